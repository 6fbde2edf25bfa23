//! After their first runs, an online predictor and its clearances allocate nothing. The test counts
//! allocations of the whole process. Therefore it runs without the test harness and its threads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(clippy::print_stdout, reason = "how much was touched is worth reading")]

use core::ops::ControlFlow;
use peak_alloc::PeakAlloc;
use sidestep::clearance::{Footprint, OnlinePredictor, Plan, PlanLimits};
use sidestep::features::FeatureSet;
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::ShfrsSettings;
use sidestep::vehicle::{Pose, TurnInput, dubins};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

fn main() {
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
    let scale = Scale::new(vec![1.0; 8], vec![2.0; 8]).unwrap();
    let model = Logistic::new(8, &[vec![0.1; 8], vec![0.2; 8], vec![-0.3; 8]], vec![0.0; 3]);
    let features = FeatureSet::subset("hrd").unwrap();
    let model = Predictor::logistic(features, vec![-1, 0, 1], scale, model.unwrap());
    let settings = ShfrsSettings::paper(3).unwrap().bounds;
    let mut online = OnlinePredictor::new(model, safety, parameters, settings).unwrap();
    let corners = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]];
    let footprint = Footprint::polygon(&corners).unwrap().grown(0.2).unwrap();
    let limits = PlanLimits::new(3.0, 2.0);
    let robot = Pose::new(6.0, 1.0, 3.1);
    let mut plan = Plan::new(vec![robot; 11], parameters.step_s, limits).unwrap();
    let mut poses = [robot; 11];
    let mut touched = 0;
    let mut round = |state: JointState, rate: f64| {
        online.push(state).unwrap();
        assert_eq!(online.predict().unwrap().len(), 5);
        poses[0] = state.robot;
        for i in 1..poses.len() {
            poses[i] = dubins::arc(poses[i - 1], 2.0, rate, 0.2);
        }
        plan.replace(&poses).unwrap();
        let found = online.clear(&plan, &footprint).unwrap();
        touched += usize::from(found.largest_clear(0.0) != Some(4));
    };
    let mut state = JointState { human: Pose::new(-8.0, 0.0, 0.1), robot };
    round(state, 0.3);
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    assert!(before > 0, "is anything counted?");
    for step in 0..200_usize {
        state = state.advance(&parameters, TurnInput::ALL[step / 5 % 3], 0.0, 0.2);
        if step % 40 == 0 {
            // Put the human ahead of the robot, so that they meet again. For the predictor, this is
            // a jump.
            let ahead = dubins::arc(state.robot, 2.0, 0.03, 3.0);
            state.human = Pose::new(ahead.x, ahead.y, ahead.psi + 3.0);
        }
        round(state, 0.01 * (step % 60) as f64 - 0.3);
    }
    assert_eq!(MEMORY.peak_usage(), before);
    println!("{touched} of 200 plans are not clear of the largest set");
    assert!((20..=180).contains(&touched), "{touched}");
}
