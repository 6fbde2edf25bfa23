//! Decision trees, compared with scikit-learn and with brute force, and checked for consistency.

use crate::learning::{PEOPLE, apart, person};
use proptest::prelude::*;
use sidestep::learn::samples::Samples;
use sidestep::learn::tree::{TreeSettings, grow, grow_each};
use sidestep::math::SeededRng;
use sidestep::predict::tree::{Tree, TreeFile};

/// The reference flags rows by comparing its trees with five other trees with random tie-breaks.
/// More trees find more ties. On rows on which a thousand trees agree, our tree must agree too.
fn agrees_with_scikit_learn(experiment: usize) {
    let apart = apart::trees(experiment);
    assert_eq!(apart.rows, 500 * PEOPLE);
    assert_eq!(apart.different, 0);
    assert!(apart.share < 1e-8, "{:e}", apart.share);
    assert!(apart.ties <= 200, "{} rows are not compared", apart.ties);
}

#[test]
fn which_way_agrees_with_scikit_learn() {
    agrees_with_scikit_learn(1);
}

#[test]
fn whether_agrees_with_scikit_learn() {
    agrees_with_scikit_learn(2);
}

/// CART by its definition: tries every split, and compares impurities as fractions.
fn plain(
    rows: &[(Vec<f32>, usize)],
    classes: usize,
    depth: usize,
    min_leaf: usize,
    out: &mut Vec<(usize, f64, Vec<u32>)>,
) {
    let count = |part: &[&(Vec<f32>, usize)]| -> Vec<u32> {
        (0..classes).map(|c| part.iter().filter(|row| row.1 == c).count() as u32).collect()
    };
    let all: Vec<&(Vec<f32>, usize)> = rows.iter().collect();
    let counts = count(&all);
    let at = out.len();
    out.push((usize::MAX, 0.0, counts.clone()));
    if depth == 0 || counts.iter().filter(|&&n| n > 0).count() == 1 {
        return;
    }
    // The weighted impurity n_l · gini_l + n_r · gini_r, multiplied by n_l · n_r.
    let mut best: Option<(i128, i128, usize, f64)> = None;
    for feature in 0..rows[0].0.len() {
        let mut values: Vec<f32> = rows.iter().map(|row| row.0[feature]).collect();
        values.sort_by(f32::total_cmp);
        for pair in values.windows(2).filter(|pair| pair[1] > pair[0] + 1e-7) {
            let threshold = (f64::from(pair[0]) + f64::from(pair[1])) / 2.0;
            let (left, right): (Vec<_>, Vec<_>) =
                all.iter().partition(|row| f64::from(row.0[feature]) <= threshold);
            if left.len().min(right.len()) < min_leaf {
                continue;
            }
            let squares = |part: &[&(Vec<f32>, usize)]| -> i128 {
                count(part).iter().map(|&n| i128::from(n) * i128::from(n)).sum()
            };
            let (nl, nr) = (left.len() as i128, right.len() as i128);
            let impurity = (nl * nl - squares(&left)) * nr + (nr * nr - squares(&right)) * nl;
            if best.is_none_or(|(i, d, ..)| impurity * d < i * nl * nr) {
                best = Some((impurity, nl * nr, feature, threshold));
            }
        }
    }
    if let Some((_, _, feature, threshold)) = best {
        (out[at].0, out[at].1) = (feature, threshold);
        let (left, right): (Vec<_>, Vec<_>) =
            rows.iter().cloned().partition(|row| f64::from(row.0[feature]) <= threshold);
        plain(&left, classes, depth - 1, min_leaf, out);
        plain(&right, classes, depth - 1, min_leaf, out);
    }
}

fn in_preorder(tree: &Tree) -> Vec<(usize, f64, Vec<u32>)> {
    let TreeFile { questions: q, counts } = tree.into();
    let feature = |i: usize| if q.left[i] == 0 { usize::MAX } else { q.feature[i] as usize };
    (0..tree.nodes()).map(|i| (feature(i), q.threshold[i], counts[i].clone())).collect()
}

/// Rows with few distinct values, so that there are many ties, or rows with many distinct values.
fn rows() -> impl Strategy<Value = (usize, Vec<f64>, Vec<usize>)> {
    (1..4usize, 1..25usize, prop_oneof![Just(3), Just(1000)]).prop_flat_map(|(width, n, levels)| {
        let values = prop::collection::vec((0..levels).prop_map(f64::from), width * n);
        (Just(width), values, prop::collection::vec(0..3usize, n))
    })
}

proptest! {
    #[test]
    fn every_split_is_the_best((width, values, labels) in rows(), depth in 0..5usize, leaf in 1..4usize) {
        let samples = Samples::new(width, &values, &labels, 3).unwrap();
        let settings = TreeSettings::default().with_max_depth(depth).with_min_leaf(leaf);
        let tree = grow(&samples, settings).unwrap();
        let row = |(row, &label): (&[f64], &usize)| (row.iter().map(|&x| x as f32).collect(), label);
        let rows: Vec<(Vec<f32>, usize)> = values.chunks_exact(width).zip(&labels).map(row).collect();
        let mut expected = Vec::new();
        plain(&rows, 3, depth, leaf, &mut expected);
        prop_assert_eq!(in_preorder(&tree), expected);
    }

    #[test]
    fn trees_grown_together_are_those_grown_alone((width, values, labels) in rows()) {
        let samples = Samples::new(width, &values, &labels, 3).unwrap();
        let leaves = [1, 2, 3, 5, 8];
        let together = grow_each(&samples, None, &leaves).unwrap();
        for (tree, min_leaf) in together.iter().zip(leaves) {
            let alone = grow(&samples, TreeSettings::default().with_min_leaf(min_leaf)).unwrap();
            prop_assert_eq!(tree, &alone);
            for depth in 0..6 {
                let settings = TreeSettings::default().with_max_depth(depth).with_min_leaf(min_leaf);
                prop_assert_eq!(tree.truncated(depth), grow(&samples, settings).unwrap());
            }
        }
    }

    #[test]
    fn the_order_of_rows_changes_nothing((width, values, labels) in rows(), seed in 0..1000u64) {
        let order = SeededRng::new(seed).permutation(labels.len());
        let moved: Vec<f64> =
            order.iter().flat_map(|&i| &values[i * width..][..width]).copied().collect();
        let relabelled: Vec<usize> = order.iter().map(|&i| labels[i]).collect();
        let tree = |values: &[f64], labels: &[usize]| {
            let samples = Samples::new(width, values, labels, 3).unwrap();
            grow(&samples, TreeSettings::default()).unwrap()
        };
        prop_assert_eq!(tree(&values, &labels), tree(&moved, &relabelled));
    }
}

#[test]
fn real_trees_are_grown_together_and_cut_alike() {
    let (training, _) = person(2, 1);
    let samples = training.samples(1);
    let leaves = [1, 5, 10, 20];
    for (tree, min_leaf) in grow_each(&samples, None, &leaves).unwrap().iter().zip(leaves) {
        for depth in [2, 3, 4, 6, 8] {
            let alone = grow(
                &samples,
                TreeSettings::default().with_max_depth(depth).with_min_leaf(min_leaf),
            )
            .unwrap();
            assert_eq!(tree.truncated(depth), alone, "depth {depth}, leaf {min_leaf}");
        }
        assert!(tree.depth() > 8);
    }
}

#[test]
fn little_to_learn_from_gives_little_trees() {
    let tree = |width, values: &[f64], labels: &[usize]| {
        let samples = Samples::new(width, values, labels, 2).unwrap();
        grow(&samples, TreeSettings::default()).unwrap()
    };
    // With only one class, the tree is a root with the class count.
    let one = tree(1, &[1.0, 2.0, 3.0], &[1, 1, 1]);
    assert_eq!((one.nodes(), one.class(&[0.0])), (1, 1));
    let mut p = [0.0; 2];
    one.probabilities_into(&[0.0], &mut p);
    assert_eq!(p, [1.0 / 5.0, 4.0 / 5.0]);
    // The features are constant, or equal in single precision.
    assert_eq!(tree(2, &[1.0, 5.0, 1.0, 5.0], &[0, 1]).nodes(), 1);
    assert_eq!(tree(1, &[1.0, 1.0 + 1e-9], &[0, 1]).nodes(), 1);
    assert_eq!(tree(1, &[0.0, -0.0], &[0, 1]).nodes(), 1);
    // Two rows, each repeated four times.
    let two = tree(1, &[1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 2.0], &[0, 1, 0, 1, 0, 1, 0, 1]);
    assert_eq!(two.nodes(), 3);
    assert_eq!((two.class(&[1.5]), two.class(&[1.6])), (0, 1));
    // Two features that are informative only in combination.
    let xor = tree(2, &[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0], &[0, 1, 1, 0]);
    assert_eq!((xor.leaves(), xor.class(&[1.0, 0.0]), xor.class(&[1.0, 1.0])), (4, 1, 0));
}

#[test]
fn what_cannot_be_learnt_is_refused() {
    let complain = |value, leaves: &[usize]| {
        let values = [1.0, value];
        let samples = Samples::new(1, &values, &[0, 1], 2)?;
        grow_each(&samples, None, leaves)
    };
    assert_eq!(complain(f64::NAN, &[1]).unwrap_err().field, "rows[1][0]");
    assert_eq!(complain(1e39, &[1]).unwrap_err().field, "rows[1][0]");
    assert_eq!(complain(2.0, &[0]).unwrap_err().field, "min_leaf");
    assert_eq!(complain(2.0, &[5, 5]).unwrap_err().field, "min_leaf");
    assert!(complain(2.0, &[]).unwrap().is_empty());
}
