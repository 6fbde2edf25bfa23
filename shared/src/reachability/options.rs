//! How a game is solved: the method, the grid, the horizon and the limits.

use super::grid::{Axis, Grid};
use super::progress::MEMORY_LIMIT_BYTES;
use super::pursuit::PursuitGame;
use super::scheme::Scheme;
use crate::invalid::Invalid;
use crate::math::TAU;
use crate::parallel::default_threads;
use serde::{Deserialize, Serialize};

/// The method that computes a value function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    /// The closed form: identical vehicles, converged value.
    Exact,
    /// Polar relative coordinates: any vehicles, any horizon.
    Polar,
    /// A rectangular grid in x, y, ψ: any vehicles, any horizon.
    Cartesian,
}

/// Every method: its name on the command line, in links and in files, and its meaning.
pub const METHODS: &[(&str, Method, &str)] = &[
    ("exact", Method::Exact, "Closed form: equal vehicles, infinite horizon"),
    ("polar", Method::Polar, "Polar relative coordinates: any vehicles, any horizon"),
    ("cartesian", Method::Cartesian, "A rectangular grid: any vehicles, any horizon"),
];

impl Method {
    /// The method that suits `game` and the horizon best.
    #[must_use]
    pub fn choose(game: &PursuitGame, horizon_s: f64) -> Self {
        if game.identical() && horizon_s.is_infinite() { Self::Exact } else { Self::Polar }
    }

    /// The name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Polar => "polar",
            Self::Cartesian => "cartesian",
        }
    }
}

/// The size of the grid. Each accuracy has about twice as many nodes per axis as the previous one.
/// If the horizon is finite or the method is Cartesian, a draft solve estimates where V is at most
/// half the radius. The grid is just large enough for these states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Accuracy {
    /// For a first look: errors of tenths of a metre near kinks.
    Draft,
    /// For studies: errors of centimetres near {V = 0}.
    Standard,
    /// For reference values.
    Fine,
}

/// Every accuracy: its name on the command line and in links, and its meaning.
pub const ACCURACIES: &[(&str, Accuracy, &str)] = &[
    ("draft", Accuracy::Draft, "For a first look: errors of tenths of a metre near kinks"),
    ("standard", Accuracy::Standard, "For studies: errors of centimetres near V = 0"),
    ("fine", Accuracy::Fine, "For reference values"),
];

/// The number type of a Cartesian solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// A rectangular grid and the numerical method on it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CartesianGrid {
    /// Number of nodes along x, y and ψ.
    pub nodes: [usize; 3],
    /// Ends of x and of y (m): x₀, x₁, y₀, y₁.
    pub domain_m: [f64; 4],
    /// The approximation of the derivatives.
    pub scheme: Scheme,
    /// The number type.
    pub precision: Precision,
}

impl CartesianGrid {
    /// A grid with `nodes` along x, y and ψ on the rectangle from x₀ to x₁ and from y₀ to y₁
    /// (`domain_m`), with WENO5 in single precision.
    #[must_use]
    pub fn new(nodes: [usize; 3], domain_m: [f64; 4]) -> Self {
        Self { nodes, domain_m, scheme: Scheme::Weno5, precision: Precision::F32 }
    }

    /// Sets [`Self::scheme`], the approximation of the derivatives.
    #[must_use]
    pub fn with_scheme(self, scheme: Scheme) -> Self {
        Self { scheme, ..self }
    }

    /// Sets [`Self::precision`], the number type.
    #[must_use]
    pub fn with_precision(self, precision: Precision) -> Self {
        Self { precision, ..self }
    }

    pub(super) fn axes(&self) -> Grid<3> {
        let [x0, x1, y0, y1] = self.domain_m;
        let [nx, ny, n_psi] = self.nodes;
        Grid {
            axes: [
                Axis::bounded(x0, x1, nx),
                Axis::bounded(y0, y1, ny),
                Axis::periodic(0.0, TAU, n_psi),
            ],
        }
    }
}

/// Options of [`solve`](super::solve()).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// The method. `None` selects the Cartesian method if `grid` is set, and otherwise
    /// [`Method::choose`].
    pub method: Option<Method>,
    /// The horizon (s); infinite for the converged value.
    pub horizon_s: f64,
    /// Size of the grid, unless `grid` or `range_m` determines it.
    pub accuracy: Accuracy,
    /// The grid of the Cartesian method.
    pub grid: Option<CartesianGrid>,
    /// Largest range of the polar method (m); `None` for a default. For an infinite horizon, V
    /// depends on this range if the pursuer is faster. For a finite horizon, the default range just
    /// contains the states where V is at most half the radius. Beyond this range, V is an estimate
    /// that can be metres too large. The number of nodes does not depend on the range, so with a
    /// larger range the nodes are farther apart.
    pub range_m: Option<f64>,
    /// Number of threads; used for a finite horizon or with the Cartesian method.
    pub threads: usize,
    /// Memory limit (bytes). A solve that needs more is rejected.
    pub memory_limit_bytes: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: None,
            horizon_s: f64::INFINITY,
            accuracy: Accuracy::Standard,
            grid: None,
            range_m: None,
            threads: default_threads(),
            memory_limit_bytes: MEMORY_LIMIT_BYTES,
        }
    }
}

impl Options {
    /// Sets [`Self::method`]; `None` for the default method.
    #[must_use]
    pub fn with_method(self, method: impl Into<Option<Method>>) -> Self {
        Self { method: method.into(), ..self }
    }

    /// Sets [`Self::horizon_s`], the horizon (s); infinite for the converged value.
    #[must_use]
    pub fn with_horizon(self, horizon_s: f64) -> Self {
        Self { horizon_s, ..self }
    }

    /// Sets [`Self::accuracy`], how fine the grid is.
    #[must_use]
    pub fn with_accuracy(self, accuracy: Accuracy) -> Self {
        Self { accuracy, ..self }
    }

    /// Sets [`Self::grid`], the grid of the Cartesian method; `None` for a grid that `accuracy`
    /// determines.
    #[must_use]
    pub fn with_grid(self, grid: impl Into<Option<CartesianGrid>>) -> Self {
        Self { grid: grid.into(), ..self }
    }

    /// Sets [`Self::range_m`], the largest range of the polar method (m); `None` for the default.
    #[must_use]
    pub fn with_range(self, range_m: impl Into<Option<f64>>) -> Self {
        Self { range_m: range_m.into(), ..self }
    }

    /// Sets [`Self::threads`], the number of threads for a finite horizon or the Cartesian method.
    #[must_use]
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Sets [`Self::memory_limit_bytes`], the memory limit of a solve (bytes).
    #[must_use]
    pub fn with_memory_limit(self, memory_limit_bytes: u64) -> Self {
        Self { memory_limit_bytes, ..self }
    }

    /// The method that [`solve`](super::solve()) will use for `game`.
    ///
    /// # Errors
    /// [`Invalid`] for an invalid game or horizon, or a method that does not support them.
    pub fn method_for(&self, game: &PursuitGame) -> Result<Method, Invalid> {
        game.check()?;
        let horizon_s = self.horizon_s;
        if horizon_s.is_nan() || horizon_s <= 0.0 {
            return Err(Invalid::new("horizon_s", "a number > 0, or inf", horizon_s));
        }
        let chosen = if self.grid.is_some() && self.method.is_none() {
            Method::Cartesian
        } else {
            self.method.unwrap_or_else(|| Method::choose(game, horizon_s))
        };
        if chosen == Method::Exact {
            if horizon_s.is_finite() {
                let expected = "inf with method exact, or method polar";
                return Err(Invalid::new("horizon_s", expected, horizon_s));
            }
            game.exact()?;
        }
        Ok(chosen)
    }
}
