//! Proof that no admissible path leads to a state.
//!
//! In a state with position p and heading ψ, a point c of the vehicle (in its frame) is at p +
//! e^{iψ}c. If no admissible path takes *that point* there, none leads to the state. The positions
//! of the point form a planar set again, which `outer` encloses by construction. So one such point
//! is a proof.
//!
//! The point is guessed from the curves of `slice`; a bad guess cannot prove anything false. Let d(p, ψ) be the
//! distance from the curves, and λ the direction in which it grows. All states that have the point in the same
//! place, q − e^{iφ}c with heading φ, must be outside; so d must not change to first order along them: the
//! component of e^{iψ}c across λ is −∂d/∂ψ. The component along λ bends them outward. Where boundary paths
//! switch on a line along λ, the point is between the two switches.

use super::super::budget::Budget;
use super::super::outer::{Outer, Request};
use super::super::outline::Outliner;
use super::super::paths::{Paths, unit};
use super::slice::Slice;
use nalgebra::Complex;

type Point = Complex<f64>;

/// The claim that no state near this one is reached from some starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Claim {
    /// Seen from the start in the middle, s of travel and rad.
    pub(super) position: Point,
    pub(super) heading: f64,
    /// No state within these distances may be reached, s of travel and rad.
    pub(super) near: f64,
    pub(super) turn: f64,
    /// Largest deviation of the start heading, rad.
    pub(super) start_heading: f64,
}

/// The component of e^{iψ}c along λ and the offset of the one across, as shares of the travel time;
/// and the accuracy, as a share of the claimed distance.
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

/// Step of the finite difference of d in the heading, rad.
const SMALL: f64 = 1e-4;

/// Largest number of pieces of time in a proof.
const MOST_PIECES: usize = 200;

/// Smaller distances, s, are not resolved.
const FINEST: f64 = 1e-6;

/// Searches for proofs, one after the other with the same buffers.
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
            // There is only one path.
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
            // The positions of the point for all headings of the claim, up to the height of an arc
            // over its chord.
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
