//! The value function of a pursuit game, from any solution method.

use super::exact::{ExactValue, PART, check_states};
use super::pursuit::PursuitGame;
use super::sampled::SampledValue;
use crate::invalid::Invalid;
use crate::parallel::parallel_parts;
use crate::vehicle::VehicleModel;
use std::sync::Arc;

/// The value of a pursuit game at any relative state.
#[derive(Clone, Debug, PartialEq)]
pub enum ValueFunction {
    /// Identical vehicles: the closed form.
    Exact(ExactValue),
    /// Any vehicles: interpolated between the nodes of a solved grid.
    Sampled(Arc<SampledValue>),
}

/// Value, gradient and optimal turn rates at a relative state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ValueState {
    /// V (m).
    pub value: f64,
    /// (∂V/∂x, ∂V/∂y, ∂V/∂ψ) in (m/m, m/m, m/rad); one-sided where V has a kink.
    pub gradient: [f64; 3],
    /// The evader's optimal turn rate (rad/s).
    pub evader_turn: f64,
    /// The pursuer's optimal turn rate (rad/s).
    pub pursuer_turn: f64,
    /// Whether the values come from the closed form.
    pub exact: bool,
    /// Whether the state is within the solved grid. Outside, V is the range margin (range minus
    /// radius) plus the deficit at the nearest point of the grid's boundary. Even inside, V depends
    /// on the size of the grid: for a faster pursuer, a larger grid can give a different V.
    pub inside: bool,
}

impl ValueFunction {
    /// The game.
    #[must_use]
    pub fn game(&self) -> PursuitGame {
        match self {
            Self::Exact(exact) => {
                let vehicle = VehicleModel {
                    speed_mps: exact.speed_mps(),
                    turn_rate_radps: exact.turn_rate_radps(),
                };
                PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: exact.radius_m() }
            }
            Self::Sampled(sampled) => sampled.game(),
        }
    }

    /// How much V was still changing (m) when the solver stopped without converging
    /// ([`SampledValue::unsettled_m`]); `None` if it converged. This is not a bound on the error.
    /// The difference from the converged value is unknown, and in a chase it can be much larger
    /// than this change. For a faster pursuer, V also depends on the range of the grid
    /// ([`Options::range_m`](super::Options::range_m)).
    #[must_use]
    pub fn unsettled_m(&self) -> Option<f64> {
        match self {
            Self::Exact(_) => None,
            Self::Sampled(sampled) => sampled.unsettled_m(),
        }
    }

    /// V (m) at the pursuer's pose (x, y, ψ) in the evader's frame. If V ≤ 0, the pursuer can force
    /// a collision. Returns NaN if a coordinate is not finite.
    #[must_use]
    pub fn value(&self, relative: [f64; 3]) -> f64 {
        if !relative.iter().all(|coordinate| coordinate.is_finite()) {
            return f64::NAN;
        }
        match self {
            Self::Exact(exact) => exact.value(relative),
            Self::Sampled(sampled) => sampled.state(relative).value,
        }
    }

    /// Writes the value at each of `states` to `out`, on all available threads. The results have
    /// the same bits as [`Self::value`].
    ///
    /// # Errors
    /// [`Invalid`] if `out` and `states` differ in length, or if a coordinate is not finite. The
    /// error names the first such coordinate (for example `states[17].y`), and `out` is unchanged.
    pub fn values_into(&self, states: &[[f64; 3]], out: &mut [f64]) -> Result<(), Invalid> {
        match self {
            Self::Exact(exact) => exact.parallel_values_into(states, out),
            Self::Sampled(sampled) => {
                check_states(states, out.len())?;
                parallel_parts(states, out, PART, |states, out| {
                    for (value, &state) in out.iter_mut().zip(states) {
                        *value = sampled.state(state).value;
                    }
                });
                Ok(())
            }
        }
    }

    /// Value, gradient and both players' optimal turn rates.
    #[must_use]
    pub fn state(&self, relative: [f64; 3]) -> ValueState {
        if !relative.iter().all(|coordinate| coordinate.is_finite()) {
            return ValueState {
                value: f64::NAN,
                gradient: [f64::NAN; 3],
                evader_turn: f64::NAN,
                pursuer_turn: f64::NAN,
                exact: matches!(self, Self::Exact(_)),
                inside: false,
            };
        }
        match self {
            Self::Exact(exact) => {
                let state = exact.analyze(relative);
                ValueState {
                    value: state.value,
                    gradient: state.gradient,
                    evader_turn: state.evader_turn,
                    pursuer_turn: state.pursuer_turn,
                    exact: true,
                    inside: true,
                }
            }
            Self::Sampled(sampled) => {
                let state = sampled.state(relative);
                let [evader_turn, pursuer_turn] =
                    sampled.game().optimal_turns(relative, state.gradient);
                ValueState {
                    value: state.value,
                    gradient: state.gradient,
                    evader_turn,
                    pursuer_turn,
                    exact: false,
                    inside: state.inside,
                }
            }
        }
    }
}
