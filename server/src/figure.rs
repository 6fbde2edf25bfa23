//! Figures of the command line: level sets, predicted regions, coverage against area.
//!
//! Each is a [`Drawing`], which writes itself as SVG and which [`png()`] paints with the fonts in
//! `fonts/`, so that neither needs a font on the machine.

mod design;
mod label_position;
mod pareto;
mod png;
mod regions;
mod slices;
mod tube;

use sidestep::chart::{Align, Drawing, colours};
use sidestep::reachability::ValueFunction;

pub use design::design;
pub use pareto::pareto;
pub use png::png;
pub use regions::{RegionsPanel, regions};
pub use slices::slices;
pub use tube::tube;

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw: {0}")]
pub struct DrawError(pub String);

/// Around every figure, px.
const MARGIN: f64 = 28.0;

/// What part of the plane panels show, m.
struct Window {
    x: [f64; 2],
    y: [f64; 2],
}

impl Window {
    /// The smallest one around points, of which there must be one.
    fn around(points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let widened = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        let add = |Self { x, y }, [px, py]: [f64; 2]| Self { x: widened(x, px), y: widened(y, py) };
        points.into_iter().fold(Self { x: none, y: none }, add)
    }

    fn wide(&self) -> f64 {
        self.x[1] - self.x[0]
    }

    fn high(&self) -> f64 {
        self.y[1] - self.y[0]
    }
}

/// A page with a heading and notes below it. It is as high as these, and `width` px wide between
/// its margins, or wider for long notes.
fn headed(heading: &str, notes: &[&str], width: f64) -> Drawing {
    const NOTE: f64 = 12.0;
    let widths = notes.iter().map(|note| sidestep::chart::width_of(note, NOTE, false));
    let width = widths.fold(width, f64::max) + 2.0 * MARGIN;
    let mut drawing = Drawing::new(heading, "", [width, 58.0 + 18.0 * notes.len() as f64]);
    drawing.bold(heading, [MARGIN, 34.0], 20.0, colours::TEXT, Align::Left);
    for (i, note) in notes.iter().enumerate() {
        let at = [MARGIN, 60.0 + 18.0 * i as f64];
        drawing.text(note, at, NOTE, colours::MUTED, Align::Left);
    }
    drawing
}

/// One line that says which function it is.
fn caption(function: &ValueFunction) -> String {
    let game = function.game();
    let (how, horizon) = match function {
        ValueFunction::Exact(_) => ("closed form", f64::INFINITY),
        ValueFunction::Sampled(samples) => ("solved on a grid", samples.horizon_s()),
    };
    let horizon = if horizon.is_finite() { format!("{horizon} s") } else { "∞".to_owned() };
    format!(
        "evader {} m/s, {} rad/s  ·  pursuer {} m/s, {} rad/s  ·  radius {} m  ·  horizon {horizon}  ·  {how}",
        game.evader.speed_mps,
        game.evader.turn_rate_radps,
        game.pursuer.speed_mps,
        game.pursuer.turn_rate_radps,
        game.radius_m,
    )
}
