//! Measures predicted sets: polygons, membership, Algorithm 1, a frame of the replay, coverage and
//! tuning.
//!
//! Uses the participants in `tests/data/trials.csv` and a predictor trained on them.

use super::{FEW, Figures};
use crate::recorded;
use sidestep::bounds::{
    ActionChoice, ActionModel, Algorithm1, BoundsSettings, InputBounds, Motion, Rollout,
    input_bounds,
};
use sidestep::invalid::Invalid;
use sidestep::math::SeededRng;
use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance, Workspace};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::cache::Memory;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::probability::judge;
use sidestep::shfrs::tuning::{Sample, TuningSettings, candidates, tune};
use sidestep::shfrs::window::{Trajectory, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;
use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings, predict};
use sidestep::vehicle::{Pose, dubins};
use std::error::Error;
use std::hint::black_box;

const RATE_RADPS: f64 = 0.5;
const SPEED_MPS: f64 = 2.0;
const STEP_S: f64 = 0.2;
/// Number of steps ahead, T.
const STEPS: usize = 10;
/// The paper's widenings ε of the five sets (rad/s).
const EPSILON: [f64; 5] = [0.0, 0.15, 0.25, 0.4, 1.0];
/// Number of predictions whose polygons are drawn.
const PREDICTIONS: usize = 20;
/// Number of states tested for membership.
const STATES: usize = 256;
/// Distance of a near-boundary state from the boundary, m.
const NEAR_M: f64 = 2e-3;
/// Distance of an outside state from the end of a drive, m.
const AWAY_M: f64 = 0.5;
/// Number of steps between two prediction times of a drive.
const EVERY: usize = 7;
/// Number of drives to predict from.
const DRIVES: usize = 10;

/// Lowest and highest turn rate of each step (rad/s).
type Rates = Vec<(f64, f64)>;

pub(crate) fn measure(figures: &mut Figures<'_>) -> Result<(), Box<dyn Error>> {
    polygons(figures, "polygons, 0 inside", straight_inside)?;
    polygons(figures, "polygons, general", in_general)?;
    membership(figures)?;

    let parameters = SceneParameters::default();
    let safety = recorded::safety();
    let (predictor, sample) = recorded::split(&recorded::drives(), 1, &safety);
    let human = PredictedHuman::new(&predictor, &safety, &parameters)?;
    let moments = moments(&sample.test);
    bounds(figures, &moments, &parameters, &human)?;
    overlay(figures, &moments, &parameters, &human)?;
    Ok(())
}

/// Measures the work of the evaluator's worker.
pub(crate) fn evaluate(figures: &mut Figures<'_>) -> Result<(), Box<dyn Error>> {
    let parameters = SceneParameters::default();
    let safety = recorded::safety();
    let (predictor, sample) = recorded::split(&recorded::drives(), 1, &safety);
    let human = PredictedHuman::new(&predictor, &safety, &parameters)?;
    coverage(figures, &sample, &parameters, &human)?;
    tuning(figures, &sample, &parameters, &human)
}

/// Random bounds that always include straight driving.
fn straight_inside(rng: &mut SeededRng) -> Rates {
    (0..STEPS).map(|_| (-RATE_RADPS * rng.unit(), RATE_RADPS * rng.unit())).collect()
}

/// Bounds as Algorithm 1 gives them with k = 2, 2, 1, 1 …. From the third step on, there is only
/// one likely input. It changes from step to step, which is a harder case than human behaviour.
fn in_general(rng: &mut SeededRng) -> Rates {
    let bounds = |i: usize| {
        let turn = [-RATE_RADPS, 0.0, RATE_RADPS][rng.below(3)];
        if i < 2 { (turn.min(0.0), turn.max(0.0)) } else { (turn, turn) }
    };
    (0..STEPS).map(bounds).collect()
}

/// The bounds widened by `epsilon`, rad/s.
fn widened(raw: &[(f64, f64)], epsilon: f64) -> Result<InputBounds, Invalid> {
    let lo = raw.iter().map(|bounds| (bounds.0 - epsilon).max(-RATE_RADPS)).collect();
    let hi = raw.iter().map(|bounds| (bounds.1 + epsilon).min(RATE_RADPS)).collect();
    InputBounds::new(lo, hi, (-RATE_RADPS, RATE_RADPS))
}

/// Measures the polygons of five nested sets of ten steps each, with an accuracy of 2 mm. With this
/// accuracy, chords deviate from the curves by at most 1 mm, which is less than a pixel. The result
/// is the mean over a fixed mix of predictions.
fn polygons(
    figures: &mut Figures<'_>,
    name: &str,
    kind: fn(&mut SeededRng) -> Rates,
) -> Result<(), Invalid> {
    let settings = PolygonSettings::new(2e-3, 1)?;
    let start = Pose::new(1.0, 2.0, 0.3);
    let mut rng = SeededRng::new(5);
    let mut frames = Vec::new();
    for _ in 0..PREDICTIONS {
        let raw = kind(&mut rng);
        for epsilon in EPSILON {
            frames.push(widened(&raw, epsilon)?);
        }
    }
    let mut set = ReachableSet::new(start, &frames[0], SPEED_MPS, STEP_S)?;
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    figures.add(name, PREDICTIONS, || {
        for bounds in &frames {
            set.reset(start, black_box(bounds)).expect("bounds of ten steps");
            for step in 1..=STEPS {
                set.step_polygon_into(step, settings, &mut workspace, &mut polygon);
                black_box(&polygon);
            }
        }
    });
    figures.add(&format!("{name}, fresh memory"), PREDICTIONS, || {
        for bounds in &frames {
            let set = ReachableSet::new(start, black_box(bounds), SPEED_MPS, STEP_S);
            let set = set.expect("bounds of ten steps");
            for step in 1..=STEPS {
                black_box(set.step_polygon(step, settings));
            }
        }
    });
    Ok(())
}

/// For each case: its name, and the turn rates of the first three steps, of the next two steps, and
/// of the later steps. The last three cases are typical results of Algorithm 1 with first three,
/// then two, then one likely input, widened by 0, 0.15 and 0.4 rad/s.
const BOUNDS: [(&str, [(f64, f64); 3]); 6] = [
    ("both ways", [(-0.5, 0.5), (-0.5, 0.5), (-0.3, 0.4)]),
    ("left", [(0.1, 0.5), (0.1, 0.5), (0.3, 0.5)]),
    ("mixed", [(-0.5, 0.5), (-0.5, 0.5), (0.3, 0.5)]),
    ("predicted", [(-0.5, 0.5), (-0.5, 0.0), (-0.5, -0.5)]),
    ("0.15 wider", [(-0.5, 0.5), (-0.5, 0.15), (-0.5, -0.35)]),
    ("0.4 wider", [(-0.5, 0.5), (-0.5, 0.4), (-0.5, -0.1)]),
];

/// Measures the test whether a full state is reached after ten steps. For states inside, near the
/// boundary and outside, it records the slowest case of [`BOUNDS`].
fn membership(figures: &mut Figures<'_>) -> Result<(), Invalid> {
    let start = Pose::new(1.0, 2.0, 0.7);
    let mut slowest: [(f64, &str); 3] = [(0.0, ""); 3];
    for (kind, [first, second, third]) in BOUNDS {
        let of = |step: usize| match step {
            0..3 => first,
            3..5 => second,
            _ => third,
        };
        let set = ReachableSet::new(
            start,
            &widened(&(0..STEPS).map(of).collect::<Rates>(), 0.0)?,
            SPEED_MPS,
            STEP_S,
        )?;
        let mut rng = SeededRng::new(1);
        let drive = |mut rate: Box<dyn FnMut(usize) -> f64 + '_>| {
            (0..STEPS).fold(start, |pose, step| dubins::arc(pose, SPEED_MPS, rate(step), STEP_S))
        };
        let inside: Vec<Pose> = (0..STATES)
            .map(|_| {
                drive(Box::new(|step| {
                    let (lo, hi) = of(step);
                    rng.uniform(lo, hi)
                }))
            })
            .collect();
        // Turns at one limit of the rates up to some step, then at the other limit.
        let extreme = (0..STATES).map(|i| {
            let (first, jump) = (i % 2 == 0, (i / 2) % (STEPS + 1));
            drive(Box::new(|step| if (step < jump) == first { of(step).0 } else { of(step).1 }))
        });
        let moved = |pose: Pose, i: usize, by: f64| {
            let by = if i.is_multiple_of(3) { -by } else { by };
            Pose { x: pose.x + by, y: pose.y - by, ..pose }
        };
        let near: Vec<Pose> = extreme.enumerate().map(|(i, pose)| moved(pose, i, NEAR_M)).collect();
        let outside: Vec<Pose> =
            inside.iter().enumerate().map(|(i, &pose)| moved(pose, i, AWAY_M)).collect();
        for (slowest, states) in slowest.iter_mut().zip([&inside, &near, &outside]) {
            let seconds = figures.fastest(FEW, STATES, || {
                for state in states {
                    let found = set.contains_state(STEPS, black_box(*state), Tolerance::default());
                    black_box(found);
                }
            });
            if seconds > slowest.0 {
                *slowest = (seconds, kind);
            }
        }
    }
    for (place, (seconds, _)) in ["inside", "near", "outside"].into_iter().zip(slowest) {
        figures.seconds.push((format!("membership, {place}"), seconds));
    }
    Ok(())
}

/// States of some drives up to each prediction time.
fn moments(drives: &[Trajectory]) -> Vec<&[JointState]> {
    let of = |drive: &'_ Trajectory| (0..drive.steps()).step_by(EVERY).map(|step| step + 1);
    let drives = drives.iter().take(DRIVES);
    drives.flat_map(|drive| of(drive).map(|upto| &drive.states()[..upto])).collect()
}

/// Measures Algorithm 1 with the learned predictor.
fn bounds(
    figures: &mut Figures<'_>,
    moments: &[&[JointState]],
    parameters: &SceneParameters,
    human: &PredictedHuman<'_>,
) -> Result<(), Invalid> {
    let motion = Motion::from(parameters);
    let usual = ShfrsSettings::paper(human.actions().len())?.bounds;
    for rollout in [Rollout::Base, Rollout::Paper] {
        let (epsilon, choice) = (usual.epsilon().to_vec(), usual.choice().clone());
        let settings = BoundsSettings::new(epsilon, choice, rollout, usual.actions())?;
        let name = format!("Algorithm 1, {}", rollout.word());
        let mut algorithm = Algorithm1::default();
        figures.add(&name, moments.len(), || {
            for history in moments {
                let found = algorithm.run(black_box(history), &motion, human, |_| 0.0, &settings);
                black_box(found.expect("the state is finite"));
            }
        });
        figures.add(&format!("{name}, fresh memory"), moments.len(), || {
            for history in moments {
                let history = black_box(history);
                let found = input_bounds(history, parameters, human, |_| 0.0, &settings);
                black_box(found.expect("the state is finite"));
            }
        });
    }
    Ok(())
}

/// Measures the prediction, bounds, sets and polygons of a frame, as the replay draws it.
fn overlay(
    figures: &mut Figures<'_>,
    moments: &[&[JointState]],
    parameters: &SceneParameters,
    human: &PredictedHuman<'_>,
) -> Result<(), Invalid> {
    for (name, by_step) in [("overlay, tubes", false), ("overlay, per step", true)] {
        let settings = ShfrsSettings::paper(human.actions().len())?.with_by_step(by_step);
        let mut sets = ShfrsPredictor::default();
        let mut frame = |history: &[JointState]| {
            let found = sets.predict(black_box(history), parameters, human, &settings);
            black_box(found.expect("the state is finite"));
        };
        figures.add(name, moments.len(), || moments.iter().for_each(|history| frame(history)));
        let mut slowest = 0.0_f64;
        for history in moments {
            slowest = slowest.max(figures.fastest(FEW, 1, || frame(history)));
        }
        figures.seconds.push((format!("{name}, slowest moment"), slowest));
        figures.add(&format!("{name}, fresh memory"), moments.len(), || {
            for history in moments {
                let found = predict(black_box(history), parameters, human, &settings);
                black_box(found.expect("the state is finite"));
            }
        });
    }
    Ok(())
}

/// Measures how long it takes to count the sets of every window of 400 trajectories, as the
/// explorer does: first without a cache, then after moves of a slider, with a cache that was filled
/// before the move.
fn coverage(
    figures: &mut Figures<'_>,
    sample: &Sample,
    parameters: &SceneParameters,
    human: &PredictedHuman<'_>,
) -> Result<(), Invalid> {
    let drives = [&sample.training[..], &sample.calibration, &sample.test].concat();
    let prediction = Prediction::new(parameters, human);
    let actions = human.actions().len();
    let settings = |least: f64, twos: usize, steps: usize| {
        let choice = ActionChoice::TopK((0..steps).map(|i| 1 + usize::from(i < twos)).collect());
        let epsilon = [&[least], &EPSILON[1..]].concat();
        BoundsSettings::new(epsilon, choice, Rollout::Base, actions)
    };
    let mut memory = Memory::default();
    let count = |memory: &mut Memory, settings: BoundsSettings| {
        let windows = WindowChoice::EveryStep.windows(&drives, settings.steps());
        for (place, windows) in windows.iter().enumerate() {
            let judged = memory.judge(place, windows, &prediction, black_box(&settings));
            black_box(judged.expect("a prediction"));
        }
    };
    let usual = settings(0.0, 2, STEPS)?;
    let seconds = figures.fastest(1, 1, || {
        for windows in WindowChoice::EveryStep.windows(&drives, STEPS) {
            let judged = judge(&windows, &prediction, black_box(&usual));
            black_box(judged.expect("a prediction"));
        }
    });
    figures.seconds.push(("coverage, 400 drives, directly".to_owned(), seconds));
    // Two consecutive moves never lead to the same settings.
    let mut moved = |name: &str, next: &dyn Fn(usize) -> Result<BoundsSettings, Invalid>| {
        let mut moves = 0..;
        count(&mut memory, usual.clone());
        let seconds = figures.fastest(FEW, 1, || {
            let settings = moves.next().map(next).expect("a move");
            count(&mut memory, settings.expect("settings that are right"));
        });
        figures.seconds.push((format!("coverage, 400 drives, {name}"), seconds));
    };
    moved("other ε", &|i| settings(1e-4 * (1 + i % 1000) as f64, 2, STEPS));
    moved("other k", &|i| settings(0.0, 3 + i % 7, STEPS));
    moved("other T", &|i| settings(0.0, 2, STEPS + 1 - 2 * (i % 2)));
    Ok(())
}

/// Measures the tuning of the choice of actions and of ε_1 on 400 trajectories in three parts. It
/// uses one random window of each trajectory.
fn tuning(
    figures: &mut Figures<'_>,
    sample: &Sample,
    parameters: &SceneParameters,
    human: &PredictedHuman<'_>,
) -> Result<(), Box<dyn Error>> {
    let prediction = Prediction::new(parameters, human);
    let settings =
        TuningSettings::new(0.9, Guarantee::Conformal, candidates(human.actions().len(), STEPS))
            .with_windows(WindowChoice::RandomOne { seed: 1 });
    figures.add("tuning, 400 drives", 1, || {
        black_box(tune(sample, prediction, &settings).expect("enough drives"));
    });
    Ok(())
}
