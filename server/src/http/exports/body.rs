//! Streaming of archives. A thread writes the archive, and the response reads it.

use crate::formats::exports::{Damage, Dataset, ExportError, Format, archive};
use crate::http::lengths::Lengths;
use crate::store::Store;
use axum::body::{Body, Bytes};
use futures_util::stream;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::runtime::Handle;
use tokio::sync::mpsc;

/// Maximum time that a request waits until the size of its archive (bytes) is known. It is less than
/// the request timeout.
const MEASURING: Duration = Duration::from_secs(20);

/// Capacity of the queue between the thread and the response (chunks).
const WAITING: usize = 4;

/// An archive that can be written.
#[derive(Clone, Debug)]
pub(super) struct Outlet {
    pub(super) store: Store,
    pub(super) dataset: Dataset,
    pub(super) format: Format,
    /// The folder for a temporary database.
    pub(super) scratch: PathBuf,
    pub(super) tag: String,
}

impl Outlet {
    /// Writes the archive. Blocks the thread.
    fn write(
        &self,
        runtime: &Handle,
        out: impl Write + Send + 'static,
    ) -> Result<Damage, ExportError> {
        let Self { store, dataset, format, scratch, .. } = self;
        archive(store, dataset, *format, runtime, scratch, out)
    }
}

/// The length of an archive. Returns `None` if measuring fails, or takes longer than [`MEASURING`].
/// In the latter case, measuring continues.
pub(super) async fn measure(lengths: &Lengths, outlet: &Outlet) -> Option<u64> {
    let (length, outlet) = (lengths.of(&outlet.tag), outlet.clone());
    let measuring = tokio::spawn(async move {
        let write = || async {
            let (out, counted) = Counter::new();
            let runtime = Handle::current();
            let writing = tokio::task::spawn_blocking(move || outlet.write(&runtime, out));
            writing.await??;
            Ok::<_, ExportError>(*counted.lock().unwrap_or_else(PoisonError::into_inner))
        };
        length.get_or_try_init(write).await.copied()
    });
    match tokio::time::timeout(MEASURING, measuring).await {
        Ok(Ok(Ok(length))) => Some(length),
        Ok(Ok(Err(error))) => {
            tracing::warn!(%error, "an archive could not be measured");
            None
        }
        Ok(Err(_)) | Err(_) => None,
    }
}

/// A byte range of an archive. If the archive cannot be written to its end, the response is aborted.
pub(super) fn body(outlet: Outlet, begin: u64, end: u64, lengths: Option<Arc<Lengths>>) -> Body {
    let (sender, receiver) = mpsc::channel(WAITING);
    let runtime = Handle::current();
    tokio::task::spawn_blocking(move || {
        let (counter, counted) = Counter::new();
        let part = Part { counter, begin, end, sender: sender.clone() };
        match outlet.write(&runtime, part) {
            Ok(damage) => {
                if damage.count > 0 {
                    let (trials, first) =
                        (damage.count, damage.first.first().map(ToString::to_string));
                    tracing::error!(
                        trials,
                        first,
                        "an export has damaged trials: see 'sidestep check'"
                    );
                }
                if let Some(lengths) = lengths {
                    let length = *counted.lock().unwrap_or_else(PoisonError::into_inner);
                    // An error means that the length is already known.
                    let _ = lengths.of(&outlet.tag).set(length);
                }
                let _ = sender.blocking_send(Piece::End);
            }
            Err(ExportError::Disk(error)) if error.kind() == io::ErrorKind::BrokenPipe => {}
            Err(error) => {
                tracing::warn!(%error, "an export was interrupted");
                let _ = sender.blocking_send(Piece::Failure);
            }
        }
    });
    Body::from_stream(stream::unfold(Some(receiver), |receiver| async {
        let mut receiver = receiver?;
        match receiver.recv().await {
            Some(Piece::Bytes(bytes)) => Some((Ok(bytes), Some(receiver))),
            Some(Piece::End) => None,
            Some(Piece::Failure) | None => {
                Some((Err(io::Error::other("the export was interrupted")), None))
            }
        }
    }))
}

enum Piece {
    Bytes(Bytes),
    /// The end of the archive. Without it, the response is incomplete.
    End,
    Failure,
}

/// A writer that counts bytes.
struct Counter(Arc<Mutex<u64>>);

impl Counter {
    fn new() -> (Self, Arc<Mutex<u64>>) {
        let count = Arc::default();
        (Self(Arc::clone(&count)), count)
    }

    /// Adds to the count, and returns the previous count.
    fn add(&self, bytes: usize) -> u64 {
        let mut count = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *count += bytes as u64;
        *count - bytes as u64
    }
}

impl Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.add(bytes.len());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A writer that sends only the bytes of a range.
struct Part {
    counter: Counter,
    begin: u64,
    end: u64,
    sender: mpsc::Sender<Piece>,
}

impl Write for Part {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let at = self.counter.add(bytes.len());
        let length = bytes.len() as u64;
        let from = self.begin.saturating_sub(at).min(length) as usize;
        let to = self.end.saturating_sub(at).min(length) as usize;
        if from < to {
            let piece = Piece::Bytes(Bytes::copy_from_slice(&bytes[from..to]));
            let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
            self.sender.blocking_send(piece).map_err(gone)?;
        } else if self.sender.is_closed() {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
