//! Tuning and region probabilities on 400 recorded drives of **synthetic** participants.

use crate::recorded;
use sidestep::bounds::{ActionChoice, Rollout};
use sidestep::clearance::{CoverageBounds, Footprint, OnlinePredictor, Plan, PlanLimits};
use sidestep::invalid::Invalid;
use sidestep::learn::participant::Driven;
use sidestep::math::{hypot, sin_cos};
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::probability::regions;
use sidestep::shfrs::tuning::{Split, Tuned, TuningSettings, candidates, tune};
use sidestep::shfrs::window::{Trajectory, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;
use sidestep::vehicle::Pose;
use std::sync::OnceLock;

/// A predictor (logistic regression on B_hrd), trained on the first 20 drives of each person. The
/// other 30 drives of each person are 240 unseen trajectories.
struct Data {
    parameters: SceneParameters,
    safety: SafetyLevels,
    predictor: Predictor,
    unseen: Vec<Trajectory>,
}

fn data() -> &'static Data {
    static DATA: OnceLock<Data> = OnceLock::new();
    DATA.get_or_init(|| {
        let parameters = SceneParameters::default();
        let safety = recorded::safety();
        let (seen, unseen): (Vec<_>, Vec<_>) =
            recorded::drives().into_iter().enumerate().partition(|(i, _)| i % recorded::TASKS < 20);
        let predictor = recorded::trained(seen.iter().map(|(_, drive)| drive), &safety);
        let trajectory = |(_, drive): &(usize, Driven)| recorded::trajectory(drive);
        let unseen = unseen.iter().map(trajectory).collect();
        Data { parameters, safety, predictor, unseen }
    })
}

fn settings(p: f64, guarantee: Guarantee, seed: u64) -> TuningSettings {
    TuningSettings::new(p, guarantee, candidates(3, 10))
        .with_windows(WindowChoice::RandomOne { seed })
}

fn tuned(settings: &TuningSettings) -> Result<Tuned, Invalid> {
    let WindowChoice::RandomOne { seed } = settings.windows else {
        return tuned_on(Split::default(), settings);
    };
    tuned_on(Split { seed, ..Split::default() }, settings)
}

fn tuned_on(split: Split, settings: &TuningSettings) -> Result<Tuned, Invalid> {
    let Data { parameters, safety, predictor, unseen } = data();
    let human = PredictedHuman::new(predictor, safety, parameters).expect("good data");
    let sample = split.parts(unseen.len())?.sample(unseen);
    tune(&sample, Prediction::new(parameters, &human), settings)
}

#[test]
fn every_guarantee_is_kept_on_trajectories_that_nothing_was_chosen_by() {
    let delta = 0.1;
    for guarantee in [
        Guarantee::Conformal,
        Guarantee::Pac { delta },
        Guarantee::FixedSequence { delta, levels: 21 },
    ] {
        for p in [0.75, 0.9] {
            let found = tuned(&settings(p, guarantee, 1)).unwrap();
            assert_eq!((found.training, found.calibration, found.test), (96, 72, 72));
            assert_eq!((found.steps, found.without_window), (10, 0));
            // This is one test with 72 trajectories. Its confidence interval must not exclude p.
            assert!(found.coverage.high >= p, "{found:?}");
            assert!((0.0..=1.0).contains(&found.epsilon));
            // The area is smaller than the area of the worst-case set.
            assert!(found.mean_area_m2 > 0.0 && found.mean_area_m2 < 16.0 / 3.0, "{found:?}");
            assert!(found.statement.contains("72 trajectories"));
        }
    }
}

#[test]
fn tuning_does_not_depend_on_the_number_of_threads() {
    let settings = settings(0.9, Guarantee::Conformal, 3);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tuned(&settings)).unwrap()
    };
    assert_eq!(on(1), on(3));
}

/// Uses several random draws of the windows. With only 72 tasks, a single unexpected key press can
/// change ε by half of its range.
#[test]
fn the_adaptive_set_needs_less_area_than_the_worst_schedule() {
    let areas = |p: f64, choice: ActionChoice| -> Vec<f64> {
        let of = |seed| {
            let one = TuningSettings::new(p, Guarantee::Conformal, vec![choice.clone()])
                .with_windows(WindowChoice::RandomOne { seed });
            tuned(&one).unwrap().mean_area_m2
        };
        let all: Vec<f64> = (0..8).map(of).collect();
        eprintln!("p = {p}, {choice}: {all:.2?} m²");
        all
    };
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    for (p, most) in [(0.75, 0.8), (0.9, 0.95)] {
        let adaptive = areas(p, ActionChoice::Adaptive { tau: 0.1, steps: 10 });
        for other in [1, 3] {
            let other = areas(p, ActionChoice::TopK(vec![other; 10]));
            assert!(adaptive.iter().zip(&other).all(|(adaptive, other)| adaptive <= other));
            assert!(mean(&adaptive) < most * mean(&other), "p = {p}");
        }
    }
}

/// Tuned settings give the same sets online as offline. The share of plans that are reported as
/// clear but that the human touches is at most what the guarantee allows.
#[test]
fn what_was_tuned_predicts_online() {
    const STEP: usize = 12;
    let Data { parameters, safety, predictor, unseen } = data();
    let found = tuned(&settings(0.9, Guarantee::Conformal, 1)).unwrap();
    let further = [found.epsilon + 0.2, 1.5];
    let (predictor, safety) = (predictor.clone(), safety.clone());
    let human = PredictedHuman::new(&predictor, &safety, parameters).unwrap();
    let prediction = Prediction::new(parameters, &human);
    let rollout = [Rollout::Base, Rollout::Paper];
    let rollout = rollout.into_iter().find(|it| it.word() == found.rollout).unwrap();
    let same = prediction.settings(vec![found.epsilon], &found.choice, rollout).unwrap();
    let online =
        OnlinePredictor::tuned(&found, &further, predictor.clone(), safety.clone(), *parameters);
    let mut online = online.unwrap();
    let bounds = CoverageBounds::of_tuned(&found, &further, parameters).unwrap();
    // The last set admits every turn rate.
    assert_eq!(bounds.outside(), [1.0 - found.p, 1.0 - found.p, 0.0]);
    assert!((bounds.outside()[0] - 0.1).abs() < 1e-12);
    // The margin consists of the tolerance of 5 mm, the heading tolerance over half a step (0.2 m),
    // and a turn of up to 1 rad/s during that half step.
    assert!((0.01..0.02).contains(&bounds.margin_m()), "{}", bounds.margin_m());
    assert!(bounds.statement().starts_with(&found.statement));

    let limits = PlanLimits::new(1.0, 1.0);
    let footprint = Footprint::disc(0.3).unwrap();
    let (mut called_safe, mut touched) = (0, 0);
    for trajectory in unseen {
        let states = trajectory.states();
        online.reset();
        for state in &states[..=STEP] {
            online.push(*state).unwrap();
        }
        let sets = online.predict().unwrap().to_vec();
        let expected = prediction.bounds(&states[..=STEP], &same).unwrap();
        assert_eq!(sets[0], expected.sets[0]);
        // The robot waits beside the human's future position. A human who stays inside the set
        // touches no plan that is clear of the set, however the plan was chosen.
        let ahead = states[STEP + found.steps].human;
        let (sin, cos) = sin_cos(ahead.psi);
        for aside in [0.3, 0.6, 1.0, 1.5] {
            let wait = Pose { x: ahead.x - aside * sin, y: ahead.y + aside * cos, psi: 0.0 };
            let plan =
                Plan::driven(wait, &vec![(0.0, 0.0); found.steps], parameters.step_s, limits);
            let clearances = online.clear(&plan.unwrap(), &footprint).unwrap();
            if bounds.collision(clearances).unwrap().at_most <= 0.1 + 1e-12 {
                called_safe += 1;
                let comes = |state: &JointState| {
                    hypot(state.human.x - wait.x, state.human.y - wait.y) <= 0.3
                };
                touched += usize::from(states[STEP..=STEP + found.steps].iter().any(comes));
            }
        }
    }
    assert!(called_safe > 100, "{called_safe}");
    assert!(touched * 10 <= 4 * unseen.len(), "{touched} of {called_safe}");
    let falling = [found.epsilon + 0.2, found.epsilon];
    let refused = CoverageBounds::of_tuned(&found, &falling, parameters).unwrap_err();
    assert_eq!(refused.field, "further[1]");
}

#[test]
fn complaints_name_the_field() {
    let good = settings(0.9, Guarantee::Conformal, 1);
    let complaint = |change: &dyn Fn(&mut TuningSettings)| {
        let mut settings = good.clone();
        change(&mut settings);
        tuned(&settings).unwrap_err()
    };
    for wrong in [0.0, 1.0, f64::NAN] {
        assert_eq!(complaint(&|s| s.p = wrong).field, "p");
        assert_eq!(complaint(&|s| s.confidence = wrong).field, "confidence");
        assert_eq!(complaint(&|s| s.guarantee = Guarantee::Pac { delta: wrong }).field, "delta");
        let split = Split { training: wrong, ..Split::default() };
        assert_eq!(tuned_on(split, &good).unwrap_err().field, "training");
    }
    let split = Split { calibration: 0.7, ..Split::default() };
    assert_eq!(tuned_on(split, &good).unwrap_err().field, "calibration");
    assert_eq!(complaint(&|s| s.candidates.clear()).field, "candidates");
    let short = ActionChoice::TopK(vec![1; 9]);
    assert_eq!(complaint(&|s| s.candidates[3] = short.clone()).field, "candidates[3]");
    let none = ActionChoice::TopK(vec![1, 0]);
    assert_eq!(complaint(&|s| s.candidates[1] = none.clone()).field, "candidates[1].k[1]");
    assert_eq!(complaint(&|s| s.windows = WindowChoice::EveryStep).field, "window_choice");
    let few = complaint(&|s| s.p = 0.99);
    let expected =
        "calibration trajectories: expected at least 99 for p = 0.99 (conformal), found 72";
    assert_eq!(few.to_string(), expected);
}

#[test]
fn probabilities_name_what_they_depend_on() {
    let Data { parameters, safety, predictor, unseen } = data();
    let human = PredictedHuman::new(predictor, safety, parameters).unwrap();
    let prediction = Prediction::new(parameters, &human);
    let choice = ActionChoice::TopK((0..10).map(|i| if i < 2 { 2 } else { 1 }).collect());
    let epsilon = vec![0.0, 0.15, 0.25, 0.4, 1.0];
    let settings = prediction.settings(epsilon, &choice, Rollout::Paper).unwrap();
    for windows in [WindowChoice::EveryStep, WindowChoice::RandomOne { seed: 4 }] {
        let found = regions(unseen, windows, prediction, &settings, 0.95).unwrap();
        let p = &found.probabilities;
        assert_eq!(p.trajectories, 240);
        assert_eq!(p.windows, if windows.is_single() { 240 } else { 240 * 40 });
        assert_eq!((found.window_choice.as_str(), found.tolerance_m), (windows.word(), 0.005));
        assert!(p.inside.windows(2).all(|pair| pair[0].value <= pair[1].value));
        assert!((p.region.iter().map(|p| p.value).sum::<f64>() - 1.0).abs() <= 1e-12);
        assert!(found.mean_area_m2.is_sorted());
        assert!(p.inside[..4].iter().all(|p| p.high - p.low > 0.05 && p.high - p.low < 0.15));
    }
}
