//! The demonstration of `sidestep serve --demo`: a study with synthetic participants and an analysis.
//!
//! All data are created like real data: the synthetic participants enrol and upload their trials
//! through the server's own HTTP interface, and the analysis worker runs the analysis. Each stage
//! first checks which data exist, so that a later start can complete an interrupted demonstration.
//! At the end the study is closed, and later starts leave it unchanged.

mod cast;

use super::simulate::volunteer::Volunteer;
use super::{CommandError, print_line};
use crate::client::{Client, ClientError, Participation};
use crate::formats::study_toml::StudyFile;
use crate::jobs::safety;
use crate::store::Store;
use crate::store::audit::NewEntry;
use crate::store::studies::StoredStudy;
use crate::support::clock::now_ms;
use cast::{CAST, Ending, Role};
use sidestep::api::{Action, AnalysisState, ComprehensionResult};
use sidestep::comparison::Request;
use sidestep::study::{Status, StudyConfig};
use sidestep::synthetic::SyntheticParticipant;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use uuid::Uuid;

/// The study's name in URLs.
pub(super) const SLUG: &str = "demo";

/// Seed of the synthetic population.
const SEED: u64 = 14;

/// Author of notes and of the analysis request in the audit trail.
const WHO: &str = "demonstration";

/// Poll interval for the analysis.
const TICK: Duration = Duration::from_millis(250);

/// The demonstration's study.
fn study() -> Result<StudyConfig, CommandError> {
    let file = StudyFile::of("demo".to_owned(), include_str!("demo/study.toml").to_owned());
    file.map(|file| file.config().clone()).map_err(CommandError::failure)
}

/// Creates the demonstration's study if it does not exist. Returns whether the study must still be
/// filled.
///
/// # Errors
/// [`CommandError::Input`] if another study has this name; that study is left unchanged.
pub(super) async fn prepare(store: &Store, database: &str) -> Result<bool, CommandError> {
    let wanted = study()?;
    match store.study(SLUG).await? {
        None => {
            let made = store.put_study(&wanted, now_ms()).await?;
            safety::keep_exact(store, &made).await?;
            Ok(true)
        }
        Some(known) if *known.config == of_status(&wanted, known.config.status) => {
            Ok(known.config.status == Status::Open)
        }
        Some(_) => Err(CommandError::Input(format!(
            "--demo: expected no study {SLUG} in {database}, or that of the demonstration, found another \
             one, which is left unchanged; choose another file with --database"
        ))),
    }
}

fn of_status(config: &StudyConfig, status: Status) -> StudyConfig {
    StudyConfig { status, ..config.clone() }
}

/// A demonstration that is being filled in the background.
#[derive(Debug)]
pub(super) struct Demo {
    task: JoinHandle<()>,
}

impl Demo {
    /// Fills the study through the server at `address`, and prints a message when it is ready.
    /// `analysis_asked` wakes the analysis worker. A key that was created at this start is printed
    /// again, because the log output has scrolled it off the screen.
    pub(super) fn start(
        store: Store,
        address: SocketAddr,
        analysis_asked: Arc<Notify>,
        new_key: Option<String>,
    ) -> Self {
        let origin = format!("http://{}", reachable(address));
        let filling = Filling { store, origin, analysis_asked, new_key };
        let task = tokio::spawn(async move {
            let said = match filling.fill().await {
                Ok(said) => said,
                Err(error) => format!(
                    "The study {SLUG} is not complete: {error}. Start the server again with --demo to resume."
                ),
            };
            if let Err(error) = print_line(&said) {
                tracing::warn!(%error, "the demonstration");
            }
        });
        Self { task }
    }

    /// Cancels unfinished work. The next start with `--demo` resumes it.
    pub(super) async fn stop(self) {
        self.task.abort();
        // Ignore the result: the task was either cancelled or had already ended.
        let _ = self.task.await;
    }
}

/// The message at the start, before the study is filled.
pub(super) fn announcement(address: SocketAddr) -> String {
    let (people, address) = (CAST.len(), reachable(address));
    format!(
        "The study {SLUG} is being filled with {people} synthetic participants and analysed, in less than a minute.\n  \
         look on at    http://{address}/lab/studies/{SLUG}"
    )
}

/// The address at which this machine reaches the server. It differs from `address` if the server
/// listens on all addresses.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address.ip() {
            IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
        });
    }
    address
}

struct Filling {
    store: Store,
    origin: String,
    analysis_asked: Arc<Notify>,
    new_key: Option<String>,
}

impl Filling {
    /// Fills whatever is missing, and returns the message to print at the end.
    async fn fill(&self) -> Result<String, CommandError> {
        let begin = Instant::now();
        let present = self.study().await?;
        let is_filled = present.config.status == Status::Open;
        if is_filled {
            self.people().await?;
            self.ask_analysis(&present).await?;
            self.close(&present).await?;
        }
        let ending = self.analysed(present.id).await?;
        let after = match is_filled {
            true => format!(" after {:.0} s", begin.elapsed().as_secs_f64()),
            false => String::new(),
        };
        let origin = &self.origin;
        let mut said = format!(
            "The study {SLUG} is ready{after}.\n  synthetic     {origin}/lab/studies/{SLUG}"
        );
        match ending {
            Some((id, AnalysisState::Done)) => {
                said += &format!("\n  report        {origin}/lab/analyses/{id}")
            }
            Some((_, state)) => said += &format!("\n  Its newest analysis is {}.", state.word()),
            None => {}
        }
        if let Some(key) = &self.new_key {
            said += &format!("\n  sign in with  {origin}/lab#key={key}");
        }
        Ok(said)
    }

    async fn study(&self) -> Result<StoredStudy, CommandError> {
        let gone = || CommandError::Failure(format!("the study {SLUG} no longer exists"));
        self.store.study(SLUG).await?.ok_or_else(gone)
    }

    /// Makes all participants take part, one after another, so that their numbers and scenes are
    /// the same each time.
    async fn people(&self) -> Result<(), CommandError> {
        let server = Client::at(&self.origin)
            .ok_or_else(|| CommandError::Failure(format!("{}: no address", self.origin)))?
            .map_err(CommandError::failure)?;
        let study = server.study(SLUG).await?;
        for (number, role) in (0..).zip(CAST) {
            let person = SyntheticParticipant::new(SEED, number);
            let volunteer = Volunteer {
                tasks: role.ending.tasks(),
                attempts: role.attempts,
                opinion: number as usize,
                mishap: role.mishap,
                ..Volunteer::new(&server, &study, person)
            };
            let name = format!("synthetic-{SEED}-{number}");
            let took_part = match role.ending {
                Ending::ScreenedOut => fails_check(&volunteer, name, role.attempts).await,
                _ => volunteer.take_part(name, |_| ()).await,
            };
            match took_part {
                Ok(me) => self.look_after(me.participant_id(), role).await?,
                // This participation ended before the demonstration was interrupted.
                Err(error) if matches!(error.code(), Some("withdrawn" | "screened_out")) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Adds the note about a participant, and applies the ending of their participation.
    async fn look_after(&self, id: &str, role: Role) -> Result<(), CommandError> {
        if let Some(text) = role.note {
            let known = self.store.profile(id).await?;
            if known.is_some_and(|known| known.notes.is_empty()) {
                let entry = entry(Action::NoteAdded, None);
                self.store.add_note(id, text.to_owned(), entry).await?;
            }
        }
        match role.ending {
            Ending::Excluded(reason) => {
                let entry = entry(Action::Excluded, None);
                self.store.exclude(id, Some(reason.to_owned()), entry).await?;
            }
            Ending::Withdrawn(_) => self.store.withdraw(id, false, now_ms(), None).await?,
            Ending::ScreenedOut => {
                // This participant enrolled before the demonstration was interrupted. With the new
                // token, attempts count from zero, so the server itself would not screen the
                // participant out.
                let result = ComprehensionResult { attempts: role.attempts, passed: false };
                self.store.check_understanding(id, None, result, role.attempts, now_ms()).await?;
            }
            Ending::Complete | Ending::UnderWay(_) => {}
        }
        Ok(())
    }

    /// Requests the analysis if there is none.
    async fn ask_analysis(&self, study: &StoredStudy) -> Result<(), CommandError> {
        if self.store.analyses_page(study.id, i64::MAX, 1).await?.is_empty() {
            let id = Uuid::new_v4().to_string();
            let entry = entry(Action::AnalysisRequested, Some(id.clone()));
            self.store.ask_analysis(id, study.id, &Request::default(), entry).await?;
            self.analysis_asked.notify_one();
        }
        Ok(())
    }

    /// Closes the study, so that no one else takes part and the next start adds nothing.
    async fn close(&self, study: &StoredStudy) -> Result<(), CommandError> {
        let closed = of_status(&study.config, Status::Closed);
        let entry = entry(Action::StudyChanged, Some("status".to_owned()));
        self.store.change_study(&closed, study.config_hash.clone(), entry).await?;
        Ok(safety::keep_exact(&self.store, &self.study().await?).await?)
    }

    /// Waits for the end of the study's newest analysis. Returns `None` if there is no analysis.
    async fn analysed(
        &self,
        study_id: i64,
    ) -> Result<Option<(String, AnalysisState)>, CommandError> {
        loop {
            let newest = self.store.analyses_page(study_id, i64::MAX, 1).await?.pop();
            match newest {
                Some(newest) if !newest.state.is_over() => tokio::time::sleep(TICK).await,
                newest => return Ok(newest.map(|newest| (newest.id, newest.state))),
            }
        }
    }
}

/// An audit-trail entry about the demonstration.
fn entry(action: Action, subject: Option<String>) -> NewEntry {
    let (who, study) = (WHO.to_owned(), Some(SLUG.to_owned()));
    NewEntry { at_ms: now_ms(), key_id: None, who, action, study, subject }
}

/// Enrols a participant who never answers correctly.
async fn fails_check(
    volunteer: &Volunteer<'_>,
    name: String,
    attempts: usize,
) -> Result<Participation, ClientError> {
    let me = volunteer.enrol(name).await?;
    me.check_understanding(&ComprehensionResult { attempts, passed: false }).await?;
    Ok(me)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_study_is_valid_and_its_people_differ() {
        let study = study().unwrap();
        study.check().unwrap();
        assert!(study.synthetic && study.slug == SLUG && study.status == Status::Open);
        let endings =
            |wanted: fn(Ending) -> bool| CAST.iter().filter(|it| wanted(it.ending)).count();
        assert_eq!(endings(|it| matches!(it, Ending::Withdrawn(_))), 1);
        assert_eq!(endings(|it| matches!(it, Ending::Excluded(_))), 1);
        assert_eq!(endings(|it| matches!(it, Ending::UnderWay(_))), 1);
        assert!(endings(|it| it == Ending::Complete) >= 8);
    }

    #[test]
    fn a_server_on_all_addresses_is_reached_on_this_machine() {
        for (listens, reached) in [
            ("0.0.0.0:80", "127.0.0.1:80"),
            ("[::]:80", "[::1]:80"),
            ("10.0.0.7:80", "10.0.0.7:80"),
        ] {
            assert_eq!(reachable(listens.parse().unwrap()), reached.parse().unwrap());
        }
    }
}
