//! Queries of a solution, and their evaluation in each number of dimensions.

use pyo3::prelude::*;
use sidestep::invalid::Invalid;
use sidestep::reachability::cartesian::{self, Direction, Kind, ShallowObstacle};
use sidestep::reachability::{self, AffineArrays};

use crate::arrays::place;
use crate::error::Error;
use crate::value::in_parts;

/// A game as arrays: the ranges of u, the ranges of d, and the rates at the nodes, row-major.
pub(crate) type GameArrays = (Vec<[f64; 2]>, Vec<[f64; 2]>, Vec<f64>);

/// A solution in any number of dimensions.
pub(crate) trait Solved: Send + Sync {
    fn times_s(&self) -> Vec<f64>;
    fn values(&self) -> Vec<f32>;
    /// Direction, kind, number of steps, and largest change of V per second at the end.
    fn march(&self) -> (Direction, Kind, usize, f64);
    fn npz(&self) -> Result<Vec<u8>, Invalid>;
    /// The game, if it is known.
    fn game(&self) -> Option<GameArrays>;
    /// V or its gradient (D numbers) at the given states, row by row.
    fn samples(&self, py: Python<'_>, asked: &Asked, gradient: bool) -> Result<Vec<f64>, Error>;
    /// The time (s) at which each state first belongs to the tube.
    fn first_times(&self, py: Python<'_>, asked: &Asked) -> Result<Vec<f64>, Error>;
    /// Which nodes depend on values beyond the grid, at this time or, by default, at the horizon.
    fn depends_on_outside(&self, tau_s: Option<f64>) -> Result<Vec<bool>, Invalid>;
    fn shallow(&self) -> Option<ShallowObstacle>;
    /// The optimal inputs u and d at the given states, and the number of inputs of each player.
    fn inputs(&self, py: Python<'_>, asked: &Asked) -> Result<OptimalInputs, Error>;
}

/// The time at which a solution is evaluated.
#[derive(Clone, Copy)]
pub(crate) enum Instant {
    /// At the end of the march.
    End,
    /// This time (s) after the start of the march.
    At(f64),
    /// At the first stored instant at which a state belongs to the tube.
    First,
}

/// The states at which a solution is evaluated.
pub(crate) struct Asked {
    /// The shape of the states without their last axis.
    pub(super) shape: Vec<usize>,
    pub(super) states: Vec<f64>,
    pub(super) instant: Instant,
    /// Whether states outside the grid raise an error. Otherwise they give NaN.
    pub(super) is_refused: bool,
    pub(super) threads: usize,
}

/// For each player: the optimal inputs, row by row, and the length of a row.
pub(crate) type OptimalInputs = [(Vec<f64>, usize); 2];

pub(crate) struct OnGrid<const D: usize> {
    pub(crate) solution: cartesian::Solution<f32, D>,
    /// `None` for a solution from a file.
    pub(crate) game: Option<AffineArrays<D>>,
}

impl<const D: usize> OnGrid<D> {
    fn at(&self, instant: Instant) -> Result<cartesian::Snapshot<'_, f32, D>, Invalid> {
        match instant {
            Instant::End | Instant::First => Ok(self.solution.end()),
            Instant::At(tau_s) => {
                let horizon_s = self.solution.horizon_s;
                if self.solution.earlier.is_empty() && tau_s != horizon_s {
                    let expected = format!("{horizon_s} s, since `times` was one number");
                    return Err(Invalid::new("tau_s", expected, tau_s));
                }
                self.solution.at_march_time(tau_s)
            }
        }
    }

    /// Computes one result for each state. The result for a state outside the grid is `outside`, unless such
    /// a state raises an error.
    fn each<T: Send + Sync + Clone>(
        &self,
        py: Python<'_>,
        asked: &Asked,
        outside: T,
        of: impl Fn([f64; D]) -> Result<T, Invalid> + Sync,
    ) -> Result<Vec<T>, Error> {
        let states = asked.states.as_chunks::<D>().0;
        in_parts(py, states, asked.threads, outside, |first, states, found| {
            for (i, (found, &state)) in found.iter_mut().zip(states).enumerate() {
                if !asked.is_refused && !self.solution.grid.contains(state) {
                    continue;
                }
                *found = of(state).map_err(|mut invalid| {
                    // The library's error names a coordinate of one state. Name the entry of the array
                    // instead.
                    let coordinate = invalid.field.strip_prefix("state[");
                    let d = coordinate.and_then(|of| of.strip_suffix(']')?.parse::<usize>().ok());
                    if let Some(d) = d {
                        let shape = [&asked.shape[..], &[D]].concat();
                        invalid.field = place("states", (first + i) * D + d, &shape);
                    }
                    invalid
                })?;
            }
            Ok(())
        })
    }
}

impl<const D: usize> Solved for OnGrid<D> {
    fn times_s(&self) -> Vec<f64> {
        self.solution.march_times_s()
    }

    fn values(&self) -> Vec<f32> {
        let all = self.solution.earlier.iter().chain([&self.solution.values]);
        all.flatten().copied().collect()
    }

    fn march(&self) -> (Direction, Kind, usize, f64) {
        let cartesian::Solution { direction, kind, steps, residual, .. } = self.solution;
        (direction, kind, steps, residual)
    }

    fn npz(&self) -> Result<Vec<u8>, Invalid> {
        self.solution.npz()
    }

    fn game(&self) -> Option<GameArrays> {
        let game = self.game.as_ref()?;
        let ranges = game.ranges();
        let (u, d) = (ranges.minimiser.to_vec(), ranges.maximiser.to_vec());
        Some((u, d, game.rates().as_flattened().to_vec()))
    }

    fn samples(&self, py: Python<'_>, asked: &Asked, gradient: bool) -> Result<Vec<f64>, Error> {
        let then = self.at(asked.instant)?;
        if gradient {
            let outside = [f64::NAN; D];
            let found = self.each(py, asked, outside, |state| Ok(then.sample(state)?.gradient))?;
            return Ok(found.into_flattened());
        }
        self.each(py, asked, f64::NAN, |state| then.value(state))
    }

    fn first_times(&self, py: Python<'_>, asked: &Asked) -> Result<Vec<f64>, Error> {
        self.each(py, asked, f64::NAN, |state| self.solution.time_to_reach(state))
    }

    fn shallow(&self) -> Option<ShallowObstacle> {
        self.solution.shallow
    }

    fn depends_on_outside(&self, tau_s: Option<f64>) -> Result<Vec<bool>, Invalid> {
        let marked = self.solution.depends_on_outside(tau_s.unwrap_or(self.solution.horizon_s))?;
        let expected = "a solution that stores how soon paths leave the grid";
        marked.ok_or_else(|| Invalid::new("solution", expected, "a file of an earlier version"))
    }

    fn inputs(&self, py: Python<'_>, asked: &Asked) -> Result<OptimalInputs, Error> {
        let then = self.at(asked.instant)?;
        let Some(game) = &self.game else {
            let expected = "one that hj_solve returned: a file keeps V, not the game";
            return Err(Invalid::new("solution", expected, "one that was loaded").into());
        };
        let ranges = game.ranges();
        let outside = reachability::Inputs {
            minimiser: vec![f64::NAN; ranges.minimiser.len()],
            maximiser: vec![f64::NAN; ranges.maximiser.len()],
        };
        let found = self.each(py, asked, outside, |state| match asked.instant {
            Instant::First => self.solution.first_inputs(game, state),
            Instant::End | Instant::At(_) => then.inputs(game, state),
        })?;
        let (mut u, mut d) = (Vec::new(), Vec::new());
        for inputs in found {
            u.extend(inputs.minimiser);
            d.extend(inputs.maximiser);
        }
        Ok([(u, ranges.minimiser.len()), (d, ranges.maximiser.len())])
    }
}
