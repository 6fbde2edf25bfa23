//! The area that convex sets sweep from step to step.
//!
//! Sets learned from positions exist only at the steps. To compare their union over time with a
//! reachable tube, the human is assumed to be, between two steps, in the convex hull of the sets of
//! these steps. This assumption uses no vehicle model. It holds if the path between two steps is a
//! straight line.

/// The convex hull, counter-clockwise from its leftmost vertex (Andrew's monotone chain). Points
/// between the two ends of an edge are omitted. A single point or a segment is returned unchanged.
pub(super) fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut points = points.to_vec();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && turn(a, b, point) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// Twice the signed area of the triangle, positive for a left turn.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The region that convex sets sweep from the origin. The result contains the convex hulls of
/// consecutive sets, and the region is the union of these hulls. `sets` contains the vertices of
/// the set after each step.
pub(super) fn swept(sets: &[Vec<[f64; 2]>]) -> Vec<Vec<[f64; 2]>> {
    let now = vec![[0.0; 2]];
    let before = core::iter::once(&now).chain(sets);
    before.zip(sets).map(|(before, set)| convex_hull(&[&before[..], &set[..]].concat())).collect()
}

/// Area (m²) of the region that `sets` after each step [sweep](swept).
pub(super) fn swept_area(sets: &[Vec<[f64; 2]>]) -> f64 {
    union_area(&swept(sets))
}

/// Area of the union of convex polygons. The result is exact, because the length of the union's
/// cross-section is linear between consecutive abscissae of vertices and crossings. So the length
/// at the midpoint of such an interval gives the area.
fn union_area(polygons: &[Vec<[f64; 2]>]) -> f64 {
    let mut cuts: Vec<f64> = polygons.iter().flatten().map(|p| p[0]).collect();
    for (i, a) in polygons.iter().enumerate() {
        for b in &polygons[i + 1..] {
            for e in edges(a) {
                cuts.extend(edges(b).filter_map(|f| crossing(e, f)));
            }
        }
    }
    cuts.sort_by(f64::total_cmp);
    let mut spans = Vec::with_capacity(polygons.len());
    let mut area = 0.0;
    for pair in cuts.windows(2) {
        let (width, middle) = (pair[1] - pair[0], 0.5 * (pair[0] + pair[1]));
        if width > 0.0 {
            spans.clear();
            spans.extend(polygons.iter().filter_map(|polygon| span(polygon, middle)));
            area += width * covered(&mut spans);
        }
    }
    area
}

fn edges(polygon: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(&a, &b)| [a, b])
}

/// The abscissa at which two edges cross. Returns `None` if they do not cross.
fn crossing([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> Option<f64> {
    let apart = |i: usize| a[i].max(b[i]) < c[i].min(d[i]) || c[i].max(d[i]) < a[i].min(b[i]);
    if apart(0) || apart(1) {
        return None;
    }
    let (from, to) = (turn(c, d, a), turn(c, d, b));
    let crosses = from * to < 0.0 && turn(a, b, c) * turn(a, b, d) < 0.0;
    crosses.then(|| a[0] + (b[0] - a[0]) * (from / (from - to)))
}

/// Lowest and highest ordinate of a polygon at `x`, if the polygon has points there.
fn span(polygon: &[[f64; 2]], x: f64) -> Option<(f64, f64)> {
    let at = |[a, b]: [[f64; 2]; 2]| {
        let crosses = (a[0] <= x) != (b[0] <= x);
        crosses.then(|| a[1] + (b[1] - a[1]) * ((x - a[0]) / (b[0] - a[0])))
    };
    edges(polygon).filter_map(at).fold(None, |span, y| {
        let (low, high) = span.unwrap_or((y, y));
        Some((y.min(low), y.max(high)))
    })
}

/// Length of the union of intervals.
fn covered(spans: &mut [(f64, f64)]) -> f64 {
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut end = f64::NEG_INFINITY;
    spans.iter().fold(0.0, |total, &(low, high)| {
        let new = (high - low.max(end)).max(0.0);
        end = end.max(high);
        total + new
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;
    use crate::reach::polygon::{signed_area, signed_distance};

    fn square(x: f64, y: f64, side: f64) -> Vec<[f64; 2]> {
        vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
    }

    #[test]
    fn areas_of_squares() {
        assert_eq!(union_area(&[square(0.0, 0.0, 2.0)]), 4.0);
        assert_eq!(union_area(&[square(0.0, 0.0, 2.0), square(1.0, 1.0, 2.0)]), 7.0);
        assert_eq!(union_area(&[square(0.0, 0.0, 1.0), square(0.0, 5.0, 2.0)]), 5.0);
        assert_eq!(union_area(&[square(0.0, 0.0, 3.0), square(1.0, 1.0, 1.0)]), 9.0);
        assert_eq!(union_area(&[]), 0.0);
        // The origin, then a square, then the same square farther on.
        let sets = [square(1.0, -0.5, 1.0), square(3.0, -0.5, 1.0)];
        assert!((swept_area(&sets) - (0.5 * 1.0 + 3.0)).abs() < 1e-12);
    }

    #[test]
    fn hulls_hold_their_points() {
        let mut rng = SeededRng::new(3);
        for n in 1..60 {
            let points: Vec<_> =
                (0..n).map(|_| [rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)]).collect();
            let hull = convex_hull(&points);
            assert!(n < 3 || signed_area(&hull) > 0.0);
            assert!(points.iter().all(|&p| signed_distance(&hull, p) < 1e-12));
            assert!(hull.iter().all(|vertex| points.contains(vertex)));
        }
    }

    /// Monte Carlo check: the share of a box that is inside any polygon.
    #[test]
    fn unions_against_counting() {
        let mut rng = SeededRng::new(8);
        for _ in 0..6 {
            let polygons: Vec<_> = (0..7)
                .map(|_| {
                    let (x, y) = (rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0));
                    let points: Vec<_> = (0..9).map(|_| [x + rng.unit(), y + rng.unit()]).collect();
                    convex_hull(&points)
                })
                .collect();
            const N: usize = 100_000;
            let inside = (0..N)
                .filter(|_| {
                    let p = [rng.uniform(0.0, 3.0), rng.uniform(0.0, 3.0)];
                    polygons.iter().any(|polygon| signed_distance(polygon, p) < 0.0)
                })
                .count();
            let counted = 9.0 * inside as f64 / N as f64;
            // Four standard errors of the counted area are at most 9 · 4 · 0.5 / √N.
            assert!((union_area(&polygons) - counted).abs() < 18.0 / (N as f64).sqrt());
        }
    }
}
