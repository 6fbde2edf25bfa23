//! One cycle of a robot at 10 Hz: `cargo xtask bench planner`. A cycle pushes the new state,
//! predicts five sets over ten steps, and computes the clearance of a plan.

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::Criterion;
use fastest::Fastest;
use sidestep::clearance::{Clearances, Footprint, OnlinePredictor, Plan, PlanLimits};
use sidestep::features::FeatureSet;
use sidestep::math::sin_cos;
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::ShfrsSettings;
use sidestep::vehicle::{Pose, TurnInput};

mod fastest;

/// Pairs of a measurement and its baseline.
const RATIOS: &[(&str, &str)] = &[
    ("planner/round, far", "planner/push and predict"),
    ("planner/round, near", "planner/round, far"),
];

/// Budgets per cycle (s).
const BUDGETS: &[(&str, f64)] = &[("planner/round, far", 1e-3), ("planner/round, near", 1e-3)];

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut fastest = Fastest::default();
    let parameters = SceneParameters::default();
    let mut online = online(&parameters);
    let footprint = Footprint::disc(0.3).and_then(|disc| disc.grown(0.3)).expect("a footprint");
    let mut group = criterion.benchmark_group("planner");
    let far = rounds(&parameters, Pose::new(9.0, 1.0, 3.1), 9.0);
    // The robot crosses in front of and behind the human, about a metre from the human's reachable
    // set.
    let near = rounds(&parameters, Pose::new(2.0, 3.5, -1.5), 2.5);
    let mut measure = |name, rounds: &[(JointState, Plan)], plans: bool| {
        fastest.measure(&mut group, name, rounds.len(), || {
            for (state, plan) in rounds {
                online.push(*state).expect("a state");
                black_box(online.predict().expect("a prediction"));
                if plans {
                    black_box(online.clear(plan, &footprint).expect("clearances"));
                }
            }
        });
    };
    measure("planner/push and predict", &near, false);
    measure("planner/round, far", &far, true);
    measure("planner/round, near", &near, true);
    group.finish();
    slowest(&mut online, &near, &footprint);
    criterion.final_summary();
    fastest.print_ratios(RATIOS, BUDGETS);
}

fn online(parameters: &SceneParameters) -> OnlinePredictor {
    let safety = SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(()));
    let scale = Scale::new(vec![1.0; 8], vec![2.0; 8]).expect("a scale");
    let model = Logistic::new(8, &[vec![0.1; 8], vec![0.2; 8], vec![-0.3; 8]], vec![0.0; 3]);
    let features = FeatureSet::subset("hrd").expect("features");
    let model = Predictor::logistic(features, vec![-1, 0, 1], scale, model.expect("a model"));
    let settings = ShfrsSettings::paper(3).expect("settings").bounds;
    OnlinePredictor::new(model, safety.expect("the closed form"), *parameters, settings)
        .expect("a predictor")
}

/// 60 states of a human who turns occasionally, each with a plan of a turning robot. In the human's
/// frame, the robot starts up to `spread` m further ahead than `robot`, to the left or right.
fn rounds(parameters: &SceneParameters, robot: Pose, spread: f64) -> Vec<(JointState, Plan)> {
    let limits = PlanLimits::new(3.0, 2.0);
    let mut human = Pose::new(0.0, 0.0, 0.4);
    let mut rounds = Vec::new();
    for i in 0..60_usize {
        let (sin, cos) = sin_cos(human.psi);
        let ahead = robot.x + spread * (i % 7) as f64 / 6.0;
        let left = robot.y - 2.0 * robot.y * (i % 5) as f64 / 4.0;
        let at = Pose::new(
            human.x + cos * ahead - sin * left,
            human.y + sin * ahead + cos * left,
            human.psi + robot.psi * if i % 5 > 2 { -1.0 } else { 1.0 },
        );
        let inputs = [(0.4 + 0.02 * i as f64, 0.3 - 0.01 * i as f64); 10];
        let plan = Plan::driven(at, &inputs, parameters.step_s, limits).expect("a plan");
        rounds.push((JointState { human, robot: at }, plan));
        human = parameters.human.advance(human, TurnInput::ALL[i / 4 % 3], parameters.step_s);
    }
    rounds
}

/// Prints the time of the slowest of many cycles near the human. Also prints the number of cycles
/// whose plan comes within 1 m of the largest set, and the number of cycles whose plan is clear of
/// it.
#[allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]
fn slowest(online: &mut OnlinePredictor, rounds: &[(JointState, Plan)], footprint: &Footprint) {
    let mut took: Vec<f64> = Vec::new();
    let (mut near, mut clear) = (0, 0);
    for repeat in 0..20 {
        for (i, (state, plan)) in rounds.iter().enumerate() {
            let start = std::time::Instant::now();
            online.push(*state).expect("a state");
            online.predict().expect("a prediction");
            let found: &Clearances = online.clear(plan, footprint).expect("clearances");
            let seconds = start.elapsed().as_secs_f64();
            if repeat == 0 {
                took.push(seconds);
                near += usize::from(found.of(4).at_least_m < 1.0);
                clear += usize::from(found.largest_clear(0.0) == Some(4));
            }
            took[i] = took[i].min(seconds);
        }
    }
    let most = took.iter().copied().fold(0.0, f64::max);
    println!(
        "slowest of {} near rounds: {:.0} µs; {near} within 1 m of the largest set, {clear} clear of it",
        rounds.len(),
        1e6 * most
    );
}
