//! The front of a planar set: the ends of the paths that get farthest, from the
//! lowest-rate path's end to the highest-rate path's.

use super::paths::{Paths, unit};
use super::sampling::{Sample, sample, spaced};
use super::singular::pieces;
use nalgebra::Complex;

/// The front after `steps` ≥ 1 steps, right to left, seconds of travel.
pub(super) fn front(
    paths: &Paths,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
) -> Vec<Complex<f64>> {
    let mut points = vec![paths.low.point(steps)];
    if paths.straight_always(steps) {
        turn_then_straight(paths, steps, least_pieces, tolerance, &mut points);
    } else {
        extremals(paths, steps, least_pieces, tolerance, &mut points);
    }
    points.push(paths.high.point(steps));
    spaced(points)
}

/// If one may always drive straight: turn right at the lowest rate, or left at
/// the highest, until the target heading is reached, and go straight.
fn turn_then_straight(
    paths: &Paths,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let pieces = least_pieces.div_ceil(steps);
    for (path, leftward) in [(&paths.low, false), (&paths.high, true)] {
        for i in 0..steps {
            let step = if leftward { i } else { steps - 1 - i };
            let straight_s = (steps - step) as f64 * paths.step_s;
            let curve = |turn_s: f64| {
                let (point, heading) = path.within(step, turn_s);
                Sample { point: point + unit(heading) * (straight_s - turn_s), angle: heading }
            };
            let whole = if leftward { (0.0, paths.step_s) } else { (paths.step_s, 0.0) };
            sample(&curve, whole, pieces, tolerance, points);
        }
    }
}

/// In general: every extremal whose end heading is near its direction.
fn extremals(
    paths: &Paths,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let family = pieces(paths, steps);
    let each = least_pieces.div_ceil(family.len().max(1));
    // The family runs from left to right.
    for piece in family.iter().rev() {
        let curve = |parameter: f64| piece.start(paths, steps, parameter).sample();
        points.push(curve(piece.to).point);
        sample(&curve, (piece.to, piece.from), each, tolerance, points);
    }
}

/// Backward from the end of step `steps` − 1, the largest |φ| at which a front
/// extremal may end: beyond it the path keeps the highest rate throughout
/// (left, φ < 0), or the lowest (right, φ > 0).
pub(super) fn end_range(paths: &Paths, steps: usize) -> (f64, f64) {
    let (high, low) = (paths.high.heading(steps), paths.low.heading(steps));
    (0..steps).fold((0.0, 0.0), |(left, right): (f64, f64), step| {
        (left.min(high - paths.high.heading(step)), right.max(low - paths.low.heading(step)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::InputBounds;
    use crate::math::hypot;

    #[test]
    fn the_general_front_agrees_with_turn_then_straight() {
        let bounds =
            InputBounds::new(vec![-0.3, 0.0, -0.5, -0.1], vec![0.1, 0.2, 0.0, 0.5], (-0.5, 0.5))
                .unwrap();
        let paths = Paths::new(&bounds, 0.2);
        let distance = |from: &[Complex<f64>], to: &[Complex<f64>]| {
            from.iter()
                .map(|a| {
                    to.windows(2)
                        .map(|w| {
                            let (edge, to_a) = (w[1] - w[0], a - w[0]);
                            let along = (edge.re * to_a.re + edge.im * to_a.im)
                                / (edge.re * edge.re + edge.im * edge.im);
                            let off = to_a - edge * along.clamp(0.0, 1.0);
                            hypot(off.re, off.im)
                        })
                        .fold(f64::INFINITY, f64::min)
                })
                .fold(0.0, f64::max)
        };
        for steps in 1..=4 {
            let simple = front(&paths, steps, 16, 1e-6);
            let mut general = Vec::new();
            extremals(&paths, steps, 16, 1e-6, &mut general);
            assert!(distance(&simple, &general) < 1e-6, "{steps}");
            assert!(distance(&general, &simple) < 1e-6, "{steps}");
        }
    }
}
