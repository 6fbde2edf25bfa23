//! Standardisation: zero mean and unit population standard deviation.

use crate::invalid::{Invalid, length, moderate, moderate_divisor};

/// Standardises features: subtracts the mean of each feature, then divides by its scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    mean: Vec<f64>,
    scale: Vec<f64>,
}

impl Scale {
    /// A scale from means and divisors.
    ///
    /// # Errors
    /// [`Invalid`] if lengths differ, a mean is beyond ±10¹⁰⁰ or a divisor is outside 10⁻¹⁰⁰ to
    /// 10¹⁰⁰.
    pub fn new(mean: Vec<f64>, scale: Vec<f64>) -> Result<Self, Invalid> {
        length("scale", mean.len(), scale.len())?;
        for (i, (&mean, &scale)) in mean.iter().zip(&scale).enumerate() {
            moderate(&format!("mean[{i}]"), mean)?;
            moderate_divisor(&format!("scale[{i}]"), scale)?;
        }
        Ok(Self { mean, scale })
    }

    /// Fits the mean and the population standard deviation of each column of `rows` (row-major,
    /// `width` columns). The divisor of a constant column is 1.
    #[must_use]
    pub fn fit(width: usize, rows: &[f64]) -> Self {
        let n = (rows.len() / width).max(1) as f64;
        let column_mean = |term: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            let mut sums = vec![0.0; width];
            for row in rows.chunks_exact(width) {
                for (j, (&value, sum)) in row.iter().zip(&mut sums).enumerate() {
                    *sum += term(j, value);
                }
            }
            sums.into_iter().map(|sum| sum / n).collect()
        };
        let mean = column_mean(&|_, value| value);
        let variance = column_mean(&|j, value| (value - mean[j]) * (value - mean[j]));
        // Rounding errors give a constant column a variance of about (ε·mean)² instead of 0.
        let scale = variance.iter().zip(&mean).map(|(&variance, &mean)| {
            let sd = variance.sqrt();
            if sd <= 1e-12 * (1.0 + mean.abs()) { 1.0 } else { sd }
        });
        let scale = scale.collect();
        Self { mean, scale }
    }

    /// The scale fitted to `rows`, and the standardised rows.
    #[must_use]
    pub fn standardised(width: usize, rows: &[f64]) -> (Self, Vec<f64>) {
        let scale = Self::fit(width, rows);
        let values = rows.chunks_exact(width).flat_map(|row| scale.row(row)).collect();
        (scale, values)
    }

    /// A standardised row.
    #[must_use]
    pub fn row(&self, row: &[f64]) -> Vec<f64> {
        row.iter().enumerate().map(|(j, &value)| self.apply(j, value)).collect()
    }

    /// The means.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The divisors.
    #[must_use]
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// A standardised feature.
    #[must_use]
    pub fn apply(&self, column: usize, value: f64) -> f64 {
        (value - self.mean[column]) / self.scale[column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_mean_and_population_deviation() {
        let scale = Scale::fit(2, &[1.0, 5.0, 3.0, 5.0, 5.0, 5.0]);
        assert_eq!(scale.mean(), [3.0, 5.0]);
        assert!((scale.scale()[0] - (8.0f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(scale.scale()[1], 1.0, "a constant column is left undivided");
        assert_eq!(scale.apply(1, 5.0), 0.0);
    }
}
