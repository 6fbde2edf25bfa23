//! The laboratory: sign-in, stored trials, replay, and the machine's self-check.

use super::replay::Replay;
use crate::json;
use crate::runtime::{Answer, App, Command, Event, Failure, Request, Surroundings, Tag};
use crate::shape::Picture;
use crate::view::{Node, el};
use sidestep::api::{SelfCheck, SignIn, StudySummary, TrialPage, TrialSummary, routes};
use sidestep::features::SafetyFunctions;
use sidestep::reachability::ValueFunction;
use sidestep::trial::simulation_fingerprint;

/// The laboratory's pages.
#[derive(Default)]
pub struct Lab {
    place: Place,
    now_ms: f64,
    key: String,
    trouble: Option<String>,
    studies: Vec<StudySummary>,
    trials: Vec<TrialSummary>,
    next_before: Option<i64>,
    listed: bool,
    page: Page,
}

/// What the address asks for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum Place {
    #[default]
    Trials,
    Replay(String),
    SelfCheck,
    Unknown,
}

/// What is shown.
#[derive(Default)]
enum Page {
    #[default]
    Loading,
    SignIn {
        busy: bool,
    },
    Trials,
    Replay(Box<Replay>),
    SelfCheck {
        here: String,
        server: SelfCheck,
    },
    Stuck(String),
}

const PAGE_LENGTH: usize = 100;

impl Lab {
    /// The page before it is opened.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn open(&mut self, surroundings: &Surroundings) -> Vec<Command> {
        let path = surroundings.path.trim_end_matches('/');
        self.place = match path.strip_prefix("/lab").unwrap_or_default() {
            "" => Place::Trials,
            "/self-check" => Place::SelfCheck,
            rest => rest
                .strip_prefix("/replay/")
                .map_or(Place::Unknown, |id| Place::Replay(id.to_owned())),
        };
        if let Some(key) = surroundings.fragment.strip_prefix("key=") {
            // The key leaves the address at once, and with it history and screenshots.
            let clean = Command::ReplaceAddress(surroundings.path.clone());
            return [clean].into_iter().chain(self.sign_in(key)).collect();
        }
        vec![Command::Send(Request::get(Tag::Session, routes::SESSION))]
    }

    fn sign_in(&mut self, key: &str) -> Vec<Command> {
        self.page = Page::SignIn { busy: true };
        self.key = key.trim().to_owned();
        let body = Some(json::write(&SignIn { key: self.key.clone() }));
        let url = routes::SESSION.to_owned();
        vec![Command::Send(Request { tag: Tag::Session, method: "POST", url, token: None, body })]
    }

    /// The laboratory is open: asks for what the address names.
    fn enter(&mut self) -> Vec<Command> {
        self.page = Page::Loading;
        let request = match &self.place {
            Place::Trials => Request::get(Tag::Studies, routes::ADMIN_STUDIES),
            Place::Replay(id) => Request::get(Tag::Trial, routes::admin_trial(id)),
            Place::SelfCheck => Request::get(Tag::SelfCheck, routes::SELF_CHECK),
            Place::Unknown => {
                self.page = Page::Stuck("There is no such page in the laboratory.".to_owned());
                return Vec::new();
            }
        };
        vec![Command::Send(request)]
    }

    fn list(&self) -> Vec<Command> {
        let Some(study) = self.studies.first() else {
            return Vec::new();
        };
        let mut url = format!("{}?limit={PAGE_LENGTH}", routes::admin_trials(&study.slug));
        if let Some(before) = self.next_before {
            url.push_str(&format!("&before={before}"));
        }
        vec![Command::Send(Request::get(Tag::Trials, url))]
    }

    fn answered(&mut self, tag: Tag, answer: &Answer) -> Result<Vec<Command>, Failure> {
        match tag {
            Tag::Session => {
                answer.octets()?;
                self.trouble = None;
                Ok(self.enter())
            }
            Tag::Studies => {
                self.studies = answer.read()?;
                self.page = Page::Trials;
                Ok(self.list())
            }
            Tag::Trials => {
                let mut page: TrialPage = answer.read()?;
                self.trials.append(&mut page.trials);
                self.next_before = page.next_before;
                self.listed = true;
                Ok(Vec::new())
            }
            Tag::Trial => {
                let replay = Replay::new(answer.read()?);
                let trial = replay.trial();
                let predictor = routes::admin_predictor(&trial.summary.trial_id);
                // V_HR and V_RH are the same function while the vehicles are identical.
                let value = trial.value_function_hr.as_deref().map(routes::value_function);
                let requests = value
                    .map(|url| Request::get(Tag::ValueFunction, url))
                    .into_iter()
                    .chain([Request::get(Tag::Predictor, predictor)]);
                let commands = requests.map(Command::Send).collect();
                self.page = Page::Replay(Box::new(replay));
                Ok(commands)
            }
            Tag::ValueFunction => {
                let octets = answer.octets()?;
                if let Page::Replay(replay) = &mut self.page {
                    match ValueFunction::decode(octets) {
                        Ok(value) => replay
                            .take_safety(SafetyFunctions { human: value.clone(), robot: value }),
                        Err(invalid) => replay.trouble = Some(invalid.to_string()),
                    }
                }
                Ok(Vec::new())
            }
            Tag::Predictor => {
                let trained = answer.read()?;
                if let Page::Replay(replay) = &mut self.page {
                    replay.take_predictor(trained);
                }
                Ok(Vec::new())
            }
            Tag::SelfCheck => {
                let server: SelfCheck = answer.read()?;
                let here = simulation_fingerprint(server.seed, server.trials);
                self.page = Page::SelfCheck { here, server };
                Ok(Vec::new())
            }
            _ => Ok(Vec::new()),
        }
    }

    fn failed(&mut self, tag: &Tag, failure: &Failure) {
        match (tag, failure) {
            // Not signed in yet is no trouble; a wrong key is.
            (_, Failure::Refused { status: 401, problem }) => {
                let tried = matches!(self.page, Page::SignIn { busy: true });
                self.trouble = tried.then(|| problem.message.clone());
                self.page = Page::SignIn { busy: false };
            }
            (Tag::Predictor | Tag::ValueFunction, _) => {
                if let Page::Replay(replay) = &mut self.page {
                    replay.trouble = Some(failure.sentence());
                }
            }
            _ if matches!(self.page, Page::SignIn { .. }) => {
                self.trouble = Some(failure.sentence());
                self.page = Page::SignIn { busy: false };
            }
            _ => self.page = Page::Stuck(failure.sentence()),
        }
    }

    fn act(&mut self, word: &str, value: &str) -> Vec<Command> {
        match (word, &mut self.page) {
            ("sign-in", Page::SignIn { .. }) => return self.sign_in(value),
            ("sign-out", _) => {
                let url = routes::SESSION.to_owned();
                let request =
                    Request { tag: Tag::Session, method: "DELETE", url, token: None, body: None };
                return vec![Command::Send(request), Command::GoTo("/".to_owned())];
            }
            ("more", Page::Trials) => return self.list(),
            (_, Page::Replay(replay)) => replay.act(word, value, self.now_ms),
            _ => {}
        }
        Vec::new()
    }
}

impl App for Lab {
    fn handle(&mut self, event: Event) -> Vec<Command> {
        match event {
            Event::Opened(surroundings) => self.open(&surroundings),
            Event::Frame(now_ms) => {
                self.now_ms = now_ms;
                if let Page::Replay(replay) = &mut self.page {
                    replay.frame(now_ms);
                }
                Vec::new()
            }
            Event::Action { word, value, t_ms } => {
                self.now_ms = t_ms;
                self.act(&word, &value)
            }
            Event::Answered(tag, answer) => {
                self.answered(tag.clone(), &answer).unwrap_or_else(|failure| {
                    self.failed(&tag, &failure);
                    Vec::new()
                })
            }
            Event::Key { .. } | Event::Blur(_) | Event::Woken => Vec::new(),
        }
    }

    fn view(&self) -> Node {
        view::page(self)
    }

    fn picture(&self) -> Option<Picture> {
        match &self.page {
            Page::Replay(replay) => Some(replay.picture()),
            _ => None,
        }
    }

    fn wants_frames(&self) -> bool {
        matches!(&self.page, Page::Replay(replay) if replay.is_playing())
    }

    fn owns_key(&self, _key: &str) -> bool {
        false
    }
}

mod view {
    use super::{Lab, Node, Page, Place, TrialSummary, el, routes};

    pub(super) fn page(lab: &Lab) -> Node {
        let content = match &lab.page {
            Page::Loading => {
                el("main").class("card").child(el("p").class("quiet").text("Loading…"))
            }
            Page::SignIn { busy } => sign_in(lab, *busy),
            Page::Trials => trials(lab),
            Page::Replay(replay) => replay.view(),
            Page::SelfCheck { here, server } => self_check(here, server),
            Page::Stuck(why) => stuck(why),
        };
        let signed_in = !matches!(lab.page, Page::SignIn { .. });
        el("div").class("lab").child(header(lab, signed_in)).child(content)
    }

    fn header(lab: &Lab, signed_in: bool) -> Node {
        let link = |place: &Place, href: &str, words: &str| {
            el("a")
                .attr("href", href)
                .attr_if(lab.place == *place, "aria-current", "page")
                .text(words)
        };
        let about = match &lab.page {
            Page::Replay(replay) => {
                let trial = replay.trial();
                let summary = &trial.summary;
                format!(
                    "{} / participant {} / {} {}",
                    trial.study,
                    summary.participant_number,
                    summary.phase.word(),
                    summary.index + 1
                )
            }
            _ => String::new(),
        };
        let nav = el("nav").attr("aria-label", "Laboratory").children([
            link(&Place::Trials, "/lab", "Trials"),
            link(&Place::SelfCheck, "/lab/self-check", "Self-check"),
        ]);
        let end = el("span").class("end").child(el("span").class("quiet").text(about)).child(
            el("button")
                .class("plain")
                .attr("type", "button")
                .action("sign-out")
                .test_id("sign-out")
                .text("Sign out"),
        );
        el("header")
            .class("top")
            .child(el("a").class("brand").attr("href", "/").text("Sidestep"))
            .children(signed_in.then_some(nav))
            .children(signed_in.then_some(end))
    }

    fn sign_in(lab: &Lab, busy: bool) -> Node {
        el("main").class("card")
            .child(el("h1").text("Laboratory"))
            .child(el("p").text("Sign in with the experimenter’s key. It was printed, with a sign-in link, when the server was started for the first time."))
            .child(el("form").attr("data-action", "sign-in")
                .child(el("label").attr("for", "key").text("Experimenter’s key"))
                .child(el("input").attr("id", "key").attr("name", "key").attr("type", "password").attr("autocomplete", "current-password").attr("required", "").attr("data-autofocus", "").test_id("key"))
                .child(el("button").class("primary").attr("type", "submit").attr_if(busy, "disabled", "").test_id("sign-in").text("Sign in")))
            .children(lab.trouble.as_ref().map(|text| el("p").class("trouble").attr("role", "alert").test_id("trouble").text(text)))
            .child(el("p").class("quiet").text("Lost it? Restart the server with --new-admin-key."))
    }

    fn trials(lab: &Lab) -> Node {
        let Some(study) = lab.studies.first() else {
            return stuck("There is no study.");
        };
        let count =
            |n: u64, one: &str, many: &str| format!("{n} {}", if n == 1 { one } else { many });
        let head = el("div")
            .class("page-head")
            .child(el("div").child(el("h1").text(&study.title)).child(el("p").class("quiet").text(
                format!(
                    "{} · {}",
                    count(study.participants, "participant", "participants"),
                    count(study.trials, "stored trial", "stored trials")
                ),
            )))
            .child(
                el("div")
                    .class("actions")
                    .child(
                        el("a")
                            .class("button")
                            .attr("href", format!("/s/{}", study.slug))
                            .test_id("drive")
                            .text("Drive a scene"),
                    )
                    .child(
                        el("a")
                            .class("button")
                            .attr("href", routes::export(&study.slug))
                            .attr("download", "")
                            .test_id("export")
                            .text("Export CSV"),
                    ),
            );
        let body = if lab.trials.is_empty() && lab.listed {
            el("div").class("empty")
                .child(el("p").text("No trials yet."))
                .child(el("p").class("quiet").text("Drive a scene yourself, or send participants the address of the study. What they drive appears here, ready to replay."))
        } else {
            let columns =
                ["Participant", "Scene", "Closest", "Danger zone", "Turned", "Stored", "Flags", ""];
            let columns = columns.map(|words| el("th").attr("scope", "col").text(words));
            el("div").class("scroll").child(
                el("table")
                    .class("trials")
                    .test_id("trials")
                    .child(el("thead").child(el("tr").children(columns)))
                    .child(el("tbody").children(lab.trials.iter().map(trial_row))),
            )
        };
        let more = lab.next_before.map(|_| {
            el("button")
                .class("plain")
                .attr("type", "button")
                .action("more")
                .text("Show older trials")
        });
        el("main").class("page").child(head).child(body).children(more)
    }

    fn trial_row(trial: &TrialSummary) -> Node {
        let outcome = &trial.outcome;
        let danger = outcome
            .first_step_in_danger
            .map_or_else(|| "kept clear".to_owned(), |step| format!("from step {step}"));
        let turned = outcome
            .avoidance
            .map_or_else(|| "never".to_owned(), |(first, last)| format!("steps {first}–{last}"));
        let flags: Vec<_> = trial.flags.iter().map(|flag| flag.word().replace('_', " ")).collect();
        let cell = |words: String| el("td").text(words);
        let replay = format!("/lab/replay/{}", trial.trial_id);
        let words = format!(
            "Replay participant {}, {} {}",
            trial.participant_number,
            trial.phase.word(),
            trial.index + 1
        );
        el("tr").children([
            cell(trial.participant_number.to_string()),
            cell(format!("{} {}", trial.phase.word(), trial.index + 1)),
            cell(format!("{:.2} m", outcome.closest_m)),
            cell(danger).class(if outcome.first_step_in_danger.is_some() { "robot" } else { "" }),
            cell(turned),
            el("td").child(el("time").attr("data-ms", trial.received_at_ms)),
            cell(flags.join(", ")),
            el("td").child(
                el("a")
                    .attr("href", replay)
                    .attr("aria-label", words)
                    .test_id("replay-link")
                    .text("Replay"),
            ),
        ])
    }

    fn self_check(here: &str, server: &sidestep::api::SelfCheck) -> Node {
        let same = here == server.fingerprint;
        let verdict = if same {
            "This browser and the server simulate alike, bit for bit."
        } else {
            "This browser and the server do not simulate alike. Please report both fingerprints."
        };
        let row = |name: &str, id: &str, value: &str| {
            el("div")
                .child(el("dt").text(name))
                .child(el("dd").child(el("code").test_id(id).text(value)))
        };
        el("main")
            .class("card wide")
            .child(el("h1").text("Self-check"))
            .child(
                el("p")
                    .class(if same { "saved" } else { "trouble" })
                    .test_id("verdict")
                    .text(verdict),
            )
            .child(el("p").class("quiet").text(format!(
                "SHA-256 of every state of {} random trials, seed {}.",
                server.trials, server.seed
            )))
            .child(el("dl").class("facts").children([
                row("here", "fingerprint-here", here),
                row("server", "fingerprint-server", &server.fingerprint),
            ]))
    }

    fn stuck(why: &str) -> Node {
        el("main")
            .class("card")
            .child(el("h1").text("This does not work"))
            .child(el("p").test_id("stuck").text(why))
            .child(el("p").child(el("a").attr("href", "/lab").text("Back to the trials")))
    }
}
