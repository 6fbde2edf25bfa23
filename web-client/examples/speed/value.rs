//! The value function: a solve, curves and values.

use super::Figures;
use sidestep::math::{SeededRng, TAU};
use sidestep::reachability::{
    self, CurveSettings, ExactValue, Method, Options, PursuitGame, ValueFunction,
};
use sidestep::vehicle::VehicleModel;
use std::error::Error;
use std::hint::black_box;
use std::ops::ControlFlow;

/// Headings at which a curve is drawn.
const CURVES: usize = 24;
/// States at which functions are evaluated.
const STATES: usize = 4096;

pub(crate) fn measure(figures: &mut Figures<'_>) -> Result<(), Box<dyn Error>> {
    let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 };
    let options = Options {
        method: Some(Method::Polar),
        range_m: Some(40.0),
        threads: 1,
        ..Options::default()
    };
    let solve = || reachability::solve(game, &options, &mut |_| ControlFlow::Continue(()));
    let solved = solve()?;
    let exact = ExactValue::new(2.0, 0.5, 3.0)?;
    let mut rng = SeededRng::new(1);
    let mut state = || [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, TAU)];
    let states: Vec<[f64; 3]> = (0..STATES).map(|_| state()).collect();
    let mut values = vec![0.0; STATES];

    figures.add("polar standard solve", 1, || {
        black_box(solve().expect("it was solved before"));
    });
    let unlike = PursuitGame {
        pursuer: VehicleModel { speed_mps: 2.4, turn_rate_radps: 0.4 },
        radius_m: 2.5,
        ..game
    };
    let options = Options { threads: 1, ..Options::default() };
    let solve = || reachability::solve(unlike, &options, &mut |_| ControlFlow::Continue(()));
    figures.add("standard solve, unlike vehicles", 1, || {
        black_box(solve().expect("the game is valid"));
    });
    figures.add("level curve", CURVES, || {
        for i in 0..CURVES {
            let psi = black_box(TAU * (i as f64 + 0.3) / CURVES as f64);
            black_box(solved.function.level_curves(psi, 0.0, CurveSettings::default()));
        }
    });
    let closed = ValueFunction::Exact(exact);
    figures.add("level curve, closed form", CURVES, || {
        for i in 0..CURVES {
            let psi = black_box(TAU * (i as f64 + 0.3) / CURVES as f64);
            black_box(closed.level_curves(psi, 0.0, CurveSettings::default()));
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
