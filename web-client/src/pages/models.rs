//! The models of analyses that a page can predict with.

use super::parts::{self, percent};
use crate::runtime::{Address, Answer, Command, Commands, Request, encoded, read};
use crate::view::{Node, el};
use sidestep::api::{
    AnalysisPage, AnalysisState, PredictorPage, PredictorSource, PredictorSummary, routes,
};
use sidestep::chart::fixed;

/// A model of an analysis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Named {
    pub(super) analysis: String,
    pub(super) file: String,
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
    pub(super) fn value(&self) -> String {
        format!("{}/{}", self.analysis, self.file)
    }

    pub(super) fn of_value(value: &str) -> Option<Self> {
        let (analysis, file) = value.split_once('/')?;
        Some(Self { analysis: analysis.to_owned(), file: file.to_owned() })
    }

    /// As part of a query.
    pub(super) fn query(&self) -> String {
        format!("analysis={}&file={}", encoded(&self.analysis), encoded(&self.file))
    }
}

/// A participant's models in the study's newest analysis that is done.
pub(super) enum Offered {
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

impl Offered {
    /// Asks for the analyses of a study.
    pub(super) fn ask<M>(study: &str, then: fn(Answer) -> M) -> Command<M>
    where
        M: 'static,
    {
        Command::Send(Request::get("analyses", routes::admin_analyses(study), then))
    }

    /// Takes the study's analyses, and asks for the models of the participant with this number in the newest
    /// that is done.
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
        // Models of experiment 2 do not say to which side somebody turns.
        let models = routes::analysis_predictors(&newest.id);
        let url = format!("{models}?participant={number}&experiment=1&limit=500");
        let then = move |answer| then(newest.id, answer);
        vec![Command::Send(Request::get("models", url, then))]
    }

    /// Takes the participant's models in an analysis.
    pub(super) fn models(&mut self, analysis: String, answer: Answer) {
        *self = match read::<PredictorPage>(answer) {
            Ok(page) if page.predictors.is_empty() => Self::NoModels,
            Ok(page) => Self::Models(analysis, page.predictors),
            Err(failure) => Self::Failed(failure.sentence),
        };
    }

    /// The models with words for each.
    pub(super) fn list(&self) -> Vec<(Named, String)> {
        let Self::Models(analysis, models) = self else { return Vec::new() };
        let named = |it: &PredictorSummary| {
            let named = Named { analysis: analysis.clone(), file: it.file.clone() };
            (
                named,
                format!(
                    "{}, {} % of inputs foreseen",
                    name(it),
                    fixed(100.0 * it.test_accuracy, 1)
                ),
            )
        };
        models.iter().map(named).collect()
    }

    /// What to do if there is nothing to choose from.
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

/// An option of a list.
pub(super) fn option<M>(value: String, is_chosen: bool, words: String) -> Node<M> {
    el("option").attr("value", value).attr_if(is_chosen, "selected", "").text(words)
}

/// Options under a heading.
pub(super) fn group<M>(words: String) -> Node<M> {
    el("optgroup").attr("label", words)
}

/// The groups of a list that has these models; what a link named may be something else, of which the server
/// said `source`.
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
        let words =
            format!("Participant {number} in the newest analysis: share of the inputs of test steps that it foresaw");
        group(words).children(options)
    });
    analysed.into_iter().chain(other).collect()
}

/// Which model it is and how good, with the analysis that made it.
pub(super) fn described<M>(source: &PredictorSource) -> Node<M> {
    let it = &source.summary;
    let (right, who) = (percent(it.test_accuracy), it.participant);
    let analysis = format!("/lab/analyses/{}", source.analysis);
    el("p")
        .text(format!("{} of participant {who}; {right} of test steps right. ", name(it)))
        .child(el("a").attr("href", analysis).text("Its analysis"))
}
