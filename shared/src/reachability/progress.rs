//! The progress, the memory limit and the errors of a solve.

use crate::invalid::Invalid;

/// The progress of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// Fraction of the steps done, from 0 to 1. If the march can end early, this is the fraction of
    /// the maximum number of steps.
    pub done: f64,
    /// Largest change of V per second at the last measurement. For the converged value of the polar
    /// method, this is the drift over [`polar::WINDOW`](super::polar::WINDOW) sweeps (m).
    pub residual: f64,
}

/// The reason why a solve has no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// The problem cannot be solved as stated.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The caller cancelled the solve.
    #[error("the solve was cancelled")]
    Cancelled,
}

/// Default memory limit of a solve: 8 GiB, or 1 GiB in a browser.
pub const MEMORY_LIMIT_BYTES: u64 = if cfg!(target_arch = "wasm32") { 1 << 30 } else { 8 << 30 };

/// Rejects a solve that needs more memory than `limit_bytes`, before any memory is allocated.
///
/// # Errors
/// [`Invalid`] with the estimated memory.
pub(super) fn check_memory(
    nodes: usize,
    arrays: usize,
    size: usize,
    limit_bytes: u64,
) -> Result<(), Invalid> {
    let needed = (nodes as u64).saturating_mul(arrays as u64).saturating_mul(size as u64);
    if needed <= limit_bytes {
        return Ok(());
    }
    let mebibytes = |bytes: u64| format!("{:.0} MiB", bytes as f64 / f64::from(1 << 20));
    // Either number can be saturated at its maximum.
    let about = if needed == u64::MAX { "more than" } else { "about" };
    let nodes = if nodes == usize::MAX { format!("more than {nodes}") } else { nodes.to_string() };
    Err(Invalid::new(
        "grid",
        format!("at most {} of memory", mebibytes(limit_bytes)),
        format!("{nodes} nodes, which need {about} {}", mebibytes(needed)),
    ))
}
