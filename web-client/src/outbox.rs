//! Trials that the server has not yet acknowledged. Each trial is stored in this browser before it
//! is sent. The trials are sent in order, and deleted only after the server has acknowledged them.

use crate::runtime::{Answer, Command, Commands, Failure, NotKept, Request};
use sidestep::api::routes;

/// Unsent trials of one participant.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    participant_id: String,
    token: String,
    waiting: Vec<Waiting>,
    line: Line,
    failures: u32,
}

/// State of the upload queue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Line {
    #[default]
    Free,
    /// A trial is being sent.
    Busy,
    /// The last attempt failed, and the pause before the next attempt is not over.
    Pausing,
}

#[derive(Clone, Debug)]
struct Waiting {
    trial_id: String,
    body: String,
    /// Whether this browser could store the trial. `None` until that is known.
    kept: Option<bool>,
}

/// Messages to the outbox.
#[derive(Clone, Debug, PartialEq)]
pub enum Msg {
    /// The browser has stored this trial, or failed to store it.
    Kept(String, Result<(), NotKept>),
    /// The server answered the upload of this trial.
    Uploaded(String, Answer),
    /// The browser has stored this refused trial outside the queue, or failed to do so.
    SetAside(String, Result<(), NotKept>),
    /// It is time to retry.
    Retry,
}

/// Outcome of an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UploadOutcome {
    /// The server has stored this trial.
    Stored(String),
    /// The server already had another version of this trial. This browser keeps its own version.
    StoredBefore(String),
    /// The server expects another trial first. This trial stays in the queue.
    OutOfOrder,
    /// The server does not accept this trial, for this reason. The trial stays in this browser.
    Refused(String, String),
    /// The server accepts nothing more from this participant, for this reason.
    Ended(Failure),
}

const WAITING: &str = "sidestep.outbox";
const REFUSED: &str = "sidestep.refused";
const FIRST_PAUSE_MS: f64 = 500.0;
const LONGEST_PAUSE_MS: f64 = 10_000.0;

impl Outbox {
    /// Restores the trials that this browser has stored for a participant, in the order of `plan`.
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
                outbox.waiting.push(Waiting { trial_id, body, kept: Some(true) });
            }
        }
        outbox
    }

    fn name(&self, kind: &str, trial_id: &str) -> String {
        format!("{kind}.{}.{trial_id}", self.participant_id)
    }

    /// Queues a trial and stores it until the server has it.
    pub fn add(&mut self, trial_id: &str, body: String) -> Command<Msg> {
        let id = trial_id.to_owned();
        let keep = Command::Keep {
            name: self.name(WAITING, trial_id),
            text: body.clone(),
            then: Box::new(|kept| Msg::Kept(id, kept)),
        };
        self.waiting.push(Waiting { trial_id: trial_id.to_owned(), body, kept: None });
        keep
    }

    /// Sends the trial that the server expects, if it is in the queue and no trial is being sent. A
    /// trial that the browser cannot store is sent from memory.
    pub fn send(&mut self, awaited: Option<&str>) -> Option<Command<Msg>> {
        if self.line != Line::Free {
            return None;
        }
        let is_next = |waiting: &&Waiting| Some(waiting.trial_id.as_str()) == awaited;
        let next = self.waiting.iter().find(is_next).filter(|next| next.kept.is_some())?;
        self.line = Line::Busy;
        let id = next.trial_id.clone();
        // The number of other trials in the queue is the backlog, which experimenters monitor.
        let url = format!("{}?waiting={}", routes::my_trial(&id), self.waiting.len() - 1);
        Some(Command::Send(Request {
            name: "upload",
            method: "PUT",
            url,
            token: Some(self.token.clone()),
            body: Some(next.body.clone()),
            then: Box::new(|answer| Msg::Uploaded(id, answer)),
        }))
    }

    /// Handles a message. Afterwards, [`Self::send`] may have a trial to send.
    pub fn update(&mut self, message: Msg) -> (Option<UploadOutcome>, Commands<Msg>) {
        match message {
            Msg::Kept(trial_id, kept) => {
                let waiting = self.waiting.iter_mut().find(|waiting| waiting.trial_id == trial_id);
                if let Some(waiting) = waiting {
                    waiting.kept = Some(kept.is_ok());
                }
            }
            // If there is no space for a second copy, the trial stays stored under its original
            // name.
            Msg::SetAside(_, Err(_)) => {}
            Msg::SetAside(trial_id, Ok(())) => return (None, vec![self.forget(&trial_id)]),
            Msg::Retry => self.resume(),
            Msg::Uploaded(trial_id, answer) => return self.uploaded(trial_id, answer),
        }
        (None, Vec::new())
    }

    fn uploaded(
        &mut self,
        trial_id: String,
        answer: Answer,
    ) -> (Option<UploadOutcome>, Commands<Msg>) {
        self.line = Line::Free;
        let Err(failure) = answer else {
            self.failures = 0;
            let forget = self.drop_stored(&trial_id);
            return (Some(UploadOutcome::Stored(trial_id)), forget.into_iter().collect());
        };
        let is_early = failure.code == "out_of_order";
        if is_early || failure.is_temporary() {
            let wake = self.pause();
            return (is_early.then_some(UploadOutcome::OutOfOrder), vec![wake]);
        }
        if matches!(failure.status, 401 | 410) {
            return (Some(UploadOutcome::Ended(failure)), Vec::new());
        }
        let set_aside = self.set_aside(&trial_id);
        let outcome = match failure.code.as_str() {
            "different_content" => UploadOutcome::StoredBefore(trial_id),
            _ => UploadOutcome::Refused(trial_id, failure.sentence),
        };
        (Some(outcome), set_aside.into_iter().collect())
    }

    /// Begins a pause before the next attempt. Pauses grow exponentially.
    fn pause(&mut self) -> Command<Msg> {
        self.line = Line::Pausing;
        let pause_ms = FIRST_PAUSE_MS * f64::from(1u32 << self.failures.min(8));
        self.failures += 1;
        let after_ms = pause_ms.min(LONGEST_PAUSE_MS) * self.share();
        Command::Wake { timer: "upload-retry", after_ms, message: Msg::Retry }
    }

    /// Jitter factor between 0.5 and 1. It differs between participants and between attempts, so
    /// that not all clients call a restarted server at the same time.
    fn share(&self) -> f64 {
        let mix = |hash: u32, byte: u8| (hash ^ u32::from(byte)).wrapping_mul(16_777_619);
        let hash =
            self.participant_id.bytes().chain([self.failures as u8]).fold(2_166_136_261, mix);
        0.5 + f64::from(hash >> 16) / 131_072.0
    }

    fn take(&mut self, trial_id: &str) -> Option<Waiting> {
        let at = self.waiting.iter().position(|waiting| waiting.trial_id == trial_id)?;
        Some(self.waiting.remove(at))
    }

    fn forget(&self, trial_id: &str) -> Command<Msg> {
        Command::Forget(self.name(WAITING, trial_id))
    }

    /// Moves a refused trial out of the queue without losing it.
    fn set_aside(&mut self, trial_id: &str) -> Option<Command<Msg>> {
        let Waiting { trial_id, body, .. } = self.take(trial_id)?;
        let name = self.name(REFUSED, &trial_id);
        let then = Box::new(|kept| Msg::SetAside(trial_id, kept));
        Some(Command::Keep { name, text: body, then })
    }

    /// Ends the pause after a failed attempt, for example because the network is available again.
    pub fn resume(&mut self) {
        if self.line == Line::Pausing {
            self.line = Line::Free;
        }
    }

    /// Drops a trial that the server has stored, no matter which tab sent it.
    pub fn drop_stored(&mut self, trial_id: &str) -> Option<Command<Msg>> {
        self.take(trial_id).map(|_| self.forget(trial_id))
    }

    /// Deletes the whole queue, because the participant has withdrawn.
    pub fn forget_all(&mut self) -> Commands<Msg> {
        let waiting = std::mem::take(&mut self.waiting);
        waiting.iter().map(|waiting| self.forget(&waiting.trial_id)).collect()
    }

    /// Number of trials in the queue.
    #[must_use]
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether the queue is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Whether this trial is in the queue.
    #[must_use]
    pub fn holds(&self, trial_id: &str) -> bool {
        self.waiting.iter().any(|waiting| waiting.trial_id == trial_id)
    }

    /// Whether this browser has stored every trial in the queue, so that the page can be closed
    /// safely.
    #[must_use]
    pub fn is_safe(&self) -> bool {
        self.waiting.iter().all(|waiting| waiting.kept == Some(true))
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
    use crate::runtime::Page;
    use crate::testing::Session;
    use crate::view::{Node, el};

    /// A page with only an outbox.
    struct Alone {
        outbox: Outbox,
        outcomes: Vec<UploadOutcome>,
    }

    impl Page for Alone {
        type Msg = Msg;

        fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
            let (outcome, commands) = self.outbox.update(message);
            self.outcomes.extend(outcome);
            commands
        }

        fn view(&self) -> Node<Msg> {
            el("p")
        }

        fn title(&self) -> String {
            String::new()
        }
    }

    fn plan() -> Vec<String> {
        ["t1", "t2", "t3"].map(str::to_owned).to_vec()
    }

    /// A browser with these trials stored.
    fn open(trials: &[&str]) -> Session<Alone> {
        let outbox = Outbox::restore("p", "secret", &plan(), &[]);
        let page = Alone { outbox, outcomes: Vec::new() };
        let mut session = Session::new((page, Vec::new()), Default::default());
        for trial in trials {
            session.add(trial);
        }
        session
    }

    impl Session<Alone> {
        fn add(&mut self, trial_id: &str) {
            let keep = self.page.outbox.add(trial_id, format!("{{{trial_id}}}"));
            self.apply(vec![keep]);
        }

        /// Sends the trial that the server expects. Returns whether there was one to send.
        fn upload(&mut self, awaited: &str) -> bool {
            let send = self.page.outbox.send(Some(awaited));
            let sends = send.is_some();
            self.apply(send.into_iter().collect());
            sends
        }

        /// Makes the server refuse the upload. Returns the outcome.
        fn refuse(&mut self, status: u16, code: &str) -> Option<UploadOutcome> {
            let body = format!(r#"{{"code":"{code}","message":"because"}}"#);
            self.answer("upload", status, body.as_bytes());
            self.page.outcomes.pop()
        }

        fn names(&self) -> Vec<&str> {
            self.kept.keys().map(String::as_str).collect()
        }
    }

    #[test]
    fn trials_are_sent_in_order_and_forgotten_when_stored() {
        let mut browser = open(&["t1"]);
        assert!(browser.upload("t1"));
        browser.add("t2");
        assert!(!browser.upload("t2"), "one at a time");
        assert_eq!(browser.names().len(), 2);
        assert!(browser.page.outbox.is_safe());
        assert_eq!(browser.urls(), [routes::my_trial("t1") + "?waiting=0"]);
        browser.answer("upload", 201, b"");
        assert_eq!(browser.page.outcomes, [UploadOutcome::Stored("t1".into())]);
        assert!(browser.upload("t2"));
        assert_eq!(browser.urls(), [routes::my_trial("t2") + "?waiting=0"]);
        browser.answer("upload", 200, b"");
        assert!(browser.page.outbox.is_empty() && browser.kept.is_empty());
    }

    #[test]
    fn an_upload_says_how_many_others_wait() {
        let mut browser = open(&["t1", "t2", "t3"]);
        for (trial, others) in [("t1", 2), ("t2", 1), ("t3", 0)] {
            assert!(browser.upload(trial));
            assert_eq!(browser.urls(), [format!("{}?waiting={others}", routes::my_trial(trial))]);
            browser.answer("upload", 201, b"");
        }
    }

    #[test]
    fn only_the_trial_that_the_server_awaits_is_sent() {
        let mut browser = open(&["t2"]);
        assert!(!browser.upload("t1"));
        browser.add("t1");
        assert!(browser.upload("t1"));
    }

    #[test]
    fn an_unreachable_server_loses_nothing_even_across_a_reload() {
        let mut browser = open(&["t2", "t1"]);
        for (status, pause_ms) in [(0, 500.0), (503, 1000.0), (500, 2000.0), (0, 4000.0)] {
            assert!(browser.upload("t2"));
            match status {
                0 => browser.unreachable("upload"),
                _ => assert_eq!(browser.refuse(status, ""), None),
            }
            assert!(!browser.upload("t2"), "not before the pause is over");
            let share = browser.timers[0].1 / pause_ms;
            assert!((0.5..1.0).contains(&share), "{share}");
            browser.wake("upload-retry");
        }
        assert!(browser.page.outbox.is_struggling() && browser.page.outcomes.is_empty());
        // A reload restores both trials.
        let kept: Vec<_> = browser.kept.into_iter().collect();
        let mut again = Outbox::restore("p", "fresh", &plan(), &kept);
        assert_eq!(again.len(), 2);
        assert!(again.is_safe() && again.send(Some("t1")).is_some());
        assert!(Outbox::restore("another", "t", &plan(), &kept).is_empty());
    }

    #[test]
    fn a_trial_is_kept_before_it_is_sent() {
        let mut browser = open(&[]);
        browser.keeps_slowly = true;
        browser.add("t1");
        assert!(!browser.upload("t1") && !browser.page.outbox.is_safe());
        browser.keep();
        assert!(browser.page.outbox.is_safe() && browser.upload("t1"));
    }

    #[test]
    fn participants_do_not_try_again_at_the_same_moment() {
        let shares = ["p", "q", "r", "s"].map(|id| Outbox::restore(id, "", &[], &[]).share());
        let [low, high] = shares
            .iter()
            .fold([1.0, 0.0f64], |[low, high], &share| [share.min(low), share.max(high)]);
        assert!(high - low > 0.01, "{shares:?}");
    }

    #[test]
    fn the_network_ends_a_pause_but_no_upload() {
        let mut browser = open(&["t1"]);
        browser.upload("t1");
        browser.page.outbox.resume();
        assert!(!browser.upload("t1"), "it is on its way");
        browser.unreachable("upload");
        browser.page.outbox.resume();
        assert!(browser.upload("t1"));
    }

    #[test]
    fn a_refused_trial_stays_in_the_browser() {
        let before = UploadOutcome::StoredBefore("t1".into());
        let refused = UploadOutcome::Refused("t1".into(), "Because.".into());
        let early = UploadOutcome::OutOfOrder;
        for (status, code, outcome, place) in [
            (409, "different_content", before, "refused"),
            (422, "invalid", refused, "refused"),
            (409, "out_of_order", early.clone(), "outbox"),
        ] {
            let mut browser = open(&["t1"]);
            browser.upload("t1");
            let waits = outcome == early;
            assert_eq!(browser.refuse(status, code), Some(outcome));
            assert_eq!(browser.names(), [format!("sidestep.{place}.p.t1")]);
            assert_eq!(browser.page.outbox.holds("t1"), waits);
        }
    }

    #[test]
    fn a_storage_that_refuses_is_noticed_and_loses_nothing() {
        for reason in [NotKept::Full, NotKept::Denied] {
            let mut browser = open(&[]);
            browser.refuses = Some(reason);
            browser.add("t1");
            assert!(!browser.page.outbox.is_safe());
            assert!(browser.upload("t1"), "it is sent from memory");
            browser.answer("upload", 201, b"");
            assert!(browser.page.outbox.is_safe() && browser.page.outbox.is_empty());
        }
        // If there is space for the trial but not for a copy of it, the trial is not deleted.
        let mut browser = open(&["t1"]);
        browser.refuses = Some(NotKept::Full);
        browser.upload("t1");
        browser.refuse(422, "invalid");
        assert_eq!(browser.names(), ["sidestep.outbox.p.t1"]);
    }
}
