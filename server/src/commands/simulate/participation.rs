//! Synthetic participants who take part through the HTTP interface, like real participants.

use super::super::{CommandError, print_json};
use super::volunteer::{Seen, Volunteer};
use super::{FlagCounts, SimulateArgs, bar};
use crate::client::Client;
use serde_json::json;
use sidestep::api::{SCHEMA_VERSION, StudyInfo};
use sidestep::study::{PhaseConfig, StudyConfig};
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep::trial::Phase;

/// Makes all participants take part, one after another, and prints the summary.
pub(super) async fn take_part(args: &SimulateArgs, url: &str) -> Result<(), CommandError> {
    let bad = |flag: &str, expected: &str, found: &str| {
        CommandError::Input(format!("--{flag}: expected {expected}, found {found}"))
    };
    if args.keys() != Keys::Clock {
        let expected = "clock with --url, since a study samples keys at each step's beginning";
        return Err(bad("keys", expected, "free"));
    }
    let wanted = StudyConfig { slug: args.study.clone(), ..StudyConfig::default() };
    wanted.check().map_err(|e| bad("study", &e.expected, &e.found))?;
    let server = Client::at(url)
        .ok_or_else(|| bad("url", "an address such as http://127.0.0.1:8080", url))?
        .map_err(CommandError::failure)?;
    let study = study(&server, &args.study).await?;
    let tasks = args.tasks.unwrap_or(u64::MAX);
    let driven = |phase: &PhaseConfig| match phase.phase {
        Phase::Task => tasks.min(phase.scenes as u64),
        _ => phase.scenes as u64,
    };
    let each: u64 = study.phases.iter().map(driven).sum();
    let bar = bar(args.participants * each);
    let (mut trials, mut already_stored, mut flags) = (0, 0, FlagCounts::default());
    for number in 0..args.participants {
        let volunteer = Volunteer {
            tasks,
            ..Volunteer::new(&server, &study, SyntheticParticipant::new(args.seed, number))
        };
        let name = format!("synthetic-{}-{number}", args.seed);
        let see = |seen: Seen<'_>| {
            match seen {
                Seen::Stored => already_stored += 1,
                Seen::Drives { scene, drive } => flags.count(&study.parameters, scene, drive),
            }
            trials += 1;
            bar.inc(1);
        };
        volunteer.take_part(name, see).await?;
    }
    bar.finish_and_clear();
    print_json(&json!({
        "synthetic": true,
        "participants": args.participants,
        "trials": trials,
        "already_stored": already_stored,
        "flags": flags,
        "url": url,
        "study": args.study,
    }))
}

/// Fetches the study, and checks that the server has the same version of the interface.
async fn study(server: &Client, slug: &str) -> Result<StudyInfo, CommandError> {
    let origin = server.origin();
    let study = server.study(slug).await.map_err(|error| match error.code() {
        Some("not_found") => CommandError::Input(format!(
            "--study {slug}: no such study at {origin}; name the study of its page, /s/NAME"
        )),
        _ => error.into(),
    })?;
    if study.schema_version != SCHEMA_VERSION {
        let theirs = study.schema_version;
        return Err(CommandError::Failure(format!(
            "{origin}: expected version {SCHEMA_VERSION} of the interface, found {theirs}"
        )));
    }
    Ok(study)
}
