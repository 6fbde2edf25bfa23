//! The rear of a slice where inputs with more than two jumps may stay farther back.
//!
//! For each of some directions, a path is improved until it is extremal: its costate
//! tells in which parts of the horizon turning more moves the end farther along the
//! direction, and these get the highest rate, as many as the end heading asks for. As the
//! rear is where a concave function is least, each such change is a gain. Neighbours are
//! joined by the paths between them (headings interpolated), which are all admissible,
//! so that the whole is a curve like the others. Where the rear is hollow, the farthest along
//! a direction lies elsewhere, and nothing is gained.

use super::super::paths::{Paths, arc, unit};
use super::ridge::{PARTS, turns};
use super::search::Arc;
use crate::math::PI;
use nalgebra::Complex;

/// Directions looked into, from the right over the rear to the left.
const DIRECTIONS: usize = 48;

/// So far beyond right and left, rad.
const BEYOND: f64 = 0.4;

/// A path is improved at most this often.
const MOST_CHANGES: usize = 8;

/// Gains below this, s, are not worth another change.
const LEAST_GAIN: f64 = 1e-7;

/// A sequence of paths with one end heading, from the lowest to the highest.
pub(super) struct Jumps<'a> {
    paths: &'a Paths,
    parts: usize,
    /// Headings after each part, path by path.
    headings: Vec<f64>,
}

/// A path of the sequence, or between two: its place in the sequence, and its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    place: f64,
    point: Complex<f64>,
}

impl<'a> Jumps<'a> {
    /// Paths of `steps` steps whose heading is `above_low` more at the end than under the
    /// lowest rates.
    pub(super) fn new(paths: &'a Paths, steps: usize, above_low: f64) -> Self {
        let parts = steps * PARTS;
        let mut sequence = Self { paths, parts, headings: Vec::new() };
        let windows: Vec<Vec<f64>> = windows(paths, parts, above_low);
        let ends: Vec<Complex<f64>> = windows.iter().map(|path| sequence.end(path)).collect();
        let (lowest, highest) = (&windows[0], &windows[parts]);
        let least = lowest.iter().copied().fold(0.0, f64::min);
        let most = highest.iter().copied().fold(0.0, f64::max);
        let right = 0.5 * (least + most) - 0.5 * PI;

        sequence.headings.extend(lowest);
        let mut last = lowest.clone();
        for i in 0..=DIRECTIONS {
            let share = i as f64 / DIRECTIONS as f64;
            let normal = unit(right + BEYOND - (PI + 2.0 * BEYOND) * share);
            let along = |end: &Complex<f64>| (end * normal.conj()).re;
            let farthest = (0..ends.len())
                .max_by(|&a, &b| along(&ends[a]).total_cmp(&along(&ends[b])))
                .unwrap_or(0);
            let fresh = sequence.improve(windows[farthest].clone(), normal, above_low);
            let kept = sequence.improve(last, normal, above_low);
            last = if fresh.1 > kept.1 { fresh.0 } else { kept.0 };
            sequence.headings.extend(&last);
        }
        sequence.headings.extend(highest);
        sequence
    }

    /// Places of the paths in the sequence.
    pub(super) fn places(&self) -> impl Iterator<Item = f64> + Clone + use<> {
        (0..self.headings.len() / self.parts).map(|place| place as f64)
    }

    fn path(&self, place: usize) -> &[f64] {
        &self.headings[place * self.parts..][..self.parts]
    }

    /// Where a path ends.
    fn end(&self, headings: &[f64]) -> Complex<f64> {
        let mut end = Complex::new(0.0, 0.0);
        self.drive(headings.iter().copied(), |moved| end += moved);
        end
    }

    /// Tells the displacement in each part.
    fn drive(&self, headings: impl Iterator<Item = f64>, mut each: impl FnMut(Complex<f64>)) {
        let seconds = self.paths.step_s / PARTS as f64;
        let mut heading = 0.0;
        for next in headings {
            each(arc(heading, (next - heading) / seconds, seconds));
            heading = next;
        }
    }

    /// A path that ends farther along a direction, and how far that is.
    fn improve(&self, mut path: Vec<f64>, normal: Complex<f64>, above_low: f64) -> (Vec<f64>, f64) {
        let mut reached = f64::NEG_INFINITY;
        let mut moves = Vec::with_capacity(self.parts);
        for change in 0..=MOST_CHANGES {
            moves.clear();
            self.drive(path.iter().copied(), |moved| moves.push(moved * normal.conj()));
            reached = moves.iter().map(|moved| moved.re).sum();
            if change == MOST_CHANGES {
                break;
            }
            // Turning in a part moves what follows across the direction.
            let mut rest = 0.0;
            let mut gains: Vec<(f64, usize)> = Vec::with_capacity(self.parts);
            for (part, moved) in moves.iter().enumerate().rev() {
                gains.push((-(rest + 0.5 * moved.im), part));
                rest += moved.im;
            }
            gains.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut changed = vec![0.0; self.parts];
            let mut left = above_low;
            for (_, part) in gains {
                let (lo, hi) = turns(self.paths, part);
                let more = left.clamp(0.0, hi - lo);
                left -= more;
                changed[part] = lo + more;
            }
            let mut heading = 0.0;
            for turn in &mut changed {
                heading += *turn;
                *turn = heading;
            }
            let farther = (self.end(&changed) * normal.conj()).re;
            if farther <= reached + LEAST_GAIN {
                break;
            }
            path = changed;
        }
        (path, reached)
    }
}

/// The paths with one window of the lowest rates between highest ones, and of the highest
/// between lowest ones: the first is the lowest path, that after as many as there are
/// parts the highest.
fn windows(paths: &Paths, parts: usize, above_low: f64) -> Vec<Vec<f64>> {
    let (mut low, mut high) = (Vec::with_capacity(parts), Vec::with_capacity(parts));
    let mut heading = (0.0, 0.0);
    for part in 0..parts {
        let (lo, hi) = turns(paths, part);
        heading = (heading.0 + lo, heading.1 + hi);
        low.push(heading.0);
        high.push(heading.1);
    }
    let below_high = (heading.1 - heading.0 - above_low).max(0.0);
    let both = || low.iter().zip(&high);
    let mut windows: Vec<Vec<f64>> = Vec::with_capacity(2 * parts + 2);
    for i in 0..=parts {
        let from = above_low * (i as f64 / parts as f64);
        windows.push(both().map(|(l, h)| h - (h - l - from).clamp(0.0, below_high)).collect());
    }
    for i in 0..=parts {
        let from = below_high * (i as f64 / parts as f64);
        windows.push(both().map(|(l, h)| l + (h - l - from).clamp(0.0, above_low)).collect());
    }
    windows
}

impl Arc for Jumps<'_> {
    type Knot = Knot;

    fn knot(&self, place: f64) -> Knot {
        let first = (place as usize).min(self.headings.len() / self.parts - 2);
        let share = place - first as f64;
        let pairs = self.path(first).iter().zip(self.path(first + 1));
        let mut point = Complex::new(0.0, 0.0);
        self.drive(pairs.map(|(a, b)| a + share * (b - a)), |moved| point += moved);
        Knot { place, point }
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.place, knot.point)
    }

    /// Between neighbours the second derivative is at most ∫δ² for headings that
    /// differ by δ.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        let first = (a.place as usize).min(self.headings.len() / self.parts - 2);
        let seconds = self.paths.step_s / PARTS as f64;
        // Linear between, a square's mean is no more than that of its ends'.
        let apart =
            self.path(first).iter().zip(self.path(first + 1)).map(|(a, b)| (b - a) * (b - a));
        0.125 * (b.place - a.place) * (b.place - a.place) * seconds * apart.sum::<f64>()
    }
}
