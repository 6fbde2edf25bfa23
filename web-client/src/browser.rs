//! The only part that touches the browser: it brings messages to a page, applies
//! the page's commands, and shows its view and picture.

mod address;
mod canvas;
mod dom;
mod fields;
mod listen;
mod net;
pub mod solver;
mod storage;

use self::dom::Dom;
use crate::runtime::{Command, Commands, Event, Page, PageContext, Solving};
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{Document, HtmlElement, Window};

/// Opens a page and keeps it until the tab is closed.
pub fn run<P: Page + 'static>(open: fn(PageContext) -> (P, Commands<P::Msg>)) {
    std::panic::set_hook(Box::new(|panic| {
        web_sys::console::error_1(&format!("Sidestep stopped: {panic}").into());
        show_crash();
    }));
    let Some((window, document, root)) = place() else {
        web_sys::console::error_1(&"Sidestep found no element with the id 'app'".into());
        return;
    };
    let (page, commands) = open(context(&window));
    let shell = Shell {
        page,
        dom: Dom::new(&document, &root),
        window,
        document,
        root,
        painter: canvas::Painter::default(),
        title: String::new(),
        frame_requested: false,
        on_frame: None,
        on_resize: None,
        listeners: Vec::new(),
        underway: Vec::new(),
        started: 0,
    };
    let pump =
        Pump { shell: Rc::new(RefCell::new(shell)), queue: Rc::default(), busy: Rc::default() };
    pump.listen();
    pump.busy.set(true);
    pump.apply(commands);
    pump.work();
}

fn place() -> Option<(Window, Document, HtmlElement)> {
    let window = web_sys::window()?;
    let document = window.document()?;
    let root = document.get_element_by_id("app")?.dyn_into().ok()?;
    Some((window, document, root))
}

/// After a panic only the document can be trusted.
fn show_crash() {
    if let Some((_, _, root)) = place() {
        root.set_text_content(Some(
            "Something went wrong. Please reload this page; nothing that was saved is lost.",
        ));
    }
}

/// What a page is told when it opens.
fn context(window: &Window) -> PageContext {
    let screen = window.screen().ok();
    let number =
        |value: Result<JsValue, JsValue>| value.ok().and_then(|v| v.as_f64()).unwrap_or(0.0);
    let width = screen.as_ref().and_then(|screen| screen.width().ok()).unwrap_or(0);
    let height = screen.as_ref().and_then(|screen| screen.height().ok()).unwrap_or(0);
    PageContext {
        address: address::current(window),
        kept: storage::all(window).unwrap_or_default(),
        locale: window.navigator().language().unwrap_or_default(),
        screen: vec![
            ("screen_width_px", width.into()),
            ("screen_height_px", height.into()),
            ("window_width_px", number(window.inner_width())),
            ("window_height_px", number(window.inner_height())),
            ("device_pixel_ratio", window.device_pixel_ratio()),
        ],
        time_origin_ms: window.performance().map_or(0.0, |clock| clock.time_origin()),
        random_name: random_name(window),
    }
}

/// 32 random hexadecimal digits.
fn random_name(window: &Window) -> Option<String> {
    let mut bytes = [0; 16];
    window.crypto().ok()?.get_random_values_with_u8_array(&mut bytes).ok()?;
    Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

struct Shell<P: Page> {
    page: P,
    window: Window,
    document: Document,
    root: HtmlElement,
    dom: Dom<P::Msg>,
    painter: canvas::Painter,
    /// The document's title.
    title: String,
    frame_requested: bool,
    on_frame: Option<Closure<dyn FnMut()>>,
    on_resize: Option<canvas::SizeWatcher>,
    listeners: Vec<listen::Listener>,
    underway: Vec<Underway>,
    /// How many requests, timers and solves were started.
    started: u32,
}

/// A request, timer or solve.
struct Underway {
    name: &'static str,
    /// Distinguishes it from others of that name: work that was cancelled may still report.
    number: u32,
    /// Cancels it when dropped.
    _work: Box<dyn Any>,
}

impl<P: Page> Shell<P> {
    /// Milliseconds on the page's clock.
    fn now_ms(&self) -> f64 {
        self.window.performance().map_or(0.0, |clock| clock.now())
    }

    /// Brings the document and the canvas up to date.
    fn show(&mut self) {
        self.dom.show(self.page.view());
        let title = self.page.title();
        if self.title != title {
            self.document.set_title(&title);
            self.title = title;
        }
        self.paint();
    }

    fn paint(&mut self) {
        if let Some(picture) = self.page.picture() {
            let canvas = self.painter.paint(&self.window, &self.document, &picture);
            if let (Some(canvas), Some(watcher)) = (canvas, &mut self.on_resize) {
                watcher.watch(&canvas);
            }
        }
    }

    /// Cancels the work of this name; returns the number of its successor.
    fn begin(&mut self, name: &'static str) -> u32 {
        self.underway.retain(|underway| underway.name != name);
        self.started += 1;
        self.started
    }

    fn holds(&self, number: u32) -> bool {
        self.underway.iter().any(|underway| underway.number == number)
    }

    fn end(&mut self, number: u32) {
        self.underway.retain(|underway| underway.number != number);
    }
}

/// Messages with when their causes happened, on the page's clock.
type Queue<M> = RefCell<VecDeque<(M, f64)>>;

/// Takes messages one at a time, in the order in which they came.
struct Pump<P: Page> {
    shell: Rc<RefCell<Shell<P>>>,
    queue: Rc<Queue<P::Msg>>,
    busy: Rc<Cell<bool>>,
}

impl<P: Page> Clone for Pump<P> {
    fn clone(&self) -> Self {
        Self {
            shell: Rc::clone(&self.shell),
            queue: Rc::clone(&self.queue),
            busy: Rc::clone(&self.busy),
        }
    }
}

impl<P: Page + 'static> Pump<P> {
    /// Gives the page a message now, or after those that are waiting.
    fn dispatch(&self, message: P::Msg, t_ms: f64) {
        self.queue.borrow_mut().push_back((message, t_ms));
        if !self.busy.replace(true) {
            self.work();
        }
    }

    /// Gives the page a message whose cause happens now.
    fn dispatch_now(&self, message: P::Msg) {
        let now_ms = self.shell.borrow().now_ms();
        self.dispatch(message, now_ms);
    }

    /// Tells the page of an event, if it wants to know.
    fn tell(&self, event: &Event, t_ms: f64) {
        let message = self.shell.borrow().page.hear(event);
        if let Some(message) = message {
            self.dispatch(message, t_ms);
        }
    }

    /// Works through the queue, then shows the result.
    fn work(&self) {
        loop {
            let next = self.queue.borrow_mut().pop_front();
            let Some((message, t_ms)) = next else { break };
            let commands = self.shell.borrow_mut().page.update(message, t_ms);
            self.apply(commands);
        }
        self.shell.borrow_mut().show();
        self.busy.set(false);
        self.request_frame();
    }

    fn apply(&self, commands: Commands<P::Msg>) {
        for command in commands {
            self.apply_one(command);
        }
    }

    fn apply_one(&self, command: Command<P::Msg>) {
        let mut shell = self.shell.borrow_mut();
        match command {
            Command::Send(request) => {
                let name = request.name;
                let number = shell.begin(name);
                let (sent, answer, then) = net::send(&shell.window, request);
                shell.underway.push(Underway { name, number, _work: Box::new(sent) });
                let pump = self.clone();
                wasm_bindgen_futures::spawn_local(async move {
                    let answer = answer.await;
                    pump.finish(number, || then(answer));
                });
            }
            Command::Wake { timer, after_ms, message } => {
                let number = shell.begin(timer);
                shell.underway.push(Underway { name: timer, number, _work: Box::new(()) });
                let pump = self.clone();
                let wake = Closure::once_into_js(move || pump.finish(number, || message));
                let _ = shell.window.set_timeout_with_callback_and_timeout_and_arguments_0(
                    wake.unchecked_ref(),
                    after_ms as i32,
                );
            }
            // The compiler leaves this out of the program of a page that does not solve.
            Command::Solve { .. } if !P::solves() => {}
            Command::Solve { name, game, then } => {
                let number = shell.begin(name);
                let address = shell.root.get_attribute("data-solver").unwrap_or_default();
                let (pump, report) = (self.clone(), Rc::clone(&then));
                let report = move |solving| {
                    let is_over = !matches!(solving, Solving::Done(_));
                    if is_over {
                        pump.finish(number, || report(solving));
                    } else if pump.shell.borrow().holds(number) {
                        pump.dispatch_now(report(solving));
                    }
                };
                match solver::Solver::start(&address, &game, report) {
                    Ok(solver) => {
                        let _work = Box::new(solver);
                        shell.underway.push(Underway { name, number, _work });
                    }
                    Err(_) => {
                        let why = "This browser cannot start the solver.".to_owned();
                        let message = then(Solving::Failed(why));
                        self.queue.borrow_mut().push_back((message, shell.now_ms()));
                    }
                }
            }
            Command::Cancel(name) => shell.underway.retain(|underway| underway.name != name),
            Command::CancelAll => shell.underway.clear(),
            Command::Keep { name, text, then } => {
                let message = then(storage::keep(&shell.window, &name, &text));
                self.queue.borrow_mut().push_back((message, shell.now_ms()));
            }
            Command::Forget(name) => storage::forget(&shell.window, &name),
            Command::ReplaceAddress(url) => address::replace(&shell.window, &url),
            Command::Visit(url) => {
                let now_ms = shell.now_ms();
                drop(shell);
                self.visit(&url, now_ms);
            }
            Command::Leave(url) => {
                let _ = shell.window.location().assign(&url);
            }
        }
    }

    /// Ends a request, timer or solve with a message, unless it was cancelled.
    fn finish(&self, number: u32, message: impl FnOnce() -> P::Msg) {
        {
            let mut shell = self.shell.borrow_mut();
            if !shell.holds(number) {
                return;
            }
            shell.end(number);
        }
        self.dispatch_now(message());
    }

    /// Goes to an address of this page without loading it; whether the page shows it.
    fn visit(&self, url: &str, t_ms: f64) -> bool {
        if !P::navigates() {
            return false;
        }
        let (window, message) = {
            let shell = self.shell.borrow();
            let message = address::of_url(&shell.window, url)
                .and_then(|address| shell.page.hear(&Event::Address(address)));
            (shell.window.clone(), message)
        };
        let Some(message) = message else { return false };
        address::push(&window, url);
        window.scroll_to_with_x_and_y(0.0, 0.0);
        self.dispatch(message, t_ms);
        true
    }

    /// Asks for a frame if the page wants one.
    fn request_frame(&self) {
        let mut shell = self.shell.borrow_mut();
        if shell.frame_requested || !shell.page.wants_frames() {
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
        self.tell(&Event::Frame, begun);
        let mut shell = self.shell.borrow_mut();
        let took = shell.now_ms() - begun;
        shell.page.frame_took(took);
    }
}
