//! Checks the polar solver against the closed form.

use core::f64::consts::LN_10;
use std::error::Error;

use serde::Serialize;
use serde_json::{Value, json};
use sidestep::math::{exp, sin_cos};
use sidestep::reachability::polar::Settings;
use sidestep::reachability::{Accuracy, Method, Nodes, Options, PursuitGame, Solved};
use sidestep::vehicle::VehicleModel;

use crate::errors::{Errors, random_states};
use crate::{Known, PAPER, solved};

/// Results for one game at one accuracy. Lengths are in metres.
#[derive(Clone, Serialize)]
pub(crate) struct Check {
    pub(crate) game: &'static str,
    pub(crate) accuracy: &'static str,
    /// Numbers of nodes in range, and in a full turn of each angle.
    nodes: [usize; 2],
    range_m: f64,
    sweeps: usize,
    drift_m: f64,
    /// Errors at random states (`random`) and at nodes (`at_nodes`), without the states that
    /// [`counts`] omits.
    random: Errors,
    at_nodes: Errors,
    /// Excess of the volume of {V ≤ 0} over the closed form's volume (percent).
    volume_percent: f64,
    /// For the random states: pairs of an error and the share of states with a larger error.
    #[serde(skip)]
    pub(crate) exceedance: Vec<(f64, f64)>,
}

/// Number of random states. Their ranges are at most 5 turning radii. {V = 0} extends to a range of
/// at most 3.6 turning radii.
pub(crate) const STATES: usize = 200_000;
/// States with |V| of at least this (m) are omitted from the error statistics.
const NEAR_M: f64 = 0.5;
/// States at which the pursuer can reduce the range by at most this (m) are omitted, too. At such
/// states, V = r − R, which is stored exactly and would make the quantiles look better.
const CLOSING_M: f64 = 1e-6;

pub(crate) const ACCURACIES: [(&str, Accuracy); 3] =
    [("draft", Accuracy::Draft), ("standard", Accuracy::Standard), ("fine", Accuracy::Fine)];
/// Index of the standard accuracy.
pub(crate) const STANDARD: usize = 1;

/// The converged value, computed by the polar solver.
pub(crate) fn by_polar(game: PursuitGame, accuracy: Accuracy) -> Result<Solved, Box<dyn Error>> {
    solved(game, &Options::default().with_method(Method::Polar).with_accuracy(accuracy))
}

/// The converged value at each of the three accuracies.
pub(crate) fn solutions(game: PursuitGame) -> Result<Vec<Solved>, Box<dyn Error>> {
    ACCURACIES.iter().map(|(_, accuracy)| by_polar(game, *accuracy)).collect()
}

/// Measures the errors of the polar solver's solutions of a game.
pub(crate) fn check(known: &Known, solutions: &[Solved]) -> Result<Vec<Check>, Box<dyn Error>> {
    let (game, exact) = (known.game, known.game.exact()?);
    let rho = exact.speed_mps() / exact.turn_rate_radps();
    let random = random_states(1, STATES, 5.0 * rho);
    let mut checks = Vec::new();
    for ((accuracy, _), solved) in ACCURACIES.into_iter().zip(solutions) {
        let Nodes::Polar { range_m, range_nodes, angle_nodes, .. } = solved.samples.nodes() else {
            unreachable!("the polar solver leaves polar nodes");
        };
        let error = |state: [f64; 3]| {
            let truth = exact.value(state);
            counts(&game, state, truth).then(|| (solved.function.value(state) - truth).abs())
        };
        let errors: Vec<f64> = random.iter().filter_map(|state| error(*state)).collect();
        // Errors of the stored values at the nodes.
        let [ranges, bearings, headings] = solved.samples.nodes().coordinates();
        let mut deficits = solved.samples.deficit();
        let mut at_nodes = Vec::new();
        for range in &ranges {
            for bearing in &bearings {
                let (sin, cos) = sin_cos(*bearing);
                for (heading, deficit) in headings.iter().zip(&mut deficits) {
                    let state = [range * cos, range * sin, *heading];
                    let truth = exact.value(state);
                    if counts(&game, state, truth) {
                        let value = range - game.radius_m + f64::from(deficit);
                        at_nodes.push((value - truth).abs());
                    }
                }
            }
        }
        checks.push(Check {
            game: known.name,
            accuracy,
            nodes: [range_nodes, angle_nodes],
            range_m,
            sweeps: solved.steps,
            drift_m: solved.residual,
            exceedance: exceedance(&errors),
            random: Errors::of(errors),
            at_nodes: Errors::of(at_nodes),
            volume_percent: 100.0 * (solved.samples.volume() / known.volume - 1.0),
        });
    }
    Ok(checks)
}

/// Whether a state with this value is included in the error statistics.
pub(crate) fn counts(game: &PursuitGame, state: [f64; 3], value: f64) -> bool {
    value.abs() < NEAR_M && game.target(state) - value > CLOSING_M
}

/// The share of errors above each threshold. The thresholds start at 10⁻⁵ m, with 16 per decade.
fn exceedance(errors: &[f64]) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for step in 0..=80 {
        let threshold = exp(LN_10 * (f64::from(step) / 16.0 - 5.0));
        let above = errors.iter().filter(|error| **error > threshold).count();
        if above == 0 {
            break;
        }
        points.push((threshold, above as f64 / errors.len() as f64));
    }
    points
}

/// Convergence of a long chase: number of sweeps and drift at standard accuracy, for equal speeds
/// and for a slightly faster pursuer.
pub(crate) fn chase(equal: &Solved) -> Result<Value, Box<dyn Error>> {
    let faster = VehicleModel { speed_mps: 1.05 * PAPER.pursuer.speed_mps, ..PAPER.pursuer };
    let chase = by_polar(PursuitGame { pursuer: faster, ..PAPER }, Accuracy::Standard)?;
    let of = |solved: &Solved| json!({ "sweeps": solved.steps, "drift_m": solved.residual });
    Ok(json!({
        "faster_percent": 5,
        "equal": of(equal),
        "chase": of(&chase),
        "gave_up": chase.steps >= Settings::default().most_sweeps,
    }))
}
