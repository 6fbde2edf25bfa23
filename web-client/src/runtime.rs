//! How a page and the browser talk: a closed set of events in, a closed set of
//! commands out.

use crate::shape::Picture;
use crate::view::Node;
use sidestep::reachability::PursuitGame;
use sidestep::scene::Evader;

/// What a page is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The page has been opened.
    Opened(Surroundings),
    /// A frame is about to be shown; ms on the page's clock.
    Frame(f64),
    /// A key went down or up (repeats are left out); ms on the page's clock.
    Key {
        /// When.
        t_ms: f64,
        /// Its name, such as `ArrowLeft`.
        key: String,
        /// Down or up.
        down: bool,
    },
    /// The window lost the keyboard, or the page was hidden.
    Blur(f64),
    /// Something with that word was pressed, or a form with it submitted; the
    /// value is that of the control, or of the form's first field.
    Action {
        /// The word.
        word: String,
        /// Text of the control.
        value: String,
        /// When, ms on the page's clock.
        t_ms: f64,
    },
    /// A request was answered, or could not be sent.
    Answered(Tag, Answer),
    /// How the solve of this vehicle's safety level goes.
    Solving(Evader, Solving),
    /// The time that a page asked to be woken after is over.
    Woken,
}

/// What is known when a page opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Path of the address, such as `/s/default`.
    pub path: String,
    /// Query of the address, decoded.
    pub query: Vec<(String, String)>,
    /// What follows `#` in the address.
    pub fragment: String,
    /// What pages of this origin have kept in this browser, by name.
    pub kept: Vec<(String, String)>,
    /// Language, such as `en-GB`.
    pub locale: String,
    /// Width, height and pixel ratio of screen and window.
    pub screen: Vec<(&'static str, f64)>,
    /// Zero of the page's clock, ms since 1970.
    pub time_origin_ms: f64,
}

/// Which request is answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tag {
    /// The study.
    Study,
    /// Where the participant is.
    Me,
    /// Enrolment.
    Enrol,
    /// A trial's upload.
    Upload(String),
    /// Completion.
    Complete,
    /// Whether the laboratory is open, or the answer to a sign-in or -out.
    Session,
    /// All studies.
    Studies,
    /// Stored trials of a study.
    Trials,
    /// One stored trial.
    Trial,
    /// The value function of this vehicle's safety level.
    ValueFunction(Evader),
    /// The trained predictor.
    Predictor,
    /// The server's fingerprint.
    SelfCheck,
}

/// What came of a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The server answered.
    Received {
        /// Status code.
        status: u16,
        /// Octets of the body.
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
        crate::json::read(self.octets()?).ok_or_else(|| Failure::Refused {
            status: 200,
            problem: sidestep::api::Problem {
                code: "unreadable".to_owned(),
                message: "The server's answer cannot be read. Please reload the page.".to_owned(),
                field: None,
            },
        })
    }

    /// The octets of a 2xx answer.
    ///
    /// # Errors
    /// [`Failure`] if the server was not reached or refused.
    pub fn octets(&self) -> Result<&[u8], Failure> {
        match self {
            Self::Unreachable => Err(Failure::Unreachable),
            Self::Received { status: 200..=299, body } => Ok(body),
            Self::Received { status, body } => {
                let unknown = || sidestep::api::Problem {
                    code: "unknown".to_owned(),
                    message: format!("The server answered with status {status}."),
                    field: None,
                };
                let problem = crate::json::read(body).unwrap_or_else(unknown);
                Err(Failure::Refused { status: *status, problem })
            }
        }
    }
}

/// What a solver beside the page says.
#[derive(Clone, Debug, PartialEq)]
pub enum Solving {
    /// So much is done, 0 … 1.
    Done(f64),
    /// The octets of the value function.
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
        problem: sidestep::api::Problem,
    },
}

impl Failure {
    /// Whether the same request may succeed later.
    #[must_use]
    pub fn is_passing(&self) -> bool {
        match self {
            Self::Unreachable => true,
            Self::Refused { status, .. } => *status >= 500 || matches!(status, 408 | 429),
        }
    }

    /// A sentence for people.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Unreachable => "The server cannot be reached. Check the connection.".to_owned(),
            Self::Refused { problem, .. } => problem.message.clone(),
        }
    }
}

/// What a page asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Send a request; [`Event::Answered`] follows.
    Send(Request),
    /// Solve a game beside the page; [`Event::Solving`] follows, until it is solved or
    /// failed.
    Solve {
        /// Whose safety level it is.
        evader: Evader,
        /// The game.
        game: PursuitGame,
    },
    /// Give up whatever is being solved.
    StopSolving,
    /// Keep a text in this browser under a name.
    Keep(String, String),
    /// Forget what is kept under a name.
    Forget(String),
    /// Send [`Event::Woken`] after so many ms.
    WakeAfter(f64),
    /// Replace the address without loading it.
    ReplaceAddress(String),
    /// Go to another address.
    GoTo(String),
}

/// A request to the server.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Names the answer.
    pub tag: Tag,
    /// GET, POST, PUT or DELETE.
    pub method: &'static str,
    /// Address on this origin.
    pub url: String,
    /// Participant's token.
    pub token: Option<String>,
    /// JSON.
    pub body: Option<String>,
}

impl Request {
    /// A request without token and body.
    #[must_use]
    pub fn get(tag: Tag, url: impl Into<String>) -> Self {
        Self { tag, method: "GET", url: url.into(), token: None, body: None }
    }
}

/// A page.
pub trait App {
    /// Takes an event and says what is to be done. Never waits.
    fn handle(&mut self, event: Event) -> Vec<Command>;

    /// What to show.
    fn view(&self) -> Node;

    /// What to draw, if there is a canvas.
    fn picture(&self) -> Option<Picture>;

    /// Whether frames are wanted; else the page is redrawn after events only.
    fn wants_frames(&self) -> bool;

    /// Whether a key belongs to the page, so that the browser does not scroll on it.
    fn owns_key(&self, key: &str) -> bool;

    /// Takes note of how long the work of a frame took, ms.
    fn frame_took(&mut self, _ms: f64) {}
}
