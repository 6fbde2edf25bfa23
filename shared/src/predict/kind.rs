//! The trait that each kind of model implements, and the macro that combines all kinds.

use crate::document::from_value;
use crate::invalid::Invalid;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A kind of model. Each kind has a source file in this folder, and a line in the table of
/// `predict.rs`.
pub(super) trait Kind: Sized {
    /// The fields of this kind in a predictor.json.
    type File;

    /// Whether the probabilities depend on features.
    const NEEDS_FEATURES: bool = true;

    /// Reads the fields of this kind from a document and ignores all others.
    fn read(document: &Value) -> Result<Self::File, Invalid>;

    /// The model with these fields, for `width` features and `classes` classes.
    fn of_file(file: Self::File, width: usize, classes: usize) -> Result<Self, Invalid>;

    /// The fields of the model in a file.
    fn to_file(&self) -> Self::File;

    /// Writes the probability of each class to `out`, given a row of raw features.
    fn probabilities_into(&self, row: &[f64], out: &mut [f64]);

    /// The index of the predicted class, below `classes`. This is the most probable class; ties go
    /// to the first class.
    fn class(&self, row: &[f64], classes: usize) -> usize {
        let mut p = vec![0.0; classes];
        self.probabilities_into(row, &mut p);
        let likelier = |best: usize, k: usize| if p[k] > p[best] { k } else { best };
        (0..p.len()).reduce(likelier).unwrap_or(0)
    }
}

/// Reads one field of a document.
pub(super) fn field<T: DeserializeOwned>(document: &Value, name: &str) -> Result<T, Invalid> {
    match document.get(name) {
        None | Some(Value::Null) => Err(Invalid::new(name, "a value", "nothing")),
        Some(value) => from_value(value).map_err(|invalid| invalid.within(name)),
    }
}

/// Generates three things from the table of kinds: the enum of models, the enum of their file
/// fields, and the functions that dispatch to a kind.
macro_rules! kinds {
    ($($(#[$about:meta])* $kind:ident: $model:ty = $file:ty,)*) => {
        /// The names of the kinds in files.
        #[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "openapi", derive(schemars::JsonSchema), schemars(rename = "Kind"))]
        #[serde(rename_all = "lowercase")]
        enum KindName {
            $($kind),*
        }

        /// A model of any kind.
        #[derive(Clone, Debug, PartialEq)]
        enum Model {
            $($kind($model)),*
        }

        /// The fields of a predictor.json that depend on its kind.
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        #[serde(untagged)]
        pub enum ModelFile {
            $($(#[$about])* $kind($file)),*
        }

        impl Model {
            fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
                match self {
                    $(Self::$kind(model) => Kind::probabilities_into(model, row, out)),*
                }
            }

            fn class(&self, row: &[f64], classes: usize) -> usize {
                match self {
                    $(Self::$kind(model) => Kind::class(model, row, classes)),*
                }
            }

            fn to_file(&self) -> ModelFile {
                match self {
                    $(Self::$kind(model) => ModelFile::$kind(Kind::to_file(model))),*
                }
            }
        }

        impl ModelFile {
            fn kind(&self) -> KindName {
                match self {
                    $(Self::$kind(_) => KindName::$kind),*
                }
            }

            fn needs_features(&self) -> bool {
                match self {
                    $(Self::$kind(_) => <$model as Kind>::NEEDS_FEATURES),*
                }
            }

            fn read(kind: KindName, document: &serde_json::Value) -> Result<Self, Invalid> {
                Ok(match kind {
                    $(KindName::$kind => Self::$kind(<$model as Kind>::read(document)?)),*
                })
            }

            fn model(self, width: usize, classes: usize) -> Result<Model, Invalid> {
                Ok(match self {
                    $(Self::$kind(file) => Model::$kind(Kind::of_file(file, width, classes)?)),*
                })
            }
        }
    };
}
pub(super) use kinds;
