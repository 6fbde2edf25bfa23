//! The Dubins car: ẋ = v cos ψ, ẏ = v sin ψ, ψ̇ = ω (the paper, eq. 4).
//!
//! The motion of one car and the relative state of two cars are in one file, because they must
//! agree.

use super::Pose;
use crate::math::{sin_cos, sinc, wrap_angle};

/// The pose after a time τ = `seconds` at constant speed and turn rate, which is the end of a
/// circular arc. The arc's chord has length v·τ·sinc(ωτ/2) and direction ψ + ωτ/2. Both formulas
/// also hold for ω = 0.
#[must_use]
pub fn arc(pose: Pose, speed_mps: f64, turn_rate_radps: f64, seconds: f64) -> Pose {
    let half_turn = 0.5 * turn_rate_radps * seconds;
    let chord = speed_mps * seconds * sinc(half_turn);
    let (sin, cos) = sin_cos(pose.psi + half_turn);
    Pose {
        x: pose.x + chord * cos,
        y: pose.y + chord * sin,
        psi: wrap_angle(pose.psi + turn_rate_radps * seconds),
    }
}

/// The relative state of the pursuit game: the pursuer's position in the evader's frame (x ahead,
/// y to the left; in metres), and the pursuer's heading minus the evader's heading, wrapped to
/// (−π, π] (rad).
#[must_use]
pub fn relative_state(evader: Pose, pursuer: Pose) -> [f64; 3] {
    let (sin, cos) = sin_cos(evader.psi);
    let (dx, dy) = (pursuer.x - evader.x, pursuer.y - evader.y);
    [cos * dx + sin * dy, -sin * dx + cos * dy, wrap_angle(pursuer.psi - evader.psi)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, hypot};
    use proptest::prelude::*;

    /// The reference implementation, which integrates the motion in many small steps.
    fn euler(mut pose: Pose, speed: f64, rate: f64, seconds: f64) -> Pose {
        let n = 200_000;
        let h = seconds / f64::from(n);
        for _ in 0..n {
            let (sin, cos) = sin_cos(pose.psi + 0.5 * rate * h);
            pose =
                Pose::new(pose.x + speed * h * cos, pose.y + speed * h * sin, pose.psi + rate * h);
        }
        pose
    }

    #[test]
    fn the_arc_agrees_with_small_steps() {
        for rate in [-0.5, -1e-3, 0.0, 0.3, 0.5] {
            let start = Pose::new(1.0, -2.0, 2.8);
            let (exact, small) = (arc(start, 2.0, rate, 3.0), euler(start, 2.0, rate, 3.0));
            assert!(hypot(exact.x - small.x, exact.y - small.y) < 1e-8, "{rate}");
            assert!(wrap_angle(exact.psi - small.psi).abs() < 1e-9, "{rate}");
        }
    }

    #[test]
    fn a_full_circle_returns() {
        let start = Pose::new(3.0, 4.0, 1.0);
        let end = arc(start, 2.0, 0.5, 4.0 * PI);
        assert!(hypot(end.x - start.x, end.y - start.y) < 1e-12);
        assert!((end.psi - start.psi).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn arcs_compose(psi in -PI..PI, rate in -0.5..0.5f64, a in 0.0..2.0f64, b in 0.0..2.0f64) {
            let start = Pose::new(0.0, 0.0, psi);
            let whole = arc(start, 2.0, rate, a + b);
            let parts = arc(arc(start, 2.0, rate, a), 2.0, rate, b);
            prop_assert!(hypot(whole.x - parts.x, whole.y - parts.y) < 1e-12);
            prop_assert!(wrap_angle(whole.psi - parts.psi).abs() < 1e-12);
        }

        #[test]
        fn the_relative_state_keeps_the_range(
            (ax, ay, ap) in (-9.0..9.0f64, -9.0..9.0f64, -PI..PI),
            (bx, by, bp) in (-9.0..9.0f64, -9.0..9.0f64, -PI..PI),
        ) {
            let (a, b) = (Pose::new(ax, ay, ap), Pose::new(bx, by, bp));
            let [x, y, psi] = relative_state(a, b);
            prop_assert!((hypot(x, y) - hypot(ax - bx, ay - by)).abs() < 1e-12);
            // Transforming the relative pose back from the evader's frame gives the pursuer.
            let (sin, cos) = sin_cos(ap);
            prop_assert!((ax + cos * x - sin * y - bx).abs() < 1e-12);
            prop_assert!((ay + sin * x + cos * y - by).abs() < 1e-12);
            prop_assert!(wrap_angle(ap + psi - bp).abs() < 1e-12);
        }
    }
}
