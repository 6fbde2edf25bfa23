//! Both sides of a solver: the page's side and the worker. The worker has its own program
//! (`bin/solver.rs`), which computes one value function and ends.
//!
//! The worker's name is its task as JSON, so the page need not send a message to a worker that is
//! still loading. The worker reports progress as numbers (0 to 1). Its last message is the bytes of
//! the value function or, if there is no solution, the reason as text. The browser stops the worker
//! when the page closes.

use crate::json;
use crate::runtime::Solving;
use crate::task::Task;
use js_sys::{Array, Uint8Array};
use sidestep::reachability::Progress;
use std::ops::ControlFlow;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{DedicatedWorkerGlobalScope, MessageEvent, Worker, WorkerOptions, WorkerType};

/// The page's side. Dropping it stops the worker.
pub(super) struct Solver {
    worker: Worker,
    _on_message: Closure<dyn FnMut(MessageEvent)>,
    _on_error: Closure<dyn FnMut(web_sys::Event)>,
}

impl Solver {
    /// Starts a worker with the program at `address`, which solves `task`.
    pub(super) fn start(
        address: &str,
        task: &Task,
        report: impl Fn(Solving) + 'static,
    ) -> Result<Self, JsValue> {
        let options = WorkerOptions::new();
        options.set_type(WorkerType::Module);
        options.set_name(&json::write(task));
        let worker = Worker::new_with_options(address, &options)?;
        let report = Rc::new(report);
        let on_message = {
            let report = Rc::clone(&report);
            Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
                let message = event.data();
                if let Some(share) = message.as_f64() {
                    report(Solving::Done(share));
                } else if let Some(bytes) = message.dyn_ref::<Uint8Array>() {
                    report(Solving::Solved(bytes.to_vec()));
                } else {
                    report(Solving::Failed(message.as_string().unwrap_or_default()));
                }
            })
        };
        let on_error = Closure::<dyn FnMut(web_sys::Event)>::new(move |event: web_sys::Event| {
            // The page reports the error, so the browser need not log it as well.
            event.prevent_default();
            let why = "The solver could not be loaded, or stopped. Check the internet connection.";
            report(Solving::Failed(why.to_owned()));
        });
        worker.set_onmessage(Some(on_message.as_ref().unchecked_ref()));
        worker.set_onerror(Some(on_error.as_ref().unchecked_ref()));
        Ok(Self { worker, _on_message: on_message, _on_error: on_error })
    }
}

impl Drop for Solver {
    fn drop(&mut self) {
        self.worker.terminate();
    }
}

/// The worker's side. Solves the task in the worker's name, and ends.
pub fn work() {
    let Ok(scope) = js_sys::global().dyn_into::<DedicatedWorkerGlobalScope>() else {
        return;
    };
    let reporter = scope.clone();
    std::panic::set_hook(Box::new(move |panic| {
        // If this message is lost, the page still gets the error event of the panic.
        let _ = reporter.post_message(&format!("The solver stopped: {panic}").into());
    }));
    let sent = match solved(&scope) {
        Ok(bytes) => {
            let bytes = Uint8Array::from(bytes.as_slice());
            let moved = Array::of1(&bytes.buffer());
            scope.post_message_with_transfer(&bytes, &moved)
        }
        Err(why) => scope.post_message(&why.into()),
    };
    if sent.is_ok() {
        scope.close();
    }
}

fn solved(scope: &DedicatedWorkerGlobalScope) -> Result<Vec<u8>, String> {
    let task: Task = json::read(scope.name().as_bytes()).ok_or("The solver received no task.")?;
    let mut percent = 0.0;
    let mut progress = |progress: Progress| {
        let now = (100.0 * progress.done).floor();
        if now > percent {
            percent = now;
            // Errors are ignored: if the page is gone, the browser ends this worker too.
            let _ = scope.post_message(&progress.done.into());
        }
        ControlFlow::Continue(())
    };
    task.solved(&mut progress).map_err(|error| error.to_string())
}
