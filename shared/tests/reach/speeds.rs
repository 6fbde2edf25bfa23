//! Sets of vehicles that choose their speed from a range, compared with closed forms, with constant speeds and
//! with drives. (`promises` searches for drives outside.)

use super::{RATE_RADPS, SPEED_MPS, STEP_S, origin, set};
use sidestep::bounds::InputBounds;
use sidestep::math::{SeededRng, TAU, cos, hypot, sin_cos};
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{Outline, PolygonSettings, ReachableSet, Tolerance, Workspace};
use sidestep::vehicle::{Pose, SpeedRange, dubins};

fn range(lo: f64, hi: f64) -> SpeedRange {
    SpeedRange::new(lo, hi).unwrap()
}

fn between(lo: &[f64], hi: &[f64], speeds: Vec<SpeedRange>) -> ReachableSet {
    let bounds = InputBounds::new(lo.to_vec(), hi.to_vec(), (-9.0, 9.0)).unwrap();
    ReachableSet::with_speeds(origin(), &bounds, speeds, STEP_S).unwrap()
}

/// How far a polygon reaches in a direction (m).
fn support(polygon: &[[f64; 2]], direction: f64) -> f64 {
    let (sin, cos) = sin_cos(direction);
    polygon.iter().map(|[x, y]| x * cos + y * sin).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn a_range_of_one_speed_is_that_speed() {
    let (lo, hi) = ([-0.3, 0.0, 0.1, -0.5, -0.5], [0.4, 0.0, 0.5, -0.2, 0.5]);
    let constant = set(origin(), &lo, &hi);
    for speeds in [vec![range(SPEED_MPS, SPEED_MPS)], vec![range(SPEED_MPS, SPEED_MPS); 5]] {
        let chosen = between(&lo, &hi, speeds);
        for settings in [PolygonSettings::default(), PolygonSettings::default().conservative()] {
            assert_eq!(chosen.step_polygon(5, settings), constant.step_polygon(5, settings));
            assert_eq!(chosen.tube_polygon(settings), constant.tube_polygon(settings));
        }
    }
}

/// Without a choice of the turn rate, the set is convex: in direction φ it reaches as far as
/// ∫ max { v·cos(θ(t) − φ) : v₋ ≤ v ≤ v₊ } dt.
#[test]
fn under_known_turn_rates_the_set_is_the_closed_form() {
    for (rates, speeds) in [
        (vec![0.3; 10], vec![range(1.0, 3.0)]),
        (vec![0.3; 10], vec![range(0.0, 2.0)]),
        (vec![-2.0, 0.0, 2.0, 2.0], vec![range(0.5, 1.5)]),
        (vec![1.5; 3], vec![range(0.0, 1.0), range(2.0, 2.0), range(0.5, 3.0)]),
    ] {
        let steps = rates.len();
        let chosen = between(&rates, &rates, speeds.clone());
        for accuracy_m in [1e-2, 1e-3, 1e-4] {
            let settings = PolygonSettings::new(accuracy_m, 2).unwrap();
            let polygon = chosen.step_polygon(steps, settings);
            let surely = chosen.step_polygon(steps, settings.conservative());
            for k in 0..64 {
                let direction = TAU * f64::from(k) / 64.0;
                let exact = farthest(&rates, &speeds, direction);
                let [near, far] = [&polygon, &surely].map(|it| support(it, direction) - exact);
                assert!(near.abs() <= 1.2 * accuracy_m, "{near} m in direction {direction}");
                assert!((-1e-6..=1.5 * accuracy_m).contains(&far), "{far} m in {direction}");
            }
        }
    }
}

/// The integral of the best speed times the cosine, by the midpoint rule.
fn farthest(rates: &[f64], speeds: &[SpeedRange], direction: f64) -> f64 {
    const PARTS: usize = 4000;
    let (mut along, mut heading) = (0.0, -direction);
    for (step, rate) in rates.iter().enumerate() {
        let speeds = speeds[step % speeds.len()];
        for part in 0..PARTS {
            let share = (part as f64 + 0.5) / PARTS as f64;
            let forward = cos(heading + rate * STEP_S * share);
            let speed = if forward > 0.0 { speeds.hi_mps() } else { speeds.lo_mps() };
            along += speed * forward * STEP_S / PARTS as f64;
        }
        heading += rate * STEP_S;
    }
    along
}

/// Drives come near each vertex, so polygons are not much larger than the set. A drive has a turn rate and a
/// speed in each part of a step. It is varied to end nearer to the vertex.
#[test]
fn drives_reach_the_vertices() {
    const PARTS: usize = 3;
    let mut rng = SeededRng::new(17);
    let mut farthest = 0.0_f64;
    for (most, speeds, steps) in [(0.5, range(1.0, 3.0), 8), (2.0, range(0.5, 1.5), 6)] {
        let (lo, hi) = (vec![-most; steps], vec![most; steps]);
        let settings = PolygonSettings::new(1e-3, 2).unwrap();
        let polygon = between(&lo, &hi, vec![speeds]).step_polygon(steps, settings);
        let spread = speeds.hi_mps() - speeds.lo_mps();
        let part_s = STEP_S / PARTS as f64;
        for vertex in polygon.iter().step_by(polygon.len().div_ceil(12)) {
            let off = |drive: &[[f64; 2]]| {
                let end = drive.iter().fold(origin(), |pose, [rate, speed]| {
                    let speed = speeds.lo_mps() + spread * speed;
                    dubins::arc(pose, speed, most * (2.0 * rate - 1.0), part_s)
                });
                hypot(end.x - vertex[0], end.y - vertex[1])
            };
            let mut least = f64::INFINITY;
            for _ in 0..3 {
                let mut drive: Vec<_> =
                    (0..PARTS * steps).map(|_| [rng.unit(), rng.unit()]).collect();
                let mut best = off(&drive);
                let mut stride = 0.5;
                while stride > 1e-4 {
                    let before = best;
                    for place in 0..2 * drive.len() {
                        for change in [-stride, stride] {
                            let kept = drive[place / 2][place % 2];
                            drive[place / 2][place % 2] = (kept + change).clamp(0.0, 1.0);
                            let found = off(&drive);
                            if found < best {
                                best = found;
                            } else {
                                drive[place / 2][place % 2] = kept;
                            }
                        }
                    }
                    if before - best < 0.1 * stride * stride {
                        stride *= 0.5;
                    }
                }
                least = least.min(best);
            }
            farthest = farthest.max(least);
        }
    }
    println!("at most {farthest:.4} m from a vertex to a drive");
    assert!(farthest <= 2.5e-3, "{farthest} m");
}

/// A step at a slower constant speed bulges less than one at the highest speed.
#[test]
fn tubes_contain_steps_at_other_constant_speeds() {
    for speeds in [[2.0, 0.2, 0.2], [0.4, 0.4, 2.0], [2.0, 0.0, 1.0], [0.01, 2.0, 0.5]] {
        for rates in [[2.0; 3], [-3.0, 2.0, 0.5]] {
            let chosen = between(&rates, &rates, speeds.map(SpeedRange::from).to_vec());
            for accuracy_m in [1e-2, 1e-3] {
                let settings = PolygonSettings::new(accuracy_m, 2).unwrap();
                let surely = chosen.tube_polygon(settings.conservative());
                let mut pose = origin();
                for (speed, rate) in speeds.into_iter().zip(rates) {
                    for _ in 0..100 {
                        pose = dubins::arc(pose, speed, rate, 0.01 * STEP_S);
                        let outside = signed_distance(&surely, pose.position());
                        assert!(outside <= 1e-9, "{outside} m, {speeds:?}, {rates:?}");
                    }
                }
            }
        }
    }
}

/// Work and size of polygons for the paper's turn rates. A range from 0 has a corner at the start.
#[test]
fn ten_steps_take_no_convex_hull() {
    let (lo, hi) = ([-RATE_RADPS; 10], [RATE_RADPS; 10]);
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    for (slow, fast) in [(0.0, 2.0), (0.1, 2.0), (1.0, 3.0), (1.9, 2.0)] {
        let chosen = between(&lo, &hi, vec![range(slow, fast)]);
        let settings = PolygonSettings::new(1e-3, 2).unwrap().with_most_work(1_000_000);
        for settings in [settings, settings.conservative()] {
            let step = chosen.step_polygon_into(10, settings, &mut workspace, &mut polygon);
            let tube = chosen.tube_polygon_into(settings, &mut workspace, &mut polygon);
            for outline in [step, tube] {
                let Outline::Refined { margin_m } = outline else {
                    panic!("{slow} to {fast} m/s: {outline:?}");
                };
                assert!(margin_m <= settings.accuracy_m(), "{margin_m} m");
            }
        }
    }
}

#[test]
fn membership_proves_only_what_is_outside() {
    let chosen = between(&[-0.5; 10], &[0.5; 10], vec![range(1.0, 3.0)]);
    let tolerance = Tolerance::default();
    let contains =
        |x: f64, y: f64, psi: f64| chosen.contains_state(10, Pose::new(x, y, psi), tolerance);
    assert!(contains(2.0, 0.0, 0.0) && contains(6.0, 0.0, 0.0) && contains(4.0, 0.5, 0.2));
    assert!(!contains(1.8, 0.0, 0.0) && !contains(6.1, 0.0, 0.0) && !contains(4.0, 5.0, 0.2));
    assert!(!contains(4.0, 0.5, 1.01), "no heading beyond 1 rad");
    assert!(!contains(f64::NAN, 0.0, 0.0) && !contains(f64::INFINITY, 0.0, 0.0));
    // Whether the speeds of a drive were admissible is not known from its turn rates.
    let states = [Pose::new(0.4, 0.0, 0.0)];
    assert!(!chosen.contains_trajectory(&states, Some(&[0.0]), tolerance));
    assert!(chosen.state_margins(10, Pose::new(4.0, 0.0, 0.0)).position_m.is_nan());
}

#[test]
fn speeds_belong_to_steps() {
    let bounds =
        |steps| InputBounds::new(vec![-0.5; steps], vec![0.5; steps], (-0.5, 0.5)).unwrap();
    let new = |speeds: Vec<SpeedRange>, steps| {
        ReachableSet::with_speeds(origin(), &bounds(steps), speeds, STEP_S)
    };
    let field = |speeds, steps| new(speeds, steps).unwrap_err().field;
    assert_eq!(field(vec![range(1.0, 2.0); 2], 3), "speeds");
    assert_eq!(field(vec![], 1), "speed_mps");
    assert_eq!(field(vec![range(0.0, 0.0)], 2), "speed_mps");
    assert_eq!(field(vec![(-1.0).into()], 2), "speed_mps");
    assert_eq!(field(vec![2.0.into(), f64::NAN.into()], 2), "speed_mps");

    // A vehicle that stands for two steps is where it was after the first.
    let standing = [range(1.0, 2.0), range(0.0, 0.0), range(0.0, 0.0)];
    let mut stands = new(standing.to_vec(), 3).unwrap();
    let settings = PolygonSettings::new(1e-3, 2).unwrap();
    let first = stands.step_polygon(1, settings);
    for vertex in stands.step_polygon(3, settings) {
        assert!(signed_distance(&first, vertex).abs() <= 2e-3, "{vertex:?}");
    }
    let before = stands.clone();
    assert_eq!(stands.reset(origin(), &bounds(4)).unwrap_err().field, "speeds");
    assert_eq!(stands, before);
    let mut all = new(vec![range(1.0, 2.0)], 3).unwrap();
    all.reset(origin(), &bounds(4)).unwrap();
    assert_eq!(all, new(vec![range(1.0, 2.0)], 4).unwrap());
}
