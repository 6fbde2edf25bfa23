//! Membership of full states (position and heading).
use super::classes::CLASSES;
use super::{RATE_RADPS, SPEED_MPS, STEP_S, origin, random_drive, random_pose, set};
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng, hypot, sin_cos};
use sidestep::reach::{Membership, PositionUncertainty, ReachableSet, StartSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};

/// Random bounds of the given kind.
fn random_bounds(steps: usize, kind: usize, rng: &mut SeededRng) -> (Vec<f64>, Vec<f64>) {
    let steady = rng.below(2) == 0;
    let mut last = (0.0, 0.0);
    (0..steps)
        .map(|step| {
            if step > 0 && steady && rng.below(3) > 0 {
                return last;
            }
            let (a, b) =
                (rng.uniform(-RATE_RADPS, RATE_RADPS), rng.uniform(-RATE_RADPS, RATE_RADPS));
            last = match (kind, rng.below(8)) {
                (0, 0) => (0.0, 0.0),
                (0, 1) => (-a.abs(), 0.0),
                (0, _) => (-a.abs(), b.abs()),
                (1, _) => (a.abs().min(b.abs()), a.abs().max(b.abs())),
                (2, _) => (-a.abs().max(b.abs()), -a.abs().min(b.abs())),
                (3, _) => (-RATE_RADPS, RATE_RADPS),
                (_, 0) => (a, a),
                (_, 1) => (-RATE_RADPS, RATE_RADPS),
                (_, 2) => ((a.signum() * 0.5 - 0.1).max(-0.5), (a.signum() * 0.5 + 0.1).min(0.5)),
                _ => (a.min(b), a.max(b)),
            };
            last
        })
        .unzip()
}

/// The states after each step under random inputs.
fn random_states(start: Pose, lo: &[f64], hi: &[f64], rng: &mut SeededRng) -> Vec<Pose> {
    const PARTS: usize = 4;
    random_drive(start, lo, hi, PARTS, rng).into_iter().skip(PARTS - 1).step_by(PARTS).collect()
}

fn random_start(rng: &mut SeededRng) -> Pose {
    Pose::new(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-3.1, 3.1))
}

/// Allowed error (m): how far outside the set a reachable state can seem. Each kind of bounds has
/// one value for up to 10 steps and one value for more steps. Kinds 1 to 3 are exact. Kind 0 is
/// exact except for steps that do not admit turns to both sides.
const MISSED_M: [(f64, f64); 5] =
    [(3e-4, 3e-3), (1e-6, 1e-6), (1e-6, 1e-6), (1e-6, 1e-6), (1e-3, 5e-3)];

#[test]
fn random_drives_stay_inside() {
    let mut rng = SeededRng::new(5);
    for (kind, missed) in MISSED_M.into_iter().enumerate() {
        for (steps, drives) in [(1, 20), (3, 20), (10, 40), (25, 4), (50, 1)] {
            let mut worst = f64::INFINITY;
            for _ in 0..80 {
                let (lo, hi) = random_bounds(steps, kind, &mut rng);
                let start = random_start(&mut rng);
                let set = set(start, &lo, &hi);
                for drive in 0..drives {
                    let states = random_states(start, &lo, &hi, &mut rng);
                    for (i, state) in states.iter().enumerate() {
                        assert!(
                            set.contains_state(i + 1, *state, Tolerance::default()),
                            "step {} {state:?}: {:?}, lo {lo:?} hi {hi:?}",
                            i + 1,
                            set.state_margins(i + 1, *state),
                        );
                    }
                    if drive % 8 == 0 {
                        let last = states[steps - 1];
                        worst = worst.min(set.state_margins(steps, last).position_m);
                    }
                }
            }
            println!("kind {kind}, {steps} steps: least margin {worst:.1e} m");
            assert!(worst >= -if steps > 10 { missed.1 } else { missed.0 }, "{worst}");
        }
    }
}

#[test]
fn what_no_enumerated_input_comes_near_is_outside() {
    const RATES: usize = 7;
    const PARTS: usize = 6;
    let mut rng = SeededRng::new(8);
    let tolerance = Tolerance { position_m: 1e-4, heading_rad: 1e-4 };
    for kind in [0, 1, 3, 4, 4] {
        let (lo, hi) = random_bounds(PARTS / 2, kind, &mut rng);
        let set = set(origin(), &lo, &hi);
        let mut cloud = vec![origin()];
        for part in 0..PARTS {
            let (low, high) = (lo[part / 2], hi[part / 2]);
            let rates = (0..RATES).map(|i| low + (high - low) * i as f64 / (RATES - 1) as f64);
            cloud = rates
                .flat_map(|rate| {
                    let arc = |pose: &Pose| dubins::arc(*pose, SPEED_MPS, rate, STEP_S / 2.0);
                    cloud.iter().map(arc).collect::<Vec<_>>()
                })
                .collect();
        }
        // The heading difference between neighbours in the cloud. The rates of neighbours differ by
        // one interval in one part.
        let apart = (2.0 * RATE_RADPS / (RATES - 1) as f64) * STEP_S / 2.0;
        let (mut outside, mut inside) = (0, 0);
        for _ in 0..400 {
            let near = cloud[rng.below(cloud.len())];
            let size = rng.unit() * rng.unit();
            let mut by = |most: f64| rng.uniform(-most, most) * size;
            let state = Pose::new(near.x + by(0.1), near.y + by(0.1), near.psi + by(0.2));
            let nearest = cloud
                .iter()
                .map(|pose| {
                    let position = hypot(pose.x - state.x, pose.y - state.y);
                    (position / 0.005).max((pose.psi - state.psi).abs() / apart)
                })
                .fold(f64::INFINITY, f64::min);
            let contained = set.contains_state(PARTS / 2, state, tolerance);
            inside += usize::from(contained);
            if nearest > 1.0 {
                outside += 1;
                assert!(!contained, "{state:?} is {nearest} away: lo {lo:?} hi {hi:?}");
            }
        }
        println!("kind {kind}: {outside} far from the cloud, {inside} inside, of 400");
    }
}

/// States around the boundary of the set, both inside and outside.
fn probes(start: Pose, lo: &[f64], hi: &[f64], rng: &mut SeededRng) -> Vec<Pose> {
    (0..40)
        .map(|_| {
            let drive = random_states(start, lo, hi, rng);
            let (state, size) = (drive[drive.len() - 1], 0.3 * rng.unit() * rng.unit());
            let mut by = || rng.uniform(-size, size);
            Pose::new(state.x + by(), state.y + by(), state.psi + by())
        })
        .collect()
}

#[test]
fn wider_bounds_contain_more_and_the_set_moves_and_mirrors() {
    let mut rng = SeededRng::new(13);
    let tolerance = Tolerance::default();
    // The larger set is tested with a larger tolerance, so that small numerical errors do not
    // decide the result.
    let slack = Tolerance { position_m: 6e-3, heading_rad: 2e-3 };
    for round in 0..60 {
        let steps = [1, 2, 5, 10, 15, 20][round % 6];
        let (lo, hi) = random_bounds(steps, round % 5, &mut rng);
        let start = random_start(&mut rng);
        let inner = set(start, &lo, &hi);
        let wide = |bound: &[f64], by: f64| -> Vec<f64> {
            bound.iter().map(|rate| (rate + by).clamp(-RATE_RADPS, RATE_RADPS)).collect()
        };
        let outer = set(start, &wide(&lo, -0.1), &wide(&hi, 0.05));
        let home = set(origin(), &lo, &hi);
        let opposite = |rates: &[f64]| -> Vec<f64> { rates.iter().map(|rate| -rate).collect() };
        let mirrored = set(origin(), &opposite(&hi), &opposite(&lo));
        for state in probes(start, &lo, &hi, &mut rng) {
            if inner.contains_state(steps, state, tolerance) {
                assert!(outer.contains_state(steps, state, slack), "{state:?}");
            }
            let (sin, cos) = sin_cos(start.psi);
            let (dx, dy) = (state.x - start.x, state.y - start.y);
            let moved = Pose::new(cos * dx + sin * dy, cos * dy - sin * dx, state.psi - start.psi);
            let mirror = Pose::new(moved.x, -moved.y, -moved.psi);
            let margins = inner.state_margins(steps, state);
            let at_home = home.state_margins(steps, moved);
            let in_mirror = mirrored.state_margins(steps, mirror);
            assert!((margins.heading_rad - at_home.heading_rad).abs() < 1e-9);
            assert!((margins.heading_rad - in_mirror.heading_rad).abs() < 1e-9);
            assert!((margins.position_m - at_home.position_m).abs() < 1e-5, "{margins:?}");
            let apart = (margins.position_m - in_mirror.position_m).abs();
            assert!(apart < 1e-3, "{margins:?} {in_mirror:?}");
            if round % 5 != 0 && round % 5 != 4 {
                assert!(apart < 1e-5, "{margins:?} {in_mirror:?}");
            }
        }
    }
}

#[test]
fn a_trajectory_is_inside_as_long_as_its_inputs_are() {
    let (lo, hi) = ([-0.1; 10], [0.5; 10]);
    let start = Pose::new(1.0, 2.0, 3.0);
    let set = set(start, &lo, &hi);
    let states = |inputs: &[f64]| -> Vec<Pose> {
        let mut pose = start;
        let mut step = |rate: &f64| {
            pose = dubins::arc(pose, SPEED_MPS, *rate, STEP_S);
            pose
        };
        inputs.iter().map(&mut step).collect()
    };
    let none = Tolerance { position_m: 0.0, heading_rad: 0.0 };
    let mut inputs = [0.5; 10];
    assert!(set.contains_trajectory(&states(&inputs), Some(&inputs), none));
    assert!(set.contains_trajectory(&states(&inputs), None, Tolerance::default()));
    // The first input is too far right, so the first state is already outside.
    inputs[0] = -0.5;
    assert!(!set.contains_trajectory(&states(&inputs), Some(&inputs), Tolerance::default()));
    // The last input is too far right. However, other inputs lead to the same state.
    inputs = [0.2; 10];
    inputs[9] = -0.12;
    assert!(set.contains_trajectory(&states(&inputs), Some(&inputs), Tolerance::default()));
}

#[test]
fn without_a_choice_and_without_a_step() {
    let rates = [0.3, -0.5, 0.0, 0.5];
    let start = Pose::new(1.0, 2.0, 3.0);
    let path = set(start, &rates, &rates);
    let mut pose = start;
    let tolerance = Tolerance { position_m: 1e-9, heading_rad: 1e-9 };
    assert!(path.contains_state(0, start, tolerance));
    for psi in [1e300, -1e300, 1e7, f64::INFINITY, f64::NAN] {
        assert!(!path.contains_state(1, Pose { psi, ..start }, tolerance));
        assert!(path.state_margins(1, Pose { psi, ..start }).position_m.is_nan());
    }
    for (i, &rate) in rates.iter().enumerate() {
        pose = dubins::arc(pose, SPEED_MPS, rate, STEP_S);
        assert!(path.contains_state(i + 1, pose, tolerance));
        assert!(!path.contains_state(i + 1, Pose { x: pose.x + 1e-8, ..pose }, tolerance));
        assert!(!path.contains_state(i + 1, Pose { psi: pose.psi + 1e-8, ..pose }, tolerance));
    }
    for nowhere in [f64::NAN, f64::INFINITY] {
        assert!(!path.contains_state(2, Pose { x: nowhere, ..pose }, Tolerance::default()));
        assert!(!path.contains_state(2, Pose { psi: nowhere, ..pose }, Tolerance::default()));
        assert!(path.state_margins(2, Pose { psi: nowhere, ..pose }).position_m.is_nan());
    }
}

/// Allows only rounding errors.
const NONE: Tolerance = Tolerance { position_m: 0.0, heading_rad: 1e-9 };

fn uncertain(position: PositionUncertainty, heading_rad: f64) -> StartSet {
    StartSet::new(Pose::new(0.7, -0.4, 2.9), position, heading_rad).expect("a start")
}

#[test]
fn an_uncertain_start_holds_what_any_of_its_poses_leads_to() {
    let mut rng = SeededRng::new(21);
    let positions = [
        PositionUncertainty::None,
        PositionUncertainty::Disc { radius_m: 0.3 },
        PositionUncertainty::Box { along_m: 0.4, across_m: 0.1 },
    ];
    for (position, heading) in
        positions.into_iter().flat_map(|position| [(position, 0.0), (position, 0.25)])
    {
        let start = uncertain(position, heading);
        for kind in 0..4 {
            let (lo, hi) = random_bounds(7, kind, &mut rng);
            let all = set(start, &lo, &hi);
            let (mut outside, mut open) = (0, 0);
            for _ in 0..40 {
                let from = random_pose(&start, false, &mut rng);
                let states = random_states(from, &lo, &hi, &mut rng);
                let end = states[states.len() - 1];
                let steps = states.len();
                let tolerance = Tolerance { position_m: 0.002, heading_rad: 1e-9 };
                assert!(all.contains_state(steps, end, tolerance), "{start:?} {lo:?} {hi:?}");
                // A state is inside if it is inside the set of any start.
                let aside = Pose::new(
                    end.x + rng.uniform(-0.8, 0.8),
                    end.y + rng.uniform(-0.8, 0.8),
                    end.psi + rng.uniform(-0.3, 0.3),
                );
                let mut any = |tolerance| {
                    (0..400).any(|_| {
                        let from = random_pose(&start, false, &mut rng);
                        set(from, &lo, &hi).contains_state(steps, aside, tolerance)
                    })
                };
                let found = any(NONE);
                let decided = all.state_membership(steps, aside, NONE, 100);
                let inside = decided == Membership::Inside;
                open += usize::from(decided == Membership::Open);
                assert!(inside || !found, "{start:?} {aside:?}");
                // It is possible that only few starts lead to the state, so it is sufficient that a
                // random start leads near it.
                let near = Tolerance { position_m: 0.08, heading_rad: 0.04 };
                assert!(!inside || found || any(near), "{start:?} {aside:?}");
                outside += usize::from(!inside);
            }
            assert!(outside > 0);
            println!("{position:?} {heading}: {outside} outside, {open} of them without proof");
        }
    }
}

/// 96 steps with up to half a turn each. The work limit applies to all states together, and every
/// state of a drive is contained. The test also detects a state that is out of reach, and, at the
/// paper's rates, a state that has turned too far.
#[test]
fn the_states_of_a_drive_are_decided_together() {
    let mut rng = SeededRng::new(19);
    let tolerance = Tolerance::default();
    for _ in 0..4 {
        let bounds = (0..96).map(|_| {
            let (a, b) = (rng.uniform(-3.1, 3.1), rng.uniform(-3.1, 3.1));
            (a.min(b), a.max(b))
        });
        let (lo, hi): (Vec<_>, Vec<_>) = bounds.unzip();
        let all = InputBounds::new(lo.clone(), hi.clone(), (-3.1, 3.1)).unwrap();
        let set = ReachableSet::new(origin(), &all, SPEED_MPS, 1.0).unwrap();
        let drive = lo.iter().zip(&hi).scan(origin(), |pose, (lo, hi)| {
            *pose = dubins::arc(*pose, SPEED_MPS, rng.uniform(*lo, *hi), 1.0);
            Some(*pose)
        });
        let mut drive: Vec<_> = drive.collect();
        assert_eq!(set.contains_states(&drive, tolerance), [true; 96]);
        drive[40].x += 1e3;
        assert!(!set.contains_states(&drive, tolerance)[40]);
    }
    for _ in 0..20 {
        let (lo, hi) = random_bounds(15, 4, &mut rng);
        let (start, set) = (origin(), set(origin(), &lo, &hi));
        let mut states = random_states(start, &lo, &hi, &mut rng);
        states[7].psi = hi[..8].iter().sum::<f64>() * STEP_S + 0.01;
        let each = states.iter().enumerate();
        let each: Vec<_> = each.map(|(i, it)| set.contains_state(i + 1, *it, tolerance)).collect();
        let found = set.contains_states(&states, tolerance);
        assert_eq!(found, each);
        assert_eq!(found.iter().filter(|it| !**it).count(), 1);
    }
}

/// After tens of steps with up to half a turn each, some margins take too much work and are NaN. In
/// all other cases, the heading is admissible.
#[test]
fn margins_are_not_numbers_where_they_take_too_much_work() {
    let class = &CLASSES[5];
    let mut unknown = 0;
    for seed in 0..60 {
        let mut rng = SeededRng::new(seed);
        let bounds = class.bounds(&mut rng);
        let set = ReachableSet::new(origin(), &bounds, class.speed_mps, class.step_s).unwrap();
        let end = bounds.lo().iter().zip(bounds.hi()).fold(origin(), |pose, (lo, hi)| {
            dubins::arc(pose, class.speed_mps, rng.uniform(*lo, *hi), class.step_s)
        });
        let found = set.state_margins(set.steps(), end);
        assert_eq!(found.position_m.is_nan(), found.heading_rad.is_nan());
        assert!(found.position_m.is_nan() || found.heading_rad >= -1e-9, "seed {seed}: {found:?}");
        unknown += usize::from(found.position_m.is_nan());
    }
    println!("{unknown} of 60 took too much work");
    assert!((1..60).contains(&unknown), "{unknown}");
}

/// Half a turn to either side covers all headings, so a larger tolerance changes nothing.
#[test]
fn a_tolerance_of_any_heading_is_half_a_turn() {
    let (lo, hi) = ([-0.5; 5], [0.5; 5]);
    let set = set(origin(), &lo, &hi);
    for (place, state) in [(1.5, 0.0), (5.0, 2.0), (1.199, 40.0)].into_iter().enumerate() {
        let state = Pose::new(state.0, 0.0, state.1);
        let found = [PI, 1e12, 1e300].map(|heading_rad| {
            let tolerance = Tolerance { heading_rad, ..Tolerance::default() };
            set.contains_state(3, state, tolerance)
        });
        assert_eq!(found, [place == 2; 3], "{state:?}");
    }
}
