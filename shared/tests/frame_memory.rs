//! Algorithm 1 takes no memory once it has run. A binary of its own, since it counts what
//! the whole process allocates.

use core::ops::ControlFlow;
use peak_alloc::PeakAlloc;
use sidestep::bounds::{Algorithm1, Motion};
use sidestep::features::{FeatureSet, SafetyFunctions};
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::{PredictedHuman, ShfrsSettings};
use sidestep::vehicle::{Pose, TurnInput};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

#[test]
fn a_frame_of_algorithm_1_allocates_nothing() {
    let parameters = SceneParameters::default();
    let safety = SafetyFunctions::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
    let scale = Scale::new(vec![1.0; 8], vec![2.0; 8]).unwrap();
    let model = Logistic::new(8, &[vec![0.1; 8], vec![0.2; 8], vec![-0.3; 8]], vec![0.0; 3]);
    let features = FeatureSet::subset("hrd").unwrap();
    let predictor = Predictor::logistic(features, vec![-1, 0, 1], scale, model.unwrap());
    let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
    let settings = ShfrsSettings::paper(3).unwrap().bounds;
    let motion = Motion::from(&parameters);
    let start = JointState { human: Pose::new(-8.0, 0.0, 0.1), robot: Pose::new(8.0, 1.0, 3.1) };
    let next = |state: &JointState| Some(state.advance(&parameters, TurnInput::Left, 0.2));
    let trial: Vec<JointState> = std::iter::successors(Some(start), next).take(51).collect();
    let mut algorithm = Algorithm1::default();
    let mut run = |length: usize| {
        let found = algorithm.run(&trial[..length], &motion, &human, |_| 0.0, &settings);
        assert_eq!(found.unwrap().sets.len(), 5);
    };
    run(51);
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    assert!(before > 0, "is anything counted?");
    // Every frame of the trial, forth and back, as a slider would.
    (1..=51).chain((1..=51).rev()).for_each(run);
    assert_eq!(MEMORY.peak_usage(), before);
}
