//! Exclusive use by one of several tabs: the latest one.
//!
//! A tab that takes over broadcasts its start time. A tab that receives a later time gives up its
//! claim; one that receives an earlier time replies, so that exactly one tab is left whatever the
//! order of messages. Unlike the browser's locks, a broadcast channel also works on pages loaded
//! without encryption.

use js_sys::Date;
use wasm_bindgen::prelude::*;
use web_sys::{BroadcastChannel, MessageEvent};

/// An exclusive claim of this tab; dropping it ends it.
pub(super) struct Claim {
    name: String,
    channel: BroadcastChannel,
    _on_message: Closure<dyn FnMut(MessageEvent)>,
}

impl Claim {
    /// Claims a name. `lost` is called when another tab claims it later.
    pub(super) fn new(name: &str, lost: impl Fn() + 'static) -> Option<Self> {
        let channel = BroadcastChannel::new(&format!("sidestep.{name}")).ok()?;
        // Two claims in the same millisecond differ in the fraction.
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
