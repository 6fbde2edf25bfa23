//! Participants at work: enrolling, uploading, and both at once.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::rc::Rc;
use std::time::{Duration, Instant};

use sidestep::api::{Enrolled, routes};
use tokio::task::JoinSet;
use tokio::time::{sleep, sleep_until};

use crate::figures::Milliseconds;
use crate::http::Connection;
use crate::participant::{Participant, drive};

/// The study that a server without a study file has.
const STUDY: &str = "default";

/// Everybody who takes part, and how the server treats them.
pub(crate) struct Load {
    pub(crate) address: Cell<SocketAddr>,
    /// Who has trials left to drive.
    waiting: RefCell<VecDeque<Participant>>,
    /// Who has not.
    done: RefCell<Vec<Participant>>,
    latencies: RefCell<Milliseconds>,
    acknowledged: Cell<usize>,
    /// Answers 503.
    refused: Cell<usize>,
    /// Answers and ends that nothing explains, in words.
    problems: RefCell<Vec<String>>,
    /// Whether connections may break off, because the server is going to be killed.
    pub(crate) mortal: Cell<bool>,
    /// Nothing is begun after it.
    end: Cell<Option<Instant>>,
}

/// What came of a class that enrolled at once.
pub(crate) struct Class {
    pub(crate) enrolled: usize,
    /// Until the last of them was in, s.
    pub(crate) seconds: f64,
}

impl Load {
    pub(crate) fn new(address: SocketAddr) -> Self {
        Self {
            address: Cell::new(address),
            waiting: RefCell::default(),
            done: RefCell::default(),
            latencies: RefCell::default(),
            acknowledged: Cell::default(),
            refused: Cell::default(),
            problems: RefCell::default(),
            mortal: Cell::default(),
            end: Cell::default(),
        }
    }

    /// Lets `count` people enrol, or fewer if time runs out: how many did, and in what time.
    pub(crate) async fn enrol(
        self: &Rc<Self>,
        count: usize,
        connections: usize,
        limit: Duration,
    ) -> (usize, Duration) {
        let left = Rc::new(Cell::new(count));
        let enrolled = Rc::new(Cell::new(0));
        let took = self.together(connections, limit, |load| {
            let (left, enrolled) = (Rc::clone(&left), Rc::clone(&enrolled));
            async move {
                let mut connection = Connection::open(load.address.get()).await?;
                while left.get() > 0 && !load.is_over() {
                    left.set(left.get() - 1);
                    let begin = Instant::now();
                    if load.enrol_one(&mut connection).await?.is_some() {
                        load.note(begin);
                        enrolled.set(enrolled.get() + 1);
                    }
                }
                Ok(())
            }
        });
        let took = took.await;
        (enrolled.get(), took)
    }

    /// Lets people drive on, from so many connections, until time or people run out: how many
    /// uploads were acknowledged, and in what time.
    pub(crate) async fn upload(
        self: &Rc<Self>,
        connections: usize,
        limit: Duration,
    ) -> (usize, Duration) {
        let before = self.acknowledged.get();
        // One participant drives one trial after the other.
        let connections = connections.min(self.waiting());
        let took = self
            .together(connections, limit, |load| async move {
                let mut connection = Connection::open(load.address.get()).await?;
                load.drive_on(&mut connection).await
            })
            .await;
        (self.acknowledged.get() - before, took)
    }

    /// Lets `count` people enrol at once, each on a connection of their own, while others
    /// upload `per_s` trials a second by the clock.
    pub(crate) async fn class(
        self: &Rc<Self>,
        count: usize,
        per_s: usize,
        limit: Duration,
    ) -> Class {
        let stop = Rc::new(Cell::new(false));
        let mut beside = JoinSet::new();
        let begin = Instant::now();
        for number in 0..per_s {
            let (load, stop) = (Rc::clone(self), Rc::clone(&stop));
            let first = begin + Duration::from_secs_f64(number as f64 / per_s as f64);
            beside.spawn_local(async move {
                if let Err(error) = load.drive_by_the_clock(first, &stop).await {
                    load.problem(error.to_string());
                }
            });
        }
        // Uploads are under way when the class comes.
        sleep(Duration::from_secs(1)).await;
        let enrolled = Rc::new(Cell::new(0));
        let took = self
            .together(count, limit, |load| {
                let enrolled = Rc::clone(&enrolled);
                async move {
                    let mut connection = Connection::open(load.address.get()).await?;
                    if load.enrol_one(&mut connection).await?.is_some() {
                        enrolled.set(enrolled.get() + 1);
                    }
                    Ok(())
                }
            })
            .await;
        sleep(Duration::from_secs(1)).await;
        stop.set(true);
        while beside.join_next().await.is_some() {}
        Class { enrolled: enrolled.get(), seconds: took.as_secs_f64() }
    }

    /// How long requests took since the last call of this.
    pub(crate) fn take_latencies(&self) -> Milliseconds {
        self.latencies.take()
    }

    /// How many requests the server put off and how many went wrong since the last call of
    /// this, with one of the latter.
    pub(crate) fn troubles(&self) -> String {
        let problems = self.problems.take();
        let example = problems.first().map(|text| format!(": {text}")).unwrap_or_default();
        format!("{}, {}{example}", self.refused.take(), problems.len())
    }

    /// How many people have trials left to drive.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting.borrow().len()
    }

    /// Everybody, whether or not they have trials left.
    pub(crate) fn everybody(&self, mut each: impl FnMut(&Participant)) {
        self.waiting.borrow().iter().for_each(&mut each);
        self.done.borrow().iter().for_each(&mut each);
    }

    /// Runs so many tasks to their end or, somewhat later, the limit's.
    async fn together<F: Future<Output = io::Result<()>> + 'static>(
        self: &Rc<Self>,
        count: usize,
        limit: Duration,
        task: impl Fn(Rc<Self>) -> F,
    ) -> Duration {
        let begin = Instant::now();
        self.end.set(Some(begin + limit));
        let mut tasks = JoinSet::new();
        for _ in 0..count {
            let task = task(Rc::clone(self));
            let load = Rc::clone(self);
            tasks.spawn_local(async move {
                if let Err(error) = task.await
                    && !(load.mortal.get() && error.kind() != ErrorKind::Other)
                {
                    load.problem(error.to_string());
                }
            });
        }
        while tasks.join_next().await.is_some() {}
        begin.elapsed()
    }

    fn is_over(&self) -> bool {
        self.end.get().is_some_and(|end| Instant::now() >= end)
    }

    /// One person enrols, and asks again while the server says that it is busy. None if it
    /// refused, or time ran out.
    async fn enrol_one(&self, connection: &mut Connection) -> io::Result<Option<()>> {
        let route = routes::participants(STUDY);
        loop {
            let answer = connection.send("POST", &route, None, br#"{"consent":true}"#).await?;
            match answer.status {
                201 => {
                    let enrolled: Enrolled = serde_json::from_slice(answer.body)?;
                    self.waiting.borrow_mut().push_back(Participant::new(&enrolled));
                    return Ok(Some(()));
                }
                503 if !self.is_over() => self.put_off(answer.retry_after_s).await,
                status => {
                    self.problem(format!("an enrolment was answered {status}"));
                    return Ok(None);
                }
            }
        }
    }

    /// Takes one waiting participant after the other and uploads all their trials.
    async fn drive_on(&self, connection: &mut Connection) -> io::Result<()> {
        while let Some(mut participant) = self.next() {
            let mut end = Ok(());
            while end.is_ok() && participant.next().is_some() && !self.is_over() {
                let begin = Instant::now();
                end = self.drive_one(connection, &mut participant, begin).await;
            }
            self.leave(participant);
            end?;
        }
        Ok(())
    }

    /// Uploads a trial each second, the first at `first`. A late answer makes the next upload
    /// late, which counts as its time too.
    async fn drive_by_the_clock(&self, first: Instant, stop: &Cell<bool>) -> io::Result<()> {
        let mut connection = Connection::open(self.address.get()).await?;
        // From among those who enrolled last, and have all their trials before them.
        let Some(mut participant) = self.waiting.borrow_mut().pop_back() else {
            return Err(io::Error::other("nobody is left to drive"));
        };
        let (mut due, mut end) = (first, Ok(()));
        while end.is_ok() && !stop.get() && participant.next().is_some() {
            sleep_until(due.into()).await;
            end = self.drive_one(&mut connection, &mut participant, due).await;
            due += Duration::from_secs(1);
        }
        self.leave(participant);
        end
    }

    /// Uploads the participant's next trial until it is acknowledged, and notes the time since
    /// `begin`: without end for one that is refused.
    async fn drive_one(
        &self,
        connection: &mut Connection,
        participant: &mut Participant,
        begin: Instant,
    ) -> io::Result<()> {
        let Some((trial_id, scene)) = participant.next() else { return Ok(()) };
        let body = serde_json::to_vec(&drive(trial_id, scene))?;
        let route = routes::my_trial(trial_id);
        loop {
            let answer = connection.send("PUT", &route, Some(&participant.token), &body).await?;
            match answer.status {
                // 200: it was stored before, and the answer was lost.
                200 | 201 => break,
                503 if !self.is_over() => self.put_off(answer.retry_after_s).await,
                status => {
                    self.latencies.borrow_mut().push(f64::INFINITY);
                    return Err(io::Error::other(format!("an upload was answered {status}")));
                }
            }
        }
        participant.acknowledge();
        self.acknowledged.set(self.acknowledged.get() + 1);
        self.note(begin);
        Ok(())
    }

    /// Who drives next; nobody when it is over, which it is for all when nobody is left.
    fn next(&self) -> Option<Participant> {
        if self.is_over() {
            return None;
        }
        let next = self.waiting.borrow_mut().pop_front();
        if next.is_none() {
            self.end.set(Some(Instant::now()));
        }
        next
    }

    fn leave(&self, participant: Participant) {
        if participant.next().is_some() {
            self.waiting.borrow_mut().push_back(participant);
        } else {
            self.done.borrow_mut().push(participant);
        }
    }

    /// Waits as the server asked to.
    async fn put_off(&self, retry_after_s: Option<u64>) {
        self.refused.set(self.refused.get() + 1);
        sleep(Duration::from_secs(retry_after_s.unwrap_or(1))).await;
    }

    fn note(&self, begin: Instant) {
        self.latencies.borrow_mut().push(1e3 * begin.elapsed().as_secs_f64());
    }

    fn problem(&self, text: String) {
        self.problems.borrow_mut().push(text);
    }
}
