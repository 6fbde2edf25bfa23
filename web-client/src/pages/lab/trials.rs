//! The stored trials of a study, newest first. New trials appear as soon as they are stored.

use super::study::{self, Tab};
use super::visit::Visit;
use crate::pages::parts::{self, alert, button, cell};
use crate::runtime::{Answer, Command, Commands, Failure, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, StudySummary, TrialPage, TrialSummary, routes};

type Node = view::Node<Msg>;

/// The page of a study's trials.
pub(super) struct Trials {
    slug: String,
    /// Whether the user may download data.
    may_export: bool,
    study: Option<StudySummary>,
    trials: Vec<TrialSummary>,
    next_before: Option<i64>,
    state: State,
    /// The reason why the last request for trials failed.
    trouble: Option<String>,
}

enum State {
    /// The list is not loaded yet.
    Loading,
    /// The list is shown.
    Listed,
    /// The list is shown, and older trials have been requested.
    LoadingMore,
    /// The list could not be loaded, for this reason.
    Failed(String),
}

/// Messages to the page.
#[derive(Clone, Debug)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server described the study.
    Study(Answer),
    /// The server listed the newest trials.
    Newest(Answer),
    /// The server listed older trials.
    Older(Answer),
    /// Load older trials.
    More,
}

/// Number of trials per request.
const PAGE_LENGTH: usize = 100;

impl Trials {
    /// Creates the page for `/lab/studies/SLUG/trials` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            slug: visit.id.to_owned(),
            may_export: visit.session.access >= Access::Export,
            study: None,
            trials: Vec::new(),
            next_before: None,
            state: State::Loading,
            trouble: None,
        };
        let mut commands = page.ask();
        commands.push(study::follow(|| Msg::Changed));
        (page, commands)
    }

    /// Requests the study and the newest trials.
    fn ask(&self) -> Commands<Msg> {
        let url = format!("{}?limit={PAGE_LENGTH}", routes::admin_trials(&self.slug));
        let newest = Command::Send(Request::get("newest", url, Msg::Newest));
        vec![study::ask(&self.slug, Msg::Study), newest]
    }

    /// Inserts new trials at the beginning of the list.
    fn newest_arrived(&mut self, page: TrialPage) {
        let newest_shown = self.trials.first().map(|trial| trial.trial_id.clone());
        let known = |trial: &TrialSummary| Some(&trial.trial_id) == newest_shown.as_ref();
        match page.trials.iter().position(known) {
            Some(new) => drop(self.trials.splice(..0, page.trials.into_iter().take(new))),
            // Either all trials are new, or the newest trial in the list no longer exists.
            None => (self.trials, self.next_before) = (page.trials, page.next_before),
        }
    }

    /// Reports a failure. A list that is already shown is kept.
    fn failed(&mut self, failure: Failure) {
        match self.state {
            State::Loading | State::Failed(_) => self.state = State::Failed(failure.sentence),
            State::Listed | State::LoadingMore => {
                self.state = State::Listed;
                self.trouble = Some(failure.sentence);
            }
        }
    }
}

impl Page for Trials {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Changed => return self.ask(),
            Msg::Study(answer) => match read(answer) {
                Ok(study) => self.study = Some(study),
                Err(failure) => self.failed(failure),
            },
            Msg::Newest(answer) => match read(answer) {
                Ok(page) => {
                    self.newest_arrived(page);
                    if matches!(self.state, State::Loading | State::Failed(_)) {
                        self.state = State::Listed;
                    }
                    self.trouble = None;
                }
                Err(failure) => self.failed(failure),
            },
            Msg::Older(answer) => match read::<TrialPage>(answer) {
                Ok(page) => {
                    self.trials.extend(page.trials);
                    self.next_before = page.next_before;
                    self.state = State::Listed;
                }
                Err(failure) => self.failed(failure),
            },
            // Ignore a second press, which would load the same rows twice.
            Msg::More if matches!(self.state, State::Listed) => {
                let Some(before) = self.next_before else { return Vec::new() };
                self.state = State::LoadingMore;
                self.trouble = None;
                let list = routes::admin_trials(&self.slug);
                let url = format!("{list}?limit={PAGE_LENGTH}&before={before}");
                return vec![Command::Send(Request::get("older", url, Msg::Older))];
            }
            Msg::More => {}
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        match (&self.state, &self.study) {
            (State::Failed(why), _) => parts::stuck("No trials to show", why),
            (State::Listed | State::LoadingMore, Some(study)) => self.list(study),
            _ => parts::loading(),
        }
    }

    fn title(&self) -> String {
        let name = self.study.as_ref().map_or(&self.slug, |study| &study.title);
        format!("{name}: trials")
    }
}

impl Trials {
    fn list(&self, study: &StudySummary) -> Node {
        let export = self.may_export.then(|| {
            el("a")
                .class("button")
                .attr("href", routes::exports(&study.slug))
                .attr("download", "")
                .test_id("export")
                .text("Trials as CSV")
        });
        let more = self.next_before.map(|_| {
            let is_loading = matches!(self.state, State::LoadingMore);
            button("more", Msg::More)
                .class("plain")
                .attr_if(is_loading, "disabled", "")
                .text(if is_loading { "Loading…" } else { "Show older trials" })
        });
        el("main")
            .class("page")
            .children(study::head(study, Tab::Trials, export))
            .child(if self.trials.is_empty() { empty() } else { self.table() })
            .children(self.trouble.as_deref().map(|why| alert("no-more", why)))
            .children(more)
    }

    fn table(&self) -> Node {
        let columns = [
            "Participant",
            "Scene",
            "Closest",
            "Danger zone",
            "Turned",
            "Stored",
            "Flags",
            "Replay",
        ];
        let table = parts::table(columns, self.trials.iter().map(row));
        el("div").class("scroll").attr("tabindex", 0).child(table.class("trials").test_id("trials"))
    }
}

fn empty() -> Node {
    el("div")
        .class("empty")
        .child(el("p").text("No trials yet."))
        .child(el("p").class("quiet").text(
        "Send participants the address of the study. Their trials appear here, ready to replay.",
    ))
}

fn row(trial: &TrialSummary) -> Node {
    let outcome = &trial.outcome;
    let danger = match outcome.first_step_in_danger {
        Some(step) => cell(format!("from step {step}")).class("robot"),
        None => cell("not entered"),
    };
    let turned = match outcome.avoidance {
        Some((first, last)) => format!("steps {first}–{last}"),
        None => "never".to_owned(),
    };
    let scene = trial.scene_words();
    let replay = el("a")
        .attr("href", format!("/lab/replay/{}", trial.trial_id))
        .attr("aria-label", format!("Replay participant {}, {scene}", trial.participant_number))
        .test_id("replay-link")
        .text("Replay");
    el("tr").key(&trial.trial_id).children([
        cell(trial.participant_number.to_string()),
        cell(scene),
        cell(format!("{:.2} m", outcome.closest_m)),
        danger,
        cell(turned),
        el("td").child(el("time").moment(trial.received_at_ms)),
        cell(parts::flags(&trial.flags)),
        el("td").child(replay),
    ])
}
