//! Tests the guarantees with drives that try to break them, with up to half a turn per step and up
//! to 100 steps. Conservative polygons and convex hulls contain every drive. Other polygons miss no
//! drive by more than their accuracy. Every state of a drive is a member. Some drives change their
//! rates and speeds within steps.

use super::classes::{CLASSES, Class};
use super::region::Region;
use super::{any_drive, origin};
use sidestep::bounds::InputBounds;
use sidestep::math::{SeededRng, exp};
use sidestep::reach::{Membership, Outline, PolygonSettings, ReachableSet, Tolerance, Workspace};
use sidestep::vehicle::{Pose, SpeedRange, dubins};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of parts of a step. A drive has one turn rate and one speed in each part.
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
    /// Lowest and highest speed of each step.
    speeds: Vec<[f64; 2]>,
    set: ReachableSet,
    /// Polygons of the tube and of the last step.
    surely: [Region; 2],
    exact: [Region; 2],
    hulls: [Region; 2],
}

impl Subject {
    fn of(
        class: &'static Class,
        bounds: &InputBounds,
        speeds: Vec<SpeedRange>,
        rng: &mut SeededRng,
    ) -> Self {
        let (count, lo, hi) = (bounds.steps(), bounds.lo().to_vec(), bounds.hi().to_vec());
        let ranges = speeds.iter().cycle().take(count);
        let ranges = ranges.map(|range| [range.lo_mps(), range.hi_mps()]).collect();
        let set = ReachableSet::with_speeds(origin(), bounds, speeds, class.step_s).unwrap();
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
        Self { class, lo, hi, speeds: ranges, set, surely, exact, hulls }
    }

    /// The poses after each part. `shares` has the turn rate of each part and then the speed of each part, as
    /// positions from 0 to 1 in their ranges.
    fn poses(&self, shares: &[f64]) -> impl Iterator<Item = Pose> {
        let part_s = self.class.step_s / PARTS as f64;
        let (rates, speeds) = shares.split_at(shares.len() / 2);
        rates.iter().zip(speeds).enumerate().scan(origin(), move |pose, (part, (rate, speed))| {
            let step = part / PARTS;
            let (lo, hi, [slow, fast]) = (self.lo[step], self.hi[step], self.speeds[step]);
            let (rate, speed) = (lo + (hi - lo) * rate, slow + (fast - slow) * speed);
            *pose = dubins::arc(*pose, speed, rate, part_s);
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
        let (mut least, mut best, mut open) = (f64::INFINITY, vec![0.0; 2 * parts], None);
        let one_speed = self.speeds.iter().all(|[slow, fast]| slow == fast);
        for i in 0..effort.drives {
            let drive = if i < effort.drives / 2 {
                let mut drive = any_drive(parts, rng);
                if one_speed {
                    drive.resize(2 * parts, 0.0);
                } else {
                    drive.extend(any_drive(parts, rng));
                }
                drive
            } else {
                let mut drive = best.clone();
                // Varies the turn rates or the speeds.
                let of = if !one_speed && rng.below(2) == 0 { parts } else { 0 };
                let (from, length) = (rng.below(parts), 1 + rng.below(parts));
                let share = [0.0, 1.0, rng.unit()][rng.below(3)];
                let varied = &mut drive[of..of + parts];
                varied.iter_mut().skip(from).take(length).for_each(|it| *it = share);
                drive
            };
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

/// The speeds of a set with this number of steps.
type Speeds = fn(&Class, usize, &mut SeededRng) -> Vec<SpeedRange>;

fn constant(class: &Class, _: usize, _: &mut SeededRng) -> Vec<SpeedRange> {
    vec![class.speed_mps.into()]
}

/// One range for all steps, or a range for each step. Some begin at 0, some have only one speed, and in some
/// steps the vehicle stands. In a quarter of the sets, every step has only one speed.
fn ranges(class: &Class, steps: usize, rng: &mut SeededRng) -> Vec<SpeedRange> {
    let constant = rng.below(4) == 0;
    let range = |rng: &mut SeededRng| {
        let (a, b) = (class.speed_mps * rng.unit(), class.speed_mps * rng.unit());
        match rng.below(6) {
            0 => SpeedRange::new(0.0, 0.0),
            _ if constant => SpeedRange::new(a, a),
            1 => SpeedRange::new(0.0, a),
            2 => SpeedRange::new(a, a),
            _ => SpeedRange::new(a.min(b), a.max(b)),
        }
        .unwrap()
    };
    let count = if rng.below(2) == 0 { 1 } else { steps };
    let mut all: Vec<_> = (0..count).map(|_| range(rng)).collect();
    // At least one step has another speed than 0.
    all[0] = SpeedRange::new(all[0].lo_mps(), all[0].hi_mps().max(0.1)).unwrap();
    all
}

/// Searches for drives that break a guarantee, on two threads and with `sets` bounds of each class.
fn search(
    sets: [usize; 6],
    effort: Effort,
    seed: u64,
    bounds: fn(&Class, &mut SeededRng) -> InputBounds,
    speeds: Speeds,
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
            let bounds = bounds(class, &mut rng);
            let speeds = speeds(class, bounds.steps(), &mut rng);
            let subject = Subject::of(class, &bounds, speeds, &mut rng);
            let (least, drive, missed) = subject.search(effort, &mut rng);
            if least < 0.0 || missed {
                println!(
                    "{least} m by {drive:?}, missed {missed}, bounds {:?} {:?}, speeds {:?}",
                    subject.lo, subject.hi, subject.speeds
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
    search([30, 20, 20, 10, 10, 3], effort, 77, Class::bounds, constant);
    search([30, 20, 20, 10, 10, 3], effort, 78, Class::grazing, constant);
    search([30, 20, 20, 10, 10, 3], effort, 79, Class::bounds, ranges);
    search([30, 20, 20, 10, 10, 3], effort, 80, Class::grazing, ranges);
}

/// Run with `cargo test --release -p sidestep --test reach -- --ignored --nocapture full_size`. Set
/// `SETS=1000` for a shorter run, `CLASS=4` for one class, `GRAZING=1` for bounds that often just exclude
/// straight driving, and `SPEEDS=1` for ranges of speeds.
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
    let speeds = if of("SPEEDS").is_some() { ranges } else { constant };
    search(each, effort, seed, bounds, speeds);
}
