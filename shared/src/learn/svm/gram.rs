//! Kernel matrices in lanes.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays at once")]

use crate::parallel::{Kernel, in_widest_lanes};
use crate::predict::svm::exponential::{exp32, exp64};
use crate::real::Real;

/// Entries of a block. Work is done block by block whatever the machine's own lane width.
pub(super) const LANES: usize = 16;

/// A block of a row, on a cache line of its own.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Block<T>(pub(super) [T; LANES]);

impl<T: Real> Block<T> {
    pub(super) fn all(value: T) -> Self {
        Self([value; LANES])
    }
}

/// The entries of blocks in a row.
pub(super) fn entries<T>(blocks: &[Block<T>]) -> impl Iterator<Item = &T> {
    blocks.iter().flat_map(|block| &block.0)
}

/// Entry `i` of blocks in a row.
#[inline(always)]
pub(super) fn entry<T>(blocks: &[Block<T>], i: usize) -> &T {
    &blocks[i / LANES].0[i % LANES]
}

/// Entry `i` of blocks in a row.
#[inline(always)]
pub(super) fn entry_mut<T>(blocks: &mut [Block<T>], i: usize) -> &mut T {
    &mut blocks[i / LANES].0[i % LANES]
}

/// A number type of kernel matrices.
pub(super) trait Entry: Real {
    /// eˣ for x ≤ 0.
    fn exp(self) -> Self;
}

impl Entry for f32 {
    #[inline(always)]
    fn exp(self) -> Self {
        exp32(self)
    }
}

impl Entry for f64 {
    #[inline(always)]
    fn exp(self) -> Self {
        exp64(self)
    }
}

/// A matrix of a number for each of some rows of data and each of the first `columns` of
/// them (those that are trained on; the others are held out).
#[derive(Clone, Debug)]
pub(super) struct Gram<T> {
    columns: usize,
    data: Vec<Block<T>>,
}

impl<T: Entry> Gram<T> {
    /// Room for matrices to come.
    pub(super) fn empty() -> Self {
        Self { columns: 0, data: Vec::new() }
    }

    /// Rows (and columns) that are trained on.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Blocks of a row.
    pub(super) fn blocks(&self) -> usize {
        self.columns.div_ceil(LANES)
    }

    /// A row; what stands behind its last column means nothing.
    #[inline(always)]
    pub(super) fn row(&self, i: usize) -> &[Block<T>] {
        &self.data[i * self.blocks()..(i + 1) * self.blocks()]
    }

    fn resize(&mut self, rows: usize, columns: usize) {
        self.columns = columns;
        self.data.resize(rows * self.blocks(), Block::all(T::ZERO));
    }

    /// Becomes the squared distances of the rows `data` (row-major, `width` columns).
    pub(super) fn become_squares(&mut self, width: usize, data: &[f64], columns: usize) {
        self.resize(data.len() / width, columns);
        let by_column = transposed(width, data, columns);
        in_widest_lanes(Squares { width, data, by_column: &by_column, gram: self });
    }

    /// Becomes the inner products of the rows.
    #[cfg(test)]
    pub(super) fn become_products(&mut self, width: usize, data: &[f64], columns: usize) {
        self.resize(data.len() / width, columns);
        let blocks = self.blocks();
        for (i, row) in self.data.chunks_mut(blocks).enumerate() {
            for j in 0..columns {
                let (a, b) = (&data[i * width..][..width], &data[j * width..][..width]);
                row[j / LANES].0[j % LANES] =
                    T::from_f64(a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>());
            }
        }
    }

    /// From squares to exp(−γ · squares).
    pub(super) fn apply_rbf(&mut self, gamma: f64) {
        let gamma = T::from_f64(gamma);
        in_widest_lanes(InPlace { gamma, data: &mut self.data });
    }

    /// The same in the lanes that the build assumes.
    #[cfg(test)]
    pub(super) fn apply_rbf_plainly(&mut self, gamma: f64) {
        InPlace { gamma: T::from_f64(gamma), data: &mut self.data }.run();
    }

    /// Becomes exp(−γ · squares).
    pub(super) fn become_rbf(&mut self, squares: &Self, gamma: f64) {
        self.columns = squares.columns;
        self.data.resize(squares.data.len(), Block::all(T::ZERO));
        let gamma = T::from_f64(gamma);
        in_widest_lanes(Exponentials { squares: &squares.data, gamma, data: &mut self.data });
    }
}

/// Feature by feature, the blocks of the first `columns` rows.
fn transposed<T: Entry>(width: usize, data: &[f64], columns: usize) -> Vec<Vec<Block<T>>> {
    let entry =
        |i: usize, j: usize| T::from_f64(if i < columns { data[i * width + j] } else { 0.0 });
    let block = |b: usize, j: usize| Block(core::array::from_fn(|l| entry(b * LANES + l, j)));
    (0..width).map(|j| (0..columns.div_ceil(LANES)).map(|b| block(b, j)).collect()).collect()
}

struct Squares<'a, T> {
    width: usize,
    data: &'a [f64],
    by_column: &'a [Vec<Block<T>>],
    gram: &'a mut Gram<T>,
}

impl<T: Entry> Kernel for Squares<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { width, data, by_column, gram } = self;
        let blocks = gram.blocks();
        for (row, data) in gram.data.chunks_exact_mut(blocks).zip(data.chunks_exact(width)) {
            for (b, out) in row.iter_mut().enumerate() {
                let mut sum = [T::ZERO; LANES];
                for (column, &x) in by_column.iter().zip(data) {
                    let x = T::from_f64(x);
                    for (sum, &y) in sum.iter_mut().zip(&column[b].0) {
                        *sum += (x - y) * (x - y);
                    }
                }
                *out = Block(sum);
            }
        }
    }
}

struct Exponentials<'a, T> {
    squares: &'a [Block<T>],
    gamma: T,
    data: &'a mut [Block<T>],
}

impl<T: Entry> Kernel for Exponentials<'_, T> {
    #[inline(always)]
    fn run(self) {
        for (out, square) in self.data.iter_mut().zip(self.squares) {
            for (out, &square) in out.0.iter_mut().zip(&square.0) {
                *out = (-self.gamma * square).exp();
            }
        }
    }
}

struct InPlace<'a, T> {
    gamma: T,
    data: &'a mut [Block<T>],
}

impl<T: Entry> Kernel for InPlace<'_, T> {
    #[inline(always)]
    fn run(self) {
        for block in self.data {
            for entry in &mut block.0 {
                *entry = (-self.gamma * *entry).exp();
            }
        }
    }
}

/// Adds `share` times each given row to `sums`, on a run of blocks.
pub(super) struct Combine<'a, T> {
    pub(super) gram: &'a Gram<T>,
    pub(super) rows: &'a [(usize, f64)],
    pub(super) first: usize,
    pub(super) sums: &'a mut [Block<f64>],
}

impl<T: Entry> Kernel for Combine<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { gram, rows, first, sums } = self;
        let run = |i: usize| &gram.row(i)[first..first + sums.len()];
        let (fours, rest) = rows.as_chunks::<4>();
        let fours = fours.iter().map(|four| (four.map(|(i, _)| run(i)), four.map(|(_, s)| s)));
        let fours: Vec<_> = fours.collect();
        let rest: Vec<_> = rest.iter().map(|&(i, share)| (run(i), share)).collect();
        for ([first, second, third, fourth], shares) in fours {
            let pairs = first.iter().zip(second).zip(third.iter().zip(fourth));
            for (sums, ((first, second), (third, fourth))) in sums.iter_mut().zip(pairs) {
                for l in 0..LANES {
                    let product = |k: usize, block: &Block<T>| shares[k] * block.0[l].to_f64();
                    sums.0[l] += (product(0, first) + product(1, second))
                        + (product(2, third) + product(3, fourth));
                }
            }
        }
        for (run, share) in rest {
            for (block, sums) in run.iter().zip(&mut *sums) {
                for (sum, entry) in sums.0.iter_mut().zip(block.0) {
                    *sum += share * entry.to_f64();
                }
            }
        }
    }
}

/// Inner products of held-out rows with coefficient vectors, on runs of blocks.
pub(super) struct Products<'a, T> {
    pub(super) gram: &'a Gram<T>,
    pub(super) row: usize,
    /// Blocks of one machine after the other.
    pub(super) coefficients: &'a [Vec<Block<f64>>],
    pub(super) out: &'a mut [f64],
}

impl<T: Entry> Kernel for Products<'_, T> {
    #[inline(always)]
    fn run(self) {
        let row = self.gram.row(self.row);
        for (coefficients, out) in self.coefficients.iter().zip(self.out) {
            let mut sums = [0.0; LANES];
            let (fours, rest) = coefficients.as_chunks::<4>();
            let (row_fours, row_rest) = row.as_chunks::<4>();
            for (blocks, coefficients) in row_fours.iter().zip(fours) {
                for l in 0..LANES {
                    let product = |k: usize| coefficients[k].0[l] * blocks[k].0[l].to_f64();
                    sums[l] += (product(0) + product(1)) + (product(2) + product(3));
                }
            }
            for (block, coefficients) in row_rest.iter().zip(rest) {
                for ((sum, entry), share) in sums.iter_mut().zip(block.0).zip(coefficients.0) {
                    *sum += share * entry.to_f64();
                }
            }
            *out = sums.iter().sum();
        }
    }
}
