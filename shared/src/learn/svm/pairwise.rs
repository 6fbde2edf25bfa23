//! Sequential minimal optimisation on a small dense problem: what takes the time.
//!
//! The dual in β_i = y_i α_i: maximise Σ y_i β_i − ½ βᵀKβ with Σ β_i = 0 and β_i between
//! 0 and y_i C. Its slope is v_i = y_i − Σ_j K_ij β_j. A step raises one β_i and lowers one
//! β_j by the same amount. i has the greatest slope among those that may rise; j, among
//! those that may fall and have a lower slope, gains most (Fan, Chen, Lin 2005, "Working set
//! selection using second order information"). It ends where the greatest slope that may
//! rise exceeds the least that may fall by less than the tolerance: libsvm's criterion.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays at once")]

use super::gram::{Block, Entry, LANES, entry, entry_mut};
use super::newton::Newton;
use crate::parallel::Kernel;
use crate::real::Real;

/// What a curvature counts as at least (identical rows have none), as in libsvm.
const LEAST_CURVATURE: f64 = 1e-12;

/// Blocks that are gone through together; the room for variables is a multiple of it.
const GROUP: usize = 4;

/// A variable of the small problem.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variable {
    pub(super) beta: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
}

impl Variable {
    /// Whether it may both rise and fall.
    pub(super) fn is_free(self) -> bool {
        self.lower < self.beta && self.beta < self.upper
    }
}

/// Arrays by variable, in blocks; those behind the last neither rise nor fall.
#[derive(Clone, Debug)]
pub(super) struct Dense<T> {
    pub(super) variables: Vec<Variable>,
    /// Blocks from a row of `matrix` to the next: one more than there is room for, so that a
    /// column's entries do not all fall into the same few sets of a cache.
    pub(super) stride: usize,
    /// K among the variables.
    pub(super) matrix: Vec<Block<T>>,
    /// One over the curvature K_ii + K_jj − 2 K_ij of an exchange, laid out like `matrix`: rows
    /// that are `ready`. Many steps raise the same few variables, and dividing takes longest.
    inverse: Vec<Block<T>>,
    ready: Vec<bool>,
    /// Room for a row of `matrix`.
    gathered: Vec<T>,
    /// K_ii.
    pub(super) diagonal: Vec<Block<T>>,
    /// v.
    pub(super) slope: Vec<Block<T>>,
    /// 0 where β may rise, −∞ where not.
    pub(super) rise: Vec<Block<T>>,
    /// 0 where β may fall, −∞ where not.
    pub(super) fall: Vec<Block<T>>,
}

impl<T: Entry> Dense<T> {
    /// No variables.
    pub(super) fn new() -> Self {
        Self {
            variables: Vec::new(),
            stride: 0,
            matrix: Vec::new(),
            inverse: Vec::new(),
            ready: Vec::new(),
            gathered: Vec::new(),
            diagonal: Vec::new(),
            slope: Vec::new(),
            rise: Vec::new(),
            fall: Vec::new(),
        }
    }

    /// Loses its variables, and keeps its room.
    pub(super) fn clear(&mut self) {
        self.variables.clear();
        let never = T::from_f64(f64::NEG_INFINITY);
        self.rise.fill(Block::all(never));
        self.fall.fill(Block::all(never));
    }

    /// Has so many variables, one more than before; its values are to be filled in.
    pub(super) fn widen(&mut self, count: usize) {
        let none = Variable { beta: 0.0, lower: 0.0, upper: 0.0 };
        self.variables.resize(count, none);
        let old = self.stride;
        let room = old.saturating_sub(1);
        if count > room * LANES {
            let stride = (2 * room).max(16) + 1;
            let mut matrix = vec![Block::all(T::ZERO); (stride - 1) * LANES * stride];
            for i in 0..room * LANES {
                matrix[i * stride..i * stride + room]
                    .copy_from_slice(&self.matrix[i * old..i * old + room]);
            }
            self.inverse.resize(matrix.len(), Block::all(T::ZERO));
            self.ready.resize((stride - 1) * LANES, false);
            (self.matrix, self.stride) = (matrix, stride);
            let never = Block::all(T::from_f64(f64::NEG_INFINITY));
            self.diagonal.resize(stride, Block::all(T::ZERO));
            self.slope.resize(stride, Block::all(T::ZERO));
            self.rise.resize(stride, never);
            self.fall.resize(stride, never);
        }
    }

    /// Fills in the kernel of variable `slot` with all `members`, from its row of the whole
    /// matrix.
    pub(super) fn fill(&mut self, slot: usize, members: &[usize], row: &[Block<T>]) {
        self.ready.fill(false);
        self.gathered.clear();
        self.gathered.extend(members.iter().map(|&member| *entry(row, member)));
        let own = &mut self.matrix[slot * self.stride..(slot + 1) * self.stride];
        for (block, gathered) in own.iter_mut().zip(self.gathered.chunks(LANES)) {
            block.0[..gathered.len()].copy_from_slice(gathered);
        }
        let (block, lane) = (slot / LANES, slot % LANES);
        for (row, &across) in self.matrix.chunks_exact_mut(self.stride).zip(&self.gathered) {
            row[block].0[lane] = across;
        }
        *entry_mut(&mut self.diagonal, slot) = *entry(row, members[slot]);
    }

    /// Sets variable `i`.
    pub(super) fn set(&mut self, i: usize, variable: Variable, slope: f64) {
        self.variables[i] = variable;
        self.slope[i / LANES].0[i % LANES] = T::from_f64(slope);
        self.set_masks(i);
    }

    #[inline(always)]
    pub(super) fn set_masks(&mut self, i: usize) {
        let Variable { beta, lower, upper } = self.variables[i];
        let mask = |may: bool| if may { T::ZERO } else { T::from_f64(f64::NEG_INFINITY) };
        self.rise[i / LANES].0[i % LANES] = mask(beta < upper);
        self.fall[i / LANES].0[i % LANES] = mask(beta > lower);
    }
}

/// Solves the small problem to the tolerance, or gives up after `steps` steps.
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
            // Pairwise steps, which find out what is at a bound, for some time longer than a
            // Newton step takes; it is for what they have not solved by then.
            let free = dense.variables.iter().filter(|variable| variable.is_free()).count();
            let budget = 4 * dense.variables.len() + free * free * free / 1000;
            if exchange(dense, tolerance, budget.min(*steps), steps) {
                return;
            }
            newton.step(dense);
        }
    }
}

/// Pairwise steps until the tolerance is reached, which it answers, or `budget` of them;
/// takes them off `steps`.
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
        let wanted = ((top - *entry(&dense.slope, j)) / curvature).to_f64();
        let (room_above, room_below) = (a.upper - a.beta, b.beta - b.lower);
        let taken = wanted.smaller(room_above).smaller(room_below);
        // A bound that is reached is reached exactly.
        dense.variables[i].beta = if taken == room_above { a.upper } else { a.beta + taken };
        dense.variables[j].beta = if taken == room_below { b.lower } else { b.beta - taken };
        step = T::from_f64(taken);
        dense.set_masks(i);
        dense.set_masks(j);
    }
    move_on(dense, blocks, i, j, step);
    false
}

/// Slopes after β_i rose and β_j fell by `step`. Returns the greatest slope that may rise,
/// the least that may fall, and the first variable that has the greatest.
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
    let (slope, rise, fall) =
        (&mut dense.slope[..blocks], &dense.rise[..blocks], &dense.fall[..blocks]);
    let mut top = [T::from_f64(f64::NEG_INFINITY); LANES];
    let mut bottom = [T::from_f64(f64::INFINITY); LANES];
    let mut place = [T::ZERO; LANES];
    let mut here = T::ZERO;
    let one = T::from_f64(1.0);
    // The best of a few blocks in registers, then the best so far in memory.
    let groups = slope.as_chunks_mut::<GROUP>().0.iter_mut().zip(rise.as_chunks::<GROUP>().0);
    let groups = groups.zip(fall.as_chunks::<GROUP>().0);
    let rows = row_i.as_chunks::<GROUP>().0.iter().zip(row_j.as_chunks::<GROUP>().0);
    for (((slope, rise), fall), (row_i, row_j)) in groups.zip(rows) {
        for l in 0..LANES {
            let mut best = T::from_f64(f64::NEG_INFINITY);
            let (mut at, mut now) = (here, here);
            let mut least = T::from_f64(f64::INFINITY);
            for g in 0..GROUP {
                let moved = slope[g].0[l] - step * (row_i[g].0[l] - row_j[g].0[l]);
                slope[g].0[l] = moved;
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

/// Makes row `i` of the inverse curvatures ready.
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

/// The variable that may fall, has a slope below `top`, and whose exchange with `i` gains
/// most: (top − v_j)² / (K_ii + K_jj − 2 K_ij).
#[inline(always)]
fn partner<T: Entry>(dense: &Dense<T>, blocks: usize, i: usize, top: T) -> usize {
    let inverse = &dense.inverse[i * dense.stride..i * dense.stride + blocks];
    let (slope, fall) = (&dense.slope[..blocks], &dense.fall[..blocks]);
    let mut most = [T::from_f64(-1.0); LANES];
    let mut place = [T::ZERO; LANES];
    let mut here = T::ZERO;
    let one = T::from_f64(1.0);
    let groups = slope.as_chunks::<GROUP>().0.iter().zip(fall.as_chunks::<GROUP>().0);
    for ((slope, fall), inverse) in groups.zip(inverse.as_chunks::<GROUP>().0) {
        for l in 0..LANES {
            let mut best = T::from_f64(-1.0);
            let (mut at, mut now) = (here, here);
            for g in 0..GROUP {
                let lack = (top - slope[g].0[l] + fall[g].0[l]).larger(T::ZERO);
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

/// The greatest of the lanes and its variable, the first on a tie; without branches, which
/// nothing could predict.
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

/// All lanes by an operation whose order does not matter.
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
