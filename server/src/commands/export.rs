//! `sidestep export`.

use super::{CommandError, print_json, study_named, unwritable};
use crate::formats::atomic_folder::Draft;
use crate::formats::exports;
use crate::formats::participants_csv::{dictionary, participants_csv};
use crate::store::{Missing, Store};
use futures_util::StreamExt;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use tokio_util::sync::CancellationToken;

/// Write a study's trials and participants to files.
#[derive(Clone, Debug, clap::Args)]
pub struct ExportArgs {
    /// Database: sqlite: followed by a file.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
    /// Name of the study in addresses.
    #[arg(long, value_name = "SLUG", default_value = "default")]
    pub study: String,
    /// Format: csv.
    #[arg(long, value_name = "FORMAT", default_value = "csv")]
    pub format: String,
    /// Folder for trials.csv (a row for each step), participants.csv and dictionary.json (the
    /// meaning of every column); it is created if it does not exist.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Writes the files: whole, or not at all.
///
/// # Errors
/// [`CommandError`] for an unknown format or study (input), or what the database
/// or the disk refuse (failure).
pub async fn run(args: ExportArgs) -> Result<(), CommandError> {
    exports::check_format(&args.format)
        .map_err(|invalid| CommandError::Input(format!("--{invalid}")))?;
    let store = Store::open(&args.database, Missing::Refuse).await?;
    let study = study_named(&store, &args.study, &args.database).await?;
    let people = store.roster(study.id).await?;
    let table = participants_csv(&study.config, &people).map_err(CommandError::failure)?;
    let dictionary = serde_json::to_vec_pretty(&dictionary(&study.config, &people))
        .map_err(CommandError::failure)?;
    let draft = Draft::begin(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let path = args.out.join("trials.csv");
    let failed = |error: std::io::Error| unwritable(&path, &error);
    let mut file = File::create(draft.path().join("trials.csv")).map_err(failed)?;
    let mut pieces = std::pin::pin!(exports::stream(store.clone(), study));
    let (mut bytes, mut filled) = (0, 0);
    while let Some(piece) = pieces.next().await {
        let piece = piece?;
        bytes += piece.len();
        filled += usize::from(!piece.is_empty());
        file.write_all(&piece).map_err(failed)?;
    }
    for (name, bytes) in [("participants.csv", table), ("dictionary.json", dictionary)] {
        std::fs::write(draft.path().join(name), bytes).map_err(failed)?;
    }
    draft.keep(&[], &CancellationToken::new()).map_err(failed)?;
    store.close().await;
    // The first piece is the header.
    if filled == 1 {
        eprintln!("{}: study {} has no trials yet", path.display(), args.study);
    }
    print_json(&serde_json::json!({ "file": path, "bytes": bytes }))
}
