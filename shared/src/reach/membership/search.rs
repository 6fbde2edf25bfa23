//! How near a curve comes to a position, and how it winds about it, from as few
//! of its points as decide that.

use nalgebra::Complex;

/// A curve that is known point by point, and how well chords follow it.
pub(super) trait Arc {
    /// A point of the curve, with what is needed to tell the deviation.
    type Knot: Copy;

    /// The point at a parameter.
    fn knot(&self, parameter: f64) -> Self::Knot;

    /// Parameter and point of a knot.
    fn place(knot: Self::Knot) -> (f64, Complex<f64>);

    /// How far the curve between two knots may be from their chord.
    fn deviation(&self, a: Self::Knot, b: Self::Knot) -> f64;
}

/// What is known about the curves looked at so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    position: Complex<f64>,
    /// The distance found, if below what was of interest.
    pub(super) distance: f64,
    /// The parameter where it was found, nearly.
    pub(super) nearest: f64,
    /// No nearer point need be found than one at this distance.
    enough: f64,
    /// How often the curve passes the ray to the right of the position, upward
    /// less downward. Meaningless once `found`.
    pub(super) crossings: i32,
}

/// Chords that follow the curve so closely, s, are taken for it.
const EXACT: f64 = 2e-7;

/// A parameter range is halved at most this often.
const MOST_HALVINGS: u32 = 48;

impl Search {
    /// Distances from `reach` on are of no interest.
    pub(super) fn new(position: Complex<f64>, enough: f64, reach: f64) -> Self {
        Self { position, distance: reach, nearest: f64::NAN, enough, crossings: 0 }
    }

    /// Whether a point near enough was found.
    pub(super) fn found(&self) -> bool {
        self.distance <= self.enough
    }

    /// Follows a curve through the parameters given, in their order.
    pub(super) fn follow<A: Arc>(&mut self, arc: &A, parameters: impl IntoIterator<Item = f64>) {
        let mut last: Option<A::Knot> = None;
        for parameter in parameters {
            let knot = self.look(arc, parameter);
            if let Some(last) = last {
                self.between(arc, last, knot, MOST_HALVINGS);
            }
            if self.found() {
                return;
            }
            last = Some(knot);
        }
    }

    /// The winding of the short way between two points that mean the same, one of them rounded.
    pub(super) fn join(&mut self, from: Complex<f64>, to: Complex<f64>) {
        self.crossings += crossing(self.position, from, to);
    }

    fn look<A: Arc>(&mut self, arc: &A, parameter: f64) -> A::Knot {
        let knot = arc.knot(parameter);
        let away = (A::place(knot).1 - self.position).norm_sqr();
        if away < self.distance * self.distance {
            (self.distance, self.nearest) = (away.sqrt(), parameter);
        }
        knot
    }

    fn between<A: Arc>(&mut self, arc: &A, a: A::Knot, b: A::Knot, halvings: u32) {
        let ((from, start), (to, end)) = (A::place(a), A::place(b));
        let deviation = arc.deviation(a, b);
        let (distance, share) = to_segment(self.position, start, end);
        // Off the curve and its chord and all between, they wind alike.
        let clear = distance > deviation && distance - deviation >= self.distance;
        if clear || deviation <= EXACT || halvings == 0 {
            if distance < self.distance {
                (self.distance, self.nearest) = (distance, from + share * (to - from));
            }
            self.crossings += crossing(self.position, start, end);
            return;
        }
        let middle = self.look(arc, 0.5 * (from + to));
        for (a, b) in [(a, middle), (middle, b)] {
            if self.found() {
                return;
            }
            self.between(arc, a, b, halvings - 1);
        }
    }
}

/// Distance of a position from a segment, and where on it that is, from 0 to 1.
fn to_segment(position: Complex<f64>, start: Complex<f64>, end: Complex<f64>) -> (f64, f64) {
    let (chord, from) = (end - start, position - start);
    let length = chord.norm_sqr();
    let along = (from * chord.conj()).re;
    let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    ((from - chord * share).norm_sqr().sqrt(), share)
}

/// Whether the segment passes the ray to the right of the position: 1 upward,
/// −1 downward.
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
