//! Killing the server while people upload, and looking for what it acknowledged.

use std::collections::HashMap;
use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sidestep::math::SeededRng;
use sidestep::scene::Scene;
use sidestep_server::content::Content;
use sidestep_server::store::{Missing, Store};
use sidestep_tests::{Folder, Process, driven};

use crate::figures::Milliseconds;
use crate::load::Load;

/// Starts the server and kills it in the middle of uploads, `kills` times. Returns the number of
/// uploads that were acknowledged, and how long the server took each time until it was ready.
pub(crate) async fn kill(
    load: &Rc<Load>,
    folder: &Folder,
    kills: u32,
    connections: usize,
) -> (usize, Milliseconds) {
    let (mut acknowledged, mut ready) = (0, Milliseconds::default());
    let mut rng = SeededRng::new(1);
    load.mortal.set(true);
    for _ in 0..kills {
        let begin = Instant::now();
        let server = Process::start(folder).await;
        ready.push(1e3 * begin.elapsed().as_secs_f64());
        load.serve_from(&server);
        if load.waiting() < 2 * connections {
            load.enrol(2 * connections, connections, 5.0).await;
        }
        let alive_s = rng.uniform(0.2, 0.7);
        let death = async {
            tokio::time::sleep(Duration::from_secs_f64(alive_s)).await;
            server.kill().await;
        };
        let ((), (count, _)) = tokio::join!(death, load.upload(connections, 2.0 * alive_s));
        acknowledged += count;
    }
    (acknowledged, ready)
}

/// What came of the comparison with the database.
#[derive(Default)]
pub(crate) struct Comparison {
    pub(crate) acknowledged: usize,
    /// Acknowledged, and not there.
    pub(crate) missing: usize,
    /// Acknowledged, and there with another content.
    pub(crate) different: usize,
    /// There, though no answer said so: the server was killed between commit and answer.
    pub(crate) unacknowledged: usize,
}

/// Compares every trial that the server acknowledged with its row.
pub(crate) async fn compare(load: &Load, folder: &Folder) -> Comparison {
    let store = Store::open(&folder.database("sidestep.db"), Missing::Refuse).await;
    let store = store.expect("the database");
    let mut found = Comparison::default();
    for participant in load.everybody() {
        let mut expected: HashMap<_, _> = participant.acknowledged().iter().cloned().collect();
        found.acknowledged += expected.len();
        for trial in store.trials_of(&participant.id).await.expect("trials") {
            match expected.remove(&trial.head.trial_id) {
                Some(scene) => found.different += usize::from(!is_as_sent(&trial.content, &scene)),
                None => found.unacknowledged += 1,
            }
        }
        found.missing += expected.len();
    }
    store.close().await;
    found
}

/// Whether a trial is stored as it was sent.
fn is_as_sent(stored: &Content, scene: &Scene) -> bool {
    let sent = driven(scene);
    let is = |text: &str, sent: Value| serde_json::from_str::<Value>(text).is_ok_and(|v| v == sent);
    stored.started_at_ms == Some(sent.started_at_ms)
        && stored.inputs == sent.inputs
        && stored.states == sent.states
        && stored.sampled_at_ms() == sent.sampled_at_ms
        && is(&stored.key_events, json!(sent.key_events))
        && is(&stored.display, json!(sent.display))
}
