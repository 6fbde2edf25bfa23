//! Pairs of classes and their votes.

/// The number of pairs of `classes` classes.
#[must_use]
pub fn pair_count(classes: usize) -> usize {
    classes * classes.saturating_sub(1) / 2
}

/// The pairs of classes in order.
pub fn pairs(classes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..classes).flat_map(move |a| (a + 1..classes).map(move |b| (a, b)))
}

/// The class with the most votes, from one decision value per pair. On a tie, the first class.
#[must_use]
pub fn vote(classes: usize, decisions: impl IntoIterator<Item = f64>) -> usize {
    let mut votes = vec![0usize; classes];
    for ((a, b), decision) in pairs(classes).zip(decisions) {
        votes[if decision > 0.0 { a } else { b }] += 1;
    }
    (0..classes).rev().max_by_key(|&class| votes[class]).unwrap_or(0)
}
