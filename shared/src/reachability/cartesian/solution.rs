//! The result of a solve, as a function of state and time.

use super::{Direction, Kind};
use crate::invalid::Invalid;
use crate::reachability::game::{Inputs, Players};
use crate::reachability::grid::Grid;
use crate::real::Real;
use core::fmt;
use serde::{Deserialize, Serialize};

/// The solution of a problem: V on the nodes, and by interpolation anywhere on the grid.
///
/// # Two times
/// A solve marches in τ, the time since the march began. [`Direction::Backward`] begins at the end
/// of the game. Then τ is the remaining time, and the forward time since the beginning of the game
/// is t = horizon − τ. [`Direction::Forward`] begins at the initial set, and t = τ.
/// [`Solution::at_time`] and [`Region::OfTime`](super::Region::OfTime) use t;
/// [`Solution::at_march_time`] and [`Region::OfMarchTime`](super::Region::OfMarchTime) use τ.
/// [`Solution::value`] and similar methods refer to the end of the march, after the whole horizon.
///
/// # Accuracy
/// Between nodes, V is interpolated linearly along each axis, plus a parabola whose curvature is
/// the smaller of the second differences at the two ends of a cell's edge. Where V is smooth, the
/// interpolation error is of third order in the spacing (of second order in the outermost cells of
/// an axis with ends). The error of the gradient is one order lower. At a kink, the interpolation
/// never overshoots, and its error is at most a quarter of the spacing times the jump of the slope.
/// Between two walls, where the curvature of V has one sign at their feet and the other sign at
/// their tops, the interpolation is linear. The interpolated V is continuous. Its gradient is
/// one-sided at nodes and where the parabolas change. The solver's error at the nodes is added to
/// the interpolation error. Between stored instants, V is linear in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution<T, const D: usize> {
    /// The nodes.
    pub grid: Grid<D>,
    /// V at the end of the march, row-major.
    pub values: Vec<T>,
    /// V at [`Settings::slices`](super::Settings::slices) earlier instants, evenly spaced from the
    /// beginning of the march.
    pub earlier: Vec<Vec<T>>,
    /// The direction of time.
    pub direction: Direction,
    /// Tube or set.
    pub kind: Kind,
    /// Number of time steps taken.
    pub steps: usize,
    /// Time marched (s).
    pub horizon_s: f64,
    /// max |∂V/∂τ| at the end, per second; close to 0 for a converged value.
    pub residual: f64,
    /// For each axis and each of its nodes: the time (s) before which no path from there passes an
    /// end of that axis; infinite if no path ever does. `None` if the solution's file lacks these
    /// times. See [`Solution::earliest_exit_s`].
    pub exit_s: Option<[Vec<f64>; D]>,
    /// Set if the obstacle makes V so flat that its sign can be wrong.
    pub shallow: Option<ShallowObstacle>,
}

/// An obstacle that makes V far flatter than the target. The sign of V can then be wrong even far
/// from the obstacle, because the scheme's error does not shrink with V. Either most of the free
/// nodes have the same obstacle value, as with an indicator, or the obstacle's steepest slope is
/// less than a quarter of the target's, as with a distance in a larger unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShallowObstacle {
    /// V is nowhere below this value, which is the smallest −g at the beginning of the march.
    pub lowest: f64,
    /// The smallest value of the target. V would be this low without the obstacle.
    pub target: f64,
}

impl fmt::Display for ShallowObstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The values are converted to f32, so that no digits beyond single precision are printed.
        let [lowest, target] = [self.lowest, self.target].map(|value| value as f32);
        write!(
            f,
            "the obstacle keeps V at {lowest} or more; without it, V is as low as {target}. V is so flat that its sign \
             can be wrong, even far from the obstacle; give the obstacle as a distance in the target's unit, or as an \
             indicator at least as high as the target is deep, ±{}",
            -target
        )
    }
}

/// V and its gradient at a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const D: usize> {
    /// V. The state belongs to the set or tube if V ≤ 0.
    pub value: f64,
    /// ∂V/∂x_d, in the unit of V per unit of x_d.
    pub gradient: [f64; D],
}

/// V at one instant, from [`Solution::at_time`], [`Solution::at_march_time`] or [`Solution::end`].
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a, T, const D: usize> {
    solution: &'a Solution<T, D>,
    /// The stored values before and after the instant, and its position between them, from 0 to 1.
    before: &'a [T],
    after: &'a [T],
    share: f64,
}

impl<T: Real, const D: usize> Solution<T, D> {
    /// V at a state, for the whole horizon.
    ///
    /// # Errors
    /// [`Invalid`] naming the coordinate that is not finite or beyond the ends of its axis.
    pub fn value(&self, state: [f64; D]) -> Result<f64, Invalid> {
        Ok(self.sample(state)?.value)
    }

    /// V and its gradient at a state, for the whole horizon.
    ///
    /// # Errors
    /// The errors of [`Self::value`].
    pub fn sample(&self, state: [f64; D]) -> Result<Sample<D>, Invalid> {
        self.end().sample(state)
    }

    /// Both players' optimal inputs at a state; see [`Snapshot::inputs`].
    ///
    /// # Errors
    /// The errors of [`Self::value`].
    pub fn inputs<G: Players<D>>(
        &self,
        game: &G,
        state: [f64; D],
    ) -> Result<Inputs<G::Minimiser, G::Maximiser>, Invalid> {
        self.end().inputs(game, state)
    }

    /// The time (s) before which no path from a state leaves the grid; infinite if no path ever
    /// does. `None` if the solution's file lacks these times. After a march of at most this time, V
    /// at the state does not depend on the values beyond the grid's ends. After a longer march, V
    /// can depend on them.
    ///
    /// This is a lower bound for all inputs of both players. Along each axis, it assumes that a path
    /// at a given coordinate moves at the largest speed bound of all nodes with this coordinate, and
    /// **toward either end** of the grid, since the bounds have no sign. The paths that determine V
    /// can leave much later. They never leave where, for instance, all states move away from an end.
    ///
    /// # Errors
    /// The errors of [`Self::value`].
    pub fn earliest_exit_s(&self, state: [f64; D]) -> Result<Option<f64>, Invalid> {
        self.grid.check_state(state)?;
        let (cell, share) = self.grid.cell(state);
        Ok(self.exit_s.as_ref().map(|exit_s| {
            let along = (0..D).filter(|d| !self.grid.axes[*d].is_periodic()).map(|d| {
                let [before, behind] = [exit_s[d][cell[d]], exit_s[d][cell[d] + 1]];
                // Exactly at a node, the other node of the cell does not count, since its time can
                // be infinite.
                match share[d] {
                    0.0 => before,
                    1.0 => behind,
                    share => (1.0 - share) * before + share * behind,
                }
            });
            along.fold(f64::INFINITY, f64::min)
        }))
    }

    /// For each node, row-major, whether V after `tau_s` (s) of the march can depend on values
    /// beyond the grid's ends. `None` if the solution's file lacks the exit times. Every node that
    /// depends on these values is marked. Many nodes that do not depend on them are marked too,
    /// such as nodes beside an end from which all states move away. See [`Self::earliest_exit_s`].
    ///
    /// # Errors
    /// [`Invalid`] for a time that is not between 0 and the horizon.
    pub fn depends_on_outside(&self, tau_s: f64) -> Result<Option<Vec<bool>>, Invalid> {
        if !(0.0..=self.horizon_s).contains(&tau_s) {
            let expected = format!("a time from 0 to the horizon, {} s", self.horizon_s);
            return Err(Invalid::new("tau_s", expected, tau_s));
        }
        Ok(self.exit_s.as_ref().map(|exit_s| {
            let nodes = (0..self.grid.len()).map(|position| self.grid.index(position));
            nodes.map(|index| (0..D).any(|d| exit_s[d][index[d]] < tau_s)).collect()
        }))
    }

    /// The first march time (s) at which a state belongs to the tube. In a backward march, this is
    /// the time to the target; in a forward march, it is the time after which the state is reached.
    /// It is 0 in the target and infinite if the horizon is too short. Between stored instants, V
    /// is linear in time.
    ///
    /// # Errors
    /// The errors of [`Self::value`], and [`Invalid`] for a set instead of a tube, or for a
    /// solution without earlier instants ([`Settings::slices`](super::Settings::slices)).
    pub fn time_to_reach(&self, state: [f64; D]) -> Result<f64, Invalid> {
        self.grid.check_state(state)?;
        if self.kind != Kind::Tube {
            return Err(Invalid::new("kind", "a tube", "a set"));
        }
        if self.earlier.is_empty() {
            let expected = "several stored instants";
            return Err(Invalid::new("solution", expected, "only the end of the march"));
        }
        let instants = self.earlier.iter().chain([&self.values]);
        let mut before: Option<(f64, f64)> = None;
        for (values, time_s) in instants.zip(self.march_times_s()) {
            let value = interpolated(&self.grid, values, state).value;
            if value <= 0.0 {
                return Ok(before.map_or(time_s, |(earlier_s, above)| {
                    earlier_s + (time_s - earlier_s) * (above / (above - value))
                }));
            }
            before = Some((time_s, value));
        }
        Ok(f64::INFINITY)
    }

    /// Both players' optimal inputs at a state, at the first stored instant at which the state
    /// belongs to the tube, or at the horizon if it never does. If a state belongs to the tube long
    /// before the horizon, V is flat there, and the inputs at the horizon depend on rounding
    /// errors. The inputs at the first instant lead to the target.
    ///
    /// # Errors
    /// The errors of [`Self::time_to_reach`].
    pub fn first_inputs<G: Players<D>>(
        &self,
        game: &G,
        state: [f64; D],
    ) -> Result<Inputs<G::Minimiser, G::Maximiser>, Invalid> {
        let first_s = self.time_to_reach(state)?;
        let instants = self.march_times_s();
        let instant = instants.into_iter().find(|time_s| *time_s >= first_s);
        self.at_march_time(instant.unwrap_or(self.horizon_s))?.inputs(game, state)
    }

    /// The march times τ of the stored instants (s); the last one is the horizon.
    #[must_use]
    pub fn march_times_s(&self) -> Vec<f64> {
        let intervals = self.earlier.len().max(1) as f64;
        let early = (0..self.earlier.len()).map(|k| self.horizon_s * (k as f64 / intervals));
        early.chain([self.horizon_s]).collect()
    }

    /// V at the forward time `t_s` (s) since the beginning of the game or since the initial set
    /// ([`Direction::Forward`]).
    ///
    /// # Errors
    /// [`Invalid`] for a time that is not between 0 and the horizon or, if no earlier instants were
    /// stored, is not the end of the march.
    pub fn at_time(&self, t_s: f64) -> Result<Snapshot<'_, T, D>, Invalid> {
        let march_s = match self.direction {
            Direction::Backward => self.horizon_s - t_s,
            Direction::Forward => t_s,
        };
        self.snapshot("t_s", t_s, march_s)
    }

    /// V after `tau_s` (s) of the march: with that much time remaining (backward), or that long
    /// after the initial set (forward).
    ///
    /// # Errors
    /// The errors of [`Self::at_time`].
    pub fn at_march_time(&self, tau_s: f64) -> Result<Snapshot<'_, T, D>, Invalid> {
        self.snapshot("tau_s", tau_s, tau_s)
    }

    fn snapshot(
        &self,
        name: &str,
        asked_s: f64,
        march_s: f64,
    ) -> Result<Snapshot<'_, T, D>, Invalid> {
        if !(asked_s.is_finite() && (0.0..=self.horizon_s).contains(&march_s)) {
            let expected = format!("a time from 0 to the horizon, {} s", self.horizon_s);
            return Err(Invalid::new(name, expected, asked_s));
        }
        if march_s == self.horizon_s {
            return Ok(self.end());
        }
        let Some(last) = self.earlier.len().checked_sub(1) else {
            let expected =
                "the end of the march, since no other instant was stored (Settings::slices)";
            return Err(Invalid::new(name, expected, format!("{asked_s} s")));
        };
        let place = march_s / self.horizon_s * self.earlier.len() as f64;
        let slice = (place as usize).min(last);
        let after = self.earlier.get(slice + 1).unwrap_or(&self.values);
        let (before, share) = (&self.earlier[slice], place - slice as f64);
        Ok(Snapshot { solution: self, before, after, share })
    }

    /// V at the end of the march.
    #[must_use]
    pub fn end(&self) -> Snapshot<'_, T, D> {
        Snapshot { solution: self, before: &self.values, after: &self.values, share: 0.0 }
    }
}

impl<T: Real, const D: usize> Snapshot<'_, T, D> {
    /// V at a state.
    ///
    /// # Errors
    /// The errors of [`Solution::value`].
    pub fn value(&self, state: [f64; D]) -> Result<f64, Invalid> {
        Ok(self.sample(state)?.value)
    }

    /// V and its gradient at a state.
    ///
    /// # Errors
    /// The errors of [`Solution::value`].
    pub fn sample(&self, state: [f64; D]) -> Result<Sample<D>, Invalid> {
        let grid = &self.solution.grid;
        grid.check_state(state)?;
        let before = interpolated(grid, self.before, state);
        if self.share == 0.0 {
            return Ok(before);
        }
        let after = interpolated(grid, self.after, state);
        let blend = |from: f64, to: f64| (1.0 - self.share) * from + self.share * to;
        Ok(Sample {
            value: blend(before.value, after.value),
            gradient: core::array::from_fn(|d| blend(before.gradient[d], after.gradient[d])),
        })
    }

    /// The inputs that are optimal for the gradient of V at a state. After a backward march, these
    /// are both players' inputs at that state and time. After a forward march, they are the inputs
    /// with which the players arrived there.
    ///
    /// # Errors
    /// The errors of [`Solution::value`].
    pub fn inputs<G: Players<D>>(
        &self,
        game: &G,
        state: [f64; D],
    ) -> Result<Inputs<G::Minimiser, G::Maximiser>, Invalid> {
        let Sample { gradient, .. } = self.sample(state)?;
        let gradient = match self.solution.direction {
            Direction::Backward => gradient,
            Direction::Forward => gradient.map(|slope| -slope),
        };
        Ok(game.optimal_inputs(state, gradient))
    }

    /// V on the nodes, row-major.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let pairs = self.before.iter().zip(self.after);
        let blend = |(before, after): (&T, &T)| {
            (1.0 - self.share) * before.to_f64() + self.share * after.to_f64()
        };
        pairs.map(blend).collect()
    }
}

/// V and its gradient at a state of the grid.
fn interpolated<T: Real, const D: usize>(
    grid: &Grid<D>,
    values: &[T],
    state: [f64; D],
) -> Sample<D> {
    let (cell, share) = grid.cell(state);
    let at = |steps: [isize; D]| {
        grid.neighbour(cell, steps).and_then(|node| values.get(node)).map(|v| v.to_f64())
    };
    let (mut value, mut slope) = (0.0, [0.0; D]);
    for corner in 0..1_usize << D {
        let up: [usize; D] = core::array::from_fn(|d| corner >> d & 1);
        let weight = |d: usize| if up[d] == 1 { share[d] } else { 1.0 - share[d] };
        let without = |left_out: &[usize]| -> f64 {
            (0..D).filter(|d| !left_out.contains(d)).map(weight).product()
        };
        let steps = up.map(|up| up as isize);
        let here = at(steps).unwrap_or_default();
        value += without(&[]) * here;
        for d in 0..D {
            let sign = if up[d] == 1 { 1.0 } else { -1.0 };
            slope[d] += sign * without(&[d]) * here;
            if up[d] == 1 {
                continue;
            }
            // The edge along d that begins at this corner.
            let along =
                |k: isize| at(core::array::from_fn(|e| steps[e] + if e == d { k } else { 0 }));
            let bend = bend(core::array::from_fn(|k| along(k as isize - 2)));
            let t = share[d];
            value -= 0.5 * t * (1.0 - t) * bend * without(&[d]);
            slope[d] -= 0.5 * (1.0 - 2.0 * t) * bend * without(&[d]);
            for e in (0..D).filter(|e| *e != d) {
                let sign = if up[e] == 1 { 1.0 } else { -1.0 };
                slope[e] -= 0.5 * t * (1.0 - t) * bend * sign * without(&[d, e]);
            }
        }
    }
    let gradient = core::array::from_fn(|d| slope[d] / grid.axes[d].spacing());
    Sample { value, gradient }
}

/// The curvature along the edge between the middle two of six nodes. It is the smaller of the
/// second differences at the edge's ends if both have the same sign, otherwise 0. Beyond the grid's
/// ends, V continues linearly.
///
/// At the foot of a wall, the second difference is large. At the wall's top, it is equally large
/// with the opposite sign. If a neighbour's second difference has the opposite sign, twice its
/// magnitude is subtracted, so that two walls do not look like a parabola between them. Where V is
/// smooth, neighbouring second differences of opposite sign are both small, of the order of the
/// spacing cubed.
fn bend(nodes: [Option<f64>; 6]) -> f64 {
    let second = |k: usize| Some((nodes[k + 1]? - nodes[k]?) - (nodes[k]? - nodes[k - 1]?));
    let (Some(low), Some(high)) = (second(2), second(3)) else {
        return 0.0;
    };
    if low * high <= 0.0 {
        return 0.0;
    }
    let against = |neighbour: Option<f64>| (-low.signum() * neighbour.unwrap_or_default()).max(0.0);
    let (low_size, high_size) =
        (low.abs() - 2.0 * against(second(1)), high.abs() - 2.0 * against(second(4)));
    low.signum() * low_size.min(high_size).max(0.0)
}
