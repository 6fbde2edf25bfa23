//! Trials that the server has not yet acknowledged. They are kept in this browser,
//! sent in order, and forgotten only after the server has said that they are stored.

use crate::runtime::{Answer, Command, Request, Tag};
use sidestep::api::routes;

/// What waits to be sent for one participant.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    participant_id: String,
    token: String,
    waiting: Vec<Waiting>,
    sending: bool,
    failures: u32,
}

#[derive(Clone, Debug)]
struct Waiting {
    trial_id: String,
    body: String,
}

/// What an answer to an upload means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Settled {
    /// The trial is safe on the server.
    Stored,
    /// Not now: it is tried again.
    Later,
    /// The server does not want it; it stays in this browser.
    Refused(String),
}

const WAITING: &str = "sidestep.outbox";
const REFUSED: &str = "sidestep.refused";
const FIRST_PAUSE_MS: f64 = 500.0;
const LONGEST_PAUSE_MS: f64 = 10_000.0;

impl Outbox {
    /// What this browser has kept for a participant, in the order of `plan`.
    #[must_use]
    pub fn restore(
        participant_id: &str,
        token: &str,
        plan: &[String],
        kept: &[(String, String)],
    ) -> Self {
        let mut outbox = Self {
            participant_id: participant_id.to_owned(),
            token: token.to_owned(),
            ..Self::default()
        };
        for trial_id in plan {
            let name = outbox.name(WAITING, trial_id);
            if let Some((_, body)) = kept.iter().find(|(key, _)| *key == name) {
                outbox.waiting.push(Waiting { trial_id: trial_id.clone(), body: body.clone() });
            }
        }
        outbox
    }

    fn name(&self, kind: &str, trial_id: &str) -> String {
        format!("{kind}.{}.{trial_id}", self.participant_id)
    }

    /// Keeps a trial and begins to send it.
    pub fn add(&mut self, trial_id: &str, body: String) -> Vec<Command> {
        let keep = Command::Keep(self.name(WAITING, trial_id), body.clone());
        self.waiting.push(Waiting { trial_id: trial_id.to_owned(), body });
        [keep].into_iter().chain(self.send()).collect()
    }

    /// Sends the first that waits, unless one is on its way.
    pub fn send(&mut self) -> Option<Command> {
        if self.sending {
            return None;
        }
        let first = self.waiting.first()?;
        self.sending = true;
        Some(Command::Send(Request {
            tag: Tag::Upload(first.trial_id.clone()),
            method: "PUT",
            url: routes::my_trial(&first.trial_id),
            token: Some(self.token.clone()),
            body: Some(first.body.clone()),
        }))
    }

    /// Takes the answer to an upload.
    pub fn answered(&mut self, trial_id: &str, answer: &Answer) -> (Settled, Vec<Command>) {
        self.sending = false;
        match answer.octets() {
            Ok(_) => {
                self.failures = 0;
                let forget = Command::Forget(self.name(WAITING, trial_id));
                self.waiting.retain(|waiting| waiting.trial_id != trial_id);
                (Settled::Stored, [forget].into_iter().chain(self.send()).collect())
            }
            Err(failure) if failure.is_passing() => {
                let pause = FIRST_PAUSE_MS * f64::from(1u32 << self.failures.min(8));
                self.failures += 1;
                (Settled::Later, vec![Command::WakeAfter(pause.min(LONGEST_PAUSE_MS))])
            }
            Err(failure) => (Settled::Refused(failure.sentence()), self.set_aside(trial_id)),
        }
    }

    /// Moves a refused trial out of the way without losing it.
    fn set_aside(&mut self, trial_id: &str) -> Vec<Command> {
        let Some(at) = self.waiting.iter().position(|waiting| waiting.trial_id == trial_id) else {
            return Vec::new();
        };
        let refused = self.waiting.remove(at);
        let keep = Command::Keep(self.name(REFUSED, trial_id), refused.body);
        let forget = Command::Forget(self.name(WAITING, trial_id));
        [keep, forget].into_iter().chain(self.send()).collect()
    }

    /// How many wait.
    #[must_use]
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether everything has been sent.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Whether this trial waits.
    #[must_use]
    pub fn holds(&self, trial_id: &str) -> bool {
        self.waiting.iter().any(|waiting| waiting.trial_id == trial_id)
    }

    /// Whether the last attempt failed.
    #[must_use]
    pub fn is_struggling(&self) -> bool {
        self.failures > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// The browser's storage, as commands change it.
    #[derive(Default)]
    struct Kept(BTreeMap<String, String>);

    impl Kept {
        fn apply(&mut self, commands: &[Command]) -> Vec<String> {
            let mut sent = Vec::new();
            for command in commands {
                match command {
                    Command::Keep(name, text) => drop(self.0.insert(name.clone(), text.clone())),
                    Command::Forget(name) => drop(self.0.remove(name)),
                    Command::Send(request) => sent.push(request.url.clone()),
                    _ => {}
                }
            }
            sent
        }

        fn list(&self) -> Vec<(String, String)> {
            self.0.clone().into_iter().collect()
        }
    }

    fn received(status: u16) -> Answer {
        let body = br#"{"code":"x","message":"because"}"#.to_vec();
        Answer::Received { status, body }
    }

    fn plan() -> Vec<String> {
        ["t1", "t2", "t3"].map(str::to_owned).to_vec()
    }

    #[test]
    fn trials_are_sent_in_order_and_forgotten_when_stored() {
        let mut kept = Kept::default();
        let mut outbox = Outbox::restore("p", "secret", &plan(), &[]);
        assert_eq!(kept.apply(&outbox.add("t1", "{1}".into())), [routes::my_trial("t1")]);
        assert_eq!(kept.apply(&outbox.add("t2", "{2}".into())), [""; 0], "one at a time");
        assert_eq!(kept.0.len(), 2);
        let (settled, commands) = outbox.answered("t1", &received(201));
        assert_eq!(settled, Settled::Stored);
        assert_eq!(kept.apply(&commands), [routes::my_trial("t2")]);
        let (_, commands) = outbox.answered("t2", &received(200));
        kept.apply(&commands);
        assert!(outbox.is_empty() && kept.0.is_empty());
    }

    #[test]
    fn an_unreachable_server_loses_nothing_even_across_a_reload() {
        let mut kept = Kept::default();
        let mut outbox = Outbox::restore("p", "secret", &plan(), &[]);
        kept.apply(&outbox.add("t2", "{2}".into()));
        kept.apply(&outbox.add("t1", "{1}".into()));
        let mut pauses = Vec::new();
        for answer in [Answer::Unreachable, received(503), received(500), Answer::Unreachable] {
            let (settled, commands) = outbox.answered("t2", &answer);
            assert_eq!(settled, Settled::Later);
            let [Command::WakeAfter(pause)] = commands[..] else { panic!("{commands:?}") };
            pauses.push(pause);
            outbox.send();
        }
        assert_eq!(pauses, [500.0, 1000.0, 2000.0, 4000.0]);
        assert!(outbox.is_struggling());
        // A reload restores the order of the plan.
        let mut again = Outbox::restore("p", "fresh", &plan(), &kept.list());
        assert_eq!(again.len(), 2);
        assert_eq!(
            kept.apply(&again.send().into_iter().collect::<Vec<_>>()),
            [routes::my_trial("t1")]
        );
        assert!(Outbox::restore("somebody else", "t", &plan(), &kept.list()).is_empty());
    }

    #[test]
    fn a_refused_trial_stays_in_the_browser() {
        let mut kept = Kept::default();
        let mut outbox = Outbox::restore("p", "secret", &plan(), &[]);
        kept.apply(&outbox.add("t1", "{1}".into()));
        let (settled, commands) = outbox.answered("t1", &received(409));
        assert_eq!(settled, Settled::Refused("because".to_owned()));
        kept.apply(&commands);
        assert_eq!(kept.list(), [("sidestep.refused.p.t1".to_owned(), "{1}".to_owned())]);
    }
}
