//! Decision trees. At each node, a row goes left if a feature is at most a threshold, otherwise
//! right. This repeats until the row reaches a leaf. [`learn::tree`](crate::learn::tree) grows the
//! trees.

use super::kind::{Kind, field};
use super::scale::Scale;
use super::{Model, Predictor};
use crate::features::FeatureSet;
use crate::invalid::{Invalid, finite, length};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Maximum depth of a tree, which bounds the cost of a prediction.
pub const DEEPEST: usize = 1000;

/// A question (split) or a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) threshold: f64,
    pub(crate) feature: u32,
    /// The child for rows whose feature is ≤ threshold. It is 0 at a leaf, because node 0 is never
    /// a child.
    pub(crate) left: u32,
    /// The child for the other rows.
    pub(crate) right: u32,
}

impl Node {
    pub(crate) const LEAF: Self = Self { threshold: 0.0, feature: 0, left: 0, right: 0 };

    pub(crate) fn is_leaf(&self) -> bool {
        self.left == 0
    }
}

/// The questions of a tree. Node 0 is the root, and children come after their parents.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Questions(pub(crate) Vec<Node>);

impl Questions {
    /// The leaf that `row` reaches.
    pub(crate) fn leaf(&self, row: &[f64]) -> usize {
        let mut at = 0;
        while !self.0[at].is_leaf() {
            let node = &self.0[at];
            let goes_left = row[node.feature as usize] <= node.threshold;
            at = if goes_left { node.left } else { node.right } as usize;
        }
        at
    }

    /// The depth of each node. The depth of the root is 0.
    fn depths(&self) -> Vec<usize> {
        let mut depths = vec![0; self.0.len()];
        for (i, node) in self.0.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            depths[node.left as usize] = depths[i] + 1;
            depths[node.right as usize] = depths[i] + 1;
        }
        depths
    }

    /// Converts questions about features that `scale` standardised to questions about raw features.
    pub(crate) fn unscaled(&self, scale: &Scale) -> Self {
        let unscale = |node: &Node| match node.is_leaf() {
            true => *node,
            false => {
                let j = node.feature as usize;
                let threshold = scale.mean()[j] + scale.scale()[j] * node.threshold;
                Node { threshold, ..*node }
            }
        };
        Self(self.0.iter().map(unscale).collect())
    }
}

/// The questions of a tree in a file. Each list has one entry per node. The root comes first, and
/// children come after their parents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct QuestionsFile {
    /// The index of the feature; 0 at leaves.
    pub feature: Vec<u32>,
    /// A row goes left if the feature is at most this; 0 at leaves.
    pub threshold: Vec<f64>,
    /// The left child; 0 at leaves.
    pub left: Vec<u32>,
    /// The right child; 0 at leaves.
    pub right: Vec<u32>,
}

impl From<&Questions> for QuestionsFile {
    fn from(questions: &Questions) -> Self {
        let nodes = &questions.0;
        Self {
            feature: nodes.iter().map(|node| node.feature).collect(),
            threshold: nodes.iter().map(|node| node.threshold).collect(),
            left: nodes.iter().map(|node| node.left).collect(),
            right: nodes.iter().map(|node| node.right).collect(),
        }
    }
}

impl QuestionsFile {
    /// Checks that the questions form a tree for `width` features, and returns them.
    ///
    /// # Errors
    /// [`Invalid`] if there is no node, the lists differ in length, a feature does not exist, a
    /// threshold is not finite, a child does not follow its parent or has several parents, a node
    /// has no parent, or the tree is deeper than [`DEEPEST`].
    pub(crate) fn check(&self, width: usize) -> Result<Questions, Invalid> {
        let count = self.feature.len();
        if count == 0 {
            return Err(Invalid::new("feature", "at least one node", "none"));
        }
        length("threshold", count, self.threshold.len())?;
        length("left", count, self.left.len())?;
        length("right", count, self.right.len())?;
        let mut depths = vec![None; count];
        depths[0] = Some(0);
        for i in 0..count {
            let Some(depth) = depths[i] else {
                return Err(Invalid::new(format!("left[{i}]"), "a node of the tree", "no parent"));
            };
            finite(&format!("threshold[{i}]"), self.threshold[i])?;
            if self.feature[i] as usize >= width {
                let expected = format!("a feature from 0 to {}", width.saturating_sub(1));
                return Err(Invalid::new(format!("feature[{i}]"), expected, self.feature[i]));
            }
            if (self.left[i], self.right[i]) == (0, 0) {
                continue;
            }
            if depth == DEEPEST {
                let expected = format!("a tree of depth {DEEPEST} at most");
                return Err(Invalid::new(format!("left[{i}]"), expected, "a deeper one"));
            }
            for (side, child) in [("left", self.left[i]), ("right", self.right[i])] {
                let at = child as usize;
                if at <= i || at >= count || depths[at].is_some() {
                    let expected = format!("a node after {i} that has no other parent");
                    return Err(Invalid::new(format!("{side}[{i}]"), expected, child));
                }
                depths[at] = Some(depth + 1);
            }
        }
        let node = |i| Node {
            threshold: self.threshold[i],
            feature: self.feature[i],
            left: self.left[i],
            right: self.right[i],
        };
        Ok(Questions((0..count).map(node).collect()))
    }
}

/// A tree with class counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    questions: Questions,
    classes: usize,
    /// The number of training rows of each class that reached each node: nodes × classes.
    counts: Vec<u32>,
}

/// The fields of a predictor.json with a decision tree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TreeFields {
    /// The nodes.
    pub tree: TreeFile,
}

/// The fields of a [`Tree`] in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TreeFile {
    /// The questions (splits) of the tree.
    #[serde(flatten)]
    pub questions: QuestionsFile,
    /// The number of training rows of each class that reached each node: nodes × classes.
    pub counts: Vec<Vec<u32>>,
}

impl From<&Tree> for TreeFile {
    fn from(tree: &Tree) -> Self {
        let counts = tree.counts.chunks_exact(tree.classes).map(<[u32]>::to_vec).collect();
        Self { questions: (&tree.questions).into(), counts }
    }
}

impl TreeFile {
    /// Checks the fields and builds the tree, for `width` features and `classes` classes.
    ///
    /// # Errors
    /// [`Invalid`] if the questions do not form a tree, if a count is missing, or if a parent's
    /// count is not the sum of its children's counts.
    pub fn check(&self, width: usize, classes: usize) -> Result<Tree, Invalid> {
        let questions = self.questions.check(width)?;
        length("counts", questions.0.len(), self.counts.len())?;
        for (i, counts) in self.counts.iter().enumerate() {
            length(&format!("counts[{i}]"), classes, counts.len())?;
        }
        for (i, node) in questions.0.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            let children = [node.left, node.right].map(|child| &self.counts[child as usize]);
            for (class, &count) in self.counts[i].iter().enumerate() {
                let sum: u64 = children.iter().map(|counts| u64::from(counts[class])).sum();
                if sum != u64::from(count) {
                    let expected = format!("the sum of its children's, {sum}");
                    return Err(Invalid::new(format!("counts[{i}][{class}]"), expected, count));
                }
            }
        }
        Ok(Tree { questions, classes, counts: self.counts.concat() })
    }
}

impl Tree {
    /// Builds a tree from nodes in preorder and their counts.
    #[cfg(feature = "learn")]
    pub(crate) fn new(nodes: Vec<Node>, classes: usize, counts: Vec<u32>) -> Self {
        Self { questions: Questions(nodes), classes, counts }
    }

    /// Number of nodes, including leaves.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.questions.0.len()
    }

    /// Number of leaves.
    #[must_use]
    pub fn leaves(&self) -> usize {
        self.nodes().div_ceil(2)
    }

    /// Depth: the maximum number of questions before a leaf.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.questions.depths().into_iter().max().unwrap_or(0)
    }

    /// The number of training rows of each class that reached a node.
    fn counts(&self, node: usize) -> &[u32] {
        &self.counts[node * self.classes..][..self.classes]
    }

    /// The most frequent class of the training rows at the leaf that `row` reaches. Ties go to the
    /// lowest class.
    #[must_use]
    pub fn class(&self, row: &[f64]) -> usize {
        let counts = self.counts_at(row);
        let most = counts.iter().max().unwrap_or(&0);
        counts.iter().position(|count| count == most).unwrap_or(0)
    }

    /// The number of training rows of each class at the leaf that `row` reaches.
    #[must_use]
    pub fn counts_at(&self, row: &[f64]) -> &[u32] {
        self.counts(self.questions.leaf(row))
    }

    /// Writes the probability of each class to `out`: (n_c + 1) / (n + K). Here, n is the number of
    /// training rows at the leaf, n_c is the number of these rows in the class, and K is the number
    /// of classes. (By Laplace's rule, a class that does not occur at the leaf still has a positive
    /// probability.)
    pub fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        let counts = self.counts_at(row);
        let total = counts.iter().map(|&count| f64::from(count)).sum::<f64>();
        let whole = total + self.classes as f64;
        for (p, &count) in out.iter_mut().zip(counts) {
            *p = (f64::from(count) + 1.0) / whole;
        }
    }

    /// The tree truncated at this depth.
    #[must_use]
    pub fn truncated(&self, depth: usize) -> Self {
        let depths = self.questions.depths();
        // The new index of each remaining node.
        let mut kept = 0;
        let mut places = vec![0; self.nodes()];
        for (place, _) in places.iter_mut().zip(&depths).filter(|(_, d)| **d <= depth) {
            *place = kept;
            kept += 1;
        }
        let mut nodes = Vec::with_capacity(kept as usize);
        let mut counts = Vec::with_capacity(kept as usize * self.classes);
        for (i, node) in self.questions.0.iter().enumerate().filter(|(i, _)| depths[*i] <= depth) {
            let place = |child: u32| places[child as usize];
            nodes.push(match node.is_leaf() || depths[i] == depth {
                true => Node::LEAF,
                false => Node { left: place(node.left), right: place(node.right), ..*node },
            });
            counts.extend(self.counts(i));
        }
        Self { questions: Questions(nodes), classes: self.classes, counts }
    }

    /// Converts a tree for features that `scale` standardised to a tree for raw features.
    #[must_use]
    pub fn unscaled(&self, scale: &Scale) -> Self {
        Self { questions: self.questions.unscaled(scale), ..self.clone() }
    }
}

impl Predictor {
    /// A decision tree on raw features (see [`Tree::unscaled`]).
    #[must_use]
    pub fn tree(features: FeatureSet, classes: Vec<i8>, model: Tree) -> Self {
        Self::new(features, classes, Model::Tree(model))
    }
}

impl Kind for Tree {
    type File = TreeFields;

    fn read(document: &Value) -> Result<TreeFields, Invalid> {
        Ok(TreeFields { tree: field(document, "tree")? })
    }

    fn of_file(file: TreeFields, width: usize, classes: usize) -> Result<Self, Invalid> {
        file.tree.check(width, classes).map_err(|invalid| invalid.within("tree"))
    }

    fn to_file(&self) -> TreeFields {
        TreeFields { tree: self.into() }
    }

    fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        self.probabilities_into(row, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x₀ ≤ 1 → leaf; else x₁ ≤ −2 → leaf, else leaf.
    fn file() -> TreeFile {
        let questions = QuestionsFile {
            feature: vec![0, 0, 1, 0, 0],
            threshold: vec![1.0, 0.0, -2.0, 0.0, 0.0],
            left: vec![1, 0, 3, 0, 0],
            right: vec![2, 0, 4, 0, 0],
        };
        let counts =
            vec![vec![4, 5, 3], vec![4, 0, 1], vec![0, 5, 2], vec![0, 3, 0], vec![0, 2, 2]];
        TreeFile { questions, counts }
    }

    #[test]
    fn a_row_walks_to_its_leaf() {
        let tree = file().check(2, 3).unwrap();
        assert_eq!((tree.nodes(), tree.leaves(), tree.depth()), (5, 3, 2));
        let mut p = [0.0; 3];
        tree.probabilities_into(&[1.0, 9.0], &mut p);
        assert_eq!(p, [5.0 / 8.0, 1.0 / 8.0, 2.0 / 8.0]);
        assert_eq!(tree.class(&[1.1, -2.0]), 1);
        // A tie goes to the lower class.
        assert_eq!(tree.class(&[1.1, -1.9]), 1);
    }

    #[test]
    fn truncation_keeps_what_is_above() {
        let tree = file().check(2, 3).unwrap();
        assert_eq!(tree.truncated(2), tree);
        assert_eq!((tree.truncated(1).nodes(), tree.truncated(1).depth()), (3, 1));
        assert_eq!(tree.truncated(0).nodes(), 1);
        for (row, classes) in [([0.0, 0.0], [1, 0, 0]), ([2.0, -3.0], [1, 1, 1])] {
            assert_eq!([0, 1, 2].map(|depth| tree.truncated(depth).class(&row)), classes);
        }
    }

    #[test]
    fn thresholds_go_back_to_the_features_units() {
        let scale = Scale::new(vec![10.0, 0.0], vec![2.0, 1.0]).unwrap();
        let tree = file().check(2, 3).unwrap().unscaled(&scale);
        let thresholds = TreeFile::from(&tree).questions.threshold;
        assert_eq!(thresholds, [12.0, 0.0, -2.0, 0.0, 0.0]);
    }

    #[test]
    fn complaints_name_the_field() {
        let complain = |change: fn(&mut TreeFile)| {
            let mut file = file();
            change(&mut file);
            file.check(2, 3).unwrap_err().field
        };
        assert_eq!(complain(|f| f.questions = QuestionsFile::default()), "feature");
        assert_eq!(complain(|f| f.questions.feature[2] = 2), "feature[2]");
        assert_eq!(complain(|f| f.questions.threshold[2] = f64::NAN), "threshold[2]");
        assert_eq!(complain(|f| f.questions.threshold.truncate(4)), "threshold");
        assert_eq!(complain(|f| f.questions.left.truncate(4)), "left");
        assert_eq!(complain(|f| f.questions.right.push(0)), "right");
        assert_eq!(complain(|f| f.questions.left[2] = 1), "left[2]", "two parents");
        assert_eq!(complain(|f| f.questions.left[2] = 2), "left[2]", "a cycle");
        assert_eq!(complain(|f| f.questions.right[2] = 5), "right[2]", "out of range");
        assert_eq!(complain(|f| f.questions.right[2] = 0), "right[2]", "one child");
        assert_eq!(complain(|f| f.questions.right[2] = 3), "right[2]", "the same child");
        assert_eq!(
            complain(|f| (f.questions.left[2], f.questions.right[2]) = (0, 0)),
            "left[3]",
            "no parent"
        );
        assert_eq!(complain(|f| f.counts.truncate(4)), "counts");
        assert_eq!(complain(|f| f.counts[3].truncate(2)), "counts[3]");
        assert_eq!(complain(|f| f.counts[3][1] = 4), "counts[2][1]");
    }

    #[test]
    fn a_chain_that_is_too_deep_is_refused() {
        let chain = |depth: u32| {
            let (mut left, mut right) = (vec![], vec![]);
            for i in 0..depth {
                left.extend([2 * i + 1, 0]);
                right.extend([2 * i + 2, 0]);
            }
            // Node 2i is a question, and node 2i + 1 is a leaf.
            left.push(0);
            right.push(0);
            let (feature, threshold) = (vec![0; left.len()], vec![0.0; left.len()]);
            QuestionsFile { feature, threshold, left, right }.check(1)
        };
        assert!(chain(DEEPEST as u32).is_ok());
        assert_eq!(chain(DEEPEST as u32 + 1).unwrap_err().field, "left[2000]");
    }
}
