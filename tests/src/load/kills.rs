//! Kills servers while people upload.

use super::Crowd;
use super::crowd::Pace;
use super::figures::Latencies;
use crate::{Database, Folder, Process};
use sidestep::math::SeededRng;
use std::rc::Rc;
use std::time::Instant;

/// Timeout for the uploads between two kills (s).
const PATIENCE_S: f64 = 60.0;

/// Number of kills and their times.
#[derive(Clone, Copy, Debug)]
pub struct Kills {
    /// Number of kills.
    pub count: u32,
    /// Upper bound on the number of acknowledged uploads between a start and the next kill.
    pub most_between: usize,
    /// Number of connections that upload.
    pub connections: usize,
    /// Seed of the random choices: the number of uploads before each kill, and which server is
    /// killed.
    pub seed: u64,
}

/// Starts a server in each folder. All servers use the same database. Repeatedly kills one of the
/// servers (SIGKILL) during uploads, while the other servers continue. Returns how long each server
/// took to become ready. At the end all servers are killed.
///
/// # Panics
/// If a server does not start.
pub async fn kill(
    crowd: &Rc<Crowd>,
    folders: &[Folder],
    database: &Database,
    kills: Kills,
) -> Latencies {
    let mut ready = Latencies::default();
    let mut rng = SeededRng::new(kills.seed);
    let mut servers: Vec<Option<Process>> = folders.iter().map(|_| None).collect();
    crowd.mortal.set(true);
    for _ in 0..kills.count {
        for (server, folder) in servers.iter_mut().zip(folders) {
            if server.is_none() {
                let begin = Instant::now();
                *server = Some(Process::start_on(folder, database).await);
                ready.note(begin.elapsed());
            }
        }
        crowd.serve_from(&servers.iter().flatten().map(|server| &**server).collect::<Vec<_>>());
        if crowd.waiting() < 2 * kills.connections {
            crowd.enrol(2 * kills.connections, kills.connections, 30.0).await;
        }
        let enough = crowd.acknowledged() + rng.below(kills.most_between);
        let victim = servers[rng.below(folders.len())].take();
        let survivors = folders.len() - 1;
        let death = async {
            crowd.until_acknowledged(enough).await;
            if let Some(victim) = victim {
                victim.kill().await;
            }
            if survivors > 0 {
                crowd.until_acknowledged(crowd.acknowledged() + kills.connections).await;
            }
            crowd.stop();
        };
        tokio::join!(crowd.upload(kills.connections, PATIENCE_S, Pace::Fast), death);
    }
    ready
}
