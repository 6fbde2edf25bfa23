//! Reachable states that polygons and membership missed. A test of a defect that is known asserts that
//! it is still there.

use super::{origin, random_drive, set};
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};

/// A drive with `inputs` within the bounds, at a speed, m/s, and step, s.
struct Case {
    speed_mps: f64,
    step_s: f64,
    lo: &'static [f64],
    hi: &'static [f64],
    inputs: &'static [f64],
}

impl Case {
    fn set(&self) -> ReachableSet {
        let admissible = |((lo, hi), input)| lo <= input && input <= hi;
        assert!(self.lo.iter().zip(self.hi).zip(self.inputs).all(admissible));
        let bounds = InputBounds::new(self.lo.to_vec(), self.hi.to_vec(), (-3.0, 3.0)).unwrap();
        ReachableSet::new(origin(), &bounds, self.speed_mps, self.step_s).unwrap()
    }

    fn end(&self) -> Pose {
        let step = |pose, rate: &f64| dubins::arc(pose, self.speed_mps, *rate, self.step_s);
        self.inputs.iter().fold(origin(), step)
    }

    /// How far outside the conservative polygon of 1 mm accuracy the drive ends, m.
    fn outside_m(&self) -> f64 {
        let settings = PolygonSettings::new(1e-3, 16).unwrap().conservative();
        let polygon = self.set().step_polygon(self.inputs.len(), settings);
        signed_distance(&polygon, self.end().position())
    }
}

const THREE: Case = Case {
    speed_mps: 10.0,
    step_s: 0.5,
    lo: &[-2.79, 2.12, -2.85],
    hi: &[1.15, 2.86, -2.0],
    inputs: &[-2.79, 2.86, -2.85],
};
const SIX: Case = Case {
    speed_mps: 10.0,
    step_s: 0.5,
    lo: &[-1.97, 2.61, -1.67, 0.93, 0.1, -2.14],
    hi: &[1.78, 2.74, 2.91, 1.75, 0.8, 0.8],
    inputs: &[1.78, 2.61, 2.91, 1.75, 0.8, 0.8],
};
const NINE: Case = Case {
    speed_mps: 10.0,
    step_s: 0.5,
    lo: &[0.0, -0.78, 0.0, 0.0, 0.0, -1.36, 0.0, 0.0, 1.33],
    hi: &[0.0, 2.53, 0.0, 0.0, 0.0, -0.7, 0.0, 0.0, 2.53],
    inputs: &[0.0, 2.53, 0.0, 0.0, 0.0, -1.36, 0.0, 0.0, 2.17],
};

const FIVE: Case = Case {
    speed_mps: 2.0,
    step_s: 0.2,
    lo: &[-2.27, 1.34, -1.81, -2.53, -2.17],
    hi: &[1.25, 1.79, 2.16, -0.29, 0.48],
    inputs: &[-2.27, 1.34, 2.16, -2.53, 0.48],
};
const SEVEN: Case = Case {
    speed_mps: 2.0,
    step_s: 0.2,
    lo: &[-0.52, 2.8, -2.33, -1.34, -2.75, -2.05, 1.79],
    hi: &[1.71, 2.94, 2.65, 1.95, 2.01, -1.43, 2.67],
    inputs: &[-0.52, 2.8, 2.65, 1.95, -2.75, -2.05, 2.67],
};

/// At up to 1.5 rad a step these drives were once outside, by up to 390 mm.
#[test]
fn conservative_polygons_contain_drives_at_large_turns_per_step() {
    for case in [THREE, SIX, NINE] {
        let outside_mm = 1e3 * case.outside_m();
        eprintln!("{} steps: {outside_mm:.1} mm outside", case.inputs.len());
        assert!(outside_mm <= 0.0, "{outside_mm} mm");
    }
}

/// The curves of membership miss states that these drives reach: they once counted as outside.
#[test]
fn membership_misses_no_state_at_large_turns_per_step() {
    let [five, seven] = [FIVE, SEVEN].map(|case| {
        let (steps, set) = (case.inputs.len(), case.set());
        assert!(set.contains_state(steps, case.end(), Tolerance::default()));
        1e3 * set.state_margins(steps, case.end()).position_m
    });
    eprintln!("{five:.1} mm, {seven:.1} mm");
    assert!(five < -1.0 && seven < -5.0, "mended? {five} {seven}");
}

/// At the paper's rates a polygon of 0.1 mm accuracy once passed inside two drives, by 0.147 mm and 0.194 mm: their rate
/// switches twice, and such paths bound the set only for a short range of end headings. The first is drive 7 of the property
/// test, with the random seed that found these bounds.
#[test]
fn a_polygon_misses_no_drive_that_switches_twice() {
    const PARTS: usize = 8;
    const HELD: f64 = -0.306_704_263_219_932_4;
    const RIGHT: f64 = -0.405_246_030_126_519_55;
    const LEFT: f64 = 0.282_760_182_643_193_9;
    let lo = [0.0, 0.0, -0.5, HELD, HELD, RIGHT, RIGHT, RIGHT, RIGHT, RIGHT];
    let hi = [LEFT, LEFT, 0.5, HELD, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let start =
        Pose::new(-1.129_995_784_067_651_6, 13.818_950_352_972_65, -2.560_656_204_839_295_6);
    let settings = PolygonSettings::default();
    let polygon = set(start, &lo, &hi).step_polygon(6, settings);
    for (seed, drive) in [(2_918_688_141_876_624_204, 7), (1697, 1)] {
        let mut rng = SeededRng::new(seed);
        let mut next = || random_drive(start, &lo, &hi, PARTS, &mut rng);
        let end = (0..drive).map(|_| next()[6 * PARTS - 1]).last().unwrap();
        let outside_m = signed_distance(&polygon, end.position());
        assert!(outside_m <= settings.accuracy_m(), "{outside_m} m");
    }
}
