//! How a page and the browser talk: the page takes messages of its own type and answers with
//! commands, each of which says which message its outcome becomes.

use crate::evaluation::Part;
use crate::task::Task;
use crate::view::Node;
use sidestep::api::Problem;
use sidestep::picture::Picture;
use sidestep::value_view::Mesh;
use std::rc::Rc;

/// A page: a state machine with a message type of its own. It never waits and never touches
/// the browser, so that tests run it natively.
pub trait Page {
    /// What it can be told.
    type Msg: Clone + 'static;

    /// Whether it has several addresses. A function without a page, so that the compiler leaves
    /// out of a program what its page does not need: every participant downloads it.
    #[must_use]
    fn navigates() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it shows solids; else [`Page::solid`] is never asked.
    #[must_use]
    fn shows_solids() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it may show a second picture; else [`Page::draw_beside`] is never asked.
    #[must_use]
    fn has_panes() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it looks at what pointers do; else [`Node::on_point`] does
    /// nothing.
    #[must_use]
    fn points() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it has programs beside it that compute; else [`Command::Solve`] and [`Command::Evaluate`] do
    /// nothing.
    #[must_use]
    fn solves() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it offers and opens files; else [`Command::Offer`] does nothing, and fields for files hold no
    /// content.
    #[must_use]
    fn offers_files() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether it keeps something in this browser; else it opens without asking what is kept.
    #[must_use]
    fn keeps() -> bool
    where
        Self: Sized,
    {
        true
    }

    /// Whether it follows changes; else [`Command::Follow`] does nothing.
    #[must_use]
    fn follows() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether keys are short cuts: a control that has the keyboard keeps the keys that it needs, and the
    /// page hears all others, again and again while they are held. Else the page hears all keys once.
    #[must_use]
    fn has_short_cuts() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Takes a message and says what is to be done. `now_ms` is when the message's cause
    /// happened, on the page's clock.
    fn update(&mut self, message: Self::Msg, now_ms: f64) -> Commands<Self::Msg>;

    /// What to show.
    fn view(&self) -> Node<Self::Msg>;

    /// The document's title.
    fn title(&self) -> String;

    /// The message that something outside of the view becomes, if the page wants to know.
    fn hear(&self, _event: &Event) -> Option<Self::Msg> {
        None
    }

    /// When something happens by the clock alone, on the page's clock, ms: [`Self::tick`] is
    /// called then, however few frames are shown.
    fn due_ms(&self) -> Option<f64> {
        None
    }

    /// Computes what follows from the clock alone up to `now_ms`. It is called when that is due
    /// and in every frame. Returns a message if more changes than the picture. A call that returns
    /// none allocates nothing.
    fn tick(&mut self, _now_ms: f64) -> Option<Self::Msg> {
        None
    }

    /// Whether the page wants frames; else the picture is painted after messages only.
    fn wants_frames(&self) -> bool {
        false
    }

    /// Puts what there is to see at `at_ms`, on the page's clock, into `picture`, which holds
    /// what was painted last. Returns whether there is a canvas.
    fn draw(&self, _at_ms: f64, _picture: &mut Picture) -> bool {
        false
    }

    /// As [`Self::draw`], for a second picture on a canvas of its own beside the first.
    fn draw_beside(&self, _at_ms: f64, _picture: &mut Picture) -> bool {
        false
    }

    /// The solid that there is to see, if there is one. It is drawn after every message.
    fn solid(&self) -> Option<Solid<Self::Msg>> {
        None
    }

    /// Whether the key at this place (see [`Event::Key`]) belongs to the page, so that the browser
    /// does not scroll on it.
    fn owns_key(&self, _code: &str) -> bool {
        false
    }

    /// Takes note of a frame that was shown at `at_ms`, and of how long its work took.
    fn frame_shown(&mut self, _at_ms: f64, _work_ms: f64) {}
}

/// Something that happens outside of what a page shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A key went down or up (repeats are left out).
    Key {
        /// Its place on the keyboard, such as `ArrowLeft` or `KeyA`: the same on every layout.
        code: String,
        /// What it types, or its name: what is printed on it.
        key: String,
        /// Down or up.
        down: bool,
    },
    /// The window lost the keyboard. No key counts as held from now on: the browser does not
    /// report when it is released.
    FocusLost {
        /// Whether the page is hidden, behind another tab for example.
        hidden: bool,
    },
    /// The window has the keyboard again.
    FocusGained,
    /// The page is no longer hidden.
    Shown,
    /// The window has another size, or is shown at another zoom.
    Resized {
        /// Width inside the window, CSS pixels.
        width_px: f64,
        /// Height inside the window, CSS pixels.
        height_px: f64,
        /// Pixels of the screen to a CSS pixel.
        ratio: f64,
    },
    /// The page fills the screen, or no longer does.
    Fullscreen(bool),
    /// The network is back.
    Online,
    /// Another tab has taken over what this one had; see [`Command::TakeOver`].
    TakenOver,
    /// Another address is to be shown: a link was pressed, the user went back or forward, or
    /// edited the address. The document stays if the page wants the message.
    Address(Address),
}

/// Triangles on a canvas of their own, transparent around them.
pub struct Solid<M> {
    /// The canvas element's id.
    pub canvas: &'static str,
    /// The triangles; another mesh has another pointer.
    pub mesh: Rc<Mesh>,
    /// From the mesh's coordinates to clip coordinates, column by column.
    pub matrix: [f32; 16],
    /// The direction from which light falls, of length 1, in the space of the normals.
    pub light: [f32; 3],
    /// Its tones in shadow, in half light and in bright light.
    pub tones: [[u8; 3]; 3],
    /// Difference of the mesh's third coordinate between two rings on the surface.
    pub ring: f32,
    /// Whether it is looked at and not being turned: worth more pixels.
    pub is_still: bool,
    /// The message when the browser does not draw it (false), because it never could or has lost its graphics
    /// for a while, and when it can again (true).
    pub then: Rc<dyn Fn(bool) -> M>,
    /// The message when another mesh was drawn: how long a picture of it takes while it turns, ms.
    pub drawn: Rc<dyn Fn(f64) -> M>,
}

impl<M: 'static> Solid<M> {
    /// The same with the messages of a page that this one is part of.
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

/// The part of an address that tells pages apart.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Address {
    /// Scheme and host, such as `http://127.0.0.1:8080`.
    pub origin: String,
    /// Path, such as `/s/default`.
    pub path: String,
    /// The query as it is written, with its `?`; empty if there is none.
    pub search: String,
    /// Query, decoded.
    pub query: Vec<(String, String)>,
    /// What follows `#`.
    pub fragment: String,
}

impl Address {
    /// The value of a name in the query.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }
}

/// A text as part of a query: everything but letters, digits and `-._~` as `%XX`.
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

/// What a page knows of the browser when it opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageContext {
    /// Where it was opened.
    pub address: Address,
    /// What pages of this origin have kept in this browser, by name.
    pub kept: Vec<(String, String)>,
    /// Why this browser keeps nothing, if so.
    pub not_kept: Option<NotKept>,
    /// The user's languages, such as `en-GB`, the preferred one first.
    pub languages: Vec<String>,
    /// Whether there is only a finger to point with, as on a telephone or tablet. Whether there
    /// is a keyboard, a browser does not tell.
    pub touch_only: bool,
    /// Whether the user wants little motion.
    pub reduced_motion: bool,
    /// Width, height and pixel ratio of screen and window.
    pub screen: Vec<(&'static str, f64)>,
    /// Zero of the page's clock, ms since 1970.
    pub time_origin_ms: f64,
    /// A name that nobody guesses and no other visit has; nothing if the browser draws none.
    pub random_name: Option<String>,
}

/// What is to be done, in order.
pub type Commands<M> = Vec<Command<M>>;

/// The message that an outcome becomes.
pub type Then<T, M> = Box<dyn FnOnce(T) -> M>;

/// What a page asks for.
///
/// Requests, timers and solves have names. One that is started under the name of one that is
/// under way takes its place: the outcome of the former never arrives.
pub enum Command<M> {
    /// Send a request.
    Send(Request<M>),
    /// Send a message after this time.
    Wake {
        /// Name of the timer.
        timer: &'static str,
        /// How long, ms.
        after_ms: f64,
        /// The message.
        message: M,
    },
    /// Solve a game beside the page.
    Solve {
        /// Name of the solve.
        name: &'static str,
        /// What is to be found.
        task: Task,
        /// The message of each report; the last report is a solution or a failure.
        then: Rc<dyn Fn(Solving) -> M>,
    },
    /// Tell an evaluator something. It is a function, so that programs without evaluators hold no code for
    /// what it returns: every participant downloads one.
    Evaluate(Box<dyn FnOnce() -> Evaluate<M>>),
    /// Send a message at once, and whenever the server says that something has changed. The server is
    /// not asked while the page is hidden, and again at once when it is shown.
    Follow {
        /// Its name, as of a request.
        name: &'static str,
        /// Address of the server's events on this origin.
        url: &'static str,
        /// The message.
        then: Rc<dyn Fn() -> M>,
    },
    /// Give up the request, timer, solve, evaluator or following of this name.
    Cancel(&'static str),
    /// Give up everything that is under way.
    CancelAll,
    /// Keep a text in this browser. What it has reported as kept is still there after a crash.
    /// Texts of one name are kept in the order of these commands.
    Keep {
        /// Its name.
        name: String,
        /// The text.
        text: String,
        /// The message once it is kept, or once that has failed.
        then: Then<Result<(), NotKept>, M>,
    },
    /// Forget what is kept under a name.
    Forget(String),
    /// Have alone what goes by this name. Every other tab of this browser that has it hears
    /// [`Event::TakenOver`]: of two tabs, the later one has it.
    TakeOver(String),
    /// The page is in this language from now on.
    Language(String),
    /// Ask users who leave the page whether they want to, or no longer.
    GuardLeaving(bool),
    /// Fill the screen, or no longer. The browser does so only when a key or button was pressed.
    Fullscreen(bool),
    /// Offer something for download. It is a function for the same reason as with [`Self::Evaluate`].
    Offer(Box<dyn FnOnce() -> Offer<M>>),
    /// Replace the address without loading it.
    ReplaceAddress(String),
    /// Show another address of this page as if a link to it had been pressed.
    Visit(String),
    /// Leave for another address.
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
    /// A film of a canvas, which begins now. It is discarded if its name is cancelled.
    Film {
        /// Its name, as of a request.
        name: &'static str,
        /// The canvas element's id.
        canvas: &'static str,
        /// Name of the file.
        file: String,
        /// The message once it is offered, or the sentence why there is none.
        then: Rc<dyn Fn(Result<(), String>) -> M>,
    },
    /// The film of this name, which ends now.
    EndOfFilm(&'static str),
}

/// Something to tell the evaluator of a name. It is started if there is none, and lives until it is
/// cancelled.
pub struct Evaluate<M> {
    /// Its name.
    pub name: &'static str,
    /// What it is told.
    pub part: Part,
    /// The content of that.
    pub content: Vec<u8>,
    /// The message of each of its reports: that of the command which started it.
    pub then: Rc<dyn Fn(Answer) -> M>,
}
/// The media type of an [`Offer::File`] whose content is SVG, and which is to be a PNG image, twice as
/// large as the SVG says.
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
    /// The message that the answer becomes.
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

    /// The same with the messages of a page that this one is part of.
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

/// Why the browser did not keep a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotKept {
    /// There is no room left for this site.
    Full,
    /// The browser keeps nothing for this site, in a private window for example.
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

/// What came of a request: the body of a 2xx answer, or why there is none.
pub type Answer = Result<Vec<u8>, Failure>;

/// Why a request brought nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Status of the refusal; 0 if the server could not be reached.
    pub status: u16,
    /// The server's word for what is wrong; empty if it gave none.
    pub code: String,
    /// A sentence for people.
    pub sentence: String,
    /// Where a participant whose participation has ended goes back to.
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

/// The answer that a response of the server is.
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

/// The value that the body of an answer holds.
///
/// # Errors
/// [`Failure`] if the server was not reached, refused, or sent what this page cannot read.
pub fn read<T: serde::de::DeserializeOwned>(answer: Answer) -> Result<T, Failure> {
    crate::json::read(&answer?).ok_or_else(|| Failure {
        status: 200,
        code: String::new(),
        sentence: "This page cannot read the server's answer. Please reload it.".to_owned(),
        return_url: None,
    })
}

/// What a solver beside the page reports.
#[derive(Clone, Debug, PartialEq)]
pub enum Solving {
    /// This share is done, 0 … 1.
    Done(f64),
    /// The bytes of the value function.
    Solved(Vec<u8>),
    /// There is no solution, for this reason.
    Failed(String),
}

/// A message with a capital letter and a full stop: the server's have neither.
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
