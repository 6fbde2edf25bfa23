//! Both sides of an evaluator: the page's side and the worker. The worker has its own program
//! (`bin/evaluator.rs`) and answers one question after another until the page stops it.
//!
//! The page sends the index of a [`Part`] in [`Part::ALL`] together with its content as bytes. The
//! worker reports in JSON. The worker's first message is empty and means that it is ready. Between
//! two pieces of work, the worker lets the browser deliver new messages from the page, so that a
//! new question never waits until an older one is answered.

use crate::evaluation::{Evaluation, Part};
use crate::runtime::{Answer, Failure};
use js_sys::{Array, Date, Uint8Array};
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{
    DedicatedWorkerGlobalScope, MessageChannel, MessageEvent, Worker, WorkerOptions, WorkerType,
};

/// The page's side. Dropping it stops the worker.
pub(super) struct Evaluator {
    worker: Worker,
    /// Messages that are queued until the worker is ready. `None` once it is ready.
    waiting: Rc<RefCell<Option<Vec<JsValue>>>>,
    _on_message: Closure<dyn FnMut(MessageEvent)>,
    _on_error: Closure<dyn FnMut(web_sys::Event)>,
}

impl Evaluator {
    /// Starts a worker with the program at `address`.
    pub(super) fn start(address: &str, report: impl Fn(Answer) + 'static) -> Result<Self, JsValue> {
        let options = WorkerOptions::new();
        options.set_type(WorkerType::Module);
        let worker = Worker::new_with_options(address, &options)?;
        let waiting = Rc::new(RefCell::new(Some(Vec::new())));
        let report = Rc::new(report);
        let on_message = {
            let (worker, waiting) = (worker.clone(), Rc::clone(&waiting));
            let report = Rc::clone(&report);
            Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
                let Some(text) = event.data().as_string() else {
                    for message in waiting.take().unwrap_or_default() {
                        let _ = worker.post_message(&message);
                    }
                    return;
                };
                report(Ok(text.into_bytes()));
            })
        };
        let on_error = Closure::<dyn FnMut(web_sys::Event)>::new(move |event: web_sys::Event| {
            // The page reports the error, so the browser need not log it as well.
            event.prevent_default();
            let sentence =
                "The evaluator could not be loaded, or stopped. Reload the page.".to_owned();
            report(Err(Failure { sentence, ..Failure::unreachable() }));
        });
        worker.set_onmessage(Some(on_message.as_ref().unchecked_ref()));
        worker.set_onerror(Some(on_error.as_ref().unchecked_ref()));
        Ok(Self { worker, waiting, _on_message: on_message, _on_error: on_error })
    }

    /// Sends a message to the worker.
    pub(super) fn tell(&self, part: Part, content: &[u8]) {
        let message = Array::of2(&(part as u8).into(), &Uint8Array::from(content)).into();
        match &mut *self.waiting.borrow_mut() {
            Some(waiting) => waiting.push(message),
            None => {
                let _ = self.worker.post_message(&message);
            }
        }
    }
}

impl Drop for Evaluator {
    fn drop(&mut self) {
        self.worker.terminate();
    }
}

/// Approximate duration of a piece of work (ms). The page gets an estimate after each piece, and a
/// new question waits at most this long.
const PIECE_MS: f64 = 16.0;

/// The worker's side.
pub fn work() {
    let Ok(scope) = js_sys::global().dyn_into::<DedicatedWorkerGlobalScope>() else {
        return;
    };
    // To continue its work, the worker sends a message to itself. The browser delivers that message
    // after all messages that the page has already sent.
    let Ok(channel) = MessageChannel::new() else { return };
    let evaluation = Rc::new(RefCell::new(Evaluation::default()));
    // Send only one such message at a time, because several would delay the page's messages.
    let is_coming = Rc::new(Cell::new(false));
    let come_back = {
        let (is_coming, next) = (Rc::clone(&is_coming), channel.port2());
        move || {
            if !is_coming.replace(true) {
                let _ = next.post_message(&JsValue::NULL);
            }
        }
    };
    let go_on = {
        let (scope, evaluation) = (scope.clone(), Rc::clone(&evaluation));
        let come_back = come_back.clone();
        move || {
            is_coming.set(false);
            let mut evaluation = evaluation.borrow_mut();
            let begun_ms = Date::now();
            // Errors are ignored: if the page is gone, the browser ends this worker too.
            let mut tell = |report: String| drop(scope.post_message(&report.into()));
            let mut is_more = evaluation.work(&mut tell);
            while is_more && Date::now() - begun_ms < PIECE_MS {
                is_more = evaluation.work(&mut tell);
            }
            if let Some(report) = evaluation.report() {
                tell(report);
            }
            if is_more {
                come_back();
            }
        }
    };
    let on_piece = Closure::<dyn FnMut(MessageEvent)>::new(move |_| go_on());
    channel.port1().set_onmessage(Some(on_piece.as_ref().unchecked_ref()));
    let on_message = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
        let said = Array::from(&event.data());
        let part = said.get(0).as_f64().and_then(|place| Part::ALL.get(place as usize));
        let content = Uint8Array::new(&said.get(1)).to_vec();
        if let Some(&part) = part {
            evaluation.borrow_mut().hear(part, &content);
            come_back();
        }
    });
    scope.set_onmessage(Some(on_message.as_ref().unchecked_ref()));
    // Both closures must live as long as the worker.
    on_piece.forget();
    on_message.forget();
    let _ = scope.post_message(&JsValue::NULL);
}
