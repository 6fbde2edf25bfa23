//! Promises against drives that try to break them, at turns of up to half a turn a step and over up to 100 steps:
//! conservative polygons and convex hulls contain every drive, and membership every state that a drive leads to.

use super::{any_drive, origin};
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng};
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};
use std::time::Instant;

/// Bounds are drawn for up to `steps` steps and turn rates of up to `most` rad/s to both sides.
struct Class {
    speed_mps: f64,
    step_s: f64,
    most: f64,
    steps: usize,
    /// Bounds in the small search.
    sets: usize,
}

const fn class(speed_mps: f64, step_s: f64, most: f64, steps: usize, sets: usize) -> Class {
    Class { speed_mps, step_s, most, steps, sets }
}

const CLASSES: [Class; 6] = [
    class(2.0, 0.2, 0.5, 15, 30),
    class(10.0, 0.5, 3.0, 12, 20),
    class(2.0, 0.2, 3.0, 25, 20),
    class(1.5, 0.1, 6.0, 50, 10),
    class(2.0, 0.2, 0.5, 100, 10),
    class(2.0, 1.0, PI, 100, 3),
];

/// Parts of a step in which a drive has one turn rate.
const PARTS: usize = 4;

/// Random drives of each set, and changes to the one that got farthest out.
#[derive(Clone, Copy)]
struct Effort {
    drives: usize,
    changes: usize,
}

struct Subject {
    class: &'static Class,
    lo: Vec<f64>,
    hi: Vec<f64>,
    set: ReachableSet,
    /// Of the tube and the last step: conservative ones, and convex hulls.
    surely: [Vec<[f64; 2]>; 2],
    hulls: [Vec<[f64; 2]>; 2],
    /// That a polygon took at most, s.
    slowest: f64,
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
        let settings = PolygonSettings::new(1e-3, 2).unwrap();
        let mut slowest = 0.0_f64;
        let mut both = |settings| {
            [true, false].map(|tube| {
                let begun = Instant::now();
                let polygon = if tube {
                    set.tube_polygon(settings)
                } else {
                    set.step_polygon(lo.len(), settings)
                };
                slowest = slowest.max(begun.elapsed().as_secs_f64());
                polygon
            })
        };
        let surely = both(settings.conservative());
        let hulls = both(settings.with_most_work(0));
        both(settings);
        Self { class, lo, hi, set, surely, hulls, slowest }
    }

    /// The poses after each part.
    fn poses(&self, shares: &[f64]) -> impl Iterator<Item = Pose> {
        let part_s = self.class.step_s / PARTS as f64;
        shares.iter().enumerate().scan(origin(), move |pose, (part, share)| {
            let (lo, hi) = (self.lo[part / PARTS], self.hi[part / PARTS]);
            *pose = dubins::arc(*pose, self.class.speed_mps, lo + (hi - lo) * share, part_s);
            Some(*pose)
        })
    }

    /// How far inside the polygons of tube and last step a drive stays, m.
    fn margin(&self, [tube, last]: &[Vec<[f64; 2]>; 2], shares: &[f64]) -> f64 {
        let (mut least, mut end) = (f64::INFINITY, origin());
        for pose in self.poses(shares) {
            least = least.min(-signed_distance(tube, pose.position()));
            end = pose;
        }
        least.min(-signed_distance(last, end.position()))
    }

    fn margin_of_conservative(&self, shares: &[f64]) -> f64 {
        self.margin(&self.surely, shares)
    }

    fn margin_of_hulls(&self, shares: &[f64]) -> f64 {
        self.margin(&self.hulls, shares)
    }

    /// How far inside, m, the curves of membership have the state at the end of a drive.
    fn state_margin(&self, shares: &[f64]) -> f64 {
        let end = self.poses(shares).last().expect("a part");
        let steps = self.lo.len();
        assert!(
            self.set.contains_state(steps, end, Tolerance::default()),
            "{end:?} is missed: {shares:?} of lo {:?} hi {:?}",
            self.lo,
            self.hi
        );
        self.set.state_margins(steps, end).position_m
    }

    /// The least margin that was found.
    fn search(
        &self,
        margin: impl Fn(&Self, &[f64]) -> f64,
        effort: Effort,
        rng: &mut SeededRng,
    ) -> f64 {
        let parts = PARTS * self.lo.len();
        let drives = (0..effort.drives).map(|_| any_drive(parts, rng));
        let judged = drives.map(|drive| (margin(self, &drive), drive));
        let best = judged.min_by(|a, b| a.0.total_cmp(&b.0));
        let (mut least, mut shares) = best.expect("a drive");
        for _ in 0..effort.changes {
            let mut changed = shares.clone();
            let (from, length) = (rng.below(parts), 1 + rng.below(parts));
            let share = [0.0, 1.0, rng.unit()][rng.below(3)];
            changed.iter_mut().skip(from).take(length).for_each(|it| *it = share);
            let found = margin(self, &changed);
            if found < least {
                (least, shares) = (found, changed);
            }
        }
        least
    }
}

/// Searches for drives that break a promise; `sets` bounds of each class.
fn search(sets: impl Fn(&Class) -> usize, polygons: Effort, states: Effort, seed: u64) {
    let mut rng = SeededRng::new(seed);
    for (i, class) in CLASSES.iter().enumerate() {
        let (mut least, mut missed, mut slowest) = (f64::INFINITY, 0, 0.0_f64);
        let count = sets(class);
        for _ in 0..count {
            let subject = Subject::any(class, &mut rng);
            slowest = slowest.max(subject.slowest);
            for margin in [Subject::margin_of_conservative, Subject::margin_of_hulls] {
                let margin = subject.search(margin, polygons, &mut rng);
                assert!(margin >= 0.0, "{margin} m, lo {:?} hi {:?}", subject.lo, subject.hi);
                least = least.min(margin);
            }
            let margin = subject.search(Subject::state_margin, states, &mut rng);
            missed += usize::from(margin < -Tolerance::default().position_m);
        }
        println!(
            "class {i}, {count} bounds: {:.6} mm inside at least; {:.1} ms at most; curves missed \
             states of {missed}",
            1e3 * least,
            1e3 * slowest
        );
    }
}

#[test]
fn no_drive_that_tries_breaks_a_promise() {
    let polygons = Effort { drives: 60, changes: 60 };
    let states = Effort { drives: 10, changes: 20 };
    search(|class| class.sets, polygons, states, 77);
}

/// `cargo test --release -p sidestep --test reach -- --ignored --nocapture full_size`, with `SETS=1000` for a shorter one.
#[test]
#[ignore = "takes hours"]
fn a_search_of_full_size() {
    let sets = std::env::var("SETS").map_or(100_000, |sets| sets.parse().expect("a number"));
    let seed = std::env::var("SEED").map_or(1, |seed| seed.parse().expect("a number"));
    let effort = Effort { drives: 500, changes: 500 };
    search(|_| sets / CLASSES.len(), effort, Effort { drives: 50, changes: 50 }, seed);
}
