//! The models of an analysis, for download or for use in a replay. The server filters and paginates
//! them. The page's address contains the selection.

use super::pager::pager;
use crate::form::FieldValue;
use crate::pages::parts::{self, alert, cell, percent, table};
use crate::runtime::{Address, Answer, Command, Commands, Request, encoded, read};
use crate::view::{self, el};
use sidestep::api::{PredictorPage, PredictorSummary, routes};

type Node = view::Node<Msg>;

/// Number of models on a page.
const PAGE_LENGTH: u64 = 20;

/// The models of an analysis.
pub(super) struct Predictors {
    analysis: String,
    chosen: Chosen,
    page: Option<PredictorPage>,
    trouble: Option<String>,
}

/// The selection of models. Each filter is the text of its URL parameter, or empty for all models.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Chosen {
    participant: String,
    model: String,
    experiment: String,
    features: String,
    offset: u64,
}

/// Messages to the list.
#[derive(Clone)]
pub(super) enum Msg {
    /// The server listed models.
    Listed(Answer),
    /// Show only models of this participant.
    Participant(FieldValue),
    /// Show only this kind of model.
    Model(FieldValue),
    /// Show only this experiment.
    Experiment(FieldValue),
    /// Show only this feature set.
    Features(FieldValue),
    /// Show the page that begins after this number of models.
    Page(u64),
}

impl Chosen {
    fn of(address: &Address) -> Self {
        let text = |name: &str| address.parameter(name).unwrap_or_default().to_owned();
        Self {
            participant: text("participant"),
            model: text("model"),
            experiment: text("experiment"),
            features: text("features"),
            offset: text("offset").parse().unwrap_or(0),
        }
    }

    /// The query for the server's list, without the page length. The page's own address has the
    /// same query.
    fn query(&self) -> String {
        let offset = if self.offset > 0 { self.offset.to_string() } else { String::new() };
        let pairs = [
            ("participant", &self.participant),
            ("model", &self.model),
            ("experiment", &self.experiment),
            ("features", &self.features),
            ("offset", &offset),
        ];
        let pairs = pairs.into_iter().filter(|(_, value)| !value.is_empty());
        let pairs: Vec<_> =
            pairs.map(|(name, value)| format!("{name}={}", encoded(value))).collect();
        pairs.join("&")
    }
}

impl Predictors {
    /// Creates the list for an analysis. The page's address contains the selection.
    pub(super) fn new(analysis: &str, address: &Address) -> Self {
        let (analysis, chosen) = (analysis.to_owned(), Chosen::of(address));
        Self { analysis, chosen, page: None, trouble: None }
    }

    /// Requests the selected models.
    pub(super) fn ask(&self) -> Command<Msg> {
        let (route, query) = (routes::analysis_predictors(&self.analysis), self.chosen.query());
        let url = format!("{route}?limit={PAGE_LENGTH}&{query}");
        Command::Send(Request::get("predictors", url.trim_end_matches('&'), Msg::Listed))
    }

    pub(super) fn update(&mut self, message: Msg) -> Commands<Msg> {
        match message {
            Msg::Listed(answer) => {
                match read(answer) {
                    Ok(page) => (self.page, self.trouble) = (Some(page), None),
                    Err(failure) => self.trouble = Some(failure.sentence),
                }
                Vec::new()
            }
            Msg::Participant(value) => self.choose(|it| &mut it.participant, &value),
            Msg::Model(value) => self.choose(|it| &mut it.model, &value),
            Msg::Experiment(value) => self.choose(|it| &mut it.experiment, &value),
            Msg::Features(value) => self.choose(|it| &mut it.features, &value),
            Msg::Page(offset) => self.show(Chosen { offset, ..self.chosen.clone() }),
        }
    }

    fn choose(
        &mut self,
        part: fn(&mut Chosen) -> &mut String,
        value: &FieldValue,
    ) -> Commands<Msg> {
        let mut chosen = Chosen { offset: 0, ..self.chosen.clone() };
        value.text().clone_into(part(&mut chosen));
        self.show(chosen)
    }

    fn show(&mut self, chosen: Chosen) -> Commands<Msg> {
        self.chosen = chosen;
        let query = self.chosen.query();
        let mark = if query.is_empty() { "" } else { "?" };
        let address = format!("/lab/analyses/{}{mark}{query}", self.analysis);
        vec![Command::ReplaceAddress(address), self.ask()]
    }

    /// The list with its filters. Returns `None` before the server has answered.
    pub(super) fn view(&self) -> Option<Node> {
        let section = el("section").attr("id", "predictors").child(el("h2").text("Predictors"));
        let trouble = self.trouble.as_deref().map(|why| alert("predictors-trouble", why));
        let Some(page) = &self.page else {
            return trouble.map(|trouble| section.child(trouble));
        };
        if page.choices.participants.is_empty() {
            let words = "An earlier version of Sidestep made this analysis. Its models are among the \
                         files; start the analysis again to list them here.";
            return Some(
                section.child(el("p").class("quiet").test_id("no-predictors").text(words)),
            );
        }
        let about = "One entry for each participant, kind of model, experiment and feature set. Models of experiment I \
             predict right, straight or left, and can be used in a replay. Those of experiment II predict whether a \
             person turns but not the direction, so they cannot.";
        Some(
            section
                .child(el("p").class("quiet").text(about))
                .child(self.filters(page))
                .children(trouble)
                .child(self.table(page))
                .children(pager(
                    (self.chosen.offset, page.predictors.len(), page.total),
                    PAGE_LENGTH,
                    Msg::Page,
                )),
        )
    }

    fn filters(&self, page: &PredictorPage) -> Node {
        let choices = &page.choices;
        let same = |values: &[String]| values.iter().map(|it| (it.clone(), it.clone())).collect();
        let participants = choices.participants.iter();
        let participants =
            participants.map(|it| (it.to_string(), format!("participant {it}"))).collect();
        let models = choices.models.iter();
        let models = models.map(|it| (it.clone(), parts::model(it).to_owned())).collect();
        let experiments = choices.experiments.iter();
        let experiments = experiments.map(|it| (it.to_string(), experiment(*it))).collect();
        let features = same(&choices.features);
        let chosen = &self.chosen;
        el("div").class("filters").children([
            select("participant", "all participants", &chosen.participant, participants)
                .on_input(Msg::Participant),
            select("model", "all models", &chosen.model, models).on_input(Msg::Model),
            select("experiment", "both experiments", &chosen.experiment, experiments)
                .on_input(Msg::Experiment),
            select("features", "all feature sets", &chosen.features, features)
                .on_input(Msg::Features),
        ])
    }

    fn table(&self, page: &PredictorPage) -> Node {
        if page.predictors.is_empty() {
            let words = "No model matches the filters.";
            return el("p").class("empty").test_id("no-predictors").text(words);
        }
        let columns = [
            "Participant",
            "Model",
            "Experiment",
            "Features",
            "Cross-validated",
            "In test",
            "Use it",
        ];
        let rows = page.predictors.iter().map(|it| self.row(it));
        el("div")
            .class("scroll")
            .attrs(&[("tabindex", "0"), ("role", "region"), ("aria-label", "Predictors")])
            .child(table(columns, rows).test_id("predictors"))
    }

    fn row(&self, it: &PredictorSummary) -> Node {
        let download = el("a")
            .attr("href", routes::analysis_file(&self.analysis, &it.file))
            .attrs(&[("download", ""), ("title", &it.file)])
            .attr("aria-label", format!("Download {}", it.file))
            .test_id("download")
            .text("Download");
        let replay = it.newest_task.as_ref().filter(|_| it.experiment == 1).map(|trial| {
            let (analysis, file) = (encoded(&self.analysis), encoded(&it.file));
            el("a")
                .attr("href", format!("/lab/replay/{trial}?analysis={analysis}&file={file}"))
                .attr("aria-label", format!("Use in replay: {}", it.file))
                .test_id("use-in-replay")
                .text("Use in replay")
        });
        let uses = el("span").class("uses").child(download).children(replay);
        el("tr")
            .key(&it.file)
            .child(el("th").attr("scope", "row").text(it.participant.to_string()))
            .child(cell(parts::model(&it.model)))
            .child(cell(experiment(it.experiment)))
            .child(cell(it.features.clone()).attr("title", it.columns.join(", ")))
            .child(cell(percent(it.cv_accuracy)))
            .child(cell(percent(it.test_accuracy)))
            .child(el("td").child(uses))
    }
}

fn experiment(number: u8) -> String {
    let words = if number == 1 { "I, direction" } else { "II, turn or not" };
    words.to_owned()
}

/// A selection list. `options` contains values with labels. An additional first entry selects all.
fn select(name: &str, all: &str, chosen: &str, options: Vec<(String, String)>) -> Node {
    let option = |(value, words): (String, String)| {
        el("option").attr_if(value == chosen, "selected", "").attr("value", value).text(words)
    };
    el("select")
        .attrs(&[("name", name), ("aria-label", name)])
        .test_id(&format!("only-{name}"))
        .child(option((String::new(), all.to_owned())))
        .children(options.into_iter().map(option))
}
