//! Hatching: parallel lines inside a polygon.

use crate::chart::Pen;
use crate::math::sin_cos;
use crate::picture::Picture;

/// Paints parallel lines inside a closed polygon (even–odd rule), `apart_m` apart, along `angle` from +x,
/// rad. The lines lie on one lattice of the world, so that those of adjacent polygons fit together.
pub(super) fn paint(
    picture: &mut Picture,
    polygon: &[[f64; 2]],
    angle: f64,
    apart_m: f64,
    pen: Pen,
    crossings: &mut Vec<f64>,
) {
    let (sin, cos) = sin_cos(angle);
    // In a frame in which the lines are horizontal.
    let turned = |[x, y]: [f64; 2]| [cos * x + sin * y, cos * y - sin * x];
    let back = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
    let heights = polygon.iter().map(|&point| turned(point)[1]);
    let (low, high) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
    if !(high - low).is_finite() {
        return;
    }
    let (first, last) = ((low / apart_m).ceil() as i64, (high / apart_m).floor() as i64);
    for line in first..=last {
        let y = line as f64 * apart_m;
        crossings.clear();
        let mut from = turned(polygon[polygon.len() - 1]);
        for &corner in polygon {
            let to = turned(corner);
            // An edge has its lower end, but not its upper one: corners count once.
            if (from[1] <= y) != (to[1] <= y) {
                crossings.push(from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0]));
            }
            from = to;
        }
        crossings.sort_unstable_by(f64::total_cmp);
        let pairs = crossings.chunks_exact(2);
        picture.segments(pairs.map(|pair| [back([pair[0], y]), back([pair[1], y])]), pen);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::colours;
    use crate::math::{PI, hypot};
    use crate::picture::Shape;

    /// Total length of the hatching of a polygon.
    fn length(polygon: &[[f64; 2]], angle: f64, apart_m: f64) -> f64 {
        let mut picture = Picture::default();
        let pen = Pen::new(colours::TEXT, 1.0);
        paint(&mut picture, polygon, angle, apart_m, pen, &mut Vec::new());
        let ends = picture.shapes().iter().flat_map(|shape| match shape {
            Shape::Path { points, .. } => picture.points(points).chunks_exact(3),
            other => panic!("{other:?}"),
        });
        ends.map(|ends| hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1])).sum()
    }

    /// Lines of length L, a apart, cover an area of about L a, whatever their direction.
    #[test]
    fn the_lines_fill_the_polygon_evenly() {
        let concave = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 1.0], [0.0, 3.0]];
        for angle in [0.0, 0.25 * PI, 0.5 * PI, 0.75 * PI, 0.3] {
            let area = 0.01 * length(&concave, angle, 0.01);
            assert!((area - 8.0).abs() < 0.05, "{angle}: {area}");
        }
        assert_eq!(length(&[], 0.0, 0.1), 0.0);
        assert_eq!(length(&[[1.0, 1.0]], 0.0, 0.1), 0.0);
    }
}
