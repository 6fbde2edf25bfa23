//! Reachable states that polygons and membership tests once missed. If a defect is not fixed yet,
//! its test asserts that the defect still exists.

use super::{origin, random_drive, set};
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::polygon::{signed_area, signed_distance};
use sidestep::reach::{Outline, PolygonSettings, ReachableSet, Tolerance, Workspace};
use sidestep::vehicle::{Pose, dubins};

/// A drive with `inputs` within the bounds. Every step has one input, or several inputs of equal
/// duration. Speed in m/s, step in s.
struct Case {
    speed_mps: f64,
    step_s: f64,
    lo: &'static [f64],
    hi: &'static [f64],
    inputs: &'static [f64],
}

impl Case {
    fn set(&self) -> ReachableSet {
        let parts = self.inputs.len() / self.lo.len();
        let admissible =
            |(i, input): (usize, &f64)| (self.lo[i / parts]..=self.hi[i / parts]).contains(input);
        assert!(self.inputs.iter().enumerate().all(admissible));
        let bounds = InputBounds::new(self.lo.to_vec(), self.hi.to_vec(), (-10.0, 10.0)).unwrap();
        ReachableSet::new(origin(), &bounds, self.speed_mps, self.step_s).unwrap()
    }

    fn end(&self) -> Pose {
        let step = |pose, rate: &f64| dubins::arc(pose, self.speed_mps, *rate, self.step_s);
        self.inputs.iter().fold(origin(), step)
    }

    /// How far the end of the drive is outside the conservative polygon with an accuracy of 1 mm
    /// (m).
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

/// With up to 1.5 rad per step, these drives were once outside, by up to 390 mm.
#[test]
fn conservative_polygons_contain_drives_at_large_turns_per_step() {
    for case in [THREE, SIX, NINE] {
        let outside_mm = 1e3 * case.outside_m();
        eprintln!("{} steps: {outside_mm:.1} mm outside", case.inputs.len());
        assert!(outside_mm <= 0.0, "{outside_mm} mm");
    }
}

/// Pairs of the allowed and the measured maximum distance of a drive outside the polygon (m). The
/// first pair is for the last step, and the second for the tube after every part of the drive.
fn misses(case: &Case, settings: PolygonSettings) -> [(f64, f64); 2] {
    let (set, parts) = (case.set(), case.inputs.len() / case.lo.len());
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    let drive = case.inputs.iter().scan(origin(), |pose, rate| {
        *pose = dubins::arc(*pose, case.speed_mps, *rate, case.step_s / parts as f64);
        Some(pose.position())
    });
    let drive: Vec<_> = drive.collect();
    [drive.len() - 1, 0].map(|from| {
        let outline = if from > 0 {
            set.step_polygon_into(set.steps(), settings, &mut workspace, &mut polygon)
        } else {
            set.tube_polygon_into(settings, &mut workspace, &mut polygon)
        };
        let follows = outline == Outline::Refined { margin_m: 0.0 };
        let outside = drive[from..].iter().map(|position| signed_distance(&polygon, *position));
        let most = outside.fold(f64::NEG_INFINITY, f64::max);
        (if follows { settings.accuracy_m() } else { 0.0 }, most)
    })
}

/// Drives with large turns per step that non-conservative polygons missed, some by 0.45 m, 33 mm,
/// 46 mm and 40 mm. Two of the drives change their rates within steps.
#[test]
fn no_polygon_misses_a_drive_at_large_turns_per_step() {
    let within = Case {
        speed_mps: 0.7266,
        step_s: 3.0,
        lo: &[-0.889, -0.770, -0.504, 0.303],
        hi: &[-0.239, -0.166, -0.193, 0.486],
        inputs: &[
            -0.889, -0.889, -0.239, -0.889, -0.77, -0.77, -0.77, -0.77, -0.504, -0.504, -0.504,
            -0.504, 0.303, 0.486, 0.486, 0.486,
        ],
    };
    let few = Case {
        speed_mps: 2.0,
        step_s: 0.2,
        lo: &[0.9, 8.7, -4.2, -8.0],
        hi: &[7.5, 9.1, 9.3, 4.3],
        inputs: &[7.5, 8.7, 9.3, 4.3],
    };
    let swinging = Case {
        speed_mps: 2.0,
        step_s: 0.2,
        lo: &[-1.2473, 2.403, 0.38, -1.2438, 2.1704, -2.4393, 0.9668, -2.8286, -3.0, -0.218],
        hi: &[0.2754, 2.403, 1.4513, 2.5319, 2.3877, -1.5164, 1.1479, -1.6498, 3.0, 0.1104],
        inputs: &[
            -1.2473, -1.2473, -1.0993, -1.0993, 2.403, 2.403, 2.403, 2.403, 1.4513, 1.4513, 1.4513,
            1.4513, 2.5319, 2.5319, -1.2438, -0.6736, 2.2032, 2.3877, 2.3877, 2.1704, -2.4393,
            -2.4393, -2.4393, -2.4393, 0.9668, 0.9668, 0.9668, 0.9668, -2.8286, -2.8286, -2.8286,
            -2.8286, -3.0, -3.0, -3.0, -3.0, -0.218, -0.218, -0.218, -0.218,
        ],
    };
    for case in [THREE, SIX, NINE, FIVE, SEVEN, within, few, swinging] {
        for accuracy_m in [1e-4, 1e-3, 1e-2] {
            for (allowed, outside) in misses(&case, PolygonSettings::new(accuracy_m, 8).unwrap()) {
                assert!(outside <= allowed, "{outside} m, {accuracy_m} m, lo {:?}", case.lo);
            }
        }
    }
}

/// Many steps with the same bounds, followed by many steps with other bounds. Tubes of extremals
/// were once cut off by up to 6.80 m.
#[test]
fn a_tube_contains_its_own_steps_under_bounds_of_two_parts() {
    let parts = |parts: [(f64, usize); 2]| parts.map(|(rate, steps)| vec![rate; steps]).concat();
    let cases = [
        ([(-0.4, 38), (-0.5, 53)], [(0.2, 38), (-0.44, 53)]),
        ([(0.2, 6), (-0.5, 28)], [(0.3, 6), (-0.07, 28)]),
        ([(-0.3, 12), (-0.5, 24)], [(-0.1, 12), (-0.36, 24)]),
    ];
    for (lo, hi) in cases {
        let set = set(origin(), &parts(lo), &parts(hi));
        for accuracy_m in [1e-3, 1e-2] {
            let settings = PolygonSettings::new(accuracy_m, 8).unwrap();
            let tube = set.tube_polygon(settings);
            let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
            for step in 0..=set.steps() {
                let outline = set.step_polygon_into(step, settings, &mut workspace, &mut polygon);
                let Outline::Refined { margin_m } = outline else { panic!("step {step}") };
                let outside = polygon.iter().map(|vertex| signed_distance(&tube, *vertex));
                let most = outside.fold(f64::NEG_INFINITY, f64::max);
                // Either both polygons deviate by at most the accuracy, or the step's polygon
                // contains its set.
                let allowed = if margin_m > 0.0 { 16.0 * accuracy_m } else { 2.0 * accuracy_m };
                assert!(most <= allowed, "{most} m, step {step} of {lo:?} {hi:?}");
            }
        }
    }
    let inputs = [vec![-0.4; 12], vec![0.2; 26], vec![-0.44; 53]].concat();
    let (lo, hi) = (parts(cases[0].0), parts(cases[0].1));
    let settings = PolygonSettings::new(1e-3, 8).unwrap();
    let tube = set(origin(), &lo, &hi).tube_polygon(settings);
    let mut pose = origin();
    for rate in inputs {
        pose = dubins::arc(pose, 2.0, rate, 0.2);
        assert!(signed_distance(&tube, pose.position()) <= settings.accuracy_m());
    }
}

/// The membership curves miss states that these drives reach. These states once counted as outside.
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

/// At the paper's rates, a polygon with an accuracy of 0.1 mm once excluded two drives, by 0.147 mm
/// and 0.194 mm. Their rates switch twice. Such paths bound the set only for a short range of end
/// headings. The first drive is drive 7 of the property test, with the random seed that found these
/// bounds.
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

/// Bounds that exclude straight driving by less than 10⁻⁴ rad/s once counted as admitting it, even
/// over long steps. The polygon of this set, whose headings are from 0.09 to 0.3 rad, then
/// contained positions that are 4.5 m outside the set.
#[test]
fn long_steps_that_forbid_driving_straight_do() {
    let of = |lo: f64, hi: f64, steps, speed_mps, step_s| {
        let bounds = InputBounds::new(vec![lo; steps], vec![hi; steps], (-1.0, 1.0)).unwrap();
        ReachableSet::new(origin(), &bounds, speed_mps, step_s).unwrap()
    };
    let long = of(9e-5, 3e-4, 1, 0.1, 1000.0);
    let straight_on = Pose::new(100.0, 0.0, 0.0);
    assert!(!long.contains_state(1, straight_on, Tolerance::default()));
    let settings = PolygonSettings::default();
    for settings in [settings, settings.conservative()] {
        assert!(signed_distance(&long.step_polygon(1, settings), straight_on.position()) > 4.0);
    }
    // Without a choice, there is only one position.
    assert_eq!(of(9e-5, 9e-5, 100, 2.0, 0.2).step_polygon(100, settings).len(), 1);
}

/// At accuracies below the distance travelled in 10⁻⁷ s, polygons of extremals once missed drives
/// by 0.35 to 3.6 mm.
#[test]
fn a_polygon_of_high_accuracy_misses_no_fast_drive() {
    let lo = [
        1.3446348887978916,
        1.224020859110516,
        -0.00599056474600296,
        -0.21906317074101722,
        0.7585020117421808,
        -0.6818179050907579,
    ];
    let hi = [
        1.6182158982384263,
        2.058622087261533,
        1.9557719387761745,
        -0.21888606763462665,
        1.9423988601070443,
        -0.6814583346165775,
    ];
    for (speed_mps, accuracy_m) in [(100.0, 1e-6), (400.0, 1e-5), (400.0, 1e-6)] {
        let bounds = InputBounds::new(lo.to_vec(), hi.to_vec(), (-3.0, 3.0)).unwrap();
        let set = ReachableSet::new(origin(), &bounds, speed_mps, 0.2).unwrap();
        let settings = PolygonSettings::new(accuracy_m, 2).unwrap();
        let polygon = set.step_polygon(6, settings);
        // The drive uses the lowest rates, except in the middle half of the fifth step.
        let end = lo.iter().enumerate().fold(origin(), |pose, (step, &low)| {
            let middle = if step == 4 { 0.7907283161693446 } else { low };
            [(low, 0.05), (middle, 0.1), (low, 0.05)]
                .into_iter()
                .fold(pose, |pose, (rate, seconds)| dubins::arc(pose, speed_mps, rate, seconds))
        });
        let outside_m = signed_distance(&polygon, end.position());
        assert!(outside_m <= accuracy_m, "{speed_mps} m/s, {accuracy_m} m: {outside_m} m");
    }
}

/// Coarse polygons were once up to 18 % larger than the convex hull.
#[test]
fn no_coarse_polygon_is_larger_than_the_convex_hull() {
    let bounds = InputBounds::new(vec![-1.5; 40], vec![1.5; 40], (-1.5, 1.5)).unwrap();
    let set = ReachableSet::new(origin(), &bounds, 2.0, 0.2).unwrap();
    for accuracy_m in [0.001, 0.01] {
        let settings = PolygonSettings::new(accuracy_m, 2).unwrap();
        for draw in [
            |set: &ReachableSet, settings| set.step_polygon(40, settings),
            |set: &ReachableSet, settings| set.tube_polygon(settings),
        ] {
            let (drawn, hull) = (draw(&set, settings), draw(&set, settings.with_most_work(0)));
            assert!(signed_area(&drawn) <= signed_area(&hull) * (1.0 + 1e-9), "{accuracy_m} m");
        }
    }
}
