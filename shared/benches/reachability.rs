//! The closed form, both solvers, interpolation and level curves, with baselines and budgets:
//! `cargo xtask bench reachability`.
//!
//! Criterion reports every measurement with its spread. The table at the end shows the fastest
//! sample of each measurement, which other load on the machine disturbs least.

mod fastest;

use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Duration;

use criterion::{Criterion, SamplingMode, Throughput};
use fastest::Fastest;
use sidestep::math::{SeededRng, TAU};
use sidestep::reachability::cartesian::{Problem, Settings, solve};
use sidestep::reachability::{
    self, Axis, CurveSettings, ExactValue, Grid, Method, Options, PursuitGame, RelativeDubins,
    Scheme, ValueFunction,
};
use sidestep::vehicle::VehicleModel;

/// Pairs of a measurement and its baseline. A ratio above 1 means that the measurement is faster
/// than its baseline.
const RATIOS: &[(&str, &str)] = &[
    ("sampled/value and gradient", "exact/scalar"),
    ("sampled/level curve", "exact/level curve"),
    ("polar/standard, 1 thread", "cartesian/weno5, 1 thread"),
    ("exact/batch, 1 thread", "exact/scalar"),
    ("exact/batch, all threads", "exact/scalar"),
    ("exact/batch, all threads", "exact/batch, 1 thread"),
    ("cartesian/eno2, 2 threads", "cartesian/eno2, 1 thread"),
    ("cartesian/weno5, 2 threads", "cartesian/weno5, 1 thread"),
];

/// Budgets per item (s).
const BUDGETS: &[(&str, f64)] = &[
    ("exact/scalar", 100e-9),
    ("exact/batch, all threads", 50e-9),
    ("sampled/value and gradient", 60e-9),
    ("polar/standard, 1 thread", 0.1),
];

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut fastest = Fastest::default();
    exact(&mut criterion, &mut fastest);
    sampled(&mut criterion, &mut fastest);
    cartesian(&mut criterion, &mut fastest);
    criterion.final_summary();
    fastest.print_ratios(RATIOS, BUDGETS);
}

/// The closed form at every node of a 61×61×48 grid.
fn exact(criterion: &mut Criterion, fastest: &mut Fastest) {
    let game = ExactValue::new(2.0, 0.5, 3.0).expect("the paper's parameters are valid");
    let [x, y] = [Axis::bounded(-30.0, 30.0, 61); 2];
    let grid = Grid { axes: [x, y, Axis::periodic(0.0, TAU, 48)] };
    let states: Vec<_> = (0..grid.len()).map(|i| grid.node(grid.index(i))).collect();
    let mut out = vec![0.0; states.len()];

    let mut group = criterion.benchmark_group("exact");
    group.sample_size(20).throughput(Throughput::Elements(states.len() as u64));
    fastest.measure(&mut group, "exact/scalar", states.len(), || {
        for state in &states {
            black_box(game.value(*black_box(state)));
        }
    });
    let function = ValueFunction::Exact(game);
    fastest.measure(&mut group, "exact/level curve", CURVES, || curves(&function));
    fastest.measure(&mut group, "exact/batch, 1 thread", states.len(), || {
        let done = game.values_into(black_box(&states), &mut out);
        done.expect("the states are finite and the lengths agree");
        black_box(&out);
    });
    fastest.measure(&mut group, "exact/batch, all threads", states.len(), || {
        let done = game.parallel_values_into(black_box(&states), &mut out);
        done.expect("the states are finite and the lengths agree");
        black_box(&out);
    });
    group.finish();
}

/// Number of headings at which level curves are traced.
const CURVES: usize = 24;

fn curves(function: &ValueFunction) {
    for i in 0..CURVES {
        let psi = TAU * (i as f64 + 0.3) / CURVES as f64;
        let settings = CurveSettings::default();
        let _ = black_box(function.level_curves(black_box(psi), 0.0, settings));
    }
}

/// Measures the polar solver on the paper's game up to a range of 40 m. Also measures interpolation
/// and level curves of its solution.
fn sampled(criterion: &mut Criterion, fastest: &mut Fastest) {
    let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 };
    let options = Options::default().with_method(Method::Polar).with_range(40.0);
    let solve = || {
        let solved = reachability::solve(game, &options, &mut |_| ControlFlow::Continue(()));
        solved.expect("the problem is valid and nobody cancels")
    };
    let mut group = criterion.benchmark_group("polar");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    fastest.measure(&mut group, "polar/standard, 1 thread", 1, || {
        black_box(solve());
    });
    group.finish();

    let solved = solve();
    let mut rng = SeededRng::new(1);
    let states: Vec<[f64; 3]> = (0..4096)
        .map(|_| [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, TAU)])
        .collect();
    let mut group = criterion.benchmark_group("sampled");
    fastest.measure(&mut group, "sampled/value and gradient", states.len(), || {
        for state in &states {
            black_box(solved.samples.state(*black_box(state)));
        }
    });
    fastest.measure(&mut group, "sampled/level curve", CURVES, || curves(&solved.function));
    group.finish();
}

/// Mitchell's game on 51×40×50 nodes over 2.8 s.
fn cartesian(criterion: &mut Criterion, fastest: &mut Fastest) {
    let vehicle = VehicleModel { speed_mps: 5.0, turn_rate_radps: 1.0 };
    let game = PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 5.0 };
    let target = |state| game.target(state);
    let game = RelativeDubins(game);
    let axes = [
        Axis::bounded(-6.0, 20.0, 51),
        Axis::bounded(-10.0, 10.0, 40),
        Axis::periodic(0.0, TAU, 50),
    ];
    let problem = Problem::reach(&game, Grid { axes }, &target, 2.8);

    let mut group = criterion.benchmark_group("cartesian");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(500));
    for (name, scheme, threads) in [
        ("cartesian/eno2, 1 thread", Scheme::Eno2, 1),
        ("cartesian/eno2, 2 threads", Scheme::Eno2, 2),
        ("cartesian/weno5, 1 thread", Scheme::Weno5, 1),
        ("cartesian/weno5, 2 threads", Scheme::Weno5, 2),
    ] {
        let settings = Settings::new(scheme).with_threads(threads).with_cfl(0.75);
        fastest.measure(&mut group, name, 1, || {
            let solution =
                solve::<f32, 3, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()));
            black_box(solution.expect("the problem is valid and nobody cancels"));
        });
    }
    group.finish();
}
