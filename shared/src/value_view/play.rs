//! Both vehicles play optimally from a relative state.

use crate::invalid::Invalid;
use crate::math::{PI, hypot};
use crate::reachability::ValueFunction;
use crate::vehicle::Pose;
use crate::vehicle::dubins::{arc, relative_state};

/// A game in which both vehicles play optimally. It ends when the vehicles have not come closer for
/// as long as the slower-turning vehicle takes to turn by 180°.
#[derive(Clone, Debug, PartialEq)]
pub struct Play {
    /// Time between two states (s).
    pub step_s: f64,
    /// The evader in the world: it starts at the origin and heads along +x.
    pub evader: Vec<Pose>,
    /// The pursuer in the world.
    pub pursuer: Vec<Pose>,
    /// The pursuer in the evader's frame: x and y (m), and ψ (rad).
    pub relative: Vec<[f64; 3]>,
    /// The given initial state.
    pub start: [f64; 3],
    /// V at the start (m).
    pub value_m: f64,
    /// Index of the state at which the vehicles are closest.
    pub closest: usize,
    /// Index of the first state within the danger radius, if any.
    pub caught: Option<usize>,
    /// Whether the simulation was cut off while the pursuer was still approaching.
    pub goes_on: bool,
}

/// Limit on a time step. In one step, the faster-turning vehicle turns by at most this angle (rad),
/// and the distance changes by at most this fraction of the radius.
const STEP: f64 = 0.004;
/// Maximum duration of a game, as the angle (rad) that the slower-turning vehicle can turn in this
/// time. In a chase, vehicles can drive several full circles.
const LONGEST: f64 = 8.0 * PI;
/// Smallest decrease of the distance that counts as an approach, as a fraction of the radius. For
/// two vehicles side by side, rounding errors alone can reduce the distance in every step.
const CLOSER: f64 = 1e-4;
/// Maximum number of steps of a game.
const MOST_STEPS: usize = 20_000;

/// Optimal play from the pursuer's pose in the evader's frame (x and y in m, ψ in rad). The turn
/// rates come from [`ValueFunction::state`] and are updated at every step.
///
/// # Errors
/// [`Invalid`] for a state that is not finite, and for a function with a finite horizon. With a
/// finite horizon, the turn rates are optimal only at the start, because V changes with the
/// remaining time.
pub fn play(function: &ValueFunction, start: [f64; 3]) -> Result<Play, Invalid> {
    crate::invalid::all_finite("at", &start)?;
    if let ValueFunction::Sampled(samples) = function
        && samples.horizon_s().is_finite()
    {
        let expected = "inf: optimal play needs V for every remaining time";
        return Err(Invalid::new("horizon", expected, samples.horizon_s()));
    }
    let game = function.game();
    let rates = [game.evader.turn_rate_radps, game.pursuer.turn_rate_radps];
    let slower = rates[0].min(rates[1]);
    let closing = game.evader.speed_mps + game.pursuer.speed_mps;
    let step_s = (STEP / rates[0].max(rates[1])).min(STEP * game.radius_m / closing);
    let most = ((LONGEST / slower / step_s) as usize).min(MOST_STEPS);
    // Number of steps without an approach after which the game ends.
    let patience = (PI / slower / step_s) as usize;

    let mut evader = vec![Pose::new(0.0, 0.0, 0.0)];
    let mut pursuer = vec![Pose::new(start[0], start[1], start[2])];
    let mut relative = vec![relative_state(evader[0], pursuer[0])];
    let range = |[x, y, _]: [f64; 3]| hypot(x, y);
    let (mut closest, mut least) = (0, range(start));
    let mut now = 0;
    while now < most && now - closest < patience {
        let state = function.state(relative[now]);
        evader.push(arc(evader[now], game.evader.speed_mps, state.evader_turn, step_s));
        pursuer.push(arc(pursuer[now], game.pursuer.speed_mps, state.pursuer_turn, step_s));
        now += 1;
        relative.push(relative_state(evader[now], pursuer[now]));
        if range(relative[now]) < least - CLOSER * game.radius_m {
            (closest, least) = (now, range(relative[now]));
        }
    }
    let caught = relative.iter().position(|state| range(*state) <= game.radius_m);
    let goes_on = now - closest < patience;
    let value_m = function.value(start);
    Ok(Play { step_s, evader, pursuer, relative, start, value_m, closest, caught, goes_on })
}

impl Play {
    /// The least distance between the vehicles (m).
    #[must_use]
    pub fn least_distance_m(&self) -> f64 {
        let [x, y, _] = self.relative[self.closest];
        hypot(x, y)
    }

    /// Time at which the vehicles are closest (s).
    #[must_use]
    pub fn closest_s(&self) -> f64 {
        self.closest as f64 * self.step_s
    }

    /// Time at which the distance first falls to the danger radius or less (s), if it does.
    #[must_use]
    pub fn caught_s(&self) -> Option<f64> {
        self.caught.map(|step| step as f64 * self.step_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;
    use crate::reachability::{Accuracy, ExactValue, Options, PursuitGame, solve};
    use crate::vehicle::VehicleModel;
    use core::ops::ControlFlow;

    fn paper() -> ValueFunction {
        ValueFunction::Exact(ExactValue::new(2.0, 0.5, 3.0).unwrap())
    }

    /// Checks the definition of V: the least distance of optimal play is V + R.
    #[test]
    fn the_least_distance_is_the_value() {
        let mut rng = SeededRng::new(7);
        let function = paper();
        for _ in 0..60 {
            let start = [rng.uniform(-6.0, 14.0), rng.uniform(-9.0, 9.0), rng.uniform(-PI, PI)];
            let game = play(&function, start).unwrap();
            let missed = game.least_distance_m() - (game.value_m + 3.0);
            assert!(missed.abs() < 0.03, "{start:?}: {missed}");
            assert!(!game.goes_on);
            assert_eq!(game.caught.is_some(), game.least_distance_m() <= 3.0);
        }
    }

    #[test]
    fn a_solved_game_is_played_as_well() {
        let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
        let game =
            PursuitGame { evader: vehicle(2.0, 0.5), pursuer: vehicle(1.6, 0.4), radius_m: 3.0 };
        let options = Options { accuracy: Accuracy::Standard, ..Options::default() };
        let solved = solve(game, &options, &mut |_| ControlFlow::Continue(())).unwrap().function;
        let mut rng = SeededRng::new(8);
        for _ in 0..30 {
            let start = [rng.uniform(-4.0, 12.0), rng.uniform(-7.0, 7.0), rng.uniform(-PI, PI)];
            let game = play(&solved, start).unwrap();
            let missed = game.least_distance_m() - (game.value_m + 3.0);
            assert!(missed.abs() < 0.15, "{start:?}: {missed}");
        }
    }

    #[test]
    fn states_that_cannot_be_played_are_refused() {
        assert_eq!(play(&paper(), [f64::NAN, 0.0, 0.0]).unwrap_err().field, "at[0]");
        let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
        let game = PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 };
        let options = Options { horizon_s: 1.0, accuracy: Accuracy::Draft, ..Options::default() };
        let solved = solve(game, &options, &mut |_| ControlFlow::Continue(())).unwrap().function;
        let refused = play(&solved, [8.0, 0.0, PI]).unwrap_err();
        assert_eq!((refused.field.as_str(), refused.found.as_str()), ("horizon", "1"));
    }

    #[test]
    fn a_game_that_starts_caught_says_so() {
        let game = play(&paper(), [1.0, 0.5, 0.0]).unwrap();
        assert_eq!((game.caught, game.caught_s()), (Some(0), Some(0.0)));
    }
}
