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
        // Shift, pressed meanwhile, makes another name of the same key: "a" goes down, "A" up.
        self.0.retain(|(_, held)| !held.eq_ignore_ascii_case(key) && key != BLUR);
        if down {
            self.0.push((t_ms, key.to_owned()));
        }
    }

    /// The input that they ask for: that of the key pressed last. When it is released, the other
    /// one counts again.
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

    #[test]
    fn the_input_is_that_of_the_key_pressed_last() {
        // A rule, what the keys did, and the input at some times.
        type Case<'a> = (&'a str, &'a [(f64, &'a str, bool)], &'a [(f64, TurnInput)]);
        let cases: [Case<'_>; 6] = [
            (
                "a held key turns until it is released",
                &[(100.0, "ArrowLeft", true), (300.0, "ArrowLeft", false)],
                &[(99.0, Straight), (100.0, Left), (299.0, Left), (300.0, Straight)],
            ),
            (
                "the later press wins, and releasing it falls back",
                &[(0.0, "a", true), (200.0, "ArrowRight", true), (400.0, "ArrowRight", false)],
                &[(100.0, Left), (300.0, Right), (500.0, Left)],
            ),
            (
                "releasing the earlier key changes nothing",
                &[(0.0, "a", true), (200.0, "d", true), (400.0, "a", false)],
                &[(300.0, Right), (500.0, Right)],
            ),
            (
                "losing the keyboard releases all keys",
                &[(0.0, "d", true), (100.0, BLUR, false)],
                &[(50.0, Right), (150.0, Straight)],
            ),
            ("a key held before the start counts", &[(-300.0, "d", true)], &[(0.0, Right)]),
            (
                "a key is released whatever Shift has made of its name",
                &[(0.0, "a", true), (100.0, "A", false), (200.0, "D", true), (300.0, "d", false)],
                &[(50.0, Left), (150.0, Straight), (250.0, Right), (350.0, Straight)],
            ),
        ];
        for (rule, events, expected) in cases {
            let event =
                |&(t_ms, key, down): &(f64, &str, bool)| KeyEvent { t_ms, key: key.into(), down };
            let events: Vec<_> = events.iter().map(event).collect();
            for &(t, input) in expected {
                assert_eq!(input_at(&events, t), input, "{rule}: at {t} ms");
            }
        }
    }
}
