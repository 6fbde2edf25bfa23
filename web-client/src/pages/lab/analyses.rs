//! The analyses of a study: a form for a new analysis, and the state of all analyses.

use super::study::{self, Tab};
use super::visit::Visit;
use crate::form::Form;
use crate::json;
use crate::pages::parts::{self, alert, button, cell, count};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, AnalysisPage, AnalysisState, AnalysisSummary, StudySummary, routes};
use sidestep::comparison;
use sidestep::features::{FEATURES, Feature};

type Node = view::Node<Msg>;

/// The page of a study's analyses.
pub(super) struct Analyses {
    slug: String,
    may_manage: bool,
    study: Option<StudySummary>,
    analyses: Option<Vec<AnalysisSummary>>,
    next_before: Option<i64>,
    /// Number of analyses requested. The form is reset after each request.
    requests: u32,
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server described the study.
    Study(Answer),
    /// The server listed the newest analyses.
    Listed(Answer),
    /// Load older analyses.
    More,
    /// The server listed older analyses.
    Older(Answer),
    /// The form for a new analysis was submitted.
    Ask(Form),
    /// The server has queued the new analysis, or refused.
    Asked(Answer),
    /// Cancel an analysis.
    Cancel(String),
    /// The server has cancelled the analysis, or refused.
    Done(Answer),
}

impl Analyses {
    /// Creates the page for `/lab/studies/SLUG/analyses` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            slug: visit.id.to_owned(),
            may_manage: visit.session.access >= Access::Manage,
            study: None,
            analyses: None,
            next_before: None,
            requests: 0,
            trouble: None,
        };
        let mut commands = page.ask();
        commands.push(study::follow(|| Msg::Changed));
        (page, commands)
    }

    fn ask(&self) -> Commands<Msg> {
        let url = format!("{}?limit=20", routes::admin_analyses(&self.slug));
        let list = Command::Send(Request::get("analyses", url, Msg::Listed));
        vec![study::ask(&self.slug, Msg::Study), list]
    }

    fn listed(&mut self, page: AnalysisPage) {
        // Keep the older analyses that are already in the list.
        let oldest = page.analyses.last().map(|analysis| analysis.created_at_ms);
        let mut analyses = page.analyses;
        let shown = self.analyses.take().unwrap_or_default();
        let has_older = shown.len() > analyses.len();
        if has_older {
            let ids: Vec<_> = analyses.iter().map(|analysis| analysis.id.clone()).collect();
            let older = shown.into_iter().filter(|it| {
                !ids.contains(&it.id) && oldest.is_some_and(|oldest| it.created_at_ms <= oldest)
            });
            analyses.extend(older);
        } else {
            self.next_before = page.next_before;
        }
        self.analyses = Some(analyses);
    }
}

/// Converts the form to a request.
fn request(form: &Form) -> comparison::Request {
    let names = form.text("features").split([',', ' ', '\n']).filter(|name| !name.is_empty());
    let features: Vec<String> = names.map(str::to_owned).collect();
    let name = form.text("set").trim().to_owned();
    let is_given = !(name.is_empty() && features.is_empty());
    comparison::Request {
        leakage: form.is_checked("leakage"),
        paper_only: form.is_checked("paper_only"),
        synthetic: form.is_checked("synthetic"),
        sets: is_given.then_some((name, features)).into_iter().collect(),
        ..comparison::Request::default()
    }
}

/// The settings of an analysis in words.
pub(super) fn settings(request: &comparison::Request) -> String {
    let mut words = vec![match request.paper_only {
        true => "only the paper’s comparison".to_owned(),
        false => "the paper’s comparison, learning curves, unseen people, importance of features"
            .to_owned(),
    }];
    words.extend(
        request.sets.iter().map(|(name, features)| format!("set {name} ({})", features.join(", "))),
    );
    if request.grids != comparison::Request::default().grids {
        words.push(format!("own hyper-parameters {}", json::write(&request.grids)));
    }
    if request.leakage {
        words.push("split by time step too".to_owned());
    }
    if request.synthetic {
        words.push("marked synthetic".to_owned());
    }
    words.join("; ")
}

/// The state of an analysis, with its progress.
pub(super) fn state<M>(analysis: &AnalysisSummary) -> view::Node<M> {
    let class = match analysis.state {
        AnalysisState::Done => "chip open",
        AnalysisState::Failed => "chip look same_timing",
        _ => "chip",
    };
    let chip = el("span").class(class).test_id("state").text(analysis.state.word());
    let stale = analysis.stale.then(|| {
        el("span")
            .class("chip look")
            .attr("title", "The study’s data have changed since this analysis began.")
            .test_id("stale")
            .text("data have changed since")
    });
    let node = el("span").class("progress").child(chip).children(stale);
    let Some(progress) = analysis.progress else { return node };
    let percent = 100 * progress.done / progress.of.max(1);
    let left = progress.left_s.map_or_else(String::new, |s| match s.ceil() {
        s if s < 90.0 => format!(", about {s:.0} s left"),
        s => format!(", about {:.0} min left", s / 60.0),
    });
    node.child(
        el("progress")
            .attr("max", progress.of.max(1))
            .attr("value", progress.done)
            .attr("aria-label", "Progress of the analysis"),
    )
    .text(format!("{percent} %{left}"))
}

impl Page for Analyses {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        let failure = match message {
            Msg::Changed => return self.ask(),
            Msg::Study(answer) => read(answer).map(|study| self.study = Some(study)).err(),
            Msg::Listed(answer) => match read(answer) {
                Ok(page) => {
                    self.listed(page);
                    None
                }
                Err(failure) => Some(failure),
            },
            Msg::More => {
                let Some(before) = self.next_before.take() else { return Vec::new() };
                let list = routes::admin_analyses(&self.slug);
                let url = format!("{list}?limit=20&before={before}");
                return vec![Command::Send(Request::get("older", url, Msg::Older))];
            }
            Msg::Older(answer) => match read::<AnalysisPage>(answer) {
                Ok(page) => {
                    self.analyses.get_or_insert_default().extend(page.analyses);
                    self.next_before = page.next_before;
                    None
                }
                Err(failure) => Some(failure),
            },
            Msg::Ask(form) => {
                self.trouble = None;
                let url = routes::admin_analyses(&self.slug);
                let body = Some(json::write(&request(&form)));
                let ask = Request::get("ask", url, Msg::Asked);
                return vec![Command::Send(Request { method: "POST", body, ..ask })];
            }
            Msg::Asked(answer) => match answer {
                Ok(_) => {
                    self.requests += 1;
                    return self.ask();
                }
                Err(failure) => Some(failure),
            },
            Msg::Cancel(id) => {
                let ask = Request::get("cancel", routes::cancel_analysis(&id), Msg::Done);
                return vec![Command::Send(Request { method: "POST", ..ask })];
            }
            Msg::Done(answer) => match answer {
                Ok(_) => return self.ask(),
                Err(failure) => Some(failure),
            },
        };
        if let Some(failure) = failure {
            self.trouble = Some(failure.sentence);
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        let (study, analyses) = match (&self.study, &self.analyses, &self.trouble) {
            (Some(study), Some(analyses), _) => (study, analyses),
            (.., Some(why)) => return parts::stuck("No analyses to show", why),
            _ => return parts::loading(),
        };
        let list = if analyses.is_empty() { empty(study) } else { self.table(analyses) };
        let more = self
            .next_before
            .map(|_| button("more", Msg::More).class("plain").text("Show older analyses"));
        el("main")
            .class("page")
            .children(study::head(study, Tab::Analyses, None))
            .children(self.trouble.as_deref().map(|why| alert("trouble", why)))
            .child(list)
            .children(more)
            .children(comparable(analyses))
            .children(self.may_manage.then(|| self.form()))
    }

    fn title(&self) -> String {
        let name = self.study.as_ref().map_or(&self.slug, |study| &study.title);
        format!("{name}: analyses")
    }
}

impl Analyses {
    fn table(&self, analyses: &[AnalysisSummary]) -> Node {
        // The table has a column for cancelling only while an analysis can be cancelled.
        let may_cancel = self.may_manage && analyses.iter().any(|it| !it.state.is_over());
        let columns = ["Requested", "State", "Settings", "Participants"];
        let columns = columns.into_iter().chain(may_cancel.then_some("Action"));
        let rows = analyses.iter().map(|analysis| self.row(analysis, may_cancel));
        let table = parts::table(columns, rows).test_id("analyses");
        el("div").class("scroll").attr("tabindex", 0).child(table)
    }

    fn row(&self, analysis: &AnalysisSummary, may_cancel: bool) -> Node {
        let link = el("a")
            .attr("href", format!("/lab/analyses/{}", analysis.id))
            .test_id("open-analysis")
            .child(el("time").moment(analysis.created_at_ms));
        let participants = match &analysis.result {
            Some(result) if result.excluded.is_empty() => result.participants.to_string(),
            Some(result) => format!("{}, {} excluded", result.participants, result.excluded.len()),
            None => "–".to_owned(),
        };
        let cancel = (!analysis.state.is_over()).then(|| {
            button(&format!("cancel-{}", analysis.id), Msg::Cancel(analysis.id.clone()))
                .class("danger")
                .attr("aria-label", "Cancel this analysis")
                .text("Cancel")
        });
        let cells = [
            el("td").child(link),
            el("td").child(state(analysis)),
            cell(settings(&analysis.request)).class("wraps"),
            cell(participants),
        ];
        let cancel = may_cancel.then(|| el("td").children(cancel));
        el("tr").key(&analysis.id).children(cells).children(cancel)
    }

    fn form(&self) -> Node {
        let tick = |name: &str, words: &str| {
            el("label")
                .class("check")
                .child(el("input").attrs(&[("type", "checkbox"), ("name", name)]).test_id(name))
                .child(el("span").text(words))
        };
        let field = |name: &str, label: &str, placeholder: &str| {
            el("label").class("stacked").child(el("span").text(label)).child(
                el("input")
                    .attrs(&[("name", name), ("placeholder", placeholder), ("autocomplete", "off")])
                    .test_id(name),
            )
        };
        let further = el("details").child(el("summary").text("A further feature set")).child(
            el("div").class("fields").child(field("set", "Name", "my_set")).child(field(
                "features",
                "Features, separated by commas",
                "v_h, distance",
            )),
        );
        let feature = |of: &Feature| {
            let unit = if of.unit == "1" { String::new() } else { format!(" ({})", of.unit) };
            el("div")
                .child(el("dt").child(el("code").text(of.name)))
                .child(el("dd").text(format!("{}{unit}", of.meaning)))
        };
        let features = el("details")
            .class("meanings")
            .child(el("summary").text("All features"))
            .child(el("dl").children(FEATURES.iter().map(feature)));
        let further = further.child(features);
        el("section").child(el("h2").text("New analysis")).child(
            el("form")
                .class("new-analysis")
                .key(self.requests)
                .on_submit(Msg::Ask)
                .test_id("new-analysis")
                .child(el("p").class("quiet").text(
                    "Models of three kinds learn each participant’s next input from features with \
                     and without the safety levels; tests say what helps. Only tasks are used, no \
                     familiarisation or practice. Test runs, participants whom an experimenter \
                     excluded, and deleted data are left out. Participants who withdrew without having their data deleted are included.",
                ))
                .child(tick(
                    "leakage",
                    "also test models on time steps of tasks that they learned from: this shows how over-optimistic \
                     such a test is",
                ))
                .child(tick(
                    "paper_only",
                    "only the paper’s comparison, without learning curves, unseen people and \
                     importance of features (a third faster)",
                ))
                .child(tick("synthetic", "the report says that the data are synthetic"))
                .child(further)
                .child(
                    el("button")
                        .attr("type", "submit")
                        .class("primary")
                        .test_id("ask")
                        .text("Start"),
                ),
        )
    }
}

/// A hint that analyses can be compared. It is shown once two analyses are finished.
fn comparable(analyses: &[AnalysisSummary]) -> Option<Node> {
    let mut done = analyses.iter().filter(|it| it.state == AnalysisState::Done);
    let newest = done.next()?;
    done.next()?;
    let link = el("a").attr("href", format!("/lab/analyses/{}", newest.id)).text("the newest one");
    Some(
        el("p")
            .class("quiet")
            .test_id("comparable")
            .text("Two analyses can be compared: open one, such as ")
            .child(link)
            .text(", and choose the other under “Compare with another analysis”."),
    )
}

fn empty(study: &StudySummary) -> Node {
    let words = match study.trials {
        0 => "This study has no trials yet. An analysis needs participants with stored tasks."
            .to_owned(),
        _ => format!(
            "{} took part. An analysis uses all who have stored tasks, except those whom an \
             experimenter excluded.",
            count(study.participants, "participant")
        ),
    };
    el("div")
        .class("empty")
        .child(el("p").text("No analyses yet."))
        .child(el("p").class("quiet").text(words))
}
