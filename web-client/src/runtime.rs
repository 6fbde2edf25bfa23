//! The interface between a page and the browser. The page takes messages of its own type and
//! returns commands. The outcome of a command becomes a message.

mod address;
mod answer;
mod command;

pub use self::address::{Address, encoded};
pub use self::answer::{Answer, Failure, answer, read};
pub use self::command::{
    Command, Commands, Evaluate, NotKept, Offer, PNG_OF_SVG, Request, Solving, Then,
};
use crate::view::Node;
use sidestep::picture::Picture;
use sidestep::value_view::Mesh;
use std::rc::Rc;

/// A page is a state machine with its own message type. It never blocks and never uses the
/// browser's API, so tests can run it natively.
pub trait Page {
    /// The type of the page's messages.
    type Msg: Clone + 'static;

    /// Whether the page has several addresses. This function and the following ones do not take
    /// `self`, so that the compiler can remove code that a page does not need. This matters because
    /// every participant downloads the program.
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

    /// Whether the page can show a second picture. If not, [`Page::draw_beside`] is never called.
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

    /// Whether the page computes in workers. If not, [`Command::Solve`] and [`Command::Evaluate`]
    /// have no effect.
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

    /// The time of the next change that depends only on the clock (ms on the page's clock).
    /// [`Self::tick`] is called at that time, whatever the frame rate.
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

    /// Records a frame shown at `at_ms`, and the time spent on its work.
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
    /// The window lost the keyboard focus. From now on, no key counts as held, because the browser
    /// no longer reports when keys are released.
    FocusLost {
        /// Whether the page is hidden, for example behind another tab.
        hidden: bool,
    },
    /// The window regained keyboard focus.
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
    /// edited the address. If the page wants the message, the browser keeps the document.
    Address(Address),
}

/// A mesh of triangles on its own canvas. The canvas is transparent around the mesh.
pub struct Solid<M> {
    /// Id of the canvas element.
    pub canvas: &'static str,
    /// The triangles. A changed mesh has a new pointer.
    pub mesh: Rc<Mesh>,
    /// Matrix from the mesh's coordinates to clip coordinates, in column-major order.
    pub matrix: [f32; 16],
    /// The direction of the light, as a unit vector in the space of the normals.
    pub light: [f32; 3],
    /// The colours of the solid in shadow, in half light and in bright light.
    pub tones: [[u8; 3]; 3],
    /// Spacing of the rings on the surface, in the unit of the mesh's third coordinate.
    pub ring: f32,
    /// Whether the solid is at rest. If so, it is drawn with more pixels.
    pub is_still: bool,
    /// Creates the message about whether the browser can draw the solid. False means that it cannot
    /// draw solids at all or that the graphics context is lost. True means that it can draw again.
    pub then: Rc<dyn Fn(bool) -> M>,
    /// Creates the message about the duration of a frame while the solid rotates (ms). The message
    /// is sent after a mesh is drawn for the first time.
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

/// What a page knows when it opens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PageContext {
    /// The page's address.
    pub address: Address,
    /// Records that pages of this origin have stored in this browser, by name.
    pub kept: Vec<(String, String)>,
    /// The reason why this browser cannot store records, if it cannot.
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
    /// The origin of the page's clock (ms since 1970).
    pub time_origin_ms: f64,
    /// A random name that is unique to this visit and cannot be guessed. `None` if the browser
    /// provides no random numbers.
    pub random_name: Option<String>,
}
