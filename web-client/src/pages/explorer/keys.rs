//! What the keys do in the explorer.

use super::Msg;

/// The message that the key with this code triggers, if any.
pub(super) fn key(code: &str) -> Option<Msg> {
    Some(match code {
        "ArrowLeft" => Msg::Step(-1),
        "ArrowRight" => Msg::Step(1),
        "PageUp" => Msg::Step(-5),
        "PageDown" => Msg::Step(5),
        "KeyP" => Msg::Next(-1),
        "KeyN" => Msg::Next(1),
        "KeyC" => Msg::Colours,
        _ => return None,
    })
}
