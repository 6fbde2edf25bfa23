//! Solves the dual problem of one pair of classes on a kernel matrix, through small problems.
//!
//! Most variables stay at a bound. Therefore, steps change only a few variables, in a small problem
//! with a dense copy of their rows ([`Pairwise`]). Then the gradients of all rows are updated, and
//! the rows that violate the optimality conditions most join the small problem. This repeats until
//! no row violates the conditions. For the next C, the solution for the previous C is multiplied by
//! the ratio of the two values, so that variables at a bound stay at the bound.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays at once")]

use super::dense::{Dense, Variable};
use super::gram::{Block, Combine, Entry, Gram, LANES, entry, entry_mut};
use super::newton::Newton;
use super::pairwise::Pairwise;
use crate::invalid::Invalid;
use crate::parallel::{Kernel, in_widest_lanes};
use core::ops::Range;

/// Maximum number of rows of each kind (to rise or to fall) that join the small problem in one
/// round.
const JOIN: usize = 24;
/// If the small problem has at least this many rows, settled rows leave it when other rows join. A
/// row is settled if its variable is at a bound and the gradient pushes it against this bound.
const FULL: usize = 48;
/// The small problem is solved only to this fraction of the current gap, because other rows will
/// join it.
const SHARE: f64 = 0.1;

/// The SVM of a pair. Its decision value is f = Σ β_i K(x_i, x) + intercept.
#[derive(Clone, Debug)]
pub(super) struct DualSolution {
    /// The dual variables β in blocks, with one entry per training row.
    pub(super) beta: Vec<Block<f64>>,
    pub(super) intercept: f64,
}

/// The problem of one pair, and its current solution.
pub(super) struct Smo<'a, T> {
    gram: &'a mut Gram<T>,
    /// 1 or −1 for the two classes, 0 for rows of other classes.
    sides: &'a [i8],
    /// The ranges of blocks that contain rows of the pair.
    runs: Vec<Range<usize>>,
    c: f64,
    rows: Rows,
    /// The row of each variable in the small problem.
    members: Vec<usize>,
    /// Whether each row is in the small problem.
    joined: Vec<bool>,
    dense: &'a mut Dense<T>,
    newton: Newton,
}

/// Arrays with one entry per row.
struct Rows {
    beta: Vec<Block<f64>>,
    /// v_i = y_i − Σ K_ij β_j.
    gradient: Vec<Block<f64>>,
    /// 0 if β can rise, otherwise −∞.
    rise: Vec<Block<f64>>,
    /// 0 if β can fall, otherwise −∞.
    fall: Vec<Block<f64>>,
}

impl<'a, T: Entry> Smo<'a, T> {
    /// The problem for this C and for rows with `sides` 1 or −1 (both must occur) or 0 (ignored).
    /// `start` is the solution of a similar problem with the same sides and C. If it is `None`, all
    /// rows of the smaller class, and equally many rows of the other class, start at the bound
    /// |β| = C.
    pub(super) fn new(
        gram: &'a mut Gram<T>,
        sides: &'a [i8],
        c: f64,
        start: Option<&[Block<f64>]>,
        dense: &'a mut Dense<T>,
    ) -> Self {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for (b, sides) in sides.chunks(LANES).enumerate() {
            if sides.iter().any(|&side| side != 0) {
                match runs.last_mut() {
                    Some(run) if run.end == b => run.end = b + 1,
                    _ => runs.push(b..b + 1),
                }
            }
        }
        let zero = vec![Block::all(0.0); gram.blocks()];
        let never = vec![Block::all(f64::NEG_INFINITY); gram.blocks()];
        let beta = start.map_or_else(|| balanced(sides, c), <[Block<f64>]>::to_vec);
        let rows = Rows { beta, gradient: zero, rise: never.clone(), fall: never };
        let joined = vec![false; sides.len()];
        dense.clear();
        let mut smo = Self {
            gram,
            sides,
            runs,
            c,
            rows,
            members: Vec::new(),
            joined,
            dense,
            newton: Newton::default(),
        };
        let mut held = Vec::new();
        for (i, &side) in sides.iter().enumerate() {
            *entry_mut(&mut smo.rows.gradient, i) = f64::from(side);
            smo.set(i, *entry(&smo.rows.beta, i));
            if *entry(&smo.rows.beta, i) != 0.0 {
                held.push((i, -entry(&smo.rows.beta, i)));
                smo.gram.want(i);
            }
        }
        smo.combine(&held);
        smo
    }

    /// Solves the problem for this C, starting from the current solution.
    ///
    /// # Errors
    /// [`Invalid`] if `steps` steps do not reach the tolerance.
    pub(super) fn solve(
        &mut self,
        c: f64,
        tolerance: f64,
        mut steps: usize,
    ) -> Result<DualSolution, Invalid> {
        self.stretch(c);
        loop {
            let (top, bottom) = self.extremes();
            if top - bottom <= tolerance {
                return Ok(self.solution(top, bottom));
            }
            if steps == 0 {
                return Err(Invalid::new("c", "a problem that converges within the step limit", c));
            }
            let middle = 0.5 * (top + bottom);
            let violators = self.violators(middle);
            self.join(&violators, middle);
            self.load();
            let inner = (SHARE * (top - bottom)).max(0.5 * tolerance);
            in_widest_lanes(Pairwise {
                dense: self.dense,
                newton: &mut self.newton,
                tolerance: inner,
                steps: &mut steps,
            });
            self.unload();
        }
    }

    fn bounds(&self, i: usize) -> (f64, f64) {
        match self.sides[i] {
            1 => (0.0, self.c),
            -1 => (-self.c, 0.0),
            _ => (0.0, 0.0),
        }
    }

    /// Sets β_i.
    fn set(&mut self, i: usize, beta: f64) {
        let (lower, upper) = self.bounds(i);
        let mask = |may: bool| if may { 0.0 } else { f64::NEG_INFINITY };
        *entry_mut(&mut self.rows.beta, i) = beta;
        *entry_mut(&mut self.rows.rise, i) = mask(beta < upper);
        *entry_mut(&mut self.rows.fall, i) = mask(beta > lower);
    }

    /// Rescales the solution for another C.
    fn stretch(&mut self, c: f64) {
        if c == self.c {
            return;
        }
        let factor = c / self.c;
        self.c = c;
        for (i, &side) in self.sides.iter().enumerate() {
            let (beta, (lower, upper)) = (*entry(&self.rows.beta, i), self.bounds(i));
            let bound = *entry(&self.rows.rise, i) != 0.0 || *entry(&self.rows.fall, i) != 0.0;
            // Variables at a bound are set to exactly the new bound.
            self.set(
                i,
                match beta {
                    0.0 => 0.0,
                    _ if bound && side > 0 => upper,
                    _ if bound => lower,
                    _ => (factor * beta).clamp(lower, upper),
                },
            );
            let gradient = entry_mut(&mut self.rows.gradient, i);
            *gradient = f64::from(side) - factor * (f64::from(side) - *gradient);
        }
    }

    /// Adds multiples of kernel rows to the gradients.
    fn combine(&mut self, rows: &[(usize, f64)]) {
        for run in &self.runs {
            let sums = &mut self.rows.gradient[run.clone()];
            in_widest_lanes(Combine { gram: self.gram, rows, first: run.start, sums });
        }
    }

    /// Calls `visit(row, gradient, can rise, can fall)` for each row of the two classes.
    fn each(&self, mut visit: impl FnMut(usize, f64, bool, bool)) {
        for (i, &side) in self.sides.iter().enumerate() {
            if side != 0 {
                let may = |mask: &[Block<f64>]| *entry(mask, i) == 0.0;
                let gradient = *entry(&self.rows.gradient, i);
                visit(i, gradient, may(&self.rows.rise), may(&self.rows.fall));
            }
        }
    }

    /// The greatest gradient among variables that can rise, and the least gradient among variables
    /// that can fall.
    fn extremes(&self) -> (f64, f64) {
        let mut extremes = (f64::NEG_INFINITY, f64::INFINITY);
        in_widest_lanes(Extremes { rows: &self.rows, runs: &self.runs, extremes: &mut extremes });
        extremes
    }

    /// The rows outside the small problem that violate the optimality conditions most. Returns at
    /// most [`JOIN`] rows of each kind.
    fn violators(&self, middle: f64) -> Vec<usize> {
        let mut found = Vec::new();
        in_widest_lanes(Violators {
            rows: &self.rows,
            runs: &self.runs,
            middle,
            found: &mut found,
        });
        found.retain(|&(_, i)| !self.joined[i]);
        let (mut rising, mut falling): (Vec<_>, Vec<_>) =
            found.into_iter().partition(|&(_, i)| *entry(&self.rows.gradient, i) > middle);
        let mut most = Vec::new();
        for kind in [&mut rising, &mut falling] {
            let by_size =
                |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
            if kind.len() > JOIN {
                kind.select_nth_unstable_by(JOIN, by_size);
                kind.truncate(JOIN);
            }
            kind.sort_unstable_by_key(|&(_, i)| i);
            most.extend(kind.iter().map(|&(_, i)| i));
        }
        most
    }

    /// Adds rows to the small problem. If it has at least [`FULL`] rows, the new rows first replace
    /// settled rows.
    fn join(&mut self, rows: &[usize], middle: f64) {
        let mut rows = rows.iter().copied();
        if self.members.len() >= FULL {
            for slot in 0..self.members.len() {
                let i = self.members[slot];
                let open = if *entry(&self.rows.gradient, i) > middle {
                    *entry(&self.rows.rise, i)
                } else {
                    *entry(&self.rows.fall, i)
                };
                let free = *entry(&self.rows.rise, i) == 0.0 && *entry(&self.rows.fall, i) == 0.0;
                if open != 0.0 && !free {
                    let Some(row) = rows.next() else { return };
                    self.joined[i] = false;
                    self.place(slot, row);
                }
            }
        }
        for row in rows {
            self.members.push(row);
            self.dense.widen(self.members.len());
            self.place(self.members.len() - 1, row);
        }
    }

    /// Assigns `row` to the variable in `slot`.
    fn place(&mut self, slot: usize, row: usize) {
        self.members[slot] = row;
        self.joined[row] = true;
        self.gram.want(row);
        self.dense.fill(slot, &self.members, self.gram.row(row));
    }

    /// Copies the variables, their bounds and their gradients into the small problem.
    fn load(&mut self) {
        for (slot, &i) in self.members.iter().enumerate() {
            let (lower, upper) = self.bounds(i);
            let variable = Variable { beta: *entry(&self.rows.beta, i), lower, upper };
            self.dense.set(slot, variable, *entry(&self.rows.gradient, i));
        }
    }

    /// Copies the solution of the small problem back, and updates all gradients.
    fn unload(&mut self) {
        let mut changes = Vec::new();
        for slot in 0..self.members.len() {
            let (i, beta) = (self.members[slot], self.dense.variables[slot].beta);
            let change = beta - entry(&self.rows.beta, i);
            if change != 0.0 {
                changes.push((i, -change));
                self.set(i, beta);
            }
        }
        self.combine(&changes);
    }

    fn solution(&self, top: f64, bottom: f64) -> DualSolution {
        let (mut sum, mut count) = (0.0, 0.0);
        self.each(|_, gradient, rise, fall| {
            if rise && fall {
                sum += gradient;
                count += 1.0;
            }
        });
        let intercept = if count > 0.0 { sum / count } else { 0.5 * (top + bottom) };
        DualSolution { beta: self.rows.beta.clone(), intercept }
    }
}

/// Puts all rows of the smaller class, and equally many evenly spread rows of the other class, at
/// the bound |β| = C.
fn balanced(sides: &[i8], c: f64) -> Vec<Block<f64>> {
    let count = |side: i8| sides.iter().filter(|&&s| s == side).count();
    let wanted = count(1).min(count(-1));
    let mut beta = vec![Block::all(0.0); sides.len().div_ceil(LANES)];
    for side in [1, -1] {
        let of_side = (0..sides.len()).filter(|&i| sides[i] == side).collect::<Vec<_>>();
        for k in 0..wanted {
            *entry_mut(&mut beta, of_side[k * of_side.len() / wanted]) = f64::from(side) * c;
        }
    }
    beta
}

/// Computes [`Smo::extremes`] on ranges of blocks.
struct Extremes<'a> {
    rows: &'a Rows,
    runs: &'a [Range<usize>],
    extremes: &'a mut (f64, f64),
}

impl Kernel for Extremes<'_> {
    #[inline(always)]
    fn run(self) {
        let (mut top, mut bottom) = ([f64::NEG_INFINITY; LANES], [f64::INFINITY; LANES]);
        for run in self.runs {
            let rows = self.rows;
            let (rise, fall) = (&rows.rise[run.clone()], &rows.fall[run.clone()]);
            for ((gradient, rise), fall) in rows.gradient[run.clone()].iter().zip(rise).zip(fall) {
                for l in 0..LANES {
                    let (up, down) = (gradient.0[l] + rise.0[l], gradient.0[l] - fall.0[l]);
                    top[l] = if up > top[l] { up } else { top[l] };
                    bottom[l] = if down < bottom[l] { down } else { bottom[l] };
                }
            }
        }
        let top = top.into_iter().fold(f64::NEG_INFINITY, f64::max);
        *self.extremes = (top, bottom.into_iter().fold(f64::INFINITY, f64::min));
    }
}

/// Finds the rows that violate the conditions, each with its gradient's distance from the middle.
struct Violators<'a> {
    rows: &'a Rows,
    runs: &'a [Range<usize>],
    middle: f64,
    found: &'a mut Vec<(f64, usize)>,
}

impl Kernel for Violators<'_> {
    #[inline(always)]
    fn run(self) {
        let Rows { gradient, rise, fall, .. } = self.rows;
        for b in self.runs.iter().flat_map(Clone::clone) {
            let mut lack = [0.0; LANES];
            let mut most = 0.0;
            for l in 0..LANES {
                let up = gradient[b].0[l] - self.middle + rise[b].0[l];
                let down = self.middle - gradient[b].0[l] + fall[b].0[l];
                lack[l] = if up > down { up } else { down };
                most = if lack[l] > most { lack[l] } else { most };
            }
            if most > 0.0 {
                let lanes = lack.iter().enumerate().filter(|&(_, &lack)| lack > 0.0);
                self.found.extend(lanes.map(|(l, &lack)| (lack, b * LANES + l)));
            }
        }
    }
}
