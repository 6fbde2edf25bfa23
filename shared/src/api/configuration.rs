//! A study's configuration as experimenters edit it: the text of a study file.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The present configuration of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Configuration {
    /// The study's name in addresses.
    pub study: String,
    /// SHA-256 of the configuration.
    pub hash: String,
    /// A study file (TOML) that says it: what differs from the paper's protocol, without comments.
    pub toml: String,
    /// People who enrolled in the study, under whatever configuration; without pilots.
    pub participants: u64,
    /// The configurations that the study has had, newest first; the first is the present one.
    pub versions: Vec<ConfigurationVersion>,
}

/// One of the configurations that a study has had.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ConfigurationVersion {
    /// Its number within the study, from 1.
    pub number: u32,
    /// SHA-256 of the configuration that people enrolled under. A study that goes back to an earlier
    /// configuration has two versions of the same hash; opening and closing it makes no version.
    pub hash: String,
    /// The experimenter's label: `version` in the study file.
    pub label: String,
    /// From when new participants got it, ms since 1970.
    pub since_ms: i64,
    /// People who enrolled under it; without pilots. If the configuration came back, they are counted in its
    /// last version.
    pub participants: u64,
    /// A study file (TOML) that says it.
    pub toml: String,
    /// Paths of the fields in which it differs from the version before it; none for the first.
    pub changed: Vec<String>,
}

/// A study file that somebody is writing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Draft {
    /// The text (TOML).
    pub toml: String,
    /// The hash of the configuration that was edited; absent for a new study. If the study has another
    /// one by now, the draft is not stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
}

/// A study that somebody is writing in a form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FormDraft {
    /// The study: an object with the fields of a study file, as in [`DraftChecked`]. Fields that are
    /// missing take the paper's values.
    pub config: Value,
    /// As in [`Draft`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
}

/// A remark about a study file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Remark {
    /// The line, from 1; absent for a form whose values cannot be written as a study file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// The field, such as `phases[0].scenes`; absent if the text is not TOML.
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
    /// Its value as JSON in the present configuration; absent if it is not there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<String>,
    /// Its value as JSON in the draft; absent if it is not there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
}

/// What a draft would be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct DraftChecked {
    /// Why it is no study; absent if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub complaint: Option<Remark>,
    /// What an experimenter should know.
    pub warnings: Vec<Remark>,
    /// The differences from the present configuration of the study of this name; none for a new study.
    pub changes: Vec<Change>,
    /// The study as a form shows it: an object with all fields of a study file. It is there also for a draft
    /// with a complaint, unless it could not be read as a study at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub config: Option<Value>,
    /// The study file (TOML) that a form's values make; absent for a draft that is a text itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toml: Option<String>,
    /// The languages that this server has.
    #[serde(default)]
    pub languages: Vec<String>,
    /// How its scenes are spread, as SVG.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
}

/// Whether people can take part, as it is to be from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NewStatus {
    /// The status.
    pub status: crate::study::Status,
}
