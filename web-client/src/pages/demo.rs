//! The demonstration: the user drives, or watches a synthetic driver, while level sets and
//! predicted sets are drawn live. The predicted sets come from a model that learns from every
//! scene.

mod driver;
mod score;
mod model;
mod view;

use self::driver::{Driver, Driving};
use self::model::Model;
use self::score::Score;
use super::parts;
use crate::drive;
use crate::form::FieldValue;
use crate::input::{BLUR, HeldKeys, KeyMap};
use crate::runtime::{Address, Command, Commands, Event, Page};
use crate::view::Node;
use sidestep::invalid::Invalid;
use sidestep::picture::Picture;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{EncounterRange, Scene, SceneParameters, generate};
use sidestep::trial_view::layers::LAYERS;
use sidestep::trial_view::style::Palette;
use sidestep::trial_view::view::View;
use sidestep::trial_view::{Playback, Recorded};
use std::ops::ControlFlow;

/// The page.
pub enum DemoPage {
    /// The page cannot start, for this reason.
    Failed(String),
    /// The page has started.
    Open(Box<Demo>),
}

/// Messages to the demonstration.
#[derive(Clone, Debug)]
pub enum Msg {
    /// Starts the current scene or, if it is over, the next one.
    Start,
    /// Pauses or resumes a synthetic driver.
    Pause,
    /// Abandons the scene and returns to its start.
    GiveUp,
    /// Switches to another driver, with a new model.
    Drive(Driver),
    /// The key with this code went down or up.
    Key(String, bool),
    /// The window lost the keyboard focus. The flag says whether the page is hidden.
    FocusLost(bool),
    /// Shows or hides the layer at this index in [`LAYERS`].
    Layer(usize),
    /// Sets the colours of the predicted sets.
    Colours(FieldValue),
    /// Shows or hides the legend.
    Legend,
    /// The displayed numbers are due for an update.
    Frame,
    /// The scene is over.
    Over,
}

impl DemoPage {
    /// Creates the page and its first commands.
    #[must_use]
    pub fn open(address: &Address) -> (Self, Commands<Msg>) {
        let page = match Demo::open(address) {
            Ok(demo) => Self::Open(Box::new(demo)),
            Err(invalid) => Self::Failed(invalid.to_string()),
        };
        (page, Vec::new())
    }
}

impl Page for DemoPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        let Self::Open(demo) = self else { return Vec::new() };
        let before = demo.address();
        if let Err(invalid) = demo.update(message, now_ms) {
            *self = Self::Failed(invalid.to_string());
            return Vec::new();
        }
        let after = demo.address();
        (before != after).then_some(Command::ReplaceAddress(after)).into_iter().collect()
    }

    fn view(&self) -> Node<Msg> {
        match self {
            Self::Failed(why) => parts::stuck("No demonstration", why),
            Self::Open(demo) => view::page(demo),
        }
    }

    fn title(&self) -> String {
        "Demonstration".to_owned()
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        match event {
            Event::Key { code, down, .. } => Some(Msg::Key(code.clone(), *down)),
            Event::FocusLost { hidden } => Some(Msg::FocusLost(*hidden)),
            _ => None,
        }
    }

    fn owns_key(&self, code: &str) -> bool {
        matches!(self, Self::Open(demo) if demo.owns_key(code))
    }

    fn tick(&mut self, now_ms: f64) -> Option<Msg> {
        match self {
            Self::Open(demo) => demo.tick(now_ms),
            Self::Failed(_) => None,
        }
    }

    fn wants_frames(&self) -> bool {
        matches!(self, Self::Open(demo) if demo.is_moving())
    }

    fn draw(&self, _: f64, picture: &mut Picture) -> bool {
        let Self::Open(demo) = self else { return false };
        picture.copy(&demo.picture);
        true
    }
}

/// State of the demonstration.
pub struct Demo {
    path: String,
    parameters: SceneParameters,
    safety: SafetyLevels,
    driver: Driver,
    scenes: Vec<Scene>,
    /// Index of the current scene.
    index: usize,
    stage: Stage,
    playback: Playback,
    score: Score,
    /// Points of each finished scene.
    points: Vec<u32>,
    model: Model,
    view: View,
    keys: KeyMap,
    held: HeldKeys,
    shows_legend: bool,
    /// The time of the last update of the numbers (ms).
    shown_ms: f64,
    picture: Picture,
    /// Error message about the link.
    misread: Option<String>,
}

/// State of the current scene.
enum Stage {
    /// The scene waits for its driver to start.
    Ready,
    /// The scene is being driven.
    Driving(Box<Driving>),
    /// The scene ended at this time (ms).
    Over(f64),
}

/// The canvas element's id.
const CANVAS: &str = "demo";

/// Interval between two updates of the numbers (ms). Faster changes would be unreadable.
const NUMBERS_EVERY_MS: f64 = 60.0;

/// How long the end of a synthetic driver's scene is shown before the next scene starts (ms).
const REST_MS: f64 = 2500.0;

/// Margin around both vehicles for the predicted sets and the danger zone (m).
const ROOM_M: f64 = 4.5;

/// Number of scenes generated at a time.
const BLOCK: usize = 12;

impl Demo {
    fn open(address: &Address) -> Result<Self, Invalid> {
        let parameters = SceneParameters::default();
        // Both vehicles are identical, so the closed form serves both.
        let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))
            .map_err(|error| Invalid::new("safety levels", "a solution", error))?;
        let named = Driver::of_query(address.parameter("driver"));
        let query = address.query.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let read = View::of_query(query.filter(|(name, _)| SEEN.contains(name)));
        let misread = match (named, &read) {
            (_, Err(invalid)) => Some(format!("The link is not valid: {invalid}.")),
            (None, _) => Some("The link names an unknown driver, so you drive.".to_owned()),
            _ => parts::unknown(address, &[&View::NAMES, &["driver"]]),
        };
        let scenes = block(&parameters, 0)?;
        let start = Recorded {
            parameters,
            scene: scenes[0].clone(),
            inputs: Vec::new(),
            states: vec![scenes[0].start()],
        };
        let mut demo = Self {
            path: address.path.clone(),
            score: Score::of(&parameters, &start.inputs, &start.states),
            playback: Playback::new(start)?,
            model: Model::new(&safety)?,
            parameters,
            safety,
            driver: named.unwrap_or_default(),
            scenes,
            index: 0,
            stage: Stage::Ready,
            points: Vec::new(),
            view: read.unwrap_or_default(),
            keys: KeyMap::default(),
            held: HeldKeys::default(),
            shows_legend: false,
            shown_ms: 0.0,
            picture: Picture::default(),
            misread,
        };
        demo.view.time_s = 0.0;
        demo.wait()?;
        Ok(demo)
    }

    /// The link to the current view.
    fn address(&self) -> String {
        let view = View { time_s: 0.0, ..self.view.clone() }.query();
        let parts: Vec<String> =
            self.driver.query().into_iter().chain((!view.is_empty()).then_some(view)).collect();
        let mark = if parts.is_empty() { "" } else { "?" };
        format!("{}{mark}{}", self.path, parts.join("&"))
    }

    fn update(&mut self, message: Msg, now_ms: f64) -> Result<(), Invalid> {
        match message {
            Msg::Start => self.start(now_ms)?,
            Msg::Pause => {
                if let Stage::Driving(driving) = &mut self.stage {
                    driving.pause_or_go_on(now_ms);
                }
            }
            Msg::GiveUp => self.wait()?,
            Msg::Drive(driver) => {
                self.driver = driver;
                self.model = Model::new(&self.safety)?;
                (self.index, self.points) = (0, Vec::new());
                self.wait()?;
            }
            Msg::Key(code, down) => self.key(&code, down, now_ms)?,
            Msg::FocusLost(hidden) => {
                self.held.change(now_ms, BLUR, false);
                if let Stage::Driving(driving) = &mut self.stage {
                    driving.key(now_ms, BLUR, false);
                    let is_live = matches!(**driving, Driving::Live(_));
                    // A user cannot drive a scene that is not visible.
                    if hidden && is_live {
                        self.wait()?;
                    } else if hidden && !driving.is_paused() {
                        driving.pause_or_go_on(now_ms);
                    }
                }
            }
            Msg::Layer(place) => {
                if let Some(shown) = self.view.shown.get_mut(place) {
                    *shown = !*shown;
                }
            }
            Msg::Colours(value) => {
                if let Err(invalid) = self.view.set("colours", value.text()) {
                    self.misread = Some(invalid.to_string());
                }
            }
            Msg::Legend => self.shows_legend = !self.shows_legend,
            // The picture is already up to date.
            Msg::Frame => return Ok(()),
            Msg::Over => return self.over(now_ms),
        }
        self.show()
    }

    fn owns_key(&self, code: &str) -> bool {
        let steers = self.keys.turn(code).is_some() && self.driver == Driver::You;
        steers || code == "Space"
    }

    fn key(&mut self, code: &str, down: bool, now_ms: f64) -> Result<(), Invalid> {
        if self.keys.turn(code).is_some() {
            self.held.change(now_ms, code, down);
            if let Stage::Driving(driving) = &mut self.stage {
                driving.key(now_ms, code, down);
            }
            return Ok(());
        }
        let message = match (code, &self.stage) {
            _ if !down => None,
            ("Space", Stage::Driving(_)) => Some(Msg::Pause),
            ("Space", _) => Some(Msg::Start),
            ("Escape", Stage::Driving(_)) => Some(Msg::GiveUp),
            ("KeyL", _) => Some(Msg::Legend),
            ("KeyC", _) => {
                let other = match self.view.style.palette {
                    Palette::Paper => "safe",
                    Palette::Safe => "paper",
                };
                Some(Msg::Colours(FieldValue::Text(other.to_owned())))
            }
            _ => view::layer_of(code).map(Msg::Layer),
        };
        message.map_or(Ok(()), |message| self.update(message, now_ms))
    }

    /// Starts the current scene, or the next one if it is over.
    fn start(&mut self, now_ms: f64) -> Result<(), Invalid> {
        match self.stage {
            Stage::Driving(_) => return Ok(()),
            Stage::Over(_) => {
                self.index += 1;
                self.wait()?;
            }
            Stage::Ready => {}
        }
        let scene = self.scene().clone();
        let keys = (&self.keys, &self.held);
        let driving =
            Driving::start(self.driver, self.index, &self.parameters, &scene, keys, now_ms);
        self.stage = Stage::Driving(Box::new(driving));
        self.go_to(now_ms)
    }

    /// Puts both vehicles at the start of the current scene.
    fn wait(&mut self) -> Result<(), Invalid> {
        if self.index >= self.scenes.len() {
            self.scenes.extend(block(&self.parameters, self.index / BLOCK)?);
        }
        let (scene, parameters) = (self.scene().clone(), self.parameters);
        let (inputs, states) = (Vec::new(), vec![scene.start()]);
        self.score = Score::of(&parameters, &inputs, &states);
        self.playback = Playback::new(Recorded { parameters, scene, inputs, states })?;
        self.playback.use_safety(self.safety.clone())?;
        self.playback.use_learned(Some(self.model.learned.clone()))?;
        self.stage = Stage::Ready;
        self.view.time_s = 0.0;
        self.show()
    }

    fn scene(&self) -> &Scene {
        &self.scenes[self.index]
    }

    fn is_moving(&self) -> bool {
        match &self.stage {
            Stage::Ready => false,
            Stage::Driving(driving) => !driving.is_paused(),
            // The next scene of a synthetic driver starts automatically.
            Stage::Over(_) => self.driver != Driver::You,
        }
    }

    fn tick(&mut self, now_ms: f64) -> Option<Msg> {
        match &mut self.stage {
            Stage::Ready => None,
            Stage::Over(since_ms) => {
                let is_due = self.driver != Driver::You && now_ms - *since_ms >= REST_MS;
                is_due.then_some(Msg::Start)
            }
            Stage::Driving(driving) => {
                let is_over = driving.tick(now_ms);
                if is_over || self.go_to(now_ms).is_err() {
                    return Some(Msg::Over);
                }
                if now_ms - self.shown_ms < NUMBERS_EVERY_MS {
                    return None;
                }
                self.shown_ms = now_ms;
                Some(Msg::Frame)
            }
        }
    }

    /// Moves the playback to this time in the scene that is being driven.
    fn go_to(&mut self, now_ms: f64) -> Result<(), Invalid> {
        if let Stage::Driving(driving) = &self.stage {
            let (inputs, states) = (driving.inputs(), driving.states());
            let recorded = self.playback.recorded();
            if (recorded.inputs.as_slice(), recorded.states.as_slice()) != (inputs, states) {
                self.playback.record(inputs, states)?;
                self.score = Score::of(&self.parameters, inputs, states);
            }
            self.view.time_s = driving.time_s(now_ms);
        }
        self.show()
    }

    /// Ends the scene: computes its points, and trains the model on it.
    fn over(&mut self, now_ms: f64) -> Result<(), Invalid> {
        if let Stage::Driving(driving) = &mut self.stage
            && driving.tick(now_ms)
        {
            self.go_to(now_ms)?;
            self.points.push(self.score.points);
            self.model.learn(&self.playback, &self.safety)?;
            // The panel shows the new model immediately.
            self.playback.use_learned(Some(self.model.learned.clone()))?;
            self.stage = Stage::Over(now_ms);
        }
        self.show()
    }

    /// Paints the scene at the current time.
    fn show(&mut self) -> Result<(), Invalid> {
        self.playback.go(&self.view)?;
        let now = self.playback.now();
        let [human, robot] = [now.state.human, now.state.robot].map(|pose| pose.position());
        let window = drive::window(&self.scenes[self.index], now.state);
        self.playback.show_window(window.including(human, ROOM_M).including(robot, ROOM_M));
        let picture = &mut self.picture;
        picture.begin(CANVAS, self.playback.window());
        picture.tell("data-step", now.step);
        picture.tell("data-scene", self.index);
        self.score.paint_band(&self.parameters, now.state.robot, picture);
        self.playback.paint(&self.view, picture);
        self.score.paint_points(now.state.human, picture);
        Ok(())
    }
}

/// The link parameters of a replay that this page also has.
const SEEN: [&str; 5] = ["show", "hr", "rh", "sets", "colours"];

/// Whether this page offers a layer. Layers that need the future are excluded, because the future
/// is unknown while driving.
fn is_offered(layer: &sidestep::trial_view::layers::Layer) -> bool {
    layer.name != "future"
}

/// The scenes of a block. They are the same for every user.
fn block(parameters: &SceneParameters, number: usize) -> Result<Vec<Scene>, Invalid> {
    let range = EncounterRange::default();
    let drawn = generate(parameters, &range, BLOCK, 1 + number as u64)?;
    Ok(drawn.into_iter().map(|(scene, _)| scene).collect())
}

/// Indices of the layers that this page offers.
fn offered() -> impl Iterator<Item = usize> {
    LAYERS.iter().enumerate().filter(|(_, layer)| is_offered(layer)).map(|(place, _)| place)
}

#[cfg(test)]
mod tests;
