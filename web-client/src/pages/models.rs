//! The models of analyses that a page can use for its predictions.

use super::parts::{self, percent};
use crate::runtime::{Address, Answer, Command, Commands, Request, encoded, read};
use crate::view::{Node, el};
use sidestep::api::{
    AnalysisPage, AnalysisState, PredictorPage, PredictorSource, PredictorSummary, routes,
};
use sidestep::chart::fixed;

/// A model of an analysis, identified by its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Named {
    pub(super) analysis: String,
    pub(super) file: String,
}

impl Named {
    /// The model that the page's address names, if any.
    pub(super) fn of(address: &Address) -> Option<Self> {
        let text = |name: &str| address.parameter(name).map(str::to_owned);
        let (analysis, file) = (text("analysis"), text("file"));
        (analysis.is_some() || file.is_some()).then(|| Self {
            analysis: analysis.unwrap_or_default(),
            file: file.unwrap_or_default(),
        })
    }

    /// The value of the model's option in a selection list. An analysis id never contains a slash.
    pub(super) fn value(&self) -> String {
        format!("{}/{}", self.analysis, self.file)
    }

    pub(super) fn of_value(value: &str) -> Option<Self> {
        let (analysis, file) = value.split_once('/')?;
        Some(Self { analysis: analysis.to_owned(), file: file.to_owned() })
    }

    /// The model as part of a query.
    pub(super) fn query(&self) -> String {
        format!("analysis={}&file={}", encoded(&self.analysis), encoded(&self.file))
    }
}

/// A participant's models in the study's newest finished analysis.
pub(super) enum Offered {
    /// The models are being loaded.
    Asked,
    /// The id of the analysis, and its models.
    Models(String, Vec<PredictorSummary>),
    /// No analysis has finished.
    NoAnalysis,
    /// The newest finished analysis has no models.
    NoModels,
    /// Loading failed, for this reason.
    Failed(String),
}

impl Offered {
    /// Requests the analyses of a study.
    pub(super) fn ask<M>(study: &str, then: fn(Answer) -> M) -> Command<M>
    where
        M: 'static,
    {
        Command::Send(Request::get("analyses", routes::admin_analyses(study), then))
    }

    /// Processes the server's list of analyses. Requests the models of the participant with this
    /// number in the newest finished analysis.
    pub(super) fn analyses<M: 'static>(
        &mut self,
        answer: Answer,
        number: i64,
        then: fn(String, Answer) -> M,
    ) -> Commands<M> {
        let page: AnalysisPage = match read(answer) {
            Ok(page) => page,
            Err(failure) => {
                *self = Self::Failed(failure.sentence);
                return Vec::new();
            }
        };
        let done = page.analyses.into_iter().find(|it| it.state == AnalysisState::Done);
        let Some(newest) = done else {
            *self = Self::NoAnalysis;
            return Vec::new();
        };
        // Models of experiment 2 do not predict the direction of a turn.
        let models = routes::analysis_predictors(&newest.id);
        let url = format!("{models}?participant={number}&experiment=1&limit=500");
        let then = move |answer| then(newest.id, answer);
        vec![Command::Send(Request::get("models", url, then))]
    }

    /// Processes the server's list of the participant's models in an analysis.
    pub(super) fn models(&mut self, analysis: String, answer: Answer) {
        *self = match read::<PredictorPage>(answer) {
            Ok(page) if page.predictors.is_empty() => Self::NoModels,
            Ok(page) => Self::Models(analysis, page.predictors),
            Err(failure) => Self::Failed(failure.sentence),
        };
    }

    /// The models with their labels.
    pub(super) fn list(&self) -> Vec<(Named, String)> {
        let Self::Models(analysis, models) = self else { return Vec::new() };
        let named = |it: &PredictorSummary| {
            let named = Named { analysis: analysis.clone(), file: it.file.clone() };
            (
                named,
                format!(
                    "{}, {} % of inputs predicted right",
                    name(it),
                    fixed(100.0 * it.test_accuracy, 1)
                ),
            )
        };
        models.iter().map(named).collect()
    }

    /// What the user can do if there is no model to choose from.
    pub(super) fn hint<M>(&self, study: &str) -> Option<Node<M>> {
        let words = match self {
            Self::Asked | Self::Models(..) => return None,
            Self::Failed(why) => format!("Other predictors cannot be listed. {why}"),
            Self::NoAnalysis => "There are more predictors once the study is analysed. ".to_owned(),
            Self::NoModels => "The newest analysis has no model of this participant. ".to_owned(),
        };
        let is_known = !matches!(self, Self::Failed(_));
        let link = is_known.then(|| {
            let analyses = format!("/lab/studies/{study}/analyses");
            el("a").attr("href", analyses).text("Analyses")
        });
        Some(el("p").class("quiet").test_id("no-models").text(words).children(link))
    }
}

/// The kind of a model and its features.
pub(super) fn name(it: &PredictorSummary) -> String {
    format!("{} on {}", parts::model(&it.model), it.features)
}

/// An option of a selection list.
pub(super) fn option<M>(value: String, is_chosen: bool, words: String) -> Node<M> {
    el("option").attr("value", value).attr_if(is_chosen, "selected", "").text(words)
}

/// A group of options with this label.
pub(super) fn group<M>(words: String) -> Node<M> {
    el("optgroup").attr("label", words)
}

/// The groups of a selection list with these models. If a link names a model that is not in the
/// list, the model is added with the facts in `source`.
pub(super) fn groups<M>(
    offered: &Offered,
    chosen: Option<&Named>,
    source: Option<&PredictorSource>,
    number: i64,
) -> Vec<Node<M>> {
    let listed = offered.list();
    let entry = |it: &Named, words: String| option(it.value(), chosen == Some(it), words);
    let other = chosen.filter(|it| listed.iter().all(|(known, _)| known != *it));
    let words = source.map_or_else(
        || other.map_or_else(String::new, |it| it.file.clone()),
        |source| format!("{}, participant {}", name(&source.summary), source.summary.participant),
    );
    let other = other.map(|it| group("From the link".to_owned()).child(entry(it, words)));
    let analysed = (!listed.is_empty()).then(|| {
        let options = listed.iter().map(|(it, words)| entry(it, words.clone()));
        let words = format!(
            "Participant {number} in the newest analysis: share of test inputs predicted right"
        );
        group(words).children(options)
    });
    analysed.into_iter().chain(other).collect()
}

/// Describes a model, its accuracy and its analysis.
pub(super) fn described<M>(source: &PredictorSource) -> Node<M> {
    let it = &source.summary;
    let (right, who) = (percent(it.test_accuracy), it.participant);
    let analysis = format!("/lab/analyses/{}", source.analysis);
    el("p")
        .text(format!("{} of participant {who}; {right} of test steps right. ", name(it)))
        .child(el("a").attr("href", analysis).text("Its analysis"))
}
