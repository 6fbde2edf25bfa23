//! Decides which key a person holds. The percepts are the input of a noisy leaky accumulator with
//! two thresholds.

use super::perception::{Percept, Sight, logistic};
use super::person::Person;
use super::stream::Stream;
use crate::math::{exp, sin};
use crate::scene::{JointState, SceneParameters};
use crate::vehicle::TurnInput;
use std::collections::VecDeque;

/// Time constants of perception errors and of the activation (s).
const NOISE_S: f64 = 0.6;
const LEAK_S: f64 = 0.35;
/// Minimum time between a press and the decision to release, and between a release and the next
/// press (s). Rounding errors can make three ticks slightly shorter than this time, so that a
/// fourth tick is needed. The reference's drives depend on these rounding errors.
const REFRACTORY_S: f64 = 0.15;
/// To choose a side, a person imagines a turn by this angle (rad) to either side and compares the
/// predicted distances.
const IMAGINED_RAD: f64 = 0.4;
/// Strength of the preference for the previous side.
const STICKINESS: f64 = 2.0;
/// A person can change sides when the predicted distance has fallen by this much since the key
/// press (m).
const WORSE_M: f64 = 0.5;

/// A person at the keyboard, during one trial.
pub(super) struct Decision<'a> {
    person: Person,
    parameters: &'a SceneParameters,
    tick_s: f64,
    stream: Stream,
    /// The states from one perception lag ago to now.
    seen: VecDeque<JointState>,
    lag_ticks: usize,
    noise: [f64; 2],
    activation: f64,
    finger: Finger,
    /// The side of the previous press: −1, 0 or 1.
    last_side: f64,
}

/// State of the finger.
#[derive(Clone, Copy, Debug)]
enum Finger {
    /// No key has been down since this time (s).
    Up { since_s: f64 },
    /// A key is down.
    Down(Press),
}

#[derive(Clone, Copy, Debug)]
struct Press {
    side: TurnInput,
    since_s: f64,
    /// The predicted distance at the press (m).
    predicted_m: f64,
    /// Extra time to hold the key after it is no longer needed (s). `None` for a lapse, whose time
    /// of release is fixed at the press.
    overhold_s: Option<f64>,
    /// The time of release (s), once it is decided.
    until_s: Option<f64>,
}

impl<'a> Decision<'a> {
    pub(super) fn new(
        person: Person,
        parameters: &'a SceneParameters,
        tick_s: f64,
        mut stream: Stream,
    ) -> Self {
        Self {
            noise: [stream.normal(), stream.normal()],
            person,
            parameters,
            tick_s,
            stream,
            seen: VecDeque::new(),
            lag_ticks: (person.lag_s / tick_s).round() as usize,
            activation: 0.0,
            finger: Finger::Up { since_s: f64::NEG_INFINITY },
            last_side: 0.0,
        }
    }

    /// The key held from `t_s` to the next tick. Call it once per tick, in order, because it draws
    /// random numbers in the reference's order.
    pub(super) fn key(&mut self, t_s: f64, state: &JointState) -> TurnInput {
        self.seen.push_back(*state);
        if self.seen.len() > self.lag_ticks + 1 {
            self.seen.pop_front();
        }
        // During the first lag, the person sees the initial state.
        let delayed = *self.seen.front().unwrap_or(state);
        let keep = exp(-self.tick_s / NOISE_S);
        for noise in &mut self.noise {
            *noise = keep * *noise + (1.0 - keep * keep).sqrt() * self.stream.normal();
        }
        let sight = Sight::of(self.parameters, &delayed, 0.0);
        let radius_m = self.parameters.danger_radius_m;
        let percept = Percept::of(&self.person, radius_m, &sight, self.noise);
        self.activation += self.tick_s * (percept.drive - self.activation) / LEAK_S
            + self.person.activation_noise * self.tick_s.sqrt() * self.stream.normal();
        let (lapse, reversal) = (self.stream.unit(), self.stream.unit());
        self.finger = match self.finger {
            Finger::Up { since_s } => {
                let lapses = lapse < self.person.lapses_per_s * self.tick_s;
                if self.activation > self.person.press_above && t_s - since_s >= REFRACTORY_S {
                    Finger::Down(self.press(t_s, &delayed, &sight, &percept))
                } else if lapses {
                    Finger::Down(self.lapse(t_s, &percept))
                } else {
                    self.finger
                }
            }
            Finger::Down(press) => {
                let reverses = reversal < self.person.reversals_per_s * self.tick_s;
                self.hold(t_s, press, &percept, reverses)
            }
        };
        match self.finger {
            Finger::Up { .. } => TurnInput::Straight,
            Finger::Down(press) => press.side,
        }
    }

    /// Presses the key of a random side. The probabilities depend on the predicted distances, the
    /// bearing, the bias and the previous side.
    fn press(&mut self, t_s: f64, delayed: &JointState, sight: &Sight, percept: &Percept) -> Press {
        let passing = |turned| Sight::of(self.parameters, delayed, turned).predicted_m;
        let for_left = self.person.side_by_distance
            * (passing(IMAGINED_RAD) - passing(-IMAGINED_RAD))
            - self.person.side_by_bearing * sin(sight.bearing_rad)
            + self.person.side_bias
            + STICKINESS * self.last_side;
        let side = side(self.stream.unit() < logistic(for_left));
        self.last_side = f64::from(side.sign());
        Press {
            side,
            since_s: t_s,
            predicted_m: percept.predicted_m,
            overhold_s: Some(self.stream.exponential(self.person.overhold_s)),
            until_s: None,
        }
    }

    /// A turn without a reason. It does not influence later choices of a side.
    fn lapse(&mut self, t_s: f64, percept: &Percept) -> Press {
        Press {
            side: side(self.stream.unit() < 0.5),
            since_s: t_s,
            predicted_m: percept.predicted_m,
            overhold_s: None,
            until_s: Some(t_s + self.stream.uniform(0.2, 0.4)),
        }
    }

    fn hold(&mut self, t_s: f64, mut press: Press, percept: &Percept, reverses: bool) -> Finger {
        let needed = self.activation > self.person.press_above;
        match (press.until_s, press.overhold_s) {
            (None, Some(overhold_s)) => {
                let over = self.activation < self.person.release_below;
                if over && t_s - press.since_s >= REFRACTORY_S {
                    press.until_s = Some(t_s + overhold_s);
                }
            }
            (Some(until_s), Some(_)) if needed && t_s < until_s => press.until_s = None,
            _ => {}
        }
        if press.until_s.is_some_and(|until_s| t_s >= until_s) {
            return Finger::Up { since_s: t_s };
        }
        if reverses && percept.predicted_m < press.predicted_m - WORSE_M {
            press.side = side(press.side == TurnInput::Right);
            press.predicted_m = percept.predicted_m;
            self.last_side = f64::from(press.side.sign());
        }
        Finger::Down(press)
    }
}

fn side(left: bool) -> TurnInput {
    if left { TurnInput::Left } else { TurnInput::Right }
}
