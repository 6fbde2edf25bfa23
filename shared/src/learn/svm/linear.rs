//! Linear machines: an interior point method on the dual, for many rows of few features.
//!
//! With g_i = y_i (w·x_i + b), the conditions of the optimum are w = Σ α_i y_i x_i,
//! Σ α_i y_i = 0, g_i − 1 = z_i − u_i, α_i z_i = 0 and (C − α_i) u_i = 0 with all of α, C − α,
//! z and u ≥ 0. Newton steps towards products μ in place of 0 leave, once α, z and u are
//! eliminated, a linear system for (w, b) alone (Ferris and Munson 2002, "Interior-point
//! methods for massive support vector machines"). A predictor and a corrector choose μ
//! (Mehrotra 1992).

use super::gram::{Block, LANES, entry, entry_mut};
use crate::invalid::Invalid;
use crate::reachability::parallel::{Kernel, in_widest_lanes};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Of the way to the nearest bound, the share that a step goes at most.
const SHARE: f64 = 0.995;
/// It ends where the products' mean is below this times 1 + C …
const MEAN_PRODUCT: f64 = 1e-11;
/// … or after so many steps; about fifteen do.
const MAX_STEPS: usize = 200;

/// w and b of a pair's machine.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) weights: Vec<f64>,
    pub(super) intercept: f64,
    /// The dual variables that show it to be the optimum, α.
    #[cfg(test)]
    pub(super) alpha: Vec<f64>,
}

impl Plane {
    /// The decision value of a standardised row.
    pub(super) fn decision(&self, row: &[f64]) -> f64 {
        self.weights.iter().zip(row).fold(self.intercept, |sum, (w, x)| sum + w * x)
    }
}

/// The machine of the rows `data` (row-major, `width` columns, standardised) with sides 1 or
/// −1, both of which occur, or 0 for rows that are no part of it.
///
/// # Errors
/// [`Invalid`] if it does not converge.
pub(super) fn fit(width: usize, data: &[f64], sides: &[i8], c: f64) -> Result<Plane, Invalid> {
    let mut state = State::new(width, data, sides, c);
    let mut converged = false;
    in_widest_lanes(Fit { state: &mut state, converged: &mut converged });
    if !converged {
        let found = format!("C = {c}, which does not converge");
        return Err(Invalid::new("c", "a problem that converges", found));
    }
    let State { theta, .. } = state;
    Ok(Plane {
        weights: theta.as_slice()[..width].to_vec(),
        intercept: theta[width],
        #[cfg(test)]
        alpha: (0..state.count).map(|i| *entry(&state.alpha, i)).collect(),
    })
}

/// Arrays by row, in blocks. Rows that only fill up the last block have y = 0 and take no part.
struct State {
    count: usize,
    c: f64,
    /// w, then b.
    theta: DVector<f64>,
    /// y times each feature, then y itself.
    columns: Vec<Vec<Block<f64>>>,
    rows: Vec<Row>,
    alpha: Vec<Block<f64>>,
    /// C − α, kept apart: the difference would cancel.
    room: Vec<Block<f64>>,
    z: Vec<Block<f64>>,
    u: Vec<Block<f64>>,
}

/// What one pass leaves for the next, for a block of rows.
#[derive(Clone, Copy)]
struct Row {
    /// 1/α and 1/(C − α).
    over_alpha: [f64; LANES],
    over_room: [f64; LANES],
    /// 1/(z/α + u/(C − α)), or 0 for rows that fill up.
    weight: [f64; LANES],
    /// 1 − g.
    lack: [f64; LANES],
    /// Right hand sides of the two products.
    p: [f64; LANES],
    q: [f64; LANES],
    /// Changes of α, z and u.
    alpha: [f64; LANES],
    z: [f64; LANES],
    u: [f64; LANES],
}

impl State {
    fn new(width: usize, data: &[f64], sides: &[i8], c: f64) -> Self {
        let mine: Vec<usize> = (0..sides.len()).filter(|&i| sides[i] != 0).collect();
        let count = mine.len();
        let blocks = count.div_ceil(LANES);
        let mut columns = vec![vec![Block::all(0.0); blocks]; width + 1];
        for (k, &i) in mine.iter().enumerate() {
            let y = f64::from(sides[i]);
            for (column, &x) in columns.iter_mut().zip(&data[i * width..(i + 1) * width]) {
                *entry_mut(column, k) = y * x;
            }
            *entry_mut(&mut columns[width], k) = y;
        }
        // In the middle of the box, on the plane Σ α y = 0.
        let first = mine.iter().filter(|&&i| sides[i] > 0).count() as f64 / count as f64;
        let mut alpha = vec![Block::all(0.5 * c); blocks];
        let mut theta = DVector::zeros(width + 1);
        for (k, &i) in mine.iter().enumerate() {
            let share = if sides[i] > 0 { 1.0 - first } else { first };
            *entry_mut(&mut alpha, k) = c * share;
        }
        for (j, column) in columns[..width].iter().enumerate() {
            theta[j] = (0..count).map(|k| entry(column, k) * entry(&alpha, k)).sum();
        }
        let room = alpha.iter().map(|a| Block(core::array::from_fn(|l| c - a.0[l]))).collect();
        let (mut z, mut u) = (vec![Block::all(1.0); blocks], vec![Block::all(1.0); blocks]);
        for k in 0..count {
            let margin = (0..width).map(|j| entry(&columns[j], k) * theta[j]).sum::<f64>() - 1.0;
            *entry_mut(&mut z, k) = 1.0 + margin.max(0.0);
            *entry_mut(&mut u, k) = 1.0 + (-margin).max(0.0);
        }
        let zero = [0.0; LANES];
        let row = Row {
            over_alpha: zero,
            over_room: zero,
            weight: zero,
            lack: zero,
            p: zero,
            q: zero,
            alpha: zero,
            z: zero,
            u: zero,
        };
        Self { count, c, theta, columns, rows: vec![row; blocks], alpha, room, z, u }
    }
}

struct Fit<'a> {
    state: &'a mut State,
    converged: &'a mut bool,
}

impl Kernel for Fit<'_> {
    #[inline(always)]
    fn run(self) {
        let state = self.state;
        let products = 2.0 * state.count as f64;
        for _ in 0..MAX_STEPS {
            let (gap, system) = state.linearise();
            if !gap.is_finite() {
                return;
            }
            if gap <= MEAN_PRODUCT * (1.0 + state.c) * products {
                *self.converged = true;
                return;
            }
            let Some(system) = system.cholesky() else { return };
            // Predictor: towards products of 0.
            let step = state.solve(&system);
            let (longest, curvature) = state.turn(&step);
            let share = longest.min(1.0);
            let reached = ((1.0 - share) * gap + share * share * curvature).max(0.0) / gap;
            // Corrector: as central as the predictor had little way, and with its curvature.
            state.correct(reached * reached * reached * gap / products);
            let step = state.solve(&system);
            let (longest, _) = state.turn(&step);
            state.advance((SHARE * longest).min(1.0), &step);
        }
    }
}

impl State {
    /// The sum of products, and the system's matrix. Right hand sides p, q are 0.
    #[inline(always)]
    fn linearise(&mut self) -> (f64, DMatrix<f64>) {
        let Self { theta, columns, rows, alpha, room, z, u, count, .. } = self;
        let n = columns.len();
        let mut sums = vec![[0.0; LANES]; n * (n + 1) / 2];
        let mut gap = [0.0; LANES];
        for (b, row) in rows.iter_mut().enumerate() {
            let (alpha, room, z, u) = (&alpha[b].0, &room[b].0, &z[b].0, &u[b].0);
            let mut margin = [0.0; LANES];
            for (column, &theta) in columns.iter().zip(theta.iter()) {
                for l in 0..LANES {
                    margin[l] += theta * column[b].0[l];
                }
            }
            // Rows that fill up: 0 in place of 1.
            let part: [f64; LANES] = if (b + 1) * LANES <= *count {
                [1.0; LANES]
            } else {
                core::array::from_fn(|l| f64::from(u8::from(b * LANES + l < *count)))
            };
            for l in 0..LANES {
                row.over_alpha[l] = 1.0 / alpha[l];
                row.over_room[l] = 1.0 / room[l];
                row.weight[l] = part[l] / (z[l] * row.over_alpha[l] + u[l] * row.over_room[l]);
                row.lack[l] = 1.0 - margin[l];
                gap[l] += part[l] * (alpha[l] * z[l] + room[l] * u[l]);
            }
            (row.p, row.q) = ([0.0; LANES], [0.0; LANES]);
            let mut k = 0;
            for (i, first) in columns.iter().enumerate() {
                let mut weighted = first[b].0;
                for l in 0..LANES {
                    weighted[l] *= row.weight[l];
                }
                for second in &columns[..=i] {
                    for l in 0..LANES {
                        sums[k][l] += weighted[l] * second[b].0[l];
                    }
                    k += 1;
                }
            }
        }
        let mut matrix = DMatrix::zeros(n, n);
        let mut k = 0;
        for i in 0..n {
            for j in 0..=i {
                matrix[(i, j)] = total(&sums[k]);
                k += 1;
            }
            // The intercept is not penalised.
            if i + 1 < n {
                matrix[(i, i)] += 1.0;
            }
        }
        (total(&gap), matrix)
    }

    /// The step of (w, b) for the present p and q.
    #[inline(always)]
    fn solve(&self, system: &Cholesky<f64, Dyn>) -> DVector<f64> {
        let mut sums = vec![[0.0; LANES]; self.columns.len()];
        for (b, row) in self.rows.iter().enumerate() {
            let mut wanted = [0.0; LANES];
            for l in 0..LANES {
                let pull = row.p[l] * row.over_alpha[l] - row.q[l] * row.over_room[l];
                wanted[l] = row.weight[l] * (row.lack[l] + pull) + self.alpha[b].0[l];
            }
            for (sum, column) in sums.iter_mut().zip(&self.columns) {
                for l in 0..LANES {
                    sum[l] += wanted[l] * column[b].0[l];
                }
            }
        }
        let mut right = DVector::from_iterator(sums.len(), sums.iter().map(total));
        for j in 0..sums.len() - 1 {
            right[j] -= self.theta[j];
        }
        system.solve(&right)
    }

    /// Changes of α, z and u for a step of (w, b). Returns the longest share of them that
    /// stays inside, and Σ Δα (Δz − Δu).
    #[inline(always)]
    fn turn(&mut self, step: &DVector<f64>) -> (f64, f64) {
        let Self { columns, rows, z, u, .. } = self;
        let mut fastest = [0.0; LANES];
        let mut curvature = [0.0; LANES];
        for (b, row) in rows.iter_mut().enumerate() {
            let mut turn = [0.0; LANES];
            for (column, &step) in columns.iter().zip(step.iter()) {
                for l in 0..LANES {
                    turn[l] += step * column[b].0[l];
                }
            }
            let (z, u) = (&z[b].0, &u[b].0);
            for l in 0..LANES {
                let (over_alpha, over_room) = (row.over_alpha[l], row.over_room[l]);
                let pull = row.p[l] * over_alpha - row.q[l] * over_room;
                let alpha = row.weight[l] * (row.lack[l] + pull - turn[l]);
                row.alpha[l] = alpha;
                // Rows that fill up have no weight, and stay.
                let part = if row.weight[l] > 0.0 { 1.0 } else { 0.0 };
                row.z[l] = part * (row.p[l] * over_alpha - z[l] - z[l] * over_alpha * alpha);
                row.u[l] = part * (row.q[l] * over_room - u[l] + u[l] * over_room * alpha);
                curvature[l] += alpha * (row.z[l] - row.u[l]);
                let speeds =
                    [-alpha * over_alpha, alpha * over_room, -row.z[l] / z[l], -row.u[l] / u[l]];
                for speed in speeds {
                    fastest[l] = if speed > fastest[l] { speed } else { fastest[l] };
                }
            }
        }
        (1.0 / fastest.into_iter().fold(0.0, f64::max), total(&curvature))
    }

    /// Right hand sides for products μ, less what the present changes add in second order.
    #[inline(always)]
    fn correct(&mut self, mu: f64) {
        for row in &mut self.rows {
            for l in 0..LANES {
                row.p[l] = mu - row.alpha[l] * row.z[l];
                row.q[l] = mu + row.alpha[l] * row.u[l];
            }
        }
    }

    /// Goes a share of the changes.
    #[inline(always)]
    fn advance(&mut self, share: f64, step: &DVector<f64>) {
        for (b, row) in self.rows.iter().enumerate() {
            for l in 0..LANES {
                self.alpha[b].0[l] += share * row.alpha[l];
                self.room[b].0[l] -= share * row.alpha[l];
                self.z[b].0[l] += share * row.z[l];
                self.u[b].0[l] += share * row.u[l];
            }
        }
        for (theta, step) in self.theta.iter_mut().zip(step.iter()) {
            *theta += share * step;
        }
    }
}

/// The sum of the lanes, in order.
#[inline(always)]
fn total(lanes: &[f64; LANES]) -> f64 {
    lanes.iter().sum()
}
