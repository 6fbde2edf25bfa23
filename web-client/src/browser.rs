//! The only module that uses the browser's API. It delivers messages to a page, executes the page's
//! commands, and shows its view and its picture.

mod address;
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

use self::clock::Clock;
use self::dom::Dom;
use self::storage::Storage;
use crate::runtime::{
    Command, Commands, Evaluate, Event, Failure, Offer, PNG_OF_SVG, Page, PageContext, Solving,
};
use js_sys::{Function, Promise, Reflect};
use sidestep::picture::Picture;
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::pin::Pin;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{Blob, Document, HtmlElement, Window};

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
            // Do not open the browser's database, because that takes longer than everything else
            // that a page waits for.
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

fn place() -> Option<(Window, Document, HtmlElement)> {
    let window = web_sys::window()?;
    let document = window.document()?;
    let root = document.get_element_by_id("app")?.dyn_into().ok()?;
    Some((window, document, root))
}

/// Shows a message after a panic. Only the document can be trusted then, so the message is written
/// there directly.
fn show_crash() {
    if let Some((_, _, root)) = place() {
        root.set_text_content(Some(
            "Something went wrong. Please reload this page; nothing that was saved is lost.",
        ));
    }
}

/// The context that a page gets when it opens, without its stored records.
fn context(window: &Window) -> PageContext {
    let screen = window.screen().ok();
    let width = screen.as_ref().and_then(|screen| screen.width().ok()).unwrap_or(0);
    let height = screen.as_ref().and_then(|screen| screen.height().ok()).unwrap_or(0);
    let (window_width, window_height, ratio) = window_size(window);
    let languages = window.navigator().languages();
    PageContext {
        address: address::current(window),
        languages: languages.iter().filter_map(|language| language.as_string()).collect(),
        // A device without any pointer counts as one with a keyboard.
        touch_only: matches(window, "(any-pointer: coarse)")
            && !matches(window, "(any-pointer: fine), (any-hover: hover)"),
        reduced_motion: matches(window, "(prefers-reduced-motion: reduce)"),
        screen: vec![
            ("screen_width_px", width.into()),
            ("screen_height_px", height.into()),
            ("window_width_px", window_width),
            ("window_height_px", window_height),
            ("device_pixel_ratio", ratio),
        ],
        time_origin_ms: window.performance().map_or(0.0, |clock| clock.time_origin()),
        random_name: random_name(window),
        ..PageContext::default()
    }
}

/// Calls a method that the browser may refuse to execute. The page is not told whether it succeeds.
fn wish(object: &JsValue, method: &str) {
    let method = Reflect::get(object, &method.into()).unwrap_or_default();
    let promise = method.dyn_ref::<Function>().and_then(|method| method.call0(object).ok());
    if let Some(Ok(promise)) = promise.map(JsValue::dyn_into::<Promise>) {
        background(async move {
            let _ = JsFuture::from(promise).await;
        });
    }
}

/// Whether a media query matches.
fn matches(window: &Window, query: &str) -> bool {
    window.match_media(query).ok().flatten().is_some_and(|query| query.matches())
}

/// The width and height of the window's content (CSS pixels), and the number of device pixels per
/// CSS pixel.
fn window_size(window: &Window) -> (f64, f64, f64) {
    let number =
        |value: Result<JsValue, JsValue>| value.ok().and_then(|v| v.as_f64()).unwrap_or(0.0);
    (number(window.inner_width()), number(window.inner_height()), window.device_pixel_ratio())
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
    clock: Clock,
    storage: Storage,
    painter: canvas::Painter,
    /// The last picture painted.
    picture: Picture,
    /// See [`Extra`]. Created on demand, so pages without solids and panes contain none of its
    /// code.
    extra: Option<Box<dyn Any>>,
    /// The document's title.
    title: String,
    frame_requested: bool,
    /// Whether a frame is in progress. At its end the picture is painted.
    in_frame: bool,
    on_frame: Option<Closure<dyn FnMut(f64)>>,
    /// When the page's next tick is due on the page's clock, and the browser's timer for it.
    alarm: Option<(f64, i32)>,
    on_alarm: Option<Closure<dyn FnMut()>>,
    on_resize: Option<canvas::SizeWatcher>,
    listeners: Vec<listen::Listener>,
    /// Codes of the keys that are down.
    down: Vec<String>,
    /// Whether the last input was by pointer and not by key.
    has_pointed: bool,
    /// While present, makes the browser ask users for confirmation before they leave.
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
    /// Distinguishes this work from other work of the same name, because cancelled work may still
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

    /// Paints the page's picture as of this time on the page's clock.
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

/// Messages in order of arrival. Each has the time of its cause on the page's clock.
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

    /// Draws the page's solid. Notifies the page when the browser cannot draw it, or can draw it
    /// again.
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
                background(async move {
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
                    shell.clock.browser_ms(after_ms),
                );
            }
            // This arm removes the code below from pages that never solve.
            Command::Solve { .. } if !P::solves() => {}
            Command::Solve { name, task, then } => {
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
                match solver::Solver::start(&address, &task, report) {
                    Ok(solver) => {
                        let _work = Box::new(solver);
                        shell.underway.push(Underway { name, number, _work });
                    }
                    Err(_) => {
                        let why = "This browser cannot start the solver.".to_owned();
                        let message = then(Solving::Failed(why));
                        self.queue.borrow_mut().push_back((message, shell.clock.now_ms()));
                    }
                }
            }
            Command::Evaluate(_) if !P::solves() => {}
            Command::Evaluate(evaluate) => {
                let Evaluate { name, part, content, then } = evaluate();
                let known = shell.underway.iter().find(|underway| underway.name == name);
                let known = known.and_then(|it| it._work.downcast_ref::<evaluator::Evaluator>());
                if let Some(evaluator) = known {
                    evaluator.tell(part, &content);
                    return;
                }
                let number = shell.begin(name);
                let address = shell.root.get_attribute("data-evaluator").unwrap_or_default();
                let (pump, report) = (self.clone(), Rc::clone(&then));
                let report = move |answer| {
                    if pump.shell.borrow().holds(number) {
                        pump.dispatch_now(report(answer));
                    }
                };
                match evaluator::Evaluator::start(&address, report) {
                    Ok(evaluator) => {
                        evaluator.tell(part, &content);
                        let _work = Box::new(evaluator);
                        shell.underway.push(Underway { name, number, _work });
                    }
                    Err(_) => {
                        let sentence = "This browser cannot start the evaluator.".to_owned();
                        let message = then(Err(Failure { sentence, ..Failure::unreachable() }));
                        self.queue.borrow_mut().push_back((message, shell.clock.now_ms()));
                    }
                }
            }
            Command::Follow { .. } if !P::follows() => {}
            Command::Follow { name, url, then } => {
                let number = shell.begin(name);
                let pump = self.clone();
                let hear = move || {
                    if pump.shell.borrow().holds(number) {
                        pump.dispatch_now(then());
                    }
                };
                let _work = Box::new(follow::Follower::start(&shell.document, url, hear));
                shell.underway.push(Underway { name, number, _work });
            }
            Command::Cancel(name) => shell.underway.retain(|underway| underway.name != name),
            // If a user leaves while a film is being recorded, the film so far is still wanted. End
            // the recording; the film is then offered for download.
            Command::CancelAll if P::offers_files() => {
                shell.underway.retain(|underway| {
                    underway._work.downcast_ref::<film::Film>().map(film::Film::end).is_some()
                });
            }
            Command::CancelAll => shell.underway.clear(),
            Command::Keep { .. } if !P::keeps() => {}
            Command::Keep { name, text, then } => {
                let kept = shell.storage.keep(&name, &text);
                let pump = self.clone();
                background(async move {
                    let kept = kept.await;
                    pump.dispatch_now(then(kept));
                });
            }
            Command::Forget(_) if !P::keeps() => {}
            Command::Forget(name) => shell.storage.forget(&name),
            Command::Language(tag) => {
                if let Some(element) = shell.document.document_element() {
                    let _ = element.set_attribute("lang", &tag);
                }
            }
            Command::TakeOver(name) => {
                let pump = self.clone();
                let lost = move || {
                    let now_ms = pump.shell.borrow().clock.now_ms();
                    pump.report(&Event::TakenOver, now_ms);
                };
                shell.claims.retain(|claim| claim.name() != name);
                shell.claims.extend(tabs::Claim::new(&name, lost));
            }
            Command::GuardLeaving(on) => {
                let guard = on.then(|| listen::Listener::guard(&shell.window)).flatten();
                shell.guard = guard;
            }
            Command::Fullscreen(true) => {
                if let Some(all) = shell.document.document_element() {
                    wish(&all, "requestFullscreen");
                }
            }
            Command::Fullscreen(false) => wish(&shell.document, "exitFullscreen"),
            Command::Offer(_) if !P::offers_files() => {}
            Command::Offer(offer) => match offer() {
                Offer::File { name, media_type: PNG_OF_SVG, content } => {
                    files::offer_picture(&shell.document, &content, name);
                }
                Offer::File { name, media_type, content } => {
                    files::offer(&shell.document, &name, media_type, &content);
                }
                Offer::Film { name, canvas, file, then } => {
                    let number = shell.begin(name);
                    let (pump, document, then_ended) =
                        (self.clone(), shell.document.clone(), Rc::clone(&then));
                    let ended = move |film: Result<Blob, String>| {
                        let offered = film.and_then(|film| {
                            files::offer_blob(&document, &file, &film)
                                .map_err(|_| "The browser did not accept the film.".to_owned())
                        });
                        // Drop the film only after this listener, which belongs to it, has
                        // returned.
                        let (pump, then) = (pump.clone(), Rc::clone(&then_ended));
                        background(async move { pump.finish(number, || then(offered)) });
                    };
                    match film::Film::begin(&shell.document, canvas, ended) {
                        Ok(film) => {
                            shell.underway.push(Underway { name, number, _work: Box::new(film) });
                        }
                        Err(why) => {
                            let message = then(Err(why));
                            self.queue.borrow_mut().push_back((message, shell.clock.now_ms()));
                        }
                    }
                }
                Offer::EndOfFilm(name) => {
                    let films = shell.underway.iter().filter(|underway| underway.name == name);
                    let film = films.filter_map(|it| it._work.downcast_ref::<film::Film>()).next();
                    film.map(film::Film::end).unwrap_or_default();
                }
            },
            Command::ReplaceAddress(url) => address::replace(&shell.window, &url),
            Command::Visit(url) => {
                let (now_ms, window) = (shell.clock.now_ms(), shell.window.clone());
                drop(shell);
                if !self.visit(&url, now_ms) {
                    let _ = window.location().assign(&url);
                }
            }
            Command::Leave(url) => {
                let _ = shell.window.location().assign(&url);
            }
        }
    }

    /// Completes a request, timer or solve: delivers its message, unless the work was cancelled.
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
            // An accelerated clock has advanced far since the frame began.
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

    /// Lets the page compute what is due at this time.
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

    /// Handles the browser's timer, which may fire slightly early because its clock has a limited
    /// resolution.
    fn ring(&self) {
        let now_ms = {
            let mut shell = self.shell.borrow_mut();
            shell.alarm = None;
            shell.clock.now_ms()
        };
        self.tick(now_ms);
        // An accelerated clock has more steps than frames, but the simulator must see every step.
        let mut shell = self.shell.borrow_mut();
        if shell.clock.is_hurried() {
            shell.paint(now_ms);
        }
    }
}
