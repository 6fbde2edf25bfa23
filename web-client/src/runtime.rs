//! Interface between a page and the browser: the page takes messages of its own type and returns
//! commands, each of which turns its outcome into a message.

use crate::evaluation::Part;
use crate::task::Task;
use crate::view::Node;
use sidestep::api::Problem;
use sidestep::picture::Picture;
use sidestep::value_view::Mesh;
use std::rc::Rc;

/// A page: a state machine with its own message type. It never blocks and never touches the
/// browser, so tests run it natively.
pub trait Page {
    /// The page's messages.
    type Msg: Clone + 'static;

    /// Whether it has several addresses. This is an associated function so that the compiler
    /// removes code that a page does not need: every participant downloads the program.
    #[must_use]
    fn navigates() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it shows solids; otherwise [`Page::solid`] is never called.
    #[must_use]
    fn shows_solids() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it may show a second picture; otherwise [`Page::draw_beside`] is never called.
    #[must_use]
    fn has_panes() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it uses pointer events; otherwise [`Node::on_point`] does nothing.
    #[must_use]
    fn points() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it uses workers that compute; otherwise [`Command::Solve`] and [`Command::Evaluate`]
    /// do nothing.
    #[must_use]
    fn solves() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it offers and opens files; otherwise [`Command::Offer`] does nothing, and file
    /// fields have no content.
    #[must_use]
    fn offers_files() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it stores records in this browser; otherwise it opens without reading any.
    #[must_use]
    fn keeps() -> bool
    where
        Self: Sized,
    {
        true
    }

    /// Whether it follows changes on the server; otherwise [`Command::Follow`] does nothing.
    #[must_use]
    fn follows() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether keys are shortcuts: a focused control keeps the keys that it needs, and the page
    /// receives all others, with repeats. Otherwise the page receives all keys, without repeats.
    #[must_use]
    fn has_short_cuts() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Handles a message and returns commands. `now_ms` is when the message's cause happened, on
    /// the page's clock.
    fn update(&mut self, message: Self::Msg, now_ms: f64) -> Commands<Self::Msg>;

    /// The view to show.
    fn view(&self) -> Node<Self::Msg>;

    /// The document's title.
    fn title(&self) -> String;

    /// The message for an event outside the view, if the page wants it.
    fn hear(&self, _event: &Event) -> Option<Self::Msg> {
        None
    }

    /// Time of the next change by the clock alone, on the page's clock, ms: [`Self::tick`] is
    /// called then, whatever the frame rate.
    fn due_ms(&self) -> Option<f64> {
        None
    }

    /// Computes what follows from the clock alone up to `now_ms`. Called when that is due and in
    /// every frame. Returns a message if more than the picture changes; a call that returns `None`
    /// allocates nothing.
    fn tick(&mut self, _now_ms: f64) -> Option<Self::Msg> {
        None
    }

    /// Whether the page wants frames; otherwise the picture is painted only after messages.
    fn wants_frames(&self) -> bool {
        false
    }

    /// Draws the scene at `at_ms`, on the page's clock, into `picture`, which holds the last
    /// picture painted. Returns whether there is a canvas.
    fn draw(&self, _at_ms: f64, _picture: &mut Picture) -> bool {
        false
    }

    /// Like [`Self::draw`], for a second picture on its own canvas beside the first.
    fn draw_beside(&self, _at_ms: f64, _picture: &mut Picture) -> bool {
        false
    }

    /// The solid to show, if any. It is drawn after every message.
    fn solid(&self) -> Option<Solid<Self::Msg>> {
        None
    }

    /// Whether the key with this code (see [`Event::Key`]) belongs to the page, so that the browser
    /// does not scroll on it.
    fn owns_key(&self, _code: &str) -> bool {
        false
    }

    /// Records a frame shown at `at_ms`, and the duration of its work.
    fn frame_shown(&mut self, _at_ms: f64, _work_ms: f64) {}
}

/// Something that happens outside the view.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A key went down or up. Repeats are left out, except for shortcuts.
    Key {
        /// Its code, such as `ArrowLeft` or `KeyA`: the same on every layout.
        code: String,
        /// The character or name printed on it.
        key: String,
        /// Down or up.
        down: bool,
    },
    /// The window lost the keyboard. From now on no key counts as held, because the browser does
    /// not report their release.
    FocusLost {
        /// Whether the page is hidden, behind another tab for example.
        hidden: bool,
    },
    /// The window has the keyboard again.
    FocusGained,
    /// The page is no longer hidden.
    Shown,
    /// The window changed size or zoom.
    Resized {
        /// Width inside the window, CSS pixels.
        width_px: f64,
        /// Height inside the window, CSS pixels.
        height_px: f64,
        /// Device pixels per CSS pixel.
        ratio: f64,
    },
    /// The page fills the screen, or no longer does.
    Fullscreen(bool),
    /// The network is back.
    Online,
    /// Another tab has taken over a claim of this one; see [`Command::TakeOver`].
    TakenOver,
    /// Another address is requested: the user followed a link, went back or forward, or edited the
    /// address. The document stays if the page wants the message.
    Address(Address),
}

/// Triangles on their own canvas, transparent around them.
pub struct Solid<M> {
    /// The canvas element's id.
    pub canvas: &'static str,
    /// The triangles. A changed mesh has a new pointer.
    pub mesh: Rc<Mesh>,
    /// From the mesh's coordinates to clip coordinates, column by column.
    pub matrix: [f32; 16],
    /// The direction from which light falls, of length 1, in the space of the normals.
    pub light: [f32; 3],
    /// Its tones in shadow, half light and bright light.
    pub tones: [[u8; 3]; 3],
    /// Spacing of the rings on the surface, in the mesh's third coordinate.
    pub ring: f32,
    /// Whether it is not being turned, so that it is drawn with more pixels.
    pub is_still: bool,
    /// The message when the browser cannot draw it (false), permanently or while its context is
    /// lost, and when it can again (true).
    pub then: Rc<dyn Fn(bool) -> M>,
    /// The message after the first drawing of a mesh: duration of a frame while it turns, ms.
    pub drawn: Rc<dyn Fn(f64) -> M>,
}

impl<M: 'static> Solid<M> {
    /// Maps its messages to those of a page that contains this one.
    #[must_use]
    pub fn map<N: 'static>(self, lift: impl Fn(M) -> N + 'static) -> Solid<N> {
        let Self { canvas, mesh, matrix, light, tones, ring, is_still, then, drawn } = self;
        let lift = Rc::new(lift);
        let raised = Rc::clone(&lift);
        let then = Rc::new(move |can| lift(then(can)));
        let drawn = Rc::new(move |ms| raised(drawn(ms)));
        Solid { canvas, mesh, matrix, light, tones, ring, is_still, then, drawn }
    }
}

/// The parts of an address that identify a page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Address {
    /// Scheme and host, such as `http://127.0.0.1:8080`.
    pub origin: String,
    /// Path, such as `/s/default`.
    pub path: String,
    /// The raw query, with its `?`; empty if there is none.
    pub search: String,
    /// Query, decoded.
    pub query: Vec<(String, String)>,
    /// The fragment, after `#`.
    pub fragment: String,
}

impl Address {
    /// The value of a query parameter.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }
}

/// Percent-encodes a text for a query: everything but letters, digits and `-._~`.
#[must_use]
pub fn encoded(text: &str) -> String {
    let mut encoded = String::new();
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            encoded.push(char::from(byte));
        } else {
            encoded.push_str(&format!("%{byte:02X}"));
        }
    }
    encoded
}

/// Context of a page when it opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageContext {
    /// The page's address.
    pub address: Address,
    /// Records that pages of this origin have stored in this browser, by name.
    pub kept: Vec<(String, String)>,
    /// Why this browser stores nothing, if so.
    pub not_kept: Option<NotKept>,
    /// The user's languages, such as `en-GB`, in order of preference.
    pub languages: Vec<String>,
    /// Whether a finger is the only pointer, as on a phone or tablet. Browsers do not tell whether
    /// there is a keyboard.
    pub touch_only: bool,
    /// Whether the user prefers reduced motion.
    pub reduced_motion: bool,
    /// Width, height and pixel ratio of screen and window.
    pub screen: Vec<(&'static str, f64)>,
    /// Zero of the page's clock, ms since 1970.
    pub time_origin_ms: f64,
    /// A random name, unguessable and unique to this visit; `None` if the browser provides no
    /// random numbers.
    pub random_name: Option<String>,
}

/// Commands, executed in order.
pub type Commands<M> = Vec<Command<M>>;

/// The message that an outcome becomes.
pub type Then<T, M> = Box<dyn FnOnce(T) -> M>;

/// A command of a page to the browser.
///
/// Requests, timers and solves have names. Starting one under a name in use cancels the earlier
/// one, whose outcome then never arrives.
pub enum Command<M> {
    /// Send a request.
    Send(Request<M>),
    /// Send a message after this time.
    Wake {
        /// Name of the timer.
        timer: &'static str,
        /// Delay, ms.
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
        /// The message of each report; the last report is a solution or a failure.
        then: Rc<dyn Fn(Solving) -> M>,
    },
    /// Send a message to an evaluator. It is a function, so that programs without evaluators
    /// contain no code for its result: every participant downloads one.
    Evaluate(Box<dyn FnOnce() -> Evaluate<M>>),
    /// Send a message now, and whenever the server reports a change. The connection is closed while
    /// the page is hidden; when it is shown again, the message is sent at once.
    Follow {
        /// Its name, as of a request.
        name: &'static str,
        /// Address of the server's events on this origin.
        url: &'static str,
        /// The message.
        then: Rc<dyn Fn() -> M>,
    },
    /// Cancel the request, timer, solve, evaluator or following of this name.
    Cancel(&'static str),
    /// Cancel everything in progress.
    CancelAll,
    /// Store a text in this browser. Once reported as stored, it survives a crash. Texts of one
    /// name are stored in the order of these commands.
    Keep {
        /// Its name.
        name: String,
        /// The text.
        text: String,
        /// The message once it is stored or that has failed.
        then: Then<Result<(), NotKept>, M>,
    },
    /// Delete the text of this name.
    Forget(String),
    /// Claim a name for this tab only. Every other tab of this browser with the same claim loses it
    /// and receives [`Event::TakenOver`].
    TakeOver(String),
    /// Set the page's language.
    Language(String),
    /// Turn on or off the confirmation for users who leave the page.
    GuardLeaving(bool),
    /// Enter or leave full screen. The browser allows it only when a key or button was pressed.
    Fullscreen(bool),
    /// Offer something for download. It is a function for the same reason as in [`Self::Evaluate`].
    Offer(Box<dyn FnOnce() -> Offer<M>>),
    /// Replace the address without loading it.
    ReplaceAddress(String),
    /// Show another address of this page as if a link to it had been followed.
    Visit(String),
    /// Navigate to another address.
    Leave(String),
}

/// Something to offer for download.
pub enum Offer<M> {
    /// A file.
    File {
        /// Its name.
        name: String,
        /// Its media type.
        media_type: &'static str,
        /// Its content.
        content: Vec<u8>,
    },
    /// A film of a canvas, recorded from now on. Cancelling its name discards it.
    Film {
        /// Its name, as of a request.
        name: &'static str,
        /// The canvas element's id.
        canvas: &'static str,
        /// Name of the file.
        file: String,
        /// The message once it is offered, or the reason for the failure.
        then: Rc<dyn Fn(Result<(), String>) -> M>,
    },
    /// Ends the recording of this name.
    EndOfFilm(&'static str),
}

/// A message to the evaluator of a name. The evaluator is started if there is none, and runs until
/// it is cancelled.
pub struct Evaluate<M> {
    /// Its name.
    pub name: &'static str,
    /// The part of the input.
    pub part: Part,
    /// Its content.
    pub content: Vec<u8>,
    /// The message for each report. Only that of the command that started the evaluator is used.
    pub then: Rc<dyn Fn(Answer) -> M>,
}
/// Media type for an [`Offer::File`] with SVG content that is converted to a PNG image of twice its
/// nominal size.
pub const PNG_OF_SVG: &str = "image/png; from svg";

/// A request to the server.
pub struct Request<M> {
    /// Its name; see [`Command`].
    pub name: &'static str,
    /// GET, POST, PUT or DELETE.
    pub method: &'static str,
    /// Address on this origin.
    pub url: String,
    /// Participant's token.
    pub token: Option<String>,
    /// JSON.
    pub body: Option<String>,
    /// Turns the answer into a message.
    pub then: Then<Answer, M>,
}

impl<M> Request<M> {
    /// A request without token and body.
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
    /// Offers this for download.
    #[must_use]
    pub fn offer(offer: Offer<M>) -> Self {
        Self::Offer(Box::new(move || offer))
    }

    /// Maps its messages to those of a page that contains this one.
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

/// Why the browser did not store a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotKept {
    /// There is no room left for this site.
    Full,
    /// The browser stores nothing for this site, in a private window for example.
    Denied,
}

impl NotKept {
    /// A sentence for people.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Full => "This browser has no storage left for this site.",
            Self::Denied => "This browser does not let this site store anything.",
        }
    }
}

/// Outcome of a request: the body of a 2xx response, or a failure.
pub type Answer = Result<Vec<u8>, Failure>;

/// Why a request failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Status of the refusal; 0 if the server could not be reached.
    pub status: u16,
    /// The server's error code; empty if it gave none.
    pub code: String,
    /// A sentence for people.
    pub sentence: String,
    /// Where to send a participant whose participation has ended.
    pub return_url: Option<String>,
}

impl Failure {
    /// The server could not be reached.
    #[must_use]
    pub fn unreachable() -> Self {
        let sentence = "The server cannot be reached. Check the internet connection.";
        Self { status: 0, code: String::new(), sentence: sentence.to_owned(), return_url: None }
    }

    /// Whether the same request may succeed later.
    #[must_use]
    pub fn is_temporary(&self) -> bool {
        self.status >= 500 || matches!(self.status, 0 | 408 | 429)
    }
}

/// Interprets a response of the server.
///
/// # Errors
/// [`Failure`] if the server refused.
pub fn answer(status: u16, body: Vec<u8>) -> Answer {
    if (200..300).contains(&status) {
        return Ok(body);
    }
    Err(match crate::json::read::<Problem>(&body) {
        Some(Problem { code, message, return_url, .. }) => {
            Failure { status, code, sentence: sentence(message), return_url }
        }
        None => {
            let sentence = format!("The server answered with status {status}.");
            Failure { status, code: String::new(), sentence, return_url: None }
        }
    })
}

/// Parses the body of an answer.
///
/// # Errors
/// [`Failure`] if the server was not reached, refused, or sent something this page cannot read.
pub fn read<T: serde::de::DeserializeOwned>(answer: Answer) -> Result<T, Failure> {
    crate::json::read(&answer?).ok_or_else(|| Failure {
        status: 200,
        code: String::new(),
        sentence: "This page cannot read the server's answer. Please reload it.".to_owned(),
        return_url: None,
    })
}

/// A report of a solver beside the page.
#[derive(Clone, Debug, PartialEq)]
pub enum Solving {
    /// Progress, 0 … 1.
    Done(f64),
    /// The bytes of the value function.
    Solved(Vec<u8>),
    /// There is no solution, for this reason.
    Failed(String),
}

/// Capitalizes a message and adds a full stop: the server's messages have neither.
fn sentence(mut message: String) -> String {
    if let Some(first) = message.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    if !message.ends_with(['.', '!', '?']) {
        message.push('.');
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_read_or_says_why_not() {
        let received = |status, body: &[u8]| answer(status, body.to_vec());
        assert_eq!(read(received(200, b"[1,2]")), Ok(vec![1, 2]));
        assert!(read::<Vec<u32>>(received(200, b"[1,")).is_err());
        let said = |message: &str| {
            let problem = format!(r#"{{"code":"busy","message":"{message}"}}"#);
            received(503, problem.as_bytes()).unwrap_err()
        };
        let full = said("the queue is full");
        assert!(full.is_temporary());
        assert_eq!((full.status, full.code.as_str()), (503, "busy"));
        assert_eq!(full.sentence, "The queue is full.");
        assert_eq!(said("Signed out.").sentence, "Signed out.");
        assert_eq!(said("ω is not finite").sentence, "ω is not finite.");
        let unknown = received(418, b"<html>").unwrap_err();
        assert!(!unknown.is_temporary() && unknown.sentence.contains("418"));
        assert!(Failure::unreachable().is_temporary());
    }
}
