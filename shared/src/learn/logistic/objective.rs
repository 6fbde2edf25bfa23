//! The penalised loss, its gradient and its Hessian in one pass over the rows.
//!
//! The unknowns form blocks of (weights …, intercept). Two classes have one block, for the score of
//! the second class. K ≥ 3 classes have K − 1 blocks, one for the score of each class except the
//! last. The score of the last class is minus the sum of the other scores.
//!
//! Each column is contiguous, and every sum over rows is accumulated in [`LANES`] partial sums. The
//! results are therefore bit-identical for every SIMD width.

use crate::learn::samples::Samples;
use crate::math::{exp, ln};
use crate::parallel::{Kernel, in_widest_lanes};
use nalgebra::{DMatrix, DVector};

/// Number of partial sums in each sum over rows.
const LANES: usize = 8;

/// Number of rows in a chunk. The intermediate results of a chunk fit into the L1 cache.
const CHUNK: usize = 256;

/// Loss, gradient and Hessian at a point.
pub(super) struct Point {
    pub(super) loss: f64,
    pub(super) gradient: DVector<f64>,
    /// Both triangles are filled.
    pub(super) hessian: DMatrix<f64>,
}

/// The objective function, for any C.
pub(super) struct Objective<'a> {
    labels: &'a [usize],
    classes: usize,
    /// Number of blocks of unknowns: 1 for two classes, otherwise the number of classes minus 1.
    blocks: usize,
    /// Number of unknowns of a block: its weights and its intercept.
    stride: usize,
    /// The columns, each with [`Self::padded`] rows. The last column is all ones. Padding entries
    /// are zero.
    columns: Vec<f64>,
    /// Classes × rows: 1 if the row has the class, otherwise 0.
    wanted: Vec<f64>,
    padded: usize,
    scratch: Scratch,
}

/// Arrays of [`CHUNK`] entries for one chunk of rows. Padding entries have no effect, because the
/// columns are zero there.
struct Scratch {
    /// Scores: blocks × rows. With three or more classes, the last class's scores come after them.
    scores: Vec<f64>,
    /// Probabilities: classes × rows. Used only with three or more classes.
    shares: Vec<f64>,
    /// The highest score of each row. Used only with three or more classes.
    tops: Vec<f64>,
    /// With three or more classes, Σ of exp(score − top) for each row, later replaced by its
    /// inverse. With two classes, exp(−|score|).
    totals: Vec<f64>,
    /// Derivative of the loss with respect to the score of each block: blocks × rows.
    gradients: Vec<f64>,
    /// Second derivatives: pairs of blocks (lower triangle) × rows.
    hessians: Vec<f64>,
    /// A column times a second derivative.
    weighted: Vec<f64>,
}

impl<'a> Objective<'a> {
    pub(super) fn new(samples: &Samples<'a>) -> Self {
        let (width, classes) = (samples.width(), samples.classes());
        let blocks = if classes == 2 { 1 } else { classes - 1 };
        let padded = samples.labels().len().next_multiple_of(LANES);
        let mut columns = vec![0.0; (width + 1) * padded];
        for (i, row) in samples.rows().enumerate() {
            for (j, &value) in row.iter().enumerate() {
                columns[j * padded + i] = value;
            }
            columns[width * padded + i] = 1.0;
        }
        let mut wanted = vec![0.0; classes * padded];
        for (i, &label) in samples.labels().iter().enumerate() {
            wanted[label * padded + i] = 1.0;
        }
        let arrays = |count: usize| vec![0.0; count * CHUNK];
        let scratch = Scratch {
            scores: arrays(classes),
            shares: arrays(classes),
            tops: arrays(1),
            totals: arrays(1),
            gradients: arrays(blocks),
            hessians: arrays(blocks * (blocks + 1) / 2),
            weighted: arrays(1),
        };
        let labels = samples.labels();
        Self { labels, classes, blocks, stride: width + 1, columns, wanted, padded, scratch }
    }

    pub(super) fn width(&self) -> usize {
        self.stride - 1
    }

    pub(super) fn classes(&self) -> usize {
        self.classes
    }

    pub(super) fn unknowns(&self) -> usize {
        self.blocks * self.stride
    }

    /// Second derivative of the penalty with respect to the same weight in blocks `a` and `b`.
    fn penalty(&self, a: usize, b: usize) -> f64 {
        if self.classes > 2 && a == b { 2.0 } else { 1.0 }
    }

    /// The gradient of the penalty, which is the penalty's Hessian times `theta`.
    fn penalty_gradient(&self, theta: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(self.unknowns(), |i, _| {
            let (a, j) = (i / self.stride, i % self.stride);
            if j == self.width() {
                return 0.0;
            }
            (0..self.blocks).map(|b| self.penalty(a, b) * theta[b * self.stride + j]).sum()
        })
    }

    /// Adds `factor` times the penalty's Hessian to `hessian`.
    fn add_penalty(&self, hessian: &mut DMatrix<f64>, factor: f64) {
        for a in 0..self.blocks {
            for b in 0..self.blocks {
                for j in 0..self.width() {
                    hessian[(a * self.stride + j, b * self.stride + j)] +=
                        factor * self.penalty(a, b);
                }
            }
        }
    }

    /// Extrapolates from the minimum `theta` to the minimum for C times `ratio`. This is one Newton
    /// step with the Hessian at `point`, which is close to `theta`. It needs no pass over the rows.
    pub(super) fn carried_over(
        &self,
        theta: &DVector<f64>,
        point: &Point,
        ratio: f64,
    ) -> Option<DVector<f64>> {
        let pull = self.penalty_gradient(theta) * (ratio - 1.0);
        let mut hessian = &point.hessian * ratio;
        self.add_penalty(&mut hessian, 1.0 - ratio);
        Some(theta + hessian.cholesky()?.solve(&pull))
    }

    /// Loss, gradient and Hessian at `theta` for this C.
    pub(super) fn at(&mut self, theta: &DVector<f64>, c: f64) -> Point {
        let n = self.unknowns();
        let sums = self.sums(theta);
        let penalty = self.penalty_gradient(theta);
        let loss = c * sums.loss + 0.5 * penalty.dot(theta);
        let gradient = DVector::from_vec(sums.gradient) * c + penalty;
        let mut hessian = DMatrix::from_vec(n, n, sums.hessian) * c;
        hessian.fill_upper_triangle_with_lower_triangle();
        self.add_penalty(&mut hessian, 1.0);
        Point { loss, gradient, hessian }
    }

    fn sums(&mut self, theta: &DVector<f64>) -> Sums {
        let mut sums = Sums::zero(self.unknowns());
        in_widest_lanes(Pass { objective: self, theta: theta.as_slice(), sums: &mut sums });
        sums
    }
}

/// Sums over rows, without the factor C and without the penalty.
#[derive(Debug, PartialEq)]
struct Sums {
    loss: f64,
    gradient: Vec<f64>,
    /// Column-major; the lower triangle is filled.
    hessian: Vec<f64>,
}

impl Sums {
    fn zero(unknowns: usize) -> Self {
        Self { loss: 0.0, gradient: vec![0.0; unknowns], hessian: vec![0.0; unknowns * unknowns] }
    }
}

struct Pass<'a, 'b> {
    objective: &'a mut Objective<'b>,
    theta: &'a [f64],
    sums: &'a mut Sums,
}

impl Kernel for Pass<'_, '_> {
    #[inline(always)]
    fn run(self) {
        let Objective { labels, classes, blocks, stride, columns, wanted, padded, scratch } =
            self.objective;
        let (blocks, stride, unknowns) = (*blocks, *stride, *blocks * *stride);
        for begin in (0..*padded).step_by(CHUNK) {
            let rows = CHUNK.min(*padded - begin);
            let column = |j: usize| &columns[j * *padded + begin..][..rows];
            for a in 0..blocks {
                let scores = &mut scratch.scores[a * CHUNK..][..rows];
                scores.fill(0.0);
                for (j, &weight) in self.theta[a * stride..][..stride].iter().enumerate() {
                    for (score, x) in scores.iter_mut().zip(column(j)) {
                        *score += weight * x;
                    }
                }
            }
            let here = &labels[begin..labels.len().min(begin + rows)];
            let wanted = |class: usize| &wanted[class * *padded + begin..][..rows];
            self.sums.loss += if *classes == 2 {
                scratch.of_two(here, wanted(1))
            } else {
                scratch.of_several(here, blocks, rows, &wanted)
            };
            for a in 0..blocks {
                let gradients = &scratch.gradients[a * CHUNK..][..rows];
                dots(gradients, &column, &mut self.sums.gradient[a * stride..][..stride]);
                for b in 0..=a {
                    let hessians = &scratch.hessians[(a * (a + 1) / 2 + b) * CHUNK..][..rows];
                    for j in 0..stride {
                        let weighted = &mut scratch.weighted[..rows];
                        for ((w, x), c) in weighted.iter_mut().zip(column(j)).zip(hessians) {
                            *w = x * c;
                        }
                        // The output is column j of block b, in the rows of block a. Diagonal
                        // blocks are symmetric, so only their lower triangle is computed.
                        let first = if a == b { j } else { 0 };
                        let at = (b * stride + j) * unknowns + a * stride;
                        let out = &mut self.sums.hessian[at + first..at + stride];
                        dots(weighted, &|i| column(first + i), out);
                    }
                }
            }
        }
    }
}

impl Scratch {
    /// Returns the loss of a chunk of rows if there are two classes, given the scores of the rows.
    /// Also computes gradients and Hessians.
    #[inline(always)]
    fn of_two(&mut self, labels: &[usize], wanted: &[f64]) -> f64 {
        let rows = wanted.len();
        let (scores, totals) = (&self.scores[..rows], &mut self.totals[..rows]);
        for (total, score) in totals.iter_mut().zip(scores) {
            *total = exp(-score.abs());
        }
        let derivatives = self.gradients.iter_mut().zip(&mut self.hessians);
        for (((&score, &small), wanted), (gradient, hessian)) in
            scores.iter().zip(&*totals).zip(wanted).zip(derivatives)
        {
            let inverse = 1.0 / (1.0 + small);
            let share = if score > 0.0 { inverse } else { small * inverse };
            *gradient = share - wanted;
            *hessian = small * inverse * inverse;
        }
        let mut loss = Loss::default();
        for ((&label, &score), &small) in labels.iter().zip(scores).zip(&*totals) {
            let against = if label == 1 { -score } else { score };
            loss.add(against.max(0.0), 1.0 + small);
        }
        loss.total()
    }

    /// Like [`Self::of_two`], for three or more classes.
    #[inline(always)]
    fn of_several<'a>(
        &mut self,
        labels: &[usize],
        blocks: usize,
        rows: usize,
        wanted: &impl Fn(usize) -> &'a [f64],
    ) -> f64 {
        let (scores, last) = self.scores.split_at_mut(blocks * CHUNK);
        let (tops, totals) = (&mut self.tops[..rows], &mut self.totals[..rows]);
        last.fill(0.0);
        for scores in scores.chunks_exact(CHUNK) {
            for (last, score) in last.iter_mut().zip(scores) {
                *last -= score;
            }
        }
        tops.fill(f64::NEG_INFINITY);
        for scores in self.scores.chunks_exact(CHUNK) {
            for (top, &score) in tops.iter_mut().zip(scores) {
                *top = if score > *top { score } else { *top };
            }
        }
        totals.fill(0.0);
        for (shares, scores) in
            self.shares.chunks_exact_mut(CHUNK).zip(self.scores.chunks_exact(CHUNK))
        {
            for ((share, score), top) in shares.iter_mut().zip(scores).zip(&*tops) {
                *share = exp(score - top);
            }
            for (total, share) in totals.iter_mut().zip(&*shares) {
                *total += share;
            }
        }
        let mut loss = Loss::default();
        for (i, &label) in labels.iter().enumerate() {
            loss.add(tops[i] - self.scores[label * CHUNK + i], totals[i]);
        }
        for total in totals.iter_mut() {
            *total = 1.0 / *total;
        }
        for shares in self.shares.chunks_exact_mut(CHUNK) {
            for (share, inverse) in shares.iter_mut().zip(&*totals) {
                *share *= inverse;
            }
        }
        let share = |class: usize| &self.shares[class * CHUNK..][..rows];
        let last = share(blocks);
        for a in 0..blocks {
            let gradients = &mut self.gradients[a * CHUNK..][..rows];
            let missed = wanted(a).iter().zip(wanted(blocks));
            for (((gradient, p), last), (own, other)) in
                gradients.iter_mut().zip(share(a)).zip(last).zip(missed)
            {
                *gradient = (p - own) - (last - other);
            }
            for b in 0..=a {
                let same = if a == b { 1.0 } else { 0.0 };
                let hessians = &mut self.hessians[(a * (a + 1) / 2 + b) * CHUNK..][..rows];
                for (((hessian, p), q), last) in
                    hessians.iter_mut().zip(share(a)).zip(share(b)).zip(last)
                {
                    *hessian = same * p + last - (p - last) * (q - last);
                }
            }
        }
        loss.total()
    }
}

/// A sum of terms and logarithms. Factors are multiplied first, because one logarithm of their
/// product is cheaper than one logarithm per factor.
struct Loss {
    sum: f64,
    product: f64,
}

impl Default for Loss {
    fn default() -> Self {
        Self { sum: 0.0, product: 1.0 }
    }
}

impl Loss {
    #[inline(always)]
    fn add(&mut self, term: f64, factor: f64) {
        self.sum += term;
        self.product *= factor;
        if self.product > 1e100 {
            self.sum += ln(self.product);
            self.product = 1.0;
        }
    }

    fn total(self) -> f64 {
        self.sum + ln(self.product)
    }
}

/// Adds the inner product of `weights` and column(i) over the rows to each `out[i]`.
#[inline(always)]
fn dots<'a>(weights: &[f64], column: &impl Fn(usize) -> &'a [f64], out: &mut [f64]) {
    let weights = weights.as_chunks::<LANES>().0;
    let column = |i: usize| &column(i).as_chunks::<LANES>().0[..weights.len()];
    let (fours, rest) = out.as_chunks_mut::<4>();
    let done = 4 * fours.len();
    for (i, out) in fours.iter_mut().enumerate() {
        let mut partial = [[0.0; LANES]; 4];
        let columns = column(4 * i).iter().zip(column(4 * i + 1));
        let columns = columns.zip(column(4 * i + 2)).zip(column(4 * i + 3));
        for (w, (((x0, x1), x2), x3)) in weights.iter().zip(columns) {
            for lane in 0..LANES {
                partial[0][lane] += w[lane] * x0[lane];
                partial[1][lane] += w[lane] * x1[lane];
                partial[2][lane] += w[lane] * x2[lane];
                partial[3][lane] += w[lane] * x3[lane];
            }
        }
        for (out, partial) in out.iter_mut().zip(partial) {
            *out += total(partial);
        }
    }
    for (i, out) in rest.iter_mut().enumerate() {
        let mut partial = [0.0; LANES];
        for (w, x) in weights.iter().zip(column(done + i)) {
            for lane in 0..LANES {
                partial[lane] += w[lane] * x[lane];
            }
        }
        *out += total(partial);
    }
}

#[inline(always)]
fn total(p: [f64; LANES]) -> f64 {
    ((p[0] + p[4]) + (p[2] + p[6])) + ((p[1] + p[5]) + (p[3] + p[7]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    /// The penalised loss, computed directly from its definition.
    fn plain_loss(samples: &Samples<'_>, theta: &DVector<f64>, c: f64) -> f64 {
        let stride = samples.width() + 1;
        let blocks: Vec<&[f64]> = theta.as_slice().chunks_exact(stride).collect();
        let mut weights: Vec<Vec<f64>> = blocks.iter().map(|block| block.to_vec()).collect();
        let two = samples.classes() == 2;
        let minus_sum =
            |j: usize| if two { 0.0 } else { -blocks.iter().map(|block| block[j]).sum::<f64>() };
        let other = (0..stride).map(minus_sum).collect();
        if two {
            weights.insert(0, other)
        } else {
            weights.push(other)
        }
        let mut loss = 0.0;
        for (row, &label) in samples.rows().zip(samples.labels()) {
            let score =
                |w: &Vec<f64>| w[stride - 1] + row.iter().zip(w).map(|(x, w)| x * w).sum::<f64>();
            let scores: Vec<f64> = weights.iter().map(score).collect();
            loss += ln(scores.iter().map(|s| exp(*s)).sum()) - scores[label];
        }
        let squares = weights.iter().flat_map(|w| &w[..stride - 1]).map(|w| w * w).sum::<f64>();
        c * loss + 0.5 * squares
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let mut rng = SeededRng::new(2);
        // The cases include fewer rows than lanes, and more rows than a chunk.
        for (n, classes) in [(5, 2), (5, 3), (300, 2), (300, 3), (300, 5)] {
            let width = 4;
            let values: Vec<f64> = (0..n * width).map(|_| rng.uniform(-1.5, 1.5)).collect();
            let labels: Vec<usize> = (0..n).map(|i| i % classes).collect();
            let samples = Samples::new(width, &values, &labels, classes).unwrap();
            let mut objective = Objective::new(&samples);
            let unknowns = objective.unknowns();
            let theta = DVector::from_fn(unknowns, |_, _| rng.uniform(-1.0, 1.0));
            let point = objective.at(&theta, 0.7);
            let exact = plain_loss(&samples, &theta, 0.7);
            assert!((point.loss - exact).abs() < 1e-12 * exact, "{} {exact}", point.loss);
            for i in 0..unknowns {
                let h = 1e-5;
                let moved = |sign: f64| {
                    let mut theta = theta.clone();
                    theta[i] += sign * h;
                    theta
                };
                let (high, low) = (objective.at(&moved(1.0), 0.7), objective.at(&moved(-1.0), 0.7));
                let change = (high.loss - low.loss) / (2.0 * h);
                assert!((change - point.gradient[i]).abs() < 1e-7 * (1.0 + change.abs()));
                let changes = (high.gradient - low.gradient) / (2.0 * h);
                for j in 0..unknowns {
                    let hessian = point.hessian[(i, j)];
                    assert!((changes[j] - hessian).abs() < 1e-6 * (1.0 + hessian.abs()));
                }
            }
        }
    }

    #[test]
    fn lanes_change_no_bit() {
        let mut rng = SeededRng::new(5);
        for classes in [2, 3] {
            let (n, width) = (700, 7);
            let values: Vec<f64> = (0..n * width).map(|_| rng.uniform(-2.0, 2.0)).collect();
            let labels: Vec<usize> = (0..n).map(|_| rng.below(classes)).collect();
            let samples = Samples::new(width, &values, &labels, classes).unwrap();
            let mut objective = Objective::new(&samples);
            let n = objective.unknowns();
            let theta = DVector::from_fn(n, |_, _| rng.uniform(-1.0, 1.0));
            let wide = objective.sums(&theta);
            let mut narrow = Sums::zero(n);
            Pass { objective: &mut objective, theta: theta.as_slice(), sums: &mut narrow }.run();
            assert_eq!(wide, narrow);
        }
    }

    #[test]
    fn scores_far_away_overflow_nothing() {
        for classes in [2, 3] {
            let labels = [1, 0, classes - 1];
            let samples = Samples::new(1, &[1.0, -1.0, 2.0], &labels, classes).unwrap();
            let mut objective = Objective::new(&samples);
            let theta = DVector::from_element(objective.unknowns(), -1000.0);
            let point = objective.at(&theta, 1.0);
            assert!(point.loss.is_finite());
            assert!(point.gradient.iter().chain(point.hessian.iter()).all(|x| x.is_finite()));
        }
    }
}
