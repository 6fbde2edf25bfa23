//! The online predictor, and the collision bounds that follow from its calibration.

use sidestep::bounds::{
    ActionChoice, ActionModel, ActionSpace, BoundsSettings, InputBounds, Rollout, input_bounds,
};
use sidestep::clearance::{
    Clearance, ClearanceFinder, Continuity, CoverageBounds, Footprint, HumanFuture, NextSteps,
    OnlinePredictor, Plan,
};
use sidestep::features::FeatureSet;
use sidestep::math::{SeededRng, sin_cos};
use sidestep::plausibility::Departure;
use sidestep::predict::Predictor;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;
use sidestep::reach::Tolerance;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::family::Family;
use sidestep::shfrs::scores::{Scores, ShfrsFamily};
use sidestep::shfrs::widened::widened;
use sidestep::shfrs::window::{Trajectory, Window};
use sidestep::shfrs::window_sets::Prediction;
use sidestep::vehicle::{Pose, SpeedRange, TurnInput, dubins};
use std::ops::ControlFlow;

fn safety(parameters: &SceneParameters) -> SafetyLevels {
    SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// A model that uses the distance and the human's inputs in the last five steps.
fn predictor() -> Predictor {
    let features = FeatureSet::of(&["distance", "turned_5", "turned_1"]).unwrap();
    let rows = [vec![-0.1, 3.0, 1.0], vec![0.3, 0.0, -0.5], vec![-0.1, -3.0, -1.0]];
    let model = Logistic::new(3, &rows, vec![0.1, 0.0, 0.0]).unwrap();
    let scale = Scale::new(vec![9.0, 0.0, 0.0], vec![3.0, 0.2, 0.1]).unwrap();
    Predictor::logistic(features, vec![-1, 0, 1], scale, model)
}

fn settings() -> BoundsSettings {
    let choice = ActionChoice::TopK(vec![2, 2, 1, 1, 1, 1, 1, 1, 1, 1]);
    BoundsSettings::new(vec![0.0, 0.15, 0.25, 0.4, 1.0], choice, Rollout::Base, 3).unwrap()
}

fn online() -> OnlinePredictor {
    let parameters = SceneParameters::default();
    OnlinePredictor::new(predictor(), safety(&parameters), parameters, settings()).unwrap()
}

fn drive() -> Vec<JointState> {
    let parameters = SceneParameters::default();
    let mut state =
        JointState { human: Pose::new(-8.0, 0.0, 0.1), robot: Pose::new(8.0, 1.0, 3.1) };
    let mut states = vec![state];
    for step in 0..40_usize {
        state = state.advance(&parameters, TurnInput::ALL[step * step / 7 % 3], 0.0, 0.2);
        states.push(state);
    }
    states
}

/// A bounded history gives the same bounds as the whole history.
#[test]
fn it_predicts_what_the_whole_history_does() {
    let parameters = SceneParameters::default();
    let (predictor, safety) = (predictor(), safety(&parameters));
    let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
    let mut online = online();
    assert_eq!(online.states_needed(), 6);
    let states = drive();
    for now in 0..states.len() {
        assert_eq!(online.push(states[now]), Ok(Continuity::Continues));
        if now < 5 {
            let said = online.predict().unwrap_err();
            assert_eq!((said.field.as_str(), said.found), ("history", (now + 1).to_string()));
            continue;
        }
        let history = &states[..=now];
        let found = input_bounds(history, &parameters, &human, |_| 0.0, &settings()).unwrap();
        assert_eq!(online.predict().unwrap(), found.sets);
        assert_eq!(online.history(), &history[now - 5..]);
    }
}

#[test]
fn a_jump_begins_a_new_history() {
    let mut online = online();
    let states = drive();
    for state in &states[..8] {
        online.push(*state).unwrap();
    }
    let plan = Plan::of_positions(&[[8.0, 1.0]; 11], 0.2, super::FREE).unwrap();
    let footprint = Footprint::disc(0.5).unwrap();
    assert_eq!(online.clear(&plan, &footprint).unwrap_err().field, "predict");
    online.predict().unwrap();
    online.clear(&plan, &footprint).unwrap();
    let nowhere = JointState { human: Pose { x: f64::NAN, y: 0.0, psi: 0.0 }, ..states[8] };
    assert_eq!(online.push(nowhere).unwrap_err().field, "state.human.x");
    online.clear(&plan, &footprint).unwrap();
    let mut far = states[8];
    far.human.x += 3.0;
    assert_eq!(online.push(far), Ok(Continuity::Restarted));
    assert_eq!(online.history(), [far]);
    assert_eq!(online.clear(&plan, &footprint).unwrap_err().field, "predict");
    let turned = JointState { human: Pose { psi: far.human.psi + 1.0, ..far.human }, ..far };
    assert_eq!(online.push(turned), Ok(Continuity::Restarted));
    online.reset();
    assert!(online.history().is_empty() && online.check_human().is_ok());
    assert_eq!(online.predict().unwrap_err().field, "history");
}

/// The sets assume a human who drives like the vehicle.
#[test]
fn a_human_at_another_speed_is_noticed() {
    let (mut online, states) = (online(), drive());
    for state in &states[..8] {
        assert_eq!(online.push(*state), Ok(Continuity::Continues));
        assert_eq!(online.check_human(), Ok(()));
    }
    let moved = |way_m: f64| {
        let (human, mut next) = (states[7].human, states[8]);
        let (sin, cos) = sin_cos(human.psi);
        next.human = Pose::new(human.x + way_m * cos, human.y + way_m * sin, human.psi);
        next
    };
    // The human stands, moves too slowly, moves too fast, or jumps. At 2 m/s, a step of 0.2 s is
    // 0.4 m.
    for way_m in [0.0, 0.2, 0.396, 0.404, 0.7, 3.0] {
        let mut online = online.clone();
        assert_ne!(online.push(moved(way_m)), Ok(Continuity::Continues));
        assert_eq!(online.check_human().unwrap_err().field, "state.human.x, y", "{way_m} m");
        let said = online.departure().unwrap().to_string();
        assert!(said.contains(&format!("moved at {:.2} m/s", way_m / 0.2)), "{said}");
    }
    online.push(moved(0.4)).unwrap();
    assert_eq!((online.check_human(), online.departure()), (Ok(()), None));
}

/// A human stands in the robot's way. At step 8, the robot is over the human, because their
/// distance along the robot's path is 3 − 8 · 0.4 = −0.2 m. The sets assume a human at 2 m/s, so at
/// step 8 these sets are 2 m away.
#[test]
fn nobody_who_stands_still_is_driven_over() {
    let parameters = SceneParameters::default();
    let constant = Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], vec![0.2, 0.6, 0.2]);
    let choice = ActionChoice::TopK(vec![1; STEPS]);
    let settings = BoundsSettings::new(vec![0.0, 1.0], choice, Rollout::Base, 3).unwrap();
    let safety = safety(&parameters);
    let online = OnlinePredictor::new(constant.unwrap(), safety, parameters, settings).unwrap();
    let robot = Pose::new(3.0, 0.0, core::f64::consts::PI);
    let plan = Plan::driven(robot, &[(2.0, 0.0); STEPS], 0.2, super::FREE).unwrap();
    let footprint = Footprint::disc(0.5).unwrap();
    let stands = JointState { human: Pose::new(0.0, 0.0, 0.0), robot };

    let mut assumed = online.clone().with_next_steps(NextSteps::AssumeVehicle);
    let mut online = online;
    assert_eq!(online.push(stands), Ok(Continuity::Continues));
    for _ in 0..2 {
        assert_eq!(online.push(stands), Ok(Continuity::Departed));
        assert_eq!(assumed.push(stands), Ok(Continuity::Continues));
    }
    online.predict().unwrap();
    let found = online.clear(&plan, &footprint).unwrap();
    let nothing = |clearance: &Clearance| clearance.at_least_m == f64::NEG_INFINITY;
    assert!(found.sets() == 2 && (0..2).all(|set| found.by_step(set).len() == STEPS));
    assert!((0..2).all(|set| found.by_step(set).iter().all(nothing)));
    assert_eq!((found.largest_clear(0.0), found.of(0).at_most_m), (None, f64::NEG_INFINITY));
    let why = Departure::Speed { measured_mps: 0.0, vehicle: 2.0.into() };
    assert_eq!((found.unproved(), online.departure()), (Some(why), Some(why)));
    // The probability of a collision has no bound either.
    let scores = Scores::new(vec![0.0; 100]).unwrap();
    let tolerance = Tolerance::default();
    let bounds =
        CoverageBounds::of_scores(&scores, &[0.0, 1.0], 0.05, &parameters, tolerance, STEPS);
    let found = online.clear(&plan, &footprint).unwrap();
    let bound = bounds.unwrap().collision(found).unwrap();
    assert_eq!((bound.at_most, bound.set), (1.0, None));
    let other = Plan::driven(robot, &[(2.0, 0.0); STEPS], 0.1, super::FREE).unwrap();
    assert_eq!(online.clear(&other, &footprint).unwrap_err().field, "plan.step_s");

    // With `assume_vehicle`, the caller gets clearances even for this human.
    assumed.predict().unwrap();
    let found = assumed.clear(&plan, &footprint).unwrap();
    assert!(found.unproved().is_none() && found.by_step(1)[8].at_least_m > 1.9);
    assert!(assumed.departure().is_none() && assumed.check_human().is_err());

    // When the human moves like the vehicle again, prediction resumes.
    let walks = JointState { human: Pose::new(0.4, 0.0, 0.0), robot };
    assert_eq!(online.push(walks), Ok(Continuity::Continues));
    online.predict().unwrap();
    assert!(online.clear(&plan, &footprint).unwrap().unproved().is_none());
    // A jump discards the history, and again nothing is proven.
    let away = JointState { human: Pose::new(4.0, 0.0, 0.0), robot };
    assert_eq!(online.push(away), Ok(Continuity::Restarted));
    online.predict().unwrap();
    assert!(online.clear(&plan, &footprint).unwrap().unproved().is_some());
}

/// A person who slows down and stands is still within the sets of a range of speeds.
#[test]
fn a_range_of_speeds_lets_the_human_stand() {
    let parameters = SceneParameters::default();
    let constant = Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], vec![0.1, 0.8, 0.1]);
    let safety = safety(&parameters);
    let settings =
        BoundsSettings::new(vec![0.0, 1.0], ActionChoice::TopK(vec![1; STEPS]), Rollout::Base, 3);
    let online =
        OnlinePredictor::new(constant.unwrap(), safety, parameters, settings.unwrap()).unwrap();
    assert_eq!(online.speed(), 2.0.into());
    let refused = online.clone().with_speed(SpeedRange::new(0.0, 0.0).unwrap());
    assert_eq!(refused.unwrap_err().field, "speed_mps");
    let mut online = online.with_speed(SpeedRange::new(0.0, 2.2).unwrap()).unwrap();
    let robot = Pose::new(6.0, 0.0, core::f64::consts::PI);
    let at = |x: f64| JointState { human: Pose::new(x, 0.0, 0.0), robot };
    for x in [0.0, 0.44, 0.6, 0.6] {
        assert_eq!(online.push(at(x)), Ok(Continuity::Continues), "{x}");
    }
    online.predict().unwrap();
    let plan = Plan::driven(robot, &[(0.0, 0.0); STEPS], 0.2, super::FREE).unwrap();
    let found = online.clear(&plan, &Footprint::disc(0.5).unwrap()).unwrap();
    // The human can stand or drive 4.4 m straight ahead.
    let clearances = found.by_step(0).iter().zip(1..);
    for (clearance, step) in clearances {
        let expected_m = 5.4 - 0.5 - 0.44 * f64::from(step);
        assert!(clearance.at_least_m <= expected_m && expected_m <= clearance.at_most_m + 1e-9);
        assert!(clearance.at_most_m - clearance.at_least_m <= 0.02, "{clearance:?}");
    }
    assert_eq!(online.push(at(1.2)), Ok(Continuity::Departed), "faster than 2.2 m/s");
    let why = online.departure().unwrap().to_string();
    assert_eq!(why, "the human moved at 3.00 m/s, the vehicle at 0 to 2.2 m/s");
}

#[test]
fn models_that_cannot_be_used_online_are_refused() {
    let parameters = SceneParameters::default();
    let complain = |predictor: Predictor, parameters: SceneParameters| {
        let safety = safety(&SceneParameters::default());
        OnlinePredictor::new(predictor, safety, parameters, settings()).unwrap_err().field
    };
    let features = FeatureSet::of(&["turned"]).unwrap();
    let whole = Predictor::constant(features, vec![-1, 0, 1], vec![0.2, 0.6, 0.2]).unwrap();
    assert_eq!(complain(whole, parameters), "features");
    let two = Predictor::constant(FeatureSet::none(), vec![0, 1], vec![0.5, 0.5]).unwrap();
    assert_eq!(complain(two, parameters), "settings.actions");
    let two = Predictor::constant(FeatureSet::none(), vec![0, 2], vec![0.5, 0.5]).unwrap();
    assert_eq!(complain(two, parameters), "classes[1]");
    let stopped = SceneParameters { step_s: 0.0, ..parameters };
    assert_eq!(complain(predictor(), stopped), "parameters.step_s");
}

const STEPS: usize = 10;

/// A model with constant probabilities.
struct Always;

impl ActionModel for Always {
    fn actions(&self) -> ActionSpace<'_> {
        ActionSpace::Levels(&[-0.5, 0.0, 0.5])
    }

    fn probabilities(&self, _: &[JointState], out: &mut [f64]) {
        out.copy_from_slice(&[0.1, 0.8, 0.1]);
    }
}

/// A human who mostly drives straight, but in some trajectories turns at a constant rate from a
/// random step on.
fn behave(rng: &mut SeededRng) -> Trajectory {
    let robot = Pose::new(40.0, 0.0, 0.0);
    let (from, turn) =
        (rng.below(STEPS), [-0.5, 0.0, 0.0, 0.0, rng.uniform(-0.5, 0.5)][rng.below(5)]);
    let upto = from + rng.below(STEPS);
    let rates: Vec<f64> =
        (0..STEPS).map(|i| if (from..upto).contains(&i) { turn } else { 0.0 }).collect();
    let mut states = vec![JointState { human: Pose::new(0.0, 0.0, 0.0), robot }];
    for &rate in &rates {
        let human = dubins::arc(states[states.len() - 1].human, 2.0, rate, 0.2);
        states.push(JointState { human, robot });
    }
    Trajectory::new(states, rates).unwrap()
}

/// Robots that choose their plans without knowing the future are touched at most as often as the
/// bound says. For every α, the probability that the bound is at most α and the robot is touched is
/// at most α, except for calibrations that fail.
#[test]
fn touches_are_as_rare_as_the_bound_says() {
    const EPSILON: [f64; 5] = [0.0, 0.15, 0.25, 0.4, 1.0];
    let delta = 0.1;
    let parameters = SceneParameters::default();
    let prediction = Prediction::new(&parameters, &Always);
    let choice = ActionChoice::TopK(vec![1; STEPS]);
    let mut rng = SeededRng::new(31);
    let sets: Vec<InputBounds> =
        EPSILON.map(|epsilon| widened(&[(0.0, 0.0); STEPS], epsilon, (-0.5, 0.5)).unwrap()).into();
    let start = Pose::new(0.0, 0.0, 0.0);
    let future = HumanFuture { start, sets: &sets, speed: 2.0.into(), step_s: 0.2 };
    let footprint = Footprint::disc(0.3).unwrap();
    let mut finder = ClearanceFinder::default();
    let (calibrations, scenes) = (60, 40);
    let many = f64::from(calibrations * scenes);
    let alphas = [0.0, 0.2, 0.3, 0.5, 0.7];
    let (mut touched, mut said) = ([0.0; 5], [0.0; 5]);
    for _ in 0..calibrations {
        let mut family = ShfrsFamily::new(prediction, &choice).unwrap();
        let score = |trajectory: Trajectory| {
            family.score(&Window::new(&trajectory, 0, STEPS).unwrap()).unwrap()
        };
        let scores = (0..60).map(|_| behave(&mut rng)).map(score).collect();
        let scores = Scores::new(scores).unwrap();
        let tolerance = Tolerance::default();
        let bounds =
            CoverageBounds::of_scores(&scores, &EPSILON, delta, &parameters, tolerance, STEPS);
        let bounds = bounds.unwrap();
        assert!(bounds.outside().is_sorted_by(|a, b| a >= b) && bounds.outside()[4] == 0.0);
        for _ in 0..scenes {
            let robot =
                Pose::new(rng.uniform(2.0, 4.0), rng.uniform(-1.2, 1.2), rng.uniform(-3.0, 3.0));
            let speed = rng.uniform(0.0, 0.3);
            let plan = Plan::driven(robot, &[(speed, 0.2); STEPS], 0.2, super::FREE).unwrap();
            let found = finder.find(&future, &plan, &footprint).unwrap();
            let bound = bounds.collision(found).unwrap();
            let human = behave(&mut rng);
            let touches = (0..STEPS * 20).any(|i| {
                let (step, part_s) = (i / 20, 0.01 * (i % 20) as f64);
                let from = human.states()[step].human;
                let at = dubins::arc(from, 2.0, human.turn_rates()[step], part_s);
                let robot = plan.pose_at(0.2 * step as f64 + part_s);
                footprint.distance_m(robot, at.position()) <= 0.0
            });
            for ((alpha, touched), said) in alphas.iter().zip(&mut touched).zip(&mut said) {
                *touched += f64::from(touches && bound.at_most <= *alpha) / many;
                *said += f64::from(bound.at_most <= *alpha) / many;
            }
        }
    }
    println!("{alphas:?}: {touched:.4?} touched, {said:.3?} of all plans");
    for ((alpha, touched), said) in alphas.iter().zip(touched).zip(said) {
        assert!(
            touched <= alpha + 3.0 * (alpha * (1.0 - alpha) / many).sqrt(),
            "{alpha} {touched}"
        );
        assert!(said > 0.02, "{alpha}: is anything promised?");
    }
    // Drives that leave F_1 cause touches, so the test would detect a bound that is much too low.
    assert!(touched[4] > 0.02, "{touched:?}");
}

#[test]
fn bounds_say_what_they_assume_and_refuse_bad_input() {
    let parameters = SceneParameters::default();
    let scores = Scores::new((0..100).map(|i| 0.01 * f64::from(i)).collect()).unwrap();
    let of = |epsilon: &[f64], delta| {
        let tolerance = Tolerance::default();
        CoverageBounds::of_scores(&scores, epsilon, delta, &parameters, tolerance, 10)
    };
    let bounds = of(&[0.505, 0.945], 0.05).unwrap();
    // Of 100 scores, 51 are inside the first set and 95 are inside the second set. For the
    // probabilities p below, P(Bin(100, p) ≥ 51) and P(Bin(100, p) ≥ 95) are each 0.025.
    for (found, inside) in bounds.outside().iter().zip([0.408_036_329_155, 0.887_165_088_895]) {
        assert!((found - (1.0 - inside)).abs() < 1e-9, "{found}");
    }
    assert!(bounds.statement().contains("confidence 0.95") && bounds.margin_m() < 0.02);
    // A set that admits every turn rate uses no share of δ.
    let (alone, beside) = (of(&[0.505], 0.05).unwrap(), of(&[0.505, 1.0], 0.05).unwrap());
    assert_eq!(beside.outside(), [alone.outside()[0], 0.0]);
    assert_eq!(of(&[], 0.05).unwrap_err().field, "epsilon");
    assert_eq!(of(&[0.3, 0.2], 0.05).unwrap_err().field, "epsilon[1]");
    assert_eq!(of(&[0.3, f64::NAN], 0.05).unwrap_err().field, "epsilon[1]");
    assert_eq!(of(&[-0.1], 0.05).unwrap_err().field, "epsilon[0]");
    assert_eq!(of(&[0.3], 1.0).unwrap_err().field, "delta");
    let plan = Plan::of_positions(&[[50.0, 0.0]; 4], 0.2, super::FREE).unwrap();
    let start = Pose::new(0.0, 0.0, 0.0);
    let sets = [super::bounds(&[-0.1; 3], &[0.1; 3])];
    let future = HumanFuture { start, sets: &sets, speed: 2.0.into(), step_s: 0.2 };
    let mut finder = ClearanceFinder::default();
    let found = finder.find(&future, &plan, &Footprint::disc(0.3).unwrap()).unwrap();
    assert_eq!(bounds.collision(found).unwrap_err().field, "clearances");
    let one = of(&[0.945], 0.05).unwrap().collision(found).unwrap();
    assert_eq!((one.set, one.at_most < 0.12), (Some(0), true));
}
