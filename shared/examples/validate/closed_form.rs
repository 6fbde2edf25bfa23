//! Checks the closed form against the equation that it must satisfy, and against an independent
//! reference.

use std::error::Error;

use serde_json::{Value, json};
use sidestep::math::{PI, SeededRng, TAU, sin_cos};
use sidestep::reachability::{ExactValue, PursuitGame};

use crate::Known;
use crate::errors::{Errors, numbers};

const STATES: usize = 100_000;

/// Measures the closed form of a game.
pub(crate) fn check(known: &Known) -> Result<Value, Box<dyn Error>> {
    let game = known.game;
    let exact = game.exact()?;
    let rho = exact.speed_mps() / exact.turn_rate_radps();
    let mut rng = SeededRng::new(1);
    let mut along = |span: f64| rng.uniform(-span, span);
    let (mut residual, mut differences, mut closing) = (Vec::new(), Vec::new(), 0);
    for _ in 0..STATES {
        let state = [along(6.0 * rho), along(6.0 * rho), along(PI)];
        let found = exact.analyze(state);
        let gap = game.target(state) - found.value;
        residual.push(gap.min(hamiltonian(&game, state, found.gradient)).abs());
        let slope = |d: usize| {
            let step = 1e-6 * if d < 2 { rho } else { 1.0 };
            let value = |sign: f64| {
                let mut moved = state;
                moved[d] += sign * step;
                exact.value(moved)
            };
            (value(1.0) - value(-1.0)) / (2.0 * step)
        };
        let gradient = [slope(0), slope(1), slope(2)];
        differences.push(gap.min(hamiltonian(&game, state, gradient)).abs());
        closing += usize::from(gap > 1e-9);
    }

    let at = |row: &[f64]| exact.value([row[0], row[1], row[2]]);
    let barrier = numbers(known.barrier)?.iter().map(|row| at(row).abs()).collect();
    let states = numbers(known.states)?.iter().map(|row| (at(row) - row[3]).abs()).collect();
    Ok(json!({
        "game": known.name,
        "parameters": game,
        // |min(r − R − V, H)|, in m or m/s, once with the closed form's gradient and once with
        // central differences of V.
        "residual": Errors::of(residual),
        "residual_of_differences": Errors::of(differences),
        // Number of states with V < r − R, where the equation is H = 0.
        "closing": closing,
        // |V| at points on the reference's barrier, and errors at the reference's states.
        "barrier": Errors::of(barrier),
        "states": Errors::of(states),
        // Volume of {V ≤ 0} (m²·rad).
        "volume": volume(&exact),
        "reference_volume": known.volume,
    }))
}

/// The Hamiltonian H(x, p). The evader's turn rate maximises it, and the pursuer's turn rate
/// minimises it.
fn hamiltonian(game: &PursuitGame, [x, y, psi]: [f64; 3], [p1, p2, p3]: [f64; 3]) -> f64 {
    let (sin, cos) = sin_cos(psi);
    let speed = game.pursuer.speed_mps;
    p1 * (speed * cos - game.evader.speed_mps)
        + p2 * speed * sin
        + game.evader.turn_rate_radps * (p1 * y - p2 * x - p3).abs()
        - game.pursuer.turn_rate_radps * p3.abs()
}

/// The volume ∭ dx dy dψ of {V ≤ 0}. Every ray from the evader leaves the set once, so the volume
/// is ∫∫ ½ r² over bearing and heading. Headings above π follow by mirror symmetry.
fn volume(exact: &ExactValue) -> f64 {
    const BEARINGS: usize = 512;
    const HEADINGS: usize = 256;
    let (inner, outer) = (exact.radius_m(), exact.range_bound_m(0.0));
    let mut sum = 0.0;
    for k in 0..HEADINGS {
        let psi = PI * (k as f64 + 0.5) / HEADINGS as f64;
        for j in 0..BEARINGS {
            let (sin, cos) = sin_cos(TAU * (j as f64 + 0.5) / BEARINGS as f64);
            let (mut low, mut high) = (inner, outer);
            for _ in 0..36 {
                let middle = 0.5 * (low + high);
                if exact.value([middle * cos, middle * sin, psi]) <= 0.0 {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            sum += 0.5 * low * low;
        }
    }
    2.0 * sum * (TAU / BEARINGS as f64) * (PI / HEADINGS as f64)
}
