//! The only part that touches the browser: it brings events to a page, applies
//! the page's commands, and shows its view and picture.

mod canvas;
mod dom;
mod listen;
mod net;
pub mod solver;

use crate::runtime::{App, Command, Event, Solving, Surroundings};
use crate::view::Node;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{Document, HtmlElement, Window};

/// Starts a page and keeps it until the tab is closed.
pub fn run(app: impl App + 'static) {
    std::panic::set_hook(Box::new(|panic| {
        web_sys::console::error_1(&format!("Sidestep stopped: {panic}").into());
        show_crash();
    }));
    let Some((window, document, root)) = place() else {
        web_sys::console::error_1(&"Sidestep found no element with the id 'app'".into());
        return;
    };
    let shell = Rc::new(RefCell::new(Shell {
        app: Box::new(app),
        window,
        document,
        root,
        shown: None,
        painter: canvas::Painter::default(),
        frame_requested: false,
        on_frame: None,
        listeners: Vec::new(),
        solvers: Vec::new(),
    }));
    let pump = Pump { shell, queue: Rc::default(), busy: Rc::default() };
    pump.listen();
    let surroundings = pump.shell.borrow().surroundings();
    pump.dispatch(Event::Opened(surroundings));
}

fn place() -> Option<(Window, Document, HtmlElement)> {
    let window = web_sys::window()?;
    let document = window.document()?;
    let root = document.get_element_by_id("app")?.dyn_into().ok()?;
    Some((window, document, root))
}

/// After a panic nothing can be trusted but the document.
fn show_crash() {
    if let Some((_, _, root)) = place() {
        root.set_text_content(Some(
            "Something went wrong. Please reload this page; nothing that was saved is lost.",
        ));
    }
}

struct Shell {
    app: Box<dyn App>,
    window: Window,
    document: Document,
    root: HtmlElement,
    shown: Option<Node>,
    painter: canvas::Painter,
    frame_requested: bool,
    on_frame: Option<Closure<dyn FnMut()>>,
    listeners: Vec<listen::Listener>,
    /// At work, or done.
    solvers: Vec<solver::Solver>,
}

impl Shell {
    /// Milliseconds on the page's clock.
    fn now_ms(&self) -> f64 {
        self.window.performance().map_or(0.0, |clock| clock.now())
    }

    fn surroundings(&self) -> Surroundings {
        let location = self.window.location();
        let screen = self.window.screen().ok();
        let number =
            |value: Result<JsValue, JsValue>| value.ok().and_then(|v| v.as_f64()).unwrap_or(0.0);
        Surroundings {
            path: location.pathname().unwrap_or_default(),
            query: net::decode_query(&location.search().unwrap_or_default()),
            fragment: location.hash().unwrap_or_default().trim_start_matches('#').to_owned(),
            kept: self.kept().unwrap_or_default(),
            locale: self.window.navigator().language().unwrap_or_default(),
            screen: vec![
                (
                    "screen_width_px",
                    screen.as_ref().and_then(|s| s.width().ok()).unwrap_or(0).into(),
                ),
                (
                    "screen_height_px",
                    screen.as_ref().and_then(|s| s.height().ok()).unwrap_or(0).into(),
                ),
                ("window_width_px", number(self.window.inner_width())),
                ("window_height_px", number(self.window.inner_height())),
                ("device_pixel_ratio", self.window.device_pixel_ratio()),
            ],
            time_origin_ms: self.window.performance().map_or(0.0, |clock| clock.time_origin()),
        }
    }

    fn kept(&self) -> Option<Vec<(String, String)>> {
        let storage = self.window.local_storage().ok()??;
        let names = (0..storage.length().ok()?).filter_map(|i| storage.key(i).ok()?);
        let ours = names.filter(|name| name.starts_with("sidestep."));
        Some(ours.filter_map(|name| Some((name.clone(), storage.get_item(&name).ok()??))).collect())
    }

    /// Brings the document and the canvas up to date.
    fn show(&mut self) {
        let view = self.app.view();
        if self.shown.as_ref() != Some(&view) {
            dom::patch_root(&self.document, &self.root, self.shown.as_ref(), &view);
            self.shown = Some(view);
        }
        if let Some(picture) = self.app.picture() {
            self.painter.paint(&self.window, &self.document, &picture);
        }
    }

    fn keep(&self, name: &str, text: &str) {
        let storage = self.window.local_storage().ok().flatten();
        let kept = storage.and_then(|storage| storage.set_item(name, text).ok());
        if kept.is_none() {
            // Private windows may refuse; the trial is still in memory and on its way.
            web_sys::console::warn_1(
                &"this browser keeps nothing: do not close the page before all is saved".into(),
            );
        }
    }
}

/// Takes events one at a time, in the order in which they came.
#[derive(Clone)]
pub(crate) struct Pump {
    shell: Rc<RefCell<Shell>>,
    queue: Rc<RefCell<VecDeque<Event>>>,
    busy: Rc<RefCell<bool>>,
}

impl Pump {
    /// Handles an event now, or right after the one that is being handled.
    pub(crate) fn dispatch(&self, event: Event) {
        self.queue.borrow_mut().push_back(event);
        if self.busy.replace(true) {
            return;
        }
        loop {
            let event = self.queue.borrow_mut().pop_front();
            let Some(event) = event else { break };
            let commands = self.shell.borrow_mut().app.handle(event);
            for command in commands {
                self.apply(command);
            }
        }
        self.shell.borrow_mut().show();
        self.busy.replace(false);
        self.request_frame();
    }

    fn apply(&self, command: Command) {
        let mut shell = self.shell.borrow_mut();
        match command {
            Command::Send(request) => {
                let pump = self.clone();
                wasm_bindgen_futures::spawn_local(async move {
                    let tag = request.tag.clone();
                    let answer = net::send(request).await;
                    pump.dispatch(Event::Answered(tag, answer));
                });
            }
            Command::Solve { evader, game } => {
                let pump = self.clone();
                let report = move |solving| pump.dispatch(Event::Solving(evader, solving));
                let address = shell.root.get_attribute("data-solver").unwrap_or_default();
                match solver::Solver::start(&address, &game, report) {
                    Ok(solver) => shell.solvers.push(solver),
                    Err(_) => {
                        let why = "This browser cannot start the solver.".to_owned();
                        self.queue
                            .borrow_mut()
                            .push_back(Event::Solving(evader, Solving::Failed(why)));
                    }
                }
            }
            Command::StopSolving => shell.solvers.clear(),
            Command::Keep(name, text) => shell.keep(&name, &text),
            Command::Forget(name) => {
                if let Ok(Some(storage)) = shell.window.local_storage() {
                    // What is not there cannot fail to be removed.
                    let _ = storage.remove_item(&name);
                }
            }
            Command::WakeAfter(ms) => {
                let pump = self.clone();
                let wake = Closure::once_into_js(move || pump.dispatch(Event::Woken));
                let _ = shell.window.set_timeout_with_callback_and_timeout_and_arguments_0(
                    wake.unchecked_ref(),
                    ms as i32,
                );
            }
            Command::ReplaceAddress(url) => {
                if let Ok(history) = shell.window.history() {
                    let _ = history.replace_state_with_url(&JsValue::NULL, "", Some(&url));
                }
            }
            Command::GoTo(url) => {
                let _ = shell.window.location().assign(&url);
            }
        }
    }

    /// Asks for a frame if the page wants one.
    fn request_frame(&self) {
        let mut shell = self.shell.borrow_mut();
        if shell.frame_requested || !shell.app.wants_frames() {
            return;
        }
        if shell.on_frame.is_none() {
            let pump = self.clone();
            shell.on_frame = Some(Closure::new(move || pump.frame()));
        }
        if let Some(on_frame) = &shell.on_frame {
            let callback = on_frame.as_ref().unchecked_ref();
            shell.frame_requested = shell.window.request_animation_frame(callback).is_ok();
        }
    }

    fn frame(&self) {
        let begun = {
            let mut shell = self.shell.borrow_mut();
            shell.frame_requested = false;
            shell.now_ms()
        };
        self.dispatch(Event::Frame(begun));
        let mut shell = self.shell.borrow_mut();
        let took = shell.now_ms() - begun;
        shell.app.frame_took(took);
    }
}
