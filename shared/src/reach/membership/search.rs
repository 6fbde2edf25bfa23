//! The distance of a curve from a position, and how the curve winds about it, from as few of its
//! points as possible.

use super::super::budget::Budget;
use super::super::sampling::to_segment;
use nalgebra::Complex;

/// A curve whose points can be computed one by one, with a bound on how far it is from chords.
pub(super) trait Arc {
    /// A point of the curve, with the data for the bound.
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

/// The result for the curves followed so far; meaningless once the budget is spent.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    budget: &'a Budget<'a>,
    position: Complex<f64>,
    /// The smallest distance found, or the reach if none is below it.
    pub(super) distance: f64,
    /// The approximate parameter and the point where it was found.
    pub(super) nearest: f64,
    pub(super) point: Complex<f64>,
    /// The search ends when a point at this distance or nearer is found.
    enough: f64,
    /// How often the curves cross the ray to the right of the position, upward
    /// minus downward. Meaningless once `found`.
    pub(super) crossings: i32,
}

/// A chord that follows the curve this closely, s, replaces it.
const EXACT: f64 = 2e-7;

/// A parameter range is halved at most this often.
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

    /// Whether a point near enough was found.
    pub(super) fn found(&self) -> bool {
        self.distance <= self.enough
    }

    /// Whether the search is over.
    fn ends(&self) -> bool {
        self.found() || self.budget.is_spent()
    }

    /// Follows a curve through the parameters given, in their order.
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

    /// Adds the crossing of the gap between two points that differ by rounding.
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
        // The position is outside the region between curve and chord: both cross the ray alike.
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

/// Whether the segment crosses the ray to the right of the position: 1 upward,
/// −1 downward, else 0.
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

/// How far a curve that turns one way only, by `turn` rad, may be from its chord.
pub(super) fn deviation_of_turn(a: Complex<f64>, b: Complex<f64>, turn: f64) -> f64 {
    if turn.abs() > 1.0 {
        return f64::INFINITY;
    }
    // tan(x/2)/2 ≤ 0.2732 x up to x = 1.
    0.2732 * (b - a).norm_sqr().sqrt() * turn.abs()
}
