//! All codes of problem bodies, with their status and meaning.

/// A code, the status of its responses, and its meaning.
pub type Meaning = (&'static str, u16, &'static str);

/// All codes, ordered by status.
pub const PROBLEMS: [Meaning; 37] = [
    ("malformed", 400, "the body is not JSON"),
    ("host", 400, "the request names no host, or several"),
    ("unauthorized", 401, "the token, key or cookie is missing or not valid"),
    ("access", 403, "the key lacks the right that this needs"),
    ("closed", 403, "the study takes no new participants"),
    ("cross_site", 403, "a page of another site made the browser send this"),
    ("full", 403, "the quota of participants is reached"),
    ("not_yours", 403, "the token was given to a client that knew only the external id"),
    ("not_found", 404, "there is no such resource"),
    ("timeout", 408, "the request was not done within 30 s"),
    ("answered", 409, "other answers are stored, and this token does not replace them"),
    ("changed", 409, "the study has another configuration meanwhile"),
    ("complete", 409, "the participation is complete"),
    ("different_content", 409, "the trial is stored with different content, which is kept"),
    ("first_key", 409, "the first key is replaced by a start with --new-admin-key"),
    ("incomplete", 409, "trials are missing"),
    ("out_of_order", 409, "another trial comes first"),
    ("over", 409, "the analysis has ended"),
    ("queue_full", 409, "too many analyses are queued"),
    ("taken", 409, "the name is taken"),
    ("unanswered", 409, "a required question is not answered"),
    ("archived", 410, "the study is archived"),
    ("screened_out", 410, "the check of understanding ended the participation"),
    ("withdrawn", 410, "the participant has withdrawn"),
    ("changed", 412, "the data have changed since the first part"),
    ("too_large", 413, "the body has more than 262144 bytes"),
    ("long_address", 414, "the address has more than 8192 bytes"),
    ("content_encoding", 415, "the body is compressed"),
    ("content_type", 415, "the Content-Type is not application/json"),
    ("unknown_host", 421, "this server does not serve that host name"),
    ("invalid", 422, "a value is invalid; `field` names it"),
    (
        "throttled",
        429,
        "too many requests, enrolments or wrong keys from this address, or too many requests with \
         this token; Retry-After says when to try again",
    ),
    ("internal", 500, "a defect of the server, which it logged"),
    ("busy", 503, "too many requests are waiting; Retry-After says when to try again"),
    (
        "measuring",
        503,
        "the length of the archive is being measured; Retry-After says when to ask again",
    ),
    ("not_ready", 503, "no trial can be stored now"),
    ("storage", 503, "the database cannot be used now; Retry-After says when to try again"),
];

/// The first entry of a code or, with a status, the entry of this code and status.
///
/// # Panics
/// If there is no entry, which is a defect of this program.
#[must_use]
pub fn meaning(code: &str, status: Option<u16>) -> Meaning {
    let fits = |it: &Meaning| it.0 == code && status.is_none_or(|status| it.1 == status);
    let found = PROBLEMS.into_iter().find(fits);
    found.unwrap_or_else(|| panic!("a code of the table, not {code}"))
}
