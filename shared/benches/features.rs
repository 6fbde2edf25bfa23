//! Features of a million steps (20,000 trials of 50 steps): `cargo xtask bench features`.
//!
//! The baseline computes the features state by state on one thread. The budget is 1 s for all
//! features on two threads, and 1 s for the paper's features on one thread.

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, SamplingMode};
use fastest::Fastest;
use rayon::{ThreadPool, ThreadPoolBuilder};
use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::math::{PI, SeededRng};
use sidestep::reachability::{Method, Options, solve};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, JointState, SceneParameters};
use sidestep::vehicle::{Pose, TurnInput};

mod fastest;

const TRIALS: usize = 20_000;
const STEPS: usize = 50;

/// Pairs of a measurement and its baseline.
const RATIOS: &[(&str, &str)] = &[
    ("features/paper's, 1 thread", "features/state by state"),
    ("features/paper's, 2 threads", "features/paper's, 1 thread"),
    ("features/all, 1 thread", "features/state by state"),
    ("features/all, 2 threads", "features/all, 1 thread"),
    ("features/sampled, 1 thread", "features/paper's, 1 thread"),
    ("features/sampled, 2 threads", "features/sampled, 1 thread"),
];

/// Budgets per step (s).
const BUDGETS: &[(&str, f64)] = &[
    ("features/paper's, 1 thread", 1e-6),
    ("features/all, 2 threads", 1e-6),
    ("features/sampled, 1 thread", 1e-6),
];

/// The inputs and states of a trial.
type Trial = (Vec<TurnInput>, Vec<JointState>);

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut fastest = Fastest::default();
    let parameters = SceneParameters::default();
    let trials = trials(&parameters);
    let exact = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))
        .expect("the closed form");
    let sampled = sampled(&parameters);
    let all = FeatureSet::all();
    let papers = FeatureSet::subset("hrd").expect("the paper's letters");
    let threads = [1, 2]
        .map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().expect("threads"));

    let mut group = criterion.benchmark_group("features");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    let mut measure = |name, work: &mut dyn FnMut()| {
        fastest.measure(&mut group, name, TRIALS * STEPS, work);
    };
    measure("features/state by state", &mut || state_by_state(&papers, &exact, &trials));
    let [one, two] = &threads;
    for (name, pool, set, safety) in [
        ("features/paper's, 1 thread", one, &papers, &exact),
        ("features/paper's, 2 threads", two, &papers, &exact),
        ("features/all, 1 thread", one, &all, &exact),
        ("features/all, 2 threads", two, &all, &exact),
        ("features/sampled, 1 thread", one, &papers, &sampled),
        ("features/sampled, 2 threads", two, &papers, &sampled),
    ] {
        measure(name, &mut || datasets(pool, set, safety, &trials));
    }
    group.finish();
    criterion.final_summary();
    fastest.print_ratios(RATIOS, BUDGETS);
}

/// Trials with random inputs. The vehicles start within 20 m of each other.
fn trials(parameters: &SceneParameters) -> Vec<Trial> {
    let mut rng = SeededRng::new(7);
    let mut trial = || {
        let mut pose =
            || Pose::new(rng.uniform(-7., 7.), rng.uniform(-7., 7.), rng.uniform(-PI, PI));
        let mut states = vec![JointState { human: pose(), robot: pose() }];
        let input = |_| TurnInput::ALL[(3.0 * rng.unit()) as usize % 3];
        let inputs: Vec<TurnInput> = (0..STEPS).map(input).collect();
        for &input in &inputs {
            states.push(states[states.len() - 1].advance(parameters, input, 0.0, 0.2));
        }
        (inputs, states)
    };
    (0..TRIALS).map(|_| trial()).collect()
}

/// Safety levels of a game that has a closed form, but solved with the polar method and
/// interpolated between its nodes.
fn sampled(parameters: &SceneParameters) -> SafetyLevels {
    let options = Options::default().with_method(Method::Polar);
    let game = parameters.game(Evader::Human);
    let solved = solve(game, &options, &mut |_| ControlFlow::Continue(()));
    let function = solved.expect("a game that can be solved").function;
    SafetyLevels { human: function.clone(), robot: function }
}

fn state_by_state(set: &FeatureSet, safety: &SafetyLevels, trials: &[Trial]) {
    let mut row = vec![0.0; set.len()];
    for (inputs, states) in trials {
        for step in 0..inputs.len() {
            set.compute_into(&states[..=step], safety, &mut row);
            black_box(&row);
        }
    }
}

fn datasets(pool: &ThreadPool, set: &FeatureSet, safety: &SafetyLevels, trials: &[Trial]) {
    pool.install(|| {
        let trials = trials.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
        black_box(Dataset::from_trials(set, safety, trials));
    });
}
