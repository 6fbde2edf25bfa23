//! Trials that the server has not yet acknowledged. They are kept in this browser,
//! sent in order, and forgotten only after the server has said that they are stored.

use crate::runtime::{Answer, Command, Commands, NotKept, Request};
use sidestep::api::routes;

/// What waits to be sent for one participant.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    participant_id: String,
    token: String,
    waiting: Vec<Waiting>,
    line: Line,
    failures: u32,
}

/// Whether something can be sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Line {
    #[default]
    Free,
    /// A trial is on its way.
    Busy,
    /// The last attempt failed, and the pause before the next is not over.
    Pausing,
}

#[derive(Clone, Debug)]
struct Waiting {
    trial_id: String,
    body: String,
    /// Whether this browser has said that it keeps it.
    kept: bool,
}

/// What the outbox is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Msg {
    /// The browser keeps this trial, or does not.
    Kept(String, Result<(), NotKept>),
    /// The server answered the upload of this trial.
    Uploaded(String, Answer),
    /// The browser keeps this refused trial apart from those that wait, or does not.
    SetAside(String, Result<(), NotKept>),
    /// It is time to try again.
    Retry,
}

/// What became of an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UploadOutcome {
    /// The server has stored this trial.
    Stored(String),
    /// The server had stored another version of this trial before; this one is kept here.
    StoredBefore(String),
    /// The server awaits another trial first; this one goes on waiting.
    OutOfOrder,
    /// The server does not accept this trial, for this reason; it is kept here.
    Refused(String, String),
    /// The server takes nothing more from this participant, for this reason.
    Ended(String),
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
                let (trial_id, body) = (trial_id.clone(), body.clone());
                outbox.waiting.push(Waiting { trial_id, body, kept: true });
            }
        }
        outbox
    }

    fn name(&self, kind: &str, trial_id: &str) -> String {
        format!("{kind}.{}.{trial_id}", self.participant_id)
    }

    /// Keeps a trial until the server has it.
    pub fn add(&mut self, trial_id: &str, body: String) -> Commands<Msg> {
        let id = trial_id.to_owned();
        let keep = Command::Keep {
            name: self.name(WAITING, trial_id),
            text: body.clone(),
            then: Box::new(|kept| Msg::Kept(id, kept)),
        };
        self.waiting.push(Waiting { trial_id: trial_id.to_owned(), body, kept: false });
        vec![keep]
    }

    /// Sends the trial that the server awaits, if it waits here and none is on its way.
    pub fn send(&mut self, awaited: Option<&str>) -> Option<Command<Msg>> {
        if self.line != Line::Free {
            return None;
        }
        let next =
            self.waiting.iter().find(|waiting| Some(waiting.trial_id.as_str()) == awaited)?;
        self.line = Line::Busy;
        let id = next.trial_id.clone();
        Some(Command::Send(Request {
            name: "upload",
            method: "PUT",
            url: routes::my_trial(&id),
            token: Some(self.token.clone()),
            body: Some(next.body.clone()),
            then: Box::new(|answer| Msg::Uploaded(id, answer)),
        }))
    }

    /// Takes a message. After it, [`Self::send`] may have something to send.
    pub fn update(&mut self, message: Msg) -> (Option<UploadOutcome>, Commands<Msg>) {
        match message {
            Msg::Kept(trial_id, kept) => {
                let waiting = self.waiting.iter_mut().find(|waiting| waiting.trial_id == trial_id);
                if let Some(waiting) = waiting {
                    waiting.kept = kept.is_ok();
                }
                (None, Vec::new())
            }
            Msg::SetAside(trial_id, kept) => {
                // A trial that cannot be kept twice stays where it is.
                let forget = kept.is_ok().then(|| Command::Forget(self.name(WAITING, &trial_id)));
                (None, forget.into_iter().collect())
            }
            Msg::Retry => {
                self.resume();
                (None, Vec::new())
            }
            Msg::Uploaded(trial_id, answer) => self.uploaded(trial_id, &answer),
        }
    }

    fn uploaded(
        &mut self,
        trial_id: String,
        answer: &Answer,
    ) -> (Option<UploadOutcome>, Commands<Msg>) {
        self.line = Line::Free;
        let failure = match answer.bytes() {
            Ok(_) => {
                self.failures = 0;
                self.waiting.retain(|waiting| waiting.trial_id != trial_id);
                let forget = Command::Forget(self.name(WAITING, &trial_id));
                return (Some(UploadOutcome::Stored(trial_id)), vec![forget]);
            }
            Err(failure) => failure,
        };
        let is_early = failure.code() == "out_of_order";
        if is_early || failure.is_temporary() {
            let wake = self.pause();
            return (is_early.then_some(UploadOutcome::OutOfOrder), vec![wake]);
        }
        match (failure.status(), failure.code()) {
            (401 | 410, _) => (Some(UploadOutcome::Ended(failure.sentence())), Vec::new()),
            (_, "different_content") => {
                let commands = self.set_aside(&trial_id);
                (Some(UploadOutcome::StoredBefore(trial_id)), commands)
            }
            _ => {
                let commands = self.set_aside(&trial_id);
                (Some(UploadOutcome::Refused(trial_id, failure.sentence())), commands)
            }
        }
    }

    /// Begins a pause, each twice as long as the one before.
    fn pause(&mut self) -> Command<Msg> {
        self.line = Line::Pausing;
        let pause_ms = FIRST_PAUSE_MS * f64::from(1u32 << self.failures.min(8));
        self.failures += 1;
        let after_ms = pause_ms.min(LONGEST_PAUSE_MS);
        Command::Wake { timer: "upload-retry", after_ms, message: Msg::Retry }
    }

    /// Moves a trial that the server does not want out of the way without losing it.
    fn set_aside(&mut self, trial_id: &str) -> Commands<Msg> {
        let Some(at) = self.waiting.iter().position(|waiting| waiting.trial_id == trial_id) else {
            return Vec::new();
        };
        let refused = self.waiting.remove(at);
        let name = self.name(REFUSED, trial_id);
        let then = Box::new(|kept| Msg::SetAside(refused.trial_id, kept));
        vec![Command::Keep { name, text: refused.body, then }]
    }

    /// Ends the pause after a failed attempt, early if the network is back.
    pub fn resume(&mut self) {
        if self.line == Line::Pausing {
            self.line = Line::Free;
        }
    }

    /// The server has stored this trial, whoever sent it.
    pub fn drop_stored(&mut self, trial_id: &str) -> Option<Command<Msg>> {
        let at = self.waiting.iter().position(|waiting| waiting.trial_id == trial_id)?;
        self.waiting.remove(at);
        Some(Command::Forget(self.name(WAITING, trial_id)))
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

    /// Whether this browser keeps everything that waits, also when the page is closed.
    #[must_use]
    pub fn is_safe(&self) -> bool {
        self.waiting.iter().all(|waiting| waiting.kept)
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
    use std::collections::{BTreeMap, VecDeque};

    /// An outbox with the browser's storage, which refuses when it is told to.
    struct Browser {
        outbox: Outbox,
        storage: BTreeMap<String, String>,
        refuses: Option<NotKept>,
        /// Addresses of uploads, and lengths of pauses.
        sent: Vec<String>,
        pauses: Vec<f64>,
    }

    impl Browser {
        fn new() -> Self {
            let outbox = Outbox::restore("p", "secret", &plan(), &[]);
            let (storage, sent, pauses) = Default::default();
            Self { outbox, storage, refuses: None, sent, pauses }
        }

        fn apply(&mut self, commands: Commands<Msg>) -> Vec<UploadOutcome> {
            let mut outcomes = Vec::new();
            let mut queue = VecDeque::from(commands);
            while let Some(command) = queue.pop_front() {
                match command {
                    Command::Keep { name, text, then } => {
                        let kept = self.refuses.map_or(Ok(()), Err);
                        if kept.is_ok() {
                            self.storage.insert(name, text);
                        }
                        let (outcome, commands) = self.outbox.update(then(kept));
                        outcomes.extend(outcome);
                        queue.extend(commands);
                    }
                    Command::Forget(name) => drop(self.storage.remove(&name)),
                    Command::Send(request) => self.sent.push(request.url),
                    Command::Wake { after_ms, .. } => self.pauses.push(after_ms),
                    _ => panic!("the outbox asks for nothing else"),
                }
            }
            outcomes
        }

        fn add(&mut self, trial_id: &str) {
            let commands = self.outbox.add(trial_id, format!("{{{trial_id}}}"));
            self.apply(commands);
        }

        fn send(&mut self, awaited: &str) -> bool {
            let command = self.outbox.send(Some(awaited));
            let sends = command.is_some();
            self.apply(command.into_iter().collect());
            sends
        }

        fn answer(&mut self, trial_id: &str, answer: Answer) -> Vec<UploadOutcome> {
            let (outcome, commands) = self.outbox.update(Msg::Uploaded(trial_id.into(), answer));
            let more = self.apply(commands);
            outcome.into_iter().chain(more).collect()
        }

        fn names(&self) -> Vec<&str> {
            self.storage.keys().map(String::as_str).collect()
        }
    }

    fn received(status: u16, code: &str) -> Answer {
        let body = format!(r#"{{"code":"{code}","message":"because"}}"#).into_bytes();
        Answer::Received { status, body }
    }

    fn plan() -> Vec<String> {
        ["t1", "t2", "t3"].map(str::to_owned).to_vec()
    }

    #[test]
    fn trials_are_sent_in_order_and_forgotten_when_stored() {
        let mut browser = Browser::new();
        browser.add("t1");
        assert!(browser.send("t1"));
        browser.add("t2");
        assert!(!browser.send("t2"), "one at a time");
        assert_eq!(browser.names().len(), 2);
        assert!(browser.outbox.is_safe());
        let stored = browser.answer("t1", received(201, ""));
        assert_eq!(stored, [UploadOutcome::Stored("t1".into())]);
        assert!(browser.send("t2"));
        browser.answer("t2", received(200, ""));
        assert!(browser.outbox.is_empty() && browser.storage.is_empty());
        assert_eq!(browser.sent, [routes::my_trial("t1"), routes::my_trial("t2")]);
    }

    #[test]
    fn only_the_trial_that_the_server_awaits_is_sent() {
        let mut browser = Browser::new();
        browser.add("t2");
        assert!(!browser.send("t1"));
        browser.add("t1");
        assert!(browser.send("t1"));
    }

    #[test]
    fn an_unreachable_server_loses_nothing_even_across_a_reload() {
        let mut browser = Browser::new();
        browser.add("t2");
        browser.add("t1");
        let answers =
            [Answer::Unreachable, received(503, ""), received(500, ""), Answer::Unreachable];
        for answer in answers {
            assert!(browser.send("t2"));
            assert_eq!(browser.answer("t2", answer), []);
            assert!(!browser.send("t2"), "not before the pause is over");
            browser.outbox.update(Msg::Retry);
        }
        assert_eq!(browser.pauses, [500.0, 1000.0, 2000.0, 4000.0]);
        assert!(browser.outbox.is_struggling());
        // A reload restores both.
        let kept: Vec<_> = browser.storage.clone().into_iter().collect();
        let mut again = Outbox::restore("p", "fresh", &plan(), &kept);
        assert_eq!(again.len(), 2);
        assert!(again.is_safe() && again.send(Some("t1")).is_some());
        assert!(Outbox::restore("somebody else", "t", &plan(), &kept).is_empty());
    }

    #[test]
    fn the_network_ends_a_pause_but_no_upload() {
        let mut browser = Browser::new();
        browser.add("t1");
        browser.send("t1");
        browser.outbox.resume();
        assert!(!browser.send("t1"), "it is on its way");
        browser.answer("t1", Answer::Unreachable);
        browser.outbox.resume();
        assert!(browser.send("t1"));
    }

    #[test]
    fn a_refused_trial_stays_in_the_browser() {
        for (status, code) in [(409, "different_content"), (422, "invalid")] {
            let mut browser = Browser::new();
            browser.add("t1");
            browser.send("t1");
            let outcome = browser.answer("t1", received(status, code));
            let expected = match status {
                409 => UploadOutcome::StoredBefore("t1".into()),
                _ => UploadOutcome::Refused("t1".into(), "Because.".into()),
            };
            assert_eq!(outcome, [expected]);
            assert_eq!(browser.names(), ["sidestep.refused.p.t1"]);
            assert!(browser.outbox.is_empty());
        }
    }

    #[test]
    fn a_trial_before_its_turn_goes_on_waiting() {
        let mut browser = Browser::new();
        browser.add("t1");
        browser.send("t1");
        let outcome = browser.answer("t1", received(409, "out_of_order"));
        assert_eq!(outcome, [UploadOutcome::OutOfOrder]);
        assert_eq!((browser.outbox.len(), browser.names().len()), (1, 1));
    }

    #[test]
    fn a_storage_that_refuses_is_noticed_and_loses_nothing() {
        for reason in [NotKept::Full, NotKept::Denied] {
            let mut browser = Browser::new();
            browser.refuses = Some(reason);
            browser.add("t1");
            assert!(!browser.outbox.is_safe());
            assert!(browser.send("t1"), "it is sent from memory");
            browser.answer("t1", received(201, ""));
            assert!(browser.outbox.is_safe() && browser.outbox.is_empty());
        }
        // Room for the trial, but not for a copy: the first is not forgotten.
        let mut browser = Browser::new();
        browser.add("t1");
        browser.refuses = Some(NotKept::Full);
        browser.send("t1");
        browser.answer("t1", received(422, "invalid"));
        assert_eq!(browser.names(), ["sidestep.outbox.p.t1"]);
    }
}
