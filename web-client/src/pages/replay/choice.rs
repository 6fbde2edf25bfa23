//! Which predictor a replay uses, and what there is to choose from.

use super::Msg;
use crate::form::FieldValue;
use crate::pages::parts::{self, alert, percent};
use crate::runtime::{Address, Answer, Command, Commands, Request, encoded, read};
use crate::view::{self, el};
use sidestep::api::{
    AnalysisPage, AnalysisState, PredictorPage, PredictorSource, PredictorSummary, TrialDetail,
    TrialUse, routes,
};

type Node = view::Node<Msg>;

/// A model of an analysis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    analysis: String,
    file: String,
}

impl Named {
    /// The one in the address of the page, if there is one.
    pub(super) fn of(address: &Address) -> Option<Self> {
        let text = |name: &str| address.parameter(name).map(str::to_owned);
        let (analysis, file) = (text("analysis"), text("file"));
        (analysis.is_some() || file.is_some()).then(|| Self {
            analysis: analysis.unwrap_or_default(),
            file: file.unwrap_or_default(),
        })
    }

    /// As the value of an option. No analysis has a slash in its id.
    fn value(&self) -> String {
        format!("{}/{}", self.analysis, self.file)
    }

    fn of_value(value: &str) -> Option<Self> {
        let (analysis, file) = value.split_once('/')?;
        Some(Self { analysis: analysis.to_owned(), file: file.to_owned() })
    }

    fn query(&self) -> String {
        format!("?analysis={}&file={}", encoded(&self.analysis), encoded(&self.file))
    }
}

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

/// The participant's models in the study's newest analysis that is done.
enum Offered {
    /// They are on their way.
    Asked,
    /// They are these, and the analysis is this.
    Models(String, Vec<PredictorSummary>),
    /// No analysis is done.
    NoAnalysis,
    /// The newest analysis that is done has none.
    NoModels,
    /// They did not come, for this reason.
    Failed(String),
}

impl Choice {
    pub(super) fn new(named: Option<Named>) -> Self {
        Self { named, source: None, offered: Offered::Asked, refused: None }
    }

    /// Asks for the predictor and for what else there is.
    pub(super) fn begin(&self, trial: &TrialDetail) -> Commands<Msg> {
        let analyses = routes::admin_analyses(&trial.study);
        let analyses = Request::get("analyses", analyses, Msg::Analyses);
        vec![self.ask(trial), Command::Send(analyses)]
    }

    /// Asks for the predictor.
    fn ask(&self, trial: &TrialDetail) -> Command<Msg> {
        let route = routes::admin_predictor(&trial.summary.trial_id);
        let query = self.named.as_ref().map_or_else(String::new, Named::query);
        Command::Send(Request::get("predictor", format!("{route}{query}"), Msg::Predictor))
    }

    /// Uses another predictor, and keeps the choice in the address.
    pub(super) fn choose(&mut self, value: &FieldValue, trial: &TrialDetail) -> Commands<Msg> {
        self.named = Named::of_value(value.text());
        (self.source, self.refused) = (None, None);
        let query = self.named.as_ref().map_or_else(String::new, Named::query);
        let address = format!("/lab/replay/{}{query}", trial.summary.trial_id);
        vec![Command::ReplaceAddress(address), self.ask(trial)]
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
        let page: AnalysisPage = match read(answer) {
            Ok(page) => page,
            Err(failure) => {
                self.offered = Offered::Failed(failure.sentence);
                return Vec::new();
            }
        };
        let done = page.analyses.into_iter().find(|it| it.state == AnalysisState::Done);
        let Some(newest) = done else {
            self.offered = Offered::NoAnalysis;
            return Vec::new();
        };
        // Models of experiment 2 do not say to which side somebody turns.
        let models = routes::analysis_predictors(&newest.id);
        let number = trial.summary.participant_number;
        let url = format!("{models}?participant={number}&experiment=1&limit=500");
        let then = move |answer| Msg::Models(newest.id, answer);
        vec![Command::Send(Request::get("models", url, then))]
    }

    /// Takes the participant's models in an analysis.
    pub(super) fn models(&mut self, analysis: String, answer: Answer) {
        self.offered = match read::<PredictorPage>(answer) {
            Ok(page) if page.predictors.is_empty() => Offered::NoModels,
            Ok(page) => Offered::Models(analysis, page.predictors),
            Err(failure) => Offered::Failed(failure.sentence),
        };
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
        .children(hint(choice, trial))
}

fn select(choice: &Choice, trial: &TrialDetail) -> Node {
    let option = |named: Option<&Named>, words: String| {
        el("option")
            .attr("value", named.map_or_else(String::new, Named::value))
            .attr_if(choice.named.as_ref() == named, "selected", "")
            .text(words)
    };
    let group = |words: String| el("optgroup").attr("label", words);
    let offered: Vec<(Named, String)> = match &choice.offered {
        Offered::Models(analysis, models) => {
            let named = |it: &PredictorSummary| {
                let named = Named { analysis: analysis.clone(), file: it.file.clone() };
                (named, format!("{}, {:.0} %", name(it), 100.0 * it.test_accuracy))
            };
            models.iter().map(named).collect()
        }
        _ => Vec::new(),
    };
    // What a link named may be something else.
    let other = choice.named.as_ref().filter(|it| offered.iter().all(|(known, _)| known != *it));
    let words = choice.source.as_ref().map_or_else(
        || other.map_or_else(String::new, |it| it.file.clone()),
        |source| format!("{}, participant {}", name(&source.summary), source.summary.participant),
    );
    let other = other.map(|it| group("From the link".to_owned()).child(option(Some(it), words)));
    let number = trial.summary.participant_number;
    let analysed = (!offered.is_empty()).then(|| {
        let options = offered.iter().map(|(it, words)| option(Some(it), words.clone()));
        let words = format!("Participant {number} in the newest analysis, right in test");
        group(words).children(options)
    });
    let usual = option(None, "Trained on earlier trials".to_owned());
    el("select")
        .attr("name", "predictor")
        .test_id("choose-predictor")
        .on_input(Msg::Choose)
        .child(group("As the study goes".to_owned()).child(usual))
        .children(analysed)
        .children(other)
}

/// The kind of a model and its features.
fn name(it: &PredictorSummary) -> String {
    format!("{} on {}", parts::model(&it.model), it.features)
}

/// Which model it is and how good, with the analysis that made it.
fn described(source: &PredictorSource) -> Node {
    let it = &source.summary;
    let (right, who) = (percent(it.test_accuracy), it.participant);
    let analysis = format!("/lab/analyses/{}", source.analysis);
    el("p")
        .text(format!("{} of participant {who}; {right} of test steps right. ", name(it)))
        .child(el("a").attr("href", analysis).text("Its analysis"))
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

/// What to do if there is nothing else to choose.
fn hint(choice: &Choice, trial: &TrialDetail) -> Option<Node> {
    let words = match &choice.offered {
        Offered::Asked | Offered::Models(..) => return None,
        Offered::Failed(why) => format!("Other predictors cannot be listed. {why}"),
        Offered::NoAnalysis => "There are more predictors once the study is analysed. ".to_owned(),
        Offered::NoModels => "The newest analysis has no model of this participant. ".to_owned(),
    };
    let is_known = !matches!(choice.offered, Offered::Failed(_));
    let link = is_known.then(|| {
        let analyses = format!("/lab/studies/{}/analyses", trial.study);
        el("a").attr("href", analyses).text("Analyses")
    });
    Some(el("p").class("quiet").test_id("no-models").text(words).children(link))
}
