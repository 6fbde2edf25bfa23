//! What the tests compare between this machine and WebAssembly.

use std::error::Error;

use serde::Serialize;
use sidestep::comparison::learning_fingerprints;

/// Stages whose bits are compared.
#[derive(Serialize)]
pub(crate) struct Count {
    training: usize,
    inference: usize,
    features: usize,
}

pub(crate) fn count() -> Result<Count, Box<dyn Error>> {
    let all = learning_fingerprints()?;
    let of = |stage: &str| all.iter().filter(|(name, _)| name.ends_with(stage)).count();
    Ok(Count { training: of("training"), inference: of("inference"), features: of("features") })
}
