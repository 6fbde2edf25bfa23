//! The link to a view of the replay: opening the replay from it, and writing it.

use super::chances::Chances;
use super::chart::Strip;
use super::choice::{Ask, Choice, Pane};
use super::playing::Playing;
use super::{Msg, Replay};
use crate::pages::models::Offered;
use crate::pages::parts;
use crate::pages::safety::Sources;
use crate::runtime::{Address, Commands};
use sidestep::api::TrialDetail;
use sidestep::picture::Picture;
use sidestep::scene::Evader;
use sidestep::trial_view::source::Source;
use sidestep::trial_view::view::View;
use sidestep::trial_view::{Playback, Recorded};

/// The predictor that the address names for the first pane.
pub(super) fn first_choice(address: &Address) -> Choice {
    let query = address.query.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    Choice::new(Pane::First, Source::of_query(query).unwrap_or_default().0)
}

impl Replay {
    /// Opens the replay of a trial in the view that the address describes.
    pub(super) fn open(
        trial: TrialDetail,
        address: &Address,
        now_ms: f64,
    ) -> Result<(Self, Commands<Msg>), String> {
        let query = || address.query.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let looked = View::of_query(query());
        let sources = Source::of_query(query());
        let misread = looked.as_ref().err().or(sources.as_ref().err());
        let misread = misread.map(|invalid| {
            let what = if looked.is_err() { "view" } else { "choice of predictors" };
            format!("The link is not valid, so the default {what} is shown: {invalid}.")
        });
        let misread = misread.or_else(|| {
            parts::unknown(address, &[&View::NAMES, &Source::NAMES, &View::PAGE_NAMES])
        });
        let (view, (_, beside)) = (looked.unwrap_or_default(), sources.unwrap_or_default());
        let TrialDetail { parameters, scene, inputs, states, .. } = trial.clone();
        let playback = Playback::new(Recorded { parameters, scene, inputs, states })
            .map_err(|invalid| invalid.to_string())?;
        let in_a_row = address.parameter("row").is_some();
        let ids = Evader::ALL.map(|evader| trial.value_function(evader));
        let mut replay = Self {
            sources: Sources::new(&trial.parameters, ids, Msg::ValueFunction),
            choice: first_choice(address),
            tasks: None,
            chances: Chances::default(),
            offered: Offered::Asked,
            finder: None,
            strip: Strip::new(&trial, &playback),
            trial,
            playback,
            beside: None,
            view,
            in_a_row,
            playing: None,
            filming: false,
            shows_legend: address.parameter("legend") != Some("no"),
            shows_numbers: address.parameter("numbers") == Some("yes"),
            picture: Picture::default(),
            trouble: None,
            misread,
            unfilmed: None,
        };
        if in_a_row {
            replay.playing = Some(Playing { until_ms: now_ms, shown_ms: now_ms });
        }
        let mut commands = replay.sources.begin();
        // If the predictor comes from the server, its request has already been sent.
        if let Ask::Nobody(method) = replay.choice.ask(&replay.trial.summary.trial_id) {
            replay.take(Pane::First, method.map(|method| *method));
        }
        commands.push(Offered::ask(&replay.trial.study, Msg::Analyses));
        commands.extend(beside.map(|source| replay.show_beside(source)).into_iter().flatten());
        replay.show();
        Ok((replay, commands))
    }

    /// The link to the current view.
    pub(super) fn address(&self) -> String {
        self.link(&self.trial.summary.trial_id, &self.view)
    }

    fn link(&self, trial_id: &str, view: &View) -> String {
        let said =
            |name: &str, differs: bool| if differs { name.to_owned() } else { String::new() };
        let row = said("row=yes", self.in_a_row);
        let legend = said("legend=no", !self.shows_legend);
        let numbers = said("numbers=yes", self.shows_numbers);
        let beside = self.beside.as_ref().map_or_else(String::new, |it| it.choice.query());
        let parts = [self.choice.query(), beside, view.query(), row, legend, numbers];
        let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        let mark = if parts.is_empty() { "" } else { "?" };
        format!("/lab/replay/{trial_id}{mark}{}", parts.join("&"))
    }

    /// The link to another trial in the same view, from the start of the trial.
    pub(super) fn link_to(&self, trial_id: &str) -> String {
        self.link(trial_id, &View { time_s: 0.0, ..self.view.clone() })
    }
}
