//! Event listeners on the document. Dropping a listener removes it from the document.

use super::canvas::SizeWatcher;
use super::surroundings::window_size;
use super::{Pump, address, background, fields, files};
use crate::form::{Does, FieldValue, Pointing};
use crate::runtime::{Event, Page};
use crate::view::{Handler, POINTS};
use wasm_bindgen::prelude::*;
use web_sys::{
    Element, EventTarget, FocusOptions, HtmlElement, KeyboardEvent, MediaQueryList, MouseEvent,
    Node, PointerEvent, WheelEvent,
};

/// An event listener. Dropping it removes the listener from its target.
pub(super) struct Listener {
    target: EventTarget,
    name: &'static str,
    callback: Closure<dyn FnMut(web_sys::Event)>,
}

impl Listener {
    /// Calls `hear` on each event of this name at `target`.
    pub(super) fn new(
        target: &EventTarget,
        name: &'static str,
        hear: impl FnMut(web_sys::Event) + 'static,
    ) -> Option<Self> {
        let callback = Closure::<dyn FnMut(web_sys::Event)>::new(hear);
        let function = callback.as_ref().unchecked_ref();
        target.add_event_listener_with_callback(name, function).ok()?;
        Some(Self { target: target.clone(), name, callback })
    }

    /// Makes the browser ask users for confirmation before they leave.
    pub(super) fn guard(target: &EventTarget) -> Option<Self> {
        Self::new(target, "beforeunload", |event| {
            event.prevent_default();
            // Older browsers need a return value as well.
            let _ = js_sys::Reflect::set(&event, &"returnValue".into(), &"unsaved".into());
        })
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let function = self.callback.as_ref().unchecked_ref();
        // This fails only if the target no longer exists, and then there is nothing to remove.
        let _ = self.target.remove_event_listener_with_callback(self.name, function);
    }
}

impl<P: Page + 'static> Pump<P> {
    /// Listens to all events that a page can receive.
    pub(super) fn listen(&self) {
        let (window, document, root) = {
            let shell = self.shell.borrow();
            (shell.window.clone(), shell.document.clone(), shell.root.clone())
        };
        self.on(&window, "keydown", |pump, event| pump.key(event, true));
        self.on(&window, "keyup", |pump, event| pump.key(event, false));
        self.on(&window, "blur", |pump, event| {
            let hidden = pump.shell.borrow().document.hidden();
            pump.tell(&Event::FocusLost { hidden }, event.time_stamp());
        });
        self.on(&window, "focus", |pump, event| {
            pump.tell(&Event::FocusGained, event.time_stamp());
        });
        self.on(&document, "visibilitychange", |pump, event| {
            let hidden = pump.shell.borrow().document.hidden();
            let change = if hidden { Event::FocusLost { hidden } } else { Event::Shown };
            pump.tell(&change, event.time_stamp());
        });
        self.on(&document, "fullscreenchange", |pump, event| {
            let fills = pump.shell.borrow().document.fullscreen_element().is_some();
            pump.tell(&Event::Fullscreen(fills), event.time_stamp());
        });
        self.on(&window, "online", |pump, event| pump.tell(&Event::Online, event.time_stamp()));
        self.on(&root, "click", |pump, event| {
            if !pump.used(event, |handler| matches!(handler, Handler::Press(_))) && P::navigates() {
                pump.link(event);
            }
            // A click from the keyboard has a click count of 0.
            let pressed = event.dyn_ref::<MouseEvent>().is_some_and(|press| press.detail() > 0);
            if P::has_short_cuts() && pressed {
                give_up_keys(event, "button, a, summary, [type=checkbox], [type=radio]");
            }
        });
        if P::has_short_cuts() {
            self.on(&root, "pointerdown", |pump, _| pump.shell.borrow_mut().has_pointed = true);
            self.on(&root, "change", |pump, event| {
                // A field also fires this event when an update of the view moves the focus to a new
                // field. The shell is borrowed during such an update.
                if pump.shell.try_borrow().is_ok_and(|shell| shell.has_pointed) {
                    give_up_keys(event, "select");
                }
            });
        }
        self.on(&root, "input", |pump, event| {
            pump.used(event, |handler| matches!(handler, Handler::Input(_)));
        });
        self.on(&root, "submit", |pump, event| {
            pump.used(event, |handler| matches!(handler, Handler::Submit(_)));
        });
        if P::points() {
            for name in ["pointermove", "pointerdown", "wheel"] {
                self.on(&root, name, Self::point);
            }
        }
        if P::navigates() {
            for name in ["popstate", "hashchange"] {
                self.on(&window, name, |pump, event| {
                    let address = address::current(&pump.shell.borrow().window);
                    pump.tell(&Event::Address(address), event.time_stamp());
                });
            }
        }
        // The pixel ratio changes with the zoom level, which also resizes the window.
        self.on(&window, "resize", |pump, event| {
            pump.shell.borrow_mut().repaint();
            let (width_px, height_px, ratio) = window_size(&pump.shell.borrow().window);
            pump.tell(&Event::Resized { width_px, height_px, ratio }, event.time_stamp());
        });
        if let Ok(Some(dark)) = window.match_media("(prefers-color-scheme: dark)") {
            self.shell.borrow_mut().painter.set_dark(dark.matches());
            self.on(&dark, "change", |pump, event| {
                let query =
                    event.target().and_then(|query| query.dyn_into::<MediaQueryList>().ok());
                let mut shell = pump.shell.borrow_mut();
                shell.painter.set_dark(query.is_some_and(|query| query.matches()));
                shell.repaint();
            });
        }
        let pump = self.clone();
        let on_resize = SizeWatcher::new(move || pump.shell.borrow_mut().repaint());
        self.shell.borrow_mut().on_resize = on_resize;
    }

    /// Calls `hear` on each event of this name at `target`.
    fn on(&self, target: &EventTarget, name: &'static str, hear: fn(&Self, &web_sys::Event)) {
        let pump = self.clone();
        let listener = Listener::new(target, name, move |event| hear(&pump, &event));
        self.shell.borrow_mut().listeners.extend(listener);
    }

    fn key(&self, event: &web_sys::Event, down: bool) {
        let Some(event) = event.dyn_ref::<KeyboardEvent>() else { return };
        // A key pressed with one of these modifiers is a shortcut of the browser. Releasing a key
        // always counts.
        if down && (event.ctrl_key() || event.alt_key() || event.meta_key()) {
            return;
        }
        let code = event.code();
        // With the first condition, the compiler removes this code from pages without shortcuts.
        if P::has_short_cuts() && is_needed(event, &code) {
            if down {
                self.shell.borrow_mut().has_pointed = false;
                return;
            }
        } else if self.shell.borrow().page.owns_key(&code) {
            event.prevent_default();
        }
        if event.repeat() && !P::has_short_cuts() {
            return;
        }
        let (name, stamp) = (event.key(), event.time_stamp());
        {
            let mut shell = self.shell.borrow_mut();
            shell.down.retain(|held| *held != code);
            if down {
                shell.down.push(code.clone());
            }
        }
        let is_command = name == "Meta";
        self.tell(&Event::Key { code, key: name, down }, stamp);
        if is_command && !down {
            self.release(stamp);
        }
    }

    /// Reports all keys as released. This is needed because macOS does not report keys that are
    /// released while the command key is down.
    fn release(&self, stamp: f64) {
        let codes = std::mem::take(&mut self.shell.borrow_mut().down);
        for code in codes {
            self.tell(&Event::Key { code, key: String::new(), down: false }, stamp);
        }
    }

    /// Sends the message of the innermost control that satisfies `hears`. Returns whether there is
    /// such a control.
    fn used(&self, event: &web_sys::Event, hears: fn(&Handler<P::Msg>) -> bool) -> bool {
        let target = event.target().and_then(|target| target.dyn_into::<Node>().ok());
        let found = target.and_then(|target| {
            let shell = self.shell.borrow();
            let (handler, element) = shell.dom.handler(&target, hears)?;
            Some((handler.clone(), element))
        });
        let Some((handler, element)) = found else { return false };
        let t_ms = self.shell.borrow().clock.of(event.time_stamp());
        match handler {
            Handler::Press(message) => self.dispatch(message, t_ms),
            // With the first condition, the compiler removes this code from pages without files.
            Handler::Input(make) if P::offers_files() && files::is_field(&element) => {
                let pump = self.clone();
                background(async move {
                    if let Some(text) = files::opened(&element).await {
                        pump.dispatch_now(make(FieldValue::Text(text)));
                    }
                });
            }
            Handler::Input(make) => {
                if let Some(value) = fields::value(&element) {
                    self.dispatch(make(value), t_ms);
                }
            }
            Handler::Submit(make) => {
                event.prevent_default();
                self.dispatch(make(fields::form(&element)), t_ms);
                // Focus the first incomplete field.
                let lacks = "[aria-invalid] input, textarea[aria-invalid]";
                let fields = element.query_selector_all(lacks);
                if let Some(field) = fields.ok().and_then(|fields| fields.get(0)) {
                    let field = field.unchecked_into::<HtmlElement>();
                    let _ = field.focus_with_options(&FocusOptions::new());
                }
            }
        }
        true
    }

    /// Reports a pointer action to the innermost element that listens to pointers.
    fn point(&self, event: &web_sys::Event) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let target = target.and_then(|it| it.closest(&format!("[{POINTS}]")).ok().flatten());
        let (Some(target), Some(mouse)) = (target, event.dyn_ref::<MouseEvent>()) else { return };
        let found = {
            let shell = self.shell.borrow();
            let hears = |handler: &Handler<P::Msg>| matches!(handler, Handler::Input(_));
            shell.dom.handler(&target, hears).map(|(handler, element)| (handler.clone(), element))
        };
        let Some((Handler::Input(make), element)) = found else { return };
        let does = match (event.type_().as_str(), event.dyn_ref::<WheelEvent>()) {
            (_, Some(_)) if target.get_attribute(POINTS).is_none_or(|what| what.is_empty()) => {
                return;
            }
            (_, Some(wheel)) => Does::Roll(wheel.delta_y() as f32),
            ("pointerdown", _) if mouse.button() != 0 => return,
            ("pointerdown", _) => Does::Press,
            _ if mouse.buttons() & 1 == 1 => Does::Drag,
            _ => Does::Hover,
        };
        match does {
            // Capture the pointer, so that a drag continues outside the element.
            Does::Press => {
                let pointer = event.dyn_ref::<PointerEvent>().map(PointerEvent::pointer_id);
                let _ = pointer.map(|pointer| element.set_pointer_capture(pointer));
            }
            Does::Roll(_) => event.prevent_default(),
            Does::Hover | Does::Drag => {}
        }
        let place = element.get_bounding_client_rect();
        let [x, y] = [mouse.client_x(), mouse.client_y()].map(f64::from);
        let at = [(x - place.left()) / place.width(), (y - place.top()) / place.height()];
        let at = at.map(|share| share as f32);
        let t_ms = self.shell.borrow().clock.of(event.time_stamp());
        self.dispatch(make(FieldValue::Pointing(Pointing { at, does })), t_ms);
    }

    /// Follows a link to another address of this page without loading the page again.
    fn link(&self, event: &web_sys::Event) {
        let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
        let link = target.and_then(|element| element.closest("a[href]").ok().flatten());
        let (Some(link), Some(press)) = (link, event.dyn_ref::<MouseEvent>()) else { return };
        let is_plain = press.button() == 0
            && !(press.ctrl_key() || press.meta_key() || press.shift_key() || press.alt_key());
        if !is_plain || link.has_attribute("target") || link.has_attribute("download") {
            return;
        }
        let url = link.get_attribute("href").unwrap_or_default();
        // For links to other documents, the browser itself asks before it leaves.
        let is_guarded = self.shell.borrow().guard.is_some() && url.starts_with("/lab");
        if is_guarded {
            let window = self.shell.borrow().window.clone();
            let question = "Leave this page? What you entered is not stored.";
            if !window.confirm_with_message(question).unwrap_or(true) {
                event.prevent_default();
                return;
            }
            self.shell.borrow_mut().guard = None;
        }
        let t_ms = self.shell.borrow().clock.of(event.time_stamp());
        if self.visit(&url, t_ms) {
            event.prevent_default();
        }
    }
}

/// Takes the focus from a control that was used by pointer, so that the page gets the keys again.
/// For example, a user who sets the speed with the mouse can then press Space to play. For keyboard
/// users, the control keeps the focus.
fn give_up_keys(event: &web_sys::Event, controls: &str) {
    let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
    let control = target.and_then(|target| target.closest(controls).ok().flatten());
    if let Some(control) = control.and_then(|control| control.dyn_into::<HtmlElement>().ok()) {
        let _ = control.blur();
    }
}

/// Whether the focused control needs this key itself.
fn is_needed(event: &KeyboardEvent, code: &str) -> bool {
    let target = event.target().and_then(|target| target.dyn_into::<Element>().ok());
    let Some(target) = target else { return false };
    let is = |selector| target.matches(selector).unwrap_or(false);
    is("select, textarea, input:not([type=range]), [data-own-keys]")
        || (matches!(code, "Space" | "Enter") && is("a, button, summary"))
}
