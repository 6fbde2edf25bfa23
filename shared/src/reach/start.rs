//! The start of the vehicle: a pose, or a set of poses around it.

use crate::invalid::Invalid;
use crate::math::PI;
use crate::vehicle::Pose;

/// Uncertainty of a start position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum PositionUncertainty {
    /// The position is exact.
    #[default]
    None,
    /// The position deviates by at most a radius, in any direction.
    Disc {
        /// The radius (m).
        radius_m: f64,
    },
    /// The position deviates by at most these lengths along and across the heading of the pose.
    Box {
        /// Half the length of the box (m).
        along_m: f64,
        /// Half the width of the box (m).
        across_m: f64,
    },
}

/// The poses from which a vehicle can start. Position and heading deviate from a given pose
/// independently of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartSet {
    pub(super) pose: Pose,
    pub(super) position: PositionUncertainty,
    pub(super) heading_rad: f64,
}

impl StartSet {
    /// Positions around the position of `pose` (world frame), with headings that deviate from its
    /// heading by at most `heading_rad` (0 to π).
    ///
    /// # Errors
    /// [`Invalid`] if the pose is not valid, a length is not from 0 to 10⁴ m, or the angle is not from
    /// 0 to π.
    pub fn new(
        pose: Pose,
        position: PositionUncertainty,
        heading_rad: f64,
    ) -> Result<Self, Invalid> {
        pose.check()?;
        match position {
            PositionUncertainty::None => {}
            PositionUncertainty::Disc { radius_m } => {
                non_negative("radius_m", radius_m)?;
            }
            PositionUncertainty::Box { along_m, across_m } => {
                non_negative("along_m", along_m)?;
                non_negative("across_m", across_m)?;
            }
        }
        if !(0.0..=PI).contains(&heading_rad) {
            return Err(Invalid::new("heading_rad", "0 to π rad", heading_rad));
        }
        Ok(Self { pose, position, heading_rad })
    }

    /// The pose in the middle (world frame).
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// The largest deviation of the position from the position of [`Self::pose`].
    #[must_use]
    pub fn position(&self) -> PositionUncertainty {
        self.position
    }

    /// Largest deviation of the heading to either side (rad).
    #[must_use]
    pub fn heading_rad(&self) -> f64 {
        self.heading_rad
    }

    /// The radius of the disc, and half the length and width of the box (m).
    pub(super) fn extents(&self) -> (f64, [f64; 2]) {
        match self.position {
            PositionUncertainty::None => (0.0, [0.0; 2]),
            PositionUncertainty::Disc { radius_m } => (radius_m, [0.0; 2]),
            PositionUncertainty::Box { along_m, across_m } => (0.0, [along_m, across_m]),
        }
    }
}

/// A start set with exactly one pose. This conversion does not check the pose; the users of the start
/// set check it.
impl From<Pose> for StartSet {
    fn from(pose: Pose) -> Self {
        Self { pose, position: PositionUncertainty::None, heading_rad: 0.0 }
    }
}

/// Largest uncertainty of a position (m).
const MOST_M: f64 = 1e4;

/// Checks that a number is from 0 to [`MOST_M`].
pub(super) fn non_negative(field: &str, value: f64) -> Result<f64, Invalid> {
    if (0.0..=MOST_M).contains(&value) {
        Ok(value)
    } else {
        Err(Invalid::new(field, format!("a number from 0 to {MOST_M}"), value))
    }
}
