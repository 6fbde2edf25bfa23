//! The child's side of long work in a child process.
//!
//! The child has a low priority and a memory limit. It reads its task from stdin and writes its
//! results to stdout. It does not get the experimenter's key. It receives the database's address
//! only for a check. The child exits when stdin closes, because the server has then ended.

mod analysis;
mod check;

use super::frames::{self, FromChild, ToChild};
use rustix::process::{Resource, Rlimit, setpriority_process, setrlimit};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, SceneParameters};
use std::io;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// Runs the task that the server sends.
///
/// # Errors
/// If the memory limit cannot be set, the threads cannot be started, or the server has ended.
pub fn run(memory_mib: u64, threads: usize, nice: i32) -> io::Result<()> {
    // Do this before any other thread starts, because threads inherit the priority.
    restrain(memory_mib, nice)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(io::Error::other)?;
    let mut orders = io::stdin().lock();
    let server = Server::default();
    match frames::read(&mut orders)? {
        (ToChild::Solve(scene), _) => {
            drop(orders);
            end_with_stdin(|_, _| ());
            pool.install(|| solve(&server, &scene))
        }
        (ToChild::Check { folder, database, backup }, _) => {
            drop(orders);
            std::env::set_current_dir(folder)?;
            end_with_stdin(|_, _| ());
            check::run(&server, &database, backup.as_deref())
        }
        (ToChild::Analyse { request, study, scene, human }, functions) => {
            let task =
                analysis::Task::read(&mut orders, *request, &study, scene, human, &functions);
            let task = task?;
            drop(orders);
            pool.install(|| task.run(&server))
        }
        (other, _) => Err(io::Error::other(format!("expected a task, found {other:?}"))),
    }
}

/// Lowers the CPU priority, and limits the memory.
fn restrain(memory_mib: u64, nice: i32) -> io::Result<()> {
    // If the priority cannot be changed, continue with the present priority.
    let _ = setpriority_process(None, nice);
    // If the system runs out of memory, it should kill this process first.
    let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
    // Limit data rather than address space. Threads reserve far more address space than they use.
    let most = Some(memory_mib.saturating_mul(1 << 20));
    setrlimit(Resource::Data, Rlimit { current: most, maximum: most })?;
    Ok(())
}

/// Starts a thread that calls `hear` with each further message from the server. When the server has
/// ended, the thread exits this process.
fn end_with_stdin(mut hear: impl FnMut(ToChild, Vec<u8>) + Send + 'static) {
    std::thread::spawn(move || {
        let mut orders = io::stdin().lock();
        while let Ok((message, beside)) = frames::read(&mut orders) {
            hear(message, beside);
        }
        std::process::exit(1);
    });
}

/// The connection to the server, through stdout.
#[derive(Default)]
struct Server(Mutex<()>);

impl Server {
    /// Sends a message to the server, from any thread.
    fn tell(&self, message: &FromChild, beside: &[u8]) -> io::Result<()> {
        let _turn = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        frames::write(&mut io::stdout().lock(), message, beside)
    }
}

fn solve(server: &Server, scene: &SceneParameters) -> io::Result<()> {
    match SafetyLevels::solve(scene, &mut |_| ControlFlow::Continue(())) {
        Ok(functions) => {
            let [human, robot] = Evader::ALL.map(|evader| functions.of(evader).encode());
            let complaints = functions.complaints();
            let solved = FromChild::Solved { human: human.len(), complaints };
            server.tell(&solved, &[human, robot].concat())
        }
        Err(error) => server.tell(&FromChild::Failed(error.to_string()), &[]),
    }
}
