//! Sets for deliberately hard bounds: steps without a choice, bounds that just exclude or just
//! admit straight driving, and up to 50 steps. Drives that get as far out as possible stay inside.
//! The tests construct these drives by methods that the library does not use.

use super::{SPEED_MPS, STEP_S, origin, set};
use sidestep::math::{SeededRng, cos};
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::vehicle::dubins;

const ACCURACY_M: f64 = 1e-3;

/// Number of parts of a step. The rates can change between parts.
const PARTS: usize = 8;
const PART_S: f64 = STEP_S / PARTS as f64;

pub(super) struct Bounds {
    pub(super) lo: Vec<f64>,
    pub(super) hi: Vec<f64>,
}

impl Bounds {
    fn new(bounds: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let (lo, hi) = bounds.into_iter().unzip();
        Self { lo, hi }
    }

    /// Random bounds. Each step either takes one of up to three pairs of bounds, or draws a new
    /// pair.
    pub(super) fn hard(rng: &mut SeededRng, steps: usize) -> Self {
        let one = |rng: &mut SeededRng| {
            let (a, b) = (rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
            match rng.below(6) {
                0 => (a, a),
                1 => (0.0, 0.0),
                2 | 3 => (-0.5, -5e-4 * a.abs() - 1e-4),
                4 => (a.min(0.0), a.max(0.0)),
                _ => (a.min(b), a.max(b)),
            }
        };
        let pool: Vec<_> = (0..1 + rng.below(3)).map(|_| one(rng)).collect();
        let held = rng.below(2) == 0;
        Self::new((0..steps).map(|_| if held { pool[rng.below(pool.len())] } else { one(rng) }))
    }

    fn set(&self) -> ReachableSet {
        set(origin(), &self.lo, &self.hi)
    }

    fn parts(&self) -> usize {
        self.lo.len() * PARTS
    }

    /// Integrates the rate of each part, and returns the position after each part.
    fn drive(&self, mut rate: impl FnMut(usize, f64, (f64, f64)) -> f64) -> Vec<[f64; 2]> {
        let (mut pose, mut heading) = (origin(), 0.0);
        let parts = 0..self.parts();
        let drive = parts.map(|part| {
            let bounds = (self.lo[part / PARTS], self.hi[part / PARTS]);
            let rate = rate(part, heading, bounds).clamp(bounds.0, bounds.1);
            pose = dubins::arc(pose, SPEED_MPS, rate, PART_S);
            heading += rate * PART_S;
            pose.position()
        });
        drive.collect()
    }

    /// For the start of each part and for the end, the heading from which the vehicle can still get
    /// farthest in direction 0. Uses dynamic programming over headings.
    fn ridge(&self) -> Vec<f64> {
        const COUNT: usize = 801;
        const SPACING: f64 = 6.6 / (COUNT - 1) as f64;
        let heading = |i: usize| i as f64 * SPACING - 3.3;
        let mut gain = vec![0.0; COUNT];
        let mut ridge = vec![0.0; self.parts() + 1];
        for part in (0..self.parts()).rev() {
            let (lo, hi) = (self.lo[part / PARTS], self.hi[part / PARTS]);
            let next = ridge[part + 1];
            let after = |at: f64| {
                let place = ((at + 3.3) / SPACING).clamp(0.0, COUNT as f64 - 1.001);
                let share = place.fract();
                gain[place as usize] * (1.0 - share) + gain[place as usize + 1] * share
            };
            let before: Vec<f64> = (0..COUNT)
                .map(|i| {
                    let turn = (next - heading(i)).clamp(lo * PART_S, hi * PART_S);
                    PART_S * cos(heading(i) + 0.5 * turn) + after(heading(i) + turn)
                })
                .collect();
            gain = before;
            let moved = next - 0.5 * (lo + hi) * PART_S;
            let mut i = (((moved + 3.3) / SPACING).round() as usize).clamp(1, COUNT - 2);
            while i + 2 < COUNT && gain[i + 1] > gain[i] {
                i += 1;
            }
            while i > 1 && gain[i - 1] > gain[i] {
                i -= 1;
            }
            let bend = gain[i - 1] - 2.0 * gain[i] + gain[i + 1];
            let off = 0.5 * (gain[i - 1] - gain[i + 1]) / bend.min(-1e-14);
            ridge[part] = heading(i) + off.clamp(-1.0, 1.0) * SPACING;
        }
        ridge
    }
}

/// Polygons of a set, drawn only once.
struct Drawn {
    tube: Vec<[f64; 2]>,
    last: Vec<[f64; 2]>,
}

impl Drawn {
    fn new(bounds: &Bounds, settings: PolygonSettings) -> Self {
        let set = bounds.set();
        let last = set.step_polygon(set.steps(), settings);
        Self { tube: set.tube_polygon(settings), last }
    }

    /// How far inside the polygons a drive stays (m). Negative if a position is outside.
    fn margin(&self, drive: &[[f64; 2]]) -> f64 {
        let along = drive.iter().step_by(3).map(|position| -signed_distance(&self.tube, *position));
        along.fold(-signed_distance(&self.last, drive[drive.len() - 1]), f64::min)
    }
}

fn exact() -> PolygonSettings {
    PolygonSettings::new(ACCURACY_M, 4).unwrap()
}

/// Drives that get as far as possible in many directions stay inside.
fn check_front(bounds: &Bounds) {
    let drawn = [exact(), exact().conservative()].map(|settings| Drawn::new(bounds, settings));
    let ridge = bounds.ridge();
    let turned: f64 = bounds.hi.iter().map(|hi| hi.max(0.0) * STEP_S).sum();
    let right: f64 = bounds.lo.iter().map(|lo| lo.min(0.0) * STEP_S).sum();
    for i in 0..=60 {
        let direction = right + (turned - right) * f64::from(i) / 60.0;
        let drive =
            bounds.drive(|part, heading, _| (direction + ridge[part + 1] - heading) / PART_S);
        assert!(drawn[0].margin(&drive) > -ACCURACY_M, "{:?} {:?}", bounds.lo, bounds.hi);
        assert!(drawn[1].margin(&drive) >= 0.0, "{:?} {:?}", bounds.lo, bounds.hi);
    }
}

#[test]
fn extremals_that_part_faster_than_digits_tell_leave_no_gap_in_the_front() {
    // A chord once cut off 2.8 m of this front.
    let (no_choice, nearly_straight) =
        ((0.156_562_969_026_367_57, 0.156_562_969_026_367_57), (-0.5, -2.009_223_919_059_104e-4));
    let steps = "NNNNcNccc NNNNNN ccccccccccc NN c NNNN cccc NNNNNNNNNNNNN";
    let steps = steps.chars().filter(|step| *step != ' ');
    check_front(&Bounds::new(
        steps.map(|step| if step == 'c' { no_choice } else { nearly_straight }),
    ));
    let mut rng = SeededRng::new(3);
    for steps in [5, 8, 10, 12, 15, 15, 20, 25, 25, 50] {
        check_front(&Bounds::hard(&mut rng, steps));
    }
}

#[test]
fn turning_more_than_half_a_circle_the_tube_is_closed_on_its_inner_side() {
    let bounds = Bounds::new([(-0.5, -0.438_788_117_642_944_06); 50]);
    check_front(&bounds);
    let drawn = Drawn::new(&bounds, exact());
    for jump in 0..bounds.parts() {
        let drive = bounds.drive(|part, _, (lo, hi)| if part < jump { hi } else { lo });
        assert!(drawn.margin(&drive) > -ACCURACY_M, "{jump}");
    }
}

/// The ends of all drives with up to two switches between the bounds are inside.
fn check_rear(bounds: &Bounds, settings: PolygonSettings) {
    let drawn = Drawn::new(bounds, settings);
    let parts = bounds.parts();
    for first in (0..parts).step_by(2) {
        for second in (first..=parts).step_by(2) {
            for high in [false, true] {
                let drive =
                    bounds.drive(
                        |part, _, (lo, hi)| {
                            if (first..second).contains(&part) == high { hi } else { lo }
                        },
                    );
                let margin = -signed_distance(&drawn.last, drive[parts - 1]);
                assert!(
                    margin > -settings.accuracy_m(),
                    "{margin} {:?} {:?}",
                    bounds.lo,
                    bounds.hi
                );
            }
        }
    }
}

#[test]
fn paths_that_jump_twice_where_bounds_are_narrow_do_not_stay_farther_back() {
    let settings = PolygonSettings::new(1e-4, 4).unwrap();
    // Straight driving is always admissible. Nevertheless, the paths with one switch miss the rear
    // boundary by 2.4 mm.
    check_rear(
        &Bounds::new([
            (0.0, 0.496),
            (-0.5, 0.5),
            (0.0, 0.333),
            (0.0, 0.0),
            (0.0, 0.0),
            (0.0, 0.0),
            (-0.5, 0.0),
            (-0.491, 0.0),
        ]),
        settings,
    );
    let mut rng = SeededRng::new(9);
    for i in 0..60 {
        let rates = [0.0, 0.02, 0.5];
        let any = |rng: &mut SeededRng| rng.uniform(-0.5, 0.5);
        let bounds = Bounds::new((0..4 + rng.below(7)).map(|_| {
            if i % 2 == 0 {
                (-rates[rng.below(3)], rates[rng.below(3)])
            } else {
                let (a, b) = (any(&mut rng), any(&mut rng));
                (a.min(b), a.max(b))
            }
        }));
        check_rear(&bounds, settings);
    }
}
