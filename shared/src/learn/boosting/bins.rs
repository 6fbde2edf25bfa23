//! Divides columns into bins with about equally many rows, so that trees have few splits to try.

use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::learn::tree::grower::Columns;
use core::ops::Range;

/// The bin of each row in each column.
pub(super) struct Bins {
    /// Rows × columns: the index of the bin. Bins are numbered consecutively over all columns.
    cells: Vec<u32>,
    /// First bin of each column, and the total number of bins.
    begins: Vec<usize>,
    /// For each column, the thresholds between adjacent bins.
    edges: Vec<Vec<f64>>,
}

impl Bins {
    /// Cuts each column into at most `most` ≥ 2 bins. Values that a tree would not separate share a
    /// bin.
    ///
    /// # Errors
    /// The errors of [`Columns::new`].
    pub(super) fn new(samples: &Samples<'_>, most: usize) -> Result<Self, Invalid> {
        let (width, rows) = (samples.width(), samples.labels().len());
        let exact = Columns::new(samples)?;
        let mut cells = vec![0; width * rows];
        let mut begins = vec![0];
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
            let begin = begins[column];
            let mut bin = 0;
            for (i, row) in exact.rows(column).enumerate() {
                if ends.get(bin) == Some(&i) {
                    bin += 1;
                }
                cells[row * width + column] = (begin + bin) as u32;
            }
            begins.push(begin + between.len() + 1);
            edges.push(between);
        }
        Ok(Self { cells, begins, edges })
    }

    pub(super) fn columns(&self) -> usize {
        self.edges.len()
    }

    /// Total number of bins.
    pub(super) fn count(&self) -> usize {
        self.begins[self.edges.len()]
    }

    /// The bins of a column.
    pub(super) fn range(&self, column: usize) -> Range<usize> {
        self.begins[column]..self.begins[column + 1]
    }

    /// The bins of a row, one per column.
    #[inline(always)]
    pub(super) fn of(&self, row: usize) -> &[u32] {
        let width = self.edges.len();
        &self.cells[row * width..(row + 1) * width]
    }

    /// The feature's threshold between bins `last` and `next`, if all bins between them are empty.
    /// It is the threshold after the middle bin.
    pub(super) fn threshold(&self, column: usize, last: usize, next: usize) -> f64 {
        self.edges[column][(last + next) / 2]
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
        // A frequent value takes only one bin, even if its rows could fill several.
        let values: Vec<f64> = (0..100).map(|i| f64::from((i - 60).max(0))).collect();
        assert_eq!(bins(&values, 4), [0.5, 14.5]);
    }
}
