//! Receives change events from the server while the page is visible. A hidden page closes its
//! connection, because browsers allow only a few connections for all tabs of a site.

use super::listen::Listener;
use js_sys::Function;
use std::cell::RefCell;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{Document, EventSource};

/// A connection to the server's events. Dropping it closes the connection.
pub(super) struct Follower {
    source: Rc<RefCell<Option<EventSource>>>,
    _shown: Option<Listener>,
    _on_change: Closure<dyn Fn()>,
}

impl Follower {
    /// Calls `hear` at each `change` event. The server sends the first event immediately.
    pub(super) fn start(document: &Document, url: &'static str, hear: impl Fn() + 'static) -> Self {
        let on_change = Closure::<dyn Fn()>::new(hear);
        let function: Function = on_change.as_ref().unchecked_ref::<Function>().clone();
        let source = Rc::new(RefCell::new(None));
        let (page, connection) = (document.clone(), Rc::clone(&source));
        let connect = move || {
            let mut connection = connection.borrow_mut();
            let is_closed = |open: &EventSource| open.ready_state() == EventSource::CLOSED;
            if page.hidden() {
                close(connection.take());
            } else if connection.as_ref().is_none_or(is_closed) {
                *connection = open(url, &function);
            }
        };
        connect();
        let _shown = Listener::new(document, "visibilitychange", move |_| connect());
        Self { source, _shown, _on_change: on_change }
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        close(self.source.borrow_mut().take());
    }
}

fn open(url: &str, function: &Function) -> Option<EventSource> {
    let source = EventSource::new(url).ok()?;
    source.add_event_listener_with_callback("change", function).ok()?;
    Some(source)
}

fn close(source: Option<EventSource>) {
    if let Some(source) = source {
        source.close();
    }
}
