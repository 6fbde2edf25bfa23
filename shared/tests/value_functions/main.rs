//! Value functions of solved games: compared with the closed form and with independent solutions of
//! unequal games, and tested as the rest of the program uses them.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod finite_horizon;
mod function;
mod refusals;
mod without_horizon;

use core::ops::ControlFlow;
use sidestep::math::{PI, SeededRng, sin_cos};
use sidestep::reachability::{Method, Options, PursuitGame, SolveError, Solved, solve};
use sidestep::vehicle::VehicleModel;
use std::sync::OnceLock;

fn game(evader: [f64; 2], pursuer: [f64; 2], radius_m: f64) -> PursuitGame {
    let vehicle =
        |[speed_mps, turn_rate_radps]: [f64; 2]| VehicleModel { speed_mps, turn_rate_radps };
    PursuitGame { evader: vehicle(evader), pursuer: vehicle(pursuer), radius_m }
}

fn paper() -> PursuitGame {
    game([2.0, 0.5], [2.0, 0.5], 3.0)
}

/// The reference's unequal pair.
fn unequal() -> PursuitGame {
    game([2.0, 0.5], [1.5, 0.8], 3.0)
}

/// The game of Mitchell, Bayen and Tomlin (2005).
fn mitchell() -> PursuitGame {
    game([5.0, 1.0], [5.0, 1.0], 5.0)
}

fn solved(game: PursuitGame, options: &Options) -> Solved {
    solve(game, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn polar_of(game: PursuitGame) -> Solved {
    solved(game, &Options::default().with_method(Method::Polar))
}

fn paper_polar() -> &'static Solved {
    static SOLVED: OnceLock<Solved> = OnceLock::new();
    SOLVED.get_or_init(|| polar_of(paper()))
}

fn unequal_polar() -> &'static Solved {
    static SOLVED: OnceLock<Solved> = OnceLock::new();
    SOLVED.get_or_init(|| polar_of(unequal()))
}

fn rows(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

fn states(seed: u64, count: usize, range_m: f64) -> Vec<[f64; 3]> {
    let mut rng = SeededRng::new(seed);
    (0..count)
        .map(|_| {
            let (r, bearing) = (range_m * rng.unit(), rng.uniform(-PI, PI));
            let (sin, cos) = sin_cos(bearing);
            [r * cos, r * sin, rng.uniform(-PI, PI)]
        })
        .collect()
}

/// Errors of a solution at states where the closed form is near V = 0: (p99, largest, number).
fn errors_near_zero(solved: &Solved, states: &[[f64; 3]]) -> (f64, f64, usize) {
    let exact = solved.function.game().exact().unwrap();
    let mut errors: Vec<f64> = states
        .iter()
        .map(|state| (exact.value(*state), solved.function.value(*state)))
        .filter(|(exact, _)| exact.abs() < 0.5)
        .map(|(exact, value)| (value - exact).abs())
        .collect();
    (quantile(&mut errors, 0.99), quantile(&mut errors, 1.0), errors.len())
}

fn refused(game: PursuitGame, options: &Options) -> String {
    match solve(game, options, &mut |_| ControlFlow::Continue(())) {
        Err(SolveError::Invalid(complaint)) => complaint.to_string(),
        Err(other) => other.to_string(),
        Ok(_) => "solved".into(),
    }
}
