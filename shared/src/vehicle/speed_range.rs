//! Speeds that a vehicle can choose.

use crate::invalid::{Invalid, positive};
use core::fmt;

/// The lowest and the highest speed of a vehicle (m/s). Within a step, the speed can change at any time and
/// by any amount within the range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedRange {
    lo_mps: f64,
    hi_mps: f64,
}

impl SpeedRange {
    /// Speeds from `lo_mps` ≥ 0 to `hi_mps` (m/s).
    ///
    /// # Errors
    /// [`Invalid`] with the field `speed_mps` if a speed is negative or not finite, or if `lo_mps` is greater
    /// than `hi_mps`.
    pub fn new(lo_mps: f64, hi_mps: f64) -> Result<Self, Invalid> {
        if (0.0..=hi_mps).contains(&lo_mps) && hi_mps.is_finite() {
            return Ok(Self { lo_mps, hi_mps });
        }
        let expected = "two finite speeds ≥ 0, the lower one first";
        Err(Invalid::new("speed_mps", expected, format!("[{lo_mps}, {hi_mps}]")))
    }

    /// Checks a range, which can come from a number.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn check(self) -> Result<(), Invalid> {
        let Self { lo_mps, hi_mps } = self;
        if lo_mps.is_nan() || lo_mps < 0.0 && lo_mps == hi_mps {
            positive("speed_mps", lo_mps)?;
        }
        Self::new(lo_mps, hi_mps).map(drop)
    }

    /// The lowest speed (m/s).
    #[must_use]
    pub fn lo_mps(self) -> f64 {
        self.lo_mps
    }

    /// The highest speed (m/s).
    #[must_use]
    pub fn hi_mps(self) -> f64 {
        self.hi_mps
    }

    /// Whether the range has only one speed.
    #[must_use]
    pub fn is_constant(self) -> bool {
        self.lo_mps == self.hi_mps
    }
}

/// A constant speed (m/s). This conversion does not check the speed; the users of the range check it.
impl From<f64> for SpeedRange {
    fn from(speed_mps: f64) -> Self {
        Self { lo_mps: speed_mps, hi_mps: speed_mps }
    }
}

/// Formats the range as `2 m/s` or `1 to 3 m/s`.
impl fmt::Display for SpeedRange {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_constant() {
            write!(out, "{} to ", self.lo_mps)?;
        }
        write!(out, "{} m/s", self.hi_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::SpeedRange;

    #[test]
    fn ranges_begin_at_zero_or_above_and_are_finite() {
        for (lo, hi) in [(0.0, 0.0), (0.0, 2.0), (1.5, 1.5)] {
            assert!(SpeedRange::new(lo, hi).is_ok(), "{lo} to {hi}");
        }
        for (lo, hi) in
            [(-0.1, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::NAN), (1.0, f64::INFINITY)]
        {
            assert_eq!(SpeedRange::new(lo, hi).unwrap_err().field, "speed_mps", "{lo} to {hi}");
        }
    }
}
