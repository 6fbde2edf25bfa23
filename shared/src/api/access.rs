//! Access rights in the laboratory, and the audit trail.

use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};

/// Access level of an experimenter's key. Each level includes all lower levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Access {
    /// View studies, participants, trials and analyses.
    Read,
    /// Also download all data, as exports or as the table of participants.
    Export,
    /// Also change and delete studies, pilots, analyses and keys.
    Manage,
}

impl Access {
    /// All levels, lowest first.
    pub const ALL: [Self; 3] = [Self::Read, Self::Export, Self::Manage];

    /// The word in JSON and in the database.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Export => "export",
            Self::Manage => "manage",
        }
    }
}

/// Response to a sign-in, and to a check of the session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Session {
    /// Always true. Without a session, the server responds with status 401 instead.
    pub signed_in: bool,
    /// The name of the key that signed in.
    pub name: String,
    /// Access level of this key.
    pub access: Access,
}

/// Maximum length of a key's name (characters).
const MAX_KEY_NAME_CHARS: usize = 64;

/// The request for a new key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NewKey {
    /// Name of the person or program that uses the key, such as `Ada` or `nightly export`. It has 1
    /// to 64 characters and is unique among keys.
    #[cfg_attr(feature = "openapi", schemars(length(min = 1, max = 64)))]
    pub name: String,
    /// Access level.
    pub access: Access,
}

impl NewKey {
    /// Checks the length and the characters of the name.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        let count = self.name.chars().count();
        if !(1..=MAX_KEY_NAME_CHARS).contains(&count) || self.name.trim() != self.name {
            let expected =
                format!("1 to {MAX_KEY_NAME_CHARS} characters without spaces around them");
            return Err(Invalid::new("name", expected, format!("{count} characters")));
        }
        // The audit trail identifies keys by name, so names that look the same would be confused.
        let fits = |c: char| c.is_alphanumeric() || " -_.,:@/&'’()".contains(c);
        if !self.name.chars().all(fits) {
            let expected = "letters, digits, spaces and -_.,:@/&'’() only";
            return Err(Invalid::new("name", expected, "another character"));
        }
        Ok(())
    }
}

/// An entry in the list of keys. The server stores only a hash of the key itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct KeySummary {
    /// Id in URLs.
    pub id: i64,
    /// Name of the person or program that uses the key.
    pub name: String,
    /// Access level.
    pub access: Access,
    /// When the key was created (ms since 1970).
    pub created_at_ms: i64,
    /// When the key was last used (ms since 1970), to the minute. Absent if it was never used.
    pub last_used_at_ms: Option<i64>,
    /// When the key was revoked (ms since 1970). Absent while it is valid.
    pub revoked_at_ms: Option<i64>,
}

/// Response to the request for a new key.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct KeyMade {
    /// The new key's entry in the list of keys.
    pub key: KeySummary,
    /// The key itself. No later response contains it.
    pub secret: String,
}

/// An action in the audit trail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// A user signed in to the laboratory.
    SignedIn,
    /// A key was created; the subject is its name.
    KeyMade,
    /// A key was revoked; the subject is its name.
    KeyRevoked,
    /// Data were exported; the subject names the data and the format.
    Exported,
    /// A study was created.
    StudyMade,
    /// A study's configuration or status changed; the subject lists the changed fields.
    StudyChanged,
    /// All pilots of a study were deleted; the subject is their number.
    PilotsDeleted,
    /// A note about a participant was written; the subject is the participant's number.
    NoteAdded,
    /// A note about a participant was deleted; the subject is the participant's number.
    NoteDeleted,
    /// A participant was excluded from analyses; the subject is the participant's number.
    Excluded,
    /// A participant was included in analyses again; the subject is the participant's number.
    Included,
    /// A participant's data were deleted, on request or after the retention period; the subject is the participant's
    /// number.
    ParticipantDeleted,
    /// An analysis was requested; the subject is its id.
    AnalysisRequested,
    /// An analysis was cancelled; the subject is its id.
    AnalysisCancelled,
    /// An analysis was deleted; the subject is its id.
    AnalysisDeleted,
    /// A participant's identity was deleted after its retention period; the subject is the
    /// participant's number.
    IdentityDeleted,
    /// Old entries of this trail were deleted; the subject is their number.
    AuditShortened,
    /// The key's access level was too low; the subject is the HTTP method and the route's pattern.
    Refused,
}

impl Action {
    /// All actions.
    pub const ALL: [Self; 18] = [
        Self::SignedIn,
        Self::KeyMade,
        Self::KeyRevoked,
        Self::Exported,
        Self::StudyMade,
        Self::StudyChanged,
        Self::PilotsDeleted,
        Self::NoteAdded,
        Self::NoteDeleted,
        Self::Excluded,
        Self::Included,
        Self::ParticipantDeleted,
        Self::AnalysisRequested,
        Self::AnalysisCancelled,
        Self::AnalysisDeleted,
        Self::IdentityDeleted,
        Self::AuditShortened,
        Self::Refused,
    ];

    /// The word in JSON and in the database.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::SignedIn => "signed_in",
            Self::KeyMade => "key_made",
            Self::KeyRevoked => "key_revoked",
            Self::Exported => "exported",
            Self::StudyMade => "study_made",
            Self::StudyChanged => "study_changed",
            Self::PilotsDeleted => "pilots_deleted",
            Self::NoteAdded => "note_added",
            Self::NoteDeleted => "note_deleted",
            Self::Excluded => "excluded",
            Self::Included => "included",
            Self::ParticipantDeleted => "participant_deleted",
            Self::AnalysisRequested => "analysis_requested",
            Self::AnalysisCancelled => "analysis_cancelled",
            Self::AnalysisDeleted => "analysis_deleted",
            Self::IdentityDeleted => "identity_deleted",
            Self::AuditShortened => "audit_shortened",
            Self::Refused => "refused",
        }
    }
}

/// A line of the audit trail.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AuditEntry {
    /// Sequence number. Later entries have higher numbers.
    pub sequence: i64,
    /// Time of the action (ms since 1970).
    pub at_ms: i64,
    /// The name of the key.
    pub who: String,
    /// The action.
    pub action: Action,
    /// The study that the action concerns, if any.
    pub study: Option<String>,
    /// The subject of the action, if any.
    pub subject: Option<String>,
}

/// A page of the audit trail, newest entry first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AuditPage {
    /// The entries of this page.
    pub entries: Vec<AuditEntry>,
    /// The value of `before` in the request for the next page. Absent on the last page.
    pub next_before: Option<i64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_those_of_json() {
        for access in Access::ALL {
            assert_eq!(serde_json::to_value(access).unwrap(), access.word());
        }
        for action in Action::ALL {
            assert_eq!(serde_json::to_value(action).unwrap(), action.word());
        }
        assert!(Access::Read < Access::Export && Access::Export < Access::Manage);
    }

    #[test]
    fn a_key_has_a_name_of_one_line() {
        let with = |name: &str| NewKey { name: name.to_owned(), access: Access::Read }.check();
        assert_eq!(with("Zoë's script"), Ok(()));
        for name in
            ["", " a", "a\nb", "a\u{0}", "a\u{202e}b", "e\u{301}", "\u{200b}", &"x".repeat(65)]
        {
            assert_eq!(with(name).unwrap_err().field, "name", "{name:?}");
        }
    }
}
