//! The state that handlers share.

use crate::http::bounded::{Bounded, TakingTurns};
use crate::http::connections::Connections;
use crate::http::lengths::Lengths;
use crate::http::pace::{Guesses, Pace};
use crate::jobs::analysis_limits::Limits;
use crate::languages::library::Library;
use crate::observed::Observed;
use crate::secrets::chosen::ChosenKey;
use crate::store::Store;
use sidestep::api::{DataCheck, SelfCheck};
use std::sync::Arc;
use tokio::sync::{Notify, OnceCell, watch};
use tokio_util::sync::CancellationToken;

/// The cookie of the laboratory.
pub const COOKIE: &str = "sidestep_session";

/// The state that handlers share.
#[derive(Debug)]
pub struct App {
    /// The database.
    pub store: Store,
    /// The study to which `/start` redirects.
    pub default_study: String,
    /// What participants read.
    pub library: Library,
    /// The key in the environment; if there is one, it takes the place of the first key.
    pub environment_key: Option<ChosenKey>,
    /// Limits how often somebody may ask.
    pub pace: Pace,
    /// Limits guesses of keys.
    pub guesses: Guesses,
    /// Draws the scenes of plans.
    pub drawing: Bounded,
    /// Compares keys with a slow hash.
    pub hashing: TakingTurns,
    /// What `/metrics` shows.
    pub observed: Observed,
    /// The open connections.
    pub connections: Arc<Connections>,
    /// Tells the analysis worker that an analysis is queued.
    pub analysis_asked: Arc<Notify>,
    /// What an analysis may cost.
    pub analysis_limits: Limits,
    /// Tells the solver that a study has another configuration.
    pub study_stored: Arc<Notify>,
    /// The server's fingerprint, computed at the first request.
    pub self_check: OnceCell<SelfCheck>,
    /// What was found when the data were last checked.
    pub data_check: watch::Receiver<DataCheck>,
    /// Whether this server is to write backups.
    pub writes_backups: bool,
    /// The lengths of archives, for the rest of a download.
    pub lengths: Arc<Lengths>,
    /// Cancelled when the server stops, which ends the answers that have no end of their own.
    pub stopping: CancellationToken,
}
