//! Newton steps on the free variables of a small problem.
//!
//! If the variables at a bound are known, the optimum of the free variables solves a linear system:
//! K Δ + λ 1 = v and Σ Δ = 0. Pairwise steps converge slowly if K is nearly singular (large C,
//! small γ). But in this case few variables are free, so the system is small. Moving by any
//! fraction of Δ from 0 to 1 never worsens the objective.

use super::dense::Dense;
use super::gram::{Entry, LANES, entry};

/// A variable whose pivot is at most this times K_ii does not move, because in single precision it
/// depends linearly on other variables.
const LEAST_PIVOT: f64 = 1e-7;
/// Rows are padded to a multiple of this.
const WIDTH: usize = 8;
/// Maximum number of successive Newton steps that end at a bound. After these, pairwise steps
/// continue.
const BOUNDS: usize = 4;

/// A Cholesky factor and vectors, with reusable memory.
#[derive(Debug, Default)]
pub(super) struct Newton {
    /// The free variables, which a step moves.
    free: Vec<usize>,
    /// The upper triangle, row by row, with `stride` entries per row.
    factor: Vec<f64>,
    stride: usize,
    /// The inverse of the factor's diagonal; 0 for a variable that does not move.
    inverse: Vec<f64>,
    step: Vec<f64>,
    unit: Vec<f64>,
}

impl Newton {
    /// Moves the free variables to their optimum. Gives up after [`BOUNDS`] moves that each end at
    /// a bound.
    #[inline(always)]
    pub(super) fn step<T: Entry>(&mut self, dense: &mut Dense<T>) {
        for _ in 0..BOUNDS {
            self.factorise(dense);
            if self.free.len() < 2 {
                return;
            }
            self.direction(dense);
            if !self.advance(dense) {
                return;
            }
        }
    }

    /// Computes the Cholesky factor of K for the free variables. All operations go row by row, so
    /// SIMD code and scalar code give the same result.
    #[inline(always)]
    fn factorise<T: Entry>(&mut self, dense: &Dense<T>) {
        let Self { free, factor, stride, inverse, .. } = self;
        free.clear();
        free.extend((0..dense.variables.len()).filter(|&i| dense.variables[i].is_free()));
        let n = free.len();
        *stride = n.next_multiple_of(WIDTH);
        factor.clear();
        factor.resize(n * *stride, 0.0);
        for (k, row) in factor.chunks_exact_mut((*stride).max(1)).enumerate() {
            let source = &dense.matrix[free[k] * dense.stride..(free[k] + 1) * dense.stride];
            for (out, &other) in row[k..].iter_mut().zip(&free[k..]) {
                *out = entry(source, other).to_f64();
            }
        }
        inverse.clear();
        for k in 0..n {
            let (above, below) = factor.split_at_mut((k + 1) * *stride);
            let row = &mut above[k * *stride..];
            let pivot = row[k];
            if pivot > LEAST_PIVOT * entry(&dense.diagonal, free[k]).to_f64() {
                let scale = 1.0 / pivot.sqrt();
                inverse.push(scale);
                for entry in &mut row[k..] {
                    *entry *= scale;
                }
                for (i, target) in (k + 1..n).zip(below.chunks_exact_mut(*stride)) {
                    subtract(&mut target[i / WIDTH * WIDTH..], row[i], &row[i / WIDTH * WIDTH..]);
                }
            } else {
                inverse.push(0.0);
                row.fill(0.0);
            }
        }
    }

    /// Replaces `out` by the solution x of K x = `out`. Entries of variables that do not move
    /// become 0.
    #[inline(always)]
    fn solve(factor: &[f64], stride: usize, inverse: &[f64], out: &mut [f64]) {
        for (k, &inverse) in inverse.iter().enumerate() {
            let value = out[k] * inverse;
            subtract(&mut out[k..], value, &factor[k * stride + k..(k + 1) * stride]);
            out[k] = value;
        }
        for (k, &inverse) in inverse.iter().enumerate().rev() {
            let row = &factor[k * stride + k + 1..(k + 1) * stride];
            let sum = row.iter().zip(&out[k + 1..]).fold(out[k], |sum, (a, b)| sum - a * b);
            out[k] = sum * inverse;
        }
    }

    #[inline(always)]
    fn direction<T: Entry>(&mut self, dense: &Dense<T>) {
        let k = self.free.len();
        self.step.clear();
        self.step.extend(self.free.iter().map(|&i| entry(&dense.gradient, i).to_f64()));
        self.step.resize(self.stride, 0.0);
        self.unit.clear();
        self.unit.resize(k, 1.0);
        self.unit.resize(self.stride, 0.0);
        Self::solve(&self.factor, self.stride, &self.inverse, &mut self.step);
        Self::solve(&self.factor, self.stride, &self.inverse, &mut self.unit);
        let level = self.step.iter().sum::<f64>() / self.unit.iter().sum::<f64>();
        for (step, unit) in self.step.iter_mut().zip(&self.unit) {
            *step -= level * unit;
        }
    }

    /// Moves along the step to its end or to the first bound. Returns whether a bound was reached.
    #[inline(always)]
    fn advance<T: Entry>(&mut self, dense: &mut Dense<T>) -> bool {
        let mut share = 1.0;
        let mut met = None;
        for (k, (&i, &step)) in self.free.iter().zip(&self.step).enumerate() {
            let variable = dense.variables[i];
            let bound = if step > 0.0 { variable.upper } else { variable.lower };
            if (bound - variable.beta).abs() < share * step.abs() {
                share = (bound - variable.beta) / step;
                met = Some(k);
            }
        }
        let blocks = dense.variables.len().div_ceil(LANES);
        for (k, (&i, &step)) in self.free.iter().zip(&self.step).enumerate() {
            let mut variable = dense.variables[i];
            let bound = if step > 0.0 { variable.upper } else { variable.lower };
            let next = if met == Some(k) { bound } else { variable.beta + share * step };
            let next = next.clamp(variable.lower, variable.upper);
            let change = T::from_f64(next - variable.beta);
            variable.beta = next;
            dense.variables[i] = variable;
            dense.set_masks(i);
            let row = &dense.matrix[i * dense.stride..i * dense.stride + blocks];
            for (gradient, row) in dense.gradient[..blocks].iter_mut().zip(row) {
                for (gradient, &across) in gradient.0.iter_mut().zip(&row.0) {
                    *gradient = *gradient - change * across;
                }
            }
        }
        met.is_some()
    }
}

/// Subtracts `share` · `row` from `target`.
#[inline(always)]
fn subtract(target: &mut [f64], share: f64, row: &[f64]) {
    for (target, &entry) in target.iter_mut().zip(row) {
        *target -= share * entry;
    }
}
