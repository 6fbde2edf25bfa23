//! Approximates curves by polylines with a bounded error.

use super::budget::Budget;
use crate::invalid::Invalid;
use nalgebra::Complex;

/// Accuracy and work limits of polygons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolygonSettings {
    accuracy_m: f64,
    least_pieces: usize,
    conservative: bool,
    most_pieces: usize,
    most_work: usize,
}

/// How a polygon approximates its set.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Outline {
    /// The polygon follows the boundary, even where it is not convex.
    Refined {
        /// The distance (m) by which the polygon was grown so that it certainly contains the set. Edges
        /// that were drawn coarsely lie even farther out. The margin exceeds the accuracy if reaching
        /// the accuracy would have taken more than [`PolygonSettings::most_pieces`] time intervals.
        ///
        /// With a margin of 0, the polygon follows the boundary on either side within the accuracy.
        /// The margin of polygons that are not [conservative](PolygonSettings::conservative) is 0,
        /// unless this would take more than [`PolygonSettings::most_work`] (see the
        /// [guarantees](super#guarantees)).
        margin_m: f64,
    },
    /// The polygon is convex and encloses the whole set with its holes and indentations, for all
    /// settings. It is returned if following the boundary would have taken more than
    /// [`PolygonSettings::most_work`], or if a coarsely drawn polygon would have been larger. In every
    /// direction, the polygon exceeds a simple bound by at most 0.03 %. The bound assumes that each
    /// path has, at each instant, the admissible heading nearest to this direction.
    ConvexHull,
}

/// Default of [`PolygonSettings::most_pieces`].
const MOST_PIECES: usize = 100;

/// Default of [`PolygonSettings::most_work`].
const MOST_WORK: usize = 4_000_000;

impl PolygonSettings {
    /// * `accuracy_m` (10⁻⁶ to 1): the largest distance (m) of the polygon's edges from the true
    ///   boundary, unless [`Outline`] says that the polygon encloses the set.
    /// * `least_pieces` (1 to 1000): the minimum number of edges for each of the boundary's curves. It
    ///   preserves the shape of small sets.
    ///
    /// # Errors
    /// [`Invalid`] if a value is outside its range.
    pub fn new(accuracy_m: f64, least_pieces: usize) -> Result<Self, Invalid> {
        if !(1e-6..=1.0).contains(&accuracy_m) {
            return Err(Invalid::new("accuracy_m", "10⁻⁶ to 1 m", accuracy_m));
        }
        if !(1..=1000).contains(&least_pieces) {
            return Err(Invalid::new("least_pieces", "1 to 1000", least_pieces));
        }
        Ok(Self { accuracy_m, least_pieces, ..Self::default() })
    }

    /// Requests conservative polygons: they contain the whole set for all bounds that
    /// [`ReachableSet`](super::ReachableSet) accepts. This follows from their construction
    /// (decision 0007), not from measured constants. The polygons are grown by a margin that is the sum
    /// of the method's errors.
    ///
    /// Conservative polygons exceed the set by about [`Self::accuracy_m`] (apart from holes, which are
    /// filled) if [`Self::most_pieces`] time intervals are enough. For example, 15 steps of 0.2 s at
    /// 0.5 rad/s and 2 m/s need about 60 intervals for 1 mm. Large turns, many steps or a high accuracy
    /// can need more intervals. Then the polygons still contain the set but are larger.
    #[must_use]
    pub fn conservative(self) -> Self {
        Self { conservative: true, ..self }
    }

    /// Replaces the limit on the time intervals of a conservative polygon (1 to 100,000). The polygon
    /// has at least one interval per step, even beyond the limit. The run time grows at most about
    /// quadratically with the number of intervals.
    ///
    /// # Errors
    /// [`Invalid`] if `pieces` is outside this range.
    pub fn with_most_pieces(self, pieces: usize) -> Result<Self, Invalid> {
        if !(1..=100_000).contains(&pieces) {
            return Err(Invalid::new("most_pieces", "1 to 100,000", pieces));
        }
        Ok(Self { most_pieces: pieces, ..self })
    }

    /// Limit on the number of time intervals of a conservative polygon; 100 by default.
    #[must_use]
    pub fn most_pieces(&self) -> usize {
        self.most_pieces
    }

    /// Replaces the limit on the work for a polygon, conservative or not. A polygon that would take more
    /// becomes an [`Outline::ConvexHull`], which contains the set. With a limit of 0, every polygon is a
    /// convex hull. A unit is about the cost of comparing two edges; the default limit takes some
    /// hundredths of a second. Work is counted, not timed, so polygons are the same on every machine.
    #[must_use]
    pub fn with_most_work(self, units: usize) -> Self {
        Self { most_work: units, ..self }
    }

    /// Limit on the units of work for a polygon; 4 million by default.
    #[must_use]
    pub fn most_work(&self) -> usize {
        self.most_work
    }

    /// Whether polygons are [conservative](Self::conservative).
    #[must_use]
    pub fn is_conservative(&self) -> bool {
        self.conservative
    }

    /// Largest distance (m) between the polygon's edges and the true boundary; see [`Self::new`].
    #[must_use]
    pub fn accuracy_m(&self) -> f64 {
        self.accuracy_m
    }

    /// Minimum number of edges for each of the boundary's curves.
    #[must_use]
    pub fn least_pieces(&self) -> usize {
        self.least_pieces
    }
}

impl Default for PolygonSettings {
    /// An accuracy of 0.1 mm and at least 16 edges per curve.
    fn default() -> Self {
        Self {
            accuracy_m: 1e-4,
            least_pieces: 16,
            conservative: false,
            most_pieces: MOST_PIECES,
            most_work: MOST_WORK,
        }
    }
}

/// A point of a curve, and the direction of the curve there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// In the human's frame (s of travel).
    pub(super) point: Complex<f64>,
    /// Along the tangent or the normal, with any length > 0. Only changes of the direction matter.
    pub(super) direction: Complex<f64>,
}

/// Maximum depth of halving a parameter range. It is enough to reach the last bit of the parameter.
/// Bounds close to zero need this depth, because a long part of the front then belongs to extremals
/// whose parameters hardly differ.
const MOST_HALVINGS: u32 = 64;

/// Appends points of `curve` for parameters in (from, to], so densely that the chords stay within
/// `tolerance` of the curve. Between neighbouring points the curve is assumed to turn in one direction
/// only, so it lies in the triangle of the chord and the end tangents. If even two adjacent
/// floating-point parameters give points that are too far apart, `bridge` appends points between the
/// two, without the end points. `curve` must spend the budget; sampling ends when it is spent.
pub(super) fn sample(
    curve: &impl Fn(f64) -> Sample,
    (from, to): (f64, f64),
    pieces: usize,
    tolerance: f64,
    bridge: &impl Fn(f64, f64, &mut Vec<Complex<f64>>),
    (points, budget): (&mut Vec<Complex<f64>>, &Budget<'_>),
) {
    let mut start = (from, curve(from));
    for i in 1..=pieces {
        let parameter = from + (to - from) * (i as f64 / pieces as f64);
        let end = (parameter, curve(parameter));
        halve(curve, (start, end), tolerance, MOST_HALVINGS, bridge, (&mut *points, budget));
        start = end;
    }
}

fn halve(
    curve: &impl Fn(f64) -> Sample,
    (start, end): ((f64, Sample), (f64, Sample)),
    tolerance: f64,
    halvings: u32,
    bridge: &impl Fn(f64, f64, &mut Vec<Complex<f64>>),
    (points, budget): (&mut Vec<Complex<f64>>, &Budget<'_>),
) {
    if triangle_height(start.1, end.1) <= tolerance || budget.is_spent() {
        points.push(end.1.point);
        return;
    }
    let parameter = 0.5 * (start.0 + end.0);
    if halvings == 0 || parameter == start.0 || parameter == end.0 {
        bridge(start.0, end.0, points);
        points.push(end.1.point);
        return;
    }
    let middle = (parameter, curve(parameter));
    halve(curve, (start, middle), tolerance, halvings - 1, bridge, (&mut *points, budget));
    halve(curve, (middle, end), tolerance, halvings - 1, bridge, (points, budget));
}

/// The largest possible height of a triangle whose base is the chord and whose other sides are the
/// tangents: (base/2)·tan(turn/2).
pub(super) fn triangle_height(a: Sample, b: Sample) -> f64 {
    let base2 = (b.point - a.point).norm_sqr();
    if base2 == 0.0 {
        return 0.0;
    }
    let turn = b.direction * a.direction.conj();
    let lengths = turn.norm_sqr().sqrt();
    // For turns of more than a radian (cos 1 = 0.54) the estimate is not used.
    if turn.re < 0.54 * lengths {
        return f64::INFINITY;
    }
    0.5 * base2.sqrt() * (turn.im.abs() / (lengths + turn.re))
}

/// The number of equal pieces into which a curve of duration `seconds` must be divided so that chords
/// stay within half of `tolerance`. `bend` is an upper bound on the second derivative perpendicular to
/// the chords. Half the tolerance is used so that errors of areas are small as well.
pub(super) fn pieces(seconds: f64, bend: f64, tolerance: f64, least: usize) -> usize {
    let fewest = seconds * (bend / (4.0 * tolerance)).sqrt();
    // Rounds up without `ceil`, which is a function call on baseline processors.
    let below = fewest as usize;
    (below + usize::from((below as f64) < fewest)).max(least)
}

/// Points closer together than this (s of travel) differ only by rounding errors.
const SAME: f64 = 1e-11;

/// Removes, from index `from` on, points that repeat their predecessor. The first and the last point
/// stay exact.
pub(super) fn space(points: &mut Vec<Complex<f64>>, from: usize) {
    let Some(&last) = points.get(from..).and_then(<[_]>::last) else {
        return;
    };
    let same = |a: Complex<f64>, b: Complex<f64>| (a - b).norm_sqr() < SAME * SAME;
    let mut kept = from;
    for i in from + 1..points.len() {
        if !same(points[i], points[kept]) {
            kept += 1;
            points[kept] = points[i];
        }
    }
    points.truncate(kept + 1);
    if same(last, points[kept]) {
        points[kept] = last;
    }
}

/// Distance of a position from a segment, and the nearest point as a fraction of the segment, from 0
/// to 1.
pub(super) fn to_segment(
    position: Complex<f64>,
    start: Complex<f64>,
    end: Complex<f64>,
) -> (f64, f64) {
    let (chord, from) = (end - start, position - start);
    let length = chord.norm_sqr();
    let along = (from * chord.conj()).re;
    let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    ((from - chord * share).norm_sqr().sqrt(), share)
}

/// Several curves in one buffer.
#[derive(Clone, Debug, Default)]
pub(super) struct Curves {
    points: Vec<Complex<f64>>,
    /// End headings at which a search for curves begins (`multi_switch`).
    pub(super) nodes: Vec<(f64, usize)>,
    /// Index in `points` of the first point of each curve.
    starts: Vec<usize>,
}

impl Curves {
    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.starts.clear();
    }

    /// Begins a curve. The caller pushes its points to the returned buffer.
    pub(super) fn begin(&mut self) -> &mut Vec<Complex<f64>> {
        self.starts.push(self.points.len());
        &mut self.points
    }

    /// The points of all curves so far. The last points belong to the current curve.
    pub(super) fn points(&mut self) -> &mut Vec<Complex<f64>> {
        &mut self.points
    }

    /// Removes points of the last curve that repeat their predecessor.
    pub(super) fn space_last(&mut self) {
        if let Some(&from) = self.starts.last() {
            space(&mut self.points, from);
        }
    }

    /// The last point of the last curve.
    pub(super) fn last(&self) -> Option<Complex<f64>> {
        self.points.last().copied()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[Complex<f64>]> + '_ {
        let ends = self.starts.iter().skip(1).copied().chain([self.points.len()]);
        self.starts.iter().zip(ends).map(|(&start, end)| &self.points[start..end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, hypot, sin_cos};

    #[test]
    fn a_circle_is_met_within_the_tolerance() {
        let circle = |angle: f64| {
            let (sin, cos) = sin_cos(angle);
            let point = Complex::new(cos, sin);
            Sample { point, direction: point }
        };
        for tolerance in [1e-2, 1e-3, 1e-5] {
            let mut points = vec![circle(0.0).point];
            let budget = Budget::new(1);
            sample(&circle, (0.0, PI), 3, tolerance, &|_, _, _| {}, (&mut points, &budget));
            for pair in points.windows(2) {
                let middle = (pair[0] + pair[1]) * 0.5;
                assert!(1.0 - hypot(middle.re, middle.im) <= tolerance);
            }
            let fewest = PI / (8.0 * tolerance).sqrt();
            assert!((points.len() as f64) < 4.0 * fewest + 4.0, "{tolerance}");
        }
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        assert_eq!(PolygonSettings::new(0.0, 8).unwrap_err().field, "accuracy_m");
        assert!(PolygonSettings::new(f64::NAN, 8).is_err());
        assert!(PolygonSettings::new(1e-3, 0).is_err());
        assert!(PolygonSettings::new(1e-3, 8).is_ok());
    }
}
