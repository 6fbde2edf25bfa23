//! Drives that try to leave conservative polygons, at six kinds of vehicles and bounds.

use super::{any_drive, origin};
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng};
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::vehicle::dubins;

/// A kind of vehicle and bounds.
struct Kind {
    speed_mps: f64,
    step_s: f64,
    most_radps: f64,
    most_steps: usize,
}

const KINDS: [Kind; 6] = [
    Kind { speed_mps: 2.0, step_s: 0.2, most_radps: 0.5, most_steps: 15 },
    Kind { speed_mps: 10.0, step_s: 0.5, most_radps: 3.0, most_steps: 12 },
    Kind { speed_mps: 2.0, step_s: 0.2, most_radps: 3.0, most_steps: 25 },
    Kind { speed_mps: 1.5, step_s: 0.1, most_radps: 6.0, most_steps: 50 },
    Kind { speed_mps: 2.0, step_s: 0.2, most_radps: 0.5, most_steps: 100 },
    Kind { speed_mps: 2.0, step_s: 1.0, most_radps: PI, most_steps: 30 },
];

/// Parts of a step in which the rate changes.
const PARTS: usize = 4;

/// Bounds of any sign, some without a choice.
fn bounds(kind: &Kind, rng: &mut SeededRng) -> (Vec<f64>, Vec<f64>) {
    let most = kind.most_radps;
    let straight = rng.below(3) == 0;
    let one = |rng: &mut SeededRng| {
        let (a, b) = (rng.uniform(-most, most), rng.uniform(-most, most));
        match rng.below(5) {
            _ if straight => (-a.abs(), b.abs()),
            0 => (a, a),
            1 => (-most, most),
            _ => (a.min(b), a.max(b)),
        }
    };
    (0..1 + rng.below(kind.most_steps)).map(|_| one(rng)).unzip()
}

/// Improves drives step by step: what brings the end nearer to the outside is kept.
#[test]
fn no_drive_that_tries_leaves_a_conservative_polygon() {
    const SETS: u64 = 3;
    const DRIVES: usize = 4;
    const TRIES: usize = 150;
    let settings = PolygonSettings::new(1e-3, 2).unwrap().conservative();
    for (place, kind) in KINDS.iter().enumerate() {
        let mut nearest = f64::INFINITY;
        for seed in 0..SETS {
            let mut rng = SeededRng::new(100 * place as u64 + seed);
            let (lo, hi) = bounds(kind, &mut rng);
            let range = (-kind.most_radps, kind.most_radps);
            let admitted = InputBounds::new(lo.clone(), hi.clone(), range).unwrap();
            let set = ReachableSet::new(origin(), &admitted, kind.speed_mps, kind.step_s).unwrap();
            let polygon = set.step_polygon(lo.len(), settings);
            let tube = set.tube_polygon(settings);
            let margin = |shares: &[f64]| {
                let mut pose = origin();
                let mut least = f64::INFINITY;
                for (part, share) in shares.iter().enumerate() {
                    let (low, high) = (lo[part / PARTS], hi[part / PARTS]);
                    let rate = low + (high - low) * share;
                    pose = dubins::arc(pose, kind.speed_mps, rate, kind.step_s / PARTS as f64);
                    least = least.min(signed_distance(&tube, pose.position()));
                }
                (signed_distance(&polygon, pose.position()), least)
            };
            for _ in 0..DRIVES {
                let mut shares = any_drive(PARTS * lo.len(), &mut rng);
                let mut best = margin(&shares);
                for _ in 0..TRIES {
                    let from = rng.below(shares.len());
                    let to = shares.len().min(from + 1 + rng.below(2 * PARTS));
                    let share = [0.0, 1.0, rng.unit()][rng.below(3)];
                    let before = shares[from..to].to_vec();
                    shares[from..to].fill(share);
                    let tried = margin(&shares);
                    assert!(
                        tried.0 >= 0.0 && tried.1 >= 0.0,
                        "kind {place}, {tried:?} m: {lo:?} {hi:?} {shares:?}"
                    );
                    if tried.0 < best.0 {
                        best = tried;
                    } else {
                        shares[from..to].copy_from_slice(&before);
                    }
                }
                nearest = nearest.min(best.0);
            }
        }
        println!("kind {place}: {:.3} mm from the boundary", 1e3 * nearest);
    }
}
