//! The predictor.json file format.

use super::{KindName, ModelFile, Predictor};
use crate::document::from_value;
use crate::features::FeatureSet;
use crate::invalid::Invalid;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// The content of a `predictor.json`; docs/predictor.md describes it for users. A logistic model
/// that was trained with other software can be written in this format and then used everywhere.
///
/// # Example
/// ```
/// use sidestep::features::FeatureSet;
/// use sidestep::predict::{Predictor, PredictorFile};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], vec![0.2, 0.6, 0.2])?;
/// let text = serde_json::to_string(&PredictorFile::from(&model))?; // the content of a predictor.json
/// let file: PredictorFile = serde_json::from_str(&text)?;
/// assert_eq!(Predictor::try_from(file)?, model);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PredictorFile {
    /// The meaning of the classes, if the file states it: 1 for the turn direction, 2 for whether
    /// the human avoids.
    pub experiment: Option<u8>,
    /// Names of the features, in column order.
    pub features: Vec<String>,
    /// The classes: −1 right, 0 straight, 1 left.
    pub classes: Vec<i8>,
    /// The turn rate of each class (rad/s), ascending. If it is `None`, the turn rate of a class is
    /// the class times the vehicle's turn rate.
    pub actions: Option<Vec<f64>>,
    /// The fields of the model, which depend on its kind.
    pub model: ModelFile,
}

/// The version of the file format.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
enum Format {
    #[serde(rename = "sidestep-predictor/1")]
    V1,
}

/// The fields common to all kinds, which come first in the file.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(expecting = "an object, {…}, as in a predictor.json")]
struct Head {
    /// The version of the file format.
    format: Format,
    /// The kind of the model.
    kind: KindName,
    /// The meaning of the classes: 1 for the turn direction, 2 for whether the human avoids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    experiment: Option<u8>,
    /// Names of the features, in column order.
    features: Vec<String>,
    /// The classes: −1 right, 0 straight, 1 left.
    classes: Vec<i8>,
    /// The turn rate of each class (rad/s), ascending.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    actions: Option<Vec<f64>>,
}

impl<'de> Deserialize<'de> for PredictorFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let document = Value::deserialize(deserializer)?;
        let read = |document: &Value| {
            let Head { format: Format::V1, kind, experiment, features, classes, actions } =
                from_value(document)?;
            let model = ModelFile::read(kind, document)?;
            Ok(Self { experiment, features, classes, actions, model })
        };
        read(&document).map_err(|invalid: Invalid| D::Error::custom(invalid))
    }
}

impl Serialize for PredictorFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Document<'a> {
            #[serde(flatten)]
            head: Head,
            #[serde(flatten)]
            model: &'a ModelFile,
        }
        let head = Head {
            format: Format::V1,
            kind: self.model.kind(),
            experiment: self.experiment,
            features: self.features.clone(),
            classes: self.classes.clone(),
            actions: self.actions.clone(),
        };
        Document { head, model: &self.model }.serialize(serializer)
    }
}

#[cfg(feature = "openapi")]
impl schemars::JsonSchema for PredictorFile {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "PredictorFile".into()
    }

    /// The fields common to all kinds; docs/predictor.md describes the fields of each kind.
    fn json_schema(schemas: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let mut schema = Head::json_schema(schemas);
        let text = "A predictor.json; docs/predictor.md describes the further fields of each kind.";
        schema.insert("description".to_owned(), text.into());
        schema.insert("additionalProperties".to_owned(), true.into());
        schema
    }
}

impl From<&Predictor> for PredictorFile {
    fn from(predictor: &Predictor) -> Self {
        Self {
            experiment: None,
            features: predictor.features.clone().into(),
            classes: predictor.classes.clone(),
            actions: predictor.actions.clone(),
            model: predictor.model.to_file(),
        }
    }
}

impl PredictorFile {
    /// Returns the predictor, if its classes are turn directions.
    ///
    /// # Errors
    /// [`Invalid`] if the file states that its classes are not turns, or if it is invalid.
    pub fn of_turns(self) -> Result<Predictor, Invalid> {
        match self.experiment {
            None | Some(1) => self.try_into(),
            Some(2) => {
                let expected = "1, a model of the turn direction";
                Err(Invalid::new("experiment", expected, "2, a model of avoidance"))
            }
            Some(other) => Err(Invalid::new("experiment", "1 or 2, or nothing", other)),
        }
    }
}

impl TryFrom<PredictorFile> for Predictor {
    type Error = Invalid;

    fn try_from(file: PredictorFile) -> Result<Self, Invalid> {
        let PredictorFile { features, classes, actions, model, .. } = file;
        let features = match features.is_empty() && !model.needs_features() {
            true => FeatureSet::none(),
            false => FeatureSet::of(&features)?,
        };
        if classes.is_empty() || !classes.is_sorted_by(|a, b| a < b) {
            let expected = "at least one class, in rising order";
            return Err(Invalid::new("classes", expected, format!("{classes:?}")));
        }
        let model = model.model(features.len(), classes.len())?;
        let predictor = Self::new(features, classes, model);
        match actions {
            Some(actions) => predictor.with_actions(actions),
            None => Ok(predictor),
        }
    }
}
