//! Sequential minimal optimisation (SMO) on a small dense problem. Training spends most of its time
//! in this module.
//!
//! In terms of β_i = y_i α_i, the dual problem is to maximise Σ y_i β_i − ½ βᵀKβ subject to
//! Σ β_i = 0, with β_i between 0 and y_i C. Its gradient is v_i = y_i − Σ_j K_ij β_j. A step raises
//! one β_i and lowers another β_j by the same amount. Variable i has the greatest gradient among
//! the variables that can rise. Candidates for j are the variables that can fall and have a lower
//! gradient than i. Among them, j is the variable whose exchange with i gains most (Fan, Chen, Lin
//! 2005, "Working set selection using second order information"). The iteration ends as in libsvm.
//! The greatest gradient among variables that can rise, minus the least gradient among variables
//! that can fall, must be at most the tolerance.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays at once")]

use super::dense::Dense;
use super::gram::{Entry, LANES, entry};
use super::newton::Newton;
use crate::parallel::Kernel;
use crate::real::Real;

/// Lower bound on the curvature, as in libsvm. It is needed because identical rows have curvature
/// 0.
const LEAST_CURVATURE: f64 = 1e-12;

/// Number of blocks that are processed together. The capacity in blocks is a multiple of this.
const GROUP: usize = 4;

/// Solves the small problem to the tolerance, or gives up when no `steps` are left.
pub(super) struct Pairwise<'a, T> {
    pub(super) dense: &'a mut Dense<T>,
    pub(super) newton: &'a mut Newton,
    pub(super) tolerance: f64,
    pub(super) steps: &'a mut usize,
}

impl<T: Entry> Kernel for Pairwise<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { dense, newton, tolerance, steps } = self;
        while *steps > 0 {
            // Pairwise steps determine which variables are at a bound. Then a Newton step solves
            // for the other variables. The budget limits the pairwise steps to slightly more time
            // than this Newton step takes.
            let free = dense.variables.iter().filter(|variable| variable.is_free()).count();
            let budget = 4 * dense.variables.len() + free * free * free / 1000;
            if exchange(dense, tolerance, budget.min(*steps), steps) {
                return;
            }
            newton.step(dense);
        }
    }
}

/// Takes pairwise steps until the tolerance is reached, but at most `budget` steps. Subtracts the
/// number of steps taken from `steps`. Returns whether the tolerance is reached.
#[inline(always)]
fn exchange<T: Entry>(
    dense: &mut Dense<T>,
    tolerance: f64,
    budget: usize,
    steps: &mut usize,
) -> bool {
    let blocks = dense.variables.len().div_ceil(LANES).next_multiple_of(GROUP);
    let tolerance = T::from_f64(tolerance);
    let least = T::from_f64(LEAST_CURVATURE);
    let (mut i, mut j, mut step) = (0, 0, T::ZERO);
    for _ in 0..budget {
        let (top, bottom, rising) = move_on(dense, blocks, i, j, step);
        if top - bottom <= tolerance {
            return true;
        }
        *steps -= 1;
        i = rising;
        if !dense.ready[i] {
            invert(dense, blocks, i, least);
        }
        j = partner(dense, blocks, i, top);
        let across = *entry(&dense.matrix[i * dense.stride..], j);
        let curvature = *entry(&dense.diagonal, i) + *entry(&dense.diagonal, j);
        let curvature = (curvature - across - across).larger(least);
        let (a, b) = (dense.variables[i], dense.variables[j]);
        let wanted = ((top - *entry(&dense.gradient, j)) / curvature).to_f64();
        let (room_above, room_below) = (a.upper - a.beta, b.beta - b.lower);
        let taken = wanted.smaller(room_above).smaller(room_below);
        // A variable that reaches a bound is set to exactly this bound.
        dense.variables[i].beta = if taken == room_above { a.upper } else { a.beta + taken };
        dense.variables[j].beta = if taken == room_below { b.lower } else { b.beta - taken };
        step = T::from_f64(taken);
        dense.set_masks(i);
        dense.set_masks(j);
    }
    move_on(dense, blocks, i, j, step);
    false
}

/// Updates the gradients after β_i has risen and β_j has fallen by `step`. Returns the greatest
/// gradient among variables that can rise, the least gradient among variables that can fall, and
/// the first variable with the greatest gradient.
#[inline(always)]
fn move_on<T: Entry>(
    dense: &mut Dense<T>,
    blocks: usize,
    i: usize,
    j: usize,
    step: T,
) -> (T, T, usize) {
    let row = |k: usize| &dense.matrix[k * dense.stride..k * dense.stride + blocks];
    let (row_i, row_j) = (row(i), row(j));
    let (gradient, rise, fall) =
        (&mut dense.gradient[..blocks], &dense.rise[..blocks], &dense.fall[..blocks]);
    let mut top = [T::from_f64(f64::NEG_INFINITY); LANES];
    let mut bottom = [T::from_f64(f64::INFINITY); LANES];
    let mut place = [T::ZERO; LANES];
    let mut here = T::ZERO;
    let one = T::from_f64(1.0);
    // First find the best entry of a few blocks in registers, then compare it with the best so far
    // in memory.
    let groups = gradient.as_chunks_mut::<GROUP>().0.iter_mut().zip(rise.as_chunks::<GROUP>().0);
    let groups = groups.zip(fall.as_chunks::<GROUP>().0);
    let rows = row_i.as_chunks::<GROUP>().0.iter().zip(row_j.as_chunks::<GROUP>().0);
    for (((gradient, rise), fall), (row_i, row_j)) in groups.zip(rows) {
        for l in 0..LANES {
            let mut best = T::from_f64(f64::NEG_INFINITY);
            let (mut at, mut now) = (here, here);
            let mut least = T::from_f64(f64::INFINITY);
            for g in 0..GROUP {
                let moved = gradient[g].0[l] - step * (row_i[g].0[l] - row_j[g].0[l]);
                gradient[g].0[l] = moved;
                let rising = moved + rise[g].0[l];
                let better = rising > best;
                best = if better { rising } else { best };
                at = if better { now } else { at };
                now += one;
                least = least.smaller(moved - fall[g].0[l]);
            }
            let better = best > top[l];
            top[l] = if better { best } else { top[l] };
            place[l] = if better { at } else { place[l] };
            bottom[l] = bottom[l].smaller(least);
        }
        here += T::from_f64(GROUP as f64);
    }
    let (greatest, at) = first_greatest(&top, &place);
    (greatest, reduced(bottom, T::smaller), at)
}

/// Computes row `i` of the inverse curvatures.
#[inline(always)]
fn invert<T: Entry>(dense: &mut Dense<T>, blocks: usize, i: usize, least: T) {
    let row = i * dense.stride..i * dense.stride + blocks;
    let own = *entry(&dense.diagonal, i);
    let one = T::from_f64(1.0);
    let rows = dense.inverse[row.clone()].iter_mut().zip(&dense.matrix[row]);
    for ((inverse, across), diagonal) in rows.zip(&dense.diagonal[..blocks]) {
        for l in 0..LANES {
            let across = across.0[l];
            inverse.0[l] = one / (own + diagonal.0[l] - across - across).larger(least);
        }
    }
    dense.ready[i] = true;
}

/// The variable whose exchange with `i` gains most, among the variables that can fall and have a
/// gradient below `top`. The gain is (top − v_j)² / (K_ii + K_jj − 2 K_ij).
#[inline(always)]
fn partner<T: Entry>(dense: &Dense<T>, blocks: usize, i: usize, top: T) -> usize {
    let inverse = &dense.inverse[i * dense.stride..i * dense.stride + blocks];
    let (gradient, fall) = (&dense.gradient[..blocks], &dense.fall[..blocks]);
    let mut most = [T::from_f64(-1.0); LANES];
    let mut place = [T::ZERO; LANES];
    let mut here = T::ZERO;
    let one = T::from_f64(1.0);
    let groups = gradient.as_chunks::<GROUP>().0.iter().zip(fall.as_chunks::<GROUP>().0);
    for ((gradient, fall), inverse) in groups.zip(inverse.as_chunks::<GROUP>().0) {
        for l in 0..LANES {
            let mut best = T::from_f64(-1.0);
            let (mut at, mut now) = (here, here);
            for g in 0..GROUP {
                let lack = (top - gradient[g].0[l] + fall[g].0[l]).larger(T::ZERO);
                let gain = lack * lack * inverse[g].0[l];
                let better = gain > best;
                best = if better { gain } else { best };
                at = if better { now } else { at };
                now += one;
            }
            let better = best > most[l];
            most[l] = if better { best } else { most[l] };
            place[l] = if better { at } else { place[l] };
        }
        here += T::from_f64(GROUP as f64);
    }
    first_greatest(&most, &place).1
}

/// The greatest value of the lanes, and the first variable that has it. The code has no branches,
/// because the processor could not predict them.
#[inline(always)]
fn first_greatest<T: Entry>(values: &[T; LANES], place: &[T; LANES]) -> (T, usize) {
    let best = reduced(*values, T::larger);
    let never = T::from_f64(f64::INFINITY);
    let mut index = [never; LANES];
    for l in 0..LANES {
        let mine = place[l] * T::from_f64(LANES as f64) + T::from_f64(l as f64);
        index[l] = if values[l] == best { mine } else { never };
    }
    (best, reduced(index, T::smaller).to_f64() as usize)
}

/// Combines all lanes with an operation that is commutative and associative.
#[inline(always)]
fn reduced<T: Entry>(mut lanes: [T; LANES], operation: impl Fn(T, T) -> T) -> T {
    let mut width = LANES / 2;
    while width > 0 {
        for l in 0..width {
            lanes[l] = operation(lanes[l], lanes[l + width]);
        }
        width /= 2;
    }
    lanes[0]
}
