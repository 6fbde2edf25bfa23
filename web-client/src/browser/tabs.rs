//! Exclusive use of a name by the tab that claimed it last.
//!
//! A tab broadcasts the time of its claim. A tab that receives a later time gives up its own claim.
//! A tab that receives an earlier time replies with its own time. So exactly one tab keeps its
//! claim, in whatever order the messages arrive. Unlike the browser's locks, a broadcast channel
//! also works on pages loaded without encryption.

use js_sys::Date;
use wasm_bindgen::prelude::*;
use web_sys::{BroadcastChannel, MessageEvent};

/// An exclusive claim of this tab. Dropping it ends the claim.
pub(super) struct Claim {
    name: String,
    channel: BroadcastChannel,
    _on_message: Closure<dyn FnMut(MessageEvent)>,
}

impl Claim {
    /// Claims a name. Calls `lost` when another tab has claimed the name later.
    pub(super) fn new(name: &str, lost: impl Fn() + 'static) -> Option<Self> {
        let channel = BroadcastChannel::new(&format!("sidestep.{name}")).ok()?;
        // The random fraction distinguishes two claims in the same millisecond.
        let since = Date::now() + js_sys::Math::random();
        let answer = channel.clone();
        let on_message = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
            match event.data().as_f64() {
                Some(other) if other < since => drop(answer.post_message(&since.into())),
                _ => lost(),
            }
        });
        channel.set_onmessage(Some(on_message.as_ref().unchecked_ref()));
        channel.post_message(&since.into()).ok()?;
        Some(Self { name: name.to_owned(), channel, _on_message: on_message })
    }

    /// The claimed name.
    pub(super) fn name(&self) -> &str {
        &self.name
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.channel.set_onmessage(None);
        self.channel.close();
    }
}
