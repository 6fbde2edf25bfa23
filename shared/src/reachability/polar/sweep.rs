//! Gauss–Seidel sweeps over the rows of a grid. Most of a solve's time is spent here.

use super::level::{Evader, Level, PAD};
use crate::math::TAU;
use crate::parallel::{Kernel, in_widest_lanes};
use crate::real::Real;
use core::ops::ControlFlow;

/// A deficit up to this share of the radius counts as zero: the range need not close.
pub(super) const SAFE: f64 = 1.0 / 3000.0;

/// Sweeps between two measurements of the drift.
pub const WINDOW: usize = 16;

/// One pass over all rows.
pub(super) struct Sweep<'a, T> {
    pub(super) level: &'a mut Level<T>,
    /// A row is skipped while nothing in its stencil changes by more than this.
    pub(super) rest: T,
    /// For a sheet: the full game, whose values it takes where that game is safe.
    pub(super) full: Option<&'a Level<T>>,
}

impl<T: Real> Kernel for Sweep<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { level, rest, full } = self;
        let (ranges, bearings) = (level.range.nodes, level.bearings());
        // Information mostly flows from small ranges outwards.
        let inwards = level.sweeps % 8 == 7;
        let backwards = level.sweeps % 2 == 1;
        let n = level.angle_nodes;
        let (evader, pursuer) = (level.game.evader, level.game.pursuer);
        let follows =
            pursuer.turn_rate_radps < evader.turn_rate_radps || level.evader == Evader::Right;
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
    /// Sweeps until the mean drift of the rows is at most `tolerance`, m, or `most_sweeps` ≥ 1 are
    /// done. `report` gets the drift and the number of sweeps, and may stop it.
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
            // Fewer sweeps than a window: what a whole one would move at the same rate.
            self.drift_m = self.mean_drift_m() * WINDOW as f64 / self.sweeps as f64;
        }
        ControlFlow::Continue(())
    }

    /// The magnitude of what each row moved since the last look, averaged over cells and rows.
    fn mean_drift_m(&self) -> f64 {
        let sum: f64 = self.drift.iter().map(|drift| drift.abs().to_f64()).sum();
        sum / (self.drift.len() * self.angle_nodes) as f64
    }

    /// Whether anything in the stencil of a row changed at its last update.
    fn is_active(&self, i: usize, k: usize, rest: T) -> bool {
        let bearings = self.bearings();
        let moved = |i: usize, k: usize| self.activity[i * bearings + k] > rest;
        let near = |at: usize, end: usize| at.saturating_sub(PAD)..(at + PAD + 1).min(end);
        let wraps = self.evader == Evader::Right;
        near(i, self.range.nodes).any(|i| moved(i, k))
            || near(k, bearings).any(|k| moved(i, k))
            || wraps && k < PAD && (bearings + k - PAD..bearings).any(|k| moved(i, k))
            || wraps && k + PAD >= bearings && (0..=k + PAD - bearings).any(|k| moved(i, k))
    }

    /// Moves one row by its cells' own time steps; returns the largest change. `FOLLOWS`:
    /// the evader may copy the pursuer's turn without turning as fast as it can.
    #[inline(always)]
    fn update<const FOLLOWS: bool>(
        &mut self,
        i: usize,
        k: usize,
        full: Option<&Self>,
        [buffer, floor]: [&mut [T]; 2],
    ) -> T {
        let n = self.angle_nodes;
        let f = T::from_f64;
        let at = self.at(i, k);
        let (along, across) = (self.rows * self.row, self.row);
        let range_m = self.ranges[i];
        // Bearings and headings have the same nodes.
        let (sin_a, cos_a) = (self.sin[k], self.cos[k]);
        let (evader, pursuer) = (self.game.evader, self.game.pursuer);
        let (evader_speed, pursuer_speed) = (f(evader.speed_mps), f(pursuer.speed_mps));
        let (evader_ahead, evader_aside) = (evader_speed * cos_a, evader_speed * sin_a);
        let (ahead_cos, ahead_sin) = (pursuer_speed * cos_a, pursuer_speed * sin_a);
        let (evader_turn, pursuer_turn) = (f(evader.turn_rate_radps), f(pursuer.turn_rate_radps));
        let evader_left = if self.evader == Evader::Free { evader_turn } else { T::ZERO };
        // V is at least −R.
        let lowest = f(-range_m);
        let per_range = f(1.0 / range_m);
        let per_step = f(1.0 / ((range_m + self.range.knee_m) * self.range.step));
        let per_angle = f(n as f64 / TAU);
        let (zero, one, cfl) = (T::ZERO, f(1.0), f(CFL));

        let row = |offset: usize| &self.values[offset + PAD..][..n];
        let own = &self.values[at..][..n + 2 * PAD];
        let (own0, own1, own2, own3, own4) =
            (&own[..n], &own[1..][..n], &own[2..][..n], &own[3..][..n], &own[4..][..n]);
        let (in2, in1) = (row(at - 2 * along), row(at - along));
        let (out1, out2) = (row(at + along), row(at + 2 * along));
        let (right2, right1) = (row(at - 2 * across), row(at - across));
        let (left1, left2) = (row(at + across), row(at + 2 * across));
        let (sin, cos) = (&self.sin[..n], &self.cos[..n]);
        let (buffer, floor) = (&mut buffer[..n], &mut floor[..n]);
        let mut largest = zero;
        let (mut most, mut totals) = ([zero; LANES], [zero; LANES]);
        for j in 0..n {
            let w = own2[j];
            let (range_in, range_out) = one_sided(in2[j], in1[j], w, out1[j], out2[j]);
            let (bearing_in, bearing_out) = one_sided(right2[j], right1[j], w, left1[j], left2[j]);
            let (heading_in, heading_out) = one_sided(own0[j], own1[j], w, own3[j], own4[j]);
            let opening = ahead_cos * cos[j] + ahead_sin * sin[j] - evader_ahead;
            let slope = if opening > zero { range_out } else { range_in };
            let drift = (evader_aside + ahead_cos * sin[j] - ahead_sin * cos[j]) * per_range;
            let upwind = |speed: T, low: T, high: T| speed * if speed > zero { high } else { low };
            // Linear in a between its ends and the values at which an angle is constant.
            let answer = |b: T| {
                let with = |a: T| {
                    upwind(drift - a, bearing_in, bearing_out)
                        + upwind(b - a, heading_in, heading_out)
                };
                let clip = |a: T| a.smaller(evader_turn).larger(-evader_left);
                with(evader_turn)
                    .larger(with(-evader_left))
                    .larger(with(clip(drift)))
                    .larger(if FOLLOWS { with(clip(b)) } else { with(evader_turn) })
            };
            let turning = answer(pursuer_turn).smaller(answer(-pursuer_turn));
            let rate = opening * (one + slope * per_step) + turning * per_angle;
            let speeds = opening.abs() * per_step
                + (drift.abs() + evader_turn + evader_turn + pursuer_turn) * per_angle;
            let moved = w + cfl * rate / speeds;
            // This order of comparison preserves NaN, which is refused at the end.
            let moved = lowest.larger(zero.smaller(moved));
            buffer[j] = moved;
        }
        if let Some(full) = full {
            let safe = f(-SAFE * self.game.radius_m);
            full.copy_row(i, k, floor);
            for (new, floor) in buffer.iter_mut().zip(floor.iter()) {
                *new = if *floor > safe { new.larger(*floor) } else { *new };
            }
        }
        for (new, old) in buffer.chunks(LANES).zip(own2.chunks(LANES)) {
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

/// Cells in the widest lanes, in single precision.
const LANES: usize = 16;

/// Adds each lane's change to `totals`, and keeps the largest.
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

/// Fewer cells than lanes, filled up with zeros.
fn padded<T: Real>(cells: &[T]) -> [T; LANES] {
    let mut lanes = [T::ZERO; LANES];
    lanes[..cells.len()].copy_from_slice(cells);
    lanes
}

/// Share of the stable time step. From about 0.8 on, sweeps no longer converge.
const CFL: f64 = 0.6;

/// Left and right differences (undivided) at the middle of five values: third order where the data are
/// smooth, as ENO2 elsewhere.
#[inline(always)]
fn one_sided<T: Real>(a: T, b: T, c: T, d: T, e: T) -> (T, T) {
    let (d0, d1, d2, d3) = (b - a, c - b, d - c, e - d);
    let (low, middle, high) = (d1 - d0, d2 - d1, d3 - d2);
    let third = T::from_f64(1.0 / 3.0);
    let two = T::from_f64(2.0);
    // (outer + 2 inner)/3 is third order; it is limited to twice the smaller of both.
    let limited = |outer: T, inner: T| {
        let bound = two * if outer.abs() < inner.abs() { outer } else { inner };
        let wanted = (outer + two * inner) * third;
        if wanted.abs() > bound.abs() { bound } else { wanted }
    };
    (d1 + T::HALF * limited(low, middle), d2 - T::HALF * limited(high, middle))
}
