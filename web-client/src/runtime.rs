//! How a page and the browser talk: the page takes messages of its own type and answers with
//! commands, each of which says which message its outcome becomes.

use crate::shape::Picture;
use crate::view::Node;
use sidestep::api::Problem;
use sidestep::reachability::PursuitGame;
use std::rc::Rc;

/// A page: a state machine with a message type of its own. It never waits and never touches
/// the browser, so that tests drive it natively.
pub trait Page {
    /// What it can be told.
    type Msg: Clone + 'static;

    /// Whether it has several addresses. The adapter leaves out what a page does not need:
    /// every participant downloads it.
    const NAVIGATES: bool = false;

    /// Whether it solves games; else [`Command::Solve`] does nothing.
    const SOLVES: bool = false;

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

    /// What to draw, if there is a canvas.
    fn picture(&self) -> Option<Picture> {
        None
    }

    /// Whether the page wants [`Event::Frame`]s; else it is redrawn after messages only.
    fn wants_frames(&self) -> bool {
        false
    }

    /// Whether a key belongs to the page, so that the browser does not scroll on it.
    fn owns_key(&self, _key: &str) -> bool {
        false
    }

    /// Takes note of how long the work of a frame took, ms.
    fn frame_took(&mut self, _ms: f64) {}
}

/// Something that happens outside of what a page shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A frame is about to be shown.
    Frame,
    /// A key went down or up (repeats are left out).
    Key {
        /// Its name, such as `ArrowLeft`.
        key: String,
        /// Down or up.
        down: bool,
    },
    /// The window lost the keyboard, or the page was hidden.
    FocusLost,
    /// The network is back.
    Online,
    /// Another address is to be shown: a link was pressed, the user went back or forward, or
    /// edited the address. The document stays if the page wants the message.
    Address(Address),
}

/// The part of an address that tells pages apart.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Address {
    /// Path, such as `/s/default`.
    pub path: String,
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

/// What a page knows of the browser when it opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageContext {
    /// Where it was opened.
    pub address: Address,
    /// What pages of this origin have kept in this browser, by name.
    pub kept: Vec<(String, String)>,
    /// Language, such as `en-GB`.
    pub locale: String,
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
        /// The game.
        game: PursuitGame,
        /// The message of each report, the last of which is a solution or a failure.
        then: Rc<dyn Fn(Solving) -> M>,
    },
    /// Give up the request, timer or solve of this name.
    Cancel(&'static str),
    /// Give up everything that is under way.
    CancelAll,
    /// Keep a text in this browser.
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
    /// Replace the address without loading it.
    ReplaceAddress(String),
    /// Show another address of this page as if a link to it had been pressed.
    Visit(String),
    /// Leave for another address.
    Leave(String),
}

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
            Self::Solve { name, game, then } => {
                Command::Solve { name, game, then: Rc::new(move |solving| lift(then(solving))) }
            }
            Self::Cancel(name) => Command::Cancel(name),
            Self::CancelAll => Command::CancelAll,
            Self::Keep { name, text, then } => {
                Command::Keep { name, text, then: Box::new(move |kept| lift(then(kept))) }
            }
            Self::Forget(name) => Command::Forget(name),
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

/// What came of a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The server answered.
    Received {
        /// Status code.
        status: u16,
        /// Bytes of the body.
        body: Vec<u8>,
    },
    /// The server could not be reached.
    Unreachable,
}

impl Answer {
    /// The body of a 2xx answer, or what to tell the user.
    ///
    /// # Errors
    /// [`Failure`] if the server was not reached, refused, or sent what this
    /// page cannot read.
    pub fn read<T: serde::de::DeserializeOwned>(&self) -> Result<T, Failure> {
        crate::json::read(self.bytes()?).ok_or_else(|| Failure::Refused {
            status: 200,
            problem: Problem {
                code: "unreadable".to_owned(),
                message: "This page cannot read the server's answer. Please reload it.".to_owned(),
                field: None,
            },
        })
    }

    /// The bytes of a 2xx answer.
    ///
    /// # Errors
    /// [`Failure`] if the server was not reached or refused.
    pub fn bytes(&self) -> Result<&[u8], Failure> {
        match self {
            Self::Unreachable => Err(Failure::Unreachable),
            Self::Received { status: 200..=299, body } => Ok(body),
            Self::Received { status, body } => {
                let unknown = || Problem {
                    code: "unknown".to_owned(),
                    message: format!("The server answered with status {status}."),
                    field: None,
                };
                let problem = crate::json::read(body).unwrap_or_else(unknown);
                Err(Failure::Refused { status: *status, problem })
            }
        }
    }

    /// The status, if the server answered.
    #[must_use]
    pub fn status(&self) -> Option<u16> {
        match self {
            Self::Unreachable => None,
            Self::Received { status, .. } => Some(*status),
        }
    }
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

/// Why a request brought nothing.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The server could not be reached.
    Unreachable,
    /// The server said no.
    Refused {
        /// Status code.
        status: u16,
        /// Why.
        problem: Problem,
    },
}

impl Failure {
    /// Whether the same request may succeed later.
    #[must_use]
    pub fn is_temporary(&self) -> bool {
        match self {
            Self::Unreachable => true,
            Self::Refused { status, .. } => *status >= 500 || matches!(status, 408 | 429),
        }
    }

    /// Status of the refusal; 0 if the server could not be reached.
    #[must_use]
    pub fn status(&self) -> u16 {
        match self {
            Self::Unreachable => 0,
            Self::Refused { status, .. } => *status,
        }
    }

    /// The server's word for what is wrong; empty if it could not be reached.
    #[must_use]
    pub fn code(&self) -> &str {
        match self {
            Self::Unreachable => "",
            Self::Refused { problem, .. } => &problem.code,
        }
    }

    /// A sentence for people.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Unreachable => {
                "The server cannot be reached. Check the internet connection.".to_owned()
            }
            Self::Refused { problem, .. } => sentence(&problem.message),
        }
    }
}

/// A message with a capital letter and a full stop: the server's have neither.
fn sentence(message: &str) -> String {
    let mut sentence = message.to_owned();
    if let Some(first) = sentence.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    if !sentence.ends_with(['.', '!', '?']) {
        sentence.push('.');
    }
    sentence
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_the_server_become_sentences() {
        assert_eq!(sentence("the queue is full"), "The queue is full.");
        assert_eq!(sentence("Signed out."), "Signed out.");
        assert_eq!(sentence("ω is not finite"), "ω is not finite.");
    }

    #[test]
    fn an_answer_is_read_or_says_why_not() {
        let received = |status, body: &[u8]| Answer::Received { status, body: body.to_vec() };
        assert_eq!(received(200, b"[1,2]").read::<Vec<u32>>(), Ok(vec![1, 2]));
        assert!(received(200, b"[1,").read::<Vec<u32>>().is_err());
        let full = received(503, br#"{"code":"busy","message":"try again"}"#);
        let failure = full.bytes().unwrap_err();
        assert!(failure.is_temporary());
        assert_eq!((failure.status(), failure.code()), (503, "busy"));
        assert_eq!(failure.sentence(), "Try again.");
        let unknown = received(418, b"<html>").bytes().unwrap_err();
        assert!(!unknown.is_temporary() && unknown.sentence().contains("418"));
        assert!(Answer::Unreachable.bytes().unwrap_err().is_temporary());
    }
}
