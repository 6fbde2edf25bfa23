//! The keys of the replay, by their codes.

use super::Msg;
use crate::view::{self, el};
use sidestep::trial_view::view::SPEEDS;

/// The action of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Plays, or pauses.
    Play,
    /// Moves by this many steps, backward if negative.
    Step(i32),
    /// Goes to the start.
    Start,
    /// Goes to the end.
    End,
    /// Switches to the next faster (positive) or slower (negative) speed.
    Speed(i32),
    /// Goes to the next (positive) or the previous (negative) trial.
    Trial(i32),
    /// Shows or hides the layer at this index.
    Layer(usize),
    /// Shows or hides the legend.
    Legend,
    /// Switches the colours of the sets.
    Colours,
    /// Switches between sets for the whole time ahead and sets after each step.
    Sets,
    /// Shows or hides the second pane.
    Beside,
}

/// The code of each key, its label and its action.
const KEYS: [(&str, &str, Key); 25] = [
    ("Space", "Space", Key::Play),
    ("ArrowLeft", "←", Key::Step(-1)),
    ("ArrowRight", "→", Key::Step(1)),
    ("PageUp", "Page up", Key::Step(-5)),
    ("PageDown", "Page down", Key::Step(5)),
    ("Home", "Home", Key::Start),
    ("End", "End", Key::End),
    ("ArrowUp", "↑", Key::Speed(1)),
    ("ArrowDown", "↓", Key::Speed(-1)),
    ("KeyP", "P", Key::Trial(-1)),
    ("KeyN", "N", Key::Trial(1)),
    ("Digit1", "1", Key::Layer(0)),
    ("Digit2", "2", Key::Layer(1)),
    ("Digit3", "3", Key::Layer(2)),
    ("Digit4", "4", Key::Layer(3)),
    ("Digit5", "5", Key::Layer(4)),
    ("Digit6", "6", Key::Layer(5)),
    ("Digit7", "7", Key::Layer(6)),
    ("Digit8", "8", Key::Layer(7)),
    ("Digit9", "9", Key::Layer(8)),
    ("Digit0", "0", Key::Layer(9)),
    ("KeyL", "L", Key::Legend),
    ("KeyC", "C", Key::Colours),
    ("KeyS", "S", Key::Sets),
    ("KeyB", "B", Key::Beside),
];

impl Key {
    /// The action of the key with this code, if any.
    pub(super) fn of(code: &str) -> Option<Self> {
        KEYS.iter().find(|(known, ..)| *known == code).map(|(.., key)| *key)
    }
}

/// The label of the key that switches a layer.
pub(super) fn of_layer(place: usize) -> Option<&'static str> {
    KEYS.iter().find(|(.., key)| *key == Key::Layer(place)).map(|(_, printed, _)| *printed)
}

/// The next higher or lower speed. If there is none, the speed stays the same.
pub(super) fn speed(present: f64, by: i32) -> f64 {
    let place = SPEEDS.iter().position(|&speed| speed == present).unwrap_or(2) as i32;
    SPEEDS[(place + by).clamp(0, SPEEDS.len() as i32 - 1) as usize]
}

/// The collapsible list of keys.
pub(super) fn list() -> view::Node<Msg> {
    let rows = [
        ("Space", "play or pause"),
        ("← →", "a step back or forward"),
        ("Page up, Page down", "five steps back or forward"),
        ("Home, End", "the start, the end"),
        ("↑ ↓", "faster, slower"),
        ("P, N", "the previous trial, the next trial"),
        ("1 … 9, 0", "show or hide a layer"),
        ("S", "sets: the whole time ahead, or each step"),
        ("C", "colours of the sets"),
        ("L", "legend"),
        ("B", "two predictors side by side"),
    ];
    let row = |(keys, what): (&str, &str)| {
        el("div").child(el("dt").text(keys)).child(el("dd").text(what))
    };
    el("details")
        .class("keys")
        .child(el("summary").text("Keys"))
        .child(el("dl").class("facts").children(rows.into_iter().map(row)))
}
