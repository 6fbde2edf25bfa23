//! Minkowski sums with a disc or a box, and unions of rotated copies about the start.

use super::boundary::Workspace;
use super::budget::Budget;
use super::paths::unit;
use super::start::non_negative;
use crate::invalid::Invalid;
use crate::math::{PI, TAU, atan2};
use nalgebra::Complex;

type Point = Complex<f64>;

/// The Minkowski sum of a simple polygon and a disc: all positions within `radius_m` of the polygon,
/// including its interior. For the human's reachable positions and the danger radius, it is the region
/// where the robot would be too near.
///
/// The vertices are in metres and counter-clockwise, and the first vertex is not repeated. A polygon
/// with one vertex is a point, and one with two vertices is a segment. The returned polygon contains
/// the sum and exceeds it by at most `accuracy_m` (10⁻⁶ to 1 m). Holes are filled.
///
/// # Errors
/// [`Invalid`] if there is no vertex, a coordinate is not finite, the radius is not from 0 to 10⁴ m,
/// or the accuracy is not in its range.
pub fn minkowski_disc(
    polygon: &[[f64; 2]],
    radius_m: f64,
    accuracy_m: f64,
) -> Result<Vec<[f64; 2]>, Invalid> {
    let Some(&[x0, y0]) = polygon.first() else {
        return Err(Invalid::new("polygon", "at least one vertex", "none"));
    };
    if let Some([x, y]) = polygon.iter().find(|p| !(p[0].is_finite() && p[1].is_finite())) {
        return Err(Invalid::new("polygon", "finite coordinates", format!("[{x}, {y}]")));
    }
    non_negative("radius_m", radius_m)?;
    if !(1e-6..=1.0).contains(&accuracy_m) {
        return Err(Invalid::new("accuracy_m", "10⁻⁶ to 1 m", accuracy_m));
    }
    let mut workspace = Workspace::default();
    let boundary = &mut workspace.boundary;
    boundary.extend(polygon.iter().map(|[x, y]| Point::new(x - x0, y - y0)));
    let budget = Budget::new(usize::MAX);
    workspace.outliner.tidy(boundary, &budget);
    // The slightly larger radius compensates for the rounding of the outline.
    let brush = Brush { radius: radius_m + 0.25 * accuracy_m, half: [0.0; 2], outside: true };
    brush.sweep(0.5 * accuracy_m, &mut workspace, &budget);
    Ok(workspace.boundary.iter().map(|p| [x0 + p.re, y0 + p.im]).collect())
}

/// The Minkowski sum of a disc and a box. [`Brush::sweep`] adds it to a set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Brush {
    /// Radius of the disc.
    pub(super) radius: f64,
    /// Half the length and width of the box.
    pub(super) half: [f64; 2],
    /// Whether the polygon that approximates the disc is circumscribed; otherwise it is inscribed.
    pub(super) outside: bool,
}

impl Brush {
    /// Replaces the boundary in the workspace by the boundary of its Minkowski sum with the brush. The
    /// boundary must be [tidy](super::outline::Outliner::tidy). The disc is approximated within
    /// `tolerance`.
    pub(super) fn sweep(self, tolerance: f64, workspace: &mut Workspace, budget: &Budget<'_>) {
        if self.radius == 0.0 && self.half == [0.0; 2] || budget.is_spent() {
            return;
        }
        let Workspace { boundary, curve, brush, outliner, .. } = workspace;
        self.vertices(tolerance, brush);
        convolve(boundary, brush, curve);
        outliner.clear();
        outliner.add_closed(curve);
        boundary.truncate(1);
        outliner.outline(boundary, budget);
    }

    /// Support function: how far the brush extends in a direction (a unit vector).
    pub(super) fn support(self, direction: Point) -> f64 {
        let [a, b] = self.half;
        self.radius + a * direction.re.abs() + b * direction.im.abs()
    }

    /// The brush as a convex polygon with k vertices. Edge j starts at vertex j and has direction
    /// 2πj/k.
    fn vertices(self, tolerance: f64, vertices: &mut Vec<Point>) {
        let ratio = self.radius / tolerance;
        // k is large enough that r·(1/cos(π/k) − 1) ≤ tolerance. The factor 0.55, instead of 0.5, covers
        // the higher-order terms of the series, which are below 10 %.
        let k = ((PI * (0.55 * ratio).sqrt()).ceil() as usize).div_ceil(4).max(2) * 4;
        let radius = if self.outside { self.radius / unit(PI / k as f64).re } else { self.radius };
        let [a, b] = self.half;
        vertices.clear();
        vertices.extend((0..k).map(|j| {
            let angle = TAU * (j as f64 - 0.5) / k as f64 - 0.5 * PI;
            let corner = match (j + k - 1) / (k / 4) % 4 {
                0 => Point::new(a, -b),
                1 => Point::new(a, b),
                2 => Point::new(-a, b),
                _ => Point::new(-a, -b),
            };
            corner + unit(angle) * radius
        }));
    }
}

/// Replaces `curve` by the convolution of a counter-clockwise polygon without crossings with a convex
/// polygon from [`Brush::vertices`]. The convolution winds at least once around each position of the
/// Minkowski sum and around no other position (Guibas, Ramshaw and Stolfi 1983).
fn convolve(polygon: &[Point], brush: &[Point], curve: &mut Vec<Point>) {
    curve.clear();
    let [.., last] = *polygon else {
        return;
    };
    if polygon.len() == 1 {
        curve.extend(brush.iter().map(|vertex| last + vertex));
        return;
    }
    let k = brush.len() as f64;
    let edge = |i: usize| polygon[(i + 1) % polygon.len()] - polygon[i];
    // An edge in `direction` is shifted by the vertex of the brush whose two edges have the directions
    // just below and just above `direction`.
    let shift = |direction: f64| (direction * k / TAU).ceil() as i64;
    let mut before = edge(polygon.len() - 1);
    let mut direction = atan2(before.im, before.re);
    let mut at = shift(direction);
    for (i, &point) in polygon.iter().enumerate() {
        let after = edge(i);
        let turn = after * before.conj();
        // At a spike (a turn by π) the curve goes around the tip.
        direction += if turn.im == 0.0 && turn.re < 0.0 { PI } else { atan2(turn.im, turn.re) };
        let to = shift(direction);
        let mut push =
            |at: i64| curve.push(point + brush[at.rem_euclid(brush.len() as i64) as usize]);
        push(at);
        while at != to {
            at += (to - at).signum();
            push(at);
        }
        before = after;
    }
}

/// Replaces the boundary in the workspace by the boundary of the union of all copies of the set that
/// are rotated about the origin by at most `angle` to either side. The boundary must be
/// [tidy](super::outline::Outliner::tidy). Arcs are approximated within `tolerance`.
///
/// The boundary of the union consists of edges of the two extreme copies, and of arcs. An arc is the
/// trace of a boundary point whose distance from the origin is a local maximum or minimum. Variations
/// by less than the tolerance do not count.
pub(super) fn rotate(angle: f64, tolerance: f64, workspace: &mut Workspace, budget: &Budget<'_>) {
    let Workspace { boundary, curve, brush, outliner, .. } = workspace;
    let drawn = |point: Point| {
        let radius = point.norm_sqr().sqrt();
        (2.0 * angle * (radius / (8.0 * tolerance)).sqrt()).ceil().max(1.0) as usize
    };
    let Some(farthest) = extremes(boundary, tolerance, brush) else { return };
    if angle >= PI {
        let count = drawn(farthest);
        let part = unit(TAU / count as f64);
        boundary.clear();
        boundary.push(farthest);
        for i in 1..count {
            boundary.push(boundary[i - 1] * part);
        }
        outliner.tidy(boundary, budget);
        return;
    }
    outliner.clear();
    let ends = [unit(-angle), unit(angle)];
    for end in ends {
        curve.clear();
        curve.extend(boundary.iter().map(|point| point * end));
        outliner.add_closed(curve);
    }
    for &point in brush.iter() {
        let count = drawn(point);
        budget.spend(count);
        if budget.is_spent() {
            return;
        }
        let part = unit(2.0 * angle / count as f64);
        curve.clear();
        curve.push(point * ends[0]);
        for i in 1..count {
            curve.push(curve[i - 1] * part);
        }
        curve.push(point * ends[1]);
        outliner.add(curve);
    }
    boundary.truncate(1);
    outliner.outline(boundary, budget);
}

/// Replaces `found` by the points of a closed polygon at which the distance from the origin has a local
/// extremum: first the farthest point, then minima and maxima alternately. Returns the farthest point.
/// Between consecutive extrema, the distance changes by at least `least`. At least one minimum is
/// always found, however small the change.
fn extremes(polygon: &[Point], least: f64, found: &mut Vec<Point>) -> Option<Point> {
    found.clear();
    let distance = |point: Point| point.norm_sqr().sqrt();
    let n = polygon.len();
    let farthest = (0..n).max_by(|&i, &j| polygon[i].norm_sqr().total_cmp(&polygon[j].norm_sqr()));
    let first = farthest?;
    found.push(polygon[first]);
    // The candidate for the next extreme, and whether it is a minimum.
    let (mut next, mut nearer) = (polygon[first], true);
    let mut look = |point: Point| {
        let further = distance(point) - distance(next);
        let further = if nearer { -further } else { further };
        if further > 0.0 {
            next = point;
        } else if further <= -least {
            found.push(next);
            (next, nearer) = (point, !nearer);
        }
    };
    for i in first..first + n {
        let (from, to) = (polygon[i % n], polygon[(i + 1) % n]);
        let edge = to - from;
        let foot = -(from * edge.conj()).re / edge.norm_sqr();
        if foot > 0.0 && foot < 1.0 {
            look(from + edge * foot);
        }
        look(to);
    }
    if found.len() == 1 {
        found.push(next);
    }
    found.first().copied()
}
