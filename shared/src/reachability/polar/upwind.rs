//! The rate of change of a row's deficits, from upwind differences on each axis and from both
//! players' optimal turn rates.

use super::level::{Evader, Level, PAD};
use crate::math::TAU;
use crate::real::Real;

/// The time step of a cell.
pub(super) trait Pace<T>: Copy {
    /// The deficit `w` after the time step, if it changes by `rate` per second. Information travels
    /// `speeds` cells per second.
    fn moved(self, w: T, rate: T, speeds: T) -> T;
}

/// The same time step for all cells.
#[derive(Clone, Copy)]
pub(super) struct Seconds<T>(pub(super) T);

impl<T: Real> Pace<T> for Seconds<T> {
    #[inline(always)]
    fn moved(self, w: T, rate: T, _speeds: T) -> T {
        w + self.0 * rate
    }
}

/// Each cell's own largest stable time step, times this fraction.
#[derive(Clone, Copy)]
pub(super) struct Share<T>(pub(super) T);

impl<T: Real> Pace<T> for Share<T> {
    #[inline(always)]
    fn moved(self, w: T, rate: T, speeds: T) -> T {
        w + self.0 * rate / speeds
    }
}

impl<T: Real> Level<T> {
    /// Whether the evader can sometimes copy the pursuer's turn at less than its own full turn
    /// rate.
    pub(super) fn follows(&self) -> bool {
        let (evader, pursuer) = (self.game.evader, self.game.pursuer);
        pursuer.turn_rate_radps < evader.turn_rate_radps || self.shape.evader == Evader::Right
    }

    /// Advances row `k` of range node `i` by one time step and writes it to `moved`. The rows of
    /// this range are read from `slab`, the rows of neighbouring ranges from `self`. For `FOLLOWS`,
    /// see [`Self::follows`].
    #[inline(always)]
    pub(super) fn advance<const FOLLOWS: bool>(
        &self,
        slab: &[T],
        [i, k]: [usize; 2],
        pace: impl Pace<T>,
        moved: &mut [T],
    ) {
        let n = self.shape.angle_nodes;
        let f = T::from_f64;
        let (at, start) = (self.at(i, k), self.shape.at_bearing(k));
        let (along, across) = (self.shape.slab(), self.shape.row);
        let range_m = self.ranges[i];
        // Bearings and headings have the same nodes.
        let (sin_a, cos_a) = (self.sin[k], self.cos[k]);
        let (evader, pursuer) = (self.game.evader, self.game.pursuer);
        let (evader_speed, pursuer_speed) = (f(evader.speed_mps), f(pursuer.speed_mps));
        let (evader_ahead, evader_aside) = (evader_speed * cos_a, evader_speed * sin_a);
        let (ahead_cos, ahead_sin) = (pursuer_speed * cos_a, pursuer_speed * sin_a);
        let (evader_turn, pursuer_turn) = (f(evader.turn_rate_radps), f(pursuer.turn_rate_radps));
        let evader_left = if self.shape.evader == Evader::Free { evader_turn } else { T::ZERO };
        // V ≥ −R, so W ≥ −r.
        let lowest = f(-range_m);
        let per_range = f(1.0 / range_m);
        let per_step = f(self.per_range_m(i));
        let per_angle = f(n as f64 / TAU);
        let (zero, one) = (T::ZERO, f(1.0));

        let beyond = |offset: usize| &self.values[offset + PAD..][..n];
        let row = |offset: usize| &slab[offset + PAD..][..n];
        let own = &slab[start..][..n + 2 * PAD];
        let (own0, own1, own2, own3, own4) =
            (&own[..n], &own[1..][..n], &own[2..][..n], &own[3..][..n], &own[4..][..n]);
        let (in2, in1) = (beyond(at - 2 * along), beyond(at - along));
        let (out1, out2) = (beyond(at + along), beyond(at + 2 * along));
        let (right2, right1) = (row(start - 2 * across), row(start - across));
        let (left1, left2) = (row(start + across), row(start + 2 * across));
        let (sin, cos) = (&self.sin[..n], &self.cos[..n]);
        let moved = &mut moved[..n];
        for j in 0..n {
            let w = own2[j];
            let (range_in, range_out) = one_sided(in2[j], in1[j], w, out1[j], out2[j]);
            let (bearing_in, bearing_out) = one_sided(right2[j], right1[j], w, left1[j], left2[j]);
            let (heading_in, heading_out) = one_sided(own0[j], own1[j], w, own3[j], own4[j]);
            let opening = ahead_cos * cos[j] + ahead_sin * sin[j] - evader_ahead;
            let slope = if opening > zero { range_out } else { range_in };
            let drift = (evader_aside + ahead_cos * sin[j] - ahead_sin * cos[j]) * per_range;
            let upwind = |speed: T, low: T, high: T| speed * if speed > zero { high } else { low };
            // The rate is piecewise linear in a. Its maximum is therefore at an end of a's range,
            // or where the bearing or the heading is constant.
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
            let later = pace.moved(w, rate, speeds);
            // This order of comparison preserves NaN, which is rejected at the end.
            moved[j] = lowest.larger(zero.smaller(later));
        }
    }

    /// Nodes per metre of range at range node `i`.
    pub(super) fn per_range_m(&self, i: usize) -> f64 {
        1.0 / ((self.ranges[i] + self.range.knee_m) * self.range.step)
    }

    /// For a sheet: where the full game `full` is safe, raises `moved` to at least the values of
    /// `full`. `spare` is a buffer for a row.
    #[inline(always)]
    pub(super) fn keep_safe(
        &self,
        full: &Self,
        [i, k]: [usize; 2],
        moved: &mut [T],
        spare: &mut [T],
    ) {
        let safe = T::from_f64(-SAFE * self.game.radius_m);
        full.copy_row(i, k, spare);
        for (new, floor) in moved.iter_mut().zip(spare.iter()) {
            *new = if *floor > safe { new.larger(*floor) } else { *new };
        }
    }
}

/// A deficit whose magnitude is below this fraction of the radius counts as zero. The evader is
/// then *safe*, because it can keep the range from decreasing.
pub(super) const SAFE: f64 = 1.0 / 3000.0;

/// Undivided left and right differences at the middle of five values. They are third-order accurate
/// where the data are smooth, and similar to ENO2 elsewhere.
#[inline(always)]
fn one_sided<T: Real>(a: T, b: T, c: T, d: T, e: T) -> (T, T) {
    let (d0, d1, d2, d3) = (b - a, c - b, d - c, e - d);
    let (low, middle, high) = (d1 - d0, d2 - d1, d3 - d2);
    let third = T::from_f64(1.0 / 3.0);
    let two = T::from_f64(2.0);
    // (outer + 2 inner)/3 gives third order. Its magnitude is limited to twice the smaller of
    // |outer| and |inner|.
    let limited = |outer: T, inner: T| {
        let bound = two * if outer.abs() < inner.abs() { outer } else { inner };
        let wanted = (outer + two * inner) * third;
        if wanted.abs() > bound.abs() { bound } else { wanted }
    };
    (d1 + T::HALF * limited(low, middle), d2 - T::HALF * limited(high, middle))
}
