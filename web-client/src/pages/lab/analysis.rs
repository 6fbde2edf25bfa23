//! One analysis: its progress or, once it is finished, its report, its files and its input data.

use super::analyses::{settings, state};
use super::compare;
use super::predictors::{self, Predictors};
use super::study::{self, Tab};
use super::visit::Visit;
use crate::form::FieldValue;
use crate::pages::parts::{self, alert, button, count, fact, size};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{
    Access, AnalysisDetail, AnalysisFile, AnalysisPage, AnalysisResult, AnalysisState,
    AnalysisSummary, routes,
};
use std::rc::Rc;

type Node = view::Node<Msg>;

/// The page of an analysis.
pub(super) struct AnalysisView {
    id: String,
    may_manage: bool,
    analysis: Option<AnalysisDetail>,
    /// The analyses of the same study, once loaded.
    others: Option<Vec<AnalysisSummary>>,
    /// The analysis to compare this one with.
    other: Option<AnalysisSummary>,
    predictors: Predictors,
    /// Whether the page asks the user to confirm the deletion of the analysis.
    deleting: bool,
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server described the analysis.
    Found(Answer),
    /// The server listed the study's analyses.
    Others(Answer),
    /// Compare this analysis with another one, or stop comparing.
    Compare(FieldValue),
    /// The server described the other analysis.
    Other(Answer),
    /// A message to the list of this analysis's models.
    Predictors(predictors::Msg),
    /// Cancel the analysis.
    Cancel,
    /// The server has cancelled the analysis, or refused.
    Cancelled(Answer),
    /// Ask for confirmation before the analysis is deleted, or stop asking.
    AskToDelete(bool),
    /// The user has confirmed the deletion.
    Delete,
    /// The server has deleted the analysis, or refused.
    Deleted(Answer),
}

/// File name of the report.
const REPORT: &str = "report.html";

impl AnalysisView {
    /// Creates the page for `/lab/analyses/ID` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            id: visit.id.to_owned(),
            may_manage: visit.session.access >= Access::Manage,
            analysis: None,
            others: None,
            other: None,
            predictors: Predictors::new(visit.id, visit.address),
            deleting: false,
            trouble: None,
        };
        let commands = vec![page.ask(), study::follow(|| Msg::Changed)];
        (page, commands)
    }

    fn ask(&self) -> Command<Msg> {
        Command::Send(Request::get("analysis", routes::admin_analysis(&self.id), Msg::Found))
    }
}

impl Page for AnalysisView {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        let failure = match message {
            Msg::Changed => return vec![self.ask()],
            Msg::Found(answer) => match read::<AnalysisDetail>(answer) {
                Ok(found) => {
                    let study = &found.summary.study;
                    let is_news = found.summary.result.is_some() && self.others.is_none();
                    let list = Request::get("others", routes::admin_analyses(study), Msg::Others);
                    let models = self.predictors.ask().map(Msg::Predictors);
                    self.analysis = Some(found);
                    self.trouble = None;
                    return if is_news { vec![Command::Send(list), models] } else { Vec::new() };
                }
                Err(failure) => {
                    // The analysis may have been deleted meanwhile.
                    self.analysis = self.analysis.take().filter(|_| failure.status != 404);
                    Some(failure)
                }
            },
            Msg::Others(answer) => match read::<AnalysisPage>(answer) {
                Ok(page) => {
                    self.others = Some(page.analyses);
                    None
                }
                Err(failure) => Some(failure),
            },
            Msg::Compare(value) => {
                let id = value.text();
                self.other = None;
                if id.is_empty() {
                    return Vec::new();
                }
                let ask = Request::get("other", routes::admin_analysis(id), Msg::Other);
                return vec![Command::Send(ask)];
            }
            Msg::Other(answer) => match read::<AnalysisDetail>(answer) {
                Ok(found) => {
                    self.other = Some(found.summary);
                    None
                }
                Err(failure) => Some(failure),
            },
            Msg::Predictors(message) => {
                let commands = self.predictors.update(message).into_iter();
                return commands.map(|command| command.map(Msg::Predictors)).collect();
            }
            Msg::Cancel => {
                let ask = Request::get("cancel", routes::cancel_analysis(&self.id), Msg::Cancelled);
                return vec![Command::Send(Request { method: "POST", ..ask })];
            }
            Msg::Cancelled(answer) => match answer {
                Ok(_) => return vec![self.ask()],
                Err(failure) => Some(failure),
            },
            Msg::AskToDelete(on) => {
                self.deleting = on;
                None
            }
            Msg::Delete => {
                let ask = Request::get("delete", routes::admin_analysis(&self.id), Msg::Deleted);
                return vec![Command::Send(Request { method: "DELETE", ..ask })];
            }
            Msg::Deleted(answer) => match (answer, &self.analysis) {
                (Ok(_), Some(analysis)) => {
                    let list = Tab::Analyses.address(&analysis.summary.study);
                    return vec![Command::Visit(list)];
                }
                (Ok(_), None) => return vec![Command::Visit("/lab".to_owned())],
                (Err(failure), _) => Some(failure),
            },
        };
        self.trouble = failure.map(|failure| failure.sentence);
        Vec::new()
    }

    fn view(&self) -> Node {
        let analysis = match (&self.analysis, &self.trouble) {
            (Some(analysis), _) => analysis,
            (None, Some(why)) => return parts::stuck("No analysis to show", why),
            (None, None) => return parts::loading(),
        };
        let summary = &analysis.summary;
        let study = &summary.study;
        let back =
            el("a").attr("href", Tab::Analyses.address(study)).text(format!("Study {study}"));
        let head = el("div")
            .child(el("p").class("quiet").child(back))
            .child(el("div").class("title").child(parts::heading("Analysis")).child(state(summary)))
            .child(el("p").class("quiet").text(settings(&summary.request)));
        el("main")
            .class("page")
            .child(el("div").class("page-head").child(head).child(self.actions(analysis)))
            .children(self.trouble.as_deref().map(|why| alert("trouble", why)))
            .children(words(analysis))
            .children(summary.result.as_ref().map(|result| data(study, analysis, result)))
            .children(self.comparison(summary))
            .children(report(analysis))
            .children(self.predictors(summary))
            .children(files(&self.id, &analysis.files))
    }

    fn title(&self) -> String {
        let study = self.analysis.as_ref().map(|analysis| analysis.summary.study.as_str());
        study.map_or_else(|| "Analysis".to_owned(), |study| format!("{study}: analysis"))
    }
}

impl AnalysisView {
    /// The list of models, if the analysis has results.
    fn predictors(&self, own: &AnalysisSummary) -> Option<Node> {
        own.result.as_ref()?;
        let lift: Rc<dyn Fn(predictors::Msg) -> Msg> = Rc::new(Msg::Predictors);
        Some(self.predictors.view()?.map(&lift))
    }

    fn comparison(&self, own: &AnalysisSummary) -> Option<Node> {
        compare::section(own, self.others.as_ref()?, self.other.as_ref(), Msg::Compare)
    }
}

/// Explains the state of the analysis, if the name of the state is not clear enough.
fn words(analysis: &AnalysisDetail) -> Option<Node> {
    let summary = &analysis.summary;
    let words = match summary.state {
        AnalysisState::Queued => "It waits for other analyses to end.",
        AnalysisState::Running => "It runs on the server; you may close this page.",
        AnalysisState::Failed => summary.message.as_deref().unwrap_or("It failed."),
        AnalysisState::Cancelled => "It was cancelled.",
        AnalysisState::Withdrawn => {
            "Its files were deleted, since they held data of a participant who withdrew. Start \
             another analysis without them."
        }
        AnalysisState::Done => return None,
    };
    let failed = summary.state == AnalysisState::Failed;
    Some(el("p").class(if failed { "trouble" } else { "" }).test_id("words").text(words))
}

/// The input data.
fn data(study: &str, analysis: &AnalysisDetail, result: &AnalysisResult) -> Node {
    let mut facts = vec![fact("Participants", result.participants.to_string())];
    facts.extend(result.models.map(|models| fact("Models trained", models.to_string())));
    for (flag, trials) in &result.flagged {
        facts.push(fact(&flag.replace('_', " "), count(trials, "trial")));
    }
    let moments = analysis.summary.ended_at_ms.map(|ms| {
        el("p")
            .class("quiet")
            .text("The data are those of ")
            .child(el("time").moment(analysis.summary.started_at_ms.unwrap_or(ms)))
    });
    let excluded = result
        .excluded
        .iter()
        .map(|it| el("li").text(format!("Participant {}: {}", it.participant, it.reason)));
    let excluded = (!result.excluded.is_empty()).then(|| {
        el("details")
            .child(
                el("summary")
                    .text(format!("{} excluded", count(result.excluded.len(), "participant"))),
            )
            .child(el("ul").test_id("excluded").children(excluded))
    });
    let same = (!result.same_trials.is_empty()).then(|| {
        let who = result.same_trials.join(", ");
        el("p").class("waiting").text(format!(
            "Participants {who} have exactly the same trials as another participant."
        ))
    });
    let synthetic = result.synthetic.as_ref().map(|why| {
        el("p").class("synthetic").test_id("synthetic").text(format!("Synthetic data: {why}"))
    });
    el("section")
        .child(el("h2").text(format!("Data of study {study}")))
        .child(el("dl").class("numbers").children(facts))
        .children(twice(result).map(|words| el("p").class("quiet").test_id("twice").text(words)))
        .children(synthetic)
        .children(same)
        .children(excluded)
        .children(moments)
        .children(provenance(result))
}

/// Explains why the lists and files have more entries than there are trained models, if this is the
/// case.
fn twice(result: &AnalysisResult) -> Option<String> {
    let models = result.models.filter(|models| *models < result.cells)?;
    Some(format!(
        "Of two SVMs, with RBF kernel and linear, the better one is listed a second time as “SVM, the \
         better of two”. The list of predictors and the folder of model files therefore have {} entries \
         for {models} models.",
        result.cells,
    ))
}

/// The program version and the data that produced the files.
fn provenance(result: &AnalysisResult) -> Option<Node> {
    let (version, hash) = (result.version.as_ref()?, result.data_sha256.as_ref()?);
    let short: String = hash.chars().take(12).collect();
    let hash = el("code").attr("title", hash).text(short);
    let versions: Vec<String> = result.study_versions.iter().map(u32::to_string).collect();
    let of = match &versions[..] {
        [] => String::new(),
        [one] => format!(" The participants had version {one} of the study."),
        several => format!(" The participants had versions {} of the study.", several.join(", ")),
    };
    let words = format!("Computed by Sidestep {version}.{of} SHA-256 of the analysed data: ");
    let words = el("p").class("quiet").test_id("provenance").text(words);
    Some(words.child(hash).text("… Test runs are never part of an analysis."))
}

/// The report, in a frame without any permissions.
fn report(analysis: &AnalysisDetail) -> Option<Node> {
    analysis.files.iter().find(|file| file.name == REPORT)?;
    let address = routes::analysis_file(&analysis.summary.id, REPORT);
    let alone = el("a").attrs(&[("href", &address), ("target", "_blank")]).text("Open it alone");
    Some(
        el("section")
            .child(el("h2").text("Report"))
            .child(
                el("p")
                    .class("quiet")
                    .child(alone)
                    .text(", to print it or to read it at full size."),
            )
            .child(
                el("iframe")
                    .class("report")
                    .attrs(&[
                        ("src", &address),
                        ("title", "Report of the analysis"),
                        ("sandbox", ""),
                    ])
                    .test_id("report"),
            ),
    )
}

fn files(id: &str, files: &[AnalysisFile]) -> Option<Node> {
    if files.is_empty() {
        return None;
    }
    let item = |file: &AnalysisFile| {
        let link = el("a")
            .attrs(&[("href", &routes::analysis_file(id, &file.name)), ("download", "")])
            .text(&file.name);
        el("li")
            .child(link)
            .child(el("small").class("quiet").text(format!(" {}", size(file.octets))))
    };
    let within = |folder: &str| files.iter().filter(|file| file.name.starts_with(folder)).collect();
    let (models, figures): (Vec<_>, Vec<_>) = (within("models/"), within("figures/"));
    let others = files.iter().filter(|file| !file.name.contains('/')).collect();
    let list =
        |files: Vec<&AnalysisFile>| el("ul").class("files").children(files.into_iter().map(item));
    let folder = |files: Vec<&AnalysisFile>, words: String| {
        let summary = el("summary").text(words);
        (!files.is_empty()).then(|| el("details").child(summary).child(list(files)))
    };
    let pictures = format!("{} as SVG", count(figures.len(), "figure"));
    let predictors = format!("{} for sidestep shfrs", count(models.len(), "model file"));
    Some(
        el("section")
            .child(el("h2").text("Files"))
            .child(list(others).test_id("files"))
            .children(folder(figures, pictures))
            .children(folder(models, predictors)),
    )
}

impl AnalysisView {
    fn actions(&self, analysis: &AnalysisDetail) -> Node {
        let actions = el("div").class("actions");
        if !self.may_manage {
            return actions;
        }
        if !analysis.summary.state.is_over() {
            return actions.child(button("cancel", Msg::Cancel).text("Cancel"));
        }
        if !self.deleting {
            let delete = button("delete", Msg::AskToDelete(true)).class("danger");
            return actions.child(delete.text("Delete…"));
        }
        let sure =
            button("sure", Msg::Delete).class("danger").focus().text("Delete with all files");
        let keep = button("keep", Msg::AskToDelete(false)).class("plain").text("Keep");
        actions.child(sure).child(keep)
    }
}
