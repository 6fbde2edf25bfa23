//! Predictors: the models that analyses trained, and the model for the replay of a trial.

use crate::http::analyses;
use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::Reader;
use crate::http::laboratory::stored;
use crate::http::params::{Params, PathText};
use crate::jobs::safety;
use crate::store::Store;
use crate::store::predictors::{ChosenPredictor, Selection};
use crate::store::trials::StoredTrial;
use crate::study_recording;
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use schemars::JsonSchema;
use serde::Deserialize;
use sidestep::api::{LearnedSets, PredictorPage, TrainedPredictor};
use sidestep::comparison::models::ModelName;
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::learn::participant::{self, Driven, Trained};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::recording::RecordedTrial;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::baselines::EmpiricalFamily;
use sidestep::shfrs::probability::probabilities;
use sidestep::shfrs::window::Trajectory;
use sidestep::trial_view::source;
use std::sync::Arc;

/// The query of a list of models.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListParams {
    /// Only models of the participant with this number.
    #[schemars(range(min = 1))]
    participant: Option<i64>,
    /// Only this kind of model, such as `svm` or `lr`.
    model: Option<ModelName>,
    /// Only this experiment: 1 or 2.
    #[schemars(range(min = 1, max = 2))]
    experiment: Option<u8>,
    /// Only models with this feature set.
    features: Option<String>,
    /// Maximum number of entries on the page, from 1 to 500. The default is 50.
    #[schemars(range(min = 1, max = 500))]
    limit: Option<i64>,
    /// Number of entries before the page, from 0.
    #[schemars(range(min = 0))]
    offset: Option<i64>,
}

impl ListParams {
    /// The selection of models.
    ///
    /// # Errors
    /// [`Invalid`] for a parameter that is out of range.
    fn selection(self) -> Result<Selection, Invalid> {
        let (limit, offset) = (self.limit.unwrap_or(50), self.offset.unwrap_or(0));
        if !(1..=500).contains(&limit) {
            return Err(Invalid::new("limit", "a whole number from 1 to 500", limit));
        }
        if offset < 0 {
            return Err(Invalid::new("offset", "a whole number ≥ 0", offset));
        }
        if let Some(number) = self.participant.filter(|number| *number < 1) {
            return Err(Invalid::new("participant", "a whole number ≥ 1", number));
        }
        if let Some(number) = self.experiment.filter(|number| !(1..=2).contains(number)) {
            return Err(Invalid::new("experiment", "1 or 2", number));
        }
        Ok(Selection {
            participant: self.participant,
            model: self.model.map(ModelName::word),
            experiment: self.experiment,
            features: self.features,
            offset,
            limit,
        })
    }
}

/// `GET /api/v1/admin/analyses/{id}/predictors`: a page of the models of an analysis, ordered by
/// participant.
pub async fn list(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
    Params(params): Params<ListParams>,
) -> Result<Json<PredictorPage>, ApiError> {
    let page = app.store.predictors(&id, params.selection()?).await?;
    page.map(Json).ok_or_else(|| ApiError::not_found("analysis"))
}

/// Selects a model. By default, the model is trained on the participant's earlier trials.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PredictorParams {
    /// The analysis that trained the model; requires `file`.
    analysis: Option<String>,
    /// The name of the model's file in the analysis; requires `analysis`.
    file: Option<String>,
    /// The feature set of the model that is trained on the participant's earlier trials: `hrd`
    /// (default) or `hrd_body_history`. Excludes `analysis`.
    features: Option<String>,
}

/// `GET /api/v1/admin/trials/{trial_id}/predictor`: a model trained on this participant's earlier trials.
/// `?features=SET` selects its feature set. `?analysis=ID&file=NAME` selects a model of an analysis
/// instead.
pub async fn predictor(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(trial_id): PathText,
    Params(params): Params<PredictorParams>,
) -> Result<Json<TrainedPredictor>, ApiError> {
    let features = source::features_of(params.features.as_deref().unwrap_or("hrd"))?;
    let named = match (params.analysis, params.file) {
        (None, None) => None,
        (Some(_), Some(_)) if params.features.is_some() => {
            let expected = "nothing beside the model of an analysis";
            return Err(
                Invalid::new("features", expected, params.features.unwrap_or_default()).into()
            );
        }
        (Some(analysis), Some(file)) => Some((analysis, file)),
        (Some(_), None) => {
            let expected = "the name of a model's file beside the analysis";
            return Err(Invalid::new("file", expected, "nothing").into());
        }
        (None, Some(_)) => {
            let expected = "the id of an analysis beside the file";
            return Err(Invalid::new("analysis", expected, "nothing").into());
        }
    };
    let trial = stored(&app.store, &trial_id).await?;
    Ok(Json(match named {
        None => of_earlier_trials(&app, &trial, features).await?,
        Some((analysis, file)) => of_analysis(&app.store, &trial_id, &analysis, &file).await?,
    }))
}

async fn of_earlier_trials(
    app: &App,
    trial: &StoredTrial,
    features: FeatureSet,
) -> Result<TrainedPredictor, ApiError> {
    let functions = safety::stored(&app.store, &trial.config_hash).await?;
    let earlier = study_recording::earlier(&app.store, trial).await?;
    let trials = earlier.len();
    let trained_on = earlier.iter().filter_map(|trial| trial.trial_id.clone()).collect();
    let train = move || {
        let safety = functions.map(|functions| functions.decode()).transpose()?;
        let earlier: Vec<Driven> =
            earlier.into_iter().map(|trial| (trial.inputs, trial.states)).collect();
        participant::train(&features, safety.as_ref(), &earlier)
    };
    let Trained { predictor, fallback } =
        tokio::task::spawn_blocking(train).await.context("training")?.context("training")?;
    let predictor = (&predictor).into();
    Ok(TrainedPredictor { predictor, trials, fallback, trained_on, source: None })
}

/// Selects the family of sets.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SetsParams {
    /// The family to learn.
    family: EmpiricalFamily,
}

/// `GET /api/v1/admin/trials/{trial_id}/sets?family=FAMILY`: sets learned from this participant's
/// earlier trials.
pub async fn sets(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(trial_id): PathText,
    Params(params): Params<SetsParams>,
) -> Result<Json<LearnedSets>, ApiError> {
    let trial = stored(&app.store, &trial_id).await?;
    let parameters = app.store.config(&trial.config_hash).await?.parameters;
    let driven = app.store.trials_of(&trial.head.participant_id).await?;
    let learn = move || learned(params.family, &parameters, &driven, &trial);
    Ok(Json(tokio::task::spawn_blocking(learn).await.context("learning")??))
}

/// Learns the sets from the earlier trials, and tests them on the participant's other tasks.
///
/// # Errors
/// [`Invalid`] if there are too few trials to learn from.
fn learned(
    family: EmpiricalFamily,
    parameters: &SceneParameters,
    driven: &[StoredTrial],
    trial: &StoredTrial,
) -> Result<LearnedSets, Invalid> {
    let trajectory =
        |trial: &RecordedTrial| Trajectory::driven(trial.states.clone(), &trial.inputs, parameters);
    let all = |trials: &mut dyn Iterator<Item = &RecordedTrial>| {
        trials.map(trajectory).collect::<Result<Vec<_>, _>>()
    };
    let earlier = study_recording::before(driven, trial);
    let fitted = source::fitted(family, parameters, &all(&mut earlier.iter())?)?;
    let tasks = study_recording::tasks(String::new(), driven).trials;
    let is_new = |task: &&RecordedTrial| earlier.iter().all(|it| it.trial_id != task.trial_id);
    let others = all(&mut tasks.iter().filter(is_new))?;
    let smallest = fitted.smallest_holding(&others)?;
    let sets = fitted.sets;
    let held = match smallest.iter().all(Vec::is_empty) {
        true => None,
        false => Some(probabilities(&smallest, sets.count(), CONFIDENCE)?),
    };
    Ok(LearnedSets { sets, trials: earlier.len(), held })
}

/// Confidence level of intervals, as in analyses.
const CONFIDENCE: f64 = 0.95;

/// A model that an analysis trained. The result also states how the model relates to this trial,
/// and on which trials the model was trained.
///
/// # Errors
/// [`ApiError`] if there is no such model, or a replay cannot use it.
pub async fn of_analysis(
    store: &Store,
    trial_id: &str,
    analysis: &str,
    file: &str,
) -> Result<TrainedPredictor, ApiError> {
    let ChosenPredictor { source, trained_on } =
        store.predictor(analysis, file, trial_id).await?.ok_or_else(gone)?;
    let packed = store.analysis_file(analysis, file).await?.ok_or_else(gone)?;
    let read = move || -> anyhow::Result<PredictorFile> {
        let bytes = analyses::unpacked(&packed)?;
        serde_json::from_slice(&bytes).context("a model of an analysis")
    };
    let predictor = tokio::task::spawn_blocking(read).await.context("unpacking")??;
    usable(&predictor)?;
    let trials = trained_on.len();
    Ok(TrainedPredictor { predictor, trials, fallback: None, trained_on, source: Some(source) })
}

/// Checks that Algorithm 1 can use a model.
///
/// # Errors
/// [`Invalid`] naming `file`, if the model does not predict the direction of turns, or needs
/// features that this version does not compute.
fn usable(file: &PredictorFile) -> Result<(), Invalid> {
    if file.experiment == Some(2) {
        let expected = "a model of the direction of turns (experiment 1)";
        let found =
            "a model of whether the human turns (experiment 2), which does not say to which side";
        return Err(Invalid::new("file", expected, found));
    }
    let told = |invalid: Invalid| {
        let Invalid { field, expected, found } = invalid;
        Invalid::new("file", format!("a model with {field}: {expected}"), found)
    };
    let predictor = Predictor::try_from(file.clone()).map_err(told)?;
    let turns = predictor.classes().iter().all(|class| (-1..=1).contains(class));
    if !turns && predictor.actions().is_none() {
        let expected = "a model with the classes -1 (right), 0 (straight) and 1 (left)";
        return Err(Invalid::new("file", expected, format!("{:?}", predictor.classes())));
    }
    Ok(())
}

fn gone() -> ApiError {
    let message = "there is no such model: its analysis was deleted or withdrawn, or an earlier version \
                   of Sidestep made it; choose another model, or start the analysis again";
    ApiError::new(StatusCode::NOT_FOUND, "not_found", message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn models_that_cannot_drive_a_prediction_are_explained() {
        let complaint = |changes: Value| {
            let mut document = json!({
                "format": "sidestep-predictor/1", "kind": "constant", "experiment": 1,
                "features": ["distance"], "classes": [-1, 0, 1], "probabilities": [0.2, 0.5, 0.3],
            });
            for (name, value) in changes.as_object().into_iter().flatten() {
                document[name] = value.clone();
            }
            let file: PredictorFile = serde_json::from_value(document).unwrap();
            usable(&file).err().map(|invalid| (invalid.field.clone(), invalid.to_string()))
        };
        assert_eq!(complaint(json!({})), None);
        for (changes, words) in [
            (json!({ "experiment": 2 }), "does not say to which side"),
            (json!({ "features": ["colour"] }), "features[0]"),
            (json!({ "classes": [0, 1, 2] }), "[0, 1, 2]"),
            (json!({ "probabilities": [0.5, 0.5] }), "probabilities"),
        ] {
            let (field, said) = complaint(changes).unwrap();
            assert!(field == "file" && said.contains(words), "{said}");
        }
    }
}
