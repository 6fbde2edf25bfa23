//! The comparison's rank tests with ties, compared with SciPy, and the reasons why cells of the
//! comparison differ from scikit-learn's cells.

use crate::learning::why::{Choice, Right, why};
use serde_json::json;

#[test]
fn p_values_are_those_of_scipys_permutations() {
    let apart = crate::learning::ranks::ranks();
    assert_eq!(apart.compared, 48);
    assert!(apart.mann_whitney < 1e-12, "{:e}", apart.mann_whitney);
    assert!(apart.wilcoxon < 1e-12, "{:e}", apart.wilcoxon);
}

/// A choice of C, with the numbers of correctly predicted rows: ours, and scikit-learn's minimum
/// and maximum.
fn choice(c: f64, ours: [usize; 2], least: [usize; 2], most: [usize; 2]) -> Choice {
    let right = |[cv, test]: [usize; 2]| Right { cv, test };
    Choice {
        hyperparameters: json!({ "C": c }),
        ours: right(ours),
        scikit_learn: right([9, 9]),
        to_the_end: [right(least), right(most)],
    }
}

#[test]
fn reasons_follow_from_the_rows() {
    let of = |c, rows| choice(c, rows, rows, rows);
    for (reference, ours, reason) in [
        (of(1.0, [8, 4]), of(1.0, [8, 4]), "stops early"),
        (of(10.0, [8, 5]), of(1.0, [8, 4]), "tie"),
        (of(0.1, [8, 5]), of(1.0, [8, 4]), "tie, rounding"),
        (of(10.0, [7, 5]), of(1.0, [8, 4]), "ours is better"),
        (of(10.0, [9, 5]), of(1.0, [8, 4]), "open"),
        (of(1.0, [8, 4]), choice(1.0, [8, 4], [8, 5], [8, 5]), "open"),
    ] {
        assert_eq!(why("lr", &reference, &ours), reason);
    }
    let tree = || choice(1.0, [8, 4], [7, 4], [9, 5]);
    assert_eq!(why("dt", &tree(), &tree()), "equal splits");
    assert_eq!(why("dt", &tree(), &choice(1.0, [8, 6], [7, 4], [9, 5])), "open");
}
