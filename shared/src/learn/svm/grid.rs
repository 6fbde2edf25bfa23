//! Cross-validation of many settings in one pass.
//!
//! Within a fold, all γ share the squared distances. All C, pairs of classes, targets and held-out
//! rows share the kernel matrix of a γ. Each fit starts from the solution for the previous C.

use super::dense::Dense;
use super::gram::{Block, Gram, Products, Sparse, TOGETHER};
use super::linear;
use super::rows::{Target, check, order, sides, standardised};
use super::smo::{DualSolution, Smo};
use crate::invalid::{Invalid, length, positive};
use crate::parallel::in_widest_lanes;
use crate::predict::svm::{Kernel, pair_count, pairs, vote};

/// The kernels to try.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Kernels {
    /// Linear.
    Linear,
    /// Radial basis functions with each of these γ.
    Rbf(Vec<f64>),
}

/// The settings to try: each C with each kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// The kernels to try.
    pub kernels: Kernels,
    /// The values of C, preferably ascending, because each fit starts from the solution for the
    /// previous C.
    pub c: Vec<f64>,
    /// A fit ends when the optimality conditions hold to this tolerance (radial basis functions
    /// only).
    pub tolerance: f64,
    /// Maximum number of pairwise steps of a fit (radial basis functions only).
    pub max_steps: usize,
}

impl Grid {
    /// A grid with C = 0.01, 0.1, 1 and 10 for linear SVMs, and C = 0.1, 1, 10 and 100 for radial
    /// basis functions. The tolerance is 10⁻³, as in libsvm.
    #[must_use]
    pub fn new(kernels: Kernels) -> Self {
        let c = match kernels {
            Kernels::Linear => vec![0.01, 0.1, 1.0, 10.0],
            Kernels::Rbf(_) => vec![0.1, 1.0, 10.0, 100.0],
        };
        Self { kernels, c, tolerance: 1e-3, max_steps: 10_000_000 }
    }

    fn check(&self) -> Result<(), Invalid> {
        positive("tolerance", self.tolerance)?;
        if self.c.is_empty() {
            return Err(Invalid::new("c", "at least one", "none"));
        }
        for (i, &c) in self.c.iter().enumerate() {
            positive(&format!("c[{i}]"), c)?;
        }
        if let Kernels::Rbf(gammas) = &self.kernels {
            for (i, &gamma) in gammas.iter().enumerate() {
                positive(&format!("gamma[{i}]"), gamma)?;
            }
        }
        Ok(())
    }
}

/// The results of one setting on the held-out rows.
#[derive(Clone, Debug, PartialEq)]
pub struct GridCell {
    /// The kernel.
    pub kernel: Kernel,
    /// The value of C.
    pub c: f64,
    /// The share of held-out rows whose label is predicted correctly (by votes). There is one entry
    /// per fold, in ascending order of fold numbers.
    pub accuracy: Vec<f64>,
    /// Decision values of each row (rows × pairs, row-major), from the SVMs that were trained
    /// without the row's fold. If the training rows contain only one class of the pair, the value
    /// is 1 for the pair's first class or −1 for its second class. If they contain neither class,
    /// the value is 0.
    pub decisions: Vec<f64>,
}

impl GridCell {
    /// Mean accuracy over the folds.
    #[must_use]
    pub fn mean_accuracy(&self) -> f64 {
        self.accuracy.iter().sum::<f64>() / self.accuracy.len() as f64
    }
}

/// The cell with the highest mean accuracy. On a tie, the first cell. Means that differ only by
/// rounding errors are a tie. (A difference of one row would be far larger.)
#[must_use]
pub fn best(cells: &[GridCell]) -> Option<&GridCell> {
    let better =
        |best: &GridCell, cell: &GridCell| cell.mean_accuracy() > best.mean_accuracy() + 1e-12;
    cells.iter().reduce(|best, cell| if better(best, cell) { cell } else { best })
}

/// Tries all settings on all targets. Returns each target's cells, ordered by C, then by γ.
///
/// `rows` are raw features (row-major, `width` columns). For each fold, they are standardised with
/// the mean and the standard deviation of the training rows. `folds` contains the fold number of
/// each row. Memory use is at most two f32 matrices of all rows × training rows.
///
/// # Errors
/// [`Invalid`] if lengths do not match, a number is not finite, a setting is not positive, there
/// are fewer than two folds, or a fit does not converge.
pub fn cross_validate(
    width: usize,
    rows: &[f64],
    folds: &[usize],
    targets: &[Target<'_>],
    grid: &Grid,
) -> Result<Vec<Vec<GridCell>>, Invalid> {
    check(width, rows, targets)?;
    length("rows", width * folds.len(), rows.len())?;
    grid.check()?;
    let mut numbers = folds.to_vec();
    numbers.sort_unstable();
    numbers.dedup();
    if numbers.len() < 2 {
        return Err(Invalid::new("folds", "at least 2 folds", numbers.len()));
    }
    let kernels: Vec<Kernel> = match &grid.kernels {
        Kernels::Linear => vec![Kernel::Linear],
        Kernels::Rbf(gammas) => gammas.iter().map(|&gamma| Kernel::Rbf { gamma }).collect(),
    };
    let settings = grid.c.iter().flat_map(|&c| kernels.iter().map(move |&kernel| (c, kernel)));
    let empty = |target: &Target<'_>| -> Vec<GridCell> {
        let decisions = vec![0.0; folds.len() * pair_count(target.classes)];
        let cell =
            |(c, kernel)| GridCell { kernel, c, accuracy: vec![], decisions: decisions.clone() };
        settings.clone().map(cell).collect()
    };
    let mut cells: Vec<Vec<GridCell>> = targets.iter().map(empty).collect();
    let order = order(width, rows, targets);
    let mut gram = Gram::<f32>::empty(true);
    let mut dense = Dense::new();
    for &fold in &numbers {
        let (held_out, trained): (Vec<usize>, Vec<usize>) =
            order.iter().partition(|&&i| folds[i] == fold);
        let all: Vec<usize> = trained.iter().chain(&held_out).copied().collect();
        let (_, data) = standardised(width, rows, &trained, &all);
        match &grid.kernels {
            Kernels::Linear => {
                for (target, cells) in targets.iter().zip(&mut cells) {
                    let labels: Vec<usize> = trained.iter().map(|&i| target.labels[i]).collect();
                    for cell in cells {
                        planes(width, &data, &labels, target.classes, &held_out, cell)?;
                    }
                }
            }
            Kernels::Rbf(gammas) => {
                gram.set_data(width, &data, trained.len());
                // For each target and pair, the solution for the previous γ and the first C.
                let mut starts: Vec<Vec<Start>> =
                    targets.iter().map(|target| vec![None; pair_count(target.classes)]).collect();
                for (k, &gamma) in gammas.iter().enumerate() {
                    gram.set_gamma(gamma);
                    let mut svms = TrainedSvms::default();
                    for (t, (target, starts)) in targets.iter().zip(&mut starts).enumerate() {
                        let labels: Vec<usize> =
                            trained.iter().map(|&i| target.labels[i]).collect();
                        let problem = Radial { labels: &labels, classes: target.classes, grid };
                        problem.solve(
                            &mut gram,
                            starts,
                            &mut dense,
                            &mut |pair, c, solution| {
                                svms.add(
                                    Place { target: t, pair, cell: c * gammas.len() + k },
                                    solution,
                                );
                            },
                        )?;
                    }
                    svms.decide(&mut gram, &held_out, targets, &mut cells);
                }
            }
        }
        for (target, cells) in targets.iter().zip(&mut cells) {
            let pairs = pair_count(target.classes);
            for cell in cells {
                let decided = |i: usize| cell.decisions[i * pairs..][..pairs].iter().copied();
                let right = |&&i: &&usize| vote(target.classes, decided(i)) == target.labels[i];
                let right = held_out.iter().filter(right).count();
                cell.accuracy.push(right as f64 / held_out.len() as f64);
            }
        }
    }
    Ok(cells)
}

/// Trains a linear SVM with the cell's C for each pair. Fills in the decisions of the held-out
/// rows, which come after the training rows in `data`.
fn planes(
    width: usize,
    data: &[f64],
    labels: &[usize],
    classes: usize,
    held_out: &[usize],
    cell: &mut GridCell,
) -> Result<(), Invalid> {
    let (trained, others) = data.split_at(width * labels.len());
    let count = pair_count(classes);
    for (pair, (first, second)) in pairs(classes).enumerate() {
        let sides = sides(labels, first, second);
        let plane = match constant(&sides) {
            Some(_) => None,
            None => Some(linear::fit(width, trained, &sides, cell.c)?),
        };
        for (row, &i) in others.chunks_exact(width).zip(held_out) {
            let always = || constant(&sides).unwrap_or(0.0);
            let decision = plane.as_ref().map_or_else(always, |plane| plane.decision(row));
            cell.decisions[i * count + pair] = decision;
        }
    }
    Ok(())
}

/// The constant decision value if at least one of the two sides does not occur.
fn constant(sides: &[i8]) -> Option<f64> {
    match (sides.contains(&1), sides.contains(&-1)) {
        (true, true) => None,
        (first, second) => Some(f64::from(u8::from(first)) - f64::from(u8::from(second))),
    }
}

/// A starting point: the solution of a similar problem.
type Start = Option<Vec<Block<f64>>>;

/// The problem of one target.
struct Radial<'a> {
    labels: &'a [usize],
    classes: usize,
    grid: &'a Grid,
}

/// A solution, or the constant decision value if at least one side does not occur.
type Trained = Result<DualSolution, f64>;

impl Radial<'_> {
    /// Trains an SVM for each pair and C. Calls `trained` with the index of the pair, the index of
    /// C and the solution.
    fn solve(
        &self,
        gram: &mut Gram<f32>,
        starts: &mut [Start],
        dense: &mut Dense<f32>,
        trained: &mut dyn FnMut(usize, usize, Trained),
    ) -> Result<(), Invalid> {
        let grid = self.grid;
        for ((pair, (first, second)), start) in pairs(self.classes).enumerate().zip(starts) {
            let sides = sides(self.labels, first, second);
            if let Some(constant) = constant(&sides) {
                (0..grid.c.len()).for_each(|k| trained(pair, k, Err(constant)));
                continue;
            }
            let mut smo = Smo::new(gram, &sides, grid.c[0], start.as_deref(), dense);
            for (k, &c) in grid.c.iter().enumerate() {
                let solution = smo.solve(c, grid.tolerance, grid.max_steps)?;
                if k == 0 {
                    *start = Some(solution.beta.clone());
                }
                trained(pair, k, Ok(solution));
            }
        }
        Ok(())
    }
}

/// The target, the pair and the cell that a solution belongs to.
struct Place {
    target: usize,
    pair: usize,
    cell: usize,
}

/// The SVMs of all targets that share one kernel matrix.
#[derive(Default)]
struct TrainedSvms {
    places: Vec<Place>,
    coefficients: Vec<Sparse>,
    intercepts: Vec<f64>,
}

impl TrainedSvms {
    fn add(&mut self, place: Place, trained: Trained) {
        self.places.push(place);
        let (coefficients, intercept) = match &trained {
            Ok(solution) => (Sparse::new(&solution.beta), solution.intercept),
            Err(constant) => (Sparse::new(&[]), *constant),
        };
        self.coefficients.push(coefficients);
        self.intercepts.push(intercept);
    }

    /// Fills in the decisions of the held-out rows, which come after the training rows in `gram`.
    fn decide(
        &self,
        gram: &mut Gram<f32>,
        held_out: &[usize],
        targets: &[Target<'_>],
        cells: &mut [Vec<GridCell>],
    ) {
        let (first, blocks) = (gram.columns(), gram.blocks());
        let mut rows = vec![Block::all(0.0); TOGETHER * blocks];
        let mut sums = vec![[0.0; TOGETHER]; self.places.len()];
        for (part, held_out) in held_out.chunks(TOGETHER).enumerate() {
            for (r, row) in rows.chunks_exact_mut(blocks).take(held_out.len()).enumerate() {
                gram.row_into(first + part * TOGETHER + r, row);
            }
            let coefficients = &self.coefficients;
            in_widest_lanes(Products { blocks, rows: &rows, coefficients, out: &mut sums });
            for ((place, sums), intercept) in self.places.iter().zip(&sums).zip(&self.intercepts) {
                let count = pair_count(targets[place.target].classes);
                let decisions = &mut cells[place.target][place.cell].decisions;
                for (&i, sum) in held_out.iter().zip(sums) {
                    decisions[i * count + place.pair] = sum + intercept;
                }
            }
        }
    }
}
