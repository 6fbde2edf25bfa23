//! A robot that replans ten times a second beside a synthetic person: of five plans, it takes the one
//! that makes the most headway among those that are clear of the largest set.
//! `cargo run --release -p sidestep --example replan`.
#![allow(clippy::print_stdout, reason = "it shows what the robot chose")]

use sidestep::bounds::{ActionChoice, BoundsSettings, Rollout};
use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::math::PI;
use sidestep::planner::{Footprint, OnlinePredictor, Plan, PlanLimits};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep::training::logistic;
use sidestep::vehicle::{Pose, dubins};
use std::ops::ControlFlow;

/// Speed, m/s, and turn rate, rad/s, that a plan holds; the one that makes most headway first.
const PLANS: [(f64, f64); 5] = [(1.4, 0.0), (1.2, 0.5), (1.2, -0.5), (0.7, 0.0), (0.0, 0.0)];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let parameters = SceneParameters { step_s: 0.1, steps: 100, ..SceneParameters::default() };
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    let person = SyntheticParticipant::new(7, 0);
    let trials = (0..40).map(|trial| person.own_trial(trial, Keys::Clock).1);
    let seen: Vec<_> = trials.map(|drive| (drive.inputs, drive.states)).collect();
    let rows = seen.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
    let features = FeatureSet::subset("hrd")?;
    let predictor = logistic(&Dataset::from_trials(&features, &safety, rows))?;

    // Five sets over ten steps of 0.1 s.
    let epsilon = vec![0.0, 0.15, 0.25, 0.4, 1.0];
    let choice = ActionChoice::TopK(vec![2, 2, 2, 2, 1, 1, 1, 1, 1, 1]);
    let settings = BoundsSettings::new(epsilon, choice, Rollout::Base, 3)?;
    let mut online = OnlinePredictor::new(predictor, safety, parameters, settings)?;
    let footprint = Footprint::disc(0.4)?.grown(0.3)?; // the robot, and a person's body
    let limits = PlanLimits { most_speed_mps: 1.5, most_turn_rate_radps: 1.0 };

    // The person reacts to a robot that drives straight on. Ours comes from the right, and would meet
    // the person after three seconds.
    let (scene, _) = person.own_trial(50, Keys::Clock);
    let states = person.drive(50, &parameters, &scene, Keys::Clock).states;
    let meet = states[30].human;
    let across = Pose { psi: meet.psi + 0.5 * PI, ..meet };
    let mut robot = dubins::arc(across, -1.4, 0.0, 3.0);
    for (tick, state) in states.iter().take(60).enumerate() {
        online.push(JointState { human: state.human, robot })?;
        online.predict()?;
        let mut best: Option<(usize, usize, f64)> = None;
        for (number, &(speed, rate)) in PLANS.iter().enumerate() {
            let plan = Plan::driven(robot, &[(speed, rate); 10], parameters.step_s, limits)?;
            let clearances = online.clear(&plan, &footprint)?;
            let clear_of = clearances.largest_clear(0.0);
            let rank = clear_of.map_or(0, |set| set + 1);
            if best.is_none_or(|(most, ..)| rank > most) {
                best = Some((rank, number, clearances.of(0).at_least_m));
            }
        }
        let (rank, number, clearance_m) = best.unwrap_or((0, PLANS.len() - 1, 0.0));
        if tick % 5 == 0 {
            let (speed, rate) = PLANS[number];
            println!(
                "{:.1} s: {speed} m/s, {rate:+} rad/s, clear of {rank} sets, {clearance_m:.2} m from F_1",
                tick as f64 * parameters.step_s
            );
        }
        robot = dubins::arc(robot, PLANS[number].0, PLANS[number].1, parameters.step_s);
    }
    Ok(())
}
