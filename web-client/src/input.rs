//! Turn inputs from keys.

use serde::{Deserialize, Serialize};
use sidestep::api::KeyEvent;
use sidestep::vehicle::TurnInput;

/// Name of the event that records the loss of keyboard focus. All keys count as released after it.
pub const BLUR: &str = "blur";

/// The steering keys, by their codes (`KeyboardEvent.code`). Codes are the same on every keyboard
/// layout.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyMap {
    /// Keys that turn left.
    pub left: Vec<String>,
    /// Keys that turn right.
    pub right: Vec<String>,
}

impl Default for KeyMap {
    /// The arrow keys, and A and D.
    fn default() -> Self {
        let codes = |codes: [&str; 2]| codes.map(str::to_owned).to_vec();
        Self { left: codes(["ArrowLeft", "KeyA"]), right: codes(["ArrowRight", "KeyD"]) }
    }
}

impl KeyMap {
    /// One key for each side. Returns `None` if a key cannot steer or both are the same.
    #[must_use]
    pub fn chosen(left: &str, right: &str) -> Option<Self> {
        let fits = can_steer(left) && can_steer(right) && left != right;
        fits.then(|| Self { left: vec![left.to_owned()], right: vec![right.to_owned()] })
    }

    /// The turn that a key causes. Returns `None` if it is not a steering key.
    #[must_use]
    pub fn turn(&self, code: &str) -> Option<TurnInput> {
        let has = |codes: &[String]| codes.iter().any(|known| known == code);
        if has(&self.left) {
            Some(TurnInput::Left)
        } else {
            has(&self.right).then_some(TurnInput::Right)
        }
    }
}

/// Whether a key may be chosen for steering. Keys that leave the page, operate it or modify other
/// keys must not be chosen.
#[must_use]
pub fn can_steer(code: &str) -> bool {
    const OTHERS: [&str; 6] = ["", "Tab", "Escape", "Enter", "NumpadEnter", "Space"];
    const GROUPS: [&str; 9] =
        ["Shift", "Control", "Alt", "Meta", "OS", "CapsLock", "NumLock", "Context", "Browser"];
    let is_function =
        code.strip_prefix('F').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    !(is_function || OTHERS.contains(&code) || GROUPS.iter().any(|group| code.starts_with(group)))
}

/// The keys that are down, in the order in which they were pressed, with the times of the presses.
#[derive(Clone, Debug, Default)]
pub struct HeldKeys(Vec<(f64, String)>);

impl HeldKeys {
    /// Records that a key went down or up. [`BLUR`] means that all keys went up.
    pub fn change(&mut self, t_ms: f64, code: &str, down: bool) {
        self.0.retain(|(_, held)| held != code && code != BLUR);
        if down {
            self.0.push((t_ms, code.to_owned()));
        }
    }

    /// Whether no key is down.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The input from the held keys: the turn of the key that was pressed last. When that key is
    /// released, the key pressed before it counts again.
    #[must_use]
    pub fn turn(&self, keys: &KeyMap) -> TurnInput {
        self.0.last().and_then(|(_, code)| keys.turn(code)).unwrap_or(TurnInput::Straight)
    }

    /// The presses of the held keys, as the first events of a scene that starts at `start_ms`.
    #[must_use]
    pub fn presses(&self, start_ms: f64) -> Vec<KeyEvent> {
        let press = |(t_ms, code): &(f64, String)| KeyEvent {
            t_ms: t_ms - start_ms,
            key: code.clone(),
            down: true,
        };
        self.0.iter().map(press).collect()
    }
}

/// The input at time `t_ms` that results from these key events, which must be sorted by time.
#[must_use]
pub fn input_at(events: &[KeyEvent], t_ms: f64, keys: &KeyMap) -> TurnInput {
    let count = events.partition_point(|event| event.t_ms <= t_ms);
    let past = events.get(..count).unwrap_or_default();
    // Find the last press that is not followed by another event of the same key.
    for (i, event) in past.iter().enumerate().rev() {
        if event.key == BLUR {
            break;
        }
        if event.down && past.iter().skip(i + 1).all(|later| later.key != event.key) {
            return keys.turn(&event.key).unwrap_or(TurnInput::Straight);
        }
    }
    TurnInput::Straight
}

#[cfg(test)]
mod tests {
    use super::*;
    use TurnInput::{Left, Right, Straight};

    #[test]
    fn the_input_is_that_of_the_key_pressed_last() {
        // A rule, key events, and the expected input at some times.
        type Case<'a> = (&'a str, &'a [(f64, &'a str, bool)], &'a [(f64, TurnInput)]);
        let cases: [Case<'_>; 5] = [
            (
                "a held key turns until it is released",
                &[(100.0, "ArrowLeft", true), (300.0, "ArrowLeft", false)],
                &[(99.0, Straight), (100.0, Left), (299.0, Left), (300.0, Straight)],
            ),
            (
                "the later press wins, and releasing it falls back",
                &[(0.0, "KeyA", true), (200.0, "ArrowRight", true), (400.0, "ArrowRight", false)],
                &[(100.0, Left), (300.0, Right), (500.0, Left)],
            ),
            (
                "releasing the earlier key changes nothing",
                &[(0.0, "KeyA", true), (200.0, "KeyD", true), (400.0, "KeyA", false)],
                &[(300.0, Right), (500.0, Right)],
            ),
            (
                "losing the keyboard releases all keys",
                &[(0.0, "KeyD", true), (100.0, BLUR, false), (200.0, "KeyA", true)],
                &[(50.0, Right), (150.0, Straight), (250.0, Left)],
            ),
            ("a key held before the start counts", &[(-300.0, "KeyD", true)], &[(0.0, Right)]),
        ];
        let keys = KeyMap::default();
        for (rule, events, expected) in cases {
            let event =
                |&(t_ms, key, down): &(f64, &str, bool)| KeyEvent { t_ms, key: key.into(), down };
            let events: Vec<_> = events.iter().map(event).collect();
            for &(t, input) in expected {
                assert_eq!(input_at(&events, t, &keys), input, "{rule}: at {t} ms");
                let mut held = HeldKeys::default();
                for event in events.iter().take_while(|event| event.t_ms <= t) {
                    held.change(event.t_ms, &event.key, event.down);
                }
                assert_eq!(held.turn(&keys), input, "{rule}: held at {t} ms");
                assert_eq!(held.is_empty(), input == Straight);
            }
        }
    }

    #[test]
    fn any_two_keys_steer_that_do_nothing_else() {
        let keys = KeyMap::chosen("KeyJ", "Numpad6").unwrap();
        assert_eq!(keys.turn("KeyJ"), Some(Left));
        assert_eq!(keys.turn("Numpad6"), Some(Right));
        assert_eq!(keys.turn("ArrowLeft"), None);
        assert_eq!(KeyMap::chosen("KeyJ", "KeyJ"), None);
        for code in ["", "Tab", "Escape", "Space", "ShiftLeft", "MetaRight", "F5", "F12"] {
            assert_eq!(KeyMap::chosen("KeyJ", code), None, "{code}");
        }
        assert!(can_steer("KeyF"));
    }
}
