//! Measures how long the library takes for the same work in a native program and as WebAssembly in
//! a page. `cargo xtask bench wasm`, `shfrs` and `playback` run both programs.
//!
//! The argument selects a group of measurements. The output is a JSON list of `[name, seconds of
//! one item]`. Only the fastest sample counts. Other work on the machine disturbs it least, and by
//! the time it runs, the browser has replaced its slower baseline code.

#[path = "../answer/mod.rs"]
mod answer;
#[path = "../../../shared/tests/library/recorded/mod.rs"]
mod recorded;
mod playback;
mod shfrs;
mod value;

use std::error::Error;

/// Number of samples of each measurement.
const SAMPLES: usize = 20;
/// Number of samples of slow work, or of one case among many similar ones.
const FEW: usize = 4;
/// Shortest duration of a sample (s). A browser's clock has a resolution of only 0.1 ms.
const SAMPLE_S: f64 = 0.02;
/// After this time (s), a measurement ends if it has at least [`FEW`] samples.
const LONG_S: f64 = 3.0;

fn main() -> Result<(), Box<dyn Error>> {
    answer::run(measured)
}

/// Measures a group. `clock` returns the time (s).
fn measured(group: &str, clock: &dyn Fn() -> f64) -> Result<String, Box<dyn Error>> {
    let mut figures = Figures { clock, seconds: Vec::new() };
    match group {
        "solve" => value::solve(&mut figures)?,
        "value" => value::measure(&mut figures)?,
        "shfrs" => shfrs::measure(&mut figures)?,
        "evaluation" => shfrs::evaluate(&mut figures)?,
        "playback" => playback::measure(&mut figures)?,
        other => return Err(format!("unknown group {other:?}").into()),
    }
    Ok(serde_json::to_string(&figures.seconds)?)
}

/// Measurements so far.
struct Figures<'a> {
    clock: &'a dyn Fn() -> f64,
    /// The name and the time per item (s) of each measurement.
    seconds: Vec<(String, f64)>,
}

impl Figures<'_> {
    /// Measures `work` on `items` items and records it under `name`.
    fn add(&mut self, name: &str, items: usize, work: impl FnMut()) {
        let seconds = self.fastest(SAMPLES, items, work);
        self.seconds.push((name.to_owned(), seconds));
    }

    /// The time per item (s) in the fastest of at most `samples` samples of `work`.
    fn fastest(&self, samples: usize, items: usize, mut work: impl FnMut()) -> f64 {
        let (mut least, begun) = (f64::INFINITY, (self.clock)());
        for sample in 0..samples {
            if sample >= FEW && (self.clock)() - begun > LONG_S {
                break;
            }
            let (begun, mut calls) = ((self.clock)(), 0);
            let took = loop {
                work();
                calls += 1;
                let took = (self.clock)() - begun;
                if took >= SAMPLE_S {
                    break took;
                }
            };
            least = least.min(took / (calls * items) as f64);
        }
        least
    }
}
