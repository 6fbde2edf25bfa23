//! The value for a finite horizon. All cells advance by the same time, in Euler steps that start
//! from V = r − R.

use super::kink::SHEET_SWEEPS;
use super::level::{Level, PAD};
use super::sweep::{CFL, WINDOW};
use super::upwind::Seconds;
use crate::math::{TAU, hypot};
use crate::parallel::{Kernel, Workers, in_widest_lanes};
use crate::real::Real;
use core::ops::ControlFlow;

/// At ranges below this fraction of the radius, a time step is divided into several parts, because
/// bearings change quickly there. The values at these ranges affect only values at even smaller
/// ranges.
const INNER: f64 = 0.3;

/// The time steps of all cells, and the number of parts into which each slab divides a step.
struct Steps<T> {
    count: usize,
    seconds: T,
    /// For each range node, the number of parts.
    parts: Vec<usize>,
    /// Number of steps at the end of the march in which the sheet is advanced too. They are enough
    /// for information to cross a few cells everywhere.
    with_sheet: usize,
}

impl<T: Real> Level<T> {
    /// Advances the deficit, which is initially 0, by `horizon_s`, and returns the sheet. `report`
    /// receives the largest rate of change of V at the last measurement (m/s) and the fraction
    /// done, and can cancel the march.
    pub(super) fn march(
        &mut self,
        horizon_s: f64,
        workers: &Workers,
        report: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> ControlFlow<(), Self> {
        let steps = self.steps(horizon_s);
        let mut next = self.values.clone();
        let mut sheet = None;
        for step in 1..=steps.count {
            if steps.count - step < steps.with_sheet && sheet.is_none() {
                let begun = self.right_copy();
                sheet = Some((begun.values.clone(), begun));
            }
            self.step(&steps, None, workers, &mut next);
            if let Some((next, sheet)) = &mut sheet {
                sheet.step(&steps, Some(self), workers, next);
            }
            if step % WINDOW == 1 || step == steps.count {
                let changes = self.values.iter().zip(&next).map(|(new, old)| (*new - *old).abs());
                let largest = changes.fold(T::ZERO, |largest, change| largest.larger(change));
                self.drift_m = largest.to_f64() / steps.seconds.to_f64();
            }
            report(self.drift_m, step as f64 / steps.count as f64)?;
        }
        (self.sweeps, self.converged) = (steps.count, true);
        match sheet {
            Some((_, sheet)) => ControlFlow::Continue(sheet),
            None => unreachable!("there is at least one step"),
        }
    }

    /// Number of steps for a horizon.
    pub(super) fn steps_of(&self, horizon_s: f64) -> f64 {
        (horizon_s * self.fastest_outside() / CFL).ceil().max(1.0)
    }

    /// The largest speed of information (cells per second) at the ranges where a time step is not
    /// divided.
    fn fastest_outside(&self) -> f64 {
        let inner = INNER * self.game.radius_m;
        let outer = (1..self.range.nodes).filter(|i| self.ranges[*i] >= inner);
        outer.map(|i| self.fastest(i)).fold(0.0, f64::max)
    }

    fn steps(&self, horizon_s: f64) -> Steps<T> {
        let speeds: Vec<f64> = (1..self.range.nodes).map(|i| self.fastest(i)).collect();
        let slowest = speeds.iter().copied().fold(f64::INFINITY, f64::min);
        let count = self.steps_of(horizon_s);
        let fastest = self.fastest_outside();
        let parts = speeds.iter().map(|speed| (speed / fastest).ceil() as usize);
        Steps {
            count: count as usize,
            seconds: T::from_f64(horizon_s / count),
            parts: core::iter::once(1).chain(parts).collect(),
            with_sheet: (SHEET_SWEEPS as f64 * fastest / slowest).ceil() as usize,
        }
    }

    /// The largest speed of information (cells per second) at range node `i`.
    fn fastest(&self, i: usize) -> f64 {
        let (evader, pursuer) = (self.game.evader, self.game.pursuer);
        let per_angle = self.shape.angle_nodes as f64 / TAU;
        let turns = 2.0 * evader.turn_rate_radps + pursuer.turn_rate_radps;
        let closing = evader.speed_mps + pursuer.speed_mps;
        // The relative speed is at most `closing`.
        closing * hypot(self.per_range_m(i), per_angle / self.ranges[i]) + turns * per_angle
    }

    /// Advances all cells by one step. Afterwards `next` contains the old values.
    fn step(
        &mut self,
        steps: &Steps<T>,
        full: Option<&Self>,
        workers: &Workers,
        next: &mut Vec<T>,
    ) {
        let shape = self.shape;
        let last = shape.at_range(self.range.nodes - 1);
        let inside = &mut next[shape.at_range(1)..last + shape.slab()];
        let level = &*self;
        workers.for_chunks(inside, shape.slab(), |chunk, out| {
            in_widest_lanes(Slab { level, steps, full, i: chunk + 1, out });
        });
        // Beyond the last range the deficit is constant.
        for ghost in 1..=PAD {
            next.copy_within(last..last + shape.slab(), last + ghost * shape.slab());
        }
        core::mem::swap(&mut self.values, next);
    }

    /// Advances `slab`, the slab of range node `i`, by `seconds` and writes it to `out`.
    #[inline(always)]
    fn advance_slab<const FOLLOWS: bool>(
        &self,
        slab: &[T],
        i: usize,
        seconds: T,
        full: Option<&Self>,
        out: &mut [T],
    ) {
        let n = self.shape.angle_nodes;
        let mut spare = vec![T::ZERO; if full.is_some() { n } else { 0 }];
        for k in 0..self.bearings() {
            let at = self.shape.at_bearing(k) + PAD;
            let row = &mut out[at..at + n];
            self.advance::<FOLLOWS>(slab, [i, k], Seconds(seconds), row);
            if let Some(full) = full {
                self.keep_safe(full, [i, k], row, &mut spare);
            }
            self.shape.spread(out, k);
        }
    }
}

/// The cells of one range in one step.
struct Slab<'a, T> {
    level: &'a Level<T>,
    steps: &'a Steps<T>,
    full: Option<&'a Level<T>>,
    i: usize,
    out: &'a mut [T],
}

impl<T: Real> Kernel for Slab<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { level, steps, full, i, out } = self;
        let parts = steps.parts[i];
        let seconds = steps.seconds / T::from_f64(parts as f64);
        // Where a step is divided, information travels much more slowly along the range than along
        // the bearing. The values at neighbouring ranges are therefore not updated between the
        // parts.
        let mut before = Vec::new();
        for part in 0..parts {
            let slab = if part == 0 {
                level.slab(i)
            } else {
                before.clear();
                before.extend_from_slice(out);
                &before
            };
            if level.follows() {
                level.advance_slab::<true>(slab, i, seconds, full, out);
            } else {
                level.advance_slab::<false>(slab, i, seconds, full, out);
            }
        }
    }
}
