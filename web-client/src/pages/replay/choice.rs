//! Which predictor a replay uses, and what there is to choose from.

use super::Msg;
use crate::form::FieldValue;
use crate::pages::models::{Named, Offered, described, group, groups, option};
use crate::pages::parts::alert;
use crate::runtime::{Answer, Command, Commands, Request};
use crate::view::{self, el};
use sidestep::api::{PredictorSource, TrialDetail, TrialUse, routes};

type Node = view::Node<Msg>;

/// The choice of a predictor.
pub(super) struct Choice {
    /// A model of an analysis; none is the one that is trained on the participant's earlier trials.
    named: Option<Named>,
    /// What the server said of it, once it is here.
    source: Option<PredictorSource>,
    offered: Offered,
    /// Why there is no predictor, if so.
    refused: Option<String>,
}

impl Choice {
    pub(super) fn new(named: Option<Named>) -> Self {
        Self { named, source: None, offered: Offered::Asked, refused: None }
    }

    /// Asks for the predictor and for what else there is.
    pub(super) fn begin(&self, trial: &TrialDetail) -> Commands<Msg> {
        vec![self.ask(trial), Offered::ask(&trial.study, Msg::Analyses)]
    }

    /// Asks for the predictor.
    fn ask(&self, trial: &TrialDetail) -> Command<Msg> {
        let route = routes::admin_predictor(&trial.summary.trial_id);
        let query =
            self.named.as_ref().map_or_else(String::new, |named| format!("?{}", named.query()));
        Command::Send(Request::get("predictor", format!("{route}{query}"), Msg::Predictor))
    }

    /// The choice as part of a query; empty for the usual one.
    pub(super) fn query(&self) -> String {
        self.named.as_ref().map_or_else(String::new, Named::query)
    }

    /// Uses another predictor.
    pub(super) fn choose(&mut self, value: &FieldValue, trial: &TrialDetail) -> Commands<Msg> {
        self.named = Named::of_value(value.text());
        (self.source, self.refused) = (None, None);
        vec![self.ask(trial)]
    }

    /// Takes what the server said of the predictor: where it comes from, or why there is none.
    pub(super) fn arrived(&mut self, answer: Result<Option<PredictorSource>, String>) {
        (self.source, self.refused) = match answer {
            Ok(source) => (source, None),
            Err(why) => (None, Some(why)),
        };
    }

    /// Takes the study's analyses, and asks for the participant's models in the newest that is done.
    pub(super) fn analyses(&mut self, answer: Answer, trial: &TrialDetail) -> Commands<Msg> {
        self.offered.analyses(answer, trial.summary.participant_number, Msg::Models)
    }

    /// Takes the participant's models in an analysis.
    pub(super) fn models(&mut self, analysis: String, answer: Answer) {
        self.offered.models(analysis, answer);
    }
}

/// The control, and what is to be known of the predictor; `trained` says how it came about, once it is
/// here.
pub(super) fn section(choice: &Choice, trial: &TrialDetail, trained: Option<String>) -> Node {
    let is_waiting = trained.is_none() && choice.refused.is_none();
    let words = match (&choice.source, trained) {
        (Some(source), Some(_)) => Some(described(source)),
        (None, Some(words)) => Some(el("p").text(words)),
        (_, None) => is_waiting.then(|| el("p").attr("role", "status").text("Loading…")),
    };
    let id = "choose-predictor";
    el("section")
        .child(el("h2").child(el("label").attr("for", id).text("Predictor")))
        .child(select(choice, trial).attr("id", id))
        .children(choice.source.as_ref().map(note))
        .children(words.map(|words| words.class("quiet").test_id("predictor")))
        .children(choice.refused.as_deref().map(|why| alert("refused", why)))
        .children(choice.offered.hint(&trial.study))
}

fn select(choice: &Choice, trial: &TrialDetail) -> Node {
    let usual =
        option(String::new(), choice.named.is_none(), "Trained on earlier trials".to_owned());
    let number = trial.summary.participant_number;
    let (named, source) = (choice.named.as_ref(), choice.source.as_ref());
    el("select")
        .attr("name", "predictor")
        .test_id("choose-predictor")
        .on_input(Msg::Choose)
        .child(group("As the study goes".to_owned()).child(usual))
        .children(groups(&choice.offered, named, source, number))
}

/// What the model has to do with this trial: a warning if it was trained on it.
fn note(source: &PredictorSource) -> Node {
    let number = source.summary.participant;
    let words = match source.trial {
        TrialUse::Trained => {
            return el("p").class("waiting").attr("role", "note").test_id("trained-on-this").text(
                "This model was trained on this trial; its predictions look better here than \
                 they are.",
            );
        }
        TrialUse::HeldOut => "This trial was held out: the model was not trained on it.".to_owned(),
        TrialUse::Unused => "The analysis did not use this trial.".to_owned(),
        TrialUse::OtherParticipant => {
            format!("The model was trained on participant {number}, who did not drive this trial.")
        }
        TrialUse::OtherStudy => format!(
            "The model was trained on participant {number} of study {}, whose vehicles and scenes \
             may differ.",
            source.study
        ),
    };
    el("p").class("quiet").attr("role", "note").test_id("trial-use").text(words)
}
