//! Who of several tabs has something alone: the later one.
//!
//! A tab that takes over says since when. One that hears of a later tab has it no longer, and one
//! that hears of an earlier tab answers, so that exactly one is left whatever the order of their
//! messages. A channel, unlike a lock of the browser, is also there where the page came without
//! encryption.

use js_sys::Date;
use wasm_bindgen::prelude::*;
use web_sys::{BroadcastChannel, MessageEvent};

/// Something that this tab has alone, until it is dropped.
pub(super) struct Claim {
    name: String,
    channel: BroadcastChannel,
    _on_message: Closure<dyn FnMut(MessageEvent)>,
}

impl Claim {
    /// Takes over; `lost` is called when another tab does so later.
    pub(super) fn new(name: &str, lost: impl Fn() + 'static) -> Option<Self> {
        let channel = BroadcastChannel::new(&format!("sidestep.{name}")).ok()?;
        // Two tabs that take over in the same millisecond differ in the fraction.
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

    /// What this tab has.
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
