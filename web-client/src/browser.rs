//! The only module that uses the browser's API. It delivers messages to a page, executes the page's
//! commands, and shows its view and its picture.

mod address;
mod surroundings;
mod canvas;
mod clock;
mod dom;
mod fields;
mod files;
mod film;
mod listen;
mod solid;
mod follow;
mod net;
pub mod evaluator;
pub mod simulator;
pub mod solver;
mod storage;
mod tabs;
mod execute;

use self::clock::Clock;
use self::dom::Dom;
use self::storage::Storage;
use self::surroundings::{context, place};
use crate::runtime::{Commands, Event, Page, PageContext};
use js_sys::{Function, Promise, Reflect};
use sidestep::picture::Picture;
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::pin::Pin;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{Document, HtmlElement, Window};

/// Opens a page and runs it until the tab is closed.
pub fn run<P: Page + 'static>(open: fn(PageContext) -> (P, Commands<P::Msg>)) {
    std::panic::set_hook(Box::new(|panic| {
        web_sys::console::error_1(&format!("Sidestep stopped: {panic}").into());
        show_crash();
    }));
    let Some((window, document, root)) = place() else {
        web_sys::console::error_1(&"Sidestep found no element with the id 'app'".into());
        return;
    };
    background(async move {
        let (storage, kept) = match P::keeps() {
            true => Storage::open(&window).await,
            // A page that stores nothing does not open the browser's database, because opening it
            // is the slowest part of the start.
            false => (Storage::none(&window), Vec::new()),
        };
        let context = PageContext { kept, not_kept: storage.failure(), ..context(&window) };
        let clock = Clock::new(&window, &context.address);
        let (page, commands) = open(context);
        let shell = Shell {
            page,
            dom: Dom::new(&document, &root),
            clock,
            storage,
            window,
            document,
            root,
            painter: canvas::Painter::default(),
            picture: Picture::default(),
            extra: None,
            title: String::new(),
            frame_requested: false,
            in_frame: false,
            on_frame: None,
            alarm: None,
            on_alarm: None,
            on_resize: None,
            listeners: Vec::new(),
            down: Vec::new(),
            has_pointed: false,
            guard: None,
            claims: Vec::new(),
            underway: Vec::new(),
            started: 0,
        };
        let pump =
            Pump { shell: Rc::new(RefCell::new(shell)), queue: Rc::default(), busy: Rc::default() };
        pump.listen();
        pump.busy.set(true);
        pump.apply(commands);
        pump.work();
        load_simulator(&pump.shell.borrow());
    });
}

/// Runs a future in the background.
fn background(work: impl Future<Output = ()> + 'static) {
    // Box all futures as one type, so that the program contains the executor code only once.
    let work: Pin<Box<dyn Future<Output = ()>>> = Box::pin(work);
    wasm_bindgen_futures::spawn_local(work);
}

/// Loads the simulator, which operates the page, if the address asks for a simulated participation.
fn load_simulator<P: Page>(shell: &Shell<P>) {
    let address = shell.root.get_attribute("data-simulator");
    let Some(address) = address.filter(|_| shell.clock.is_simulated()) else { return };
    let script = shell.document.create_element("script");
    if let (Ok(script), Some(body)) = (script, shell.document.body()) {
        let _ = script.set_attribute("type", "module");
        let _ = script.set_attribute("src", &address);
        let _ = body.append_child(&script);
    }
}

/// Shows a message after a panic. After a panic, only the document can be trusted, so the message
/// is written directly into the document.
fn show_crash() {
    if let Some((_, _, root)) = place() {
        root.set_text_content(Some(
            "Something went wrong. Please reload this page; nothing that was saved is lost.",
        ));
    }
}

/// Calls a method that the browser might refuse, and ignores the outcome.
fn wish(object: &JsValue, method: &str) {
    let method = Reflect::get(object, &method.into()).unwrap_or_default();
    let promise = method.dyn_ref::<Function>().and_then(|method| method.call0(object).ok());
    if let Some(Ok(promise)) = promise.map(JsValue::dyn_into::<Promise>) {
        background(async move {
            let _ = JsFuture::from(promise).await;
        });
    }
}

struct Shell<P: Page> {
    page: P,
    window: Window,
    document: Document,
    root: HtmlElement,
    dom: Dom<P::Msg>,
    clock: Clock,
    storage: Storage,
    painter: canvas::Painter,
    /// The last picture painted.
    picture: Picture,
    /// See [`Extra`]. Created on demand, so that pages that never use it do not contain its code.
    extra: Option<Box<dyn Any>>,
    /// The document's title.
    title: String,
    frame_requested: bool,
    /// Whether an animation frame is being handled. The picture is painted at the end of the frame.
    in_frame: bool,
    on_frame: Option<Closure<dyn FnMut(f64)>>,
    /// When the page's next tick is due on the page's clock, and the browser's timer for it.
    alarm: Option<(f64, i32)>,
    on_alarm: Option<Closure<dyn FnMut()>>,
    on_resize: Option<canvas::SizeWatcher>,
    listeners: Vec<listen::Listener>,
    /// Codes of the keys that are down.
    down: Vec<String>,
    /// Whether the last input came from the pointer rather than from a key.
    has_pointed: bool,
    /// While this is `Some`, the browser asks users for confirmation before they leave.
    guard: Option<listen::Listener>,
    claims: Vec<tabs::Claim>,
    underway: Vec<Underway>,
    /// Number of requests, timers and solves started so far.
    started: u32,
}

/// State that only some pages need.
#[derive(Default)]
struct Extra {
    /// The painter of solids.
    solids: solid::Painter,
    /// The painter of the second picture, and the last picture it painted.
    painter: canvas::Painter,
    picture: Picture,
}

/// A request, timer, solve or other work in progress.
struct Underway {
    name: &'static str,
    /// Distinguishes this work from other work of the same name, because cancelled work can still
    /// report.
    number: u32,
    /// Dropping this value cancels the work.
    _work: Box<dyn Any>,
}

impl<P: Page> Shell<P> {
    /// Updates the document and the canvas.
    fn show(&mut self) {
        self.dom.show(self.page.view());
        let title = self.page.title();
        if self.title != title {
            self.document.set_title(&title);
            self.title = title;
        }
        if self.page.draw(self.clock.now_ms(), &mut self.picture) {
            let canvas = self.painter.find(&self.document, self.picture.canvas);
            if let (Some(canvas), Some(watcher)) = (canvas, &mut self.on_resize) {
                watcher.watch(canvas);
            }
            if !self.in_frame {
                self.painter.paint(&self.window, &self.picture);
            }
        }
        if P::has_panes() && !self.in_frame {
            self.paint_beside(self.clock.now_ms());
        }
    }

    /// Paints the page's picture for the time `at_ms` on the page's clock.
    fn paint(&mut self, at_ms: f64) {
        if self.page.draw(at_ms, &mut self.picture) {
            self.painter.paint(&self.window, &self.picture);
        }
        if P::has_panes() {
            self.paint_beside(at_ms);
        }
    }

    /// Paints the second picture, if there is one.
    fn paint_beside(&mut self, at_ms: f64) {
        let Some(extra) = extra(&mut self.extra) else { return };
        if self.page.draw_beside(at_ms, &mut extra.picture) {
            extra.painter.be_like(&self.painter);
            extra.painter.find(&self.document, extra.picture.canvas);
            extra.painter.paint(&self.window, &extra.picture);
        }
    }

    /// Repaints after the size or the colours have changed.
    fn repaint(&mut self) {
        self.painter.measure_again();
        if P::has_panes()
            && let Some(extra) = extra(&mut self.extra)
        {
            extra.painter.measure_again();
        }
        self.paint(self.clock.now_ms());
    }

    /// Cancels the current work of this name and returns the number for the new work.
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

/// Returns the state that only some pages need, and creates it on first use.
fn extra(place: &mut Option<Box<dyn Any>>) -> Option<&mut Extra> {
    place.get_or_insert_with(|| Box::new(Extra::default())).downcast_mut()
}

/// Messages in order of arrival, each with the time of its cause (ms on the page's clock).
type Queue<M> = RefCell<VecDeque<(M, f64)>>;

/// Processes messages one at a time, in order of arrival.
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
    /// Delivers a message to the page, now or after the messages in the queue.
    fn dispatch(&self, message: P::Msg, t_ms: f64) {
        self.queue.borrow_mut().push_back((message, t_ms));
        if !self.busy.replace(true) {
            self.work();
        }
    }

    /// Delivers a message whose cause happens now.
    fn dispatch_now(&self, message: P::Msg) {
        let now_ms = self.shell.borrow().clock.now_ms();
        self.dispatch(message, now_ms);
    }

    /// Reports an event to the page. `stamp` is its time on the browser's clock.
    fn tell(&self, event: &Event, stamp: f64) {
        let t_ms = self.shell.borrow().clock.of(stamp);
        self.report(event, t_ms);
    }

    /// Reports an event to the page if the page wants it. `t_ms` is its time on the page's clock.
    fn report(&self, event: &Event, t_ms: f64) {
        let message = self.shell.borrow().page.hear(event);
        if let Some(message) = message {
            self.dispatch(message, t_ms);
        }
    }

    /// Delivers all messages in the queue, then shows the result.
    fn work(&self) {
        loop {
            let next = self.queue.borrow_mut().pop_front();
            let Some((message, t_ms)) = next else { break };
            let commands = self.shell.borrow_mut().page.update(message, t_ms);
            self.apply(commands);
        }
        self.shell.borrow_mut().show();
        self.busy.set(false);
        if P::shows_solids() {
            self.show_solid();
        }
        self.set_alarm();
        self.request_frame();
    }

    /// Draws the page's solid. Notifies the page when the browser loses or regains the ability to
    /// draw it.
    fn show_solid(&self) {
        let mut shell = self.shell.borrow_mut();
        let Some(solid) = shell.page.solid() else { return };
        let (pump, then) = (self.clone(), Rc::clone(&solid.then));
        let tell = move |can: bool| pump.dispatch_now(then(can));
        let (document, window) = (shell.document.clone(), shell.window.clone());
        let is_drawn = extra(&mut shell.extra)
            .and_then(|extra| extra.solids.draw(&document, &window, &solid, tell));
        drop(shell);
        match is_drawn {
            None => self.dispatch_now((solid.then)(false)),
            Some(Some(ms)) => self.dispatch_now((solid.drawn)(ms)),
            Some(None) => {}
        }
    }

    /// Navigates to an address within this page, without loading it. Returns whether the page can
    /// show the address.
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

    /// Requests an animation frame if the page wants one.
    fn request_frame(&self) {
        let mut shell = self.shell.borrow_mut();
        if shell.frame_requested || !shell.page.wants_frames() {
            return;
        }
        if shell.on_frame.is_none() {
            let pump = self.clone();
            shell.on_frame = Some(Closure::new(move |stamp| pump.frame(stamp)));
        }
        if let Some(on_frame) = &shell.on_frame {
            let callback = on_frame.as_ref().unchecked_ref();
            shell.frame_requested = shell.window.request_animation_frame(callback).is_ok();
        }
    }

    /// Handles an animation frame. `stamp` is the time on the browser's clock at which the frame
    /// began.
    fn frame(&self, stamp: f64) {
        let (begun_ms, at_ms) = {
            let mut shell = self.shell.borrow_mut();
            (shell.frame_requested, shell.in_frame) = (false, true);
            let now_ms = shell.clock.now_ms();
            // An accelerated clock has advanced too far since the frame began, so paint for the
            // current time.
            let is_hurried = shell.clock.is_hurried();
            (now_ms, if is_hurried { now_ms } else { shell.clock.of(stamp) })
        };
        self.tick(begun_ms);
        let mut shell = self.shell.borrow_mut();
        shell.in_frame = false;
        shell.paint(at_ms);
        let took_ms = shell.clock.now_ms() - begun_ms;
        shell.page.frame_shown(at_ms, took_ms);
        drop(shell);
        self.request_frame();
    }

    /// Makes the page do the work that is due at `now_ms`.
    fn tick(&self, now_ms: f64) {
        let message = self.shell.borrow_mut().page.tick(now_ms);
        match message {
            Some(message) => self.dispatch(message, now_ms),
            None => self.set_alarm(),
        }
    }

    /// Sets the browser's timer for the page's next tick.
    fn set_alarm(&self) {
        let mut shell = self.shell.borrow_mut();
        let due_ms = shell.page.due_ms();
        if shell.alarm.map(|(due_ms, _)| due_ms) == due_ms {
            return;
        }
        shell.clock.stop_at(due_ms);
        if let Some((_, timer)) = shell.alarm.take() {
            shell.window.clear_timeout_with_handle(timer);
        }
        if shell.on_alarm.is_none() {
            let pump = self.clone();
            shell.on_alarm = Some(Closure::new(move || pump.ring()));
        }
        if let (Some(due_ms), Some(on_alarm)) = (due_ms, &shell.on_alarm) {
            let timer = shell.window.set_timeout_with_callback_and_timeout_and_arguments_0(
                on_alarm.as_ref().unchecked_ref(),
                shell.clock.wait_ms(due_ms),
            );
            shell.alarm = timer.ok().map(|timer| (due_ms, timer));
        }
    }

    /// Handles the browser's timer, which can fire slightly early because its clock has a limited
    /// resolution.
    fn ring(&self) {
        let now_ms = {
            let mut shell = self.shell.borrow_mut();
            shell.alarm = None;
            shell.clock.now_ms()
        };
        self.tick(now_ms);
        // With an accelerated clock, there are more steps than frames, but the simulator must see
        // every step.
        let mut shell = self.shell.borrow_mut();
        if shell.clock.is_hurried() {
            shell.paint(now_ms);
        }
    }
}
