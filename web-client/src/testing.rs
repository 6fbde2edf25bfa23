//! Runs a page in a minimal fake browser. The fake server answers when the test tells it to.

use crate::evaluation::Evaluation;
use crate::runtime::{
    Answer, Command, Commands, Evaluate, Event, Failure, NotKept, Offer, Page, Request, Solving,
    Then, answer,
};
use crate::task::Task;
use crate::view::Node;
use sidestep::picture::Picture;
use std::collections::BTreeMap;
use std::rc::Rc;

/// Converts a report of a solver to a message.
pub(crate) type Report<M> = Rc<dyn Fn(Solving) -> M>;

/// Converts a report of an evaluator to a message.
pub(crate) type Evaluated<M> = Rc<dyn Fn(Answer) -> M>;

/// Creates the message for a change on the server.
pub(crate) type Changed<M> = Rc<dyn Fn() -> M>;

/// Converts the outcome of storing a text to a message.
pub(crate) type Kept<M> = Then<Result<(), NotKept>, M>;

/// Converts the outcome of a film to a message.
pub(crate) type Filmed<M> = Rc<dyn Fn(Result<(), String>) -> M>;

/// A page in the fake browser, with the page's requests.
pub(crate) struct Session<P: Page> {
    pub(crate) page: P,
    /// The time of the next message, on the page's clock (ms).
    pub(crate) now_ms: f64,
    /// The texts that the browser has stored, by name.
    pub(crate) kept: BTreeMap<String, String>,
    /// The reason why the browser refuses to store more texts.
    pub(crate) refuses: Option<NotKept>,
    /// Requests without an answer so far.
    pub(crate) asked: Vec<Request<P::Msg>>,
    /// The timers that are set: name, duration (ms) and message.
    pub(crate) timers: Vec<(&'static str, f64, P::Msg)>,
    /// The solves in progress: name, task and message function.
    pub(crate) solving: Vec<(&'static str, Task, Report<P::Msg>)>,
    /// The evaluators and their message functions, by name.
    pub(crate) evaluators: BTreeMap<&'static str, (Evaluation, Evaluated<P::Msg>)>,
    /// The subscriptions to changes: name and message function.
    pub(crate) following: Vec<(&'static str, Changed<P::Msg>)>,
    /// The addresses that the page has shown without leaving the document.
    pub(crate) visited: Vec<String>,
    /// The address to which the page has navigated, if it has left the document.
    pub(crate) left: Option<String>,
    /// The names that this tab has claimed.
    pub(crate) claims: Vec<String>,
    /// Whether users must confirm before they leave.
    pub(crate) guarded: bool,
    /// Whether the page has requested full screen.
    pub(crate) fullscreen: bool,
    /// Whether the browser delays storing texts. The delayed texts are in `keeping`.
    pub(crate) keeps_slowly: bool,
    /// The texts that still have to be stored: name, text and message function.
    pub(crate) keeping: Vec<(String, String, Kept<P::Msg>)>,
    picture: Picture,
    /// Names and contents of the files offered.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// The films being recorded: name, name of the file, and message function.
    pub(crate) films: Vec<(&'static str, String, Filmed<P::Msg>)>,
    /// Names of the films that were ended.
    pub(crate) films_ended: Vec<&'static str>,
}

impl<P: Page> Session<P> {
    /// Opens a page in a browser that has stored `kept`.
    pub(crate) fn new(
        (page, commands): (P, Commands<P::Msg>),
        kept: BTreeMap<String, String>,
    ) -> Self {
        let mut session = Self {
            page,
            now_ms: 0.0,
            kept,
            refuses: None,
            asked: Vec::new(),
            timers: Vec::new(),
            solving: Vec::new(),
            evaluators: BTreeMap::new(),
            following: Vec::new(),
            visited: Vec::new(),
            left: None,
            claims: Vec::new(),
            guarded: false,
            fullscreen: false,
            keeps_slowly: false,
            keeping: Vec::new(),
            picture: Picture::default(),
            files: Vec::new(),
            films: Vec::new(),
            films_ended: Vec::new(),
        };
        session.apply(commands);
        session
    }

    pub(crate) fn apply(&mut self, commands: Commands<P::Msg>) {
        for command in commands {
            match command {
                Command::Send(request) => {
                    self.cancel(|name| name == request.name);
                    self.asked.push(request);
                }
                Command::Wake { timer, after_ms, message } => {
                    self.cancel(|name| name == timer);
                    self.timers.push((timer, after_ms, message));
                }
                Command::Solve { name, task, then } => {
                    self.cancel(|other| other == name);
                    self.solving.push((name, task, then));
                }
                Command::Evaluate(evaluate) => {
                    let Evaluate { name, part, content, then } = evaluate();
                    self.evaluators
                        .entry(name)
                        .or_insert((Evaluation::default(), then))
                        .0
                        .hear(part, &content);
                }
                Command::Follow { name, then, .. } => {
                    self.cancel(|other| other == name);
                    self.following.push((name, then));
                }
                Command::Cancel(name) => self.cancel(|other| other == name),
                Command::CancelAll => self.cancel(|_| true),
                Command::Keep { name, text, then } => {
                    self.keeping.push((name, text, then));
                    if !self.keeps_slowly {
                        self.keep();
                    }
                }
                Command::Forget(name) => {
                    self.keep();
                    self.kept.remove(&name);
                }
                Command::TakeOver(name) => self.claims.push(name),
                Command::Language(_) => {}
                Command::GuardLeaving(on) => self.guarded = on,
                Command::Fullscreen(on) => self.fullscreen = on,
                Command::Visit(url) | Command::ReplaceAddress(url) => self.visited.push(url),
                Command::Leave(url) => self.left = Some(url),
                Command::Offer(offer) => match offer() {
                    Offer::File { name, content, .. } => self.files.push((name, content)),
                    Offer::Film { name, file, then, .. } => {
                        self.cancel(|other| other == name);
                        self.films.push((name, file, then));
                    }
                    Offer::EndOfFilm(name) => self.films_ended.push(name),
                },
            }
        }
    }

    /// Stores all pending texts, or refuses to store them.
    pub(crate) fn keep(&mut self) {
        for (name, text, then) in std::mem::take(&mut self.keeping) {
            let kept = self.refuses.map_or(Ok(()), Err);
            if kept.is_ok() {
                self.kept.insert(name, text);
            }
            self.tell(then(kept));
        }
    }

    fn cancel(&mut self, named: impl Fn(&str) -> bool) {
        self.asked.retain(|request| !named(request.name));
        self.timers.retain(|(name, ..)| !named(name));
        self.solving.retain(|(name, ..)| !named(name));
        self.following.retain(|(name, ..)| !named(name));
        self.evaluators.retain(|name, _| !named(name));
    }

    /// Runs the evaluator with this name until it has finished. Delivers only the last report.
    pub(crate) fn evaluate(&mut self, name: &str) {
        let (evaluation, then) = self.evaluators.get_mut(name).expect("an evaluator");
        while evaluation.work(&mut |_| {}) {}
        let message = evaluation.report().map(|report| then(Ok(report.into_bytes())));
        if let Some(message) = message {
            self.tell(message);
        }
    }

    pub(crate) fn tell(&mut self, message: P::Msg) {
        let commands = self.page.update(message, self.now_ms);
        self.apply(commands);
    }

    /// Sets the time.
    pub(crate) fn at(&mut self, now_ms: f64) -> &mut Self {
        self.now_ms = now_ms;
        self
    }

    /// Shows a frame, or ticks the page at its due time.
    pub(crate) fn frame(&mut self) {
        if let Some(message) = self.page.tick(self.now_ms) {
            self.tell(message);
        }
        if self.page.draw(self.now_ms, &mut self.picture) {
            self.page.frame_shown(self.now_ms, 0.5);
        }
    }

    /// The picture that the page draws now, if there is a canvas.
    pub(crate) fn picture(&self) -> Option<Picture> {
        let mut picture = Picture::default();
        self.page.draw(self.now_ms, &mut picture).then_some(picture)
    }

    pub(crate) fn hear(&mut self, event: &Event) {
        let message = self.page.hear(event).expect("the page wants to know");
        self.tell(message);
    }

    /// Removes and returns the request with this name.
    pub(crate) fn take(&mut self, name: &str) -> Request<P::Msg> {
        let at = self.asked.iter().position(|request| request.name == name);
        let names: Vec<_> = self.asked.iter().map(|request| request.name).collect();
        self.asked.remove(at.unwrap_or_else(|| panic!("no {name} in {names:?}")))
    }

    fn reply(&mut self, name: &str, answer: Answer) {
        let request = self.take(name);
        self.tell((request.then)(answer));
    }

    /// Makes the server answer the request with this name.
    pub(crate) fn answer(&mut self, name: &str, status: u16, body: &[u8]) {
        self.reply(name, answer(status, body.to_vec()));
    }

    /// Makes the server answer the request with a value as JSON.
    pub(crate) fn send(&mut self, name: &str, status: u16, body: &impl serde::Serialize) {
        self.answer(name, status, &serde_json::to_vec(body).unwrap());
    }

    pub(crate) fn unreachable(&mut self, name: &str) {
        self.reply(name, Err(Failure::unreachable()));
    }

    /// Fires the timer with this name.
    pub(crate) fn wake(&mut self, timer: &str) {
        let at = self.timers.iter().position(|(name, ..)| *name == timer).expect("a timer");
        let (.., message) = self.timers.remove(at);
        self.tell(message);
    }

    /// Delivers a report of the solver with this name.
    pub(crate) fn solver(&mut self, name: &str, solving: Solving) {
        let at = self.solving.iter().position(|(other, ..)| *other == name).expect("a solve");
        let message = (self.solving[at].2)(solving.clone());
        if !matches!(solving, Solving::Done(_)) {
            self.solving.remove(at);
        }
        self.tell(message);
    }

    /// Simulates a change on the server: delivers the message of every subscription.
    pub(crate) fn changed(&mut self) {
        let messages: Vec<_> = self.following.iter().map(|(_, then)| then()).collect();
        for message in messages {
            self.tell(message);
        }
    }

    pub(crate) fn press(&mut self, test_id: &str) {
        let view = self.page.view();
        let message = view.press(test_id);
        self.tell(message.unwrap_or_else(|| panic!("no {test_id} in: {}", view.words())));
    }

    /// All text of the view.
    pub(crate) fn text(&self) -> String {
        self.page.view().words()
    }

    /// The text of the element with this test name, if it is shown.
    pub(crate) fn words(&self, test_id: &str) -> Option<String> {
        self.page.view().find(test_id).map(Node::words)
    }

    /// The addresses of the requests that have no answer yet.
    pub(crate) fn urls(&self) -> Vec<&str> {
        self.asked.iter().map(|request| request.url.as_str()).collect()
    }
}
