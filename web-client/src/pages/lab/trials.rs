//! The stored trials of a study, newest first, and the choice of the study.

use crate::pages::parts::{self, alert, button, cell, count};
use crate::runtime::{Address, Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{StudySummary, TrialPage, TrialSummary, routes};

type Node = view::Node<Msg>;

/// The page of a study's trials.
pub(super) struct Trials {
    /// Slug of the study that the address names; the first study if it names none.
    wanted: Option<String>,
    studies: Vec<StudySummary>,
    trials: Vec<TrialSummary>,
    next_before: Option<i64>,
    state: State,
    /// Why older trials did not come when they were last asked for.
    trouble: Option<String>,
}

enum State {
    /// Nothing can be shown yet.
    Loading,
    /// The list is shown as far as it has come.
    Listed,
    /// The list is shown, and more of it was asked for.
    LoadingMore,
    /// There is no list, for this reason.
    Failed(String),
}

/// What the page can be told.
#[derive(Clone, Debug)]
pub(super) enum Msg {
    /// The server listed the studies.
    Studies(Answer),
    /// The server listed trials.
    Listed(Answer),
    /// Another study was chosen.
    Choose(String),
    /// Older trials are wanted.
    More,
}

/// Trials that are asked for at once.
const PAGE_LENGTH: usize = 100;

impl Trials {
    /// The page as it opens at `/lab?study=SLUG`.
    pub(super) fn open(address: &Address) -> (Self, Commands<Msg>) {
        let page = Self {
            wanted: address.parameter("study").map(str::to_owned),
            studies: Vec::new(),
            trials: Vec::new(),
            next_before: None,
            state: State::Loading,
            trouble: None,
        };
        (page, vec![Command::Send(Request::get("studies", routes::ADMIN_STUDIES, Msg::Studies))])
    }

    /// The study whose trials are shown.
    fn study(&self) -> Option<&StudySummary> {
        match &self.wanted {
            Some(slug) => self.studies.iter().find(|study| study.slug == *slug),
            None => self.studies.first(),
        }
    }

    fn ask_for_trials(&self) -> Commands<Msg> {
        let Some(study) = self.study() else {
            return Vec::new();
        };
        let mut url = format!("{}?limit={PAGE_LENGTH}", routes::admin_trials(&study.slug));
        if let Some(before) = self.next_before {
            url.push_str(&format!("&before={before}"));
        }
        vec![Command::Send(Request::get("trials", url, Msg::Listed))]
    }

    fn studies_arrived(&mut self, studies: Vec<StudySummary>) -> Commands<Msg> {
        self.studies = studies;
        if self.study().is_none() {
            let why = match &self.wanted {
                None => "This server has no study yet.".to_owned(),
                Some(slug) => {
                    let known: Vec<_> =
                        self.studies.iter().map(|study| study.slug.as_str()).collect();
                    format!("This server has no study “{slug}”. It has: {}.", known.join(", "))
                }
            };
            self.state = State::Failed(why);
        }
        // The study is shown with its trials: an empty table would say that there are none.
        self.ask_for_trials()
    }
}

impl Page for Trials {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Studies(answer) => match read(answer) {
                Ok(studies) => return self.studies_arrived(studies),
                Err(failure) => self.state = State::Failed(failure.sentence),
            },
            Msg::Listed(answer) => match read::<TrialPage>(answer) {
                Ok(page) => {
                    self.trials.extend(page.trials);
                    self.next_before = page.next_before;
                    self.state = State::Listed;
                }
                // What is shown stays.
                Err(failure) if matches!(self.state, State::LoadingMore) => {
                    self.state = State::Listed;
                    self.trouble = Some(failure.sentence);
                }
                Err(failure) => self.state = State::Failed(failure.sentence),
            },
            Msg::Choose(slug) => return vec![Command::Visit(format!("/lab?study={slug}"))],
            // A second press asks for nothing more: the same rows would come twice.
            Msg::More if matches!(self.state, State::Listed) => {
                self.state = State::LoadingMore;
                self.trouble = None;
                return self.ask_for_trials();
            }
            Msg::More => {}
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        match (&self.state, self.study()) {
            (State::Failed(why), _) => parts::stuck("No trials to show", why),
            (State::Listed | State::LoadingMore, Some(study)) => self.list(study),
            _ => parts::loading(),
        }
    }

    fn title(&self) -> String {
        self.study().map_or_else(|| "Trials".to_owned(), |study| study.title.clone())
    }
}

impl Trials {
    fn list(&self, study: &StudySummary) -> Node {
        let counts = format!(
            "{} · {}",
            count(study.participants, "participant"),
            count(study.trials, "stored trial")
        );
        let title = el("div")
            .child(parts::heading(&study.title))
            .child(el("p").class("quiet").text(counts));
        let link = |href: String, name: &str, words: &str| {
            el("a").class("button").attr("href", href).test_id(name).text(words)
        };
        let actions = el("div")
            .class("actions")
            .child(link(format!("/s/{}", study.slug), "drive", "Drive a scene"))
            .child(link(routes::export(&study.slug), "export", "Export CSV").attr("download", ""));
        let more = self.next_before.map(|_| {
            let is_loading = matches!(self.state, State::LoadingMore);
            button("more", Msg::More)
                .class("plain")
                .attr_if(is_loading, "disabled", "")
                .text(if is_loading { "Loading…" } else { "Show older trials" })
        });
        el("main")
            .class("page")
            .children(self.chooser(study))
            .child(el("div").class("page-head").child(title).child(actions))
            .child(if self.trials.is_empty() { empty() } else { self.table() })
            .children(self.trouble.as_deref().map(|why| alert("no-more", why)))
            .children(more)
    }

    /// A list of all studies, if there are several.
    fn chooser(&self, current: &StudySummary) -> Option<Node> {
        let option = |study: &StudySummary| {
            let trials = count(study.trials, "trial");
            el("option")
                .attr("value", &study.slug)
                .attr_if(study.slug == current.slug, "selected", "")
                .text(format!("{} ({trials})", study.title))
        };
        let choice = el("select")
            .attr("name", "study")
            .test_id("study")
            .on_input(|value| Msg::Choose(value.text().to_owned()))
            .children(self.studies.iter().map(option));
        (self.studies.len() > 1).then(|| el("label").class("chooser").text("Study ").child(choice))
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
        el("div").class("scroll").child(table.class("trials").test_id("trials"))
    }
}

fn empty() -> Node {
    el("div").class("empty").child(el("p").text("No trials yet.")).child(
        el("p").class("quiet").text(
            "Drive a scene yourself, or send participants the address of the study. Their trials \
             appear here, ready to replay.",
        ),
    )
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
