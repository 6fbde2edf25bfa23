//! Measures the value function: a solve, curves and values.

use super::Figures;
use sidestep::math::{SeededRng, TAU};
use sidestep::reachability::{
    self, CurveSettings, ExactValue, Method, Options, PursuitGame, SolveError, Solved,
    ValueFunction,
};
use sidestep::vehicle::VehicleModel;
use std::error::Error;
use std::hint::black_box;
use std::ops::ControlFlow;

/// Number of headings at which a curve is drawn.
const CURVES: usize = 24;
/// Number of states at which functions are evaluated.
const STATES: usize = 4096;

/// The paper's vehicles.
fn paper() -> PursuitGame {
    let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 }
}

/// The paper's evader against another pursuer. This game has no closed form.
fn against(speed_mps: f64, turn_rate_radps: f64) -> PursuitGame {
    PursuitGame { pursuer: VehicleModel { speed_mps, turn_rate_radps }, ..paper() }
}

fn polar() -> Options {
    Options::default().with_method(Method::Polar).with_range(40.0).with_threads(1)
}

fn solved(game: PursuitGame, options: &Options) -> Result<Solved, SolveError> {
    reachability::solve(game, options, &mut |_| ControlFlow::Continue(()))
}

/// Measures the work of the solver's worker.
pub(crate) fn solve(figures: &mut Figures<'_>) -> Result<(), Box<dyn Error>> {
    let usual = || Options::default().with_threads(1);
    for (name, game, options) in [
        ("polar standard solve", paper(), polar()),
        ("slower, more agile pursuer", against(1.5, 0.8), usual()),
        ("slower pursuer", against(1.5, 0.5), usual()),
        ("less agile pursuer", against(2.0, 0.3), usual()),
        ("faster pursuer, no convergence", against(2.4, 0.4), usual()),
    ] {
        solved(game, &options)?;
        figures.add(name, 1, || {
            black_box(solved(game, &options).expect("it was solved before"));
        });
    }
    Ok(())
}

/// Measures the operations for which pages use a value function.
pub(crate) fn measure(figures: &mut Figures<'_>) -> Result<(), Box<dyn Error>> {
    let solved = solved(paper(), &polar())?;
    let exact = ExactValue::new(2.0, 0.5, 3.0)?;
    let mut rng = SeededRng::new(1);
    let mut state = || [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, TAU)];
    let states: Vec<[f64; 3]> = (0..STATES).map(|_| state()).collect();
    let mut values = vec![0.0; STATES];

    figures.add("level curve", CURVES, || {
        for i in 0..CURVES {
            let psi = black_box(TAU * (i as f64 + 0.3) / CURVES as f64);
            let _ = black_box(solved.function.level_curves(psi, 0.0, CurveSettings::default()));
        }
    });
    let closed = ValueFunction::Exact(exact);
    figures.add("level curve, closed form", CURVES, || {
        for i in 0..CURVES {
            let psi = black_box(TAU * (i as f64 + 0.3) / CURVES as f64);
            let _ = black_box(closed.level_curves(psi, 0.0, CurveSettings::default()));
        }
    });
    figures.add("exact value", STATES, || {
        for state in &states {
            black_box(exact.value(*black_box(state)));
        }
    });
    figures.add("exact values, batch", STATES, || {
        let filled = exact.values_into(black_box(&states), &mut values);
        filled.expect("the states are finite and the lengths agree");
        black_box(&values);
    });
    figures.add("value and gradient", STATES, || {
        for state in &states {
            black_box(solved.samples.state(*black_box(state)));
        }
    });
    Ok(())
}
