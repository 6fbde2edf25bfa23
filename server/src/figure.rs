//! Figures of the command line: level sets, predicted regions, and coverage against area.
//!
//! Each figure is a [`Drawing`](sidestep::chart::Drawing), which writes itself as SVG. [`png()`]
//! renders it with the fonts in `fonts/`. Neither format needs a font on the machine.

mod design;
mod label_position;
mod pareto;
mod png;
mod regions;
mod tube;

pub use design::design;
pub use pareto::pareto;
pub use png::png;
pub use regions::{RegionsPanel, regions};
pub use sidestep::value_view::slices;
pub use tube::tube;

use sidestep::chart::{MARGIN, headed};

/// The reason why a figure cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw: {0}")]
pub struct DrawError(pub String);

/// The part of the plane that panels show (m).
struct Window {
    x: [f64; 2],
    y: [f64; 2],
}

impl Window {
    /// The bounding box of one or more points.
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
