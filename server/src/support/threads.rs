//! Long computations on separate threads.

use tokio::sync::oneshot;

/// The reason why a computation gave no result.
#[derive(Debug, thiserror::Error)]
pub enum ThreadError {
    /// The system cannot start another thread.
    #[error("cannot start a thread: {0}")]
    Start(String),
    /// The computation panicked; the panic's message is on stderr.
    #[error("the computation failed; see the message above")]
    Panicked,
}

/// Runs `work` on a thread called `name` and waits for its result. Parallel loops in `work` use
/// `threads` threads, or one per processor if `threads` is `None`.
///
/// The work is not a blocking task of the runtime, because a runtime waits for its blocking tasks
/// when it shuts down. A command must be able to end while abandoned work is still running.
///
/// # Errors
/// [`ThreadError`] if no thread can be started, or `work` panicked.
pub async fn run<T: Send + 'static>(
    name: &str,
    threads: Option<usize>,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ThreadError> {
    let pool = threads.map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build());
    let pool = pool.transpose().map_err(|error| ThreadError::Start(error.to_string()))?;
    on_a_thread(name, move || match pool {
        Some(pool) => pool.install(work),
        None => work(),
    })
    .await
}

/// Runs `work` on a thread called `name` and waits for its result. If the system has thread
/// priorities, the thread has a low priority.
///
/// # Errors
/// [`ThreadError`] if no thread can be started, or `work` panicked.
pub async fn run_in_spare_time<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ThreadError> {
    on_a_thread(name, move || {
        // On other systems this would change the priority of the whole process.
        #[cfg(target_os = "linux")]
        let _ = rustix::process::setpriority_process(None, LOW_PRIORITY);
        work()
    })
    .await
}

/// A nice value. A thread with this value gets about a tenth of a normal thread's processor time if
/// both threads need the processor.
#[cfg(target_os = "linux")]
const LOW_PRIORITY: i32 = 10;

async fn on_a_thread<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ThreadError> {
    let (answer, answered) = oneshot::channel();
    std::thread::Builder::new()
        .name(name.to_owned())
        // Sending fails only if the caller has stopped waiting.
        .spawn(move || drop(answer.send(work())))
        .map_err(|error| ThreadError::Start(error.to_string()))?;
    answered.await.map_err(|_| ThreadError::Panicked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn results_come_back_and_panics_are_errors() {
        let threads = run("test", Some(3), rayon::current_num_threads).await.unwrap();
        assert_eq!(threads, 3);
        let panicked = run("test", None, || panic!("on purpose")).await;
        assert!(matches!(panicked, Err::<(), _>(ThreadError::Panicked)));
    }
}
