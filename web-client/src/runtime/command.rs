//! Commands of a page to the browser, and their outcomes.

use super::answer::Answer;
use crate::evaluation::Part;
use crate::task::Task;
use std::rc::Rc;

/// Commands, executed in order.
pub type Commands<M> = Vec<Command<M>>;

/// Converts an outcome to a message.
pub type Then<T, M> = Box<dyn FnOnce(T) -> M>;

/// A command of a page to the browser.
///
/// Requests, timers and solves have names. Starting a request, timer or solve cancels the earlier
/// one with the same name, whose outcome then never arrives.
pub enum Command<M> {
    /// Send a request.
    Send(Request<M>),
    /// Send a message after a delay.
    Wake {
        /// Name of the timer.
        timer: &'static str,
        /// The delay (ms).
        after_ms: f64,
        /// The message.
        message: M,
    },
    /// Solve a game in a worker.
    Solve {
        /// Name of the solve.
        name: &'static str,
        /// The task.
        task: Task,
        /// Converts each report to a message. The last report is a solution or a failure.
        then: Rc<dyn Fn(Solving) -> M>,
    },
    /// Send a message to an evaluator. The content is a function, so that programs without
    /// evaluators, such as the participant's, do not contain the code that creates the message.
    Evaluate(Box<dyn FnOnce() -> Evaluate<M>>),
    /// Send a message now, and whenever the server reports a change. The connection is closed while
    /// the page is hidden. When the page is shown again, the message is sent immediately.
    Follow {
        /// The name under which the subscription can be cancelled.
        name: &'static str,
        /// Address of the server's events on this origin.
        url: &'static str,
        /// The message.
        then: Rc<dyn Fn() -> M>,
    },
    /// Cancel the request, timer, solve, evaluator or `Follow` with this name.
    Cancel(&'static str),
    /// Cancel everything in progress.
    CancelAll,
    /// Store a text in this browser. Once the text is reported as stored, it survives a crash.
    /// Texts with the same name are stored in the order of these commands.
    Keep {
        /// The name of the text.
        name: String,
        /// The text.
        text: String,
        /// Converts the outcome to a message.
        then: Then<Result<(), NotKept>, M>,
    },
    /// Delete the text with this name.
    Forget(String),
    /// Claim a name for this tab only. Every other tab of this browser that has claimed the name
    /// loses it and receives [`Event::TakenOver`](super::Event::TakenOver).
    TakeOver(String),
    /// Set the page's language.
    Language(String),
    /// Set whether users must confirm before they leave the page.
    GuardLeaving(bool),
    /// Enter or leave full screen. The browser allows this only as a reaction to a key or button
    /// press.
    Fullscreen(bool),
    /// Offer something for download. The content is a function for the same reason as in
    /// [`Self::Evaluate`].
    Offer(Box<dyn FnOnce() -> Offer<M>>),
    /// Replace the address in the address bar without loading it.
    ReplaceAddress(String),
    /// Show another address of this page, as if the user had followed a link.
    Visit(String),
    /// Leave the page for another address.
    Leave(String),
}

/// Something to offer for download.
pub enum Offer<M> {
    /// A file.
    File {
        /// Name of the file.
        name: String,
        /// Media type of the file.
        media_type: &'static str,
        /// Content of the file.
        content: Vec<u8>,
    },
    /// A film of a canvas, recorded from now on. If the film is cancelled, it is discarded.
    Film {
        /// The name under which the film can be cancelled.
        name: &'static str,
        /// Id of the canvas element.
        canvas: &'static str,
        /// Name of the file.
        file: String,
        /// Converts the outcome to a message: the film was offered, or it failed for this reason.
        then: Rc<dyn Fn(Result<(), String>) -> M>,
    },
    /// Ends the recording with this name.
    EndOfFilm(&'static str),
}

/// Media type for an [`Offer::File`] with SVG content that is converted to a PNG image of twice its
/// nominal size.
pub const PNG_OF_SVG: &str = "image/png; from svg";

/// A message to the evaluator with this name. If there is no such evaluator, it is started, and it
/// runs until it is cancelled.
pub struct Evaluate<M> {
    /// Name of the evaluator.
    pub name: &'static str,
    /// The kind of message.
    pub part: Part,
    /// Content of the message.
    pub content: Vec<u8>,
    /// Converts each report to a message. Only the function of the command that started the
    /// evaluator is used.
    pub then: Rc<dyn Fn(Answer) -> M>,
}

/// A request to the server.
pub struct Request<M> {
    /// Name of the request; see [`Command`].
    pub name: &'static str,
    /// GET, POST, PUT or DELETE.
    pub method: &'static str,
    /// Address on this page's origin.
    pub url: String,
    /// The participant's token, if any.
    pub token: Option<String>,
    /// The body (JSON), if any.
    pub body: Option<String>,
    /// Converts the answer to a message.
    pub then: Then<Answer, M>,
}

impl<M> Request<M> {
    /// Creates a GET request without token and body.
    #[must_use]
    pub fn get(
        name: &'static str,
        url: impl Into<String>,
        then: impl FnOnce(Answer) -> M + 'static,
    ) -> Self {
        let (url, then) = (url.into(), Box::new(then));
        Self { name, method: "GET", url, token: None, body: None, then }
    }
}

impl<M: 'static> Command<M> {
    /// Creates the command that offers this for download.
    #[must_use]
    pub fn offer(offer: Offer<M>) -> Self {
        Self::Offer(Box::new(move || offer))
    }

    /// Maps the messages to the messages of a page that contains the page of this command.
    #[must_use]
    pub fn map<N: 'static>(self, lift: impl Fn(M) -> N + Clone + 'static) -> Command<N> {
        match self {
            Self::Send(Request { name, method, url, token, body, then }) => {
                let then = Box::new(move |answer| lift(then(answer)));
                Command::Send(Request { name, method, url, token, body, then })
            }
            Self::Wake { timer, after_ms, message } => {
                Command::Wake { timer, after_ms, message: lift(message) }
            }
            Self::Solve { name, task, then } => {
                Command::Solve { name, task, then: Rc::new(move |solving| lift(then(solving))) }
            }
            Self::Evaluate(evaluate) => Command::Evaluate(Box::new(move || {
                let Evaluate { name, part, content, then } = evaluate();
                let then = Rc::new(move |answer| lift(then(answer)));
                Evaluate { name, part, content, then }
            })),
            Self::Follow { name, url, then } => {
                Command::Follow { name, url, then: Rc::new(move || lift(then())) }
            }
            Self::Cancel(name) => Command::Cancel(name),
            Self::CancelAll => Command::CancelAll,
            Self::Keep { name, text, then } => {
                Command::Keep { name, text, then: Box::new(move |kept| lift(then(kept))) }
            }
            Self::Forget(name) => Command::Forget(name),
            Self::TakeOver(name) => Command::TakeOver(name),
            Self::Language(tag) => Command::Language(tag),
            Self::GuardLeaving(on) => Command::GuardLeaving(on),
            Self::Fullscreen(on) => Command::Fullscreen(on),
            Self::Offer(offer) => Command::Offer(Box::new(move || match offer() {
                Offer::File { name, media_type, content } => {
                    Offer::File { name, media_type, content }
                }
                Offer::Film { name, canvas, file, then } => {
                    let then = Rc::new(move |ended| lift(then(ended)));
                    Offer::Film { name, canvas, file, then }
                }
                Offer::EndOfFilm(name) => Offer::EndOfFilm(name),
            })),
            Self::ReplaceAddress(url) => Command::ReplaceAddress(url),
            Self::Visit(url) => Command::Visit(url),
            Self::Leave(url) => Command::Leave(url),
        }
    }
}

/// The reason why the browser did not store a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotKept {
    /// There is no space left for this site.
    Full,
    /// The browser stores nothing for this site, for example in a private window.
    Denied,
}

impl NotKept {
    /// An error message for people.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Full => "This browser has no storage left for this site.",
            Self::Denied => "This browser does not let this site store anything.",
        }
    }
}

/// A report from a solver, which runs in a worker.
#[derive(Clone, Debug, PartialEq)]
pub enum Solving {
    /// Progress, from 0 to 1.
    Done(f64),
    /// The bytes of the value function.
    Solved(Vec<u8>),
    /// There is no solution, for this reason.
    Failed(String),
}
