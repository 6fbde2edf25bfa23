//! The interface between a page and the browser. The page takes messages of its own type and
//! returns commands. The outcome of a command becomes a message.

use crate::evaluation::Part;
use crate::task::Task;
use crate::view::Node;
use sidestep::api::Problem;
use sidestep::picture::Picture;
use sidestep::value_view::Mesh;
use std::rc::Rc;

/// A page is a state machine with its own message type. It never blocks and never uses the
/// browser's API, so tests can run it natively.
pub trait Page {
    /// The type of the page's messages.
    type Msg: Clone + 'static;

    /// Whether the page has several addresses. This and the following are associated functions, so
    /// that the compiler can remove code that a page does not need. Every participant downloads the
    /// program.
    #[must_use]
    fn navigates() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether the page shows solids. If not, [`Page::solid`] is never called.
    #[must_use]
    fn shows_solids() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether the page may show a second picture. If not, [`Page::draw_beside`] is never called.
    #[must_use]
    fn has_panes() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether the page uses pointer events. If not, [`Node::on_point`] has no effect.
    #[must_use]
    fn points() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether the page uses workers that compute. If not, [`Command::Solve`] and
    /// [`Command::Evaluate`] have no effect.
    #[must_use]
    fn solves() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether the page offers and opens files. If not, [`Command::Offer`] has no effect, and file
    /// fields have no content.
    #[must_use]
    fn offers_files() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether the page stores records in this browser. If not, it opens without reading any.
    #[must_use]
    fn keeps() -> bool
    where
        Self: Sized,
    {
        true
    }

    /// Whether the page follows changes on the server. If not, [`Command::Follow`] has no effect.
    #[must_use]
    fn follows() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether keys are shortcuts. If so, a focused control gets the keys that it needs, and the
    /// page receives all other keys, including repeats. If not, the page receives all keys, without
    /// repeats.
    #[must_use]
    fn has_short_cuts() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Handles a message and returns commands. `now_ms` is the time of the message's cause, on the
    /// page's clock.
    fn update(&mut self, message: Self::Msg, now_ms: f64) -> Commands<Self::Msg>;

    /// The view that the page shows.
    fn view(&self) -> Node<Self::Msg>;

    /// The document's title.
    fn title(&self) -> String;

    /// The message for an event outside the view, if the page wants it.
    fn hear(&self, _event: &Event) -> Option<Self::Msg> {
        None
    }

    /// When the next change by the clock alone is due (ms on the page's clock). [`Self::tick`] is
    /// called then, whatever the frame rate.
    fn due_ms(&self) -> Option<f64> {
        None
    }

    /// Computes the changes up to `now_ms` that depend only on the clock. Called when such a change
    /// is due and in every frame. Returns a message if more than the picture changes. A call that
    /// returns `None` must not allocate.
    fn tick(&mut self, _now_ms: f64) -> Option<Self::Msg> {
        None
    }

    /// Whether the page wants animation frames. If not, the picture is painted only after messages.
    fn wants_frames(&self) -> bool {
        false
    }

    /// Draws the scene at `at_ms` on the page's clock into `picture`, which still contains the last
    /// painted picture. Returns whether there is a canvas.
    fn draw(&self, _at_ms: f64, _picture: &mut Picture) -> bool {
        false
    }

    /// Like [`Self::draw`], but for a second picture with its own canvas.
    fn draw_beside(&self, _at_ms: f64, _picture: &mut Picture) -> bool {
        false
    }

    /// The solid to show, if any. It is drawn after every message.
    fn solid(&self) -> Option<Solid<Self::Msg>> {
        None
    }

    /// Whether the page uses the key with this code (see [`Event::Key`]). If so, the browser does
    /// not scroll when the key is pressed.
    fn owns_key(&self, _code: &str) -> bool {
        false
    }

    /// Records a frame shown at `at_ms`, and the duration of its work.
    fn frame_shown(&mut self, _at_ms: f64, _work_ms: f64) {}
}

/// An event from outside the view.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A key went down or up. Repeats are not reported, except for shortcuts.
    Key {
        /// Code of the key, such as `ArrowLeft` or `KeyA`; the same on every keyboard layout.
        code: String,
        /// The character that the key types, or the name of the key.
        key: String,
        /// Whether the key went down.
        down: bool,
    },
    /// The window lost the keyboard. From now on, no key counts as held, because the browser does
    /// not report when keys are released.
    FocusLost {
        /// Whether the page is hidden, for example behind another tab.
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
    /// The page fills the screen (true), or no longer does (false).
    Fullscreen(bool),
    /// The network is available again.
    Online,
    /// Another tab has taken over a claim of this tab; see [`Command::TakeOver`].
    TakenOver,
    /// Another address is requested, because the user followed a link, went back or forward, or
    /// edited the address. If the page wants the message, the document stays.
    Address(Address),
}

/// A mesh of triangles on its own canvas, which is transparent around them.
pub struct Solid<M> {
    /// Id of the canvas element.
    pub canvas: &'static str,
    /// The triangles. A changed mesh has a new pointer.
    pub mesh: Rc<Mesh>,
    /// Maps the mesh's coordinates to clip coordinates. In column-major order.
    pub matrix: [f32; 16],
    /// The direction of the light, as a unit vector in the space of the normals.
    pub light: [f32; 3],
    /// The colours of the solid in shadow, in half light and in bright light.
    pub tones: [[u8; 3]; 3],
    /// Spacing of the rings on the surface, in the unit of the mesh's third coordinate.
    pub ring: f32,
    /// Whether the solid is at rest. If so, it is drawn with more pixels.
    pub is_still: bool,
    /// The message when the browser can draw the solid again (true) or cannot draw it (false),
    /// either never or because the context is lost.
    pub then: Rc<dyn Fn(bool) -> M>,
    /// The message after the first drawing of a mesh, with the duration of a frame while the solid
    /// turns (ms).
    pub drawn: Rc<dyn Fn(f64) -> M>,
}

impl<M: 'static> Solid<M> {
    /// Maps the messages to the messages of a page that contains this solid.
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
    /// The raw query with its `?`. Empty if there is no query.
    pub search: String,
    /// The decoded query.
    pub query: Vec<(String, String)>,
    /// The fragment, without its `#`.
    pub fragment: String,
}

impl Address {
    /// The value of a query parameter.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }
}

/// Percent-encodes a text for a query. Encodes everything except letters, digits and `-._~`.
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

/// What a page knows when it opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageContext {
    /// The page's address.
    pub address: Address,
    /// Records that pages of this origin have stored in this browser, by name.
    pub kept: Vec<(String, String)>,
    /// Why this browser stores nothing.
    pub not_kept: Option<NotKept>,
    /// The user's languages, such as `en-GB`, in order of preference.
    pub languages: Vec<String>,
    /// Whether fingers are the only pointers, as on a phone or tablet. Browsers do not report
    /// whether there is a keyboard.
    pub touch_only: bool,
    /// Whether the user prefers reduced motion.
    pub reduced_motion: bool,
    /// Width and height of the screen and of the window, and the pixel ratio.
    pub screen: Vec<(&'static str, f64)>,
    /// The zero of the page's clock (ms since 1970).
    pub time_origin_ms: f64,
    /// A random name that is unique to this visit and cannot be guessed. `None` if the browser
    /// provides no random numbers.
    pub random_name: Option<String>,
}

/// Commands, executed in order.
pub type Commands<M> = Vec<Command<M>>;

/// Converts an outcome to a message.
pub type Then<T, M> = Box<dyn FnOnce(T) -> M>;

/// A command of a page to the browser.
///
/// Requests, timers and solves have names. Starting one under a name in use cancels the earlier
/// one, whose outcome then never arrives.
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
    /// evaluators, such as the participant's, contain no code for its result.
    Evaluate(Box<dyn FnOnce() -> Evaluate<M>>),
    /// Send a message now, and whenever the server reports a change. The connection is closed while
    /// the page is hidden. When the page is shown again, the message is sent immediately.
    Follow {
        /// The name under which this can be cancelled.
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
    /// loses it and receives [`Event::TakenOver`].
    TakeOver(String),
    /// Set the page's language.
    Language(String),
    /// Switch on or off that users must confirm before they leave the page.
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
    /// A film of a canvas, recorded from now on. Cancelling its name discards the film.
    Film {
        /// The name under which this can be cancelled.
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
/// Media type for an [`Offer::File`] with SVG content that is converted to a PNG image of twice its
/// nominal size.
pub const PNG_OF_SVG: &str = "image/png; from svg";

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

/// Why the browser did not store a text.
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

/// Outcome of a request: the body of a 2xx response, or the failure.
pub type Answer = Result<Vec<u8>, Failure>;

/// Why a request failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// HTTP status of the response. 0 if the server could not be reached.
    pub status: u16,
    /// The server's error code. Empty if the server gave none.
    pub code: String,
    /// An error message for people.
    pub sentence: String,
    /// Where to send a participant whose participation has ended.
    pub return_url: Option<String>,
}

impl Failure {
    /// The failure if the server could not be reached.
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

/// Interprets a response from the server.
///
/// # Errors
/// [`Failure`] if the status is not 2xx.
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

/// Capitalizes a message and adds a full stop, because the server's messages may have neither.
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
