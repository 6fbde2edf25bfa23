//! `sidestep solve`.

use super::game::GameArgs;
use super::solving::{self, Interrupt, flagged};
use super::{CommandError, Words, one_of, print_json, unwritable};
use crate::formats::atomic_file;
use serde::Serialize;
use sidestep::invalid::Invalid;
use sidestep::reachability::{
    ACCURACIES, Accuracy, CartesianGrid, METHODS, Method, Options, Precision, Scheme,
    default_threads, npz,
};
use std::path::PathBuf;

/// Solve the pursuit game and write its value function to a NumPy archive.
///
/// V(x, y, psi) in metres is the largest range margin (range - radius) that the evader can
/// guarantee. V <= 0 where the pursuer can force a collision. Prints one line of JSON: method, grid
/// (shape of the array value), steps (time steps, or sweeps over the finest grid), wall_s, threads,
/// converged_residual (the remaining change of V: m/s, or m in 16 sweeps of the polar method
/// without a horizon), converged (null for a finite horizon), and volume (of {V <= 0} over the
/// grid's domain, including between nodes, in m^2 rad).
#[derive(Clone, Debug, clap::Args)]
pub struct SolveArgs {
    #[command(flatten)]
    game: GameArgs,
    /// Method [default: exact for equal vehicles without a horizon, cartesian with --grid, else polar].
    #[arg(long, value_parser = one_of(METHODS))]
    method: Option<Method>,
    /// Horizon (s); inf for the converged value.
    #[arg(long, value_name = "S", default_value_t = f64::INFINITY, allow_negative_numbers = true)]
    horizon: f64,
    /// Accuracy of the grid.
    ///
    /// With a finite horizon, or for a Cartesian grid, the grid covers the states in which a draft
    /// solution has V at most half the radius.
    #[arg(long, value_parser = one_of(ACCURACIES), default_value = "standard")]
    #[arg(conflicts_with = "grid")]
    accuracy: Accuracy,
    /// Largest range of the polar grid (m) [default: radius + 3 pi times the wider turning radius].
    ///
    /// For a finite horizon, the default is smaller.
    #[arg(long, value_name = "M", allow_negative_numbers = true, conflicts_with = "grid")]
    range: Option<f64>,
    /// Cartesian grid: number of nodes in x, y and psi (one periodic turn); needs --domain.
    #[arg(long, value_name = "NX,NY,NPSI", value_parser = numbers::<usize, 3>)]
    #[arg(requires = "domain", allow_hyphen_values = true)]
    grid: Option<Numbers<usize, 3>>,
    /// Bounds of the Cartesian grid (m); needs --grid.
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = numbers::<f64, 4>)]
    #[arg(requires = "grid", allow_hyphen_values = true)]
    domain: Option<Numbers<f64, 4>>,
    /// Scheme for derivatives on the Cartesian grid.
    #[arg(long, value_parser = one_of(SCHEMES), default_value = "weno5", requires = "grid")]
    scheme: Scheme,
    /// Floating-point type on the Cartesian grid.
    #[arg(long, value_parser = one_of(PRECISIONS), default_value = "f32", requires = "grid")]
    precision: Precision,
    /// Number of threads; it does not change the result [default: all cores].
    ///
    /// Only a finite horizon and the method cartesian use several threads.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    threads: Option<usize>,
    /// File to write: the arrays value, axis0, axis1, axis2 and meta.
    ///
    /// The polar method adds the array sheet, which represents V's kink between nodes (see stored in meta).
    #[arg(long, value_name = "FILE.npz")]
    out: PathBuf,
}

const SCHEMES: Words<Scheme> = &[
    ("upwind", Scheme::Upwind, "First order"),
    ("eno2", Scheme::Eno2, "Essentially non-oscillatory, second order"),
    ("eno3", Scheme::Eno3, "Essentially non-oscillatory, third order"),
    ("weno5", Scheme::Weno5, "Weighted essentially non-oscillatory, fifth order"),
];

const PRECISIONS: Words<Precision> =
    &[("f32", Precision::F32, "Single"), ("f64", Precision::F64, "Double")];

/// N numbers in one argument.
type Numbers<T, const N: usize> = [T; N];

fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Result<[T; N], String> {
    let parsed: Result<Vec<T>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let kind = if size_of::<T>() == size_of::<usize>() && "0.5".parse::<T>().is_err() {
        "whole numbers"
    } else {
        "numbers"
    };
    parsed
        .ok()
        .and_then(|list| list.try_into().ok())
        .ok_or_else(|| format!("expected {N} {kind} with commas between"))
}

/// The printed line.
#[derive(Debug, Serialize)]
struct Line {
    method: &'static str,
    /// Shape of the array `value`.
    grid: [usize; 3],
    steps: usize,
    /// Duration of the computation (s), without writing the file.
    wall_s: f64,
    threads: usize,
    /// The remaining change of V (m/s). For the polar method without a horizon, the unit is m per
    /// round of sweeps.
    converged_residual: f64,
    /// Whether the solution converged. False if the solver gave up; null for a finite horizon.
    converged: Option<bool>,
    /// Volume of {V <= 0} over the domain (m² rad).
    volume: f64,
}

/// Solves the game, writes the file and prints the line.
///
/// # Errors
/// [`CommandError`] for impossible flags (input), or if the file cannot be written or the solve is
/// cancelled (failure).
pub async fn run(args: SolveArgs) -> Result<(), CommandError> {
    let game = args.game.game()?;
    let options = args.options()?;
    let method = match options.method {
        None if options.grid.is_some() => Method::Cartesian,
        None => Method::choose(&game, options.horizon_s),
        Some(method) => method,
    };
    if let (Method::Cartesian, Some(range)) = (method, options.range_m) {
        let expected = "none with method cartesian (see --grid and --domain)";
        return Err(flagged(Invalid::new("range_m", expected, range)));
    }
    atomic_file::check(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let interrupt = Interrupt::listen();
    let (solved, wall_s) = solving::solved(game, options, &interrupt).await?;
    let file = npz::npz(&solved.samples, solved.method);
    atomic_file::write(&args.out, &interrupt.token, |out| out.write_all(&file))
        .map_err(|e| interrupt.unwritten(&args.out, &e))?;
    print_json(&Line {
        method: solved.method.name(),
        grid: npz::shape(&solved.samples.nodes()),
        steps: solved.steps,
        wall_s,
        threads: solved.threads,
        converged_residual: solved.residual,
        converged: solved.converged,
        volume: solved.samples.volume(),
    })
}

/// Upper bound on the number of nodes of an axis.
const AXIS_LIMIT: usize = 1 << 16;

/// Upper bound on the number of threads.
const THREAD_LIMIT: usize = 1024;

impl SolveArgs {
    fn options(&self) -> Result<Options, CommandError> {
        let grid = self.grid.zip(self.domain).map(|(nodes, domain_m)| {
            CartesianGrid::new(nodes, domain_m)
                .with_scheme(self.scheme)
                .with_precision(self.precision)
        });
        let nodes = self.grid.unwrap_or_default();
        if let Some(long) = nodes.iter().find(|n| **n > AXIS_LIMIT) {
            let count = nodes.iter().fold(1_u64, |n, m| n.saturating_mul(*m as u64));
            let needed = count.saturating_mul(size_of::<f32>() as u64).div_ceil(1 << 20);
            let expected = format!("at most {AXIS_LIMIT} nodes an axis");
            let found = format!("{long}, of {count} nodes, which need at least {needed} MiB");
            return Err(flagged(Invalid::new("grid", expected, found)));
        }
        let threads = self.threads.unwrap_or_else(default_threads);
        if !(1..=THREAD_LIMIT).contains(&threads) {
            let expected = format!("1 to {THREAD_LIMIT}");
            return Err(flagged(Invalid::new("threads", expected, threads)));
        }
        Ok(Options::default()
            .with_method(self.method)
            .with_horizon(self.horizon)
            .with_accuracy(self.accuracy)
            .with_grid(grid)
            .with_range(self.range)
            .with_threads(threads))
    }
}
