//! The part of a curve that is within a rectangle: left, top, right, bottom.

use super::drawing::Point;

/// The pieces of a line inside (Liang and Barsky). Points that are not finite part it.
pub(super) fn line_inside(line: &[Point], [left, top, right, bottom]: [f64; 4]) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let mut joined = false;
    for (from, to) in line.iter().zip(line.iter().skip(1)) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        // Shares of the way at which it enters and leaves each side.
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for (speed, room) in [
            (-dx, from[0] - left),
            (dx, right - from[0]),
            (-dy, from[1] - top),
            (dy, bottom - from[1]),
        ] {
            if speed < 0.0 {
                enters = enters.max(room / speed);
            } else if speed > 0.0 {
                leaves = leaves.min(room / speed);
            } else if room < 0.0 {
                leaves = -1.0;
            }
        }
        if !(dx.is_finite() && dy.is_finite()) || enters > leaves {
            joined = false;
            continue;
        }
        let at = |share: f64| [from[0] + share * dx, from[1] + share * dy];
        let end = if leaves < 1.0 { at(leaves) } else { *to };
        match pieces.last_mut() {
            Some(piece) if joined && enters == 0.0 => piece.push(end),
            _ => pieces.push(vec![if enters > 0.0 { at(enters) } else { *from }, end]),
        }
        joined = leaves == 1.0;
    }
    pieces
}

/// The polygon inside (Sutherland and Hodgman); empty if nothing is.
pub(super) fn polygon_inside(
    polygon: &[Point],
    [left, top, right, bottom]: [f64; 4],
) -> Vec<Point> {
    let mut inside: Vec<Point> = polygon.to_vec();
    // Axis, limit, and whether what is above the limit stays.
    for (axis, limit, above) in
        [(0, left, true), (0, right, false), (1, top, true), (1, bottom, false)]
    {
        let depth = |p: &Point| if above { p[axis] - limit } else { limit - p[axis] };
        let mut kept = Vec::with_capacity(inside.len() + 4);
        for (from, to) in inside.iter().zip(inside.iter().cycle().skip(1)) {
            let (a, b) = (depth(from), depth(to));
            if a >= 0.0 {
                kept.push(*from);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                let share = a / (a - b);
                kept.push([0, 1].map(|d| from[d] + share * (to[d] - from[d])));
            }
        }
        inside = kept;
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [f64; 4] = [0.0, 0.0, 10.0, 10.0];

    #[test]
    fn a_line_is_cut_at_the_frame() {
        let inside = [[1.0, 1.0], [5.0, 5.0], [9.0, 1.0]];
        assert_eq!(line_inside(&inside, FRAME), [inside.to_vec()]);
        // Out on the right and in again from above.
        let line = [[5.0, 5.0], [15.0, 5.0], [15.0, -5.0], [5.0, -5.0], [5.0, 5.0]];
        let pieces = line_inside(&line, FRAME);
        assert_eq!(pieces, [vec![[5.0, 5.0], [10.0, 5.0]], vec![[5.0, 0.0], [5.0, 5.0]]]);
        assert!(line_inside(&[[-1.0, -5.0], [-1.0, 15.0]], FRAME).is_empty());
        assert_eq!(line_inside(&[[-5.0, 3.0], [15.0, 3.0]], FRAME), [[[0.0, 3.0], [10.0, 3.0]]]);
    }

    #[test]
    fn a_number_that_is_none_parts_a_line() {
        let line = [[1.0, 1.0], [2.0, 2.0], [3.0, f64::NAN], [4.0, 4.0], [5.0, 5.0]];
        let pieces = line_inside(&line, FRAME);
        assert_eq!(pieces, [[[1.0, 1.0], [2.0, 2.0]], [[4.0, 4.0], [5.0, 5.0]]]);
    }

    #[test]
    fn a_polygon_is_cut_at_the_frame() {
        let square = [[5.0, 5.0], [15.0, 5.0], [15.0, 15.0], [5.0, 15.0]];
        let cut = polygon_inside(&square, FRAME);
        assert_eq!(cut, [[5.0, 5.0], [10.0, 5.0], [10.0, 10.0], [5.0, 10.0]]);
        assert!(polygon_inside(&[[11.0, 1.0], [12.0, 1.0], [12.0, 2.0]], FRAME).is_empty());
        // All of the frame is inside of this.
        let around = [[-9.0, -9.0], [99.0, -9.0], [99.0, 99.0], [-9.0, 99.0]];
        assert_eq!(polygon_inside(&around, FRAME).len(), 4);
    }
}
