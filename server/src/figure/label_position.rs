//! Finds the position with the most space for a label.

use sidestep::reach::polygon::{bounding_box, signed_distance};

/// Spacing of the candidate points (pixels).
const SPACING: f64 = 3.0;

/// The point inside `outer` and outside `inner` that is farthest from both edges. Returns `None` if
/// its distance is less than `least`. Points are [right, down] in pixels, and either polygon can be
/// empty. The point is accurate to the spacing of the candidate points.
pub(super) fn label_position(
    outer: &[[f64; 2]],
    inner: &[[f64; 2]],
    least: f64,
) -> Option<[f64; 2]> {
    let [left, top, right, bottom] = bounding_box(outer)?;
    let tried = |low: f64, high: f64| {
        (0..=((high - low) / SPACING) as usize).map(move |i| low + SPACING * i as f64)
    };
    let points = tried(left, right).flat_map(|x| tried(top, bottom).map(move |y| [x, y]));
    let room = |at| (-signed_distance(outer, at)).min(signed_distance(inner, at));
    let (most, at) = points.map(|at| (room(at), at)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (most >= least).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]];

    fn check(inner: &[[f64; 2]], least: f64, expected: Option<[f64; 2]>) {
        let found = label_position(&SQUARE, inner, least);
        assert_eq!(found.is_some(), expected.is_some(), "{found:?}");
        for (found, expected) in found.into_iter().flatten().zip(expected.into_iter().flatten()) {
            assert!((found - expected).abs() <= SPACING, "{found} {expected}");
        }
    }

    #[test]
    fn the_middle_of_what_is_free() {
        check(&[], 5.0, Some([20.0, 20.0]));
        let left = [[0.0, 0.0], [20.0, 0.0], [20.0, 40.0], [0.0, 40.0]];
        assert!(
            label_position(&SQUARE, &left, 8.0).is_some_and(|[x, _]| (x - 30.0).abs() <= SPACING)
        );
    }

    #[test]
    fn nothing_where_there_is_no_room() {
        check(&[], 21.0, None);
        let most = [[1.0, 1.0], [39.0, 1.0], [39.0, 39.0], [1.0, 39.0]];
        check(&most, 2.0, None);
        check(&SQUARE, 0.5, None);
        assert_eq!(label_position(&[[0.0, 0.0], [9.0, 9.0]], &[], 1.0), None);
    }
}
