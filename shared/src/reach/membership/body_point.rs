//! Proof that no admissible path leads to a state.
//!
//! In a state with position p and heading ψ, a point c of the vehicle (in its frame) is at p + e^{iψ}c. If no admissible
//! path takes *that point* there, none leads to the state. Where the point can be is a planar set again, which `outer`
//! surrounds by construction. So one such point is proof.
//!
//! Which point to take is guessed from the curves of `slice`, and a bad guess proves nothing wrong. Let d(p, ψ) be the
//! distance from the curves, and λ the direction in which it grows. All states that have the point in the same place, q − e^{iφ}c
//! with heading φ, must be outside; so d must not change to first order along them: the component of e^{iψ}c across λ is
//! −∂d/∂ψ. The component along λ bends them outward. Where boundary paths switch on a line along λ, the point is
//! between the two switches.

use super::super::budget::Budget;
use super::super::outer::{Outer, Request};
use super::super::outline::Outliner;
use super::super::paths::{Paths, unit};
use super::slice::Slice;
use nalgebra::Complex;

type Point = Complex<f64>;

/// States that may be reached from some starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Claim {
    /// Seen from the start in the middle, s of travel and rad.
    pub(super) position: Point,
    pub(super) heading: f64,
    /// How far from it no state may be reached, s of travel and rad.
    pub(super) near: f64,
    pub(super) turn: f64,
    /// By how much the heading at the start may differ, rad.
    pub(super) start_heading: f64,
}

/// The component of e^{iψ}c along λ, and what is added to the one across, as shares of the time travelled; and the accuracy, as
/// a share of the distance that is claimed.
const GUESSES: [[f64; 3]; 12] = [
    [0.5, 0.0, 1.0],
    [0.25, 0.0, 1.0],
    [0.75, 0.0, 1.0],
    [0.1, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [2.0, 0.0, 1.0],
    [0.5, 0.0, 0.2],
    [0.25, 0.0, 0.2],
    [0.5, 0.25, 0.5],
    [0.5, -0.25, 0.5],
    [0.25, 0.1, 0.5],
    [0.25, -0.1, 0.5],
];

/// Step of the difference of d over the heading, rad.
const SMALL: f64 = 1e-4;

/// Most pieces of time of one proof.
const MOST_PIECES: usize = 200;

/// Smaller distances, s, are not told apart.
const FINEST: f64 = 1e-6;

/// Searches for proofs, one after the other in the same memory.
#[derive(Debug, Default)]
pub(super) struct Prover {
    outer: Outer,
    outliner: Outliner,
}

impl Prover {
    /// Whether it is proven that no path of `steps` steps leads to a state within the distances of `claim`. Each guess
    /// subtracts one from `trials`; at 0, or once the budget is spent, there are no more guesses.
    pub(super) fn proves(
        &mut self,
        paths: &Paths,
        steps: usize,
        claim: Claim,
        trials: &mut usize,
        budget: &Budget<'_>,
    ) -> bool {
        if *trials == 0 || budget.is_spent() {
            return false;
        }
        let seconds = steps as f64 * paths.step_s;
        let (low, high) = (paths.low.heading(steps), paths.high.heading(steps));
        let nearest = |heading: f64| {
            Slice::new(paths, steps, heading.clamp(low, high), budget).nearest(claim.position)
        };
        let (point, distance) = nearest(claim.heading);
        if budget.is_spent() {
            return false;
        }
        let excess = distance - claim.near;
        if claim.start_heading == 0.0 && (0..steps).all(|step| paths.lo[step] == paths.hi[step]) {
            // There is one path.
            return excess > 0.0;
        }
        if excess < FINEST {
            return false;
        }
        let outward = (claim.position - point) / distance;
        let growth = (nearest(claim.heading + SMALL).1 - distance) / SMALL;
        for [along, across, accuracy] in GUESSES {
            if *trials == 0 || budget.is_spent() {
                return false;
            }
            *trials -= 1;
            let arm = outward * Point::new(along * seconds, across * seconds - growth);
            let request = Request {
                steps,
                tube: false,
                accuracy: accuracy * excess,
                most_pieces: MOST_PIECES,
                heading: claim.start_heading,
                body_point: arm * unit(-claim.heading),
            };
            // Where the point is in the states whose headings are as near, up to the height of an arc over its chord.
            let line = [-claim.turn, claim.turn].map(|turn| claim.position + arm * unit(turn));
            let height = 0.5 * arm.norm_sqr().sqrt() * claim.turn * claim.turn;
            let clearance = self.outer.clearance(paths, request, line, &mut self.outliner, budget);
            if clearance > claim.near + height {
                return true;
            }
        }
        false
    }
}
