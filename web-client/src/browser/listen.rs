//! Listeners on the document, removed when dropped.

use super::canvas::SizeWatcher;
use super::{Pump, address, fields};
use crate::runtime::{Event, Page};
use crate::view::{Handler, Use};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::spawn_local;
use web_sys::{Element, EventTarget, KeyboardEvent, MouseEvent, Node};

/// A callback on a target for as long as this value lives.
pub(super) struct Listener {
    target: EventTarget,
    name: &'static str,
    callback: Closure<dyn FnMut(web_sys::Event)>,
}

impl Listener {
    fn new(
        target: &EventTarget,
        name: &'static str,
        callback: impl FnMut(web_sys::Event) + 'static,
    ) -> Option<Self> {
        let callback = Closure::<dyn FnMut(web_sys::Event)>::new(callback);
        let function = callback.as_ref().unchecked_ref();
        target.add_event_listener_with_callback(name, function).ok()?;
        Some(Self { target: target.clone(), name, callback })
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let function = self.callback.as_ref().unchecked_ref();
        // A target that is gone has no listeners.
        let _ = self.target.remove_event_listener_with_callback(self.name, function);
    }
}

impl<P: Page + 'static> Pump<P> {
    /// Listens to everything that a page can be told of.
    pub(super) fn listen(&self) {
        let (window, document, root) = {
            let shell = self.shell.borrow();
            (shell.window.clone(), shell.document.clone(), shell.root.clone())
        };
        let key = |down: bool| {
            let pump = self.clone();
            move |event: web_sys::Event| {
                if let Some(event) = event.dyn_ref::<KeyboardEvent>() {
                    pump.key(event, down);
                }
            }
        };
        let focus_lost = || {
            let pump = self.clone();
            move |event: web_sys::Event| pump.tell(&Event::FocusLost, event.time_stamp())
        };
        let hidden = {
            let (pump, document) = (self.clone(), document.clone());
            move |event: web_sys::Event| {
                if document.hidden() {
                    pump.tell(&Event::FocusLost, event.time_stamp());
                }
            }
        };
        let repaint = || {
            let pump = self.clone();
            move |_: web_sys::Event| {
                let mut shell = pump.shell.borrow_mut();
                shell.painter.forget_style();
                shell.paint();
            }
        };
        let online = {
            let pump = self.clone();
            move |event: web_sys::Event| pump.tell(&Event::Online, event.time_stamp())
        };
        let address = || {
            let pump = self.clone();
            move |event: web_sys::Event| {
                let address = address::current(&pump.shell.borrow().window);
                pump.tell(&Event::Address(address), event.time_stamp());
            }
        };
        let used = |used: Use| {
            let pump = self.clone();
            move |event: web_sys::Event| pump.used(&event, used)
        };
        let dark = window.match_media("(prefers-color-scheme: dark)").ok().flatten();
        let listeners = [
            Listener::new(&window, "keydown", key(true)),
            Listener::new(&window, "keyup", key(false)),
            Listener::new(&window, "blur", focus_lost()),
            Listener::new(&document, "visibilitychange", hidden),
            Listener::new(&window, "resize", repaint()),
            Listener::new(&window, "online", online),
            P::NAVIGATES.then(|| Listener::new(&window, "popstate", address())).flatten(),
            P::NAVIGATES.then(|| Listener::new(&window, "hashchange", address())).flatten(),
            Listener::new(&root, "click", used(Use::Press)),
            Listener::new(&root, "input", used(Use::Input)),
            Listener::new(&root, "submit", used(Use::Submit)),
            dark.and_then(|query| Listener::new(&query, "change", repaint())),
        ];
        let pump = self.clone();
        let on_resize = SizeWatcher::new(move || pump.shell.borrow_mut().paint());
        let mut shell = self.shell.borrow_mut();
        shell.listeners = listeners.into_iter().flatten().collect();
        shell.on_resize = on_resize;
    }

    fn key(&self, event: &KeyboardEvent, down: bool) {
        if event.ctrl_key() || event.alt_key() || event.meta_key() {
            return;
        }
        let key = event.key();
        if self.shell.borrow().page.owns_key(&key) {
            event.prevent_default();
        }
        if !event.repeat() {
            self.tell(&Event::Key { key, down }, event.time_stamp());
        }
    }

    /// Finds the message of the control that was used.
    fn used(&self, event: &web_sys::Event, used: Use) {
        let target = event.target().and_then(|target| target.dyn_into::<Node>().ok());
        let Some(target) = target else { return };
        let t_ms = event.time_stamp();
        let found = {
            let shell = self.shell.borrow();
            let found = shell.dom.handler(&target, used);
            found.map(|(handler, element)| (handler.clone(), element))
        };
        let pump = self.clone();
        match found {
            None if P::NAVIGATES && used == Use::Press => self.link(event, &target),
            None => {}
            Some((Handler::Press(message), _)) => self.dispatch(message, t_ms),
            Some((Handler::Input(make), field)) => spawn_local(async move {
                if let Some(value) = fields::value(&field).await {
                    pump.dispatch(make(value), t_ms);
                }
            }),
            Some((Handler::Submit(make), form)) => {
                event.prevent_default();
                spawn_local(async move {
                    let form = fields::form(&form).await;
                    pump.dispatch(make(form), t_ms);
                });
            }
        }
    }

    /// Follows a link to another address of this page without loading it.
    fn link(&self, event: &web_sys::Event, target: &Node) {
        let element = target.dyn_ref::<Element>();
        let link = element.and_then(|element| element.closest("a[href]").ok().flatten());
        let (Some(link), Some(press)) = (link, event.dyn_ref::<MouseEvent>()) else { return };
        let is_plain = press.button() == 0
            && !(press.ctrl_key() || press.meta_key() || press.shift_key() || press.alt_key());
        if !is_plain || link.has_attribute("target") || link.has_attribute("download") {
            return;
        }
        let url = link.get_attribute("href").unwrap_or_default();
        if self.visit(&url, event.time_stamp()) {
            event.prevent_default();
        }
    }
}
