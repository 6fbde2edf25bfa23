//! The value function of any game: maps, the solver's errors, optimal play from a clicked position,
//! and the sublevel set {V ≤ c} as a solid.

mod found;
mod keys;
mod pointing;
mod view;

use self::found::Found;
use self::keys::Key;
use super::parts;
use crate::form::{FieldValue, Pointing};
use crate::runtime::{Address, Command, Commands, Event, Offer, PNG_OF_SVG, Page, Solid, Solving};
use crate::task::Task;
use crate::view::Node;
use sidestep::chart::{Drawing, Layer};
use sidestep::reachability::{Method, ValueFunction};
use sidestep::value_view::{Map, Orbit, Play, RING, Shown, TONES, View, play, slices, tube};
use std::rc::Rc;

/// The page.
pub struct Reachability {
    view: View,
    /// Errors in the link and in fields, each with the name of the parameter and a message.
    misread: Vec<(String, String)>,
    /// The solve in progress: the time at which it started, on the page's clock (ms), and the
    /// fraction done.
    solving: Option<(f64, f64)>,
    /// The file that is being written: the fraction done, or the reason for the failure.
    writing: Option<Result<f64, String>>,
    /// The value function of `view`, or the previous value function while a new one is being
    /// solved.
    found: Option<Found>,
    /// The reason why there is no value function.
    missing: Option<String>,
    /// The position of the pointer (m), if the pointer has moved since the cross-hair moved.
    pointer: Option<[f64; 2]>,
    /// Optimal play from the cross-hair, or an error message.
    game: Option<Result<Play, String>>,
    /// While the pointer holds the tube: the position at which it grabbed the tube, and the viewing
    /// angles at that time.
    held: Option<([f32; 2], [i16; 2])>,
    /// Whether the browser can draw solids, and how long drawing one takes (ms), once it is
    /// measured.
    has_graphics: bool,
    frame_ms: Option<f64>,
    /// Whether the user wants the solid although drawing it is slow.
    insists: bool,
    /// Whether the view has changed very recently.
    moves: bool,
    /// Width of the window (px).
    window_px: f64,
}

/// Messages to the page.
#[derive(Clone, Debug)]
pub enum Msg {
    /// The control for this link parameter has a new value.
    Set(&'static str, FieldValue),
    /// A report from the solver.
    Solving(Solving),
    /// Stops solving.
    Stop,
    /// Solves again after a stop or a failure.
    Again,
    /// A pointer action on the map.
    Point(Pointing),
    /// A pointer action on the tube.
    Hold(Pointing),
    /// Whether the browser can draw solids.
    Graphics(bool),
    /// The browser has drawn a solid in this time (ms).
    Drawn(f64),
    /// Draws the solid although it is slow.
    Insist,
    /// A key was pressed.
    Key(Key),
    /// Starts or ends optimal play from the cross-hair.
    Play,
    /// Updates the link to the current view.
    Link,
    /// The window now has this width (px).
    Width(f64),
    /// Offers the picture as SVG.
    SaveSvg,
    /// Offers the picture as PNG.
    SavePng,
    /// Offers the value function as a NumPy archive.
    SaveNpz,
    /// A report from the solver that writes the archive.
    Writing(Solving),
}

/// Name of the solve for the page.
const SOLVE: &str = "value-function";
/// Name of the solve whose result is a file.
const FILE: &str = "value-function-file";
const LINK: &str = "link";
/// The link is updated after this time without changes (ms), because browsers limit how often a
/// page may change its address.
const LINK_AFTER_MS: f64 = 250.0;
/// Id of the canvas element.
const CANVAS: &str = "solid";
/// Maximum drawing time (ms) at which a solid still rotates smoothly.
const SLOW_MS: f64 = 50.0;
/// Maximum width of the tube's picture (px), and its height as a fraction of the width. In a wider
/// space, the picture is enlarged. In a narrower space, the picture shrinks, but its text does not.
const SOLID_PX: f64 = 640.0;
const SOLID_HEIGHT: f64 = 0.75;

impl Reachability {
    /// Creates the page that the address describes, and its first commands.
    #[must_use]
    pub fn open(address: &Address, window_px: f64) -> (Self, Commands<Msg>) {
        let query = address.query.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let (view, refused) = View::of_query(query);
        let misread = refused
            .map(|invalid| format!("The link is not valid: {invalid}."))
            .or_else(|| parts::unknown(address, &[&View::NAMES]))
            .map(|why| ("link".to_owned(), why));
        let mut page = Self {
            view,
            misread: misread.into_iter().collect(),
            solving: None,
            writing: None,
            found: None,
            missing: None,
            pointer: None,
            game: None,
            held: None,
            has_graphics: true,
            frame_ms: None,
            insists: false,
            moves: false,
            window_px,
        };
        let commands = page.begin(0.0);
        page.replay();
        (page, commands)
    }

    /// Gets the value function of the view. A closed form is available immediately. Otherwise, a
    /// worker solves the game.
    fn begin(&mut self, now_ms: f64) -> Commands<Msg> {
        self.missing = None;
        self.solving = None;
        match self.view.chosen() {
            Err(invalid) => {
                self.found = None;
                self.missing = Some(format!("{invalid}."));
                vec![Command::Cancel(SOLVE)]
            }
            Ok(Method::Exact) => {
                let function = self.view.game.exact().map(ValueFunction::Exact);
                self.take(function.map_err(|invalid| invalid.to_string()), None);
                vec![Command::Cancel(SOLVE)]
            }
            Ok(_) => {
                self.solving = Some((now_ms, 0.0));
                let (task, then) = (task(&self.view), Rc::new(Msg::Solving));
                vec![Command::Solve { name: SOLVE, task, then }]
            }
        }
    }

    /// Stores the value function, and how long the solve took (s).
    fn take(&mut self, function: Result<ValueFunction, String>, seconds: Option<f64>) {
        self.solving = None;
        match function {
            Ok(function) => self.found = Some(Found::new(function, seconds)),
            Err(why) => {
                self.found = None;
                self.missing = Some(why);
            }
        }
    }

    fn hear_solver(&mut self, solving: Solving, now_ms: f64) {
        let Some((since_ms, share)) = &mut self.solving else { return };
        let seconds = (now_ms - *since_ms) / 1000.0;
        match solving {
            Solving::Done(done) => *share = done,
            Solving::Solved(bytes) => {
                let function = ValueFunction::decode(&bytes);
                self.take(function.map_err(|invalid| invalid.to_string()), Some(seconds));
            }
            Solving::Failed(why) => self.take(Err(why), None),
        }
    }

    /// Sets a link parameter to the value of a control.
    fn set(&mut self, name: &'static str, value: &FieldValue) {
        let text = match value {
            FieldValue::Number(Some(number)) => number.to_string(),
            _ => value.text().to_owned(),
        };
        self.misread.retain(|(known, _)| known != name && known != "link");
        if let Err(invalid) = self.view.set(name, &text) {
            self.misread.push((name.to_owned(), format!("{invalid}.")));
        }
    }

    /// The viewing direction and the scale of the tube and its box.
    fn orbit(&self, found: &Found) -> Orbit {
        let zoom = f64::from(self.view.zoom_percent) / 100.0;
        let width = self.widths()[0].min(SOLID_PX);
        Orbit::new(found.window(), self.view.turned_deg, zoom, [width, SOLID_HEIGHT * width])
    }

    /// Widths of the map and of the world's picture (px). They are side by side if there is enough
    /// space.
    fn widths(&self) -> [f64; 2] {
        // These numbers must match the style sheet: the width of the panel, and the margins around
        // and between the pictures.
        let is_narrow = self.window_px <= 760.0;
        let room = if is_narrow { self.window_px - 13.0 } else { self.window_px - 320.0 - 48.0 };
        let room = room.clamp(300.0, 992.0);
        match self.view.plays && self.view.shown != Shown::Tube && room >= 800.0 {
            true => [0.6 * room - 24.0, 0.4 * room],
            false => [room; 2],
        }
    }

    /// The position whose numbers are shown: the pointer's position or, without a pointer, the
    /// cross-hair's position.
    fn at_m(&self) -> [f64; 2] {
        self.pointer.unwrap_or(self.view.at_m)
    }

    /// The relative state at this position with the view's heading.
    fn state(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        [x, y, self.view.psi()]
    }

    /// Updates the pictures. Recomputes optimal play if the value function, the cross-hair or the
    /// heading has changed.
    fn replay(&mut self) {
        let start = self.state(self.view.at_m);
        let widths = self.widths();
        let Some(found) = &mut self.found else {
            self.game = None;
            return;
        };
        found.draw(&self.view, widths[0]);
        let is_new = found.is_new();
        let known = self.game.as_ref().and_then(|game| game.as_ref().ok());
        let is_known = !is_new && known.is_some_and(|game| game.start == start);
        if !self.view.plays {
            self.game = None;
        } else if !is_known {
            let game = play(found.function(), start);
            self.game = Some(game.map_err(|invalid| format!("No optimal play. {invalid}.")));
        }
    }

    /// The marks over the map: the path of optimal play, the evader, and the pursuer at the current
    /// position.
    fn marks(&self) -> Vec<Layer> {
        let path = self.game.iter().flatten().flat_map(Play::relative_path);
        path.chain(Map::vehicles(self.at_m(), self.view.psi())).collect()
    }

    /// The current picture, for a file.
    fn drawing(&self) -> Option<Drawing> {
        let found = self.found.as_ref()?;
        match self.view.shown {
            Shown::Tube if self.shows_solid() => {
                let (function, level_m) = (found.function(), self.view.level_m);
                Some(tube(function, level_m, &*found.mesh()?, &self.orbit(found)))
            }
            Shown::Tube => Some(self.small_multiples(found)),
            Shown::Value | Shown::Error => Some(found.map()?.with(self.marks())),
        }
    }

    /// Whether the tube is shown as a solid. The browser must be able to draw it, and the drawing
    /// must be fast enough unless the user insists.
    fn shows_solid(&self) -> bool {
        self.has_graphics && (self.insists || self.frame_ms.is_none_or(|ms| ms <= SLOW_MS))
    }

    /// Slices of the tube at eight headings, shown instead of the solid.
    fn small_multiples(&self, found: &Found) -> Drawing {
        let headings = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
        slices(found.function(), &headings, &[self.view.level_m])
    }

    /// Offers the picture as a file with this extension.
    fn save(&self, ending: &str, media_type: &'static str) -> Commands<Msg> {
        let name = self.file_name(ending);
        let content = self.drawing().map(|drawing| drawing.svg().into_bytes());
        let download =
            content.map(|content| Command::offer(Offer::File { name, media_type, content }));
        download.into_iter().collect()
    }

    /// Solves again for the file, because the values on this page are rounded to a millimetre.
    fn begin_file(&mut self) -> Commands<Msg> {
        self.writing = Some(Ok(0.0));
        let task = Task { as_archive: true, ..task(&self.view) };
        vec![Command::Solve { name: FILE, task, then: Rc::new(Msg::Writing) }]
    }

    fn hear_writer(&mut self, solving: Solving) -> Commands<Msg> {
        match solving {
            Solving::Done(share) => self.writing = Some(Ok(share)),
            Solving::Failed(why) => self.writing = Some(Err(why)),
            Solving::Solved(bytes) => {
                self.writing = None;
                let (name, media_type) = ("value-function.npz".to_owned(), "application/zip");
                return vec![Command::offer(Offer::File { name, media_type, content: bytes })];
            }
        }
        Vec::new()
    }

    /// The link to the current view.
    fn address(&self) -> String {
        let query = self.view.query();
        let mark = if query.is_empty() { "" } else { "?" };
        format!("/lab/reachability{mark}{query}")
    }

    /// A file name with this extension.
    fn file_name(&self, ending: &str) -> String {
        let psi = self.view.psi_deg;
        match self.view.shown {
            Shown::Value => format!("value-psi-{psi}.{ending}"),
            Shown::Error => format!("error-psi-{psi}.{ending}"),
            Shown::Tube => format!("tube.{ending}"),
        }
    }
}

/// The solver's task for this view.
fn task(view: &View) -> Task {
    let horizon_s = view.horizon_s.is_finite().then_some(view.horizon_s);
    Task {
        game: view.game,
        method: view.method,
        horizon_s,
        accuracy: Some(view.accuracy),
        as_archive: false,
    }
}

impl Page for Reachability {
    type Msg = Msg;

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        let before = self.view.clone();
        let mut commands = Vec::new();
        match message {
            Msg::Set(name, value) => self.set(name, &value),
            Msg::Solving(solving) => self.hear_solver(solving, now_ms),
            Msg::Stop if self.solving.is_none() => {
                commands.push(Command::Cancel(FILE));
                self.writing = None;
            }
            Msg::Stop => {
                commands.push(Command::Cancel(SOLVE));
                self.take(Err("The solve was stopped.".to_owned()), None);
            }
            Msg::Again => commands = self.begin(now_ms),
            Msg::Point(pointing) => self.point(pointing),
            Msg::Hold(pointing) => self.hold(pointing),
            Msg::Graphics(can) => self.has_graphics = can,
            Msg::Drawn(ms) => self.frame_ms = Some(ms),
            Msg::Insist => self.insists = true,
            Msg::Key(key) => self.press(key),
            Msg::Play => self.view.plays = !self.view.plays,
            Msg::Width(px) => self.window_px = px,
            Msg::Link => {
                self.moves = false;
                return vec![Command::ReplaceAddress(self.address())];
            }
            Msg::SaveSvg => return self.save("svg", "image/svg+xml"),
            Msg::SavePng => return self.save("png", PNG_OF_SVG),
            Msg::SaveNpz => return self.begin_file(),
            Msg::Writing(solving) => return self.hear_writer(solving),
        }
        if self.view.parameters() != before.parameters() {
            self.writing = None;
            commands.push(Command::Cancel(FILE));
            commands.extend(self.begin(now_ms));
        }
        self.replay();
        if self.view != before {
            self.moves = true;
            commands.push(Command::Wake {
                timer: LINK,
                after_ms: LINK_AFTER_MS,
                message: Msg::Link,
            });
        }
        commands
    }

    fn view(&self) -> Node<Msg> {
        view::page(self)
    }

    fn title(&self) -> String {
        "Reachability".to_owned()
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        match event {
            Event::Key { code, down: true, .. } => Key::of(code).map(Msg::Key),
            Event::Resized { width_px, .. } => Some(Msg::Width(*width_px)),
            _ => None,
        }
    }

    fn solid(&self) -> Option<Solid<Msg>> {
        let is_shown = self.view.shown == Shown::Tube && self.shows_solid();
        let found = self.found.as_ref().filter(|_| is_shown)?;
        let orbit = self.orbit(found);
        Some(Solid {
            canvas: CANVAS,
            mesh: found.mesh()?,
            matrix: orbit.matrix(),
            light: orbit.light(),
            tones: TONES.map(|tone| tone.light),
            ring: RING as f32,
            is_still: !self.moves,
            then: Rc::new(Msg::Graphics),
            drawn: Rc::new(Msg::Drawn),
        })
    }

    fn owns_key(&self, code: &str) -> bool {
        Key::of(code).is_some()
    }
}
