//! The replay of one trial: a time slider, the safety levels, the predicted sets, and the
//! participant's actual drive.

mod chart;
mod choice;
mod finder;
mod chances;
mod panes;
mod keys;
mod playing;
mod link;
mod view;

use self::chances::{Chances, Tasks};
use self::chart::Strip;
use self::choice::{Ask, Choice, Pane};
use self::finder::Finder;
use self::keys::Key;
use self::link::first_choice;
use self::panes::{Beside, FIRST_BESIDE};
use self::playing::{FILM, Playing};
use super::models::Offered;
use super::moment;
use super::parts;
use super::safety::Sources;
use crate::form::FieldValue;
use crate::runtime::{
    Address, Answer, Command, Commands, Event, Failure, Offer, Page, Request, Solving, read,
};
use crate::view::Node;
use sidestep::api::{TrialDetail, routes, trial_heading};
use sidestep::picture::Picture;
use sidestep::scene::Evader;
use sidestep::trial_view::Playback;
use sidestep::trial_view::layers::LAYERS;
use sidestep::trial_view::style::{Palette, Sets};
use sidestep::trial_view::view::View;

/// The page of one trial.
pub enum ReplayPage {
    /// The trial is loading. The address describes the view. Messages that arrive before the trial
    /// are queued.
    Loading(Address, Vec<Msg>),
    /// There is nothing to replay, for this reason.
    Failed(String),
    /// The trial is loaded.
    Open(Box<Replay>),
}

/// Messages to the replay.
#[derive(Clone, Debug)]
pub enum Msg {
    /// The server sent the trial.
    Trial(Answer),
    /// The server sent the predictor of this pane, or the data from which to learn it.
    Predictor(Pane, Answer),
    /// Choose another predictor in this pane.
    Choose(Pane, FieldValue),
    /// Use the predictor from this file in this pane.
    Open(Pane, FieldValue),
    /// Shows or hides the model finder for this pane.
    Find(Pane),
    /// A message to the model finder.
    Finder(finder::Msg),
    /// Shows or hides the second pane.
    Beside,
    /// The server sent the participant's tasks.
    Drives(Answer),
    /// A report from the evaluator on how often the sets of this pane contain the future.
    Chances(Pane, Answer),
    /// The server listed the study's analyses.
    Analyses(Answer),
    /// The server listed the participant's models in this analysis.
    Models(String, Answer),
    /// A report about the value function in which this vehicle evades, from the server or the
    /// solver.
    ValueFunction(Evader, Solving),
    /// Stop solving.
    StopSolving,
    /// Request or solve the missing value functions again.
    SolveAgain,
    /// A key was pressed.
    Key(Key),
    /// Plays, or pauses.
    Play,
    /// Goes to this time (s).
    Seek(f64),
    /// Moves by this many steps, to the start of a step.
    Step(i32),
    /// Plays at this speed.
    Speed(FieldValue),
    /// Plays trials one after another, or stops at the end of the current trial.
    InARow,
    /// Selects which predicted sets to draw.
    Sets(FieldValue),
    /// Selects the colours of the predicted sets.
    Colours(FieldValue),
    /// Selects which levels of this vehicle's value function to draw.
    Levels(Evader, FieldValue),
    /// Shows or hides the layer at this index in [`LAYERS`].
    Layer(usize),
    /// Shows or hides the legend.
    Legend,
    /// Shows or hides the numbers of every step.
    Numbers,
    /// Offers the picture as SVG.
    SaveSvg,
    /// Offers the picture as PNG.
    SavePng,
    /// Starts or ends the film of the playback.
    Film,
    /// The film has ended, or failed for this reason.
    Filmed(Result<(), String>),
    /// The numbers are due for an update during playback.
    Frame,
    /// Updates the link.
    Link,
}

impl ReplayPage {
    /// Creates the page and its first commands.
    #[must_use]
    pub fn open(trial_id: &str, address: &Address) -> (Self, Commands<Msg>) {
        let trial = Request::get("trial", routes::admin_trial(trial_id), Msg::Trial);
        let mut commands = vec![Command::Send(trial)];
        // Training on the server takes the longest, so request it before the trial has arrived.
        if let Ask::Server(predictor) = first_choice(address).ask(trial_id) {
            commands.push(predictor);
        }
        (Self::Loading(address.clone(), Vec::new()), commands)
    }

    /// Opens the trial that has arrived, and handles the queued messages.
    fn arrived(&mut self, answer: Answer, now_ms: f64) -> Commands<Msg> {
        let Self::Loading(address, early) = self else { return Vec::new() };
        let trial = read(answer).map_err(|Failure { status, sentence, .. }| match status {
            404 => "There is no such trial. Its participant may have withdrawn it.".to_owned(),
            _ => sentence,
        });
        let (opened, early) =
            (trial.and_then(|trial| Replay::open(trial, address, now_ms)), std::mem::take(early));
        match opened {
            Ok((mut replay, mut commands)) => {
                commands.extend(early.into_iter().flat_map(|it| replay.update(it, now_ms)));
                *self = Self::Open(Box::new(replay));
                commands
            }
            Err(why) => {
                *self = Self::Failed(why);
                Vec::new()
            }
        }
    }
}

impl Page for ReplayPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        match (message, self) {
            (Msg::Trial(answer), page) => page.arrived(answer, now_ms),
            (message, Self::Loading(_, early)) => {
                early.push(message);
                Vec::new()
            }
            (message, Self::Open(replay)) => replay.update(message, now_ms),
            (_, Self::Failed(_)) => Vec::new(),
        }
    }

    fn view(&self) -> Node<Msg> {
        match self {
            Self::Loading(..) => parts::loading(),
            Self::Failed(why) => parts::stuck("Nothing to replay", why),
            Self::Open(replay) => view::page(replay),
        }
    }

    fn title(&self) -> String {
        match self {
            Self::Open(replay) => replay.title(),
            _ => "Replay".to_owned(),
        }
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        match (self, event) {
            (Self::Open(_), Event::Key { code, down: true, .. }) => Key::of(code).map(Msg::Key),
            _ => None,
        }
    }

    fn owns_key(&self, code: &str) -> bool {
        matches!(self, Self::Open(_)) && Key::of(code).is_some()
    }

    fn tick(&mut self, now_ms: f64) -> Option<Msg> {
        match self {
            Self::Open(replay) => replay.play_to(now_ms),
            _ => None,
        }
    }

    fn wants_frames(&self) -> bool {
        matches!(self, Self::Open(replay) if replay.is_playing())
    }

    fn draw(&self, _: f64, picture: &mut Picture) -> bool {
        let Self::Open(replay) = self else { return false };
        picture.copy(&replay.picture);
        true
    }

    fn draw_beside(&self, _: f64, picture: &mut Picture) -> bool {
        let Self::Open(replay) = self else { return false };
        let Some(beside) = &replay.beside else { return false };
        picture.copy(&beside.picture);
        true
    }
}

/// The replay of a trial.
pub struct Replay {
    trial: TrialDetail,
    sources: Sources<Msg>,
    choice: Choice,
    /// The participant's tasks, once requested.
    tasks: Option<Tasks>,
    chances: Chances,
    /// The participant's models in the newest analysis, to choose from.
    offered: Offered,
    /// The model finder, while shown.
    finder: Option<Finder>,
    playback: Playback,
    /// The second pane, while shown.
    beside: Option<Box<Beside>>,
    view: View,
    /// Whether the next trial follows when this one ends.
    in_a_row: bool,
    /// The state of playback. `None` while it is paused.
    playing: Option<Playing>,
    /// Whether the playback is being filmed. The film ends when playback pauses.
    filming: bool,
    shows_legend: bool,
    shows_numbers: bool,
    strip: Strip,
    /// The current picture.
    picture: Picture,
    /// An error message about the pictures, if any.
    trouble: Option<String>,
    /// Error message about the link.
    misread: Option<String>,
    /// The reason why the last film failed, if it did.
    unfilmed: Option<String>,
}

impl Replay {
    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        let mut commands = Vec::new();
        if matches!(message, Msg::Link) {
            // During playback, the link is not updated.
            let link = (!self.is_playing()).then(|| Command::ReplaceAddress(self.address()));
            return link.into_iter().collect();
        }
        // If the view changes, the link must be updated.
        let before = (!self.is_playing()).then(|| self.address());
        // The panes whose prediction may have changed.
        let panes = match &message {
            Msg::Predictor(pane, _) | Msg::Choose(pane, _) | Msg::Open(pane, _) => vec![*pane],
            Msg::ValueFunction(..) | Msg::Drives(_) => vec![Pane::First, Pane::Second],
            Msg::Beside => vec![Pane::Second],
            _ => Vec::new(),
        };
        match message {
            Msg::Trial(_) | Msg::Link => {}
            Msg::Predictor(pane, answer) => {
                let method = self.pane(pane).map(|(choice, _)| choice.arrived(answer));
                method.into_iter().for_each(|method| self.take(pane, method));
            }
            Msg::Choose(pane, value) => {
                self.pane(pane).into_iter().for_each(|(choice, _)| choice.choose(&value));
                commands = self.predict(pane);
            }
            Msg::Open(pane, content) => {
                let learned = self.pane(pane).and_then(|(choice, _)| choice.open(&content));
                if let Some(learned) = learned {
                    // The pending request for another predictor is obsolete.
                    commands = vec![Command::Cancel(pane.request())];
                    self.take(pane, Ok(learned.into()));
                }
            }
            Msg::Find(pane) => commands = self.find(pane),
            Msg::Finder(message) => {
                let finder = self.finder.as_mut();
                commands = finder.map(|finder| finder.update(message)).unwrap_or_default();
            }
            Msg::Beside if self.beside.take().is_some() => {
                commands = vec![Command::Cancel(Pane::Second.request())];
                self.finder = self.finder.take().filter(|finder| finder.pane == Pane::First);
            }
            Msg::Beside => commands = self.show_beside(FIRST_BESIDE),
            Msg::Drives(answer) => self.tasks = Some(Tasks::of(answer)),
            Msg::Chances(pane, answer) => commands = self.take_chances(pane, answer),
            Msg::Analyses(answer) => {
                let number = self.trial.summary.participant_number;
                commands = self.offered.analyses(answer, number, Msg::Models);
            }
            Msg::Models(analysis, answer) => self.offered.models(analysis, answer),
            Msg::ValueFunction(evader, solving) => {
                self.sources.take(evader, solving);
                self.take_safety();
            }
            Msg::StopSolving => commands = self.sources.stop(),
            Msg::SolveAgain => commands = self.sources.retry(),
            Msg::Key(key) => return self.press(key, now_ms),
            Msg::Play => self.play_or_pause(now_ms),
            Msg::Seek(time_s) => {
                self.playing = None;
                self.view.time_s = time_s.clamp(0.0, self.playback.duration_s());
            }
            Msg::Step(by) => {
                self.playing = None;
                self.step(by);
            }
            Msg::Speed(value) => self.set("speed", &value),
            Msg::InARow => self.in_a_row = !self.in_a_row,
            Msg::Sets(value) => self.set("sets", &value),
            Msg::Colours(value) => self.set("colours", &value),
            Msg::Levels(evader, value) => {
                self.set(if evader == Evader::Human { "hr" } else { "rh" }, &value);
            }
            Msg::Layer(place) => {
                if let Some(shown) = self.view.shown.get_mut(place) {
                    *shown = !*shown;
                }
            }
            Msg::Legend => self.shows_legend = !self.shows_legend,
            Msg::Numbers => self.shows_numbers = !self.shows_numbers,
            Msg::SaveSvg => commands = vec![self.svg()],
            Msg::SavePng => commands = vec![self.png()],
            Msg::Film if self.filming => self.playing = None,
            Msg::Film => commands = self.film(now_ms),
            Msg::Filmed(ended) => {
                self.filming = false;
                self.unfilmed = ended.err();
            }
            Msg::Frame if self.playing.is_none() => commands = self.at_the_end(),
            Msg::Frame => {}
        }
        if !panes.is_empty() {
            self.strip = Strip::new(&self.trial, &self.playback);
        }
        commands.extend(panes.into_iter().flat_map(|pane| self.count(pane)));
        if self.filming && self.playing.is_none() {
            commands.push(Command::offer(Offer::EndOfFilm(FILM)));
        }
        self.show();
        if self.playback.set_count() > 0
            && let Some(words) = moment::fit(&mut self.view, self.playback.steps_ahead())
        {
            self.misread = Some(words);
            self.show();
        }
        let after = (!self.is_playing()).then(|| self.address());
        if after.is_some() && after != before {
            let message = Msg::Link;
            commands.push(Command::Wake { timer: LINK, after_ms: LINK_AFTER_MS, message });
        }
        commands
    }

    fn title(&self) -> String {
        let TrialDetail { study, summary, synthetic, .. } = &self.trial;
        trial_heading(study, summary.participant_number, &summary.scene_words(), *synthetic)
    }

    /// Sets a parameter of the view to the value of a control. An invalid value only causes an
    /// error message.
    fn set(&mut self, name: &str, value: &FieldValue) {
        let mut view = self.view.clone();
        match view.set(name, value.text()) {
            Ok(()) => (self.view, self.misread) = (view, None),
            Err(invalid) => self.misread = Some(invalid.to_string()),
        }
    }

    fn press(&mut self, key: Key, now_ms: f64) -> Commands<Msg> {
        let message = match key {
            Key::Play => Msg::Play,
            Key::Step(by) => Msg::Step(by),
            Key::Start => Msg::Seek(0.0),
            Key::End => Msg::Seek(self.playback.duration_s()),
            Key::Speed(by) => {
                let speed = keys::speed(self.view.speed, by);
                Msg::Speed(FieldValue::Text(speed.to_string()))
            }
            Key::Trial(by) => {
                let other = if by < 0 { &self.trial.previous } else { &self.trial.next };
                let link = other.as_ref().map(|id| self.link_to(id));
                return link.map(Command::Visit).into_iter().collect();
            }
            Key::Layer(place) if place < LAYERS.len() => Msg::Layer(place),
            Key::Layer(_) => return Vec::new(),
            Key::Legend => Msg::Legend,
            Key::Beside => Msg::Beside,
            Key::Colours => {
                let other = match self.view.style.palette {
                    Palette::Paper => "safe",
                    Palette::Safe => "paper",
                };
                Msg::Colours(FieldValue::Text(other.to_owned()))
            }
            Key::Sets => {
                let other = match self.view.style.sets {
                    Sets::Tube => "steps",
                    Sets::EachStep | Sets::Step(_) => "tube",
                };
                Msg::Sets(FieldValue::Text(other.to_owned()))
            }
        };
        self.update(message, now_ms)
    }

    /// At the end of a trial, continues with the next trial if the user wants that. A film contains
    /// only one trial.
    fn at_the_end(&self) -> Commands<Msg> {
        let is_over = self.view.time_s >= self.playback.duration_s();
        let goes_on = self.in_a_row && is_over && !self.filming;
        let next = self.trial.next.as_ref().filter(|_| goes_on);
        next.map(|next| Command::Visit(self.link_to(next))).into_iter().collect()
    }

    /// Updates the picture.
    fn show(&mut self) {
        self.trouble = self.playback.go(&self.view).err().map(|invalid| invalid.to_string());
        let picture = &mut self.picture;
        picture.begin(CANVAS, self.playback.window());
        picture.tell("data-step", self.playback.now().step);
        picture.tell("data-trial", &self.trial.summary.trial_id);
        self.playback.paint(&self.view, picture);
        let Some(beside) = &mut self.beside else { return };
        let gone = beside.playback.go(&self.view);
        if self.trouble.is_none() {
            self.trouble = gone.err().map(|invalid| invalid.to_string());
        }
        beside.picture.begin(CANVAS_BESIDE, beside.playback.window());
        beside.picture.tell("data-step", beside.playback.now().step);
        beside.playback.paint(&self.view, &mut beside.picture);
    }

    /// A file name with study, participant, scene and time. Replaces characters that file names
    /// should not contain.
    fn file_name(&self, ending: &str) -> String {
        let time = self.playback.now().time_s;
        let words = format!("{} {time:.1} s", self.title()).replace(" / ", " ");
        let words = words.split(|c: char| !c.is_ascii_alphanumeric() && c != '.');
        let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        format!("{}.{ending}", words.join("-"))
    }
}

/// Ids of the canvas elements.
const CANVAS: &str = "replay";
const CANVAS_BESIDE: &str = "replay-beside";
/// Name of the link's timer.
const LINK: &str = "link";
/// Delay before the link is updated (ms), because browsers limit how often a page may change its
/// address.
const LINK_AFTER_MS: f64 = 250.0;
