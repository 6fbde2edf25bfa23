//! Membership of full states (position and heading).
#![allow(clippy::print_stdout, reason = "the measured errors are worth reading")]

use serde::Deserialize;
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::{ReachableSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};

const SPEED_MPS: f64 = 2.0;
const STEP_S: f64 = 0.2;
const RATE_RADPS: f64 = 0.5;

fn set(start: Pose, lo: &[f64], hi: &[f64]) -> ReachableSet {
    let range = (-RATE_RADPS, RATE_RADPS);
    let bounds = InputBounds::new(lo.to_vec(), hi.to_vec(), range).expect("bounds");
    ReachableSet::new(start, &bounds, SPEED_MPS, STEP_S).expect("a set")
}

#[derive(Deserialize)]
struct Vectors {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    id: usize,
    x0: Pose,
    lo: Vec<f64>,
    hi: Vec<f64>,
    queries: Vec<Query>,
}

#[derive(Deserialize)]
struct Query {
    step: usize,
    state: Pose,
    kind: String,
    full_in: Option<bool>,
}

#[test]
fn every_decided_query_of_the_reference() {
    let vectors: Vectors =
        serde_json::from_str(include_str!("data/shfrs_vectors.json")).expect("the data parses");
    let tolerance = Tolerance { position_m: 1e-3, heading_rad: 1e-3 };
    let mut decided = 0;
    let mut wrong = 0;
    for case in &vectors.cases {
        let set = set(case.x0, &case.lo, &case.hi);
        for query in &case.queries {
            let inside = set.contains_state(query.step, query.state, tolerance);
            let margins = set.state_margins(query.step, query.state);
            let Some(expected) = query.full_in else { continue };
            decided += 1;
            if inside != expected {
                wrong += 1;
                println!(
                    "case {} step {} {} {:?}: {inside}, not {expected}: {margins:?}",
                    case.id, query.step, query.kind, query.state,
                );
            }
        }
    }
    println!("{decided} decided");
    assert_eq!(wrong, 0);
}

/// Bounds of one of the kinds that matter.
fn random_bounds(steps: usize, kind: usize, rng: &mut SeededRng) -> (Vec<f64>, Vec<f64>) {
    let steady = rng.below(2) == 0;
    let mut last = (0.0, 0.0);
    (0..steps)
        .map(|step| {
            if step > 0 && steady && rng.below(3) > 0 {
                return last;
            }
            let (a, b) =
                (rng.uniform(-RATE_RADPS, RATE_RADPS), rng.uniform(-RATE_RADPS, RATE_RADPS));
            last = match (kind, rng.below(8)) {
                (0, 0) => (0.0, 0.0),
                (0, 1) => (-a.abs(), 0.0),
                (0, _) => (-a.abs(), b.abs()),
                (1, _) => (a.abs().min(b.abs()), a.abs().max(b.abs())),
                (2, _) => (-a.abs().max(b.abs()), -a.abs().min(b.abs())),
                (3, _) => (-RATE_RADPS, RATE_RADPS),
                (_, 0) => (a, a),
                (_, 1) => (-RATE_RADPS, RATE_RADPS),
                (_, 2) => ((a.signum() * 0.5 - 0.1).max(-0.5), (a.signum() * 0.5 + 0.1).min(0.5)),
                _ => (a.min(b), a.max(b)),
            };
            last
        })
        .unzip()
}

/// The states after each step under random inputs.
fn random_drive(start: Pose, lo: &[f64], hi: &[f64], rng: &mut SeededRng) -> Vec<Pose> {
    const PARTS: usize = 4;
    let (mut pose, mut share) = (start, rng.unit());
    let restless = rng.uniform(0.0, 0.3);
    let only_bounds = rng.below(2) == 0;
    lo.iter()
        .zip(hi)
        .map(|(low, high)| {
            for _ in 0..PARTS {
                if rng.unit() < restless {
                    share = rng.unit();
                }
                let share = if only_bounds { share.round() } else { share };
                pose =
                    dubins::arc(pose, SPEED_MPS, low + (high - low) * share, STEP_S / PARTS as f64);
            }
            pose
        })
        .collect()
}

#[test]
fn random_drives_stay_inside() {
    let mut rng = SeededRng::new(5);
    for kind in 0..5 {
        for (steps, drives) in [(1, 4), (3, 8), (10, 10), (25, 4), (50, 1)] {
            let (mut worst, mut negative, mut count) = (f64::INFINITY, 0, 0);
            for _ in 0..20 {
                let (lo, hi) = random_bounds(steps, kind, &mut rng);
                let start = Pose::new(rng.uniform(-9.0, 9.0), 3.0, rng.uniform(-3.1, 3.1));
                let set = set(start, &lo, &hi);
                for _ in 0..drives {
                    for (i, state) in random_drive(start, &lo, &hi, &mut rng).iter().enumerate() {
                        let margin = set.state_margins(i + 1, *state).position_m;
                        count += 1;
                        if margin < -1e-6 {
                            negative += 1;
                        }
                        if margin < worst {
                            worst = margin;
                            if margin < -1e-3 {
                                println!(
                                    "   {kind} {steps} step {} {margin} {:?} lo {lo:?} hi {hi:?}",
                                    i + 1,
                                    set.state_margins(i + 1, *state)
                                );
                            }
                        }
                        let tolerance = Tolerance::default();
                        if margin < -0.005 {
                            println!("OUT {}", set.contains_state(i + 1, *state, tolerance));
                        }
                    }
                }
            }
            println!(
                "kind {kind}, {steps} steps: worst {worst:.2e} m, {negative} of {count} outside"
            );
        }
    }
}
