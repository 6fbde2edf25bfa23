//! `sidestep languages`.

use super::{CommandError, print_json, unwritable};
use crate::formats::atomic_folder::Draft;
use crate::languages::BUILT_IN;
use std::path::PathBuf;
use tokio_util::sync::CancellationToken;

/// Write the language files of the participant's page, to edit or to translate.
///
/// Serve the edited files with `sidestep serve --languages DIR`. A file may contain only the
/// sentences that it changes; a new language, named after its tag (fr.toml, pt-BR.toml), must be
/// complete.
#[derive(Clone, Debug, clap::Args)]
pub struct LanguagesArgs {
    /// Folder for the files; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Writes a file for each language, all files or none.
///
/// # Errors
/// [`CommandError`] if one of the files already exists (input), or the folder cannot be written (failure).
pub fn run(args: &LanguagesArgs) -> Result<(), CommandError> {
    let failed = |error: std::io::Error| unwritable(&args.out, &error);
    let mut files = Vec::new();
    // Do not overwrite an existing file, because a user might have edited it.
    if let Some((tag, _)) =
        BUILT_IN.iter().find(|(tag, _)| args.out.join(format!("{tag}.toml")).exists())
    {
        let out = args.out.display();
        let message =
            format!("--out {out}: expected a folder without language files, found {tag}.toml");
        return Err(CommandError::Input(message));
    }
    let draft = Draft::begin(&args.out).map_err(failed)?;
    for (tag, text) in BUILT_IN {
        let name = format!("{tag}.toml");
        std::fs::write(draft.path().join(&name), text).map_err(failed)?;
        files.push(name);
    }
    draft.keep(&[], &CancellationToken::new()).map_err(failed)?;
    print_json(&serde_json::json!({ "out": args.out, "files": files }))
}
