use super::*;
use crate::math::{SeededRng, TAU, acos};

#[test]
fn far_away_the_value_is_the_range() {
    let mut rng = SeededRng::new(31);
    for _ in 0..2000 {
        let range = [1e150, 1e154, 1e155, 1e200, 1e300][rng.below(5)];
        let (sin, cos) = sin_cos(rng.uniform(-PI, PI));
        let state = [range * cos, range * sin, rng.uniform(-PI, PI)];
        let found = paper().analyze(state);
        assert!((found.value / range - 1.0).abs() < 1e-12, "{state:?}: {}", found.value);
        assert_eq!(found.value, paper().value(state), "{state:?}");
        let [dx, dy, dpsi] = found.gradient;
        assert!((hypot(dx, dy) - 1.0).abs() < 1e-9 && dpsi.is_finite(), "{state:?}: {found:?}");
    }
}

fn paper() -> ExactValue {
    ExactValue::new(2.0, 0.5, 3.0).unwrap()
}

/// A direct implementation of the formula, to check [`ExactValue::value`].
fn plain_value(game: ExactValue, [x, y, psi]: [f64; 3]) -> f64 {
    fn sheet(x: f64, y: f64, psi: f64) -> f64 {
        let (sin_half, cos_half) = sin_cos(0.5 * psi);
        let n0 = x * cos_half + y * sin_half;
        let t0 = -x * sin_half + y * cos_half;
        let (a, b) = (-t0 - 2.0 * cos_half, -n0);
        if a <= 2.0 {
            return n0;
        }
        let u = atan2(b, a) + acos((2.0 / hypot(a, b)).min(1.0));
        let u_max = PI - 0.5 * psi;
        let (sin_u, cos_u) = sin_cos(u);
        let (sin_psi, cos_psi) = sin_cos(psi);
        if u <= u_max {
            n0 * cos_u + a * sin_u - 2.0 * u
        } else {
            hypot(x + sin_psi, y + 1.0 - cos_psi) - 2.0 * u_max
        }
    }
    let rho = game.speed_mps / game.turn_rate_radps;
    let (x, y, psi) = (x / rho, y / rho, wrap_positive(psi));
    let (sin_half, cos_half) = sin_cos(0.5 * psi);
    let range = hypot(x, y);
    let nearest = if -x * sin_half + y * cos_half >= 0.0 {
        range
    } else {
        range.min(sheet(x, y, psi).max(sheet(x, -y, TAU - psi)))
    };
    rho * nearest - game.radius_m
}

#[test]
fn the_fast_value_is_the_plain_one() {
    let game = paper();
    let mut rng = SeededRng::new(11);
    for span in [1.0, 10.0, 40.0, 1000.0] {
        for _ in 0..50_000 {
            let (x, y) = (rng.uniform(-span, span), rng.uniform(-span, span));
            let state = [x, y, rng.uniform(-10.0, 10.0)];
            let (fast, plain) = (game.value(state), plain_value(game, state));
            assert!((fast - plain).abs() <= 1e-14 * (40.0 + span), "{state:?} {fast} {plain}");
            assert_eq!(game.analyze(state).value.to_bits(), fast.to_bits());
        }
    }
}

#[test]
fn spot_values_of_the_reference() {
    assert!((paper().value([10.0, 0.0, PI]) + 2.14801).abs() < 5e-6);
    assert!((paper().value([30.0, 5.0, 3.5]) - 17.17630).abs() < 5e-6);
}

/// Vehicles that can hardly turn drive straight on, so the smallest range follows from two straight
/// motions.
#[test]
fn vehicles_that_hardly_turn_drive_straight() {
    let mut rng = SeededRng::new(12);
    for turn_rate in [1e-20, 1e-120, 1e-160, 1e-200, 1e-300] {
        let game = ExactValue::new(1.0, turn_rate, 1.0).unwrap();
        assert!((game.value([2.0, 1.0, -1.0]) - 0.275_732).abs() < 1e-5, "{turn_rate:e}");
        for _ in 0..1000 {
            let [x, y, psi] = [3.0, 3.0, 3.0].map(|most| rng.uniform(-most, most));
            // The pursuer's relative velocity, and the time at which it is nearest.
            let (sin, cos) = sin_cos(psi);
            let (vx, vy) = (cos - 1.0, sin);
            let time = (-(x * vx + y * vy) / (vx * vx + vy * vy)).max(0.0);
            let expected = hypot(x + time * vx, y + time * vy) - 1.0;
            let found = game.value([x, y, psi]);
            assert!((found - expected).abs() < 1e-9, "{turn_rate:e} {x} {y} {psi}: {found}");
        }
    }
}

#[test]
fn zero_at_the_tip_of_the_barrier() {
    assert!(paper().value([13.021, 0.0, PI]).abs() < 1e-3);
}

#[test]
fn bad_parameters_name_the_field() {
    let complaint = ExactValue::new(2.0, 0.0, 3.0).unwrap_err();
    assert_eq!(complaint.field, "turn_rate_radps");
    assert_eq!(ExactValue::new(f64::NAN, 0.5, 3.0).unwrap_err().field, "speed_mps");
}
