//! The keys of the page, by their codes.

use super::Msg;
use crate::view::{self, el};
use sidestep::value_view::Shown;

/// The action of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Moves the cross-hair by these numbers of steps to the right and upwards.
    Move([i8; 2]),
    /// Changes the relative heading by this number of degrees.
    Turn(i16),
    /// Scales the tube by 1.1 raised to this power.
    Zoom(i8),
    /// Plays optimally from the cross-hair.
    Play,
    /// Discards the optimal play that is shown.
    Forget,
    /// Shows another quantity.
    Show(Shown),
}

const KEYS: [(&str, Key); 17] = [
    ("ArrowLeft", Key::Move([-1, 0])),
    ("ArrowRight", Key::Move([1, 0])),
    ("ArrowUp", Key::Move([0, 1])),
    ("ArrowDown", Key::Move([0, -1])),
    ("PageUp", Key::Turn(5)),
    ("PageDown", Key::Turn(-5)),
    ("BracketRight", Key::Turn(1)),
    ("BracketLeft", Key::Turn(-1)),
    ("Equal", Key::Zoom(1)),
    ("NumpadAdd", Key::Zoom(1)),
    ("Minus", Key::Zoom(-1)),
    ("NumpadSubtract", Key::Zoom(-1)),
    ("Enter", Key::Play),
    ("Escape", Key::Forget),
    ("Digit1", Key::Show(Shown::Value)),
    ("Digit2", Key::Show(Shown::Error)),
    ("Digit3", Key::Show(Shown::Tube)),
];

impl Key {
    /// The action of the key with this code, if any.
    pub(super) fn of(code: &str) -> Option<Self> {
        KEYS.iter().find(|(known, _)| *known == code).map(|(_, key)| *key)
    }
}

/// The collapsible list of keys.
pub(super) fn list() -> view::Node<Msg> {
    let rows = [
        ("← → ↑ ↓", "move the cross-hair, or turn the tube"),
        ("Page up, Page down", "turn ψ by 5°"),
        ("[ ]", "turn ψ by 1°"),
        ("+ −", "a larger or smaller tube"),
        ("Enter", "play optimally from the cross-hair"),
        ("Escape", "forget the game"),
        ("1, 2, 3", "V, error, tube"),
    ];
    let row = |(keys, what): (&str, &str)| {
        el("div").child(el("dt").text(keys)).child(el("dd").text(what))
    };
    el("details")
        .class("keys")
        .child(el("summary").text("Keys"))
        .child(el("dl").class("facts").children(rows.into_iter().map(row)))
}
