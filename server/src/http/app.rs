//! The state that handlers share.

use crate::http::bounded::{Bounded, TakingTurns};
use crate::http::connections::Connections;
use crate::http::lengths::Lengths;
use crate::http::pace::{Guesses, Pace};
use crate::jobs::analysis::limits::Limits;
use crate::languages::library::Library;
use crate::metrics::Metrics;
use crate::store::Store;
use crate::support::secrets::chosen::ChosenKey;
use sidestep::api::{DataCheck, SelfCheck};
use std::sync::Arc;
use tokio::sync::{Notify, OnceCell, watch};
use tokio_util::sync::CancellationToken;

/// Name of the laboratory's session cookie.
pub const COOKIE: &str = "sidestep_session";

/// The state that handlers share.
#[derive(Debug)]
pub struct App {
    /// The database.
    pub store: Store,
    /// The study to which `/start` redirects.
    pub default_study: String,
    /// The texts for participants.
    pub library: Library,
    /// The key in the environment variable, if set. It replaces the first key, which the server
    /// creates at its first start.
    pub environment_key: Option<ChosenKey>,
    /// Rate limits of requests and enrolments.
    pub pace: Pace,
    /// Rate limits for wrong keys.
    pub guesses: Guesses,
    /// Runs the jobs that draw the scenes of plans.
    pub drawing: Bounded,
    /// Runs the jobs that compare keys with a slow hash.
    pub hashing: TakingTurns,
    /// Metrics for `/metrics`.
    pub metrics: Metrics,
    /// The open connections.
    pub connections: Arc<Connections>,
    /// Notifies the analysis worker that an analysis is queued.
    pub analysis_asked: Arc<Notify>,
    /// Upper bounds on the cost of an analysis.
    pub analysis_limits: Limits,
    /// Notifies the solver that a study has a new configuration.
    pub study_stored: Arc<Notify>,
    /// The server's fingerprint, computed at the first request.
    pub self_check: OnceCell<SelfCheck>,
    /// The result of the last data check.
    pub data_check: watch::Receiver<DataCheck>,
    /// Whether this server writes backups.
    pub writes_backups: bool,
    /// The lengths of archives, for resuming downloads.
    pub lengths: Arc<Lengths>,
    /// Cancelled when the server stops, so that endless responses end.
    pub stopping: CancellationToken,
}
