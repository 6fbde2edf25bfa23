//! People at their own pace. Each joins and uploads trials when they are due. Sometimes a person
//! reloads the page, sends a trial again, vanishes before the response, or withdraws.

use super::Crowd;
use super::http::Connection;
use super::person::{Person, Withdrawal};
use sidestep::api::{Progress, routes};
use sidestep::math::SeededRng;
use std::io::{self, ErrorKind};
use std::rc::Rc;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use tokio::time::sleep_until;

/// Behaviour of people.
#[derive(Clone, Copy, Debug)]
pub struct Habits {
    /// Time between two trials of a person (s).
    pub period_s: f64,
    /// How many of 1,000 trials are preceded by a reload of the page.
    pub reloads: usize,
    /// How many of 1,000 trials are preceded by a second upload of the previous trial.
    pub repeats: usize,
    /// For how many of 1,000 trials the person closes the connection before the response and
    /// uploads the trial again.
    pub vanishes: usize,
    /// How many of 1,000 trials are replaced by a withdrawal. Half of the withdrawals ask for
    /// deletion of the data.
    pub withdrawals: usize,
    /// Seed of all random choices.
    pub seed: u64,
}

impl Default for Habits {
    fn default() -> Self {
        Self { period_s: 12.0, reloads: 20, repeats: 20, vanishes: 10, withdrawals: 1, seed: 1 }
    }
}

/// A person's action when a trial is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Act {
    Drive,
    Reload,
    Repeat,
    Vanish,
    Withdraw { delete: bool },
}

impl Habits {
    fn draw(&self, rng: &mut SeededRng) -> Act {
        let mut drawn = rng.below(1_000);
        for (act, share) in
            [(Act::Reload, self.reloads), (Act::Repeat, self.repeats), (Act::Vanish, self.vanishes)]
        {
            if drawn < share {
                return act;
            }
            drawn -= share;
        }
        if drawn < self.withdrawals {
            return Act::Withdraw { delete: rng.below(2) == 0 };
        }
        Act::Drive
    }
}

impl Crowd {
    /// Simulates `people` people, who join evenly distributed over `join_s` and take part until
    /// `end_s` after the start (s). Every action is due at a fixed time, whether or not earlier
    /// responses are late.
    pub async fn take_part(
        self: &Rc<Self>,
        people: usize,
        habits: Habits,
        join_s: f64,
        end_s: f64,
    ) {
        let begin = Instant::now();
        self.ends_at(begin + Duration::from_secs_f64(end_s));
        let mut tasks = JoinSet::new();
        for number in 0..people {
            let crowd = Rc::clone(self);
            let joins = begin + Duration::from_secs_f64(join_s * number as f64 / people as f64);
            tasks.spawn_local(async move {
                if let Err(error) = crowd.participation(number, habits, joins).await {
                    crowd.broken(&error);
                }
            });
        }
        while tasks.join_next().await.is_some() {}
    }

    async fn participation(&self, number: usize, habits: Habits, joins: Instant) -> io::Result<()> {
        sleep_until(joins.into()).await;
        if self.is_over() {
            return Ok(());
        }
        let mut connection = self.connect().await?;
        let Some(mut person) = self.enrolled_at(&mut connection, joins).await? else {
            return Ok(());
        };
        let mut rng = SeededRng::new(habits.seed.wrapping_add(number as u64));
        let mut due = joins;
        let mut end = Ok(());
        while end.is_ok() && person.next().is_some() && person.withdrawal.is_none() {
            due += Duration::from_secs_f64(habits.period_s);
            if self.is_over_at(due) {
                break;
            }
            sleep_until(due.into()).await;
            let act = habits.draw(&mut rng);
            end = self.act(&mut connection, &mut person, due, act).await;
            if end.as_ref().is_err_and(|error| error.kind() != ErrorKind::Other) {
                // The server closes idle connections, and a browser would open a new one.
                connection = self.connect().await?;
                end = self.act(&mut connection, &mut person, due, act).await;
            }
        }
        self.leave(person);
        end
    }

    async fn act(
        &self,
        connection: &mut Connection,
        person: &mut Person,
        due: Instant,
        act: Act,
    ) -> io::Result<()> {
        match act {
            Act::Drive => {}
            Act::Reload => self.reload(connection, person, due).await?,
            Act::Repeat => {
                if let Some((trial_id, body)) = person.last() {
                    self.put(connection, &person.token, trial_id, &body).await?;
                    self.note_other(due);
                }
            }
            Act::Vanish => {
                if let (Some(trial_id), Some(body)) = (person.next(), person.next_body()) {
                    let gone = std::mem::replace(connection, self.connect().await?);
                    let route = routes::my_trial(trial_id);
                    gone.vanish("PUT", &route, Some(&person.token), &body).await?;
                }
            }
            Act::Withdraw { delete } => {
                return self.withdraw(connection, person, due, delete).await;
            }
        }
        self.drive_one(connection, person, due).await
    }

    /// Requests the participant's progress, as a reload does, and checks that it lists exactly the
    /// acknowledged trials.
    async fn reload(
        &self,
        connection: &mut Connection,
        person: &Person,
        due: Instant,
    ) -> io::Result<()> {
        let answer = connection.send("GET", routes::ME, Some(&person.token), b"").await?;
        if answer.status != 200 {
            return Err(io::Error::other(format!("a reload was answered {}", answer.status)));
        }
        let me: Progress = serde_json::from_slice(answer.body)?;
        self.note_other(due);
        if !person.acknowledged().eq(me.stored.iter().map(String::as_str)) {
            let [stored, sent] = [me.stored.len(), person.count()];
            self.problem(format!("a reload finds {stored} trials of {sent}"));
        }
        Ok(())
    }

    async fn withdraw(
        &self,
        connection: &mut Connection,
        person: &mut Person,
        due: Instant,
        delete: bool,
    ) -> io::Result<()> {
        let data = if delete { "delete" } else { "keep" };
        person.withdrawal = Some(Withdrawal { delete, acknowledged: false });
        let route = format!("{}?data={data}", routes::ME);
        let answer = connection.send("DELETE", &route, Some(&person.token), b"").await?;
        if answer.status != 200 {
            return Err(io::Error::other(format!("a withdrawal was answered {}", answer.status)));
        }
        person.withdrawal = Some(Withdrawal { delete, acknowledged: true });
        self.note_other(due);
        Ok(())
    }
}
