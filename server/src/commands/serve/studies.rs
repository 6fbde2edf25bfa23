//! The studies that a server starts with.

use crate::commands::CommandError;
use crate::formats::study_toml::StudyFile;
use crate::jobs::safety;
use crate::store::Store;
use crate::store::studies::StoredStudy;
use crate::support::clock::now_ms;
use serde_json::{Map, Value};
use sidestep::invalid::Invalid;
use sidestep::study::StudyConfig;

/// Returns those of `names` that belong to studies for real participants, in the same order.
pub(super) async fn of_people(
    store: &Store,
    names: &[String],
) -> Result<Vec<String>, CommandError> {
    let summaries = store.summaries(None, now_ms()).await?;
    let is_synthetic =
        |name: &String| summaries.iter().any(|study| study.slug == *name && study.synthetic);
    Ok(names.iter().filter(|name| !is_synthetic(name)).cloned().collect())
}

/// Stores the study of the file, or creates the paper's study in an empty database. Stores the study's
/// value functions if they have a closed form. Returns the names of all studies. The first one is the
/// study of the file, or the newest study if there is no file.
pub(super) async fn prepare(
    store: &Store,
    file: Option<&StudyFile>,
    replace: bool,
) -> Result<Vec<String>, CommandError> {
    let mut names = store.slugs().await?;
    names.reverse();
    let config = match file {
        Some(file) => {
            let mut config = file.config().clone();
            // A study that was closed in the laboratory stays closed, unless the file gives a status.
            if !file.gives("status")
                && let Some(known) = store.study(&config.slug).await?
            {
                config.status = known.config.status;
            }
            config
        }
        None if names.is_empty() => StudyConfig::default(),
        None => return Ok(names),
    };
    let slug = config.slug.clone();
    let known = store.study(&slug).await?.filter(|known| *known.config != config);
    // An earlier version of the study came from this file, and the study was changed later. Keep
    // the later changes.
    if let Some(known) = known.as_ref().filter(|_| !replace)
        && let Some(number) = followed(store, known, &config).await?
    {
        eprintln!(
            "study {slug}: keeps the changes since version {number}, which equals this file \
             (pass --replace-study to go back to the file)"
        );
        safety::keep_exact(store, known).await?;
        names.retain(|name| *name != slug);
        names.insert(0, slug);
        return Ok(names);
    }
    let counts = store.summaries(Some(slug.clone()), now_ms()).await?;
    let participants = counts.first().map_or(0, |study| study.participants);
    if let (Some(known), Some(file)) = (&known, file)
        && participants > 0
        && !replace
    {
        let (old, changed) = (&known.config_hash[..8], changes(&known.config, &config));
        let expected = format!(
            "the configuration {old} of study {slug}, in which {participants} participants take \
             part (pass --replace-study to change it for new participants, or choose another slug)"
        );
        let different = Invalid::new("slug", expected, format!("other values of {changed}"));
        return Err(CommandError::Input(file.complaint(&different)));
    }
    if let (Some(known), Some(file)) = (&known, file) {
        let checked = known.config.check_successor(&config, participants);
        checked.map_err(|invalid| CommandError::Input(file.complaint(&invalid)))?;
    }
    let study = store.put_study(&config, now_ms()).await?;
    if let Some(known) = &known {
        let (old, new) = (&known.config_hash[..8], &study.config_hash[..8]);
        let changed = changes(&known.config, &config);
        eprintln!(
            "study {slug}: configuration {old} → {new} for new participants (changed: {changed}); \
             {participants} participants keep theirs"
        );
    }
    safety::keep_exact(store, &study).await?;
    names.retain(|name| *name != slug);
    names.insert(0, slug);
    Ok(names)
}

/// The number of the last version that came from a file, if that version equals `config` and a later
/// version exists.
async fn followed(
    store: &Store,
    study: &StoredStudy,
    config: &StudyConfig,
) -> Result<Option<u32>, CommandError> {
    let versions = store.study_versions(study.id).await?;
    let last = versions.iter().rfind(|version| version.by_file);
    // If the last version from a file is also the present version, it can differ from `config` only
    // in the status. The file gives this status, so the status applies.
    let present = versions.last().map(|version| version.number);
    let changed = last.filter(|version| Some(version.number) != present && version.says(config));
    Ok(changed.map(|version| version.number))
}

/// The fields of a study in which two configurations differ.
fn changes(old: &StudyConfig, new: &StudyConfig) -> String {
    let fields = |config| match serde_json::to_value(config) {
        Ok(Value::Object(fields)) => fields,
        _ => Map::new(),
    };
    let (old, new) = (fields(old), fields(new));
    let changed = new.iter().filter(|(name, value)| old.get(*name) != Some(value));
    changed.map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
}
