//! Algorithm 1 and the whole overlay of a frame: a logistic regression on B_hrd, ten steps
//! ahead, five sets. Each beside the same with fresh memory in every call.
//!
//! What a call may take natively: Algorithm 1, 30 µs.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use sidestep::bounds::{Algorithm1, BoundsSettings, Motion, Rollout, input_bounds};
use sidestep::features::{FeatureSet, SafetyFunctions};
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings, predict};
use sidestep::vehicle::{Pose, TurnInput};

/// Somebody who turns away from a robot that comes near.
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

/// Twenty steps of a scene.
fn history(parameters: &SceneParameters) -> Vec<JointState> {
    let start = JointState { human: Pose::new(-8.0, 0.0, 0.1), robot: Pose::new(8.0, 1.0, 3.1) };
    let next = |state: &JointState| Some(state.advance(parameters, TurnInput::Straight, 0.2));
    std::iter::successors(Some(start), next).take(21).collect()
}

fn frame(criterion: &mut Criterion) {
    let parameters = SceneParameters::default();
    let safety = SafetyFunctions::solve(&parameters, &mut |_| ControlFlow::Continue(()));
    let safety = safety.expect("the closed form");
    let predictor = predictor();
    let human = PredictedHuman::new(&predictor, &safety, &parameters).expect("three turns");
    let history = history(&parameters);
    let motion = Motion::from(&parameters);

    let mut group = criterion.benchmark_group("frame");
    group.measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(300));
    for rollout in [Rollout::Paper, Rollout::Base] {
        let settings = ShfrsSettings::paper(3).expect("three actions");
        let choice = settings.bounds.choice().clone();
        let bounds = BoundsSettings::new(settings.bounds.epsilon().to_vec(), choice, rollout, 3);
        let bounds = bounds.expect("settings");
        let mut algorithm = Algorithm1::default();
        group.bench_function(format!("Algorithm 1, {rollout:?}"), |bencher| {
            bencher.iter(|| {
                let found = algorithm.run(black_box(&history), &motion, &human, |_| 0.0, &bounds);
                found.map(|found| found.raw[9]).expect("bounds")
            });
        });
        group.bench_function(format!("Algorithm 1, {rollout:?}, fresh memory"), |bencher| {
            bencher.iter(|| {
                input_bounds(black_box(&history), &parameters, &human, |_| 0.0, &bounds)
                    .expect("bounds")
            });
        });
    }
    for by_step in [false, true] {
        let settings = ShfrsSettings { by_step, ..ShfrsSettings::paper(3).expect("three actions") };
        let shown = if by_step { "tubes and steps" } else { "tubes" };
        let mut sets = ShfrsPredictor::default();
        group.bench_function(format!("overlay, {shown}"), |bencher| {
            bencher.iter(|| {
                let found = sets.predict(black_box(&history), &parameters, &human, &settings);
                found.map(|found| found.sets[4].area_m2).expect("sets")
            });
        });
        group.bench_function(format!("overlay, {shown}, fresh memory"), |bencher| {
            bencher.iter(|| {
                predict(black_box(&history), &parameters, &human, &settings).expect("sets")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, frame);
criterion_main!(benches);
