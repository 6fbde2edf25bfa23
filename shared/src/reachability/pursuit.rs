//! The game whose value is the safety level: two Dubins vehicles and a radius.

use super::exact::ExactValue;
use crate::invalid::{Invalid, positive};
use crate::math::{hypot, power_of_two_near, sin_cos};
use crate::vehicle::VehicleModel;
use serde::{Deserialize, Serialize};

/// An evader, a pursuer and the range at which the evader is caught.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PursuitGame {
    /// The vehicle that maximises the smallest range.
    pub evader: VehicleModel,
    /// The vehicle that minimises the smallest range.
    pub pursuer: VehicleModel,
    /// Danger radius R (m).
    pub radius_m: f64,
}

impl PursuitGame {
    /// Checks every parameter.
    ///
    /// # Errors
    /// [`Invalid`] naming the parameter that is not a finite number > 0.
    pub fn check(self) -> Result<Self, Invalid> {
        self.evader.check().map_err(|e| e.within("evader"))?;
        self.pursuer.check().map_err(|e| e.within("pursuer"))?;
        positive("radius_m", self.radius_m)?;
        Ok(self)
    }

    /// A power of two (m) near a third of the radius: 1 m for the paper's radius of 3 m. Length
    /// tolerances scale with this unit, and dividing by it causes no rounding error.
    #[must_use]
    pub fn length_unit_m(&self) -> f64 {
        power_of_two_near(self.radius_m / 3.0)
    }

    /// Whether both vehicles have the same speed and turn rate, so that the closed form applies.
    #[must_use]
    pub fn identical(&self) -> bool {
        self.evader == self.pursuer
    }

    /// The closed form of this game.
    ///
    /// # Errors
    /// [`Invalid`] if the vehicles differ, or if a parameter is not a finite number > 0.
    pub fn exact(self) -> Result<ExactValue, Invalid> {
        self.check()?;
        if !self.identical() {
            let VehicleModel { speed_mps: v, turn_rate_radps: w } = self.pursuer;
            let VehicleModel { speed_mps: ve, turn_rate_radps: we } = self.evader;
            return Err(Invalid::new(
                "method",
                "polar or cartesian, since there is no closed form unless evader and pursuer \
                 have the same speed and turn rate",
                format!("exact with evader ({ve} m/s, {we} rad/s), pursuer ({v} m/s, {w} rad/s)"),
            ));
        }
        ExactValue::new(self.evader.speed_mps, self.evader.turn_rate_radps, self.radius_m)
    }

    /// Velocity of the relative state (x, y, ψ), in (m/s, m/s, rad/s), for the turn rates `a` of
    /// the evader and `b` of the pursuer.
    #[must_use]
    pub fn velocity(&self, [x, y, psi]: [f64; 3], a: f64, b: f64) -> [f64; 3] {
        let (sin, cos) = sin_cos(psi);
        let v = self.pursuer.speed_mps;
        [-self.evader.speed_mps + v * cos + a * y, v * sin - a * x, b - a]
    }

    /// The target function r − R (m).
    #[must_use]
    pub fn target(&self, [x, y, _]: [f64; 3]) -> f64 {
        hypot(x, y) - self.radius_m
    }

    /// The optimal turn rates of evader and pursuer (rad/s) for the gradient p of V: the evader
    /// maximises a (p₁ y − p₂ x − p₃), and the pursuer minimises b p₃. A turn rate is zero where
    /// its factor is zero.
    #[must_use]
    pub fn optimal_turns(&self, [x, y, _]: [f64; 3], [p1, p2, p3]: [f64; 3]) -> [f64; 2] {
        // `signum` of ±0 would be ±1.
        let sign = |s: f64| if s == 0.0 { 0.0 } else { s.signum() };
        [
            self.evader.turn_rate_radps * sign(p1 * y - p2 * x - p3),
            self.pursuer.turn_rate_radps * sign(-p3),
        ]
    }
}
