//! Participants at work: enrolling, uploading, and both at once.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::rc::Rc;
use std::time::{Duration, Instant};

use sidestep::api::{Enrolled, routes};
use sidestep::scene::Scene;
use sidestep_tests::{Address, Driver, driven};
use tokio::task::JoinSet;
use tokio::time::{sleep, sleep_until};

use crate::figures::Milliseconds;
use crate::http::Connection;

/// Somebody who takes part.
pub(crate) struct Participant {
    pub(crate) id: String,
    token: String,
    /// What is to be driven: trial and scene.
    plan: Vec<(String, Scene)>,
    /// How many trials the server has acknowledged.
    acknowledged: usize,
}

impl Participant {
    fn new(enrolled: Enrolled) -> Self {
        let driver = Driver { enrolled };
        let plan = driver.scenes();
        let Enrolled { participant_id: id, token, .. } = driver.enrolled;
        Self { id, token, plan, acknowledged: 0 }
    }

    /// The trial that comes next; none after the last.
    fn next(&self) -> Option<&(String, Scene)> {
        self.plan.get(self.acknowledged)
    }

    /// The trials that the server has acknowledged.
    pub(crate) fn acknowledged(&self) -> &[(String, Scene)] {
        &self.plan[..self.acknowledged]
    }
}

/// Everybody who takes part, and how the server treats them.
#[derive(Default)]
pub(crate) struct Load {
    /// `HOST:PORT`.
    address: RefCell<String>,
    /// Who has trials left to drive.
    waiting: RefCell<VecDeque<Participant>>,
    /// Who has not.
    done: RefCell<Vec<Participant>>,
    latencies: RefCell<Milliseconds>,
    enrolled: Cell<usize>,
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

impl Load {
    pub(crate) fn new(server: &Address) -> Self {
        let load = Self::default();
        load.serve_from(server);
        load
    }

    /// From now on that server is asked.
    pub(crate) fn serve_from(&self, server: &Address) {
        self.address.replace(server.origin.trim_start_matches("http://").to_owned());
    }

    /// Lets `count` people enrol, or fewer if time runs out: how many did, and in what time, s.
    pub(crate) async fn enrol(
        self: &Rc<Self>,
        count: usize,
        connections: usize,
        limit_s: f64,
    ) -> (usize, f64) {
        let before = self.enrolled.get();
        let left = Rc::new(Cell::new(count));
        let took_s = self.together(connections, limit_s, |load| {
            let left = Rc::clone(&left);
            async move {
                let mut connection = load.connect().await?;
                while left.get() > 0 && !load.is_over() {
                    left.set(left.get() - 1);
                    let begin = Instant::now();
                    if load.enrol_one(&mut connection).await? {
                        load.note(begin);
                    }
                }
                Ok(())
            }
        });
        let took_s = took_s.await;
        (self.enrolled.get() - before, took_s)
    }

    /// Lets participants upload over this number of connections until time or participants run out.
    /// Returns the number of acknowledged uploads and the time that they took, s.
    pub(crate) async fn upload(self: &Rc<Self>, connections: usize, limit_s: f64) -> (usize, f64) {
        let before = self.acknowledged.get();
        // One participant drives one trial after the other.
        let connections = connections.min(self.waiting());
        let took_s = self.together(connections, limit_s, |load| async move {
            load.drive_on(&mut load.connect().await?).await
        });
        let took_s = took_s.await;
        (self.acknowledged.get() - before, took_s)
    }

    /// Lets `count` people enrol at once, each on a connection of their own, while others
    /// upload `per_s` trials a second by the clock: how many enrolled, and in what time, s.
    pub(crate) async fn class(
        self: &Rc<Self>,
        count: usize,
        per_s: usize,
        limit_s: f64,
    ) -> (usize, f64) {
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
        let before = self.enrolled.get();
        let took_s = self.together(count, limit_s, |load| async move {
            load.enrol_one(&mut load.connect().await?).await.map(drop)
        });
        let took_s = took_s.await;
        sleep(Duration::from_secs(1)).await;
        stop.set(true);
        while beside.join_next().await.is_some() {}
        (self.enrolled.get() - before, took_s)
    }

    /// The durations of the requests since the last call.
    pub(crate) fn take_latencies(&self) -> Milliseconds {
        self.latencies.take()
    }

    /// The numbers of requests that the server put off and that failed since the last call, with
    /// the message of one failure.
    pub(crate) fn troubles(&self) -> String {
        let problems = self.problems.take();
        let example = problems.first().map(|text| format!(": {text}")).unwrap_or_default();
        format!("{}, {}{example}", self.refused.take(), problems.len())
    }

    /// The number of participants who have trials left to drive.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting.borrow().len()
    }

    /// Removes and returns all participants, with or without trials left.
    pub(crate) fn everybody(&self) -> impl Iterator<Item = Participant> {
        self.waiting.take().into_iter().chain(self.done.take())
    }

    async fn connect(&self) -> io::Result<Connection> {
        let address = self.address.borrow().clone();
        Connection::open(&address).await
    }

    /// Runs `count` tasks until they end or, shortly after the limit, stops them. Returns the time
    /// taken, s.
    async fn together<F: Future<Output = io::Result<()>> + 'static>(
        self: &Rc<Self>,
        count: usize,
        limit_s: f64,
        task: impl Fn(Rc<Self>) -> F,
    ) -> f64 {
        let begin = Instant::now();
        self.end.set(Some(begin + Duration::from_secs_f64(limit_s)));
        let mut tasks = JoinSet::new();
        for _ in 0..count {
            let (load, task) = (Rc::clone(self), task(Rc::clone(self)));
            tasks.spawn_local(async move {
                if let Err(error) = task.await
                    && !(load.mortal.get() && error.kind() != ErrorKind::Other)
                {
                    load.problem(error.to_string());
                }
            });
        }
        while tasks.join_next().await.is_some() {}
        begin.elapsed().as_secs_f64()
    }

    fn is_over(&self) -> bool {
        self.end.get().is_some_and(|end| Instant::now() >= end)
    }

    /// One person enrols, and asks again while the server says that it is busy. False if it
    /// refused, or time ran out.
    async fn enrol_one(&self, connection: &mut Connection) -> io::Result<bool> {
        let route = routes::participants("default");
        loop {
            let answer = connection.send("POST", &route, None, br#"{"consent":true}"#).await?;
            match answer.status {
                201 => {
                    let enrolled = serde_json::from_slice(answer.body)?;
                    self.waiting.borrow_mut().push_back(Participant::new(enrolled));
                    self.enrolled.set(self.enrolled.get() + 1);
                    return Ok(true);
                }
                503 if !self.is_over() => self.put_off(answer.retry_after_s).await,
                status => {
                    self.problem(format!("an enrolment was answered {status}"));
                    return Ok(false);
                }
            }
        }
    }

    /// Takes one waiting participant after the other and uploads all their trials.
    async fn drive_on(&self, connection: &mut Connection) -> io::Result<()> {
        while let Some(mut participant) = self.next() {
            let mut end = Ok(());
            while end.is_ok() && participant.next().is_some() && !self.is_over() {
                end = self.drive_one(connection, &mut participant, Instant::now()).await;
            }
            self.leave(participant);
            end?;
        }
        Ok(())
    }

    /// Uploads a trial each second, the first at `first`. A late answer makes the next upload
    /// late, which counts as its time too.
    async fn drive_by_the_clock(&self, first: Instant, stop: &Cell<bool>) -> io::Result<()> {
        let mut connection = self.connect().await?;
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
        let body = serde_json::to_vec(&driven(scene))?;
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
        participant.acknowledged += 1;
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
