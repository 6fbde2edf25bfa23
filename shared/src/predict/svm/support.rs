//! Support vectors in SIMD lanes. Each kernel value is computed once and used for all pairs.

use super::exponential::exp64;
use crate::parallel::{Kernel, in_widest_lanes};

/// Number of support vectors in a block. Each lane has its own sum, and the sums of the lanes are
/// added in order, so the processor's SIMD width has no effect on the result.
const LANES: usize = 8;

type Lanes = [f64; LANES];

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Support {
    gamma: f64,
    width: usize,
    count: usize,
    /// Blocks of vectors × features. Entries after the last vector are zero.
    vectors: Vec<Lanes>,
    /// Blocks of vectors × pairs. Entries after the last vector are zero.
    dual: Vec<Lanes>,
    pairs: usize,
}

impl Support {
    /// Lays out row-major vectors (`count` × `width`) and coefficients (`pairs` × `count`) in
    /// blocks.
    pub(super) fn new(
        gamma: f64,
        width: usize,
        count: usize,
        vectors: &[f64],
        dual: &[f64],
        pairs: usize,
    ) -> Self {
        let blocks = count.div_ceil(LANES);
        let at = |block: usize, lane: usize| Some(block * LANES + lane).filter(|&i| i < count);
        let lay = |columns: usize, value: &dyn Fn(usize, usize) -> f64| -> Vec<Lanes> {
            let cells = (0..blocks).flat_map(|block| (0..columns).map(move |j| (block, j)));
            cells
                .map(|(block, j)| {
                    core::array::from_fn(|lane| at(block, lane).map_or(0.0, |i| value(i, j)))
                })
                .collect()
        };
        let vectors = lay(width, &|i, j| vectors[i * width + j]);
        let dual = lay(pairs, &|i, pair| dual.get(pair * count + i).copied().unwrap_or(0.0));
        Self { gamma, width, count, vectors, dual, pairs }
    }

    pub(super) fn gamma(&self) -> f64 {
        self.gamma
    }

    pub(super) fn vectors(&self) -> Vec<Vec<f64>> {
        let entry = |i: usize, j: usize| self.vectors[i / LANES * self.width + j][i % LANES];
        (0..self.count).map(|i| (0..self.width).map(|j| entry(i, j)).collect()).collect()
    }

    pub(super) fn dual(&self) -> Vec<Vec<f64>> {
        let entry = |i: usize, pair: usize| self.dual[i / LANES * self.pairs + pair][i % LANES];
        (0..self.pairs).map(|pair| (0..self.count).map(|i| entry(i, pair)).collect()).collect()
    }

    /// Adds the sum over all support vectors, for a standardised row, to each pair's decision
    /// value.
    pub(super) fn add_to(&self, row: &[f64], decisions: &mut [f64]) {
        let mut sums = vec![[0.0; LANES]; self.pairs];
        in_widest_lanes(Sums { support: self, row, sums: &mut sums });
        for (decision, sums) in decisions.iter_mut().zip(sums) {
            *decision += sums.into_iter().sum::<f64>();
        }
    }
}

struct Sums<'a> {
    support: &'a Support,
    row: &'a [f64],
    sums: &'a mut [Lanes],
}

impl Kernel for Sums<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { support, row, sums } = self;
        let vectors = support.vectors.chunks_exact(support.width);
        for (block, dual) in vectors.zip(support.dual.chunks_exact(support.pairs)) {
            let mut square = [0.0; LANES];
            for (vectors, &x) in block.iter().zip(row) {
                for (square, &vector) in square.iter_mut().zip(vectors) {
                    *square += (x - vector) * (x - vector);
                }
            }
            let mut kernel = [0.0; LANES];
            for (kernel, square) in kernel.iter_mut().zip(square) {
                *kernel = exp64(-support.gamma * square);
            }
            for (sums, dual) in sums.iter_mut().zip(dual) {
                for ((sum, &dual), &kernel) in sums.iter_mut().zip(dual).zip(&kernel) {
                    *sum += dual * kernel;
                }
            }
        }
    }
}
