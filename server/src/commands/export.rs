//! `sidestep export`.

use super::solving::Interrupt;
use super::{CommandError, Words, failed, one_of, print_json, study_named};
use crate::formats::exports::{
    self, Damage, Dataset, ExportError, FileEntry, Filter, Format, Quality,
};
use crate::store::{Purpose, Store};
use sidestep::trial::Phase;
use std::path::PathBuf;

/// Write a study's data to files: steps, trials, key events and participants as tables.
///
/// Besides the tables, the folder has configurations.json, dictionary.json (the meaning of every
/// column) and manifest.json (rows and SHA-256 of every file). The manifest is written last, so a
/// folder without it is incomplete.
///
/// Every trial is replayed, as by 'sidestep check'. A damaged trial is named, and marked in the tables by
/// the column damaged. A trial that cannot be read or found is left out. In both cases the exit code is 1.
/// Nothing is written if the study or the list of its participants cannot be read.
#[derive(Clone, Debug, clap::Args)]
pub struct ExportArgs {
    /// Database: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
    /// Name of the study in URLs.
    #[arg(long, value_name = "SLUG", default_value = "default")]
    pub study: String,
    /// Format of the tables.
    #[arg(long, value_name = "FORMAT", default_value = "csv", value_parser = one_of(FORMATS))]
    pub format: Format,
    /// Folder for the files; created if it does not exist.
    ///
    /// Replaces an earlier export of the same study there.
    #[arg(long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    /// Only trials of this phase, with their steps and key events [default: all phases].
    #[arg(long, help_heading = "Which data", value_name = "PHASE", value_parser = one_of(PHASES))]
    pub phase: Option<Phase>,
    /// Trials to export, by their flags.
    #[arg(long, help_heading = "Which data", value_name = "QUALITY", default_value = "all")]
    #[arg(value_parser = one_of(QUALITIES))]
    pub quality: Quality,
    /// Only participants enrolled under the configuration whose SHA-256 begins with HASH [default: all].
    #[arg(long, help_heading = "Which data", value_name = "HASH")]
    pub configuration: Option<String>,
    /// Export pilots instead of participants; pilots are numbered separately.
    #[arg(long, help_heading = "Which data")]
    pub pilots: bool,
    /// Exit with code 0 even if trials are damaged; they are still named and marked.
    #[arg(long)]
    pub allow_damaged: bool,
}

const FORMATS: Words<Format> = &[
    ("csv", Format::Csv, "Comma-separated text with a header"),
    ("jsonl", Format::Jsonl, "A JSON object in each line"),
    ("parquet", Format::Parquet, "Apache Parquet"),
    ("psych-ds", Format::PsychDs, "A folder of the Psych-DS standard, with CSV files"),
    ("sqlite", Format::Sqlite, "One SQLite database"),
];

const PHASES: Words<Phase> = &[
    ("familiarisation", Phase::Familiarisation, "Getting used to the keys and the vehicle"),
    ("practice", Phase::Practice, "Scenes like the tasks, not analysed"),
    ("task", Phase::Task, "The scenes that are analysed"),
];

const QUALITIES: Words<Quality> = &[
    ("all", Quality::All, "All trials"),
    (
        "unflagged",
        Quality::Unflagged,
        "Trials without damage and without a flag other than imported",
    ),
];

/// Writes all files or none.
///
/// # Errors
/// [`CommandError`] for an unknown study or configuration (input), or an error of the database or
/// the disk (failure).
pub async fn run(args: ExportArgs) -> Result<(), CommandError> {
    let store = Store::open(&args.database, Purpose::Read).await?;
    let study = study_named(&store, &args.study).await?;
    let configuration = match args.configuration {
        Some(digits) => Some(configuration(&digits, store.configurations(study.id).await?)?),
        None => None,
    };
    let (phase, quality, pilots) = (args.phase, args.quality, args.pilots);
    let filter = Filter { phase, quality, configuration, pilots };
    let interrupt = Interrupt::listen();
    let dataset = Dataset::read(&store, &study, &filter).await?;
    let (format, stop) = (args.format, &interrupt.token);
    let written = exports::write(&store, dataset, format, &args.out, stop).await;
    let manifest = written.map_err(|error| match error {
        ExportError::Occupied(_) => {
            CommandError::Input(format!("--out {}: {error}", args.out.display()))
        }
        ExportError::Disk(error) => interrupt.unwritten(&args.out, &error),
        error => error.into(),
    })?;
    store.close().await;
    let FileEntry { name, rows, bytes, .. } = &manifest.files[0];
    let path = args.out.join(name);
    if *rows == 0 && filter == Filter::default() {
        eprintln!("{}: study {} has no trials yet", path.display(), args.study);
    }
    let files = &manifest.files;
    let Damage { count, first, database } = &manifest.damage;
    first.iter().for_each(|damaged| eprintln!("sidestep: {damaged}"));
    database.iter().for_each(|damaged| eprintln!("sidestep: {damaged}"));
    let printed = print_json(&serde_json::json!({
        "file": path, "bytes": bytes, "files": files, "damaged_trials": count, "database_damage": database.len(),
    }));
    if (*count == 0 && database.is_empty()) || args.allow_damaged {
        return printed;
    }
    if *count == 0 {
        let why = format!(
            "{}: the database is damaged; rows may be missing, or be another participant's: restore a backup, or salvage \
             the database and export that, or add --allow-damaged if you can do without",
            args.out.display()
        );
        return failed(printed, why);
    }
    let trials = if *count == 1 { "1 trial is".to_owned() } else { format!("{count} trials are") };
    let why = format!(
        "{}: {trials} damaged, and marked in the tables by the column damaged unless left out; restore a backup, or \
         add --allow-damaged if you can do without",
        args.out.display()
    );
    failed(printed, why)
}

/// The one configuration whose hash begins with these digits.
fn configuration(digits: &str, known: Vec<(String, String)>) -> Result<String, CommandError> {
    let hashes: Vec<String> = known.into_iter().map(|(hash, _)| hash).collect();
    let wanted = digits.to_lowercase();
    let mut fitting = hashes.iter().filter(|hash| hash.starts_with(&wanted));
    match (fitting.next(), fitting.next()) {
        (Some(hash), None) => Ok(hash.clone()),
        _ => Err(CommandError::Input(format!(
            "--configuration: expected the first digits of one of {}, found {digits:?}",
            hashes.join(", ")
        ))),
    }
}
