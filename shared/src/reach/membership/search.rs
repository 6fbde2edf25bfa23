//! The distance of a curve from a position, and its winding number around the position. Both are
//! computed from as few points of the curve as possible.

use super::super::budget::Budget;
use super::super::sampling::to_segment;
use nalgebra::Complex;

/// A curve whose points can be computed one by one, with a bound on its distance from chords.
pub(super) trait Arc {
    /// A point of the curve, with the data that the bound needs.
    type Knot: Copy;

    /// The point at a parameter.
    fn knot(&self, parameter: f64) -> Self::Knot;

    /// Approximate cost of computing a point, in units of a [`Budget`].
    fn work(&self) -> usize;

    /// Parameter and point of a knot.
    fn place(knot: Self::Knot) -> (f64, Complex<f64>);

    /// Upper bound on the distance of the curve from the chord between two knots.
    fn deviation(&self, a: Self::Knot, b: Self::Knot) -> f64;
}

/// The result for the curves followed so far. It is meaningless if the budget is spent.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    budget: &'a Budget<'a>,
    position: Complex<f64>,
    /// The smallest distance found, or the search radius `reach` if no distance is below it.
    pub(super) distance: f64,
    /// The approximate parameter and the point at which the smallest distance was found.
    pub(super) nearest: f64,
    pub(super) point: Complex<f64>,
    /// The search ends when it finds a point at this distance or nearer.
    enough: f64,
    /// Signed crossings of the curves with the ray to the right of the position: the number of upward
    /// crossings minus the number of downward crossings. Meaningless once `found()` is true.
    pub(super) crossings: i32,
}

/// If a chord is within this distance (s) of the curve, it replaces the curve.
const EXACT: f64 = 2e-7;

/// Maximum depth of halving a parameter range.
const MOST_HALVINGS: u32 = 48;

impl<'a> Search<'a> {
    /// A search for distances below `reach`.
    pub(super) fn new(
        position: Complex<f64>,
        enough: f64,
        reach: f64,
        budget: &'a Budget<'a>,
    ) -> Self {
        let point = Complex::new(f64::NAN, f64::NAN);
        Self { budget, position, distance: reach, nearest: f64::NAN, point, enough, crossings: 0 }
    }

    /// Whether a point at distance `enough` or nearer was found.
    pub(super) fn found(&self) -> bool {
        self.distance <= self.enough
    }

    /// Whether the search is over.
    fn ends(&self) -> bool {
        self.found() || self.budget.is_spent()
    }

    /// Follows a curve through the given parameters, in their order.
    pub(super) fn follow<A: Arc>(&mut self, arc: &A, parameters: impl IntoIterator<Item = f64>) {
        let mut last: Option<A::Knot> = None;
        for parameter in parameters {
            let knot = self.look(arc, parameter);
            if let Some(last) = last {
                self.between(arc, last, knot, MOST_HALVINGS);
            }
            if self.ends() {
                return;
            }
            last = Some(knot);
        }
    }

    /// Counts the crossing of the ray with the small gap between the ends of two curves.
    pub(super) fn join(&mut self, from: Complex<f64>, to: Complex<f64>) {
        self.crossings += crossing(self.position, from, to);
    }

    fn look<A: Arc>(&mut self, arc: &A, parameter: f64) -> A::Knot {
        self.budget.spend(arc.work());
        let knot = arc.knot(parameter);
        let point = A::place(knot).1;
        let away = (point - self.position).norm_sqr();
        if away < self.distance * self.distance {
            (self.distance, self.nearest, self.point) = (away.sqrt(), parameter, point);
        }
        knot
    }

    fn between<A: Arc>(&mut self, arc: &A, a: A::Knot, b: A::Knot, halvings: u32) {
        let ((from, start), (to, end)) = (A::place(a), A::place(b));
        let deviation = arc.deviation(a, b);
        let (distance, share) = to_segment(self.position, start, end);
        // If the position is outside the region between curve and chord, both have the same crossings
        // with the ray.
        let clear = distance > deviation && distance - deviation >= self.distance;
        if clear || deviation <= EXACT || halvings == 0 {
            if distance < self.distance {
                (self.distance, self.nearest) = (distance, from + share * (to - from));
                self.point = start + (end - start) * share;
            }
            self.crossings += crossing(self.position, start, end);
            return;
        }
        let middle = self.look(arc, 0.5 * (from + to));
        for (a, b) in [(a, middle), (middle, b)] {
            if self.ends() {
                return;
            }
            self.between(arc, a, b, halvings - 1);
        }
    }
}

/// The crossing of a segment with the ray to the right of the position: 1 if upward, −1 if downward, 0
/// if there is none.
fn crossing(position: Complex<f64>, start: Complex<f64>, end: Complex<f64>) -> i32 {
    let (above, below) = (start.im > position.im, end.im > position.im);
    if above == below {
        return 0;
    }
    let (chord, from) = (end - start, position - start);
    let left = chord.re * from.im - chord.im * from.re;
    if below && left > 0.0 {
        1
    } else if above && left < 0.0 {
        -1
    } else {
        0
    }
}

/// Upper bound on the distance between a curve and its chord. The curve must turn in one direction
/// only, by `turn` (rad) in total.
pub(super) fn deviation_of_turn(a: Complex<f64>, b: Complex<f64>, turn: f64) -> f64 {
    if turn.abs() > 1.0 {
        return f64::INFINITY;
    }
    // tan(x/2)/2 ≤ 0.2732 x for x up to 1.
    0.2732 * (b - a).norm_sqr().sqrt() * turn.abs()
}
