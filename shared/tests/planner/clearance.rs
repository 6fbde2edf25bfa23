//! Clearances, compared with random drives, with closed forms and with each other.

use super::{Class, FREE, PAPERS, any_bounds, any_drive, any_plan, bounds};
use sidestep::bounds::InputBounds;
use sidestep::clearance::{
    Clearance, ClearanceFinder, ClearanceSettings, Footprint, HumanFuture, Plan,
};
use sidestep::math::{PI, SeededRng, hypot, sin_cos};
use sidestep::vehicle::{Pose, SpeedRange, dubins};

/// The paper's turn rates, and larger turn rates, steps and speeds.
const CLASSES: [Class; 6] = [
    PAPERS,
    Class { steps: 20, ..PAPERS },
    Class { rate_radps: 3.0, ..PAPERS },
    Class { speed_mps: 10.0, step_s: 0.5, rate_radps: 3.0, steps: 6 },
    Class { speed_mps: 1.2, step_s: 0.1, rate_radps: 2.0, steps: 30 },
    Class { speed_mps: 2.0, step_s: 0.5, rate_radps: 1.0, steps: 4 },
];

fn footprint(number: usize) -> Footprint {
    match number % 3 {
        0 => Footprint::disc(0.4).unwrap(),
        1 => Footprint::disc(0.0).unwrap(),
        _ => {
            let corners = [[0.5, 0.3], [-0.4, 0.3], [0.0, 0.0], [-0.4, -0.3], [0.6, -0.2]];
            Footprint::polygon(&corners).unwrap().grown(0.1).unwrap()
        }
    }
}

/// Compares random drives, sampled 20 times per step, with every bound. Also measures the gap
/// between lower and upper bounds.
#[test]
fn no_drive_comes_nearer() {
    search(|class, _| class.speed_mps.into(), 1.0);
}

/// The same, if the human chooses the speed from a range.
#[test]
fn no_drive_of_any_speed_comes_nearer() {
    let speeds = |class: &Class, rng: &mut SeededRng| {
        let slowest = [0.0, rng.unit(), 0.5][rng.below(3)];
        SpeedRange::new(slowest * class.speed_mps, class.speed_mps).unwrap()
    };
    search(speeds, 0.9);
}

/// `decided` is the share of near clearances that must be known within the accuracy at the paper's turn rates.
fn search(speeds: impl Fn(&Class, &mut SeededRng) -> SpeedRange, decided: f64) {
    const PARTS: usize = 20;
    for (number, class) in CLASSES.into_iter().enumerate() {
        let mut rng = SeededRng::new(number as u64);
        let accuracy_m = 0.01 * class.speed_mps;
        let settings = ClearanceSettings::new(accuracy_m).unwrap();
        let mut finder = ClearanceFinder::new(settings);
        let (mut near, mut exact, mut nearest, mut looked) = (0, 0_u32, f64::INFINITY, 0);
        for case in 0..60 {
            let set = [any_bounds(class, &mut rng)];
            let plan = any_plan(class, &mut rng);
            let start = Pose::new(0.3, -0.2, rng.uniform(-3.0, 3.0));
            let footprint = footprint(case);
            let (speed, step_s) = (speeds(&class, &mut rng), class.step_s);
            let future = HumanFuture { start, sets: &set, speed, step_s };
            let found = finder.find(&future, &plan, &footprint).unwrap();
            for _ in 0..300 {
                let drive = any_drive(start, class, (&set[0], speed), PARTS, &mut rng);
                for (i, pose) in drive.iter().enumerate() {
                    let seconds = step_s * i as f64 / PARTS as f64;
                    let apart = footprint.distance_m(plan.pose_at(seconds), pose.position());
                    // The end of a step is also the start of the next one.
                    for step in [i / PARTS, i.div_ceil(PARTS).saturating_sub(1)] {
                        let Some(clearance) = found.by_step(0).get(step) else { continue };
                        let beyond = apart - clearance.at_least_m;
                        assert!(beyond >= 0.0, "case {case} of {class:?}, step {step}: {beyond}");
                        nearest = nearest.min(beyond);
                        looked += 1;
                    }
                }
            }
            for clearance in found.by_step(0) {
                assert!(clearance.at_most_m >= clearance.at_least_m, "{clearance:?}");
                let between = clearance.at_most_m - clearance.at_least_m.max(0.0);
                if clearance.at_most_m > 0.0 && clearance.at_least_m < settings.enough_m {
                    near += 1;
                    exact += u32::from(between <= accuracy_m * (1.0 + 1e-9));
                }
            }
        }
        println!(
            "{class:?}: {looked} looks, at least {:.1e} m beyond a bound; {exact} of {near} near \
             clearances within {accuracy_m} m",
            nearest,
        );
        // If sets are wide, the work limit ends some searches early.
        let least = f64::from(near) * if class.rate_radps <= 0.5 { decided } else { 0.5 };
        assert!(f64::from(exact) >= least && near > 20, "{class:?}: {exact} of {near}");
    }
}

/// The clearance of one set at each step.
fn clearances(set: InputBounds, plan: &Plan, radius_m: f64, accuracy_m: f64) -> Vec<Clearance> {
    let settings = ClearanceSettings::new(accuracy_m).unwrap().with_enough(f64::INFINITY).unwrap();
    let start = Pose::new(0.0, 0.0, 0.0);
    let future = HumanFuture { start, sets: &[set], speed: 2.0.into(), step_s: 0.2 };
    let footprint = Footprint::disc(radius_m).unwrap();
    let mut finder = ClearanceFinder::new(settings);
    finder.find(&future, plan, &footprint).unwrap().by_step(0).to_vec()
}

fn holds(clearance: Clearance, expected_m: f64, accuracy_m: f64) {
    let Clearance { at_least_m, at_most_m } = clearance;
    assert!(
        at_least_m <= expected_m + 1e-9
            && expected_m - 1e-9 <= at_most_m
            && at_most_m - at_least_m <= accuracy_m + 1e-9,
        "{clearance:?} {expected_m}"
    );
}

/// Human and robot drive straight. Their closest approach can be within a step.
#[test]
fn straight_drives_have_their_closed_form() {
    let mut rng = SeededRng::new(7);
    for _ in 0..200 {
        let start =
            Pose::new(rng.uniform(1.0, 8.0), rng.uniform(-4.0, 4.0), rng.uniform(-3.0, 3.0));
        let speed = rng.uniform(-3.0, 3.0);
        let plan = Plan::driven(start, &[(speed, 0.0); 10], 0.2, FREE).unwrap();
        let found = clearances(bounds(&[0.0; 10], &[0.0; 10]), &plan, 0.4, 1e-3);
        let (sin, cos) = sin_cos(start.psi);
        let (vx, vy) = (speed * cos - 2.0, speed * sin);
        let closest_s = -(start.x * vx + start.y * vy) / (vx * vx + vy * vy);
        for (step, clearance) in found.into_iter().enumerate() {
            let t = closest_s.clamp(0.2 * step as f64, 0.2 * (step + 1) as f64);
            let expected = hypot(start.x + vx * t, start.y + vy * t) - 0.4;
            if expected > 0.002 {
                holds(clearance, expected, 1e-3);
            } else {
                assert!(clearance.at_least_m <= expected + 1e-9, "{clearance:?} {expected}");
            }
        }
    }
}

/// A human whose bounds always admit driving straight gets as far ahead as the speed allows, and as
/// far to the right as the arc at the lowest turn rate.
#[test]
fn a_robot_that_stands_ahead_or_aside() {
    let set = || bounds(&[-0.5; 10], &[0.5; 10]);
    let stand = |x: f64, y: f64| Plan::of_positions(&[[x, y]; 11], 0.2, FREE).unwrap();
    let ahead = clearances(set(), &stand(7.0, 0.0), 0.5, 1e-3);
    let aside = clearances(set(), &stand(3.0, -60.0), 0.5, 1e-3);
    for step in 0..10 {
        let t = 0.2 * (step + 1) as f64;
        holds(ahead[step], 7.0 - 2.0 * t - 0.5, 1e-3);
        // Seen from far away, the closest point of the front is the end of the path that always
        // turns right, or a point close to it.
        let end = dubins::arc(Pose::new(0.0, 0.0, 0.0), 2.0, -0.5, t);
        let arc_m = hypot(3.0 - end.x, -60.0 - end.y) - 0.5;
        assert!(aside[step].at_least_m <= arc_m + 1e-9 && arc_m < aside[step].at_most_m + 0.05);
    }
}

/// A robot crosses behind the human, where sets are not convex. Drives that switch once between the
/// bounds reach the rear boundary.
#[test]
fn a_robot_behind_is_seen_as_the_switching_drives_come_near() {
    const ACCURACY_M: f64 = 0.005;
    for (across, speed) in [(0.0, 0.0), (0.3, -1.0), (-0.6, 1.5)] {
        let robot = Pose::new(2.6, across, 0.5 * PI);
        let plan = Plan::driven(robot, &[(speed, 0.0); 10], 0.2, FREE).unwrap();
        let found = clearances(bounds(&[-0.5; 10], &[0.5; 10]), &plan, 0.2, ACCURACY_M);
        let mut nearest = f64::INFINITY;
        for i in 0..=200 {
            let seconds = 1.8 + 0.2 * f64::from(i) / 200.0;
            for j in 0..=400 {
                let switch_s = seconds * f64::from(j) / 400.0;
                for rate in [-0.5, 0.5] {
                    let turned = dubins::arc(Pose::new(0.0, 0.0, 0.0), 2.0, rate, switch_s);
                    let end = dubins::arc(turned, 2.0, -rate, seconds - switch_s);
                    let at = plan.pose_at(seconds);
                    nearest = nearest.min(hypot(end.x - at.x, end.y - at.y) - 0.2);
                }
            }
        }
        let Clearance { at_least_m, at_most_m } = found[9];
        println!("{nearest:.4} m by enumeration, {at_least_m:.4} to {at_most_m:.4} m");
        // The convex hull of the set would contain the robot.
        assert!(
            nearest > 0.3 && at_least_m <= nearest && nearest - at_least_m <= ACCURACY_M + 1e-4
        );
        assert!((at_most_m - nearest).abs() <= ACCURACY_M);
    }
}

/// Larger sets come nearer to the plan. Each set has the same clearance as if it were computed
/// alone.
#[test]
fn clearances_fall_from_set_to_set() {
    let mut rng = SeededRng::new(11);
    let mut finder = ClearanceFinder::default();
    let class = PAPERS;
    for case in 0..40 {
        let base = any_bounds(class, &mut rng);
        let plan = any_plan(class, &mut rng);
        let widened = |epsilon: f64| {
            let lo: Vec<f64> = base.lo().iter().map(|lo| (lo - epsilon).max(-0.5)).collect();
            let hi: Vec<f64> = base.hi().iter().map(|hi| (hi + epsilon).min(0.5)).collect();
            bounds(&lo, &hi)
        };
        let sets = [0.0, 0.15, 0.25, 0.4, 1.0].map(widened);
        let start = Pose::new(0.0, 0.0, rng.uniform(-3.0, 3.0));
        let footprint = footprint(case);
        let future = HumanFuture { start, sets: &sets, speed: 2.0.into(), step_s: 0.2 };
        let all = finder.find(&future, &plan, &footprint).unwrap().clone();
        assert_eq!((all.sets(), all.steps()), (5, 10));
        for (j, set) in sets.iter().enumerate() {
            let one = [set.clone()];
            let future = HumanFuture { sets: &one, ..future };
            let alone = finder.find(&future, &plan, &footprint).unwrap();
            for (a, b) in all.by_step(j).iter().zip(alone.by_step(0)) {
                assert!(a.at_least_m <= b.at_most_m && b.at_least_m <= a.at_most_m, "{a:?} {b:?}");
            }
            if j > 0 {
                for (a, b) in all.by_step(j - 1).iter().zip(all.by_step(j)) {
                    assert!(a.at_least_m >= b.at_least_m && a.at_most_m >= b.at_most_m);
                }
            }
        }
        let clear = (0..5).filter(|&j| all.of(j).at_least_m > 0.1).count();
        assert_eq!(all.largest_clear(0.1).map_or(0, |largest| largest + 1), clear);
    }
}

/// A lower work limit gives looser bounds, but the bounds remain valid.
#[test]
fn little_work_is_careful() {
    let mut rng = SeededRng::new(13);
    let class = CLASSES[2];
    for case in 0..20 {
        let sets = [any_bounds(class, &mut rng)];
        let plan = any_plan(class, &mut rng);
        let start = Pose::new(0.0, 0.0, 0.0);
        let future = HumanFuture { start, sets: &sets, speed: 2.0.into(), step_s: 0.2 };
        let find = |most_parts, most_work| {
            let settings = ClearanceSettings::default().with_most_parts(most_parts).unwrap();
            let settings = settings.with_most_work(most_work);
            let mut finder = ClearanceFinder::new(settings);
            finder.find(&future, &plan, &footprint(case)).unwrap().clone()
        };
        let much = find(400, usize::MAX);
        for little in [find(1, usize::MAX), find(400, 0), find(400, 1000)] {
            for (little, much) in little.by_step(0).iter().zip(much.by_step(0)) {
                assert!(little.at_least_m <= much.at_most_m && much.at_least_m <= little.at_most_m);
            }
        }
    }
}

#[test]
fn bad_input_is_refused() {
    let sets = [bounds(&[-0.1; 3], &[0.1; 3]), bounds(&[-0.3; 3], &[0.3; 3])];
    let plan = Plan::of_positions(&[[5.0, 0.0]; 4], 0.2, FREE).unwrap();
    let start = Pose::new(0.0, 0.0, 0.0);
    let good = HumanFuture { start, sets: &sets, speed: 2.0.into(), step_s: 0.2 };
    let complain = |future: HumanFuture<'_>, plan: &Plan| {
        let footprint = Footprint::disc(0.3).unwrap();
        ClearanceFinder::default().find(&future, plan, &footprint).unwrap_err().field
    };
    let nowhere = Pose { x: f64::NAN, y: 0.0, psi: 0.0 };
    assert_eq!(complain(HumanFuture { start: nowhere, ..good }, &plan), "start.x");
    assert_eq!(complain(HumanFuture { speed: 0.0.into(), ..good }, &plan), "speed_mps");
    assert_eq!(complain(HumanFuture { sets: &[], ..good }, &plan), "sets");
    assert_eq!(complain(HumanFuture { step_s: 0.1, ..good }, &plan), "plan.step_s");
    let backward = [sets[1].clone(), sets[0].clone()];
    assert_eq!(complain(HumanFuture { sets: &backward, ..good }, &plan), "sets[1].lo[0]");
    let longer = [sets[0].clone(), bounds(&[-0.3; 4], &[0.3; 4])];
    assert_eq!(complain(HumanFuture { sets: &longer, ..good }, &plan), "sets[1]");
    let short = Plan::of_positions(&[[5.0, 0.0]; 3], 0.2, FREE).unwrap();
    assert_eq!(complain(good, &short), "plan");
    let slow = Plan::of_positions(&[[5.0, 0.0]; 4], 9.0, FREE).unwrap();
    let fast = [bounds(&[0.0; 3], &[0.4; 3])];
    assert_eq!(complain(HumanFuture { sets: &fast, step_s: 9.0, ..good }, &slow), "sets[0].hi[0]");
    assert_eq!(ClearanceSettings::new(f64::NAN).unwrap_err().field, "accuracy_m");
    let settings = ClearanceSettings::default();
    assert_eq!(settings.with_enough(f64::NAN).unwrap_err().field, "enough_m");
    assert_eq!(settings.with_most_parts(0).unwrap_err().field, "most_parts");
}
