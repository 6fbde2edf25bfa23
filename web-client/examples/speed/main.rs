//! How long the library takes: the same work as a program of this machine and as
//! WebAssembly in a page. `cargo xtask bench wasm` and `cargo xtask bench shfrs` run both.
//!
//! The group of measurements is the first argument, or what follows # in the page's address.
//! The answer is a JSON list of `[name, seconds of one item]`: on standard output, or as
//! the text of the page. The fastest sample counts, which other work on the machine
//! disturbs least, and by which a browser has long replaced its first, slower code.

#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

#[path = "../../../shared/examples/validate_shfrs/people.rs"]
mod people;
mod shfrs;
mod value;

use std::error::Error;

/// Samples of each measurement.
const SAMPLES: usize = 20;
/// Samples of what takes long, or of one among many alike.
const FEW: usize = 4;
/// What a sample takes at least, s: a browser's clock has steps of 0.1 ms.
const SAMPLE_S: f64 = 0.02;
/// After so long, s, few samples will do.
const LONG_S: f64 = 3.0;

#[cfg(not(target_arch = "wasm32"))]
fn main() -> Result<(), Box<dyn Error>> {
    let start = std::time::Instant::now();
    let group = std::env::args().nth(1).unwrap_or_default();
    println!("{}", measured(&group, &|| start.elapsed().as_secs_f64())?);
    Ok(())
}

#[cfg(target_arch = "wasm32")]
fn main() {
    let window = web_sys::window().expect("a page runs this");
    let body = window.document().and_then(|document| document.body()).expect("a body");
    let page = body.clone();
    std::panic::set_hook(Box::new(move |panic| page.set_text_content(Some(&panic.to_string()))));
    let clock = window.performance().expect("a clock");
    let address = window.location().hash().expect("an address");
    let answer = measured(address.trim_start_matches('#'), &|| clock.now() / 1000.0);
    body.set_text_content(Some(&answer.unwrap_or_else(|error| error.to_string())));
}

/// Measures the group by `clock`, s.
fn measured(group: &str, clock: &dyn Fn() -> f64) -> Result<String, Box<dyn Error>> {
    let mut figures = Figures { clock, seconds: Vec::new() };
    match group {
        "value" => value::measure(&mut figures)?,
        "shfrs" => shfrs::measure(&mut figures)?,
        other => return Err(format!("expected value or shfrs, found {other:?}").into()),
    }
    Ok(serde_json::to_string(&figures.seconds)?)
}

/// What was measured.
struct Figures<'a> {
    clock: &'a dyn Fn() -> f64,
    /// Names, and seconds of one item.
    seconds: Vec<(String, f64)>,
}

impl Figures<'_> {
    /// Measures `work` on so many `items` under `name`.
    fn add(&mut self, name: &str, items: usize, work: impl FnMut()) {
        let seconds = self.fastest(SAMPLES, items, work);
        self.seconds.push((name.to_owned(), seconds));
    }

    /// The fastest of so many samples of `work`, s for each of its `items`.
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
