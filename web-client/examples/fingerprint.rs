//! Fingerprints of learning, natively or as WebAssembly: a JSON list of `[stage, SHA-256]`.
//! `tests/tests/webassembly.rs` compares both.

mod answer;

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    answer::run(|_, _| Ok(serde_json::to_string(&sidestep::comparison::learning_fingerprints()?)?))
}
