//! Grows the trees of boosting from histograms.
//!
//! A node's histogram contains, for each bin of each column, the number of the node's rows in this
//! bin and the sums of their gradients and Hessians. All splits are evaluated on the histogram. Of
//! two children, only the smaller child's histogram is summed over rows. The larger child's
//! histogram is the parent's histogram minus the smaller child's histogram. Sums are integers, so
//! the subtraction is exact. Ties are broken as in [`tree`](super::super::tree): by the lowest
//! column index, then by the lowest threshold.

use super::bins::Bins;
use super::newton::{Newton, Sums};
use crate::predict::tree::Node;
use core::ops::{AddAssign, SubAssign};

/// Limits on the growth of trees.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) depth: usize,
    /// Minimum number of rows in a leaf.
    pub(super) leaf: usize,
}

/// Totals of a bin's rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bin {
    sums: Sums,
    rows: i64,
}

impl AddAssign for Bin {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.sums[0] += other.sums[0];
        self.sums[1] += other.sums[1];
        self.rows += other.rows;
    }
}

impl SubAssign for Bin {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        self.sums[0] -= other.sums[0];
        self.sums[1] -= other.sums[1];
        self.rows -= other.rows;
    }
}

/// A split. Rows whose bin of `column` is at most `last` go left.
#[derive(Clone, Copy)]
struct Split {
    score: f64,
    column: usize,
    last: usize,
    /// The first non-empty bin after `last`.
    next: usize,
    left: Bin,
}

/// A tree: its nodes in preorder, and the sums of each node.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Grown {
    pub(super) nodes: Vec<Node>,
    pub(super) sums: Vec<Sums>,
}

/// Buffers for growing trees, which are reused from one tree to the next.
pub(super) struct Grower {
    limits: Limits,
    /// The rows of each node, contiguous.
    rows: Vec<u32>,
    /// Unused histograms.
    spare: Vec<Vec<Bin>>,
}

impl Grower {
    pub(super) fn new(limits: Limits) -> Self {
        Self { limits, rows: Vec::new(), spare: Vec::new() }
    }

    /// Grows a tree, and writes the leaf of each row to `leaf_of`.
    pub(super) fn grow(&mut self, bins: &Bins, newton: &Newton, leaf_of: &mut [usize]) -> Grown {
        let mut rows = core::mem::take(&mut self.rows);
        rows.clear();
        rows.extend(0..leaf_of.len() as u32);
        let mut growing = Growing { bins, newton, grower: self, leaf_of, grown: Grown::default() };
        let histogram = growing.histogram(&rows);
        let sums = newton.total(rows.iter().map(|&row| row as usize));
        growing.node(&mut rows, sums, Some(histogram), 0);
        let grown = growing.grown;
        self.rows = rows;
        grown
    }
}

/// A tree while it grows.
struct Growing<'a> {
    bins: &'a Bins,
    newton: &'a Newton,
    grower: &'a mut Grower,
    leaf_of: &'a mut [usize],
    grown: Grown,
}

impl Growing<'_> {
    /// Adds the node of `rows` and its subtree. Returns the index of the node. If there is no
    /// histogram, the node becomes a leaf.
    fn node(
        &mut self,
        rows: &mut [u32],
        sums: Sums,
        histogram: Option<Vec<Bin>>,
        depth: usize,
    ) -> u32 {
        let place = self.grown.nodes.len();
        self.grown.nodes.push(Node::LEAF);
        self.grown.sums.push(sums);
        let split = histogram.as_ref().and_then(|bins| self.best(bins, rows.len(), sums));
        let Some(split) = split else {
            for &row in &*rows {
                self.leaf_of[row as usize] = place;
            }
            self.grower.spare.extend(histogram);
            return place as u32;
        };
        let first_right = self.part(rows, split);
        let (left, right) = rows.split_at_mut(first_right);
        let left_sums = split.left.sums;
        let right_sums = [sums[0] - left_sums[0], sums[1] - left_sums[1]];
        let (left_bins, right_bins) = self.children(left, right, histogram, depth + 1);
        let left = self.node(left, left_sums, left_bins, depth + 1);
        let right = self.node(right, right_sums, right_bins, depth + 1);
        self.grown.nodes[place] = Node {
            feature: split.column as u32,
            threshold: self.bins.threshold(split.column, split.last, split.next),
            left,
            right,
        };
        place as u32
    }

    /// Computes the histogram of each child that can be split. The smaller child also gets a
    /// histogram if only the larger child can be split. Consumes the parent's histogram.
    fn children(
        &mut self,
        left: &[u32],
        right: &[u32],
        parent: Option<Vec<Bin>>,
        depth: usize,
    ) -> (Option<Vec<Bin>>, Option<Vec<Bin>>) {
        let open = |rows: &[u32]| {
            depth < self.grower.limits.depth && rows.len() >= 2 * self.grower.limits.leaf
        };
        let (left_open, right_open) = (open(left), open(right));
        if !left_open && !right_open {
            self.grower.spare.extend(parent);
            return (None, None);
        }
        let left_is_smaller = left.len() < right.len();
        let (smaller, larger_open) =
            if left_is_smaller { (left, right_open) } else { (right, left_open) };
        let smaller = self.histogram(smaller);
        let larger = parent.filter(|_| larger_open).map(|mut bins| {
            bins.iter_mut().zip(&smaller).for_each(|(bin, &less)| *bin -= less);
            bins
        });
        if left_is_smaller { (Some(smaller), larger) } else { (larger, Some(smaller)) }
    }

    /// The sums over the given rows, for each bin of each column.
    fn histogram(&mut self, rows: &[u32]) -> Vec<Bin> {
        let mut bins = self.grower.spare.pop().unwrap_or_default();
        bins.clear();
        bins.resize(self.bins.count(), Bin::default());
        for &row in rows {
            let own = Bin { sums: self.newton.derivatives[row as usize], rows: 1 };
            for &bin in self.bins.of(row as usize) {
                bins[bin as usize] += own;
            }
        }
        bins
    }

    /// The best split that leaves enough rows on both sides, if it lowers the deviance.
    fn best(&self, histogram: &[Bin], rows: usize, sums: Sums) -> Option<Split> {
        let mut best: Option<Split> = None;
        for column in 0..self.bins.columns() {
            let bins = &histogram[self.bins.range(column)];
            let mut left = Bin::default();
            // The previous non-empty bin.
            let mut last = None;
            for (next, bin) in bins.iter().enumerate().filter(|(_, bin)| bin.rows > 0) {
                let smaller = (left.rows as usize).min(rows - left.rows as usize);
                if let Some(last) = last.filter(|_| smaller >= self.grower.limits.leaf) {
                    let [g, h] = left.sums;
                    let right = [sums[0] - g, sums[1] - h];
                    let score = self.newton.gain(left.sums) + self.newton.gain(right);
                    if best.is_none_or(|best| score > best.score) {
                        best = Some(Split { score, column, last, next, left });
                    }
                }
                left += *bin;
                last = Some(next);
            }
        }
        best.filter(|best| best.score > self.newton.gain(sums))
    }

    /// Moves the rows that go left to the front. Returns the number of these rows.
    fn part(&self, rows: &mut [u32], split: Split) -> usize {
        let last = self.bins.range(split.column).start + split.last;
        let mut end = 0;
        for i in 0..rows.len() {
            let goes_left = self.bins.of(rows[i] as usize)[split.column] as usize <= last;
            rows.swap(i, end);
            end += usize::from(goes_left);
        }
        end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::samples::Samples;
    use crate::learn::tree::grower::{self, Columns, Criterion};
    use crate::math::SeededRng;

    /// The reference implementation evaluates every split of the sorted rows.
    impl Criterion for Newton {
        type Total = Sums;
        /// The sums on the left, and in total.
        type Scan = (Sums, Sums);
        type Score = f64;

        fn total(&self, rows: impl Iterator<Item = usize>) -> Sums {
            Newton::total(self, rows)
        }
        fn is_done(&self, _: &Sums) -> bool {
            false
        }
        fn begin(&self, total: &Sums) -> (Sums, Sums) {
            ([0; 2], *total)
        }
        fn pass(&self, (left, _): &mut (Sums, Sums), row: usize) {
            let [gradient, hessian] = self.derivatives[row];
            left[0] += gradient;
            left[1] += hessian;
        }
        fn score(&self, (left, all): &(Sums, Sums)) -> f64 {
            self.gain(*left) + self.gain([all[0] - left[0], all[1] - left[1]])
        }
        fn is_better(&self, score: &f64, than: &f64) -> bool {
            score > than
        }
        fn is_worth_it(&self, score: &f64, total: &Sums) -> bool {
            *score > self.gain(*total)
        }
    }

    #[test]
    fn trees_are_those_of_sorted_rows() {
        let mut rng = SeededRng::new(11);
        for (rows, width, bins, depth, leaf) in [
            (300, 3, 8, 3, 10),
            (200, 2, 64, 6, 1),
            (157, 5, 5, 4, 7),
            (40, 1, 3, 2, 15),
            (9, 2, 4, 3, 5),
        ] {
            let values: Vec<f64> =
                (0..rows * width).map(|_| (rng.uniform(-4.0, 4.0) * 10.0).round()).collect();
            let labels = vec![0; rows];
            let samples = Samples::new(width, &values, &labels, 2).unwrap();
            let cut = Bins::new(&samples, bins).unwrap();
            let mut gradient = || {
                // Coarse gradients produce ties between splits.
                let p = (rng.unit() * 8.0).round() / 8.0;
                [
                    super::super::newton::in_quanta(p - 0.5),
                    super::super::newton::in_quanta(p * (1.0 - p)),
                ]
            };
            let newton =
                Newton { derivatives: (0..rows).map(|_| gradient()).collect(), penalty: 1.0 };

            let numbers: Vec<f64> = (0..rows)
                .flat_map(|row| {
                    let bins = cut.of(row).iter().enumerate();
                    bins.map(|(j, &bin)| (bin as usize - cut.range(j).start) as f64)
                        .collect::<Vec<_>>()
                })
                .collect();
            let binned = Samples::new(width, &numbers, &labels, 2).unwrap();
            let columns = Columns::new(&binned).unwrap();
            let limits = grower::Limits::new(Some(depth), &[leaf]).unwrap();
            let mut expected_leaves = vec![usize::MAX; rows];
            let mut expected = grower::grow(&columns, &newton, &limits, &mut |_, place, rows| {
                rows.for_each(|row| expected_leaves[row] = place);
            });
            let expected = expected.remove(0);

            let mut leaves = vec![usize::MAX; rows];
            let mut grower = Grower::new(Limits { depth, leaf });
            // Grow the tree twice, to test the reuse of buffers.
            grower.grow(&cut, &newton, &mut leaves);
            let grown = grower.grow(&cut, &newton, &mut leaves);
            assert_eq!(leaves, expected_leaves);
            assert_eq!(grown.sums, expected.totals);
            assert_eq!(grown.nodes.len(), expected.nodes.len());
            for (mine, plain) in grown.nodes.iter().zip(&expected.nodes) {
                assert_eq!(
                    (mine.feature, mine.left, mine.right),
                    (plain.feature, plain.left, plain.right)
                );
                if !plain.is_leaf() {
                    let (feature, number) = (plain.feature as usize, plain.threshold as usize);
                    assert_eq!(mine.threshold, cut.threshold(feature, number, number));
                }
            }
        }
    }
}
