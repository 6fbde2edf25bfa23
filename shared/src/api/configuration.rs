//! A study's configuration as experimenters edit it, that is, as the text of a study file.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The current configuration of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Configuration {
    /// The study's name in URLs.
    pub study: String,
    /// SHA-256 of the configuration.
    pub hash: String,
    /// The configuration as a study file (TOML). It contains only the differences from the paper's
    /// protocol, and no comments.
    pub toml: String,
    /// Number of people who enrolled in the study under any configuration, without pilots.
    pub participants: u64,
    /// All configurations of the study, newest first; the first is the current one.
    pub versions: Vec<ConfigurationVersion>,
}

/// A current or former configuration of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ConfigurationVersion {
    /// Its number within the study, counted from 1.
    pub number: u32,
    /// SHA-256 of the configuration that people enrolled under. A study that returns to an earlier
    /// configuration has two versions with the same hash. Opening or closing a study creates no
    /// version.
    pub hash: String,
    /// The experimenter's label: `version` in the study file.
    pub label: String,
    /// When the study began to use it for new participants (ms since 1970).
    pub since_ms: i64,
    /// Number of people who enrolled under it, without pilots. If several versions have this
    /// configuration, its people are counted in the last of these versions only.
    pub participants: u64,
    /// The configuration as a study file (TOML).
    pub toml: String,
    /// Paths of the fields in which it differs from the previous version. Empty for the first
    /// version.
    pub changed: Vec<String>,
}

/// A draft of a study file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Draft {
    /// The text (TOML).
    pub toml: String,
    /// The hash of the configuration that was edited. Absent for a new study. If the study's
    /// configuration has changed in the meantime, the draft is not stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
}

/// A draft of a study in a form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FormDraft {
    /// The study: an object with the fields of a study file, as in [`DraftChecked`]. Missing fields
    /// default to the paper's values.
    pub config: Value,
    /// See [`Draft::base`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
}

/// A remark about a study file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Remark {
    /// Line number, from 1. Absent for a form whose values cannot be written as a study file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// The field, such as `phases[0].scenes`. Absent if the text is not TOML.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// A sentence that names the field.
    pub message: String,
}

/// A field in which two configurations differ.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Change {
    /// Its path, such as `trials.countdown_s`.
    pub field: String,
    /// The field's value in the current configuration, as JSON. Absent if it has no value there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<String>,
    /// The field's value in the draft, as JSON. Absent if it has no value there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
}

/// The result of checking a draft.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct DraftChecked {
    /// The error in the draft. Absent if it is valid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub complaint: Option<Remark>,
    /// Warnings for the experimenter.
    pub warnings: Vec<Remark>,
    /// The differences from the current configuration of the study with the draft's name. Empty for
    /// a new study.
    pub changes: Vec<Change>,
    /// The study as a form shows it: an object with all fields of a study file. It is present even
    /// if the draft has an error, unless the draft could not be parsed as a study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub config: Option<Value>,
    /// The study file (TOML) generated from a form. Absent if the draft was a text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toml: Option<String>,
    /// The languages that this server offers.
    #[serde(default)]
    pub languages: Vec<String>,
    /// The distribution of the study's scenes, as SVG.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
}

/// A change of a study's status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NewStatus {
    /// The new status.
    pub status: crate::study::Status,
}
