//! Vehicles: their poses, inputs and motion.

pub mod dubins;
mod speed_range;

pub use speed_range::SpeedRange;

use crate::invalid::{Invalid, positive};
use crate::math::wrap_angle;
use serde::{Deserialize, Serialize};

/// A position (m) and a heading in (−π, π] (rad, counter-clockwise from +x). Serialized as
/// `[x, y, psi]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
pub struct Pose {
    /// To the right (m).
    pub x: f64,
    /// Up (m).
    pub y: f64,
    /// Heading ψ (rad).
    pub psi: f64,
}

impl Pose {
    /// A pose; the heading is wrapped to (−π, π].
    #[must_use]
    pub fn new(x: f64, y: f64, psi: f64) -> Self {
        Self { x, y, psi: wrap_angle(psi) }
    }

    /// The position (m).
    #[must_use]
    pub fn position(&self) -> [f64; 2] {
        [self.x, self.y]
    }

    /// The largest accepted magnitude of a coordinate (m or rad). Distances between far larger
    /// coordinates would overflow.
    pub const MOST: f64 = 1e6;

    /// Accepts a pose whose three coordinates are at most [`Self::MOST`] in magnitude.
    ///
    /// # Errors
    /// [`Invalid`] naming the coordinate.
    pub fn check(&self) -> Result<(), Invalid> {
        for (field, value) in [("x", self.x), ("y", self.y), ("psi", self.psi)] {
            Self::checked(field, value)?;
        }
        Ok(())
    }

    /// Accepts one coordinate of a pose.
    ///
    /// # Errors
    /// [`Invalid`] naming the coordinate.
    pub fn checked(field: &str, value: f64) -> Result<f64, Invalid> {
        if value.abs() <= Self::MOST {
            return Ok(value);
        }
        let expected = format!("a number from -{0} to {0}", Self::MOST);
        Err(Invalid::new(field, expected, format!("{value:?}")))
    }
}

impl From<[f64; 3]> for Pose {
    /// Does not wrap the heading, because a stored state must survive a round trip bit for bit.
    fn from([x, y, psi]: [f64; 3]) -> Self {
        Self { x, y, psi }
    }
}

impl From<Pose> for [f64; 3] {
    fn from(pose: Pose) -> Self {
        [pose.x, pose.y, pose.psi]
    }
}

/// The turn that the held key requests for one step. Serialized as −1, 0 or 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "i64", into = "i8")]
pub enum TurnInput {
    /// Turn right (clockwise) at the full rate, −ω.
    Right,
    /// Keep the heading.
    Straight,
    /// Turn left (counter-clockwise) at the full rate, +ω.
    Left,
}

#[cfg(feature = "openapi")]
impl schemars::JsonSchema for TurnInput {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "TurnInput".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "The turn that the held key requests for one step: −1 right, 0 straight, 1 left.",
            "type": "integer",
            "enum": [-1, 0, 1],
        })
    }
}

impl TurnInput {
    /// Every input, in ascending order of turn rate.
    pub const ALL: [Self; 3] = [Self::Right, Self::Straight, Self::Left];

    /// The sign of the turn rate: −1, 0 or 1.
    #[must_use]
    pub fn sign(self) -> i8 {
        match self {
            Self::Right => -1,
            Self::Straight => 0,
            Self::Left => 1,
        }
    }

    /// The word for this input on pages and in reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Straight => "straight",
            Self::Left => "left",
        }
    }
}

impl From<TurnInput> for i8 {
    fn from(input: TurnInput) -> Self {
        input.sign()
    }
}

impl TryFrom<i64> for TurnInput {
    type Error = Invalid;

    fn try_from(sign: i64) -> Result<Self, Invalid> {
        match sign {
            -1 => Ok(Self::Right),
            0 => Ok(Self::Straight),
            1 => Ok(Self::Left),
            other => Err(Invalid::new("", "-1 (right), 0 (straight) or 1 (left)", other)),
        }
    }
}

/// A Dubins car: constant speed, bounded turn rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct VehicleModel {
    /// Speed v (m/s).
    pub speed_mps: f64,
    /// Largest turn rate ω (rad/s).
    pub turn_rate_radps: f64,
}

impl VehicleModel {
    /// Accepts a model whose numbers are finite and > 0.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        positive("speed_mps", self.speed_mps)?;
        positive("turn_rate_radps", self.turn_rate_radps)?;
        Ok(())
    }

    /// The turn rate of an input (rad/s).
    #[must_use]
    pub fn turn_rate(&self, input: TurnInput) -> f64 {
        f64::from(input.sign()) * self.turn_rate_radps
    }

    /// Lowest and highest turn rate (rad/s).
    #[must_use]
    pub fn turn_range(&self) -> (f64, f64) {
        (-self.turn_rate_radps, self.turn_rate_radps)
    }

    /// The pose after `seconds` of `input`.
    #[must_use]
    pub fn advance(&self, pose: Pose, input: TurnInput, seconds: f64) -> Pose {
        dubins::arc(pose, self.speed_mps, self.turn_rate(input), seconds)
    }
}
