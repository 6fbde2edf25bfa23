//! The steps with a choice, cut into parts, and paths that turn at one rate in each.

use super::super::paths::{Paths, Turn, unit};
use super::slice::Slice;
use nalgebra::Complex;

/// Parts of a step.
pub(super) const PARTS: usize = 4;

/// The parts of a slice's steps with a choice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts<'a> {
    paths: &'a Paths,
    first: usize,
    /// How many there are.
    pub(super) count: usize,
    /// Length of a part, s.
    pub(super) seconds: f64,
    /// Heading and position where the first part begins.
    pub(super) heading: f64,
    point: Complex<f64>,
    /// Heading where the last part ends.
    pub(super) end_heading: f64,
    /// What is driven afterwards.
    rest: Complex<f64>,
}

impl<'a> Parts<'a> {
    pub(super) fn new(slice: &Slice<'a>) -> Self {
        let (paths, low) = (slice.paths, &slice.paths.low);
        let end_heading = slice.last_heading();
        let rest = low.point(slice.steps) - low.point(slice.last);
        Self {
            paths,
            first: slice.first,
            count: (slice.last - slice.first) * PARTS,
            seconds: paths.step_s / PARTS as f64,
            heading: low.heading(slice.first),
            point: low.point(slice.first),
            end_heading,
            rest: unit(end_heading - low.heading(slice.last)) * rest,
        }
    }

    /// Least and greatest turn in a part, rad.
    pub(super) fn turns(&self, part: usize) -> (f64, f64) {
        let step = self.first + part / PARTS;
        (self.paths.lo[step] * self.seconds, self.paths.hi[step] * self.seconds)
    }

    /// Where a path with these headings after each part ends. `each` is told the
    /// displacement in each part.
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

    /// The same; fills in where the middle of each part is.
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
