//! The models of analyses: their metadata, and the trials that trained and tested them.

use super::analyses::Job;
use super::lanes::Lock;
use super::sql::{Connection, OptionalExtension, Row, ToSql, params};
use super::{Store, StoreError};
use sidestep::api::{PredictorChoices, PredictorPage, PredictorSource, PredictorSummary, TrialUse};

/// The metadata of a model of an analysis. The file of the model must be stored already.
#[derive(Clone, Debug, PartialEq)]
pub struct NewPredictor {
    /// The name of its file.
    pub file: String,
    /// The number of the participant whose tasks trained it.
    pub participant: i64,
    /// Its position in the tables of the analysis.
    pub place: usize,
    /// The kind of model.
    pub model: &'static str,
    /// The experiment, 1 or 2.
    pub experiment: u8,
    /// The name of the feature set.
    pub features: String,
    /// The names of the features in the feature set.
    pub columns: Vec<String>,
    /// Accuracy in cross-validation, from 0 to 1.
    pub cv_accuracy: f64,
    /// Accuracy on the test steps, from 0 to 1.
    pub test_accuracy: f64,
}

/// A task that an analysis used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsedTask {
    /// The trial.
    pub trial_id: String,
    /// Whether the task trained the models of the participant who drove it. Otherwise the task tested them.
    pub trains: bool,
}

/// Filter and page of a list of models.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Only models of the participant with this number.
    pub participant: Option<i64>,
    /// Only this kind of model.
    pub model: Option<&'static str>,
    /// Only this experiment.
    pub experiment: Option<u8>,
    /// Only this feature set.
    pub features: Option<String>,
    /// Number of models before the page.
    pub offset: i64,
    /// Maximum number of models on a page.
    pub limit: i64,
}

/// A model of a finished analysis, and how the analysis used a given trial.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenPredictor {
    /// The model and its origin.
    pub source: PredictorSource,
    /// The ids of the tasks that trained it.
    pub trained_on: Vec<String>,
}

impl Store {
    /// Records a job's models whose files are stored, if the job is still wanted. Returns whether the
    /// job is still wanted.
    pub async fn put_predictors(
        &self,
        job: &Job,
        predictors: Vec<NewPredictor>,
    ) -> Result<bool, StoreError> {
        let (sequence, attempt) = (job.sequence, job.attempt);
        self.write_behind([Lock::Analyses], move |db| {
            let mut insert = db.prepare_cached(
                "INSERT INTO analysis_predictor (analysis, name, participant_number, place, model, \
                     experiment, feature_set, features, cv_accuracy, test_accuracy) \
                 SELECT sequence, $3, $4, $5, $6, $7, $8, $9, $10, $11 FROM analysis \
                 WHERE sequence = $1 AND state = 'running' AND attempts = $2",
            )?;
            for new in &predictors {
                let columns = serde_json::to_string(&new.columns).map_err(StoreError::corrupt)?;
                let inserted = insert.execute(params![
                    sequence,
                    attempt,
                    new.file,
                    new.participant,
                    new.place as i64,
                    new.model,
                    new.experiment,
                    new.features,
                    columns,
                    new.cv_accuracy,
                    new.test_accuracy
                ])?;
                if inserted == 0 {
                    return Ok(false);
                }
            }
            Ok(true)
        })
        .await
    }

    /// Records the tasks that a job used, if the job is still wanted. Returns whether the job is still
    /// wanted.
    pub async fn put_used_tasks(
        &self,
        job: &Job,
        tasks: Vec<UsedTask>,
    ) -> Result<bool, StoreError> {
        let (sequence, attempt) = (job.sequence, job.attempt);
        self.write_behind([Lock::Analyses], move |db| {
            // A participant whose first trials arrived after the analysis began also belongs to the analysis.
            let mut join = db.prepare_cached(
                "INSERT INTO analysis_participant (analysis, participant_id) \
                 SELECT sequence, participant_id FROM analysis, scene WHERE trial_id = $3 \
                     AND sequence = $1 AND state = 'running' AND attempts = $2 \
                 ON CONFLICT DO NOTHING",
            )?;
            let mut insert = db.prepare_cached(
                "INSERT INTO analysis_trial (analysis, participant_id, trial_id, trains) \
                 SELECT sequence, participant_id, trial_id, $4 FROM analysis, scene \
                 WHERE trial_id = $3 AND sequence = $1 AND state = 'running' AND attempts = $2",
            )?;
            for UsedTask { trial_id, trains } in &tasks {
                join.execute(params![sequence, attempt, trial_id])?;
                if insert.execute(params![sequence, attempt, trial_id, trains])? == 0 {
                    return Ok(false);
                }
            }
            Ok(true)
        })
        .await
    }

    /// A page of the models of an analysis. Returns `None` if there is no such analysis.
    pub async fn predictors(
        &self,
        id: &str,
        selection: Selection,
    ) -> Result<Option<PredictorPage>, StoreError> {
        let id = id.to_owned();
        self.read_long(move |db| page(db, &id, &selection)).await
    }

    /// The model with this file in a finished analysis, and its relation to a trial.
    pub async fn predictor(
        &self,
        id: &str,
        file: &str,
        trial_id: &str,
    ) -> Result<Option<ChosenPredictor>, StoreError> {
        let (id, file, trial_id) = (id.to_owned(), file.to_owned(), trial_id.to_owned());
        self.read_long(move |db| chosen(db, &id, &file, &trial_id)).await
    }
}

/// The SQL condition for the models of the analysis with the sequence number `$1`, if it is done.
const OF_ANALYSIS: &str = "analysis = $1 \
     AND (SELECT state FROM analysis WHERE sequence = $1) = 'done'";

/// The SQL condition for models, or kinds of models, that pass a filter. If the filter names a
/// participant, an index finds their models.
fn filter(asked: &Selection) -> String {
    let participant = match asked.participant {
        Some(_) => "participant_number = $2",
        None => "$2 IS NULL",
    };
    format!(
        "{OF_ANALYSIS} AND {participant} AND ($3 IS NULL OR model = $3) \
         AND ($4 IS NULL OR experiment = $4) \
         AND ($5 IS NULL OR feature_set = $5)"
    )
}

/// The columns that [`summary_of`] reads.
const COLUMNS: &str = "name, participant_number, model, experiment, feature_set, features, \
     cv_accuracy, test_accuracy, (SELECT trial.trial_id FROM participant \
         JOIN scene ON scene.participant_id = participant.id \
         JOIN trial ON trial.trial_id = scene.trial_id \
         WHERE participant.study_id = (SELECT study_id FROM analysis \
                                       WHERE sequence = analysis_predictor.analysis) \
             AND number = participant_number AND phase = 'task' \
         ORDER BY ordinal DESC LIMIT 1) AS newest_task";

fn page(db: &Connection, id: &str, asked: &Selection) -> Result<Option<PredictorPage>, StoreError> {
    let query = "SELECT sequence FROM analysis WHERE id = $1";
    let mut analysis = db.prepare_cached(query)?;
    let analysis = analysis.query_row([id], |row| row.get::<_, i64>(0)).optional()?;
    let Some(analysis) = analysis else { return Ok(None) };
    let mut bound: Vec<&dyn ToSql> =
        vec![&analysis, &asked.participant, &asked.model, &asked.experiment, &asked.features];
    let filter = filter(asked);
    // A participant has about a hundred models, but an analysis can have a million models. The
    // numbers of models of an analysis are therefore counted in advance, in the table
    // `predictor_kind`.
    let query = match asked.participant {
        Some(_) => format!("SELECT count(*) FROM analysis_predictor WHERE {filter}"),
        None => format!(
            "SELECT CAST(coalesce(sum(models), 0) AS BIGINT) FROM predictor_kind WHERE {filter}"
        ),
    };
    let total: i64 = db.prepare_cached(&query)?.query_row(&bound[..], |row| row.get(0))?;
    bound.extend([&asked.limit as &dyn ToSql, &asked.offset]);
    // The subquery finds the rows of the page by the index alone.
    let mut statement = db.prepare_cached(&format!(
        "SELECT {COLUMNS} FROM analysis_predictor WHERE id IN (SELECT id FROM analysis_predictor \
             WHERE {filter} ORDER BY participant_number, place \
             LIMIT $6 OFFSET $7) \
         ORDER BY participant_number, place"
    ))?;
    let predictors = statement.query_and_then(&bound[..], summary_of)?;
    let predictors = predictors.collect::<Result<_, StoreError>>()?;
    let choices = choices(db, analysis)?;
    Ok(Some(PredictorPage { predictors, total: total.unsigned_abs(), choices }))
}

fn choices(db: &Connection, analysis: i64) -> Result<PredictorChoices, StoreError> {
    let mut participants = db.prepare_cached(&format!(
        "SELECT participant_number FROM predictor_participant WHERE {OF_ANALYSIS} \
         ORDER BY participant_number"
    ))?;
    let participants = participants.query_map([analysis], |row| row.get(0))?;
    let mut choices = PredictorChoices {
        participants: participants.collect::<Result<_, _>>()?,
        ..PredictorChoices::default()
    };
    // An analysis trains the same models for each participant.
    let mut kinds = db.prepare_cached(
        "SELECT model, experiment, feature_set FROM analysis_predictor \
         WHERE analysis = $1 AND participant_number = $2 ORDER BY place",
    )?;
    let first = choices.participants.first();
    let kind = |row: &Row| Ok((row.get(0)?, row.get(1)?, row.get(2)?));
    for found in kinds.query_map(params![analysis, first], kind)? {
        let (model, experiment, features) = found?;
        add(&mut choices.models, model);
        add(&mut choices.experiments, experiment);
        add(&mut choices.features, features);
    }
    Ok(choices)
}

/// Adds a value unless it is in the list.
fn add<T: PartialEq>(list: &mut Vec<T>, value: T) {
    if !list.contains(&value) {
        list.push(value);
    }
}

fn summary_of(row: &Row) -> Result<PredictorSummary, StoreError> {
    let columns: String = row.get("features")?;
    Ok(PredictorSummary {
        file: row.get("name")?,
        participant: row.get("participant_number")?,
        model: row.get("model")?,
        experiment: row.get("experiment")?,
        features: row.get("feature_set")?,
        columns: serde_json::from_str(&columns).map_err(StoreError::corrupt)?,
        cv_accuracy: row.get("cv_accuracy")?,
        test_accuracy: row.get("test_accuracy")?,
        newest_task: row.get("newest_task")?,
    })
}

fn chosen(
    db: &Connection,
    id: &str,
    file: &str,
    trial_id: &str,
) -> Result<Option<ChosenPredictor>, StoreError> {
    // Participants are identified by their numbers within a study.
    let mut statement = db.prepare_cached(&format!(
        "SELECT {COLUMNS}, study.slug AS study, \
             study.id = driver.study_id AS same_study, \
             study.id = driver.study_id AND driver.number = participant_number AS same_person, \
             (SELECT trains FROM analysis_trial WHERE analysis = sequence \
                 AND participant_id = driver.id AND trial_id = $3) AS trains, \
             (SELECT {} FROM analysis_trial JOIN participant \
                     ON participant.id = analysis_trial.participant_id \
                 WHERE analysis = sequence AND number = participant_number AND trains) \
                 AS trained_on \
         FROM analysis_predictor JOIN analysis ON analysis.sequence = analysis_predictor.analysis \
         JOIN study ON study.id = analysis.study_id \
         JOIN participant AS driver ON driver.id = \
             (SELECT participant_id FROM scene WHERE trial_id = $3) \
         WHERE analysis.id = $1 AND state = 'done' AND name = $2",
        db.choose(
            "json_group_array(analysis_trial.trial_id)",
            "coalesce(CAST(json_agg(analysis_trial.trial_id) AS TEXT), '[]')"
        )
    ))?;
    let chosen = |row: &Row| {
        let trial = match (row.get("same_study")?, row.get("same_person")?, row.get("trains")?) {
            (false, ..) => TrialUse::OtherStudy,
            (true, false, _) => TrialUse::OtherParticipant,
            (true, true, Some(true)) => TrialUse::Trained,
            (true, true, Some(false)) => TrialUse::HeldOut,
            (true, true, None) => TrialUse::Unused,
        };
        let (analysis, study) = (id.to_owned(), row.get("study")?);
        let source = PredictorSource { analysis, study, summary: summary_of(row)?, trial };
        let trained_on = serde_json::from_str(&row.get::<_, String>("trained_on")?);
        Ok(ChosenPredictor { source, trained_on: trained_on.map_err(StoreError::corrupt)? })
    };
    statement.query_and_then([id, file, trial_id], chosen)?.next().transpose()
}
