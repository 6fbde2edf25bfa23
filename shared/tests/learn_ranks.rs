//! Rank tests of the comparison, with their ties, against scipy.

mod learning;

#[test]
fn p_values_are_those_of_scipys_permutations() {
    let apart = learning::ranks::ranks();
    assert_eq!(apart.compared, 48);
    assert!(apart.mann_whitney < 1e-12, "{:e}", apart.mann_whitney);
    assert!(apart.wilcoxon < 1e-12, "{:e}", apart.wilcoxon);
}
