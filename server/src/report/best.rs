//! The best numbers of a table's row.

/// Which of them are the best: all that are equal to it, none where there is none.
pub(super) fn is_best(numbers: &[Option<f64>], less_is_better: bool) -> Vec<bool> {
    let sign = if less_is_better { -1.0 } else { 1.0 };
    let of = |number: &Option<f64>| number.map(|number| sign * number).filter(|n| n.is_finite());
    let best = numbers.iter().filter_map(of).fold(f64::NEG_INFINITY, f64::max);
    // Means of equal shares may differ in their last digits.
    numbers.iter().map(|number| of(number).is_some_and(|number| best - number < 1e-9)).collect()
}

#[cfg(test)]
mod tests {
    use super::is_best;

    #[test]
    fn the_best_and_all_its_equals() {
        assert_eq!(
            is_best(&[Some(1.0), Some(3.0), None, Some(3.0)], false),
            [false, true, false, true]
        );
        assert_eq!(is_best(&[Some(1.0), Some(3.0), None], true), [true, false, false]);
        assert_eq!(is_best(&[None, None], true), [false, false]);
    }
}
