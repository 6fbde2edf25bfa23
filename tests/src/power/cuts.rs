//! A server that loses power at many points of one recording.

use super::{Disk, Recording};
use crate::load::{Comparison, Person, compare};
use crate::{Answer, Database, Folder, Server, sqlite};
use reqwest::Method;
use serde_json::json;
use sidestep::api::routes;
use sidestep::math::SeededRng;
use sqlx::SqliteConnection;

/// A session before the power is cut.
#[derive(Clone, Copy, Debug)]
pub struct Session {
    /// Number of people, one after another.
    pub people: usize,
    /// Number of trials of each person.
    pub trials: usize,
    /// Seed of the random choice of the writes that reach the disk.
    pub seed: u64,
}

/// A fact that a client knows from some point on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// Another trial of the person is stored.
    Stored,
    /// The person has asked for deletion.
    Leaving,
    /// The server has acknowledged the deletion.
    Gone,
}

/// A recorded session.
#[derive(Debug)]
pub struct Recorded {
    recording: Recording,
    people: Vec<Person>,
    known: Vec<(usize, usize, Known)>,
    rng: SeededRng,
}

impl Session {
    /// Records the writes to the disk while people enrol and upload. Every second person deletes
    /// their data.
    ///
    /// # Panics
    /// If the server refuses a request.
    pub async fn record(self) -> Recorded {
        let folder = tempfile::TempDir::new().expect("a folder");
        let recording = Recording::of(folder.path());
        let server = Server::within(folder, "").await;
        let (mut people, mut known) = (Vec::new(), Vec::new());
        for number in 0..self.people {
            let route = routes::participants("default");
            let enrol = server.request(Method::POST, &route).json(&json!({ "consent": true }));
            let mut person = Person::new(Answer::of(enrol).await.into(201), number);
            for _ in 0..self.trials {
                let (Some(trial_id), Some(body)) = (person.next(), person.next_body()) else {
                    break;
                };
                let put = server.request(Method::PUT, &routes::my_trial(trial_id));
                let put = put.header("content-type", "application/json").body(body.into_owned());
                let answer = Answer::of(put.bearer_auth(&person.token)).await;
                assert_eq!(answer.status, 201, "{}", answer.body);
                person.acknowledge();
                known.push((recording.now(), number, Known::Stored));
            }
            if !number.is_multiple_of(2) {
                known.push((recording.now(), number, Known::Leaving));
                let delete = server.request(Method::DELETE, &format!("{}?data=delete", routes::ME));
                let answer = Answer::of(delete.bearer_auth(&person.token)).await;
                assert_eq!(answer.status, 200, "{}", answer.body);
                known.push((recording.now(), number, Known::Gone));
            }
            people.push(person);
        }
        server.stop().await;
        Recorded { recording, people, known, rng: SeededRng::new(self.seed) }
    }
}

impl Recorded {
    /// The first and the last point at which there is acknowledged data to lose.
    ///
    /// # Panics
    /// If nothing was stored.
    #[must_use]
    pub fn moments(&self) -> (usize, usize) {
        (self.known.first().expect("a trial").0, self.recording.now())
    }

    /// Cuts the power at a point, and compares the files with what the clients knew at that point.
    ///
    /// # Errors
    /// If the database is damaged. The error is SQLite's message.
    ///
    /// # Panics
    /// If files cannot be written.
    pub async fn cut(&mut self, moment: usize, disk: Disk) -> Result<(Comparison, Folder), String> {
        let folder = Folder::default();
        self.recording.cut(moment, disk, &mut self.rng, folder.root());
        let damage = damage(&folder).await.unwrap_or_else(|error| error.to_string());
        if damage != "ok" {
            return Err(damage);
        }
        let database = Database::file(folder.root(), "sidestep.db");
        Ok((compare(&self.people_at(moment), &database).await, folder))
    }

    /// A random point between [`Self::moments`].
    pub fn any_moment(&mut self) -> usize {
        let (first, last) = self.moments();
        first + self.rng.below(last - first + 1)
    }

    /// All people, with what their clients knew at a point.
    fn people_at(&self, moment: usize) -> Vec<Person> {
        let known = |number: usize, what: Known| {
            let until = self.known.iter().take_while(|(at, _, _)| *at <= moment);
            until.filter(|(_, who, known)| (*who, *known) == (number, what)).count()
        };
        let person = |(number, person): (usize, &Person)| {
            let [stored, leaving, gone] =
                [Known::Stored, Known::Leaving, Known::Gone].map(|what| known(number, what));
            person.as_of(stored, (leaving > 0).then_some(gone > 0))
        };
        self.people.iter().enumerate().map(person).collect()
    }
}

/// Runs SQLite's integrity check on the database in a folder. Returns `ok`, or a description of the
/// damage.
async fn damage(folder: &Folder) -> sqlx::Result<String> {
    let asked = async |db: &mut SqliteConnection| {
        let _: i64 = sqlx::query_scalar("SELECT count(*) FROM trial").fetch_one(&mut *db).await?;
        sqlx::query_scalar("PRAGMA integrity_check").fetch_one(&mut *db).await
    };
    sqlite::with(&folder.path("sidestep.db"), asked).await
}
