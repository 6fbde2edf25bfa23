//! Represents the kink of V, where left and right turns are equally good for the evader, as the
//! maximum of two smooth sheets.

use super::Solution;
use super::level::{Evader, Level, PAD};
use super::sweep::Sweep;
use super::upwind::SAFE;
use crate::math::TAU;
use crate::parallel::in_widest_lanes;
use crate::real::Real;

/// Number of sweeps over a sheet. For a finite horizon, the sheet advances only in the last time
/// steps. There are enough of these that even the slowest cells of the sheet advance by about this
/// many steps at the CFL number [`CFL`](super::sweep::CFL).
pub(super) const SHEET_SWEEPS: usize = 12;

/// At the kink, the full game's value is blurred by at most this fraction of a cell. Where the
/// value exceeds both sheets by more than this, the evader has a better strategy than a single
/// turn.
const KINK_BLUR: f64 = 0.2;

/// Where the sheets differ by more than this many cells, the state is not near the kink.
const KINK_NEAR: f64 = 4.0;

impl<T: Real> Level<T> {
    /// The game in which the evader only turns to one side or goes straight, until it is safe in
    /// the full game. The initial values are the values of the full game (`self`).
    pub(super) fn right_copy(&self) -> Self {
        let (n, ranges) = (self.shape.angle_nodes, self.range.nodes);
        let mut sheet = Self::new(&self.game, self.range_m, ranges, n, Evader::Right);
        for i in 0..ranges {
            for k in 0..n {
                let at = sheet.at(i, k) + PAD;
                self.copy_row(i, k, &mut sheet.values[at..at + n]);
                sheet.spread(i, k);
            }
        }
        sheet
    }

    /// The converged value of the game of [`Self::right_copy`].
    pub(super) fn right_sheet(&self) -> Self {
        let mut sheet = self.right_copy();
        // Where the evader turns right in the full game, the sheet of right turns already has its final
        // values. So only a few cells beyond the kink need new values.
        let rest = T::from_f64(SAFE * self.game.radius_m);
        for _ in 0..SHEET_SWEEPS {
            in_widest_lanes(Sweep { level: &mut sheet, rest, full: Some(self) });
        }
        sheet
    }

    /// The solution. Near the kink, it takes its values from the sheets wherever they agree with
    /// the full game.
    pub(super) fn finish(mut self, mut sheet: Self) -> Solution<T> {
        let (n, ranges) = (self.shape.angle_nodes, self.range.nodes);
        for i in 0..ranges {
            let next = self.ranges[(i + 1).min(ranges - 1)] - self.ranges[i];
            let cell = next.max(self.ranges[i] * TAU / n as f64);
            let (near, blur) = (T::from_f64(KINK_NEAR * cell), T::from_f64(KINK_BLUR * cell));
            for k in 0..=n / 2 {
                // Rows at bearings 0 and π contain each state twice, by mirror symmetry.
                let own_mirror = k == 0 || k == n / 2;
                for j in 0..if own_mirror { n / 2 + 1 } else { n } {
                    let at = self.at(i, k) + PAD + j;
                    let right = sheet.at(i, k) + PAD + j;
                    let left = sheet.at(i, (n - k) % n) + PAD + (n - j) % n;
                    let full = self.values[at];
                    let (a, b) = (sheet.values[right], sheet.values[left]);
                    let both = a.larger(b);
                    let explained = (full - both).abs() <= blur && (a - b).abs() <= near;
                    if explained {
                        self.values[at] = both;
                        if own_mirror {
                            let twin = self.at(i, k) + PAD + (n - j) % n;
                            self.values[twin] = both;
                        }
                    } else {
                        sheet.values[right] = full;
                        sheet.values[left] = full;
                    }
                }
            }
        }
        // The arrays are copied one after the other, so that at most three full grids exist at a
        // time.
        let deficit = self.inside();
        self.values = Vec::new();
        let sheet = sheet.inside();
        Solution {
            range: self.range,
            range_m: self.range_m,
            angle_nodes: self.shape.angle_nodes,
            deficit,
            sheet,
            sweeps: self.sweeps,
            horizon_s: f64::INFINITY,
            rate_mps: 0.0,
            drift_m: 0.0,
            converged: self.converged,
        }
    }
}
