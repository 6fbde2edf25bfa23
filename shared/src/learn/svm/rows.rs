//! Training rows of SVMs: classes, checks, order and standardisation.

use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::predict::scale::Scale;

/// The classes that a classifier learns to predict.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The class of each row, 0 … `classes` − 1.
    pub labels: &'a [usize],
    /// Number of classes, at least 2.
    pub classes: usize,
}

/// 1 for rows of class `first`, −1 for rows of class `second`, 0 for other rows.
pub(super) fn sides(labels: &[usize], first: usize, second: usize) -> Vec<i8> {
    let side = |&label: &usize| i8::from(label == first) - i8::from(label == second);
    labels.iter().map(side).collect()
}

/// Checks lengths, labels and numbers.
pub(super) fn check(width: usize, rows: &[f64], targets: &[Target<'_>]) -> Result<(), Invalid> {
    for target in targets {
        Samples::new(width, rows, target.labels, target.classes)?;
        if target.classes < 2 {
            return Err(Invalid::new("classes", "at least 2", target.classes));
        }
    }
    Ok(())
}

/// The order in which computations process the rows: by labels, then by features. Rows with equal
/// labels and features are interchangeable.
pub(super) fn order(width: usize, rows: &[f64], targets: &[Target<'_>]) -> Vec<usize> {
    let row = |i: usize| &rows[i * width..(i + 1) * width];
    let mut order: Vec<usize> = (0..rows.len() / width.max(1)).collect();
    order.sort_by(|&a, &b| {
        let labels = |i: usize| targets.iter().map(move |target| target.labels[i]);
        let features = || {
            let pairs = row(a).iter().zip(row(b)).map(|(a, b)| a.total_cmp(b));
            pairs.fold(core::cmp::Ordering::Equal, core::cmp::Ordering::then)
        };
        labels(a).cmp(labels(b)).then_with(features)
    });
    order
}

/// The scale fitted to the rows `fitted`, and the rows `wanted`, standardised with this scale.
pub(super) fn standardised(
    width: usize,
    rows: &[f64],
    fitted: &[usize],
    wanted: &[usize],
) -> (Scale, Vec<f64>) {
    let row = |&i: &usize| &rows[i * width..(i + 1) * width];
    let raw: Vec<f64> = fitted.iter().flat_map(row).copied().collect();
    let scale = Scale::fit(width, &raw);
    let rows = wanted.iter().flat_map(|i| scale.row(row(i))).collect();
    (scale, rows)
}
