//! Upper and lower limits of V, and the jumps of the obstacle.

use super::super::grid::Grid;
use super::kernel::Range;
use super::layout::{BLOCK, Ghosts, Layout, each_interior, each_line, fill_ghosts};
use crate::parallel::Workers;
use crate::real::Real;
use core::sync::atomic::{AtomicBool, Ordering};

/// The nodes that a march computes.
pub(super) struct Nodes<'a, const D: usize> {
    pub(super) grid: &'a Grid<D>,
    pub(super) layout: &'a Layout<D>,
    pub(super) ghosts: [Ghosts<'a>; D],
    pub(super) workers: &'a Workers,
}

/// Upper and lower limits of V on the nodes.
pub(super) struct Limits<T> {
    pub(super) ceiling: Option<Vec<T>>,
    pub(super) floor: Option<Vec<T>>,
    /// Whether `floor` has ever been capped below the obstacle at some node.
    pub(super) is_capped: bool,
    /// Whether the obstacle has had jumps at some time so far, so that V can have jumps.
    pub(super) jumps: bool,
    /// Whether some of these jumps are hidden by the target's slope; see
    /// [`Limits::look_for_jumps`].
    hides_jumps: bool,
    /// [`NEAR`] at the nodes of hidden jumps. Elsewhere, the value is smaller by one for each cell
    /// of distance from such a node. Empty if the march does not search for jumps.
    near: Vec<T>,
    /// The target's steepest slope at the beginning.
    pub(super) slope: f64,
    /// The smallest and the largest value of the target so far.
    pub(super) seen: [f64; 2],
}

impl<T: Real> Limits<T> {
    /// The limits for a target with these values. If `ceiling` is set, V must not exceed it. `near`
    /// is empty or as long as `target`.
    pub(super) fn new<const D: usize>(
        target: &[T],
        layout: &Layout<D>,
        grid: &Grid<D>,
        [ceiling, floor]: [Option<Vec<T>>; 2],
        near: Vec<T>,
    ) -> Self {
        Self {
            ceiling,
            floor,
            is_capped: false,
            jumps: false,
            hides_jumps: false,
            near,
            slope: steepest(target, layout, grid),
            seen: range(target, layout),
        }
    }

    /// The proximity of hidden jumps, if there are any; see [`Limits::look_for_jumps`].
    pub(super) fn hidden(&self) -> Option<&[T]> {
        self.hides_jumps.then_some(&self.near[..])
    }

    /// For each axis, the difference between neighbours above which a slope is far steeper than the
    /// target's steepest slope.
    pub(super) fn steep<const D: usize>(&self, grid: &Grid<D>) -> [f64; D] {
        grid.axes.map(|axis| STEEP * self.slope * axis.spacing())
    }

    /// Caps an obstacle at M, the largest magnitude of the target. A path's value is `max(l, g)`,
    /// where l is the target at the path's end and g is the highest obstacle on the path. Since
    /// l ≤ M, `max(l, min(g, M)) = min(max(l, g), M)`. So V becomes min(V, M) and keeps its sign.
    /// Some obstacles have values far above the target's, which mean "never enter". Without the
    /// cap, such values would cause rounding errors as large as the target's values, and these
    /// errors would enter V.
    pub(super) fn cap_floor(&mut self) {
        let cap = T::from_f64(self.largest());
        let mut is_capped = false;
        for floor in self.floor.iter_mut().flatten() {
            is_capped |= *floor > cap;
            *floor = floor.smaller(cap);
        }
        self.is_capped |= is_capped;
    }

    /// The largest magnitude of the target so far; infinite for a target that is 0 everywhere.
    fn largest(&self) -> f64 {
        let largest = self.seen[0].abs().max(self.seen[1].abs());
        if largest > 0.0 { largest } else { f64::INFINITY }
    }

    /// The lowest value of a tube, and the range of values that one stage can reach. Neighbours,
    /// including ghosts, differ by at most the range R of the data, and second differences are at
    /// most 2 R. With the coefficients of ENO3 and WENO5, no one-sided derivative exceeds (1 +
    /// 14/6) R/Δx, where Δx is the spacing. A stage moves V by at most Δt Σ speed (|mean of the two
    /// derivatives| + |half of their difference|), and Δt Σ speed/Δx is at most `cfl`.
    pub(super) fn range(&self, cfl: f64) -> Range<T> {
        let lowest = self.seen[0];
        let highest = if self.floor.is_some() { self.largest() } else { self.seen[1] };
        let most = 2.0 * cfl * (10.0 / 3.0) * (highest - lowest);
        // Rounding error of the sums, in the narrower type.
        let rounding = 1e-4 * (most + lowest.abs().max(highest.abs()));
        let possible = [lowest - most - rounding, highest + most + rounding].map(T::from_f64);
        Range { lowest: T::from_f64(lowest), possible }
    }

    /// Records whether the obstacle jumps. The obstacle's values are limited to the target's
    /// values. A jump is a difference between two neighbours that exceeds a quarter of the
    /// obstacle's range and four times the adjacent differences of the same sign. No slope
    /// satisfies both conditions. If a jump is not far steeper than the target's steepest slope,
    /// that slope hides the jumps of V. Hidden jumps are marked only in passages. Elsewhere, a
    /// first-order scheme would cost more accuracy than the jumps do.
    pub(super) fn look_for_jumps<const D: usize>(&mut self, nodes: &Nodes<'_, D>) {
        let Some(floor) = &self.floor else { return };
        // A first-order scheme only needs to know whether there are any jumps.
        let is_first_order = self.near.is_empty();
        if is_first_order && self.jumps {
            return;
        }
        let Nodes { grid, layout, ghosts, workers } = nodes;
        let lowest = self.seen[0];
        let (lead, length) = (layout.lead(), layout.slice_length());
        let [low, high] = range(floor, layout).map(|value| value.max(lowest));
        let (share, hidden) = (0.25 * (high - low), T::from_f64(NEAR));
        // Rounding can make a difference slightly smaller than its exact value.
        let [least, suspect] = [lowest, 0.999 * share].map(T::from_f64);
        let (steep, jumps) = (self.steep(grid), AtomicBool::new(self.jumps));
        let look = |i: usize, near: &mut [T]| {
            each_line(layout, i, |mut index, start| {
                let start = lead + i * length + start;
                // Nearly all lines have no jump, and this check is fast.
                if is_flat_line(floor, grid, layout, &index, start, [least, suspect]) {
                    return;
                }
                for last in 0..layout.nodes[D - 1] {
                    index[D - 1] = last;
                    let place = start + last;
                    let value = |at: usize| floor[at].to_f64().max(lowest);
                    for (d, axis) in grid.axes.iter().enumerate() {
                        let (nodes, stride) = (axis.nodes as isize, layout.strides[d]);
                        let first = place - index[d] * stride;
                        let at = |k: isize| {
                            let k = if axis.is_periodic() { k.rem_euclid(nodes) } else { k };
                            (0..nodes).contains(&k).then(|| value(first + k as usize * stride))
                        };
                        // The rise from the k-th node of the axis to the next node; 0 beyond an
                        // end.
                        let rise = |k: isize| match (at(k), at(k + 1)) {
                            (Some(this), Some(next)) => next - this,
                            _ => 0.0,
                        };
                        let is_jump = |k: isize| {
                            let this = rise(k);
                            let beside = |k: isize| rise(k) * this.signum();
                            let size = this.abs();
                            size > share && size > STEEP * beside(k - 1).max(beside(k + 1))
                        };
                        // Whether another wall, or the end of the axis, is near the foot of this
                        // wall.
                        let is_passage = |k: isize| {
                            let way = -rise(k).signum() as isize;
                            (1..=PASSAGE).map(|nodes| k + way * nodes).any(|k| {
                                at(k).is_none()
                                    || at(k + 1).is_none()
                                    || way as f64 * rise(k) > 0.0 && is_jump(k)
                            })
                        };
                        let node = index[d] as isize;
                        for k in [node - 1, node].into_iter().filter(|k| is_jump(*k)) {
                            jumps.store(true, Ordering::Relaxed);
                            let height = at(k).into_iter().chain(at(k + 1)).fold(low, f64::max);
                            if !is_first_order && height <= steep[d] && is_passage(k) {
                                near[start - lead - i * length + last] = hidden;
                            }
                        }
                    }
                }
            });
        };
        if is_first_order {
            for slice in 0..layout.slices() {
                look(slice, &mut []);
            }
            self.jumps = jumps.into_inner();
            return;
        }
        let inside = &mut self.near[lead..lead + layout.slices() * length];
        workers.for_chunks(inside, length, look);
        self.jumps = jumps.into_inner();
        self.hides_jumps |= inside.contains(&hidden);
        if self.hides_jumps {
            let near = &mut self.near[..layout.length - BLOCK];
            for d in 0..D {
                spread(near, layout, d, grid.axes[d].is_periodic());
            }
            for d in (0..D).rev() {
                fill_ghosts(near, layout, d, ghosts[d], false);
            }
        }
    }
}

/// Takes the values of a line of nodes along the last axis, raised to at least `least`. Returns
/// whether each of them differs from its neighbours' values by at most `suspect`. `start` is the
/// position of the line's first node.
fn is_flat_line<T: Real, const D: usize>(
    data: &[T],
    grid: &Grid<D>,
    layout: &Layout<D>,
    index: &[usize; D],
    start: usize,
    [least, suspect]: [T; 2],
) -> bool {
    let length = layout.nodes[D - 1];
    let line = &data[start..start + length];
    let is_flat = |one: &[T], other: &[T]| largest_difference(one, other, least) <= suspect;
    if !is_flat(&line[1..], &line[..length - 1]) {
        return false;
    }
    if grid.axes[D - 1].is_periodic() && !is_flat(&line[..1], &line[length - 1..]) {
        return false;
    }
    (0..D - 1).all(|d| {
        let (nodes, stride) = (layout.nodes[d], layout.strides[d]);
        [index[d].checked_sub(1), Some(index[d] + 1)].into_iter().all(|beside| {
            let beside = match beside {
                Some(beside) if beside < nodes => beside,
                _ if !grid.axes[d].is_periodic() => return true,
                None => nodes - 1,
                Some(_) => 0,
            };
            let start = start - index[d] * stride + beside * stride;
            is_flat(line, &data[start..start + length])
        })
    })
}

/// Number of independent accumulators.
const LANES: usize = 16;

/// The largest difference between corresponding values, after raising each value to at least
/// `least`.
fn largest_difference<T: Real>(one: &[T], other: &[T], least: T) -> T {
    let difference = |a: T, b: T| (a.larger(least) - b.larger(least)).abs();
    let mut largest = [T::ZERO; LANES];
    let ((ones, one), (others, other)) = (one.as_chunks::<LANES>(), other.as_chunks::<LANES>());
    for (ones, others) in ones.iter().zip(others) {
        for ((largest, a), b) in largest.iter_mut().zip(ones).zip(others) {
            *largest = largest.larger(difference(*a, *b));
        }
    }
    let rest = one.iter().zip(other).map(|(a, b)| difference(*a, *b));
    largest.into_iter().chain(rest).fold(T::ZERO, T::larger)
}

/// The smallest and the largest value at interior nodes.
pub(super) fn range<T: Real, const D: usize>(data: &[T], layout: &Layout<D>) -> [f64; 2] {
    let (mut lows, mut highs) =
        ([T::from_f64(f64::INFINITY); LANES], [T::from_f64(f64::NEG_INFINITY); LANES]);
    for slice in 0..layout.slices() {
        let lead = layout.lead() + slice * layout.slice_length();
        each_line(layout, slice, |_, start| {
            let line = &data[lead + start..][..layout.nodes[D - 1]];
            for values in line.chunks(LANES) {
                for ((low, high), value) in lows.iter_mut().zip(&mut highs).zip(values) {
                    *low = low.smaller(*value);
                    *high = high.larger(*value);
                }
            }
        });
    }
    [lows.into_iter().fold(lows[0], T::smaller), highs.into_iter().fold(highs[0], T::larger)]
        .map(T::to_f64)
}

/// Largest slope between neighbours along any axis; 1 if it is 0 or not finite.
pub(super) fn steepest<T: Real, const D: usize>(
    value: &[T],
    layout: &Layout<D>,
    grid: &Grid<D>,
) -> f64 {
    let mut steepest = 0.0_f64;
    for slice in 0..layout.slices() {
        let start = layout.lead() + slice * layout.slice_length();
        each_interior(layout, slice, |index, offset| {
            for d in 0..D {
                if index[d] + 1 < layout.nodes[d] {
                    let at = start + offset;
                    let rise = value[at + layout.strides[d]].to_f64() - value[at].to_f64();
                    steepest = steepest.max(rise.abs() / grid.axes[d].spacing());
                }
            }
        });
    }
    if steepest > 0.0 && steepest.is_finite() { steepest } else { 1.0 }
}

/// Spreads the proximity of jumps along `axis`. It decreases by 1 from node to node.
fn spread<T: Real, const D: usize>(
    near: &mut [T],
    layout: &Layout<D>,
    axis: usize,
    is_periodic: bool,
) {
    let (reach, nodes, stride) = (layout.reach, layout.nodes[axis], layout.strides[axis]);
    // A periodic axis needs two rounds.
    let steps = if is_periodic { 2 * nodes } else { nodes };
    for line in near.chunks_exact_mut((nodes + 2 * reach) * stride) {
        let mut pass = |to: usize, from: usize| {
            for k in 0..stride {
                let there = line[(reach + from) * stride + k] - T::from_f64(1.0);
                let here = &mut line[(reach + to) * stride + k];
                *here = here.larger(there);
            }
        };
        for k in 1..steps {
            let (this, last) = (k % nodes, (k - 1) % nodes);
            pass(this, last);
        }
        for k in (1..steps).rev() {
            let (this, last) = (k % nodes, (k - 1) % nodes);
            pass(last, this);
        }
    }
}

/// The smallest range that contains both of these ranges.
pub(super) fn joined([low, high]: [f64; 2], [other_low, other_high]: [f64; 2]) -> [f64; 2] {
    [low.min(other_low), high.max(other_high)]
}

/// If there is an obstacle, a slope that is more than this many times as steep as the other slopes
/// is a jump.
pub(super) const STEEP: f64 = 4.0;
/// A gap of at most this many nodes between two walls, or between a wall and the end of the grid,
/// is a passage.
const PASSAGE: isize = 6;
/// Up to this many cells away from a jump, the first-order scheme can be used even if V does not
/// jump there.
const NEAR: f64 = 8.0;
