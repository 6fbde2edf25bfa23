//! Plans and footprints.

use super::FREE;
use sidestep::clearance::{Footprint, Plan, PlanLimits};
use sidestep::math::{PI, SeededRng, hypot, wrap_angle};
use sidestep::vehicle::{Pose, dubins};

/// Between its poses, a plan follows the vehicle's motion.
#[test]
fn a_driven_plan_is_the_drive() {
    let mut rng = SeededRng::new(1);
    for _ in 0..200 {
        let start = Pose::new(rng.uniform(-5.0, 5.0), 1.0, rng.uniform(-PI, PI));
        let any = |rng: &mut SeededRng| (rng.uniform(-3.0, 5.0), rng.uniform(-15.0, 15.0));
        let inputs: Vec<_> = (0..4).map(|_| any(&mut rng)).collect();
        let plan = Plan::driven(start, &inputs, 0.2, FREE).unwrap();
        assert_eq!((plan.steps(), plan.step_s(), plan.poses().len()), (4, 0.2, 5));
        for (step, &(speed, rate)) in inputs.iter().enumerate() {
            let part_s = rng.uniform(0.0, 0.2);
            let expected = dubins::arc(plan.poses()[step], speed, rate, part_s);
            let found = plan.pose_at(0.2 * step as f64 + part_s);
            assert!(hypot(found.x - expected.x, found.y - expected.y) < 1e-9);
            assert!(wrap_angle(found.psi - expected.psi).abs() < 1e-9);
        }
        assert_eq!(plan.pose_at(-1.0).position(), start.position());
        let end = plan.pose_at(9.0);
        assert!(hypot(end.x - plan.poses()[4].x, end.y - plan.poses()[4].y) < 1e-12);
    }
}

#[test]
fn plans_that_jump_are_refused() {
    let limits = PlanLimits::new(1.5, 1.0);
    let complain = |poses: &[[f64; 3]]| {
        let poses = poses.iter().map(|&pose| Pose::from(pose)).collect();
        Plan::new(poses, 0.2, limits).unwrap_err()
    };
    let said = complain(&[[0.0; 3], [0.3, 0.0, 0.0], [0.7, 0.0, 0.0]]);
    assert_eq!(said.field, "poses[2]");
    assert!(said.expected.starts_with("at most 0.3") && said.found.starts_with("0.39"), "{said}");
    assert_eq!(complain(&[[0.0; 3], [0.1, 0.0, 0.3]]).field, "poses[1]");
    assert_eq!(complain(&[[0.0; 3], [0.1, f64::NAN, 0.0]]).field, "poses[1].y");
    assert_eq!(complain(&[[0.0; 3]]).field, "poses");
    assert_eq!(complain(&[]).field, "poses");
    let poses = || vec![Pose::new(0.0, 0.0, 0.0); 2];
    assert_eq!(Plan::new(poses(), 0.0, limits).unwrap_err().field, "step_s");
    let limitless = PlanLimits::new(f64::INFINITY, limits.most_turn_rate_radps);
    assert_eq!(Plan::new(poses(), 0.2, limitless).unwrap_err().field, "limits.most_speed_mps");
    let around = Plan::driven(poses()[0], &[(1.0, 0.0), (1.0, 16.0)], 0.2, FREE).unwrap_err();
    assert_eq!(around.field, "inputs[1].turn_rate");
    let nan = Plan::driven(poses()[0], &[(f64::NAN, 0.0)], 0.2, FREE).unwrap_err();
    assert_eq!(nan.field, "poses[1].x");
    // A rejected replacement changes nothing.
    let mut plan = Plan::new(poses(), 0.2, limits).unwrap();
    let before = plan.clone();
    assert!(plan.replace(&[Pose::new(0.0, 0.0, 0.0), Pose::new(1.0, 0.0, 0.0)]).is_err());
    assert_eq!(plan, before);
    plan.replace(&[Pose::new(0.0, 0.0, 0.0), Pose::new(0.2, 0.0, 0.1)]).unwrap();
    assert_eq!(plan.poses()[1].x, 0.2);
}

/// Poses do not distinguish a half turn to the left from a half turn to the right.
#[test]
fn half_a_turn_in_a_step_is_refused() {
    let (start, limits) = (Pose::new(0.0, 2.2, 0.5 * PI), PlanLimits::new(10.0, 100.0));
    for turn in [-PI, PI, PI - 1e-9] {
        let refused = Plan::driven(start, &[(0.0, turn / 0.2)], 0.2, limits).unwrap_err();
        assert_eq!(refused.field, "inputs[0].turn_rate", "{turn}");
        let poses = vec![start, Pose::new(0.0, 2.2, wrap_angle(0.5 * PI + turn))];
        assert_eq!(Plan::new(poses, 0.2, limits).unwrap_err().field, "poses[1]", "{turn}");
    }
    for turn in [1e-5 - PI, PI - 1e-5] {
        let plan = Plan::driven(start, &[(0.0, turn / 0.2)], 0.2, limits).unwrap();
        let half_way = wrap_angle(plan.pose_at(0.1).psi - 0.5 * PI);
        assert!((half_way - 0.5 * turn).abs() < 1e-9, "{half_way}");
    }
}

#[test]
fn a_footprint_is_a_hull_with_a_margin() {
    let square = [[1.0, 1.0], [0.0, 0.0], [-1.0, 1.0], [1.0, -1.0], [0.5, 1.0], [-1.0, -1.0]];
    let footprint = Footprint::polygon(&square).unwrap();
    assert_eq!(footprint.corners(), [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]);
    let grown = footprint.grown(0.25).unwrap();
    let turned = Pose::new(5.0, 0.0, 0.5 * PI);
    for (place, expected) in [
        ([5.0, 3.0], 1.75),
        ([5.0, -3.0], 1.75),
        ([8.0, 0.0], 1.75),
        ([6.0 + 3.0, 1.0 + 4.0], 4.75),
        ([5.0, 0.0], -1.25),
        ([5.5, 0.0], -0.75),
    ] {
        let found = grown.distance_m(turned, place);
        assert!((found - expected).abs() < 1e-12, "{place:?}: {found}");
    }
    let disc = Footprint::disc(0.5).unwrap();
    assert!((disc.distance_m(turned, [5.0, 2.0]) - 1.5).abs() < 1e-12);
    assert_eq!((disc.corners(), disc.margin_m()), (&[[0.0; 2]][..], 0.5));
    let field = |points: &[[f64; 2]]| Footprint::polygon(points).unwrap_err().field;
    assert_eq!(field(&[]), "points");
    assert_eq!(field(&[[0.0, 0.0], [f64::NAN, 0.0]]), "points[1]");
    assert_eq!(Footprint::disc(-0.1).unwrap_err().field, "radius_m");
    assert_eq!(disc.grown(f64::INFINITY).unwrap_err().field, "margin_m");
}
