//! Hatching: parallel lines inside polygons.

use crate::chart::Pen;
use crate::math::sin_cos;
use crate::picture::Picture;

/// A crossing of a line and an edge: the index of the line, the position along it (m), and whether
/// the line enters a polygon there (1) or leaves one (−1).
pub(super) type Crossing = (i64, f64, i32);

/// Paints parallel lines inside the union of closed polygons (nonzero winding rule). The lines are
/// `apart_m` apart and run along `angle` (rad, from +x). Their positions in the world do not depend
/// on the polygons, so the lines of adjacent areas align.
pub(super) fn paint(
    picture: &mut Picture,
    polygons: &[Vec<[f64; 2]>],
    angle: f64,
    apart_m: f64,
    pen: Pen,
    crossings: &mut Vec<Crossing>,
) {
    let (sin, cos) = sin_cos(angle);
    // Rotates into a frame in which the lines are horizontal.
    let turned = |[x, y]: [f64; 2]| [cos * x + sin * y, cos * y - sin * x];
    let back = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
    crossings.clear();
    for polygon in polygons {
        let Some(&last) = polygon.last() else { continue };
        let mut from = turned(last);
        for &corner in polygon {
            let to = turned(corner);
            let (low, high) = (from[1].min(to[1]), from[1].max(to[1]));
            let lines = (low / apart_m).floor() as i64..=(high / apart_m).ceil() as i64;
            for line in lines.filter(|_| (high - low).is_finite()) {
                let y = line as f64 * apart_m;
                // An edge includes its lower end but not its upper end, so corners count once.
                if (from[1] <= y) != (to[1] <= y) {
                    let x = from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0]);
                    crossings.push((line, x, if to[1] < from[1] { 1 } else { -1 }));
                }
            }
            from = to;
        }
    }
    crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // A line leaves every polygon that it enters, so the count returns to 0 before the next line.
    let (mut within, mut entered) = (0, f64::NAN);
    let spans = crossings.iter().filter_map(|&(line, x, winding)| {
        if within == 0 {
            entered = x;
        }
        within += winding;
        let y = line as f64 * apart_m;
        (within == 0).then(|| [back([entered, y]), back([x, y])])
    });
    picture.segments(spans, pen);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::colours;
    use crate::math::{PI, hypot};
    use crate::picture::Shape;

    /// Total length of the hatching of a polygon.
    fn length(polygons: &[Vec<[f64; 2]>], angle: f64, apart_m: f64) -> f64 {
        let mut picture = Picture::default();
        let pen = Pen::new(colours::TEXT, 1.0);
        paint(&mut picture, polygons, angle, apart_m, pen, &mut Vec::new());
        let ends = picture.shapes().iter().flat_map(|shape| match shape {
            Shape::Path { points, .. } => picture.points(points).chunks_exact(3),
            other => panic!("{other:?}"),
        });
        ends.map(|ends| hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1])).sum()
    }

    /// Lines with total length L and spacing a cover an area of about L·a, whatever their
    /// direction.
    #[test]
    fn the_lines_fill_the_polygon_evenly() {
        let concave = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 1.0], [0.0, 3.0]];
        let square = vec![[0.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
        for angle in [0.0, 0.25 * PI, 0.5 * PI, 0.75 * PI, 0.3] {
            let area = |polygons: &[Vec<[f64; 2]>]| 0.01 * length(polygons, angle, 0.01);
            let alone = area(core::slice::from_ref(&concave));
            assert!((alone - 8.0).abs() < 0.05, "{angle}: {alone}");
            // The overlap (½ m²) is hatched once.
            let union = area(&[concave.clone(), square.clone(), concave.clone()]);
            assert!((union - 11.5).abs() < 0.05, "{angle}: {union}");
        }
        assert_eq!(length(&[], 0.0, 0.1), 0.0);
        assert_eq!(length(&[Vec::new()], 0.0, 0.1), 0.0);
        assert_eq!(length(&[vec![[1.0, 1.0]]], 0.0, 0.1), 0.0);
    }
}
