//! Error of a solver against the closed form.

use super::map::Map;
use super::scale::Scale;
use crate::math::TAU;
use crate::picture::Window;
use crate::reachability::{ExactValue, ValueFunction};

/// Number of columns of the grid of errors at one heading.
const COLUMNS: usize = 150;
/// Number of headings at which errors are summarised.
const HEADINGS: u32 = 24;

/// V of the solver minus V of the closed form, over a window.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    window: Window,
    /// Largest absolute error at all headings (m).
    pub greatest_m: f64,
    /// (x, y, ψ) of the largest error (m, m, rad).
    pub greatest_at: [f64; 3],
    /// Mean absolute error at all headings (m).
    pub mean_m: f64,
    scale: Scale,
}

/// The error at one heading.
#[derive(Clone, Debug, PartialEq)]
pub struct AtHeading {
    /// The picture.
    pub map: Map,
    /// Largest absolute error in the picture (m).
    pub greatest_m: f64,
    /// Mean absolute error in the picture (m).
    pub mean_m: f64,
}

impl Difference {
    /// Compares the two functions on a grid over `window` at 24 headings.
    #[must_use]
    pub fn new(solved: &ValueFunction, exact: &ExactValue, window: Window) -> Self {
        let (mut greatest_m, mut greatest_at) = (0.0, [0.0; 3]);
        let (mut sum, mut count) = (0.0, 0.0);
        for heading in 0..HEADINGS {
            let psi = f64::from(heading) * TAU / f64::from(HEADINGS);
            for at in grid(window, COLUMNS) {
                let state = [at[0], at[1], psi];
                let size = (solved.value(state) - exact.value(state)).abs();
                (sum, count) = (sum + size, count + 1.0);
                if size > greatest_m {
                    (greatest_m, greatest_at) = (size, state);
                }
            }
        }
        let scale = Scale::around_zero(greatest_m);
        Self { window, greatest_m, greatest_at, mean_m: sum / count, scale }
    }

    /// The error at the heading `psi` (rad), in a picture of this width (px). All headings use the
    /// same colour scale.
    #[must_use]
    pub fn at(
        &self,
        solved: &ValueFunction,
        exact: &ExactValue,
        psi: f64,
        width: f64,
    ) -> AtHeading {
        let error = |[x, y]: [f64; 2]| solved.value([x, y, psi]) - exact.value([x, y, psi]);
        let values: Vec<f64> = grid(self.window, COLUMNS).map(error).collect();
        let title = "V of the solver less V of the closed form";
        let map = Map::of_cells(title, &values, COLUMNS, self.window, &self.scale, width);
        let sizes = values.iter().map(|error| error.abs());
        AtHeading {
            map: map.finish("error", &self.scale),
            greatest_m: sizes.clone().fold(0.0, f64::max),
            mean_m: sizes.sum::<f64>() / values.len().max(1) as f64,
        }
    }
}

/// The cell centres of a grid with `columns` columns, row by row from the bottom.
fn grid(window: Window, columns: usize) -> impl Iterator<Item = [f64; 2]> {
    let [wide, high] = [0, 1].map(|d| window.high[d] - window.low[d]);
    let rows = ((columns as f64 * high / wide).round() as usize).max(1);
    let at = move |i: usize, count: usize, low: f64, length: f64| {
        low + length * (i as f64 + 0.5) / count as f64
    };
    (0..rows * columns).map(move |n| {
        [at(n % columns, columns, window.low[0], wide), at(n / columns, rows, window.low[1], high)]
    })
}
