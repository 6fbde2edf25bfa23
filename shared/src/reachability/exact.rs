//! The value of the game of two identical vehicles, in closed form.
//!
//! From the barrier of Merz (1972) and Mitchell (2001, "Games of two identical
//! vehicles"), extended from the barrier to every state. Lengths are scaled by
//! the turning radius ρ = v/ω, so one formula serves all speeds and rates.

use crate::invalid::{Invalid, finite, positive};
use crate::math::{PI, TAU, acos, atan2, hypot, sin_cos, wrap_positive};

/// The value function of two vehicles with the same speed and largest turn rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactValue {
    /// Speed v of both, m/s.
    speed_mps: f64,
    /// Largest turn rate ω of both, rad/s.
    turn_rate_radps: f64,
    /// Turning radius ρ = v/ω, m.
    turning_radius_m: f64,
    /// Danger radius R, m.
    radius_m: f64,
}

impl ExactValue {
    /// The game of two vehicles of speed `speed_mps` and turn rates within
    /// ±`turn_rate_radps`, where a range of `radius_m` or less is a capture.
    ///
    /// # Errors
    /// [`Invalid`] if a parameter is not a finite number > 0.
    pub fn new(speed_mps: f64, turn_rate_radps: f64, radius_m: f64) -> Result<Self, Invalid> {
        positive("speed_mps", speed_mps)?;
        positive("turn_rate_radps", turn_rate_radps)?;
        positive("radius_m", radius_m)?;
        let turning_radius_m = speed_mps / turn_rate_radps;
        positive("speed_mps / turn_rate_radps", turning_radius_m)?;
        Ok(Self { speed_mps, turn_rate_radps, turning_radius_m, radius_m })
    }

    /// V at a relative state: the pursuer at (`x`, `y`) m in the evader's frame
    /// (x ahead, y to the left), its heading relative to the evader's `psi` rad
    /// counter-clockwise, any real. Metres; ≤ 0 means that the pursuer can force
    /// a capture. The state must be finite ([`Self::checked_value`] checks).
    #[must_use]
    pub fn value(&self, [x, y, psi]: [f64; 3]) -> f64 {
        let rho = self.turning_radius_m;
        let (x, y) = (x / rho, y / rho);
        let psi = wrap_positive(psi);
        let half = 0.5 * psi;
        let (sin_half, cos_half) = sin_cos(half);
        let range = hypot(x, y);
        // Rate at which the range opens when neither turns, up to a factor ≥ 0.
        let opening = -x * sin_half + y * cos_half;
        if opening >= 0.0 {
            return rho * range - self.radius_m;
        }
        let one_side = sheet(x, y, psi, opening, sin_half, cos_half);
        // The mirror image (x, −y, 2π − ψ), where sin(h) stays and cos(h) changes sign.
        let other_side = sheet(x, -y, TAU - psi, opening, sin_half, -cos_half);
        rho * range.min(one_side.max(other_side)) - self.radius_m
    }

    /// [`Self::value`] of a state from outside.
    ///
    /// # Errors
    /// [`Invalid`] naming the coordinate that is not finite.
    pub fn checked_value(&self, state: [f64; 3]) -> Result<f64, Invalid> {
        for (name, value) in ["x", "y", "psi"].into_iter().zip(state) {
            finite(name, value)?;
        }
        Ok(self.value(state))
    }

    /// Speed v of both, m/s.
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Largest turn rate ω of both, rad/s.
    #[must_use]
    pub fn turn_rate_radps(&self) -> f64 {
        self.turn_rate_radps
    }

    /// Danger radius R, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// A range, m, beyond which V > `level` at every bearing and heading.
    ///
    /// Both turn at full rate for at most π/ω, so the range cannot shrink by more
    /// than twice the path of that manoeuvre.
    #[must_use]
    pub fn range_bound_m(&self, level: f64) -> f64 {
        2.0 * PI * self.turning_radius_m + self.radius_m + level
    }
}

/// The smallest range, in turning radii, when the evader turns right to the end
/// and the pursuer answers optimally; ψ in [0, 2π], `t0` < 0 the opening rate.
fn sheet(x: f64, y: f64, psi: f64, t0: f64, sin_half: f64, cos_half: f64) -> f64 {
    let n0 = x * cos_half + y * sin_half;
    let a = -t0 - 2.0 * cos_half;
    let b = -n0;
    if a <= 2.0 {
        return n0; // opposite turns to the end
    }
    let u = atan2(b, a) + acos((2.0 / hypot(a, b)).min(1.0));
    let u_max = PI - 0.5 * psi;
    if u <= u_max {
        let (sin_u, cos_u) = sin_cos(u);
        n0 * cos_u + a * sin_u - 2.0 * u // the pursuer ends straight
    } else {
        let (sin_psi, cos_psi) = sin_cos(psi);
        hypot(x + sin_psi, y + 1.0 - cos_psi) - 2.0 * u_max // same-sense turns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn paper() -> ExactValue {
        ExactValue::new(2.0, 0.5, 3.0).unwrap()
    }

    #[test]
    fn spot_values_of_the_reference() {
        assert!((paper().value([10.0, 0.0, PI]) + 2.14801).abs() < 5e-6);
        assert!((paper().value([30.0, 5.0, 3.5]) - 17.17630).abs() < 5e-6);
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
        assert_eq!(paper().checked_value([0.0, f64::NAN, 0.0]).unwrap_err().field, "y");
    }

    fn state() -> impl Strategy<Value = [f64; 3]> {
        (-25.0..25.0f64, -25.0..25.0f64, -10.0..10.0f64).prop_map(|(x, y, psi)| [x, y, psi])
    }

    proptest! {
        #[test]
        fn symmetric_in_the_evaders_axis(s in state()) {
            let [x, y, psi] = s;
            prop_assert!((paper().value(s) - paper().value([x, -y, -psi])).abs() < 1e-9);
        }

        #[test]
        fn never_above_the_present_range(s in state()) {
            prop_assert!(paper().value(s) <= hypot(s[0], s[1]) - 3.0 + 1e-9);
        }

        #[test]
        fn scales_with_speed_and_length(s in state(), scale in 0.2..5.0f64) {
            let [x, y, psi] = s;
            let scaled = ExactValue::new(2.0 * scale, 0.5, 3.0 * scale).unwrap();
            let faster = ExactValue::new(6.0, 1.5, 3.0).unwrap();
            let v = paper().value(s);
            prop_assert!((scaled.value([x * scale, y * scale, psi]) - scale * v).abs() < 1e-9);
            prop_assert!((faster.value(s) - v).abs() < 1e-9);
        }

        #[test]
        fn falls_with_the_radius_one_for_one(s in state()) {
            let wider = ExactValue::new(2.0, 0.5, 4.0).unwrap();
            prop_assert!((paper().value(s) - wider.value(s) - 1.0).abs() < 1e-9);
        }

        #[test]
        fn positive_beyond_the_range_bound(bearing in -PI..PI, psi in -PI..PI, level in 0.0..5.0f64) {
            let r = paper().range_bound_m(level) + 1e-9;
            let (s, c) = sin_cos(bearing);
            prop_assert!(paper().value([r * c, r * s, psi]) > level - 1e-6);
        }

        #[test]
        fn continuous_where_the_heading_wraps(x in -20.0..20.0f64, y in -20.0..20.0f64) {
            let eps = 1e-9;
            prop_assert!((paper().value([x, y, eps]) - paper().value([x, y, -eps])).abs() < 1e-6);
        }
    }
}
