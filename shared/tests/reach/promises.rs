//! Conservative polygons against drives that try to leave them, at turns of up to half a turn a step and over up
//! to 100 steps.

use super::{any_drive, origin};
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng};
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::vehicle::dubins;

/// Bounds are drawn for up to `steps` steps and turn rates of up to `most` rad/s to both sides.
struct Class {
    speed_mps: f64,
    step_s: f64,
    most: f64,
    steps: usize,
    sets: usize,
}

const fn class(speed_mps: f64, step_s: f64, most: f64, steps: usize, sets: usize) -> Class {
    Class { speed_mps, step_s, most, steps, sets }
}

const CLASSES: [Class; 6] = [
    class(2.0, 0.2, 0.5, 15, 60),
    class(10.0, 0.5, 3.0, 12, 40),
    class(2.0, 0.2, 3.0, 25, 40),
    class(1.5, 0.1, 6.0, 50, 20),
    class(2.0, 0.2, 0.5, 100, 20),
    class(2.0, 1.0, PI, 100, 2),
];

/// Parts of a step in which a drive has one turn rate.
const PARTS: usize = 4;

/// Random drives of each set, and changes to the one that got farthest out.
const DRIVES: usize = 60;
const CHANGES: usize = 60;

struct Subject {
    class: &'static Class,
    lo: Vec<f64>,
    hi: Vec<f64>,
    tube: Vec<[f64; 2]>,
    last: Vec<[f64; 2]>,
}

impl Subject {
    fn any(class: &'static Class, rng: &mut SeededRng) -> Self {
        let most = class.most;
        let straight = rng.below(3) == 0;
        let bounds = (0..=rng.below(class.steps)).map(|_| {
            let (a, b) = (rng.uniform(-most, most), rng.uniform(-most, most));
            match rng.below(5) {
                _ if straight => (-a.abs(), b.abs()),
                0 => (a, a),
                1 => (-most, most),
                _ => (a.min(b), a.max(b)),
            }
        });
        let (lo, hi): (Vec<_>, Vec<_>) = bounds.unzip();
        let bounds = InputBounds::new(lo.clone(), hi.clone(), (-most, most)).unwrap();
        let set = ReachableSet::new(origin(), &bounds, class.speed_mps, class.step_s).unwrap();
        let settings = PolygonSettings::new(1e-3, 2).unwrap().conservative();
        let (tube, last) = (set.tube_polygon(settings), set.step_polygon(lo.len(), settings));
        Self { class, lo, hi, tube, last }
    }

    /// How far inside the polygons a drive stays, m.
    fn margin(&self, shares: &[f64]) -> f64 {
        let (mut pose, mut least) = (origin(), f64::INFINITY);
        let part_s = self.class.step_s / PARTS as f64;
        for (part, share) in shares.iter().enumerate() {
            let (lo, hi) = (self.lo[part / PARTS], self.hi[part / PARTS]);
            pose = dubins::arc(pose, self.class.speed_mps, lo + (hi - lo) * share, part_s);
            least = least.min(signed_distance(&self.tube, pose.position()));
        }
        least.min(signed_distance(&self.last, pose.position()))
    }

    /// The least margin that was found.
    fn search(&self, rng: &mut SeededRng) -> f64 {
        let parts = PARTS * self.lo.len();
        let drives = (0..DRIVES).map(|_| any_drive(parts, rng));
        let judged = drives.map(|drive| (self.margin(&drive), drive));
        let best = judged.min_by(|a, b| a.0.total_cmp(&b.0));
        let (mut least, mut shares) = best.expect("a drive");
        for _ in 0..CHANGES {
            let mut changed = shares.clone();
            let (from, length) = (rng.below(parts), 1 + rng.below(parts));
            let share = [0.0, 1.0, rng.unit()][rng.below(3)];
            changed.iter_mut().skip(from).take(length).for_each(|it| *it = share);
            let margin = self.margin(&changed);
            if margin < least {
                (least, shares) = (margin, changed);
            }
        }
        least
    }
}

#[test]
fn no_drive_that_tries_leaves_a_conservative_polygon() {
    let mut rng = SeededRng::new(77);
    for (i, class) in CLASSES.iter().enumerate() {
        let least = (0..class.sets).map(|_| Subject::any(class, &mut rng).search(&mut rng));
        let least = least.fold(f64::INFINITY, f64::min);
        println!("class {i}: {:.6} mm inside at least", 1e3 * least);
        assert!(least >= 0.0, "class {i}: {least}");
    }
}
