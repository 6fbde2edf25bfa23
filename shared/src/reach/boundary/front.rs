//! The front of a planar set: the ends of the paths that get farthest in some direction. It runs from
//! the end of the lowest-rate path to the end of the highest-rate path.

use super::super::budget::Budget;
use super::super::paths::{Path, Paths};
use super::super::sampling::{Sample, pieces, sample, space, triangle_height};
use super::divergence::MOST_DIVERGENCES;
use super::singular::{self, Piece};
use nalgebra::Complex;

/// Appends the front after `steps` ≥ 1 steps (s of travel), from right to left. Overwrites `family`.
pub(super) fn front(
    paths: &Paths,
    steps: usize,
    (least_pieces, tolerance): (usize, f64),
    family: &mut Vec<Piece>,
    points: &mut Vec<Complex<f64>>,
    budget: &Budget<'_>,
) {
    let from = points.len();
    if paths.straight_always(steps) {
        let least = least_pieces.div_ceil(steps);
        turn_then_straight(&paths.low, steps, least, tolerance, points);
        points.push(paths.low.point(steps));
        points[from..].reverse();
        turn_then_straight(&paths.high, steps, least, tolerance, points);
    } else {
        points.push(paths.low.point(steps));
        extremals(paths, steps, (least_pieces, tolerance), family, points, budget);
    }
    points.push(paths.high.point(steps));
    space(points, from);
}

/// Appends the ends of the paths that turn like `path` for some time and then go straight, without the
/// end of `path` itself. Driving straight must always be admissible.
fn turn_then_straight(
    path: &Path,
    steps: usize,
    least: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let step_s = path.step_s();
    for step in 0..steps {
        let rate = path.turn(step).rate;
        if rate == 0.0 {
            continue;
        }
        let mut straight_s = (steps - step) as f64 * step_s;
        // The second derivative of the curve is rate²·straight_s across the curve and `rate` along it.
        // A chord deviates from the tangent by at most rate·step_s (rad).
        let bend = rate * rate * (straight_s + step_s);
        let count = pieces(step_s, bend, tolerance, least);
        let piece_s = step_s / count as f64;
        let turn = path.piece(step, count);
        let (mut point, mut facing) = (path.point(step), path.facing(step));
        for _ in 0..count {
            points.push(point + facing * straight_s);
            point += facing * turn.moved;
            facing *= turn.turned;
            straight_s -= piece_s;
        }
    }
}

/// Appends the ends of all extremals of [`singular::pieces`], for any bounds.
fn extremals(
    paths: &Paths,
    steps: usize,
    (least_pieces, tolerance): (usize, f64),
    family: &mut Vec<Piece>,
    points: &mut Vec<Complex<f64>>,
    budget: &Budget<'_>,
) {
    singular::pieces(paths, steps, family, budget);
    let each = least_pieces.div_ceil(family.len().max(1));
    // The family runs from left to right.
    let mut before: Option<(&Piece, Sample)> = None;
    for piece in family.iter().rev() {
        if budget.is_spent() {
            return;
        }
        let curve = |parameter: f64| {
            let start = piece.start(paths, parameter);
            budget.spend(start.work);
            start.sample()
        };
        let begin = curve(piece.to);
        if let Some((right, end)) = before
            && triangle_height(end, begin) > tolerance
        {
            let gap = right.neighbours(piece, paths);
            gap.bridge(paths, tolerance, MOST_DIVERGENCES, (points, budget));
        }
        points.push(begin.point);
        let bridge = |from: f64, to: f64, points: &mut Vec<Complex<f64>>| {
            let gap = piece.between(from, to);
            gap.bridge(paths, tolerance, MOST_DIVERGENCES, (points, budget));
        };
        sample(&curve, (piece.to, piece.from), each, tolerance, &bridge, (points, budget));
        before = Some((piece, curve(piece.from)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::InputBounds;
    use crate::reach::sampling::to_segment;

    #[test]
    fn the_general_front_agrees_with_turn_then_straight() {
        let bounds =
            InputBounds::new(vec![-0.3, 0.0, -0.5, -0.1], vec![0.1, 0.2, 0.0, 0.5], (-0.5, 0.5))
                .unwrap();
        let paths = Paths::new(&bounds, 0.2);
        let distance = |from: &[Complex<f64>], to: &[Complex<f64>]| {
            let apart = |point: &Complex<f64>| {
                let edges = to.windows(2).map(|edge| to_segment(*point, edge[0], edge[1]).0);
                edges.fold(f64::INFINITY, f64::min)
            };
            from.iter().map(apart).fold(0.0, f64::max)
        };
        for steps in 1..=4 {
            let (mut family, mut simple, mut general) = (Vec::new(), Vec::new(), Vec::new());
            let budget = Budget::new(1 << 30);
            front(&paths, steps, (16, 1e-6), &mut family, &mut simple, &budget);
            extremals(&paths, steps, (16, 1e-6), &mut family, &mut general, &budget);
            assert!(distance(&simple, &general) < 1e-6, "{steps}");
            assert!(distance(&general, &simple) < 1e-6, "{steps}");
        }
    }
}
