//! Proof that no admissible path leads to a state.
//!
//! In a state with position p and heading ψ, a point c of the vehicle (in the vehicle's frame) is at
//! p + e^{iψ}c. If no admissible path takes *this body point* there, no path leads to the state. The
//! reachable positions of the body point again form a planar set, and `outer` encloses this set by
//! construction. So one suitable body point is enough for a proof.
//!
//! The body point is guessed from the curves of `slice`; a bad guess cannot prove anything false. Let
//! d(p, ψ) be the distance from the curves, and λ the direction in which d grows. Consider all states
//! whose body point is at one place q. A state with heading φ then has the position q − e^{iφ}c. All
//! these states must be outside, so d must not change to first order among them. Hence the component of
//! e^{iψ}c across λ is −∂d/∂ψ. The component along λ bends the curve of these states outward. If
//! boundary paths switch on a line along λ, the body point lies between the two switches.

use super::super::budget::Budget;
use super::super::outer::{Outer, Request};
use super::super::outline::Outliner;
use super::super::paths::{Paths, unit};
use super::slice::Slice;
use nalgebra::Complex;

type Point = Complex<f64>;

/// The claim that no state near a given state is reached from a set of starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Claim {
    /// The state, relative to the start pose in the middle (s of travel and rad).
    pub(super) position: Point,
    pub(super) heading: f64,
    /// The claim: no state within these distances is reached (s of travel and rad).
    pub(super) near: f64,
    pub(super) turn: f64,
    /// Largest deviation of the start heading (rad).
    pub(super) start_heading: f64,
}

/// The guesses. The first number is the component of e^{iψ}c along λ, and the second is an offset of
/// the component across λ. Both are fractions of the travel time. The third number is the accuracy, as
/// a fraction of `excess` (the distance from the curves minus `near`).
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

/// Step of the finite difference of d with respect to the heading (rad).
const SMALL: f64 = 1e-4;

/// Largest number of time intervals in a proof.
const MOST_PIECES: usize = 200;

/// Distances below this (s) are not resolved.
const FINEST: f64 = 1e-6;

/// Searches for proofs and reuses its buffers.
#[derive(Debug, Default)]
pub(super) struct Prover {
    outer: Outer,
    outliner: Outliner,
}

impl Prover {
    /// Tries to prove that no path of `steps` steps leads to a state within the distances of `claim`.
    /// Returns whether it succeeded. Each guess subtracts one from `trials`. The method gives up when
    /// `trials` is 0 or the budget is spent.
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
            // The positions of the body point for all headings of the claim form an arc. The segment
            // is its chord, and `height` bounds the distance of the arc from the chord.
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
