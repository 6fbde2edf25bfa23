//! How long the solver and its functions take on one thread: the same work as a program
//! of this machine and as WebAssembly in a page. `cargo xtask bench wasm` runs both.
//!
//! The answer is a JSON list of `[name, seconds of one item]`: on standard output, or as
//! the text of the page. The fastest sample counts, which other work on the machine
//! disturbs least, and by which a browser has long replaced its first, slower code.

#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

use sidestep::features::{FeatureSet, SafetyFunctions};
use sidestep::math::{SeededRng, TAU};
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::reachability::{
    self, CurveSettings, ExactValue, Method, Options, Player, PursuitGame,
};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings};
use sidestep::vehicle::Pose;
use std::hint::black_box;
use std::ops::ControlFlow;

/// Samples of each measurement.
const SAMPLES: usize = 20;
/// What a sample takes at least, s: a browser's clock has steps of 0.1 ms.
const SAMPLE_S: f64 = 0.02;
/// Headings at which a curve is drawn.
const CURVES: usize = 24;
/// States at which functions are evaluated.
const STATES: usize = 4096;

#[cfg(not(target_arch = "wasm32"))]
fn main() {
    let start = std::time::Instant::now();
    println!("{}", measured(&|| start.elapsed().as_secs_f64()));
}

#[cfg(target_arch = "wasm32")]
fn main() {
    let window = web_sys::window().expect("a page runs this");
    let body = window.document().and_then(|document| document.body()).expect("a body");
    let page = body.clone();
    std::panic::set_hook(Box::new(move |panic| page.set_text_content(Some(&panic.to_string()))));
    let clock = window.performance().expect("a clock");
    body.set_text_content(Some(&measured(&|| clock.now() / 1000.0)));
}

/// Measures everything by `clock`, s.
fn measured(clock: &dyn Fn() -> f64) -> String {
    let player = Player { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: player, pursuer: player, radius_m: 3.0 };
    let options = Options {
        method: Some(Method::Polar),
        range_m: Some(40.0),
        threads: 1,
        ..Options::default()
    };
    let solve = || {
        let solved = reachability::solve(game, &options, &mut |_| ControlFlow::Continue(()));
        solved.expect("the problem is valid and nobody cancels")
    };
    let solved = solve();
    let exact = ExactValue::new(2.0, 0.5, 3.0).expect("the paper's parameters are valid");
    let mut rng = SeededRng::new(1);
    let mut state = || [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, TAU)];
    let states: Vec<[f64; 3]> = (0..STATES).map(|_| state()).collect();
    let mut values = vec![0.0; STATES];

    let parameters = SceneParameters::default();
    let solved_both = SafetyFunctions::solve(&parameters, &mut |_| ControlFlow::Continue(()));
    let safety = solved_both.expect("equal vehicles have a closed form");
    let predictor = predictor();
    let human = PredictedHuman::new(&predictor, &safety, &parameters).expect("three turns");
    let start = JointState { human: Pose::new(-4.0, 0.0, 0.1), robot: Pose::new(4.0, 1.0, 3.1) };
    let overlay = |by_step| {
        let settings = ShfrsSettings { by_step, ..ShfrsSettings::paper(3).expect("three actions") };
        let mut sets = ShfrsPredictor::default();
        fastest(clock, 1, || {
            let found = sets.predict(black_box(&[start]), &parameters, &human, &settings);
            black_box(found.expect("the state is finite"));
        })
    };

    let figures = [
        ("predicted sets", overlay(false)),
        ("predicted sets, by step", overlay(true)),
        (
            "polar standard solve",
            fastest(clock, 1, || {
                black_box(solve());
            }),
        ),
        (
            "level curve",
            fastest(clock, CURVES, || {
                for i in 0..CURVES {
                    let psi = black_box(TAU * (i as f64 + 0.3) / CURVES as f64);
                    let settings = CurveSettings::default();
                    black_box(solved.function.level_curves(psi, 0.0, settings));
                }
            }),
        ),
        (
            "exact value",
            fastest(clock, STATES, || {
                for state in &states {
                    black_box(exact.value(*black_box(state)));
                }
            }),
        ),
        (
            "exact values, batch",
            fastest(clock, STATES, || {
                let filled = exact.values_into(black_box(&states), &mut values);
                filled.expect("the states are finite and the lengths agree");
                black_box(&values);
            }),
        ),
        (
            "value and gradient",
            fastest(clock, STATES, || {
                for state in &states {
                    black_box(solved.samples.state(*black_box(state)));
                }
            }),
        ),
    ];
    serde_json::to_string(&figures).expect("names and numbers")
}

/// A logistic regression on B_hrd: somebody who turns away from a robot that comes near.
fn predictor() -> Predictor {
    let features = FeatureSet::subset("hrd").expect("the paper's features");
    let scale = Scale::new(vec![5.0, 2.0, 0.0, 0.0, 0.0, 2.0, 2.0, 6.0], vec![2.0; 8]);
    let right = vec![0.1, -0.4, 0.3, 0.2, -0.5, -1.1, -0.3, -0.2];
    let straight = vec![-0.3, 0.1, 0.1, -0.3, -0.1, 2.0, 0.7, 0.3];
    let left = vec![0.2, 0.3, -0.4, 0.1, 0.6, -0.9, -0.4, -0.1];
    let model = Logistic::new(8, &[right, straight, left], vec![0.1, 0.4, -0.1]);
    let (scale, model) = (scale.expect("a scale"), model.expect("a model"));
    Predictor::logistic(features, vec![-1, 0, 1], scale, model)
}

/// The fastest sample of `work`, s for each of its `items`.
fn fastest(clock: &dyn Fn() -> f64, items: usize, mut work: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..SAMPLES {
        let (begun, mut calls) = (clock(), 0);
        let took = loop {
            work();
            calls += 1;
            let took = clock() - begun;
            if took >= SAMPLE_S {
                break took;
            }
        };
        least = least.min(took / (calls * items) as f64);
    }
    least
}
