//! Linear SVMs: an interior-point method on the dual, for many rows with few features.
//!
//! With g_i = y_i (w·x_i + b), the optimality conditions are w = Σ α_i y_i x_i, Σ α_i y_i = 0,
//! g_i − 1 = z_i − u_i, α_i z_i = 0 and (C − α_i) u_i = 0, where α, C − α, z and u are all ≥ 0.
//! Newton steps aim at products α_i z_i and (C − α_i) u_i that are equal to some μ instead of 0.
//! After elimination of α, z and u, only a linear system for (w, b) remains (Ferris and Munson
//! 2002, "Interior-point methods for massive support vector machines").
//!
//! A predictor step and a corrector step choose μ (Mehrotra 1992). The corrector assumes that the
//! full step is feasible. If only a small fraction of the step is feasible, the iteration can cycle
//! (Cartis 2009, "Some disadvantages of a Mehrotra-type primal-dual corrector interior point
//! algorithm for linear programming"). Therefore, once a step has not reduced the sum of the
//! products, all later steps are *plain*. A plain step has no corrector, and it is short enough to
//! stay in a neighbourhood of the central path. The neighbourhood is chosen so that it contains the
//! current point. Inside it, plain steps always reduce the sum (Wright 1997, "Primal-dual
//! interior-point methods", chapter 5).

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays at once")]

use super::gram::LANES;
use crate::invalid::Invalid;
use crate::parallel::{Kernel, in_widest_lanes};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A step covers at most this fraction of the distance to the nearest bound.
const SHARE: f64 = 0.995;
/// Plain steps aim at a mean product in this range, as a fraction of the current mean product.
const PLAIN_CENTRE: (f64, f64) = (0.1, 0.8);
/// Plain steps keep every product at or above this fraction of the mean product. If the smallest
/// product is already below this limit when plain steps begin, the limit is lowered to slightly
/// below the smallest product. Otherwise, there might be no plain step.
const NEIGHBOURHOOD: f64 = 1e-4;
/// Plain steps reduce the sum of products by at least this fraction, times the step length.
const DECREASE: f64 = 0.01;
/// The iteration ends when the mean product is at most this times 1 + C.
const MEAN_PRODUCT: f64 = 1e-12;
/// Maximum number of steps. About fifteen are needed.
const MAX_STEPS: usize = 200;

/// Number of rows in a block. Sums over several rows are formed in registers before they are
/// stored.
const ROWS: usize = 4 * LANES;

type Block = [f64; ROWS];

/// The weights w and the intercept b of a pair's SVM.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) weights: Vec<f64>,
    pub(super) intercept: f64,
    /// The dual variables α, which certify the optimum.
    #[cfg(test)]
    pub(super) alpha: Vec<f64>,
}

impl Plane {
    /// The decision value of a standardised row.
    pub(super) fn decision(&self, row: &[f64]) -> f64 {
        self.weights.iter().zip(row).fold(self.intercept, |sum, (w, x)| sum + w * x)
    }
}

/// Trains the SVM on the rows `data` (row-major, `width` columns, standardised). `sides` is 1 or −1
/// for rows of the two classes, both of which must occur, and 0 for ignored rows.
///
/// # Errors
/// [`Invalid`] if the iteration does not converge.
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
        alpha: state.alpha.as_flattened()[..state.count].to_vec(),
    })
}

/// The current iterate. Rows are in blocks. Padding rows fill the last block; they have y = 0 and
/// no effect.
struct State {
    count: usize,
    c: f64,
    /// w, then b.
    theta: DVector<f64>,
    /// For each block of rows: y times each feature, then y itself.
    columns: Vec<Block>,
    rows: Vec<Row>,
    alpha: Vec<Block>,
    /// C − α. It is stored, because computing the difference would lose digits by cancellation.
    room: Vec<Block>,
    z: Vec<Block>,
    u: Vec<Block>,
}

/// Intermediate results of one pass over a block of rows, for use in the next pass.
#[derive(Clone, Copy)]
struct Row {
    /// 1/α and 1/(C − α).
    over_alpha: Block,
    over_room: Block,
    /// 1/(z/α + u/(C − α)), or 0 for padding rows.
    weight: Block,
    /// 1 − g.
    lack: Block,
    /// Right-hand sides for the products α z and (C − α) u.
    p: Block,
    q: Block,
    /// Changes of α, z and u.
    alpha: Block,
    z: Block,
    u: Block,
}

impl State {
    fn new(width: usize, data: &[f64], sides: &[i8], c: f64) -> Self {
        let mine: Vec<usize> = (0..sides.len()).filter(|&i| sides[i] != 0).collect();
        let count = mine.len();
        let blocks = count.div_ceil(ROWS);
        let stride = width + 1;
        let mut columns = vec![[0.0; ROWS]; blocks * stride];
        for (k, &i) in mine.iter().enumerate() {
            let y = f64::from(sides[i]);
            let columns = &mut columns[k / ROWS * stride..][..stride];
            for (column, &x) in columns.iter_mut().zip(&data[i * width..(i + 1) * width]) {
                column[k % ROWS] = y * x;
            }
            columns[width][k % ROWS] = y;
        }
        // Start inside the box 0 < α < C, on the plane Σ α y = 0.
        let first = mine.iter().filter(|&&i| sides[i] > 0).count() as f64 / count as f64;
        let mut alpha = vec![[0.5 * c; ROWS]; blocks];
        let mut theta = DVector::zeros(width + 1);
        for (k, &i) in mine.iter().enumerate() {
            let share = if sides[i] > 0 { 1.0 - first } else { first };
            alpha.as_flattened_mut()[k] = c * share;
            for (theta, column) in theta.iter_mut().take(width).zip(&columns[k / ROWS * stride..]) {
                *theta += c * share * column[k % ROWS];
            }
        }
        let room = alpha.iter().map(|alpha| alpha.map(|alpha| c - alpha)).collect();
        let (mut z, mut u) = (vec![[1.0; ROWS]; blocks], vec![[1.0; ROWS]; blocks]);
        for k in 0..count {
            let columns = &columns[k / ROWS * stride..];
            let products = (0..width).map(|j| columns[j][k % ROWS] * theta[j]);
            let margin = products.sum::<f64>() - 1.0;
            z.as_flattened_mut()[k] = 1.0 + margin.max(0.0);
            u.as_flattened_mut()[k] = 1.0 + (-margin).max(0.0);
        }
        let zero = [0.0; ROWS];
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
        // The limit of the neighbourhood; `None` until plain steps begin.
        let (mut last, mut neighbourhood) = (f64::INFINITY, None);
        for _ in 0..MAX_STEPS {
            let (gap, system) = state.linearise();
            if !gap.is_finite() {
                return;
            }
            if gap <= MEAN_PRODUCT * (1.0 + state.c) * products {
                *self.converged = true;
                return;
            }
            if gap >= last && neighbourhood.is_none() {
                let present = state.least_product() / (gap / products);
                neighbourhood = Some(NEIGHBOURHOOD.min(0.999 * present));
            }
            last = gap;
            let Some(system) = system.cholesky() else { return };
            // The predictor step aims at products of 0.
            let step = state.solve(&system);
            let (longest, curvature) = state.turn(&step);
            let share = longest.min(1.0);
            let reached = ((1.0 - share) * gap + share * share * curvature).max(0.0) / gap;
            // The corrector step has second-order terms. The less progress the predictor step made,
            // the more the corrector step aims at the central path.
            let centre = reached * reached * reached;
            if neighbourhood.is_some() {
                let (least, most) = PLAIN_CENTRE;
                state.aim(centre.clamp(least, most) * gap / products, 0.0);
            } else {
                state.aim(centre * gap / products, 1.0);
            }
            let step = state.solve(&system);
            let (longest, _) = state.turn(&step);
            let mut share = (SHARE * longest).min(1.0);
            if let Some(neighbourhood) = neighbourhood {
                // Steps shorter than this differ only by rounding errors.
                while share > f64::EPSILON && !state.stays_in(neighbourhood, share, gap) {
                    share *= 0.8;
                }
            }
            state.advance(share, &step);
        }
    }
}

impl State {
    /// Returns the sum of products, and the matrix of the linear system. Sets the right-hand sides
    /// to 0.
    #[inline(always)]
    fn linearise(&mut self) -> (f64, DMatrix<f64>) {
        let Self { theta, columns, rows, alpha, room, z, u, count, .. } = self;
        let n = theta.len();
        let mut sums = vec![[0.0; LANES]; n * (n + 1) / 2];
        let mut gap = [0.0; ROWS];
        for (b, row) in rows.iter_mut().enumerate() {
            let (alpha, room, z, u) = (&alpha[b], &room[b], &z[b], &u[b]);
            let columns = &columns[b * n..(b + 1) * n];
            let mut margin = [0.0; ROWS];
            for (column, &theta) in columns.iter().zip(theta.iter()) {
                for l in 0..ROWS {
                    margin[l] += theta * column[l];
                }
            }
            // 0 for padding rows, otherwise 1.
            let part: Block = if (b + 1) * ROWS <= *count {
                [1.0; ROWS]
            } else {
                core::array::from_fn(|l| f64::from(u8::from(b * ROWS + l < *count)))
            };
            for l in 0..ROWS {
                row.over_alpha[l] = 1.0 / alpha[l];
                row.over_room[l] = 1.0 / room[l];
                row.weight[l] = part[l] / (z[l] * row.over_alpha[l] + u[l] * row.over_room[l]);
                row.lack[l] = 1.0 - margin[l];
                gap[l] += part[l] * (alpha[l] * z[l] + room[l] * u[l]);
            }
            (row.p, row.q) = ([0.0; ROWS], [0.0; ROWS]);
            let mut sums = sums.iter_mut();
            for (i, first) in columns.iter().enumerate() {
                let mut weighted = *first;
                for l in 0..ROWS {
                    weighted[l] *= row.weight[l];
                }
                for (second, sum) in columns[..=i].iter().zip(&mut sums) {
                    add_product(sum, &weighted, second);
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

    /// Solves for the step of (w, b), given the current p and q.
    #[inline(always)]
    fn solve(&self, system: &Cholesky<f64, Dyn>) -> DVector<f64> {
        let mut sums = vec![[0.0; LANES]; self.theta.len()];
        let columns = self.columns.chunks_exact(self.theta.len());
        for ((b, row), columns) in self.rows.iter().enumerate().zip(columns) {
            let mut wanted = [0.0; ROWS];
            for l in 0..ROWS {
                let pull = row.p[l] * row.over_alpha[l] - row.q[l] * row.over_room[l];
                wanted[l] = row.weight[l] * (row.lack[l] + pull) + self.alpha[b][l];
            }
            for (sum, column) in sums.iter_mut().zip(columns) {
                add_product(sum, &wanted, column);
            }
        }
        let mut right = DVector::from_iterator(sums.len(), sums.iter().map(|sum| total(sum)));
        for j in 0..sums.len() - 1 {
            right[j] -= self.theta[j];
        }
        system.solve(&right)
    }

    /// Computes the changes of α, z and u for a step of (w, b). Returns the largest feasible step
    /// length, as a fraction of these changes, and Σ Δα (Δz − Δu).
    #[inline(always)]
    fn turn(&mut self, step: &DVector<f64>) -> (f64, f64) {
        let Self { columns, rows, z, u, .. } = self;
        let mut fastest = [0.0; ROWS];
        let mut curvature = [0.0; ROWS];
        let columns = columns.chunks_exact(step.len());
        for ((b, row), columns) in rows.iter_mut().enumerate().zip(columns) {
            let mut turn = [0.0; ROWS];
            for (column, &step) in columns.iter().zip(step.iter()) {
                for l in 0..ROWS {
                    turn[l] += step * column[l];
                }
            }
            let (z, u) = (&z[b], &u[b]);
            for l in 0..ROWS {
                let (over_alpha, over_room) = (row.over_alpha[l], row.over_room[l]);
                let pull = row.p[l] * over_alpha - row.q[l] * over_room;
                let alpha = row.weight[l] * (row.lack[l] + pull - turn[l]);
                row.alpha[l] = alpha;
                // Padding rows have zero weight and do not change.
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

    /// Sets the right-hand sides for products of μ. Subtracts `second_order` times the second-order
    /// terms of the current changes.
    #[inline(always)]
    fn aim(&mut self, mu: f64, second_order: f64) {
        for row in &mut self.rows {
            for l in 0..ROWS {
                row.p[l] = mu - second_order * row.alpha[l] * row.z[l];
                row.q[l] = mu + second_order * row.alpha[l] * row.u[l];
            }
        }
    }

    fn least_product(&self) -> f64 {
        let places = (0..self.count).map(|k| (k / ROWS, k % ROWS));
        let product = |(b, l): (usize, usize)| {
            (self.alpha[b][l] * self.z[b][l]).min(self.room[b][l] * self.u[b][l])
        };
        places.map(product).fold(f64::INFINITY, f64::min)
    }

    /// Whether a step with this share of the changes keeps every product at or above
    /// `neighbourhood` times the mean product, and sufficiently reduces the sum of products. `gap`
    /// is the sum before the step.
    fn stays_in(&self, neighbourhood: f64, share: f64, gap: f64) -> bool {
        let (mut least, mut sum) = (f64::INFINITY, 0.0);
        for (b, row) in self.rows.iter().enumerate() {
            for l in 0..ROWS.min(self.count - b * ROWS) {
                let change = share * row.alpha[l];
                let first = (self.alpha[b][l] + change) * (self.z[b][l] + share * row.z[l]);
                let second = (self.room[b][l] - change) * (self.u[b][l] + share * row.u[l]);
                least = least.min(first).min(second);
                sum += first + second;
            }
        }
        let mean = sum / (2.0 * self.count as f64);
        least >= neighbourhood * mean && sum <= (1.0 - DECREASE * share) * gap
    }

    /// Takes a step with this share of the changes.
    #[inline(always)]
    fn advance(&mut self, share: f64, step: &DVector<f64>) {
        for (b, row) in self.rows.iter().enumerate() {
            for l in 0..ROWS {
                self.alpha[b][l] += share * row.alpha[l];
                self.room[b][l] -= share * row.alpha[l];
                self.z[b][l] += share * row.z[l];
                self.u[b][l] += share * row.u[l];
            }
        }
        for (theta, step) in self.theta.iter_mut().zip(step.iter()) {
            *theta += share * step;
        }
    }
}

/// Adds the products of corresponding rows of two blocks to `sums`.
#[inline(always)]
fn add_product(sums: &mut [f64; LANES], first: &Block, second: &Block) {
    for l in 0..LANES {
        let product = |part: usize| first[part * LANES + l] * second[part * LANES + l];
        sums[l] += (product(0) + product(1)) + (product(2) + product(3));
    }
}

/// The sum, in index order.
#[inline(always)]
fn total(terms: &[f64]) -> f64 {
    terms.iter().sum()
}
