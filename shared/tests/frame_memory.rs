//! After their first runs, Algorithm 1, the reachable sets and the picture of a frame allocate no
//! memory. The test counts the allocations of the whole process, so it runs without the test
//! harness and its threads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use core::ops::ControlFlow;
use peak_alloc::PeakAlloc;
use sidestep::bounds::{Algorithm1, Motion};
use sidestep::features::FeatureSet;
use sidestep::picture::Picture;
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::shfrs::baselines::{EmpiricalFamily, Fitted};
use sidestep::shfrs::window::Trajectory;
use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings};
use sidestep::trial_view::layers::LAYERS;
use sidestep::trial_view::view::View;
use sidestep::trial_view::{Learned, Playback, Recorded};
use sidestep::vehicle::{Pose, TurnInput};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

fn main() {
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
    let scale = Scale::new(vec![1.0; 8], vec![2.0; 8]).unwrap();
    let model = Logistic::new(8, &[vec![0.1; 8], vec![0.2; 8], vec![-0.3; 8]], vec![0.0; 3]);
    let features = FeatureSet::subset("hrd").unwrap();
    let model = Predictor::logistic(features, vec![-1, 0, 1], scale, model.unwrap());
    let human = PredictedHuman::new(&model, &safety, &parameters).unwrap();
    let settings = ShfrsSettings::paper(3).unwrap().with_by_step(true);
    let motion = Motion::from(&parameters);
    let start = JointState { human: Pose::new(-8.0, 0.0, 0.1), robot: Pose::new(8.0, 1.0, 3.1) };
    let next = |state: &JointState| Some(state.advance(&parameters, TurnInput::Left, 0.0, 0.2));
    let trial: Vec<JointState> = std::iter::successors(Some(start), next).take(51).collect();
    let mut algorithm = Algorithm1::default();
    silent(|length| {
        let history = &trial[..length];
        let found = algorithm.run(history, &motion, &human, |_| 0.0, &settings.bounds);
        assert_eq!(found.unwrap().sets.len(), 5);
    });
    let mut predictor = ShfrsPredictor::default();
    silent(|length| {
        let found = predictor.predict(&trial[..length], &parameters, &human, &settings);
        assert_eq!(found.unwrap().sets[4].steps.len(), 10);
    });
    let recorded = Recorded {
        parameters,
        scene: Scene::new(&parameters, start.human, start.robot),
        inputs: vec![TurnInput::Left; trial.len() - 1],
        states: trial.clone(),
    };
    for colours in ["paper", "safe"] {
        let mut playback = Playback::new(recorded.clone()).unwrap();
        playback.use_safety(safety.clone()).unwrap();
        let learned = Learned { predictor: model.clone(), settings: settings.clone() };
        playback.use_learned(Some(learned)).unwrap();
        let mut view = View { shown: [true; LAYERS.len()], ..View::default() };
        view.set("colours", colours).unwrap();
        let (mut picture, mut shown) = (Picture::default(), Picture::default());
        silent(|length| {
            // Some of these times are between steps.
            view.time_s = 0.17 * length as f64;
            playback.go(&view).unwrap();
            picture.begin("canvas", playback.window());
            picture.tell("data-step", playback.now().step);
            playback.paint(&view, &mut picture);
            shown.copy(&picture);
        });
    }
    let inputs: Vec<TurnInput> = (0..50).map(|step| TurnInput::ALL[step / 5 % 3]).collect();
    let driven = Trajectory::driven(trial.clone(), &inputs, &parameters).unwrap();
    for family in [EmpiricalFamily::Empirical, EmpiricalFamily::Gaussian] {
        let training = core::slice::from_ref(&driven);
        let mut sets = Fitted::learn(family, &parameters, training, 10).unwrap().sets;
        silent(|length| {
            sets.place(trial[length - 1].human, TurnInput::ALL[length % 3]);
            assert_eq!(sets.sets()[4].steps.len(), 10);
        });
    }
}

/// First shows every frame of the trial twice, because the rear envelope swaps two lists, and each
/// list must grow to the size of the largest frame. After that, it shows all frames again, forward
/// and backward as a user does with a slider. This must allocate nothing.
fn silent(mut frame: impl FnMut(usize)) {
    (1..=51).chain(1..=51).for_each(&mut frame);
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    assert!(before > 0, "is anything counted?");
    (1..=51).chain((1..=51).rev()).for_each(frame);
    assert_eq!(MEMORY.peak_usage(), before);
}
