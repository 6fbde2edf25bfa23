//! Which input the keys ask for.

use sidestep::api::KeyEvent;
use sidestep::vehicle::TurnInput;

/// The name under which the loss of all keys is recorded.
pub const BLUR: &str = "blur";

/// The turn that a key stands for: arrows, or A and D.
#[must_use]
pub fn turn_of_key(key: &str) -> Option<TurnInput> {
    match key {
        "ArrowLeft" | "a" | "A" => Some(TurnInput::Left),
        "ArrowRight" | "d" | "D" => Some(TurnInput::Right),
        _ => None,
    }
}

/// The keys that are down, in the order in which they were pressed, with when that was.
#[derive(Clone, Debug, Default)]
pub struct HeldKeys(Vec<(f64, String)>);

impl HeldKeys {
    /// A key went down or up; with [`BLUR`], all went up.
    pub fn change(&mut self, t_ms: f64, key: &str, down: bool) {
        self.0.retain(|(_, held)| held != key && key != BLUR);
        if down {
            self.0.push((t_ms, key.to_owned()));
        }
    }

    /// What they ask for. Of two held keys the one pressed later wins; when it is released,
    /// the other counts again.
    #[must_use]
    pub fn turn(&self) -> TurnInput {
        self.0.last().and_then(|(_, key)| turn_of_key(key)).unwrap_or(TurnInput::Straight)
    }

    /// Their presses as the first events of a scene that starts at `start_ms`.
    #[must_use]
    pub fn presses(&self, start_ms: f64) -> Vec<KeyEvent> {
        let press = |(t_ms, key): &(f64, String)| KeyEvent {
            t_ms: t_ms - start_ms,
            key: key.clone(),
            down: true,
        };
        self.0.iter().map(press).collect()
    }
}

/// The input at time `t_ms`, given what the keys did (in order of time).
#[must_use]
pub fn input_at(events: &[KeyEvent], t_ms: f64) -> TurnInput {
    let mut held = HeldKeys::default();
    for event in events.iter().take_while(|event| event.t_ms <= t_ms) {
        held.change(event.t_ms, &event.key, event.down);
    }
    held.turn()
}

#[cfg(test)]
mod tests {
    use super::*;
    use TurnInput::{Left, Right, Straight};

    fn check(events: &[(f64, &str, bool)], expected: &[(f64, TurnInput)]) {
        let events: Vec<_> = events
            .iter()
            .map(|&(t_ms, key, down)| KeyEvent { t_ms, key: key.to_owned(), down })
            .collect();
        for &(t, input) in expected {
            assert_eq!(input_at(&events, t), input, "at {t} ms");
        }
    }

    #[test]
    fn a_held_key_turns_until_it_is_released() {
        check(
            &[(100.0, "ArrowLeft", true), (300.0, "ArrowLeft", false)],
            &[(99.0, Straight), (100.0, Left), (299.0, Left), (300.0, Straight)],
        );
    }

    #[test]
    fn the_later_press_wins_and_releasing_it_falls_back() {
        check(
            &[(0.0, "a", true), (200.0, "ArrowRight", true), (400.0, "ArrowRight", false)],
            &[(100.0, Left), (300.0, Right), (500.0, Left)],
        );
    }

    #[test]
    fn releasing_the_earlier_key_changes_nothing() {
        check(
            &[(0.0, "a", true), (200.0, "d", true), (400.0, "a", false)],
            &[(300.0, Right), (500.0, Right)],
        );
    }

    #[test]
    fn losing_the_keyboard_releases_all_keys() {
        check(&[(0.0, "d", true), (100.0, BLUR, false)], &[(50.0, Right), (150.0, Straight)]);
    }

    #[test]
    fn keys_held_before_the_start_count() {
        check(&[(-300.0, "d", true)], &[(0.0, Right)]);
    }
}
