//! Grows trees by exhaustive search over splits, for any criterion.
//!
//! Each column is sorted once. A node stores its rows once per column, in the order of this column.
//! A split partitions each of these lists and keeps their order. Trees that differ only in their
//! minimum leaf size are grown together until their best splits differ.

use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::predict::tree::{DEEPEST, Node};

/// Maximum number of rows. With more rows, the sums of a criterion could overflow.
const MOST_ROWS: usize = 1 << 21;

/// Values that differ by at most this are never separated, as in scikit-learn. In single precision,
/// adding this to a large value has no effect, so large values are separable unless they are equal.
const CLOSE: f32 = 1e-7;

/// A split criterion. Its results must depend only on sets of rows, not on their order.
pub(crate) trait Criterion {
    /// The summary of a node's rows.
    type Total;
    /// The summaries of both sides during a scan over the splits of a column.
    type Scan;
    /// The score of a split.
    type Score: Copy;

    /// The summary of these rows.
    fn total(&self, rows: impl Iterator<Item = usize>) -> Self::Total;
    /// Whether a node with this summary becomes a leaf without a search for splits.
    fn is_done(&self, total: &Self::Total) -> bool;
    /// The initial scan, with all of the node's rows on the right.
    fn begin(&self, total: &Self::Total) -> Self::Scan;
    /// Moves a row from the right to the left.
    fn pass(&self, scan: &mut Self::Scan, row: usize);
    /// The score of the current split, which has at least one row on each side.
    fn score(&self, scan: &Self::Scan) -> Self::Score;
    /// Whether one score is strictly better than another.
    fn is_better(&self, score: &Self::Score, than: &Self::Score) -> bool;
    /// Whether a node with this summary should be split, given the score of its best split.
    fn is_worth_it(&self, _score: &Self::Score, _total: &Self::Total) -> bool {
        true
    }
}

/// A row's value in one column.
#[derive(Clone, Copy)]
struct Entry {
    value: f32,
    row: u32,
}

impl Entry {
    /// Whether this entry and `next`, whose value is not smaller, are too close to be separated.
    #[inline(always)]
    fn is_close_to(self, next: Self) -> bool {
        next.value <= self.value + CLOSE
    }

    #[inline(always)]
    fn halfway_to(self, next: Self) -> f64 {
        0.5 * (f64::from(self.value) + f64::from(next.value))
    }
}

/// The columns of samples, each sorted.
pub(crate) struct Columns {
    rows: usize,
    /// Entries, column by column.
    entries: Vec<Entry>,
}

impl Columns {
    /// # Errors
    /// [`Invalid`] if there are too many rows or a number is beyond single precision.
    pub(crate) fn new(samples: &Samples<'_>) -> Result<Self, Invalid> {
        let rows = samples.labels().len();
        if rows > MOST_ROWS {
            return Err(Invalid::new("rows", format!("at most {MOST_ROWS} rows"), rows));
        }
        let mut entries = Vec::with_capacity(rows * samples.width());
        // Sort keys: the bits of the value as an integer with the same order, then the row.
        let mut keys: Vec<u64> = Vec::with_capacity(rows);
        for j in 0..samples.width() {
            keys.clear();
            for (i, row) in samples.rows().enumerate() {
                // Adding 0 turns −0 into 0.
                let value = row[j] as f32 + 0.0;
                if value.is_infinite() {
                    let expected = "a number within single precision";
                    return Err(Invalid::new(format!("rows[{i}][{j}]"), expected, row[j]));
                }
                let bits = value.to_bits();
                let ordered = if value < 0.0 { !bits } else { bits | 1 << 31 };
                keys.push(u64::from(ordered) << 32 | i as u64);
            }
            keys.sort_unstable();
            entries.extend(keys.iter().map(|&key| {
                let (ordered, row) = ((key >> 32) as u32, key as u32);
                let bits = if ordered >> 31 == 0 { !ordered } else { ordered & !(1 << 31) };
                Entry { value: f32::from_bits(bits), row }
            }));
        }
        Ok(Self { rows, entries })
    }

    fn column(&self, column: usize) -> &[Entry] {
        &self.entries[column * self.rows..][..self.rows]
    }

    /// The rows in the order of a column.
    pub(crate) fn rows(&self, column: usize) -> impl Iterator<Item = usize> {
        self.column(column).iter().map(|entry| entry.row as usize)
    }

    /// The possible splits of a column: the number of rows on the left, and the threshold.
    pub(crate) fn partings(&self, column: usize) -> impl Iterator<Item = (usize, f64)> {
        let pairs = (1..).zip(self.column(column).windows(2));
        pairs
            .filter(|(_, pair)| !pair[0].is_close_to(pair[1]))
            .map(|(left, pair)| (left, pair[0].halfway_to(pair[1])))
    }
}

/// Limits on the growth of trees.
pub(crate) struct Limits {
    depth: usize,
    /// The minimum leaf size of each tree, ascending.
    leaves: Vec<usize>,
}

impl Limits {
    /// # Errors
    /// [`Invalid`] if `min_leaves` are not ascending from at least 1.
    pub(crate) fn new(max_depth: Option<usize>, min_leaves: &[usize]) -> Result<Self, Invalid> {
        if min_leaves.first() == Some(&0) || !min_leaves.is_sorted_by(|a, b| a < b) {
            let expected = "numbers from 1, in rising order";
            return Err(Invalid::new("min_leaf", expected, format!("{min_leaves:?}")));
        }
        Ok(Self { depth: max_depth.unwrap_or(DEEPEST).min(DEEPEST), leaves: min_leaves.to_vec() })
    }
}

/// A tree: its nodes in preorder, and the total of each node.
pub(crate) struct Grown<T> {
    pub(crate) nodes: Vec<Node>,
    pub(crate) totals: Vec<T>,
}

/// The best split of a node in one of the trees.
#[derive(Clone, Copy)]
struct Best<S> {
    score: S,
    column: usize,
    /// Number of rows on the left.
    left: usize,
    threshold: f64,
}

/// A node that is not split yet.
struct OpenNode {
    /// The node's rows in the order of each column, column by column. If the node is known to be a
    /// leaf, only one column is stored.
    entries: Vec<Entry>,
    rows: usize,
    depth: usize,
    /// The trees that contain the node.
    trees: Vec<usize>,
    /// The index of the node's parent in each of these trees. Empty for the root.
    parents: Vec<usize>,
    is_right: bool,
}

/// Grows one tree per minimum leaf size. Calls `at_leaf(tree, node, rows)` with the rows of each
/// leaf.
pub(crate) fn grow<C: Criterion>(
    columns: &Columns,
    criterion: &C,
    limits: &Limits,
    at_leaf: &mut impl FnMut(usize, usize, &mut dyn Iterator<Item = usize>),
) -> Vec<Grown<C::Total>>
where
    C::Total: Clone,
{
    let none = || Grown { nodes: Vec::new(), totals: Vec::new() };
    let mut grown: Vec<Grown<C::Total>> = limits.leaves.iter().map(|_| none()).collect();
    if grown.is_empty() {
        return grown;
    }
    let mut goes_left = vec![false; columns.rows];
    let mut waiting = vec![OpenNode {
        entries: columns.entries.clone(),
        rows: columns.rows,
        depth: 0,
        trees: (0..limits.leaves.len()).collect(),
        parents: Vec::new(),
        is_right: false,
    }];
    while let Some(open) = waiting.pop() {
        let first = &open.entries[..open.rows];
        let total = criterion.total(first.iter().map(|entry| entry.row as usize));
        let mut places = Vec::with_capacity(open.trees.len());
        for (i, &tree) in open.trees.iter().enumerate() {
            let Grown { nodes, totals } = &mut grown[tree];
            places.push(nodes.len());
            if let Some(&parent) = open.parents.get(i) {
                let child = nodes.len() as u32;
                let parent = &mut nodes[parent];
                *(if open.is_right { &mut parent.right } else { &mut parent.left }) = child;
            }
            nodes.push(Node::LEAF);
            totals.push(total.clone());
        }
        let leaves: Vec<usize> = open.trees.iter().map(|&tree| limits.leaves[tree]).collect();
        let best = if open.depth == limits.depth || criterion.is_done(&total) {
            vec![None; leaves.len()]
        } else {
            best_splits(criterion, &open, &total, &leaves)
        };
        let mut i = 0;
        while i < best.len() {
            let Some(split) = best[i] else {
                let rows = &mut first.iter().map(|entry| entry.row as usize);
                at_leaf(open.trees[i], places[i], rows);
                i += 1;
                continue;
            };
            // Trees with the same split are adjacent, because a larger minimum leaf size allows
            // fewer splits.
            let same = |other: &Option<Best<C::Score>>| {
                other.is_some_and(|o| (o.column, o.left) == (split.column, split.left))
            };
            let end = i + best[i..].iter().take_while(|other| same(other)).count();
            for (tree, &place) in open.trees[i..end].iter().zip(&places[i..end]) {
                let node = &mut grown[*tree].nodes[place];
                (node.feature, node.threshold) = (split.column as u32, split.threshold);
            }
            let column = &open.entries[split.column * open.rows..][..open.rows];
            for (i, entry) in column.iter().enumerate() {
                goes_left[entry.row as usize] = i < split.left;
            }
            // The stack is last in, first out, so the left child is popped next, which gives
            // preorder.
            for is_right in [true, false] {
                let rows = if is_right { &column[split.left..] } else { &column[..split.left] };
                let is_leaf = open.depth + 1 == limits.depth || rows.len() < 2 * leaves[i];
                waiting.push(OpenNode {
                    entries: match is_leaf {
                        true => rows.to_vec(),
                        false => part(&open.entries, &goes_left, !is_right, open.rows, rows.len()),
                    },
                    rows: rows.len(),
                    depth: open.depth + 1,
                    trees: open.trees[i..end].to_vec(),
                    parents: places[i..end].to_vec(),
                    is_right,
                });
            }
            i = end;
        }
    }
    grown
}

/// Finds, for each minimum leaf size (ascending), the best split that leaves at least this many
/// rows on both sides.
fn best_splits<C: Criterion>(
    criterion: &C,
    open: &OpenNode,
    total: &C::Total,
    leaves: &[usize],
) -> Vec<Option<Best<C::Score>>> {
    let mut best: Vec<Option<Best<C::Score>>> = vec![None; leaves.len()];
    let least = leaves[0];
    if open.rows < 2 * least {
        return best;
    }
    for (column, entries) in open.entries.chunks_exact(open.rows).enumerate() {
        if entries[0].is_close_to(entries[open.rows - 1]) {
            continue;
        }
        let mut scan = criterion.begin(total);
        for (left, pair) in (1..).zip(entries.windows(2)) {
            criterion.pass(&mut scan, pair[0].row as usize);
            let smaller = left.min(open.rows - left);
            if smaller < least || pair[0].is_close_to(pair[1]) {
                continue;
            }
            let score = criterion.score(&scan);
            // A smaller minimum leaf size allows all splits that a larger one allows, so its best
            // split is at least as good. If a split does not improve the best split for a larger
            // minimum, it cannot improve the best split for a smaller one.
            for (best, _) in best.iter_mut().zip(leaves).rev().filter(|(_, l)| **l <= smaller) {
                if best.is_some_and(|best| !criterion.is_better(&score, &best.score)) {
                    break;
                }
                let threshold = pair[0].halfway_to(pair[1]);
                *best = Some(Best { score, column, left, threshold });
            }
        }
    }
    for best in &mut best {
        *best = best.filter(|best| criterion.is_worth_it(&best.score, total));
    }
    best
}

/// Returns the entries of one side of the split. `entries` consists of one list of `rows` entries
/// per column, and `kept` entries of each list are on this side.
fn part(entries: &[Entry], goes_left: &[bool], left: bool, rows: usize, kept: usize) -> Vec<Entry> {
    // The vector has one spare slot, because entries of the other side are also written and then
    // overwritten. This is cheaper than a branch.
    let mut side = vec![Entry { value: 0.0, row: 0 }; entries.len() / rows * kept + 1];
    let mut end = 0;
    for entry in entries {
        side[end] = *entry;
        end += usize::from(goes_left[entry.row as usize] == left);
    }
    side.truncate(end);
    side
}
