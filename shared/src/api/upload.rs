//! A trial as the client uploads it.

use super::{
    MAX_KEY_EVENTS, MAX_NAME_CHARS, MAX_PAGE_EVENTS, Object, check_object, first, is_first,
};
use crate::invalid::{Invalid, all_finite, finite, length};
use crate::scene::{JointState, SceneParameters};
use crate::trial::PageEvent;
use crate::vehicle::TurnInput;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A key press or release.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct KeyEvent {
    /// Time after the scene's start (ms). Negative for keys that were already held.
    pub t_ms: f64,
    /// The key's name, such as `ArrowLeft`, or `blur` when the window lost focus.
    #[cfg_attr(feature = "openapi", schemars(length(max = MAX_NAME_CHARS)))]
    pub key: String,
    /// Whether the key went down.
    pub down: bool,
}

/// Request body of a trial's upload. `V` is the type of the facts about the display. On the server,
/// they are any JSON values. In the client, which measures them, they are numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "TrialUpload", description = "Body of a trial's upload.")
)]
pub struct TrialUpload<V = Value> {
    /// Start of the scene on the participant's clock (ms since 1970). A wrong clock is flagged.
    pub started_at_ms: f64,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// The states as the participant saw them: before each step and after the last step.
    pub states: Vec<JointState>,
    /// When each input was actually sampled (ms after the scene's start).
    pub sampled_at_ms: Vec<f64>,
    /// Key events, in chronological order.
    #[cfg_attr(feature = "openapi", schemars(length(max = MAX_KEY_EVENTS)))]
    pub key_events: Vec<KeyEvent>,
    /// Page events during the scene, in chronological order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "openapi", schemars(length(max = MAX_PAGE_EVENTS)))]
    pub page_events: Vec<PageEvent>,
    /// Number of times that the scene was shown to the participant, including this time.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    #[cfg_attr(feature = "openapi", schemars(range(min = 1)))]
    pub exposures: u32,
    /// Facts about the display: any small object.
    pub display: Object<V>,
}

impl<V: Serialize> TrialUpload<V> {
    /// Checks that this can be a trial of the study: it has the right number of steps, its states
    /// can be drawn, and it respects the size limits. Anything else that is unusual is not
    /// rejected. [`flags`](crate::trial::flags) and [`Record`](crate::trial::Record) flag it.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self, parameters: &SceneParameters) -> Result<(), Invalid> {
        finite("started_at_ms", self.started_at_ms)?;
        length("inputs", parameters.steps, self.inputs.len())?;
        length("states", parameters.steps + 1, self.states.len())?;
        for (i, state) in self.states.iter().enumerate() {
            state.check().map_err(|e| e.within(&format!("states[{i}]")))?;
        }
        length("sampled_at_ms", parameters.steps, self.sampled_at_ms.len())?;
        all_finite("sampled_at_ms", &self.sampled_at_ms)?;
        if self.key_events.len() > MAX_KEY_EVENTS {
            let expected = format!("at most {MAX_KEY_EVENTS} entries");
            return Err(Invalid::new("key_events", expected, self.key_events.len()));
        }
        for (i, event) in self.key_events.iter().enumerate() {
            finite(&format!("key_events.t_ms[{i}]"), event.t_ms)?;
            let count = event.key.chars().count();
            if count > MAX_NAME_CHARS {
                let expected = format!("at most {MAX_NAME_CHARS} characters");
                let found = format!("{count} characters");
                return Err(Invalid::new(format!("key_events[{i}].key"), expected, found));
            }
        }
        if self.page_events.len() > MAX_PAGE_EVENTS {
            let expected = format!("at most {MAX_PAGE_EVENTS} entries");
            return Err(Invalid::new("page_events", expected, self.page_events.len()));
        }
        for (i, event) in self.page_events.iter().enumerate() {
            finite(&format!("page_events.t_ms[{i}]"), event.t_ms)?;
        }
        if self.exposures == 0 {
            return Err(Invalid::new("exposures", "a whole number ≥ 1", self.exposures));
        }
        check_object("display", &self.display)
    }
}

/// Response to a trial's upload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialStored {
    /// Id of the trial.
    pub trial_id: String,
    /// Id of the next trial. Absent after the last trial.
    pub next: Option<String>,
}
