//! Decision trees: CART with Gini impurity.
//!
//! Each node gets the split that reduces the impurity most. Ties (compared exactly, in integers) go
//! to the lowest feature index, then to the lowest threshold, so a tree depends only on the set of
//! its rows and not on their order. A node becomes a leaf if it is pure, if no split leaves enough
//! rows on both sides, or if it is at the maximum depth. A split is accepted even if it does not
//! reduce the impurity. For example, two features can be informative only together, and then the
//! first split on one of them does not reduce the impurity.
//!
//! Numbers are handled as in scikit-learn: features are rounded to single precision, values that
//! differ by at most 10⁻⁷ are never separated, and thresholds are midpoints. (But scikit-learn
//! breaks ties at random.)

pub(super) mod grower;

use super::samples::Samples;
use crate::invalid::Invalid;
use crate::predict::tree::Tree;
use grower::{Columns, Criterion, Limits, grow as grow_with};

/// The limits of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TreeSettings {
    /// Maximum depth. `None` means as deep as the rows allow, up to
    /// [`DEEPEST`](crate::predict::tree::DEEPEST).
    pub max_depth: Option<usize>,
    /// Minimum number of rows in a leaf.
    pub min_leaf: usize,
}

impl Default for TreeSettings {
    /// A tree as deep as the rows allow, whose leaves may contain a single row.
    fn default() -> Self {
        Self { max_depth: None, min_leaf: 1 }
    }
}

impl TreeSettings {
    /// Sets [`Self::max_depth`], the maximum depth. `None` means as deep as the rows allow.
    #[must_use]
    pub fn with_max_depth(self, max_depth: impl Into<Option<usize>>) -> Self {
        Self { max_depth: max_depth.into(), ..self }
    }

    /// Sets [`Self::min_leaf`], the minimum number of rows in a leaf.
    #[must_use]
    pub fn with_min_leaf(self, min_leaf: usize) -> Self {
        Self { min_leaf, ..self }
    }
}

/// Grows a tree.
///
/// # Errors
/// [`Invalid`] if `min_leaf` is 0, there are more than 2²¹ rows, or a number is beyond single
/// precision.
pub fn grow(samples: &Samples<'_>, settings: TreeSettings) -> Result<Tree, Invalid> {
    let mut trees = grow_each(samples, settings.max_depth, &[settings.min_leaf])?;
    trees.pop().ok_or_else(|| Invalid::new("min_leaf", "at least one", "none"))
}

/// Grows one tree for each minimum leaf size in `min_leaves` (ascending). The trees share work as
/// long as their splits agree. Each tree is identical to the result of [`grow`] with its minimum
/// leaf size. To get trees of lower depth, use [`Tree::truncated`].
///
/// # Errors
/// The errors of [`grow`], and [`Invalid`] if `min_leaves` are not ascending.
pub fn grow_each(
    samples: &Samples<'_>,
    max_depth: Option<usize>,
    min_leaves: &[usize],
) -> Result<Vec<Tree>, Invalid> {
    let columns = Columns::new(samples)?;
    let limits = Limits::new(max_depth, min_leaves)?;
    let gini = Gini { labels: samples.labels(), classes: samples.classes() };
    let trees = grow_with(&columns, &gini, &limits, &mut |_, _, _| ());
    let tree = |grown: grower::Grown<Vec<u32>>| {
        Tree::new(grown.nodes, samples.classes(), grown.totals.concat())
    };
    Ok(trees.into_iter().map(tree).collect())
}

/// The Gini impurity, computed in integers.
struct Gini<'a> {
    labels: &'a [usize],
    classes: usize,
}

/// Class counts on both sides of a split.
struct Sides {
    left: Vec<u64>,
    right: Vec<u64>,
    /// The sum of the squared counts on each side, then the number of rows on each side.
    left_squares: u64,
    right_squares: u64,
    left_rows: u64,
    right_rows: u64,
}

/// Σ over both sides of (sum of squared counts / number of rows), as a fraction. The greatest value
/// belongs to the lowest impurity. With n ≤ 2²¹ rows, the numerator is at most n³/4.
#[derive(Clone, Copy)]
struct Concentration {
    numerator: u64,
    denominator: u64,
}

impl Criterion for Gini<'_> {
    type Total = Vec<u32>;
    type Scan = Sides;
    type Score = Concentration;

    fn total(&self, rows: impl Iterator<Item = usize>) -> Vec<u32> {
        let mut counts = vec![0; self.classes];
        for row in rows {
            counts[self.labels[row]] += 1;
        }
        counts
    }

    fn is_done(&self, counts: &Vec<u32>) -> bool {
        counts.iter().filter(|&&count| count > 0).count() <= 1
    }

    fn begin(&self, counts: &Vec<u32>) -> Sides {
        let right: Vec<u64> = counts.iter().map(|&count| u64::from(count)).collect();
        Sides {
            left: vec![0; self.classes],
            left_squares: 0,
            right_squares: right.iter().map(|count| count * count).sum(),
            left_rows: 0,
            right_rows: right.iter().sum(),
            right,
        }
    }

    #[inline(always)]
    fn pass(&self, sides: &mut Sides, row: usize) {
        let class = self.labels[row];
        // (n ± 1)² − n² = 1 ± 2n.
        sides.left_squares += 2 * sides.left[class] + 1;
        sides.left[class] += 1;
        sides.left_rows += 1;
        sides.right[class] -= 1;
        sides.right_squares -= 2 * sides.right[class] + 1;
        sides.right_rows -= 1;
    }

    #[inline(always)]
    fn score(&self, sides: &Sides) -> Concentration {
        Concentration {
            numerator: sides.left_squares * sides.right_rows
                + sides.right_squares * sides.left_rows,
            denominator: sides.left_rows * sides.right_rows,
        }
    }

    #[inline(always)]
    fn is_better(&self, score: &Concentration, than: &Concentration) -> bool {
        u128::from(score.numerator) * u128::from(than.denominator)
            > u128::from(than.numerator) * u128::from(score.denominator)
    }
}
