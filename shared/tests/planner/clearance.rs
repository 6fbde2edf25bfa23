//! Clearances against random drives and closed forms.

use super::{Class, PAPERS, any_bounds, any_drive, any_plan};
use sidestep::math::SeededRng;
use sidestep::planner::{ClearanceFinder, ClearanceSettings, Footprint, HumanFuture};
use sidestep::vehicle::Pose;

/// The paper's rates, and larger turns, steps and speeds.
const CLASSES: [Class; 6] = [
    PAPERS,
    Class { steps: 20, ..PAPERS },
    Class { rate_radps: 3.0, ..PAPERS },
    Class { speed_mps: 10.0, step_s: 0.5, rate_radps: 3.0, steps: 6 },
    Class { speed_mps: 1.2, step_s: 0.1, rate_radps: 2.0, steps: 30 },
    Class { speed_mps: 2.0, step_s: 0.5, rate_radps: 1.0, steps: 4 },
];

/// Random drives, looked at 20 times in each step, against every bound; and how far apart the bounds
/// from below and from above are.
#[test]
fn no_drive_comes_nearer() {
    const PARTS: usize = 20;
    for (number, class) in CLASSES.into_iter().enumerate() {
        let mut rng = SeededRng::new(number as u64);
        let accuracy_m = 0.01 * class.speed_mps;
        let settings = ClearanceSettings::new(accuracy_m).unwrap();
        let mut finder = ClearanceFinder::new(settings);
        let (mut near, mut exact, mut nearest, mut looked) = (0, 0, f64::INFINITY, 0);
        let clock = std::time::Instant::now();
        let mut spent = 0.0;
        for case in 0..60 {
            let set = [any_bounds(class, &mut rng)];
            let plan = any_plan(class, &mut rng);
            let start = Pose::new(0.3, -0.2, rng.uniform(-3.0, 3.0));
            let footprint = match case % 3 {
                0 => Footprint::disc(0.4).unwrap(),
                1 => Footprint::polygon(&[[0.0; 2]]).unwrap(),
                _ => Footprint::polygon(&[[0.5, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.6, -0.2]])
                    .unwrap()
                    .grown(0.1)
                    .unwrap(),
            };
            let Class { speed_mps, step_s, .. } = class;
            let future = HumanFuture { start, sets: &set, speed_mps, step_s };
            let before = clock.elapsed().as_secs_f64();
            let found = finder.find(&future, &plan, &footprint).unwrap();
            spent += clock.elapsed().as_secs_f64() - before;
            for _ in 0..300 {
                let drive = any_drive(start, class, &set[0], PARTS, &mut rng);
                for (i, pose) in drive.iter().enumerate() {
                    let seconds = step_s * i as f64 / PARTS as f64;
                    let apart = footprint.distance_m(plan.pose_at(seconds), pose.position());
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
                    exact += usize::from(between <= accuracy_m * (1.0 + 1e-9));
                    if between > accuracy_m * (1.0 + 1e-9) { println!("{} {case} {clearance:?} {}", case % 3, set[0].lo().iter().zip(set[0].hi()).all(|(l, h)| *l <= 0.0 && *h >= 0.0)); }
                }
            }
        }
        println!(
            "{class:?}: {looked} looks, {:.2} mm at least beyond a bound; {exact} of {near} near \
             clearances within {accuracy_m} m; {:.2} ms each plan",
            1e3 * nearest,
            1e3 * spent / 60.0
        );
    }
}
