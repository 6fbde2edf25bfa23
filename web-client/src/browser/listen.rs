//! Listeners on the document, removed when dropped.

use super::Pump;
use crate::runtime::Event;
use wasm_bindgen::prelude::*;
use web_sys::{Element, EventTarget, HtmlInputElement, KeyboardEvent};

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

impl Pump {
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
        let blur = || {
            let pump = self.clone();
            move |event: web_sys::Event| pump.dispatch(Event::Blur(event.time_stamp()))
        };
        let hidden = {
            let (pump, document) = (self.clone(), document.clone());
            move |event: web_sys::Event| {
                if document.hidden() {
                    pump.dispatch(Event::Blur(event.time_stamp()));
                }
            }
        };
        let redraw = || {
            let pump = self.clone();
            move |_: web_sys::Event| {
                pump.shell.borrow_mut().painter.forget_style();
                pump.shell.borrow_mut().show();
            }
        };
        let action = |name: &'static str| {
            let pump = self.clone();
            move |event: web_sys::Event| pump.action(&event, name)
        };
        let online = {
            let pump = self.clone();
            move |_: web_sys::Event| pump.dispatch(Event::Woken)
        };
        let dark = window.match_media("(prefers-color-scheme: dark)").ok().flatten();
        let listeners = [
            Listener::new(&window, "keydown", key(true)),
            Listener::new(&window, "keyup", key(false)),
            Listener::new(&window, "blur", blur()),
            Listener::new(&document, "visibilitychange", hidden),
            Listener::new(&window, "resize", redraw()),
            Listener::new(&window, "online", online),
            Listener::new(&root, "click", action("click")),
            Listener::new(&root, "input", action("input")),
            Listener::new(&root, "submit", action("submit")),
            dark.and_then(|query| Listener::new(&query, "change", redraw())),
        ];
        self.shell.borrow_mut().listeners = listeners.into_iter().flatten().collect();
    }

    fn key(&self, event: &KeyboardEvent, down: bool) {
        if event.ctrl_key() || event.alt_key() || event.meta_key() {
            return;
        }
        let key = event.key();
        if self.shell.borrow().app.owns_key(&key) {
            event.prevent_default();
        }
        if !event.repeat() {
            self.dispatch(Event::Key { t_ms: event.time_stamp(), key, down });
        }
    }

    /// Reports a press, a change or a submission under the word of the element.
    fn action(&self, event: &web_sys::Event, name: &str) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let Some(element) = target.and_then(|e| e.closest("[data-action]").ok().flatten()) else {
            return;
        };
        let expected = match element.tag_name().as_str() {
            "FORM" => "submit",
            "INPUT" => "input",
            _ => "click",
        };
        if expected != name {
            return;
        }
        if name == "submit" {
            event.prevent_default();
        }
        let field = match element.tag_name().as_str() {
            "FORM" => element.query_selector("input").ok().flatten(),
            _ => Some(element.clone()),
        };
        let value =
            field.and_then(|e| e.dyn_into::<HtmlInputElement>().ok()).map(|input| input.value());
        let word = element.get_attribute("data-action").unwrap_or_default();
        let t_ms = event.time_stamp();
        self.dispatch(Event::Action { word, value: value.unwrap_or_default(), t_ms });
    }
}
