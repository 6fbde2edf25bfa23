//! Worst-case times of polygons and membership tests with the default settings: `cargo xtask bench
//! reach`. The bounds are random, in six classes, with up to half a turn per step and up to 100
//! steps. Half of the sets have an uncertain start.
//!
//! If a time is a new maximum, the operation is timed twice more, and the fastest time counts,
//! because other load on the machine disturbs it least. `-- --sets 1000 --seed 7` draws other sets.
//! `-- --sets 1` with the printed seed draws the slowest set again.

#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

#[path = "../tests/reach/classes.rs"]
mod classes;
#[path = "../tests/reach/starts.rs"]
mod starts;

use std::hint::black_box;
use std::time::Instant;

use classes::{CLASSES, Class};
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng, exp};
use sidestep::reach::{Outline, Workspace};
use sidestep::reach::{PolygonSettings, PositionUncertainty, ReachableSet, StartSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};
use starts::pose_at;

/// Upper bound on every time (ms).
const BUDGET_MS: f64 = 100.0;
/// The timed operations.
const WORK: [&str; 7] = [
    "step polygon",
    "tube polygon",
    "conservative step polygon",
    "conservative tube polygon",
    "membership of a state",
    "membership of a drive",
    "margins of a state",
];

fn main() {
    let (sets, seed) = (option("--sets").unwrap_or(200), option("--seed").unwrap_or(1));
    println!("the slowest of {sets} bounds in each class, ms (budget {BUDGET_MS}):");
    println!("{:28} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}", "class", 0, 1, 2, 3, 4, 5);
    let slowest = CLASSES.each_ref().map(|class| slowest_of(class, sets, seed));
    for (i, name) in WORK.iter().enumerate() {
        let row: String = slowest.iter().map(|works| format!(" {:7.2}", works[i].ms)).collect();
        println!("{name:28}{row}");
    }
    let all = slowest.iter().enumerate().flat_map(|(class, works)| works.map(|work| (class, work)));
    let (class, Slowest { ms, seed }) =
        all.max_by(|a, b| a.1.ms.total_cmp(&b.1.ms)).expect("six classes");
    println!(
        "slowest: {ms:.1} ms, {:.2} of the budget, class {class}, seed {seed}",
        ms / BUDGET_MS
    );
}

/// The maximum time of one operation, and the seed of the set that took it.
#[derive(Clone, Copy, Default)]
struct Slowest {
    ms: f64,
    seed: u64,
}

impl Slowest {
    /// Updates the maximum if `work` on the set of this seed takes longer.
    fn time<T>(&mut self, seed: u64, mut work: impl FnMut() -> T) {
        let mut fastest_ms = f64::INFINITY;
        for _ in 0..3 {
            let start = Instant::now();
            black_box(work());
            fastest_ms = fastest_ms.min(1e3 * start.elapsed().as_secs_f64());
            if fastest_ms <= self.ms {
                return;
            }
        }
        *self = Self { ms: fastest_ms, seed };
    }
}

/// The number after the option `name`.
fn option(name: &str) -> Option<u64> {
    std::env::args().skip_while(|word| word != name).nth(1)?.parse().ok()
}

/// The maximum time of each operation, over the sets of `seed` and the following seeds.
fn slowest_of(class: &Class, sets: u64, seed: u64) -> [Slowest; 7] {
    let mut workspace = Workspace::default();
    let mut slowest = [Slowest::default(); 7];
    for seed in seed..seed + sets {
        let mut rng = SeededRng::new(seed);
        let bounds = class.bounds(&mut rng);
        let start = start(&mut rng);
        let set = ReachableSet::new(start, &bounds, class.speed_mps, class.step_s);
        let set = set.expect("a start, bounds and a vehicle that are accepted");
        let steps = set.steps();
        // Two thirds of the sets use an accuracy of 5 mm, and the others a random accuracy from 1
        // mm to 5 cm.
        let accuracy_m = 1e-3 * if rng.below(3) == 0 { exp(rng.uniform(0.0, 4.0)) } else { 5.0 };
        let settings = PolygonSettings::new(accuracy_m, 2).expect("an accuracy");
        let shares = [0; 3].map(|_| rng.uniform(-1.0, 1.0));
        let drive = drive(class, &bounds, pose_at(&start, shares), &mut rng);
        let last = drive[steps - 1];
        let mut polygon = Vec::new();
        let mut step = |settings| -> Outline {
            set.step_polygon_into(steps, settings, &mut workspace, &mut polygon)
        };
        slowest[0].time(seed, || step(settings));
        slowest[2].time(seed, || step(settings.conservative()));
        let mut tube =
            |settings| -> Outline { set.tube_polygon_into(settings, &mut workspace, &mut polygon) };
        slowest[1].time(seed, || tube(settings));
        slowest[3].time(seed, || tube(settings.conservative()));
        slowest[4].time(seed, || set.contains_state(steps, last, Tolerance::default()));
        slowest[6].time(seed, || set.state_margins(steps, last));
        slowest[5].time(seed, || set.contains_states(&drive, Tolerance::default()));
    }
    slowest
}

/// A random start. In half of the cases, the position is uncertain. In half of these cases, the
/// heading is uncertain too.
fn start(rng: &mut SeededRng) -> StartSet {
    let pose = Pose::new(1.0, -2.0, rng.uniform(-PI, PI));
    let position = match rng.below(4) {
        0 => PositionUncertainty::Disc { radius_m: rng.unit() },
        1 => PositionUncertainty::Box { along_m: rng.unit(), across_m: rng.unit() },
        _ => return pose.into(),
    };
    let heading_rad = [0.0, PI * rng.unit()][rng.below(2)];
    StartSet::new(pose, position, heading_rad).expect("a start")
}

/// The poses after each step of a random drive. Its turn rates are at the bounds, between them, or
/// slightly beyond one of them, so that membership tests include hard cases.
fn drive(class: &Class, bounds: &InputBounds, from: Pose, rng: &mut SeededRng) -> Vec<Pose> {
    let beyond = [0.0, 0.02][rng.below(2)];
    let mut pose = from;
    let drive = bounds.lo().iter().zip(bounds.hi()).map(|(lo, hi)| {
        let share = [0.0, 1.0, rng.unit()][rng.below(3)];
        let rate = lo + (hi - lo) * share + beyond * class.most * (2.0 * rng.unit() - 1.0);
        pose = dubins::arc(pose, class.speed_mps, rate, class.step_s);
        pose
    });
    drive.collect()
}
