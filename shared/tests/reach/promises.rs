//! Tests the guarantees with drives that try to break them, with up to half a turn per step and up
//! to 100 steps. Conservative polygons and convex hulls contain every drive. Other polygons miss no
//! drive by more than their accuracy. Every state of a drive is a member. Some drives change their
//! rates within steps.

use super::classes::{CLASSES, Class};
use super::region::Region;
use super::{any_drive, origin};
use sidestep::bounds::InputBounds;
use sidestep::math::{SeededRng, exp};
use sidestep::reach::{Membership, Outline, PolygonSettings, ReachableSet, Tolerance, Workspace};
use sidestep::vehicle::{Pose, dubins};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of parts of a step. A drive has one turn rate in each part.
const PARTS: usize = 4;

/// Number of drives per set, and how many of their end states are tested for membership. Half of
/// the drives are random, and half are variations of the drive that got farthest out.
#[derive(Clone, Copy)]
struct Effort {
    drives: usize,
    states: usize,
}

struct Subject {
    class: &'static Class,
    lo: Vec<f64>,
    hi: Vec<f64>,
    set: ReachableSet,
    /// Polygons of the tube and of the last step.
    surely: [Region; 2],
    exact: [Region; 2],
    hulls: [Region; 2],
}

impl Subject {
    fn of(class: &'static Class, bounds: &InputBounds, rng: &mut SeededRng) -> Self {
        let (count, lo, hi) = (bounds.steps(), bounds.lo().to_vec(), bounds.hi().to_vec());
        let set = ReachableSet::new(origin(), bounds, class.speed_mps, class.step_s).unwrap();
        // An accuracy from 1 mm to 5 cm.
        let settings = PolygonSettings::new(1e-3 * exp(rng.uniform(0.0, 4.0)), 2).unwrap();
        let mut workspace = Workspace::default();
        let mut region = |settings, tube| {
            let mut polygon = Vec::new();
            let outline = if tube {
                set.tube_polygon_into(settings, &mut workspace, &mut polygon)
            } else {
                set.step_polygon_into(count, settings, &mut workspace, &mut polygon)
            };
            let follows = outline == Outline::Refined { margin_m: 0.0 };
            Region::new(polygon, if follows { settings.accuracy_m() } else { 0.0 })
        };
        let mut both = |settings| [true, false].map(|tube| region(settings, tube));
        let surely = both(settings.conservative().with_most_work(1_000_000));
        let (exact, hulls) = (both(settings), both(settings.with_most_work(0)));
        Self { class, lo, hi, set, surely, exact, hulls }
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

    /// How far inside the polygons a drive stays (m), and where it ends. The last position is
    /// compared with the polygons of the last step. The positions at the ends of part `from` and of all
    /// later parts are compared with the polygons of the tube. If the margin exceeds `least`, returns `least`.
    fn margin(&self, shares: &[f64], from: usize, mut least: f64) -> (f64, Pose) {
        let mut end = origin();
        for (part, pose) in self.poses(shares).enumerate() {
            end = pose;
            if part >= from {
                for [tube, _] in [&self.surely, &self.exact, &self.hulls] {
                    least = least.min(tube.margin(pose.position(), least));
                }
            }
        }
        for [_, last] in [&self.surely, &self.exact, &self.hulls] {
            least = least.min(last.margin(end.position(), least));
        }
        (least, end)
    }

    /// Returns the smallest margin found, the drive with this margin (as positions between the
    /// bounds), and whether a state was missed.
    fn search(&self, effort: Effort, rng: &mut SeededRng) -> (f64, Vec<f64>, bool) {
        let parts = PARTS * self.lo.len();
        // The start is on the boundary of each tube. Therefore the tube is checked only from a
        // random part on.
        let from = rng.below(parts);
        let (mut least, mut best, mut open) = (f64::INFINITY, vec![0.0; parts], None);
        for i in 0..effort.drives {
            let mut drive =
                if i < effort.drives / 2 { any_drive(parts, rng) } else { best.clone() };
            if i >= effort.drives / 2 {
                let (from, length) = (rng.below(parts), 1 + rng.below(parts));
                let share = [0.0, 1.0, rng.unit()][rng.below(3)];
                drive.iter_mut().skip(from).take(length).for_each(|it| *it = share);
            }
            let (margin, end) = self.margin(&drive, from, least);
            if margin < least {
                (least, best) = (margin, drive);
            }
            if i % effort.drives.div_ceil(effort.states) == 0 && open.is_none() {
                let tolerance = Tolerance::default();
                let found = self.set.state_membership(self.lo.len(), end, tolerance, 0);
                open = (found == Membership::Open).then_some(end);
            }
        }
        // For one in four sets, run the full membership test on a state that the limited test
        // leaves open.
        let missed = open.filter(|_| rng.below(4) == 0).is_some_and(|state| {
            !self.set.contains_state(self.lo.len(), state, Tolerance::default())
        });
        (least, best, missed)
    }
}

/// Results for some sets.
#[derive(Clone, Copy, Default)]
struct Found {
    sets: usize,
    outside: usize,
    missed: usize,
}

/// Searches for drives that break a guarantee, on two threads and with `sets` bounds of each class.
fn search(
    sets: [usize; 6],
    effort: Effort,
    seed: u64,
    bounds: fn(&Class, &mut SeededRng) -> InputBounds,
) {
    let mut broken = 0;
    let chosen = CLASSES.iter().zip(sets).enumerate().filter(|(_, (_, count))| *count > 0);
    for (i, (class, count)) in chosen {
        let (next, all) = (AtomicUsize::new(0), Mutex::new(Found::default()));
        let worker = || loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            if place >= count {
                return;
            }
            if place > 0 && place.is_multiple_of(1000) {
                println!("class {i}: {place} of {count} bounds begun");
            }
            let mut rng = SeededRng::new(seed + (1_000_000 * i + place) as u64);
            let subject = Subject::of(class, &bounds(class, &mut rng), &mut rng);
            let (least, drive, missed) = subject.search(effort, &mut rng);
            if least < 0.0 || missed {
                println!(
                    "{least} m by {drive:?}, missed {missed}, bounds {:?} {:?}",
                    subject.lo, subject.hi
                );
            }
            let mut all = all.lock().unwrap();
            all.sets += 1;
            all.outside += usize::from(least < 0.0);
            all.missed += usize::from(missed);
        };
        std::thread::scope(|scope| {
            scope.spawn(worker);
            worker();
        });
        let Found { sets, outside, missed } = all.into_inner().unwrap();
        println!(
            "class {i}, {sets} bounds: {outside} with a drive outside, {missed} with a missed state"
        );
        broken += outside + missed;
    }
    assert_eq!(broken, 0);
}

#[test]
fn no_drive_that_tries_breaks_a_promise() {
    let effort = Effort { drives: 120, states: 30 };
    search([30, 20, 20, 10, 10, 3], effort, 77, Class::bounds);
    search([30, 20, 20, 10, 10, 3], effort, 78, Class::grazing);
}

/// Run with `cargo test --release -p sidestep --test reach -- --ignored --nocapture full_size`. Set
/// `SETS=1000` for a shorter run, `CLASS=4` for one class, and `GRAZING=1` for bounds that often
/// just exclude straight driving.
#[test]
#[ignore = "a search of its own, of about an hour"]
fn a_search_of_full_size() {
    let of = |name| std::env::var(name).ok().map(|number| number.parse().expect("a number"));
    let sets = of("SETS").unwrap_or(100_000) / CLASSES.len();
    let each =
        core::array::from_fn(|i| if of("CLASS").is_none_or(|class| class == i) { sets } else { 0 });
    let effort = Effort { drives: 1000, states: 50 };
    let seed = of("SEED").unwrap_or(1) as u64;
    let bounds = if of("GRAZING").is_some() { Class::grazing } else { Class::bounds };
    search(each, effort, seed, bounds);
}
