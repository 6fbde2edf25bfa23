//! The model finder: study, analysis, participant, and search words.

use super::Msg as Whole;
use super::choice::Pane;
use crate::form::FieldValue;
use crate::pages::models::{Named, name};
use crate::pages::moment::select;
use crate::pages::parts::{alert, button, count};
use crate::runtime::{Answer, Command, Commands, Request, read};
use crate::view::{self, el};
use sidestep::api::{
    AnalysisPage, AnalysisState, AnalysisSummary, PredictorPage, PredictorSummary, StudySummary,
    routes,
};
use sidestep::chart::fixed;

type Node = view::Node<Whole>;

/// Maximum number of models shown. Search words narrow the list.
const MOST: usize = 12;

/// State of the finder. Its lists are loaded one after another.
pub(super) struct Finder {
    /// The pane in which the model will be used.
    pub(super) pane: Pane,
    studies: Vec<StudySummary>,
    study: String,
    /// The finished analyses of the study. `None` before the server has answered.
    analyses: Option<Vec<AnalysisSummary>>,
    analysis: String,
    /// The number of a participant. Empty for all participants.
    participant: String,
    page: Option<PredictorPage>,
    sought: String,
    trouble: Option<String>,
}

/// Messages to the finder.
#[derive(Clone, Debug)]
pub enum Msg {
    /// The server listed the studies.
    Studies(Answer),
    /// Select this study.
    Study(FieldValue),
    /// The server listed the analyses of the study.
    Analyses(Answer),
    /// Select this analysis.
    Analysis(FieldValue),
    /// Show only models of this participant.
    Participant(FieldValue),
    /// The server listed models.
    Models(Answer),
    /// Show only models that contain these words.
    Search(FieldValue),
}

impl Finder {
    /// Opens the finder for this pane, with this study selected.
    pub(super) fn open(pane: Pane, study: &str) -> (Self, Commands<Whole>) {
        let finder = Self {
            pane,
            studies: Vec::new(),
            study: study.to_owned(),
            analyses: None,
            analysis: String::new(),
            participant: String::new(),
            page: None,
            sought: String::new(),
            trouble: None,
        };
        let studies = ask("finder-studies", routes::ADMIN_STUDIES.to_owned(), Msg::Studies);
        let commands = vec![studies, finder.ask_analyses()];
        (finder, commands)
    }

    fn ask_analyses(&self) -> Command<Whole> {
        ask("finder-analyses", routes::admin_analyses(&self.study), Msg::Analyses)
    }

    /// Requests the models of experiment 1. Models of experiment 2 do not predict the direction of
    /// a turn.
    fn ask_models(&mut self) -> Commands<Whole> {
        self.page = None;
        if self.analysis.is_empty() {
            return Vec::new();
        }
        let route = routes::analysis_predictors(&self.analysis);
        let participant = match self.participant.as_str() {
            "" => String::new(),
            number => format!("&participant={number}"),
        };
        let url = format!("{route}?experiment=1&limit=500{participant}");
        vec![ask("finder-models", url, Msg::Models)]
    }

    pub(super) fn update(&mut self, message: Msg) -> Commands<Whole> {
        self.trouble = None;
        let taken = match message {
            Msg::Studies(answer) => read(answer).map(|studies| {
                self.studies = studies;
                Vec::new()
            }),
            Msg::Study(value) => {
                self.study = value.text().to_owned();
                (self.analyses, self.page) = (None, None);
                Ok(vec![self.ask_analyses()])
            }
            Msg::Analyses(answer) => read(answer).map(|page: AnalysisPage| {
                let analyses = page.analyses.into_iter();
                let done: Vec<_> = analyses.filter(|it| it.state == AnalysisState::Done).collect();
                self.analysis = done.first().map(|it| it.id.clone()).unwrap_or_default();
                self.participant.clear();
                self.analyses = Some(done);
                self.ask_models()
            }),
            Msg::Analysis(value) => {
                self.analysis = value.text().to_owned();
                self.participant.clear();
                Ok(self.ask_models())
            }
            Msg::Participant(value) => {
                self.participant = value.text().to_owned();
                Ok(self.ask_models())
            }
            Msg::Models(answer) => read(answer).map(|page| {
                self.page = Some(page);
                Vec::new()
            }),
            Msg::Search(value) => {
                self.sought = value.text().to_lowercase();
                Ok(Vec::new())
            }
        };
        taken.unwrap_or_else(|failure| {
            self.trouble = Some(format!("Models cannot be listed. {}", failure.sentence));
            Vec::new()
        })
    }

    /// The models that contain all search words.
    fn found<'a>(&'a self, page: &'a PredictorPage) -> impl Iterator<Item = &'a PredictorSummary> {
        page.predictors.iter().filter(|it| {
            let words = words(it).to_lowercase();
            self.sought.split_whitespace().all(|sought| words.contains(sought))
        })
    }

    pub(super) fn view(&self) -> Node {
        let studies = self.studies.iter();
        let mut studies: Vec<_> =
            studies.map(|it| (it.slug.clone(), format!("{} ({})", it.title, it.slug))).collect();
        if studies.is_empty() {
            studies.push((self.study.clone(), self.study.clone()));
        }
        let analyses = self.analyses.iter().flatten();
        let analyses: Vec<_> = analyses
            .enumerate()
            .map(|(place, it)| {
                let newest = if place == 0 { "the newest, " } else { "" };
                (it.id.clone(), format!("{newest}{}", it.id))
            })
            .collect();
        let people = self.page.as_ref().map(|page| page.choices.participants.as_slice());
        let mut participants = vec![(String::new(), "all".to_owned())];
        let numbers = people.unwrap_or_default().iter();
        participants.extend(numbers.map(|it| (it.to_string(), format!("participant {it}"))));
        let has_analyses = !analyses.is_empty();
        let empty = self.analyses.as_ref().is_some_and(Vec::is_empty).then(|| {
            let words = "No analysis of this study is done.";
            el("p").class("quiet").test_id("finder-empty").text(words)
        });
        let study = select("finder-study", "Study", studies, &self.study, |value| {
            Whole::Finder(Msg::Study(value))
        });
        let analysis = has_analyses.then(|| {
            select("finder-analysis", "Analysis", analyses, &self.analysis, |value| {
                Whole::Finder(Msg::Analysis(value))
            })
        });
        let who = has_analyses.then(|| {
            select("finder-participant", "Participant", participants, &self.participant, |value| {
                Whole::Finder(Msg::Participant(value))
            })
        });
        let search = el("div")
            .class("pair")
            .child(el("label").attr("for", "finder-search").text("Search"))
            .child(
                el("input")
                    .attrs(&[("type", "search"), ("id", "finder-search")])
                    .attrs(&[("autocomplete", "off"), ("placeholder", "tree hrd")])
                    .test_id("finder-search")
                    .on_input(|value| Whole::Finder(Msg::Search(value))),
            );
        let heading = match self.pane {
            Pane::First => "Find a model",
            Pane::Second => "Find a model for the second picture",
        };
        el("section")
            .class("finder")
            .test_id("finder")
            .child(el("h2").text(heading))
            .child(study)
            .children(analysis)
            .children(who)
            .children(has_analyses.then_some(search))
            .children(empty)
            .children(self.trouble.as_deref().map(|why| alert("finder-trouble", why)))
            .children(self.page.as_ref().map(|page| self.models(page)))
            .child(button("finder-close", Whole::Find(self.pane)).class("plain find").text("Close"))
    }

    fn models(&self, page: &PredictorPage) -> Node {
        let total = self.found(page).count();
        let entry = |it: &PredictorSummary| {
            let words = format!(
                "{}, {} % of inputs predicted right",
                words(it),
                fixed(100.0 * it.test_accuracy, 1)
            );
            let named = Named { analysis: self.analysis.clone(), file: it.file.clone() };
            let message = Whole::Choose(self.pane, FieldValue::Text(named.value()));
            let button = button("found-model", message).class("plain").text(words);
            el("li").key(&it.file).child(button)
        };
        let shown = self.found(page).take(MOST).map(entry);
        let mut words = count(total, "model");
        if total > MOST {
            words
                .push_str(&format!("; the first {MOST} are shown. Search for words of the others"));
        }
        let listed = page.predictors.len() as u64;
        if page.total > listed {
            words.push_str(&format!(
                ". Of {} models, {listed} are searched: choose a participant for the others",
                page.total
            ));
        }
        el("div")
            .child(
                el("p")
                    .class("quiet")
                    .attr("role", "status")
                    .test_id("finder-count")
                    .text(format!("{words}.")),
            )
            .child(el("ul").class("found").children(shown))
    }
}

/// The searchable text of a model.
fn words(it: &PredictorSummary) -> String {
    format!("Participant {}: {}", it.participant, name(it))
}

fn ask(name: &'static str, url: String, then: fn(Answer) -> Msg) -> Command<Whole> {
    Command::Send(Request::get(name, url, move |answer| Whole::Finder(then(answer))))
}
