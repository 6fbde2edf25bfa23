//! The laboratory: sign-in, stored trials, replay, and the machine's self-check.

mod view;
#[cfg(test)]
mod tests;

use super::replay::Replay;
use crate::json;
use crate::runtime::{Answer, App, Command, Event, Failure, Request, Surroundings, Tag};
use crate::shape::Picture;
use crate::view::Node;
use sidestep::api::{SelfCheck, SignIn, StudySummary, TrialPage, TrialSummary, routes};
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
                // A study is shown with its trials: an empty table would say that there are none.
                if self.studies.is_empty() {
                    self.page = Page::Trials;
                }
                Ok(self.list())
            }
            Tag::Trials => {
                let mut page: TrialPage = answer.read()?;
                self.trials.append(&mut page.trials);
                self.next_before = page.next_before;
                self.page = Page::Trials;
                Ok(Vec::new())
            }
            Tag::Trial => {
                let mut replay = Replay::new(answer.read()?);
                let predictor = routes::admin_predictor(&replay.trial().summary.trial_id);
                let predictor = Command::Send(Request::get(Tag::Predictor, predictor));
                let commands = replay.begin().into_iter().chain([predictor]).collect();
                self.page = Page::Replay(Box::new(replay));
                Ok(commands)
            }
            Tag::ValueFunction(evader) => {
                let octets = answer.octets()?;
                if let Page::Replay(replay) = &mut self.page {
                    replay.take_value_function(evader, Ok(octets));
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
            (Tag::ValueFunction(evader), failure) => {
                if let Page::Replay(replay) = &mut self.page {
                    replay.take_value_function(*evader, Err(failure));
                }
            }
            (Tag::Predictor, _) => {
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
            (_, Page::Replay(replay)) => return replay.act(word, value, self.now_ms),
            _ => {}
        }
        Vec::new()
    }
}

impl Lab {
    fn take(&mut self, event: Event) -> Vec<Command> {
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
            Event::Solving(evader, solving) => {
                if let Page::Replay(replay) = &mut self.page {
                    replay.take_solving(evader, solving);
                }
                Vec::new()
            }
            Event::Key { .. } | Event::Blur(_) | Event::Woken => Vec::new(),
        }
    }
}

impl App for Lab {
    fn handle(&mut self, event: Event) -> Vec<Command> {
        let replayed = matches!(self.page, Page::Replay(_));
        let mut commands = self.take(event);
        if replayed && !matches!(self.page, Page::Replay(_)) {
            // Nobody waits for the solution any more.
            commands.push(Command::StopSolving);
        }
        commands
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
