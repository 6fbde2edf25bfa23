//! The one or two panes of a replay: their predictors, and files with their pictures.

use super::chances::Chances;
use super::choice::{Ask, Choice, Pane};
use super::finder::Finder;
use super::{Msg, Replay};
use crate::runtime::{Command, Commands, Offer, PNG_OF_SVG};
use sidestep::chart::Drawing;
use sidestep::picture::Picture;
use sidestep::trial_view::source::{Source, Way};
use sidestep::trial_view::{Method, Playback, side_by_side};

/// The second pane. It shows the same instant with another prediction.
pub(super) struct Beside {
    pub(super) choice: Choice,
    pub(super) playback: Playback,
    pub(super) picture: Picture,
    pub(super) chances: Chances,
}

/// Default predictor of the second pane. It is the simplest guess.
pub(super) const FIRST_BESIDE: Source = Source::Way(Way::ConstantVelocity);

impl Replay {
    /// Uses the value functions as soon as both are loaded.
    pub(super) fn take_safety(&mut self) {
        for pane in [Pane::First, Pane::Second] {
            let Some(safety) = self.sources.functions() else { return };
            let Some((choice, playback)) = self.pane(pane) else { return };
            if playback.safety().is_none()
                && let Err(invalid) = playback.use_safety(safety)
            {
                choice.refuse(&invalid.to_string());
            }
        }
    }

    /// The choice and the playback of a pane, if the pane is shown.
    pub(super) fn pane(&mut self, pane: Pane) -> Option<(&mut Choice, &mut Playback)> {
        match pane {
            Pane::First => Some((&mut self.choice, &mut self.playback)),
            Pane::Second => {
                self.beside.as_mut().map(|beside| (&mut beside.choice, &mut beside.playback))
            }
        }
    }

    /// Shows the second pane with a predictor from this source.
    pub(super) fn show_beside(&mut self, source: Source) -> Commands<Msg> {
        // This trial is already shown, so it is valid.
        let Ok(playback) = Playback::new(self.playback.recorded().clone()) else {
            return Vec::new();
        };
        let (choice, picture) = (Choice::new(Pane::Second, source), Picture::default());
        let chances = Chances::default();
        self.beside = Some(Box::new(Beside { choice, playback, picture, chances }));
        self.take_safety();
        self.predict(Pane::Second)
    }

    /// Predicts with the chosen predictor of this pane as soon as it is loaded.
    pub(super) fn predict(&mut self, pane: Pane) -> Commands<Msg> {
        let trial_id = &self.trial.summary.trial_id;
        let ask = match pane {
            Pane::First => self.choice.ask(trial_id),
            Pane::Second => match &mut self.beside {
                Some(beside) => beside.choice.ask(trial_id),
                None => return Vec::new(),
            },
        };
        // Until the new predictor is loaded, do not show the sets of the previous predictor.
        if let Some((_, playback)) = self.pane(pane) {
            let _ = playback.use_method(None);
        }
        match ask {
            Ask::Server(command) => vec![command],
            Ask::Nobody(method) => {
                self.take(pane, method.map(|method| *method));
                vec![Command::Cancel(pane.request())]
            }
        }
    }

    /// Predicts with `method` in this pane. If `method` is an error or does not fit, shows the error.
    pub(super) fn take(&mut self, pane: Pane, method: Result<Method, String>) {
        let Some((choice, playback)) = self.pane(pane) else { return };
        let used = method.and_then(|method| {
            let human = playback.recorded().parameters.human;
            let used = method.for_human(&human).and_then(|it| playback.use_method(Some(it)));
            used.map_err(|invalid| invalid.to_string())
        });
        if let Err(why) = used {
            choice.refuse(&why);
            let _ = playback.use_method(None);
        }
    }

    /// Shows or hides the model finder for this pane.
    pub(super) fn find(&mut self, pane: Pane) -> Commands<Msg> {
        if self.finder.take().is_some_and(|finder| finder.pane == pane) {
            return Vec::new();
        }
        let (finder, commands) = Finder::open(pane, &self.trial.study);
        self.finder = Some(finder);
        commands
    }

    /// The current picture as a drawing.
    fn drawing(&mut self) -> Drawing {
        let title = self.title();
        let Some(beside) = &mut self.beside else {
            return self.playback.figure(&self.view, &title);
        };
        let captions = [self.choice.caption(), beside.choice.caption()];
        let panes = [(&mut self.playback, &*captions[0]), (&mut beside.playback, &*captions[1])];
        side_by_side(panes, &self.view, &title)
    }

    /// Offers the picture as SVG.
    pub(super) fn svg(&mut self) -> Command<Msg> {
        let (name, content) = (self.file_name("svg"), self.drawing().svg().into_bytes());
        Command::offer(Offer::File { name, media_type: "image/svg+xml", content })
    }

    /// Offers the picture as PNG.
    pub(super) fn png(&mut self) -> Command<Msg> {
        let (name, content) = (self.file_name("png"), self.drawing().svg().into_bytes());
        Command::offer(Offer::File { name, media_type: PNG_OF_SVG, content })
    }
}
