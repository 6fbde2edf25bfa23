//! Participants who enrol and upload, at full speed or at a fixed rate.

use super::figures::Latencies;
use super::http::Connection;
use super::person::Person;
use crate::Address;
use sidestep::api::routes;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::rc::Rc;
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio::task::JoinSet;
use tokio::time::{sleep, sleep_until};

/// All participants, and the servers' responses to them. All tasks run in one thread, on a
/// `LocalSet`.
#[derive(Debug, Default)]
pub struct Crowd {
    /// The servers of the study. New connections use one server after another.
    servers: RefCell<Vec<SocketAddr>>,
    turn: Cell<usize>,
    /// People who have trials left to drive.
    waiting: RefCell<VecDeque<Person>>,
    /// People who have no trials left, or have withdrawn.
    done: RefCell<Vec<Person>>,
    /// Latencies of uploads.
    latencies: RefCell<Latencies>,
    /// Latencies of all other requests.
    others: RefCell<Latencies>,
    enrolled: Cell<usize>,
    acknowledged: Cell<usize>,
    /// Notifies waiting tasks of new acknowledgements.
    progress: Notify,
    /// Number of 503 responses.
    refused: Cell<usize>,
    /// Descriptions of unexpected responses and disconnections.
    problems: RefCell<Vec<String>>,
    /// Whether broken connections are expected because a server will be killed.
    pub mortal: Cell<bool>,
    /// No new work starts after this time.
    end: Cell<Option<Instant>>,
}

/// Rule that determines when uploads are due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Each upload is due as soon as the previous upload on the connection is acknowledged.
    Fast,
    /// This number of uploads is due per second, regardless of earlier uploads.
    PerSecond(f64),
}

impl Crowd {
    /// A crowd that uses these servers.
    #[must_use]
    pub fn of(servers: &[&Address]) -> Rc<Self> {
        let crowd = Self::default();
        crowd.serve_from(servers);
        Rc::new(crowd)
    }

    /// Uses these servers from now on.
    ///
    /// # Panics
    /// If the address of a server is not an IP address with a port.
    pub fn serve_from(&self, servers: &[&Address]) {
        let address = |server: &&Address| {
            let text = server.origin.trim_start_matches("http://");
            text.parse().expect("an address with a port")
        };
        self.servers.replace(servers.iter().map(address).collect());
    }

    /// Enrols `count` people, or fewer if time runs out. Returns the number of people enrolled and
    /// the time taken (s).
    pub async fn enrol(
        self: &Rc<Self>,
        count: usize,
        connections: usize,
        limit_s: f64,
    ) -> (usize, f64) {
        let before = self.enrolled.get();
        let left = Rc::new(Cell::new(count));
        let took_s = self.together(connections, limit_s, |crowd| {
            let left = Rc::clone(&left);
            async move {
                let mut connection = crowd.connect().await?;
                while left.get() > 0 && !crowd.is_over() {
                    left.set(left.get() - 1);
                    crowd.enrol_one(&mut connection).await?;
                }
                Ok(())
            }
        });
        let took_s = took_s.await;
        (self.enrolled.get() - before, took_s)
    }

    /// Prepares the request bodies of all waiting people.
    pub fn prepare(&self) {
        self.waiting.borrow_mut().iter_mut().for_each(Person::prepare);
    }

    /// Makes participants upload over this number of connections until the time is over or no
    /// participant is left. Returns the number of acknowledged uploads and the time taken (s).
    pub async fn upload(
        self: &Rc<Self>,
        connections: usize,
        limit_s: f64,
        pace: Pace,
    ) -> (usize, f64) {
        let before = self.acknowledged.get();
        // Each participant drives one trial at a time, so more connections would be idle.
        let connections = connections.min(self.waiting());
        let (begin, ticket) = (Instant::now(), Rc::new(Cell::new(0)));
        let took_s = self.together(connections, limit_s, |crowd| {
            let ticket = Rc::clone(&ticket);
            let due = move || match pace {
                Pace::Fast => Instant::now(),
                Pace::PerSecond(rate) => {
                    let number = ticket.replace(ticket.get() + 1);
                    begin + Duration::from_secs_f64(f64::from(number) / rate)
                }
            };
            async move { crowd.drive_on(&mut crowd.connect().await?, due).await }
        });
        let took_s = took_s.await;
        (self.acknowledged.get() - before, took_s)
    }

    /// Enrols `count` people at the same time, each on their own connection. Meanwhile, other
    /// people upload `per_s` trials per second at a fixed rate. Returns the number of people
    /// enrolled and the time taken (s).
    pub async fn class(self: &Rc<Self>, count: usize, per_s: usize, limit_s: f64) -> (usize, f64) {
        let stop = Rc::new(Cell::new(false));
        let mut beside = JoinSet::new();
        let begin = Instant::now();
        let limit = Duration::from_secs_f64(limit_s);
        self.ends_at(begin + limit);
        for number in 0..per_s {
            let (crowd, stop) = (Rc::clone(self), Rc::clone(&stop));
            let first = begin + Duration::from_secs_f64(number as f64 / per_s as f64);
            beside.spawn_local(async move {
                if let Err(error) = crowd.drive_by_the_clock(first, &stop).await {
                    crowd.problem(error.to_string());
                }
            });
        }
        // Wait until uploads are in progress before the `count` people enrol.
        self.until_acknowledged(self.acknowledged() + per_s).await;
        let before = self.enrolled.get();
        let took_s = self.together(count, limit_s, |crowd| async move {
            crowd.enrol_one(&mut crowd.connect().await?).await.map(drop)
        });
        let took_s = took_s.await;
        self.ends_at(Instant::now() + limit);
        self.until_acknowledged(self.acknowledged() + per_s).await;
        stop.set(true);
        while beside.join_next().await.is_some() {}
        (self.enrolled.get() - before, took_s)
    }

    /// Latencies of uploads since the last call of this function.
    pub fn take_latencies(&self) -> Latencies {
        self.latencies.take()
    }

    /// Latencies of all other requests since the last call of this function.
    pub fn take_others(&self) -> Latencies {
        self.others.take()
    }

    /// The number of 503 responses and of problems since the last call of this function, with the
    /// first problem as an example.
    pub fn troubles(&self) -> String {
        let problems = self.problems.take();
        let example = problems.first().map(|text| format!(": {text}")).unwrap_or_default();
        format!("{}, {}{example}", self.refused.take(), problems.len())
    }

    /// Descriptions of unexpected responses and disconnections.
    #[must_use]
    pub fn problems(&self) -> Vec<String> {
        self.problems.borrow().clone()
    }

    /// The number of participants who have trials left to drive.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.waiting.borrow().len()
    }

    /// The number of acknowledged trials.
    #[must_use]
    pub fn acknowledged(&self) -> usize {
        self.acknowledged.get()
    }

    /// Waits until this number of trials has been acknowledged, or time is over.
    pub async fn until_acknowledged(&self, count: usize) {
        while self.acknowledged.get() < count && !self.is_over() {
            self.progress.notified().await;
        }
    }

    /// Removes and returns all participants, with or without trials left.
    pub fn everybody(&self) -> Vec<Person> {
        self.waiting.take().into_iter().chain(self.done.take()).collect()
    }

    pub(super) async fn connect(&self) -> io::Result<Connection> {
        let turn = self.turn.replace(self.turn.get() + 1);
        let server = {
            let servers = self.servers.borrow();
            servers[turn % servers.len()]
        };
        // Connections come from different addresses, as in a real crowd. All addresses in
        // 127.0.0.0/8 belong to this machine.
        let [fourth, third, ..] = turn.to_le_bytes();
        Connection::open(server, Some([127, 0, third, fourth.max(1)].into())).await
    }

    /// Runs `count` tasks until all have ended. They start no new work after the limit. Returns the
    /// time taken (s).
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
            let (crowd, task) = (Rc::clone(self), task(Rc::clone(self)));
            tasks.spawn_local(async move {
                if let Err(error) = task.await {
                    crowd.broken(&error);
                }
            });
        }
        while tasks.join_next().await.is_some() {}
        self.stop();
        begin.elapsed().as_secs_f64()
    }

    pub(super) fn is_over(&self) -> bool {
        self.is_over_at(Instant::now())
    }

    /// Whether this instant is at or after the end.
    pub(super) fn is_over_at(&self, then: Instant) -> bool {
        self.end.get().is_some_and(|end| then >= end)
    }

    /// Sets the time after which no new work starts.
    pub(super) fn ends_at(&self, end: Instant) {
        self.end.set(Some(end));
    }

    /// Stops the run: no new work starts from now on.
    pub fn stop(&self) {
        self.ends_at(Instant::now());
        self.progress.notify_waiters();
    }

    /// Records why a connection broke. Broken connections are expected if a server will be killed.
    pub(super) fn broken(&self, error: &io::Error) {
        if !self.mortal.get() || error.kind() == ErrorKind::Other {
            self.problem(error.to_string());
        }
    }

    /// Enrols one person, and retries while the server is busy. Returns false if the server refused
    /// or time ran out.
    async fn enrol_one(&self, connection: &mut Connection) -> io::Result<bool> {
        let person = self.enrolled_at(connection, Instant::now()).await?;
        let is_in = person.is_some();
        self.waiting.borrow_mut().extend(person);
        Ok(is_in)
    }

    /// Enrols a person whose enrolment was due at `due`. Returns `None` if the server refused or
    /// time ran out.
    pub(super) async fn enrolled_at(
        &self,
        connection: &mut Connection,
        due: Instant,
    ) -> io::Result<Option<Person>> {
        let route = routes::participants("default");
        loop {
            let answer = connection.send("POST", &route, None, br#"{"consent":true}"#).await?;
            match answer.status {
                201 => {
                    let enrolled = serde_json::from_slice(answer.body)?;
                    self.others.borrow_mut().note(due.elapsed());
                    let number = self.enrolled.replace(self.enrolled.get() + 1);
                    return Ok(Some(Person::new(enrolled, number)));
                }
                503 if !self.is_over() => self.put_off(answer.retry_after_s).await,
                status => {
                    self.problem(format!("an enrolment was answered {status}"));
                    return Ok(None);
                }
            }
        }
    }

    /// Takes one waiting participant after another and uploads all their trials when they are due.
    async fn drive_on(
        &self,
        connection: &mut Connection,
        due: impl Fn() -> Instant,
    ) -> io::Result<()> {
        while let Some(mut person) = self.next() {
            let mut end = Ok(());
            while end.is_ok() && person.next().is_some() && !self.is_over() {
                let due = due();
                if due > Instant::now() {
                    sleep_until(due.into()).await;
                }
                end = self.drive_one(connection, &mut person, due).await;
            }
            self.leave(person);
            end?;
        }
        Ok(())
    }

    /// Uploads a trial each second, the first at `first`. A late answer delays the next upload, and
    /// the delay counts towards the latency of that upload.
    async fn drive_by_the_clock(&self, first: Instant, stop: &Cell<bool>) -> io::Result<()> {
        let mut connection = self.connect().await?;
        // Take a person who enrolled recently and has all trials left.
        let Some(mut person) = self.waiting.borrow_mut().pop_back() else {
            return Err(io::Error::other("nobody is left to drive"));
        };
        let (mut due, mut end) = (first, Ok(()));
        while end.is_ok() && !stop.get() && person.next().is_some() {
            sleep_until(due.into()).await;
            end = self.drive_one(&mut connection, &mut person, due).await;
            due += Duration::from_secs(1);
        }
        self.leave(person);
        end
    }

    /// Uploads the participant's next trial until it is acknowledged, and records the latency since
    /// `due`.
    pub(super) async fn drive_one(
        &self,
        connection: &mut Connection,
        person: &mut Person,
        due: Instant,
    ) -> io::Result<()> {
        let (Some(trial_id), Some(body)) = (person.next(), person.next_body()) else {
            return Ok(());
        };
        self.put(connection, &person.token, trial_id, &body).await?;
        drop(body);
        person.acknowledge();
        self.acknowledged.set(self.acknowledged.get() + 1);
        self.latencies.borrow_mut().note(due.elapsed());
        self.progress.notify_waiters();
        Ok(())
    }

    /// Uploads a trial until it is acknowledged.
    pub(super) async fn put(
        &self,
        connection: &mut Connection,
        token: &str,
        trial_id: &str,
        body: &[u8],
    ) -> io::Result<()> {
        let route = routes::my_trial(trial_id);
        loop {
            let answer = connection.send("PUT", &route, Some(token), body).await?;
            match answer.status {
                // 200 means that the trial was already stored, but the earlier response was lost.
                200 | 201 => return Ok(()),
                503 if !self.is_over() => self.put_off(answer.retry_after_s).await,
                status => {
                    self.latencies.borrow_mut().refuse();
                    return Err(io::Error::other(format!("an upload was answered {status}")));
                }
            }
        }
    }

    /// Records a request that is neither an enrolment nor an upload.
    pub(super) fn note_other(&self, due: Instant) {
        self.others.borrow_mut().note(due.elapsed());
    }

    /// Removes the next person who has trials left to drive. Returns `None` if time is over. If
    /// nobody is left, also ends the run for all connections.
    fn next(&self) -> Option<Person> {
        if self.is_over() {
            return None;
        }
        let next = self.waiting.borrow_mut().pop_front();
        if next.is_none() {
            self.end.set(Some(Instant::now()));
        }
        next
    }

    pub(super) fn leave(&self, person: Person) {
        if person.next().is_some() && person.withdrawal.is_none() {
            self.waiting.borrow_mut().push_back(person);
        } else {
            self.done.borrow_mut().push(person);
        }
    }

    /// Waits for as long as the server asked.
    async fn put_off(&self, retry_after_s: Option<u64>) {
        self.refused.set(self.refused.get() + 1);
        sleep(Duration::from_secs(retry_after_s.unwrap_or(1))).await;
    }

    pub(super) fn problem(&self, text: String) {
        self.problems.borrow_mut().push(text);
    }
}
