//! Paths with a constant turn rate in each quarter of a step.

use super::super::paths::{Paths, Turn, unit};
use super::span::Span;
use nalgebra::Complex;

/// Number of parts of a step.
pub(super) const PARTS: usize = 4;

/// The steps from the first to the last one in which the bounds leave a choice, divided into parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts<'a> {
    paths: &'a Paths,
    first: usize,
    /// Number of parts.
    pub(super) count: usize,
    /// Duration of a part (s).
    pub(super) seconds: f64,
    /// Heading and position at the beginning of the first part.
    pub(super) heading: f64,
    point: Complex<f64>,
    /// Heading at the end of the last part.
    pub(super) end_heading: f64,
    /// The displacement after the last part.
    rest: Complex<f64>,
}

impl<'a> Parts<'a> {
    pub(super) fn new(span: Span<'a>) -> Self {
        let (paths, low) = (span.paths, &span.paths.low);
        let end_heading = span.last_heading();
        let rest = low.point(span.steps) - low.point(span.last);
        Self {
            paths,
            first: span.first,
            count: (span.last - span.first) * PARTS,
            seconds: paths.step_s / PARTS as f64,
            heading: low.heading(span.first),
            point: low.point(span.first),
            end_heading,
            rest: unit(end_heading - low.heading(span.last)) * rest,
        }
    }

    /// Lowest and highest turn in a part (rad).
    pub(super) fn turns(&self, part: usize) -> (f64, f64) {
        let step = self.first + part / PARTS;
        (self.paths.lo[step] * self.seconds, self.paths.hi[step] * self.seconds)
    }

    /// The end of the path with these headings after each part. Calls `each` with the displacement in
    /// each part.
    pub(super) fn drive(
        &self,
        headings: impl Iterator<Item = f64>,
        mut each: impl FnMut(Complex<f64>),
    ) -> Complex<f64> {
        let (mut heading, mut point) = (self.heading, self.point);
        let mut facing = unit(heading);
        for next in headings {
            let turn = Turn::new((next - heading) / self.seconds, self.seconds);
            let moved = facing * turn.moved;
            each(moved);
            point += moved;
            facing *= turn.turned;
            heading = next;
        }
        point + self.rest
    }

    /// Like [`Self::drive`], but also writes the midpoint of each part's chord to `middles`.
    pub(super) fn drive_between(
        &self,
        headings: impl Iterator<Item = f64>,
        middles: &mut [Complex<f64>],
    ) -> Complex<f64> {
        let (mut point, mut part) = (self.point, 0);
        self.drive(headings, |moved| {
            middles[part] = point + 0.5 * moved;
            point += moved;
            part += 1;
        })
    }
}
