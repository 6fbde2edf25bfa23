//! Gauss–Seidel sweeps over the rows of a grid. Most of a solve's time is spent here.

use super::level::{Evader, Level, PAD};
use super::upwind::Share;
use crate::parallel::{Kernel, in_widest_lanes};
use crate::real::Real;
use core::ops::ControlFlow;

/// Number of sweeps between two measurements of the drift.
pub const WINDOW: usize = 16;

/// One pass over all rows.
pub(super) struct Sweep<'a, T> {
    pub(super) level: &'a mut Level<T>,
    /// A row is skipped if no row in its stencil changed by more than this at its last update.
    pub(super) rest: T,
    /// For a sheet: the full game. Where it is safe, its values are lower bounds of the sheet's
    /// values.
    pub(super) full: Option<&'a Level<T>>,
}

impl<T: Real> Kernel for Sweep<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { level, rest, full } = self;
        let (ranges, bearings) = (level.range.nodes, level.bearings());
        // Information mostly travels outwards, so only every eighth sweep goes inwards.
        let inwards = level.sweeps % 8 == 7;
        let backwards = level.sweeps % 2 == 1;
        let n = level.shape.angle_nodes;
        let follows = level.follows();
        let mut scratch = vec![T::ZERO; 2 * n];
        let (buffer, floor) = scratch.split_at_mut(n);
        for i in 1..ranges {
            let i = if inwards { ranges - i } else { i };
            for k in 0..bearings {
                let k = if backwards { bearings - 1 - k } else { k };
                let change = if level.is_active(i, k, rest) {
                    let scratch = [&mut *buffer, &mut *floor];
                    if follows {
                        level.update::<true>(i, k, full, scratch)
                    } else {
                        level.update::<false>(i, k, full, scratch)
                    }
                } else {
                    T::ZERO
                };
                level.activity[i * bearings + k] = change;
            }
        }
        level.sweeps += 1;
    }
}

impl<T: Real> Level<T> {
    /// Sweeps until the mean drift of the rows is at most `tolerance` (m), or `most_sweeps` ≥ 1
    /// sweeps are done. `report` receives the drift and the number of sweeps, and can cancel the
    /// solve.
    pub(super) fn converge(
        &mut self,
        tolerance: f64,
        most_sweeps: usize,
        report: &mut dyn FnMut(f64, usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        while self.sweeps < most_sweeps && self.drift_m > tolerance {
            in_widest_lanes(Sweep { level: self, rest: T::from_f64(tolerance), full: None });
            if self.sweeps.is_multiple_of(WINDOW) {
                self.drift_m = self.mean_drift_m();
                self.drift.fill(T::ZERO);
            }
            report(self.drift_m, self.sweeps)?;
        }
        self.converged = self.drift_m <= tolerance;
        if self.drift_m.is_infinite() {
            // There were fewer sweeps than a window, so the drift is extrapolated to a whole
            // window.
            self.drift_m = self.mean_drift_m() * WINDOW as f64 / self.sweeps as f64;
        }
        ControlFlow::Continue(())
    }

    /// The magnitude of each row's mean signed change since the last measurement, averaged over the
    /// rows.
    fn mean_drift_m(&self) -> f64 {
        let sum: f64 = self.drift.iter().map(|drift| drift.abs().to_f64()).sum();
        sum / (self.drift.len() * self.shape.angle_nodes) as f64
    }

    /// Whether any row in a row's stencil changed by more than `rest` at its last update.
    fn is_active(&self, i: usize, k: usize, rest: T) -> bool {
        let bearings = self.bearings();
        let moved = |i: usize, k: usize| self.activity[i * bearings + k] > rest;
        let near = |at: usize, end: usize| at.saturating_sub(PAD)..(at + PAD + 1).min(end);
        let wraps = self.shape.evader == Evader::Right;
        near(i, self.range.nodes).any(|i| moved(i, k))
            || near(k, bearings).any(|k| moved(i, k))
            || wraps && k < PAD && (bearings + k - PAD..bearings).any(|k| moved(i, k))
            || wraps && k + PAD >= bearings && (0..=k + PAD - bearings).any(|k| moved(i, k))
    }

    /// Advances the cells of one row by their own time steps and returns the largest change. For
    /// `FOLLOWS`, see [`Self::follows`].
    #[inline(always)]
    fn update<const FOLLOWS: bool>(
        &mut self,
        i: usize,
        k: usize,
        full: Option<&Self>,
        [buffer, floor]: [&mut [T]; 2],
    ) -> T {
        let (n, at) = (self.shape.angle_nodes, self.at(i, k));
        self.advance::<FOLLOWS>(self.slab(i), [i, k], Share(T::from_f64(CFL)), buffer);
        if let Some(full) = full {
            self.keep_safe(full, [i, k], buffer, floor);
        }
        let old = &self.values[at + PAD..][..n];
        let mut largest = T::ZERO;
        let (mut most, mut totals) = ([T::ZERO; LANES], [T::ZERO; LANES]);
        for (new, old) in buffer.chunks(LANES).zip(old.chunks(LANES)) {
            match (new.first_chunk(), old.first_chunk()) {
                (Some(new), Some(old)) => tally(new, old, &mut most, &mut totals),
                _ => tally(&padded(new), &padded(old), &mut most, &mut totals),
            }
        }
        let bearings = self.bearings();
        let drift = &mut self.drift[i * bearings + k];
        for (most, total) in most.into_iter().zip(totals) {
            largest = largest.larger(most);
            *drift += total;
        }
        self.values[at + PAD..][..n].copy_from_slice(buffer);
        self.spread(i, k);
        largest
    }
}

/// Number of single-precision cells in the widest SIMD register.
const LANES: usize = 16;

/// Adds each lane's change to `totals`, and keeps the largest magnitude in `most`.
#[inline(always)]
fn tally<T: Real>(
    new: &[T; LANES],
    old: &[T; LANES],
    most: &mut [T; LANES],
    totals: &mut [T; LANES],
) {
    for lane in 0..LANES {
        let moved = new[lane] - old[lane];
        totals[lane] += moved;
        most[lane] = most[lane].larger(moved.abs());
    }
}

/// Pads an incomplete group of cells with zeros.
fn padded<T: Real>(cells: &[T]) -> [T; LANES] {
    let mut lanes = [T::ZERO; LANES];
    lanes[..cells.len()].copy_from_slice(cells);
    lanes
}

/// CFL number: the time step as a fraction of the largest stable time step. From about 0.8 on,
/// sweeps no longer converge.
pub(super) const CFL: f64 = 0.6;
