//! A study's configuration as experimenters edit it: the text of a study file.

use serde::{Deserialize, Serialize};

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

/// A remark about a line of a study file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Remark {
    /// The line, from 1.
    pub line: usize,
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
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct DraftChecked {
    /// Why it is no study; absent if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub complaint: Option<Remark>,
    /// What an experimenter should know.
    pub warnings: Vec<Remark>,
    /// The differences from the present configuration of the study of this name; none for a new study.
    pub changes: Vec<Change>,
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
