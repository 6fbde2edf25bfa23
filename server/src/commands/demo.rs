//! The demonstration of `sidestep serve --demo`: a study that synthetic people fill, with an analysis.
//!
//! Everything goes the way of real data: people enrol and drive through the server's own HTTP interface, and the
//! worker makes the analysis. Each step looks for what is there first, so a demonstration that was broken
//! off goes on. At the end the study is closed, and a closed one is left as it is.

mod cast;

use super::simulate::volunteer::Volunteer;
use super::{CommandError, print_line};
use crate::client::{Client, ClientError, Participation};
use crate::clock::now_ms;
use crate::formats::study_toml::StudyFile;
use crate::jobs::safety;
use crate::store::Store;
use crate::store::audit::NewEntry;
use crate::store::studies::StoredStudy;
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

/// The study's name in addresses.
pub(super) const SLUG: &str = "demo";

/// The population that the people are from.
const SEED: u64 = 14;

/// Who writes notes and asks for the analysis, in the audit trail.
const WHO: &str = "demonstration";

/// How often the analysis is looked at.
const TICK: Duration = Duration::from_millis(250);

/// The demonstration's study.
fn study() -> Result<StudyConfig, CommandError> {
    let file = StudyFile::of("demo".to_owned(), include_str!("demo/study.toml").to_owned());
    file.map(|file| file.config().clone()).map_err(CommandError::failure)
}

/// Makes the study of the demonstration if there is none. Returns whether it is to be filled.
///
/// # Errors
/// [`CommandError::Input`] if there is another study of this name, which stays as it is.
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
             one, which stays as it is; give another file with --database"
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
    /// Fills the study through the server at `address`, and says when it is ready. `analysis_asked` tells the
    /// worker of the analysis; a key that was made at this start is said again, since the log of the filling
    /// has moved it away.
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
                    "The study {SLUG} is not complete: {error}. Start the server again with --demo to go on."
                ),
            };
            if let Err(error) = print_line(&said) {
                tracing::warn!(%error, "the demonstration");
            }
        });
        Self { task }
    }

    /// Breaks off what is not done, which goes on at the next start with `--demo`.
    pub(super) async fn stop(self) {
        self.task.abort();
        // It was aborted, or had ended.
        let _ = self.task.await;
    }
}

/// What the command says while the study fills.
pub(super) fn announcement(address: SocketAddr) -> String {
    let (people, address) = (CAST.len(), reachable(address));
    format!(
        "The study {SLUG} is being filled with {people} synthetic people and analysed, in less than a minute.\n  \
         look on at    http://{address}/lab/studies/{SLUG}"
    )
}

/// The address under which this machine reaches a server that listens on all its addresses.
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
    /// Does what is missing, and returns what to say then.
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
        let gone = || CommandError::Failure(format!("the study {SLUG} is not there any more"));
        self.store.study(SLUG).await?.ok_or_else(gone)
    }

    /// Everybody takes part, one after the other, so that numbers and scenes are the same each time.
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
                // Their participation ended before the demonstration was broken off.
                Err(error) if matches!(error.code(), Some("withdrawn" | "screened_out")) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// What experimenters do with a participant.
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
                // They enrolled before the demonstration was broken off. Whoever continues with another token
                // has attempts of its own, which end nothing.
                let result = ComprehensionResult { attempts: role.attempts, passed: false };
                self.store.check_understanding(id, None, result, role.attempts, now_ms()).await?;
            }
            Ending::Complete | Ending::UnderWay(_) => {}
        }
        Ok(())
    }

    /// Asks for the analysis if there is none.
    async fn ask_analysis(&self, study: &StoredStudy) -> Result<(), CommandError> {
        if self.store.analyses_page(study.id, i64::MAX, 1).await?.is_empty() {
            let id = Uuid::new_v4().to_string();
            let entry = entry(Action::AnalysisRequested, Some(id.clone()));
            self.store.ask_analysis(id, study.id, &Request::default(), entry).await?;
            self.analysis_asked.notify_one();
        }
        Ok(())
    }

    /// Nobody else takes part, and nothing is added at the next start.
    async fn close(&self, study: &StoredStudy) -> Result<(), CommandError> {
        let closed = of_status(&study.config, Status::Closed);
        let entry = entry(Action::StudyChanged, Some("status".to_owned()));
        self.store.change_study(&closed, study.config_hash.clone(), entry).await?;
        Ok(safety::keep_exact(&self.store, &self.study().await?).await?)
    }

    /// Waits until the study's newest analysis is over; nothing if there is none.
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

/// An entry of the audit trail about the demonstration.
fn entry(action: Action, subject: Option<String>) -> NewEntry {
    let (who, study) = (WHO.to_owned(), Some(SLUG.to_owned()));
    NewEntry { at_ms: now_ms(), key_id: None, who, action, study, subject }
}

/// Somebody enrols and never gets the answers right.
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
