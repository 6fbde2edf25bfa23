//! The filter of an export.

use crate::formats::tables::Driven;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sidestep::trial::{Flag, Phase};

/// Selects the participants of an export, and their trials with steps and key events. The default
/// selects all participants and no pilots.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Filter {
    /// Only trials of this phase.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Phase>,
    /// Selects trials by their flags.
    pub quality: Quality,
    /// Only participants who enrolled under the configuration with this hash.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub configuration: Option<String>,
    /// Export pilots instead of participants. They are never exported together, because pilots are
    /// numbered separately.
    pub pilots: bool,
}

/// Selects trials by their flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "ExportQuality")]
pub enum Quality {
    /// All trials.
    #[default]
    All,
    /// Trials without damage and without a flag other than `imported`.
    Unflagged,
}

impl Filter {
    /// Whether the filter selects this trial, if it selects the trial's participant.
    #[must_use]
    pub fn keeps(&self, Driven { trial, damage, .. }: &Driven<'_>) -> bool {
        let head = &trial.head;
        let quality = match self.quality {
            Quality::All => true,
            Quality::Unflagged => damage.is_none() && !Flag::question(&head.flags),
        };
        quality && self.phase.is_none_or(|phase| phase == head.phase)
    }

    /// Whether the filter selects participants who enrolled under the configuration with this hash.
    #[must_use]
    pub fn keeps_configuration(&self, hash: &str) -> bool {
        self.configuration.as_ref().is_none_or(|wanted| wanted == hash)
    }
}
