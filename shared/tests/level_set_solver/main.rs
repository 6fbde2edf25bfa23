//! Tests of the Cartesian level-set solver: against a plain reimplementation (twin), against closed
//! forms in one to four dimensions, against the exact value of the pursuit game, and with input
//! that it must reject.
//!
//! Each test prints its measurements (`cargo test --release -- --nocapture`).
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod twin;
mod threads;
mod closed_forms;
mod orders;
mod pursuit;
mod mirrored;
mod bad_input;
mod scales;
mod ends;
mod first;
mod games;
mod steepening;
mod solutions;
mod control_affine;
mod files;
#[path = "../../examples/measure/mod.rs"]
mod measure;

use core::f64::consts::LN_2;
use core::ops::ControlFlow;
use games::{Broken, Drift, Twisted, TwoMasses};
use sidestep::invalid::Invalid;
use sidestep::math::{PI, SeededRng, TAU, cos, hypot, ln, sin, sin_cos};
use sidestep::reachability::cartesian::{
    Direction, Horizon, Kind, Problem, Region, Settings, Solution, solve,
};
use sidestep::reachability::{
    Axis, Boundary, DoubleIntegrator, Game, Grid, Lanes, Real, Scheme, SolveError, TERMS,
};
use steepening::{SECONDS, Steepening, exact};

const BACKWARD: Direction = Direction::Backward;
const FORWARD: Direction = Direction::Forward;

const SCHEMES: [Scheme; 4] = [Scheme::Upwind, Scheme::Eno2, Scheme::Eno3, Scheme::Weno5];

fn settings(scheme: Scheme) -> Settings {
    Settings::new(scheme).with_threads(2).with_cfl(0.75)
}

fn solved<T: Real, const D: usize, G: Game<D>>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
) -> Solution<T, D> {
    solve(problem, settings, &mut |_| ControlFlow::Continue(())).expect("a solution")
}

/// The problem of reaching `target` within `seconds`, without an obstacle.
fn problem<'a, const D: usize, G: Game<D>>(
    game: &'a G,
    axes: [Axis; D],
    target: &'a (dyn Fn([f64; D]) -> f64 + Sync),
    (kind, direction): (Kind, Direction),
    seconds: f64,
) -> Problem<'a, D, G> {
    Problem::reach(game, Grid { axes }, target, seconds).with_kind(kind).with_direction(direction)
}

/// A bumpy function with a kink, periodic in 2π along every axis.
fn bumpy<const D: usize>(x: [f64; D], time: f64) -> f64 {
    let [mut bowl, mut waves] = [-0.4, 0.1];
    for (d, x) in x.into_iter().enumerate() {
        let d = d as f64;
        bowl += (1.0 + 0.2 * d) * (1.0 - cos(x - 0.37 + 0.11 * d + 0.9 * time));
        waves += 0.31 * sin(2.0 * x + 1.7 * d - time) - 0.1 * d;
    }
    bowl.max(waves)
}

/// A function that is negative inside a moving ball.
fn ball<const D: usize>(x: [f64; D], time: f64) -> f64 {
    x.into_iter().fold(-0.45, |height, x| height + (1.0 - cos(x - 1.13 - 0.8 * time)))
}

#[derive(Clone, Copy, Debug)]
struct Errors {
    nodes: usize,
    mean: f64,
    max: f64,
}

/// The errors of a solution against `exact`, at the nodes in `region`.
fn errors<T: Real, const D: usize>(
    name: &str,
    solution: &Solution<T, D>,
    region: impl Fn([f64; D]) -> bool,
    exact: impl Fn([f64; D]) -> f64,
) -> Errors {
    let mut errors = Errors { nodes: 0, mean: 0.0, max: 0.0 };
    for (position, value) in solution.values.iter().enumerate() {
        let state = solution.grid.node(solution.grid.index(position));
        if region(state) {
            let error = (value.to_f64() - exact(state)).abs();
            errors.nodes += 1;
            errors.mean += error;
            errors.max = errors.max.max(error);
        }
    }
    errors.mean /= errors.nodes as f64;
    let Errors { nodes, mean, max } = errors;
    eprintln!("{name}: mean {mean:.2e}, max {max:.2e} over {nodes} nodes");
    errors
}
