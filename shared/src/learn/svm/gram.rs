//! Kernel matrices for SIMD code. Each row is computed on first use.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays at once")]

use crate::parallel::{Kernel, in_widest_lanes};
use crate::predict::svm::exponential::{exp32, exp64};
use crate::real::Real;

/// Number of entries in a block. All work is done in whole blocks, for every SIMD width.
pub(super) const LANES: usize = 16;

/// A block of a row, aligned to a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Block<T>(pub(super) [T; LANES]);

impl<T: Real> Block<T> {
    pub(super) fn all(value: T) -> Self {
        Self([value; LANES])
    }
}

/// The entries of a row's blocks.
pub(super) fn entries<T>(blocks: &[Block<T>]) -> impl Iterator<Item = &T> {
    blocks.iter().flat_map(|block| &block.0)
}

/// Entry `i` of a row's blocks.
#[inline(always)]
pub(super) fn entry<T>(blocks: &[Block<T>], i: usize) -> &T {
    &blocks[i / LANES].0[i % LANES]
}

/// Entry `i` of a row's blocks, mutable.
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

/// Rows of a matrix. Each row is computed on first use, and many rows are never used.
#[derive(Clone, Debug)]
struct Lazy<T> {
    /// The position of each row in `data`, counted in rows. It is [`NOWHERE`] until the row is
    /// computed.
    place: Vec<u32>,
    data: Vec<Block<T>>,
}

const NOWHERE: u32 = u32::MAX;

impl<T: Entry> Lazy<T> {
    fn empty() -> Self {
        Self { place: Vec::new(), data: Vec::new() }
    }

    /// Removes all rows. Reserves address space for all `rows` rows, but only rows in use consume
    /// memory.
    fn reset(&mut self, rows: usize, blocks: usize) {
        self.place.clear();
        self.place.resize(rows, NOWHERE);
        self.data.clear();
        self.data.reserve_exact(rows * blocks);
    }

    fn has(&self, i: usize) -> bool {
        self.place[i] != NOWHERE
    }

    #[inline(always)]
    fn row(&self, i: usize, blocks: usize) -> &[Block<T>] {
        &self.data[self.place[i] as usize * blocks..][..blocks]
    }

    /// Adds row `i`, filled with zeros.
    fn add(&mut self, i: usize, blocks: usize) -> &mut [Block<T>] {
        let begin = self.data.len();
        self.place[i] = (begin / blocks) as u32;
        self.data.resize(begin + blocks, Block::all(T::ZERO));
        &mut self.data[begin..]
    }
}

/// The kernel exp(−γ · squared distance) between all data rows and the training rows. The training
/// rows are the first `columns` data rows; the other data rows are held out. Each row of the kernel
/// is computed on first use.
#[derive(Clone, Debug)]
pub(super) struct Gram<T> {
    width: usize,
    columns: usize,
    gamma: T,
    /// Row-major.
    data: Vec<f64>,
    /// The first `columns` rows in blocks, feature by feature within each block.
    by_block: Vec<Block<T>>,
    /// Squared distances. They are cached only if several γ are used on the same data.
    squares: Option<Lazy<T>>,
    kernel: Lazy<T>,
}

impl<T: Entry> Gram<T> {
    /// Empty buffers. `of_several` states whether several γ will be used on the same data.
    pub(super) fn empty(of_several: bool) -> Self {
        Self {
            width: 0,
            columns: 0,
            gamma: T::ZERO,
            data: Vec::new(),
            by_block: Vec::new(),
            squares: of_several.then(Lazy::empty),
            kernel: Lazy::empty(),
        }
    }

    /// Sets the data rows (row-major, `width` columns). The first `columns` rows are for training.
    /// The caller must then call [`Self::set_gamma`].
    pub(super) fn set_data(&mut self, width: usize, data: &[f64], columns: usize) {
        (self.width, self.columns) = (width, columns);
        self.data.clear();
        self.data.extend_from_slice(data);
        let entry =
            |i: usize, j: usize| T::from_f64(if i < columns { data[i * width + j] } else { 0.0 });
        let block = |b: usize, j: usize| Block(core::array::from_fn(|l| entry(b * LANES + l, j)));
        self.by_block.clear();
        for b in 0..self.blocks() {
            self.by_block.extend((0..width).map(|j| block(b, j)));
        }
        let (rows, blocks) = (data.len() / width, self.blocks());
        if let Some(squares) = &mut self.squares {
            squares.reset(rows, blocks);
        }
        self.kernel.reset(rows, blocks);
    }

    /// Sets γ and drops all computed rows of the kernel.
    pub(super) fn set_gamma(&mut self, gamma: f64) {
        self.gamma = T::from_f64(gamma);
        self.kernel.reset(self.data.len() / self.width, self.blocks());
    }

    /// Number of training rows, which is the number of columns.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Number of blocks in a row.
    pub(super) fn blocks(&self) -> usize {
        self.columns.div_ceil(LANES)
    }

    /// Computes row `i` unless it is cached.
    pub(super) fn want(&mut self, i: usize) {
        if !self.kernel.has(i) {
            let Self { width, gamma, data, by_block, squares, kernel, .. } = self;
            let out = kernel.add(i, by_block.len() / *width);
            let row = &data[i * *width..(i + 1) * *width];
            in_widest_lanes(Fresh { gamma: *gamma, i, row, by_block, squares, out });
        }
    }

    /// Row `i`, which must already be computed. Its padding entries have no meaning.
    #[inline(always)]
    pub(super) fn row(&self, i: usize) -> &[Block<T>] {
        self.kernel.row(i, self.blocks())
    }

    /// Computes row `i` into `out` without caching it. The row's squared distances are still cached
    /// if several γ are used.
    pub(super) fn row_into(&mut self, i: usize, out: &mut [Block<T>]) {
        let Self { width, gamma, data, by_block, squares, .. } = self;
        let row = &data[i * *width..(i + 1) * *width];
        in_widest_lanes(Fresh { gamma: *gamma, i, row, by_block, squares, out });
    }

    /// Like [`Self::row_into`], but with the SIMD width of the build target.
    #[cfg(test)]
    pub(super) fn row_into_plainly(&mut self, i: usize, out: &mut [Block<T>]) {
        let Self { width, gamma, data, by_block, squares, .. } = self;
        let row = &data[i * *width..(i + 1) * *width];
        Fresh { gamma: *gamma, i, row, by_block, squares, out }.run();
    }

    /// A matrix of the inner products of all rows, instead of kernel values.
    #[cfg(test)]
    pub(super) fn of_products(width: usize, data: &[f64]) -> Self {
        let mut gram = Self::empty(false);
        gram.set_data(width, data, data.len() / width);
        for (i, a) in data.chunks_exact(width).enumerate() {
            let blocks = gram.blocks();
            let row = gram.kernel.add(i, blocks);
            for (j, b) in data.chunks_exact(width).enumerate() {
                let product = a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                *entry_mut(row, j) = T::from_f64(product);
            }
        }
        gram
    }
}

/// Computes row `i` of the kernel from the squared distances. Missing distances are computed first.
struct Fresh<'a, T> {
    gamma: T,
    i: usize,
    row: &'a [f64],
    by_block: &'a [Block<T>],
    squares: &'a mut Option<Lazy<T>>,
    out: &'a mut [Block<T>],
}

impl<T: Entry> Kernel for Fresh<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { gamma, i, row, by_block, squares, out } = self;
        match squares {
            None => {
                distances(row, by_block, out);
                for out in out {
                    for entry in &mut out.0 {
                        *entry = (-gamma * *entry).exp();
                    }
                }
            }
            Some(squares) => {
                let blocks = out.len();
                if !squares.has(i) {
                    distances(row, by_block, squares.add(i, blocks));
                }
                for (out, square) in out.iter_mut().zip(squares.row(i, blocks)) {
                    for (out, &square) in out.0.iter_mut().zip(&square.0) {
                        *out = (-gamma * square).exp();
                    }
                }
            }
        }
    }
}

/// Squared distances between `row` and all columns (training rows).
#[inline(always)]
fn distances<T: Entry>(row: &[f64], by_block: &[Block<T>], out: &mut [Block<T>]) {
    for (out, features) in out.iter_mut().zip(by_block.chunks_exact(row.len())) {
        let mut sum = [T::ZERO; LANES];
        for (column, &x) in features.iter().zip(row) {
            let x = T::from_f64(x);
            for (sum, &y) in sum.iter_mut().zip(&column.0) {
                *sum += (x - y) * (x - y);
            }
        }
        *out = Block(sum);
    }
}

/// Adds multiples of kernel rows to `sums`, starting at block `first`. `rows` contains the index
/// and the factor of each kernel row.
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

/// Number of adjacent blocks of coefficients that are stored or omitted together.
const GROUP: usize = 4;
/// Number of rows that are multiplied together, so that each coefficient is read only once for all
/// of these rows.
pub(super) const TOGETHER: usize = 4;

/// Coefficients, without the groups of blocks that contain only zeros.
#[derive(Clone, Debug)]
pub(super) struct Sparse {
    groups: Vec<(usize, [Block<f64>; GROUP])>,
    /// Blocks after the last whole group.
    rest: Vec<Block<f64>>,
}

impl Sparse {
    pub(super) fn new(blocks: &[Block<f64>]) -> Self {
        let (groups, rest) = blocks.as_chunks::<GROUP>();
        let counts = |group: &[Block<f64>]| entries(group).any(|&entry| entry != 0.0);
        let groups = groups.iter().copied().enumerate().filter(|(_, group)| counts(group));
        Self { groups: groups.collect(), rest: rest.to_vec() }
    }
}

/// Computes inner products of rows and coefficients.
pub(super) struct Products<'a, T> {
    /// Number of blocks in a row.
    pub(super) blocks: usize,
    /// [`TOGETHER`] rows.
    pub(super) rows: &'a [Block<T>],
    pub(super) coefficients: &'a [Sparse],
    /// For each set of coefficients, one result per row.
    pub(super) out: &'a mut [[f64; TOGETHER]],
}

impl<T: Entry> Kernel for Products<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { blocks, rows, coefficients, out } = self;
        let rows: [&[Block<T>]; TOGETHER] =
            core::array::from_fn(|r| &rows[r * blocks..(r + 1) * blocks]);
        let rows = rows.map(|row| row.as_chunks::<GROUP>());
        for (coefficients, out) in coefficients.iter().zip(out) {
            let mut sums = [[0.0; LANES]; TOGETHER];
            for (place, shares) in &coefficients.groups {
                for (sums, (groups, _)) in sums.iter_mut().zip(&rows) {
                    let group = &groups[*place];
                    for l in 0..LANES {
                        let product = |k: usize| shares[k].0[l] * group[k].0[l].to_f64();
                        sums[l] += (product(0) + product(1)) + (product(2) + product(3));
                    }
                }
            }
            for (sums, (_, rest)) in sums.iter_mut().zip(&rows) {
                for (block, shares) in rest.iter().zip(&coefficients.rest) {
                    for ((sum, entry), share) in sums.iter_mut().zip(block.0).zip(shares.0) {
                        *sum += share * entry.to_f64();
                    }
                }
            }
            *out = sums.map(|sums| sums.iter().sum());
        }
    }
}
