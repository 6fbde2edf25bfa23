//! Plane polygons: area, bounding box, and signed distance of a point.
//!
//! A polygon is a list of vertices (m). An edge joins the last vertex to the first, which is not
//! repeated. One vertex is a point; two vertices are a segment, traversed in both directions.

use crate::math::hypot;

/// Area (m²) by the shoelace formula; positive if the vertices run counter-clockwise.
#[must_use]
pub fn signed_area(polygon: &[[f64; 2]]) -> f64 {
    let Some(&[x0, y0]) = polygon.first() else {
        return 0.0;
    };
    // Coordinates are relative to the first vertex, so that small sets far from the origin keep
    // their digits.
    let twice: f64 = edges(polygon)
        .map(|([ax, ay], [bx, by])| (ax - x0) * (by - y0) - (bx - x0) * (ay - y0))
        .sum();
    0.5 * twice
}

/// The axis-aligned bounding box of the vertices: `[x_min, y_min, x_max, y_max]` (m). Returns `None`
/// if there is no vertex.
#[must_use]
pub fn bounding_box(polygon: &[[f64; 2]]) -> Option<[f64; 4]> {
    let &[x, y] = polygon.first()?;
    Some(polygon.iter().fold([x, y, x, y], |b, p| {
        [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])]
    }))
}

/// Signed distance (m) of a position from the polygon's boundary: negative inside, like the value
/// function V, and positive outside; +∞ if there is no vertex. A position is inside if its winding
/// number is not zero.
#[must_use]
pub fn signed_distance(polygon: &[[f64; 2]], position: [f64; 2]) -> f64 {
    let [x, y] = position;
    let (mut winding, mut nearest) = (0_i32, f64::INFINITY);
    for ([ax, ay], [bx, by]) in edges(polygon) {
        let (dx, dy) = (bx - ax, by - ay);
        let (px, py) = (x - ax, y - ay);
        let left = dx * py - dy * px;
        if ay <= y && y < by && left > 0.0 {
            winding += 1;
        } else if by <= y && y < ay && left < 0.0 {
            winding -= 1;
        }
        let length2 = dx * dx + dy * dy;
        let along =
            if length2 > 0.0 { ((px * dx + py * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
        nearest = nearest.min(hypot(px - along * dx, py - along * dy));
    }
    if winding == 0 { nearest } else { -nearest }
}

/// All edges; the closing edge is the last one.
fn edges(polygon: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(next.copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]];

    #[test]
    fn a_square() {
        assert_eq!(signed_area(&SQUARE), 4.0);
        assert_eq!(bounding_box(&SQUARE), Some([1.0, 1.0, 3.0, 3.0]));
        assert_eq!(signed_distance(&SQUARE, [2.0, 2.5]), -0.5);
        assert_eq!(signed_distance(&SQUARE, [2.0, 4.5]), 1.5);
        assert_eq!(signed_distance(&SQUARE, [6.0, 7.0]), 5.0);
    }

    #[test]
    fn the_other_way_round_the_area_is_negative() {
        let clockwise: Vec<_> = SQUARE.iter().rev().copied().collect();
        assert_eq!(signed_area(&clockwise), -4.0);
        assert_eq!(signed_distance(&clockwise, [2.0, 2.5]), -0.5);
    }

    #[test]
    fn a_point_and_nothing() {
        assert_eq!(signed_area(&[[2.0, 3.0]]), 0.0);
        assert_eq!(signed_distance(&[[2.0, 3.0]], [2.0, 5.0]), 2.0);
        assert_eq!(signed_area(&[]), 0.0);
        assert_eq!(bounding_box(&[]), None);
        assert_eq!(signed_distance(&[], [0.0, 0.0]), f64::INFINITY);
    }
}
