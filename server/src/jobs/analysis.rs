//! Computes an analysis from a recording, for the command and for the server.

pub mod limits;
pub mod process;
pub mod worker;

use crate::support::threads::{self, ThreadError};
use sidestep::comparison::{Analysis, AnalysisError, Cache, Progress, Request, analyse};
use sidestep::dataset::GivenFeatures;
use sidestep::invalid::Invalid;
use sidestep::recording::Recording;
use sidestep::safety::SafetyLevels;
use std::ops::ControlFlow;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;

/// The input of an analysis.
pub struct AnalysisTask<C> {
    /// The tasks to compare.
    pub recording: Recording,
    /// Features that replace the computed ones.
    pub given: Option<GivenFeatures>,
    /// The safety levels of the recording's vehicles.
    pub safety: SafetyLevels,
    /// The feature sets, grids and options.
    pub request: Request,
    /// Stores fits, so that later analyses can reuse them.
    pub cache: Arc<C>,
    /// Number of threads. The default is one per processor.
    pub threads: Option<usize>,
    /// Cancels the analysis.
    pub cancel: CancellationToken,
}

/// The reason why an analysis failed.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// The request is invalid.
    #[error(transparent)]
    Request(Invalid),
    /// The data cannot be compared, or the analysis was cancelled.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    /// The computation did not finish.
    #[error(transparent)]
    Thread(#[from] ThreadError),
}

impl<C: Cache + Send + 'static> AnalysisTask<C> {
    /// Computes the analysis on separate threads and reports to `progress`.
    ///
    /// # Errors
    /// [`TaskError`] for an invalid request, data that cannot be compared, or a cancelled analysis.
    pub async fn run(
        self,
        progress: impl Fn(Progress) + Send + Sync + 'static,
    ) -> Result<Analysis, TaskError> {
        let Self { recording, given, safety, request, cache, threads, cancel } = self;
        let work = move || {
            let step = |now| {
                progress(now);
                if cancel.is_cancelled() {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            compute(recording, given.as_ref(), &safety, &request, &*cache, &step)
        };
        threads::run("analysis", threads, work).await?
    }
}

/// Computes the analysis of a recording on the threads of the caller's pool.
///
/// # Errors
/// [`TaskError`] for an invalid request or data that cannot be compared, or if `step` cancels the analysis.
pub fn compute(
    mut recording: Recording,
    given: Option<&GivenFeatures>,
    safety: &SafetyLevels,
    request: &Request,
    cache: &dyn Cache,
    step: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Analysis, TaskError> {
    let settings = request.settings().map_err(TaskError::Request)?;
    if request.synthetic {
        // Evidence in the data is stronger than the experimenter's statement, so keep the evidence.
        recording.provenance.is_mixed = false;
        let known = recording.provenance.synthetic.take();
        recording.provenance.synthetic = Some(match known {
            Some(known) => format!("{known}; the experimenter says so, too"),
            None => "the experimenter says so".to_owned(),
        });
    }
    Ok(analyse(&recording, given, safety, &settings, Some(cache), step)?)
}
