//! Cross-validation of many settings at once.
//!
//! A fold's distances serve every γ; a kernel matrix serves every C, pair of classes and
//! task, and decides the held-out rows too. Each C starts where the last ended.

use super::gram::{Block, Gram, Products, Sparse, TOGETHER};
use super::pairwise::Dense;
use super::smo::{Machine, Smo};
use super::{Task, check, linear, order, sides, standardised};
use crate::invalid::{Invalid, length, positive};
use crate::parallel::in_widest_lanes;
use crate::predict::svm::{Kernel, pair_count, pairs, vote};

/// The kernels to try.
#[derive(Clone, Debug, PartialEq)]
pub enum Kernels {
    /// The linear one.
    Linear,
    /// Radial basis functions with each of these γ.
    Rbf(Vec<f64>),
}

/// The settings to try: each C with each kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Linear, or the γ.
    pub kernels: Kernels,
    /// The C, best in rising order: each starts where the last ended.
    pub c: Vec<f64>,
    /// Stop where the conditions of the optimum hold to this (radial basis functions).
    pub tolerance: f64,
    /// Pairwise steps of a fit at the most (radial basis functions).
    pub max_steps: usize,
}

impl Grid {
    /// C of 0.01, 0.1, 1 and 10 for linear machines and of 0.1, 1, 10 and 100 for radial
    /// basis functions, with libsvm's tolerance 10⁻³.
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

/// How one setting does on held-out rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// The kernel.
    pub kernel: Kernel,
    /// C.
    pub c: f64,
    /// Share of the held-out rows whose label is predicted (by votes), a fold, in rising order
    /// of the folds' numbers.
    pub accuracy: Vec<f64>,
    /// Decision values of each row by the machines of the folds that it is not in (rows ×
    /// pairs, row-major). Where a pair's class is missing there, 1 or −1 for the other.
    pub decisions: Vec<f64>,
}

impl Cell {
    /// Mean over folds.
    #[must_use]
    pub fn mean_accuracy(&self) -> f64 {
        self.accuracy.iter().sum::<f64>() / self.accuracy.len() as f64
    }
}

/// The cell of the greatest mean accuracy, the first on a tie. Means that differ by rounding
/// only are a tie: one row more or less is far above it.
#[must_use]
pub fn best(cells: &[Cell]) -> Option<&Cell> {
    let better = |best: &Cell, cell: &Cell| cell.mean_accuracy() > best.mean_accuracy() + 1e-12;
    cells.iter().reduce(|best, cell| if better(best, cell) { cell } else { best })
}

/// Tries all settings on all tasks: for each task its cells, C by C, and within a C γ by γ.
///
/// `rows` are raw features (row-major, `width` columns), standardised by the training rows of
/// each fold; `folds` has a number a row. Memory: at most two matrices of all rows ×
/// training rows in f32.
///
/// # Errors
/// [`Invalid`] if lengths do not fit, a number is not finite or not > 0 where it must be,
/// there are fewer than two folds, or a fit does not converge.
pub fn cross_validate(
    width: usize,
    rows: &[f64],
    folds: &[usize],
    tasks: &[Task<'_>],
    grid: &Grid,
) -> Result<Vec<Vec<Cell>>, Invalid> {
    check(width, rows, tasks)?;
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
    let empty = |task: &Task<'_>| -> Vec<Cell> {
        let decisions = vec![0.0; folds.len() * pair_count(task.classes)];
        let cell = |(c, kernel)| Cell { kernel, c, accuracy: vec![], decisions: decisions.clone() };
        settings.clone().map(cell).collect()
    };
    let mut cells: Vec<Vec<Cell>> = tasks.iter().map(empty).collect();
    let order = order(width, rows, tasks);
    let mut gram = Gram::<f32>::empty(true);
    let mut dense = Dense::new();
    for &fold in &numbers {
        let (held_out, trained): (Vec<usize>, Vec<usize>) =
            order.iter().partition(|&&i| folds[i] == fold);
        let all: Vec<usize> = trained.iter().chain(&held_out).copied().collect();
        let (_, data) = standardised(width, rows, &trained, &all);
        match &grid.kernels {
            Kernels::Linear => {
                for (task, cells) in tasks.iter().zip(&mut cells) {
                    let labels: Vec<usize> = trained.iter().map(|&i| task.labels[i]).collect();
                    for cell in cells {
                        planes(width, &data, &labels, task.classes, &held_out, cell)?;
                    }
                }
            }
            Kernels::Rbf(gammas) => {
                gram.set_data(width, &data, trained.len());
                // Of each task and pair, the last kernel's solution for the first C.
                let mut starts: Vec<Vec<Start>> =
                    tasks.iter().map(|task| vec![None; pair_count(task.classes)]).collect();
                for (k, &gamma) in gammas.iter().enumerate() {
                    gram.set_gamma(gamma);
                    let mut machines = Machines::default();
                    for (t, (task, starts)) in tasks.iter().zip(&mut starts).enumerate() {
                        let labels: Vec<usize> = trained.iter().map(|&i| task.labels[i]).collect();
                        let problem = Radial { labels: &labels, classes: task.classes, grid };
                        problem.solve(&mut gram, starts, &mut dense, &mut |pair, c, machine| {
                            machines
                                .add(Place { task: t, pair, cell: c * gammas.len() + k }, machine);
                        })?;
                    }
                    machines.decide(&mut gram, &held_out, tasks, &mut cells);
                }
            }
        }
        for (task, cells) in tasks.iter().zip(&mut cells) {
            let pairs = pair_count(task.classes);
            for cell in cells {
                let decided = |i: usize| cell.decisions[i * pairs..][..pairs].iter().copied();
                let right = |&&i: &&usize| vote(task.classes, decided(i)) == task.labels[i];
                let right = held_out.iter().filter(right).count();
                cell.accuracy.push(right as f64 / held_out.len() as f64);
            }
        }
    }
    Ok(cells)
}

/// Linear machines for a cell's C: fills in the decisions of the held-out rows, which `data`
/// has after the trained ones.
fn planes(
    width: usize,
    data: &[f64],
    labels: &[usize],
    classes: usize,
    held_out: &[usize],
    cell: &mut Cell,
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

/// The decision value where not both sides occur.
fn constant(sides: &[i8]) -> Option<f64> {
    match (sides.contains(&1), sides.contains(&-1)) {
        (true, true) => None,
        (first, second) => Some(f64::from(u8::from(first)) - f64::from(u8::from(second))),
    }
}

/// A solution that another problem may start from.
type Start = Option<Vec<Block<f64>>>;

/// One task.
struct Radial<'a> {
    labels: &'a [usize],
    classes: usize,
    grid: &'a Grid,
}

/// A machine, or what it always says.
type Trained = Result<Machine, f64>;

impl Radial<'_> {
    /// Trains for each pair and C, and hands over what came out with the places of both.
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
                let machine = smo.solve(c, grid.tolerance, grid.max_steps)?;
                if k == 0 {
                    *start = Some(machine.beta.clone());
                }
                trained(pair, k, Ok(machine));
            }
        }
        Ok(())
    }
}

/// What a machine belongs to.
struct Place {
    task: usize,
    pair: usize,
    cell: usize,
}

/// The machines of all tasks on one kernel matrix.
#[derive(Default)]
struct Machines {
    places: Vec<Place>,
    coefficients: Vec<Sparse>,
    intercepts: Vec<f64>,
}

impl Machines {
    fn add(&mut self, place: Place, trained: Trained) {
        self.places.push(place);
        let (coefficients, intercept) = match &trained {
            Ok(machine) => (Sparse::new(&machine.beta), machine.intercept),
            Err(constant) => (Sparse::new(&[]), *constant),
        };
        self.coefficients.push(coefficients);
        self.intercepts.push(intercept);
    }

    /// Fills in the decisions of the held-out rows, which `gram` has after the trained ones.
    fn decide(
        &self,
        gram: &mut Gram<f32>,
        held_out: &[usize],
        tasks: &[Task<'_>],
        cells: &mut [Vec<Cell>],
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
                let count = pair_count(tasks[place.task].classes);
                let decisions = &mut cells[place.task][place.cell].decisions;
                for (&i, sum) in held_out.iter().zip(sums) {
                    decisions[i * count + place.pair] = sum + intercept;
                }
            }
        }
    }
}
