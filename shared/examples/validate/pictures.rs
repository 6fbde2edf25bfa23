//! Data for the page's figures: curves and a map.

use std::error::Error;

use serde::Serialize;
use sidestep::math::{PI, TAU, hypot};
use sidestep::reachability::{CartesianGrid, CurveSettings, Options, Solved, ValueFunction};

use crate::errors::Errors;
use crate::measure::{HORIZON_S, MITCHELL};
use crate::{PAPER, solved};

/// A closed curve in the evader's frame (m).
type Curve = Vec<[f64; 2]>;

/// {V = 0} of *mitchell* at one relative heading.
pub(crate) struct Slice {
    pub(crate) psi_deg: f64,
    pub(crate) exact: Vec<Curve>,
    /// The polar solution at standard accuracy.
    pub(crate) polar: Vec<Curve>,
    /// WENO5 on 51×40×50 nodes, T = 2.8 s.
    pub(crate) cartesian: Vec<Curve>,
    /// The point of the closed form's curve that is farthest from the evader (m).
    pub(crate) tip: [f64; 2],
}

/// |polar − closed form| for *paper* at ψ = π and standard accuracy.
#[derive(Serialize)]
pub(crate) struct ErrorMap {
    /// Errors of all cells (m). `worst` is the position of the largest error.
    errors: Errors,
    worst: [f64; 2],
    /// Centre of the cell with the smallest x and y (m). Cells are squares with a side of `cell_m`
    /// metres.
    #[serde(skip)]
    pub(crate) origin: [f64; 2],
    #[serde(skip)]
    pub(crate) cell_m: f64,
    /// Errors (m), with one row for each y.
    #[serde(skip)]
    pub(crate) rows: Vec<Vec<f64>>,
    /// {V = 0} of the closed form.
    #[serde(skip)]
    pub(crate) zero: Vec<Curve>,
}

fn fineness() -> CurveSettings {
    CurveSettings::default().with_flatness(0.002).with_spacing(0.1)
}

/// Measures how far the traced level curves of a solution are from its {V = 0}. The measure is |V|
/// (m) at the points of the curves and midway between neighbouring points, at 24 headings.
pub(crate) fn traced(solved: &Solved) -> Result<Errors, Box<dyn Error>> {
    let polar = &solved.function;
    let mut errors = Vec::new();
    for step in 0..24 {
        let psi = TAU * f64::from(step) / 24.0;
        for curve in polar.level_curves(psi, 0.0, CurveSettings::default())? {
            for (a, b) in curve.iter().zip(curve.iter().cycle().skip(1)) {
                let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                errors.extend([*a, middle].map(|[x, y]| polar.value([x, y, psi]).abs()));
            }
        }
    }
    Ok(Errors::of(errors))
}

/// Slices at three headings. `polar` is the polar solver's solution.
pub(crate) fn slices(polar: &Solved) -> Result<Vec<Slice>, Box<dyn Error>> {
    let grid = CartesianGrid::new([51, 40, 50], [-6.0, 20.0, -10.0, 10.0]);
    let options = Options::default().with_horizon(HORIZON_S).with_grid(grid);
    let cartesian = solved(MITCHELL, &options)?.function;
    let exact = ValueFunction::Exact(MITCHELL.exact()?);
    let slice = |psi_deg: f64| -> Result<Slice, Box<dyn Error>> {
        let psi = psi_deg * TAU / 360.0;
        let curves = |function: &ValueFunction| function.level_curves(psi, 0.0, fineness());
        let (exact, polar) = (curves(&exact)?, curves(&polar.function)?);
        let cartesian = curves(&cartesian)?;
        let farther = |a: [f64; 2], b: &[f64; 2]| {
            if hypot(b[0], b[1]) > hypot(a[0], a[1]) { *b } else { a }
        };
        let tip = exact.iter().flatten().fold([0.0; 2], farther);
        Ok(Slice { psi_deg, exact, polar, cartesian, tip })
    };
    [60.0, 120.0, 180.0].into_iter().map(slice).collect()
}

/// The error map of a solution of *paper*.
pub(crate) fn error_map(polar: &Solved) -> Result<ErrorMap, Box<dyn Error>> {
    let (origin, cell_m, [columns, rows]) = ([-5.95, -7.95], 0.1, [210, 160]);
    let exact = ValueFunction::Exact(PAPER.exact()?);
    let at = |i: usize, j: usize| [origin[0] + cell_m * i as f64, origin[1] + cell_m * j as f64];
    let error = |i: usize, j: usize| {
        let [x, y] = at(i, j);
        (polar.function.value([x, y, PI]) - exact.value([x, y, PI])).abs()
    };
    let rows: Vec<Vec<f64>> =
        (0..rows).map(|j| (0..columns).map(|i| error(i, j)).collect()).collect();
    let errors = rows.concat();
    let worst = (0..errors.len()).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
    let worst = at(worst % columns, worst / columns);
    let zero = exact.level_curves(PI, 0.0, fineness())?;
    Ok(ErrorMap { errors: Errors::of(errors), worst, origin, cell_m, rows, zero })
}
