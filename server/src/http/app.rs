//! What handlers share.

use crate::http::answers::Answers;
use crate::http::bounded::Bounded;
use crate::http::throttle::Throttle;
use crate::store::Store;
use sidestep::api::SelfCheck;
use std::sync::Arc;
use tokio::sync::{Notify, OnceCell};

/// What handlers share.
#[derive(Debug)]
pub struct App {
    /// The database.
    pub store: Store,
    /// The study that `/start` leads to.
    pub default_study: String,
    /// Hash of the key that the environment gave; if there is one, only it is valid.
    pub environment_key: Option<[u8; 32]>,
    /// Against guessing of keys.
    pub throttle: Throttle,
    /// Draws the scenes of plans.
    pub drawing: Bounded,
    /// Counts for `/metrics`.
    pub answers: Answers,
    /// Tells the analysis worker that there is something in the queue.
    pub analysis_asked: Arc<Notify>,
    /// Computed when it is first asked for.
    pub self_check: OnceCell<SelfCheck>,
}
