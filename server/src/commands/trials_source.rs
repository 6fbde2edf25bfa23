//! The source of trials for commands that learn from trials. It is a file or a study.

use super::trials_file::{self, Faults, SceneArgs};
use super::{CommandError, study_named, table_file};
use crate::store::{Purpose, Store};
use crate::study_recording;
use sidestep::plausibility;
use sidestep::recording::Recording;
use std::path::PathBuf;

/// The tasks to learn from.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TrialsArgs {
    #[command(flatten)]
    source: Source,
    /// Name of the study in URLs (with --database).
    #[arg(long, value_name = "SLUG", default_value = "default", conflicts_with = "trials")]
    study: String,
    /// The vehicles; the human is the evader. With --database, the vehicles of the study are used.
    #[command(flatten)]
    scene: SceneArgs,
}

#[derive(Clone, Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// CSV file of trials, such as steps.csv of `sidestep export`; - reads stdin. Only tasks count.
    ///
    /// It needs at least the columns participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega in any
    /// order. The delimiter may be a semicolon or a tab, with decimal commas.
    #[arg(long, value_name = "FILE.csv")]
    trials: Option<PathBuf>,
    /// Database: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", conflicts_with_all = ["GameArgs", "SceneArgs"])]
    database: Option<String>,
}

impl TrialsArgs {
    /// Returns the tasks. Checks that the vehicles can have driven the states, and that the human's
    /// turns match the inputs. Names excluded participants on stderr.
    ///
    /// # Errors
    /// [`CommandError::Input`] for an unusable file, with its line, or an unknown study.
    pub(super) async fn recording(&self, faults: Faults) -> Result<Recording, CommandError> {
        let recording = match &self.source.trials {
            Some(path) => trials_file::recording(path, &self.scene.scene()?, faults)?,
            None => self.stored().await?,
        };
        let trials = recording.participants.iter().flat_map(|person| &person.trials);
        plausibility::check_inputs(&recording.scene, trials)
            .map_err(|invalid| CommandError::Input(format!("{}: {invalid}", self.name())))?;
        for exclusion in &recording.exclusions {
            eprintln!("sidestep: {}: excluded: {exclusion}", self.name());
        }
        Ok(recording)
    }

    /// The name of the file or study in messages.
    pub(super) fn name(&self) -> String {
        match &self.source.trials {
            Some(path) => table_file::name(path),
            None => format!("study {}", self.study),
        }
    }

    async fn stored(&self) -> Result<Recording, CommandError> {
        let url = self.source.database.clone().unwrap_or_default();
        let store = Store::open(&url, Purpose::Read).await?;
        let study = study_named(&store, &self.study).await?;
        let recording = study_recording::of_study(&store, &study).await?;
        store.close().await;
        if recording.participants.is_empty() {
            let expected = "expected at least one participant with tasks, found none";
            return Err(CommandError::Input(match recording.exclusions.first() {
                Some(first) => format!("{}: {first}; {expected} else", self.name()),
                None => format!("{}: {expected}", self.name()),
            }));
        }
        Ok(recording)
    }
}
