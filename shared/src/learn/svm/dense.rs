//! The small dense problem for pairwise and Newton steps: its variables, its submatrix of the
//! kernel matrix, and its gradient.

use super::gram::{Block, Entry, LANES, entry, entry_mut};

/// A variable of the small problem.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variable {
    pub(super) beta: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
}

impl Variable {
    /// Whether the variable is strictly between its bounds, so that it can rise and fall.
    pub(super) fn is_free(self) -> bool {
        self.lower < self.beta && self.beta < self.upper
    }
}

/// Arrays with an entry for each variable, in blocks. Padding entries can neither rise nor fall.
#[derive(Clone, Debug)]
pub(super) struct Dense<T> {
    pub(super) variables: Vec<Variable>,
    /// Number of blocks from one row of `matrix` to the next. It is one more than the capacity in
    /// blocks, because otherwise a column's entries would all map to the same few cache sets.
    pub(super) stride: usize,
    /// The kernel matrix K of the variables.
    pub(super) matrix: Vec<Block<T>>,
    /// The inverse of the curvature K_ii + K_jj − 2 K_ij of an exchange, in the layout of `matrix`.
    /// Only rows that are `ready` are valid. It is cached because many steps raise the same few
    /// variables, and division is the slowest operation.
    pub(super) inverse: Vec<Block<T>>,
    pub(super) ready: Vec<bool>,
    /// Buffer for a row of `matrix`.
    gathered: Vec<T>,
    /// K_ii.
    pub(super) diagonal: Vec<Block<T>>,
    /// The gradient v.
    pub(super) gradient: Vec<Block<T>>,
    /// 0 if β can rise, otherwise −∞.
    pub(super) rise: Vec<Block<T>>,
    /// 0 if β can fall, otherwise −∞.
    pub(super) fall: Vec<Block<T>>,
}

impl<T: Entry> Dense<T> {
    /// A problem without variables.
    pub(super) fn new() -> Self {
        Self {
            variables: Vec::new(),
            stride: 0,
            matrix: Vec::new(),
            inverse: Vec::new(),
            ready: Vec::new(),
            gathered: Vec::new(),
            diagonal: Vec::new(),
            gradient: Vec::new(),
            rise: Vec::new(),
            fall: Vec::new(),
        }
    }

    /// Removes all variables, but keeps the memory.
    pub(super) fn clear(&mut self) {
        self.variables.clear();
        let never = T::from_f64(f64::NEG_INFINITY);
        self.rise.fill(Block::all(never));
        self.fall.fill(Block::all(never));
    }

    /// Extends the problem to `count` variables, one more than before. The caller sets the new
    /// variable.
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
            self.gradient.resize(stride, Block::all(T::ZERO));
            self.rise.resize(stride, never);
            self.fall.resize(stride, never);
        }
    }

    /// Copies the kernel values between variable `slot` and all `members`. `row` is the variable's
    /// row of the full kernel matrix.
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

    /// Sets variable `i` and its gradient.
    pub(super) fn set(&mut self, i: usize, variable: Variable, gradient: f64) {
        self.variables[i] = variable;
        self.gradient[i / LANES].0[i % LANES] = T::from_f64(gradient);
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
