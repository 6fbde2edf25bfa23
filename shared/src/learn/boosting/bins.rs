//! Columns cut into bins of about equally many rows: trees then try few splits.

use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::learn::tree::grower::Columns;

/// Rows with the number of their bin in place of each value.
pub(super) struct Bins {
    columns: Columns,
    /// For each column, the threshold between each bin and the next.
    edges: Vec<Vec<f64>>,
}

impl Bins {
    /// At most `most` ≥ 2 bins a column; values that a tree would not part are in one.
    ///
    /// # Errors
    /// As for [`Columns::new`].
    pub(super) fn new(samples: &Samples<'_>, most: usize) -> Result<Self, Invalid> {
        let (width, rows) = (samples.width(), samples.labels().len());
        let exact = Columns::new(samples)?;
        let mut numbers = vec![0.0; width * rows];
        let mut edges = Vec::with_capacity(width);
        for column in 0..width {
            let (mut between, mut ends) = (Vec::new(), Vec::new());
            let one_each = exact.partings(column).count() < most;
            let share = rows.div_ceil(most);
            let mut full = share;
            for (end, threshold) in exact.partings(column) {
                if one_each || end >= full {
                    between.push(threshold);
                    ends.push(end);
                    full = (end / share + 1) * share;
                }
            }
            let mut bin = 0;
            for (i, row) in exact.rows(column).enumerate() {
                if ends.get(bin) == Some(&i) {
                    bin += 1;
                }
                numbers[row * width + column] = bin as f64;
            }
            edges.push(between);
        }
        let binned = Samples::new(width, &numbers, samples.labels(), samples.classes())?;
        Ok(Self { columns: Columns::new(&binned)?, edges })
    }

    pub(super) fn columns(&self) -> &Columns {
        &self.columns
    }

    /// The feature's threshold where a tree parts bins at `number`.
    pub(super) fn threshold(&self, column: usize, number: f64) -> f64 {
        self.edges[column][number as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(values: &[f64], most: usize) -> Vec<f64> {
        let labels = vec![0; values.len()];
        let samples = Samples::new(1, values, &labels, 1).unwrap();
        Bins::new(&samples, most).unwrap().edges.remove(0)
    }

    #[test]
    fn few_values_have_a_bin_each() {
        assert_eq!(bins(&[3.0, 1.0, 1.0, 2.0, 5.0], 4), [1.5, 2.5, 4.0]);
        assert!(bins(&[2.0, 2.0, 2.0], 4).is_empty());
    }

    #[test]
    fn many_values_share_bins_equally() {
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(bins(&values, 4), [24.5, 49.5, 74.5]);
        // A value that fills several bins takes one.
        let values: Vec<f64> = (0..100).map(|i| f64::from((i - 60).max(0))).collect();
        assert_eq!(bins(&values, 4), [0.5, 14.5]);
    }
}
