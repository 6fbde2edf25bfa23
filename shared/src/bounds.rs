//! Time-varying bounds on the human's turn rate (the paper, Definition 1 and
//! Algorithm 1).

use crate::invalid::{Invalid, length};

/// Lowest and highest turn rate of each coming step, rad/s.
#[derive(Clone, Debug, PartialEq)]
pub struct InputBounds {
    lo: Vec<f64>,
    hi: Vec<f64>,
}

impl InputBounds {
    /// Bounds of `lo.len()` ≥ 1 steps within [`turn_rate.0`, `turn_rate.1`] rad/s.
    ///
    /// # Errors
    /// [`Invalid`] if the lists are empty or differ in length, a bound is not
    /// finite or outside the turn rate, or `lo[i] > hi[i]`.
    pub fn new(lo: Vec<f64>, hi: Vec<f64>, turn_rate: (f64, f64)) -> Result<Self, Invalid> {
        if lo.is_empty() {
            return Err(Invalid::new("lo", "at least one step", "none"));
        }
        length("hi", lo.len(), hi.len())?;
        for (i, (&low, &high)) in lo.iter().zip(&hi).enumerate() {
            for (name, bound) in [("lo", low), ("hi", high)] {
                if !(turn_rate.0..=turn_rate.1).contains(&bound) {
                    let range =
                        format!("a turn rate from {} to {} rad/s", turn_rate.0, turn_rate.1);
                    return Err(Invalid::new(format!("{name}[{i}]"), range, bound));
                }
            }
            if low > high {
                let expected = format!("at most hi[{i}] = {high}");
                return Err(Invalid::new(format!("lo[{i}]"), expected, low));
            }
        }
        Ok(Self { lo, hi })
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.lo.len()
    }

    /// Lowest turn rate of each step, rad/s.
    #[must_use]
    pub fn lo(&self) -> &[f64] {
        &self.lo
    }

    /// Highest turn rate of each step, rad/s.
    #[must_use]
    pub fn hi(&self) -> &[f64] {
        &self.hi
    }
}
