//! Regular checks of a served file.

use super::original::Original;
use crate::store::error::StoreError;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Interval between the regular checks.
const WATCH: Duration = Duration::from_millis(250);

/// One of this many checks reads the whole log, if the log was written to.
const READ_LOG: usize = 3;

/// Pause before a failed rescue is retried.
const AGAIN: Duration = Duration::from_secs(2);

/// Checks a file regularly.
#[derive(Debug)]
pub(super) struct Watch {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Starts the thread. It calls `noticed` when another process has changed the file, and then
    /// repeatedly until the data are rescued.
    pub(super) fn start(
        original: Arc<Original>,
        noticed: impl Fn() + Send + 'static,
    ) -> Result<Self, StoreError> {
        let (stop, stopped) = channel();
        let thread = std::thread::Builder::new().name("store-watch".to_owned()).spawn(move || {
            let (mut was_well, mut asked) = (true, Instant::now());
            let mut rounds = 0_usize;
            while stopped.recv_timeout(WATCH) == Err(RecvTimeoutError::Timeout) {
                rounds += 1;
                original.check_in_place();
                let found = match rounds.is_multiple_of(READ_LOG) {
                    true => original.check_all(),
                    false => original.check_with_log(),
                };
                match &found {
                    Err(error) if was_well => {
                        tracing::error!(%error, "nothing is stored any more");
                        (asked, ()) = (Instant::now(), noticed());
                    }
                    // The last rescue may have failed because the disk was full.
                    Err(_) if original.lacks_rescue() && asked.elapsed() > AGAIN => {
                        (asked, ()) = (Instant::now(), noticed());
                    }
                    Ok(()) if !was_well => {
                        tracing::info!("the database file is back");
                        original.note_rescued(None);
                    }
                    _ => {}
                }
                was_well = found.is_ok();
            }
        });
        let thread = thread.map_err(|error| StoreError::Unavailable(error.to_string()))?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
