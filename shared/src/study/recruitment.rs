//! Recruiting service: links to the study and return URLs.

use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};

/// Recruiting service: links to the study and return URLs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Recruitment {
    /// URL parameters that may hold the person's id at the recruiting service. The first of them
    /// that is present is used. Default: `external_id`, Prolific's `PROLIFIC_PID`, MTurk's
    /// `workerId`, SONA's `survey_code`.
    pub external_id: Vec<String>,
    /// Whether a person without this id is refused. Default: false.
    pub require_external_id: bool,
    /// Further URL parameters that are stored with the participant. Default: Prolific's `STUDY_ID`
    /// and `SESSION_ID`, MTurk's `assignmentId` and `hitId`.
    pub record: Vec<String>,
    /// Allowed hosts of return URLs. Default: none.
    pub return_hosts: Vec<String>,
    /// Return URL after completion: an https URL on one of `return_hosts`, in which `{code}` and
    /// `{external_id}` are filled in. If empty, there is no return URL.
    pub completed_url: String,
    /// Return URL for people who were screened out. Like `completed_url`, but without `{code}`.
    pub screened_out_url: String,
    /// Return URL for people who withdrew. Like `completed_url`, but without `{code}`.
    pub withdrawn_url: String,
    /// Return URL for people who have finished and open the study again in a browser that does not
    /// have their code. Like `completed_url`, but without `{code}`, because anyone who knows the
    /// person's id gets this URL.
    pub finished_url: String,
    /// Return URL when the study is full. Like `completed_url`, but without `{code}`.
    pub full_url: String,
    /// Return URL when the study is closed or archived. Like `completed_url`, but without `{code}`.
    pub closed_url: String,
    /// Maximum number of completed participants; 0 means no limit. Pilots and people who withdrew
    /// or were screened out do not count. Default: 0.
    pub quota: u64,
    /// Minutes for which an unfinished participant holds a place in the quota after the server last
    /// stored data of this participant, 1 to 10080 (a week). A participant who returns later can
    /// still finish. Default: 60.
    pub hold_min: f64,
}

impl Default for Recruitment {
    fn default() -> Self {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        Self {
            external_id: names(&["external_id", "PROLIFIC_PID", "workerId", "survey_code"]),
            require_external_id: false,
            record: names(&["STUDY_ID", "SESSION_ID", "assignmentId", "hitId"]),
            return_hosts: Vec::new(),
            completed_url: String::new(),
            screened_out_url: String::new(),
            withdrawn_url: String::new(),
            finished_url: String::new(),
            full_url: String::new(),
            closed_url: String::new(),
            quota: 0,
            hold_min: 60.0,
        }
    }
}

/// Maximum length of an external id (characters).
const MAX_ID_CHARS: usize = 128;

impl Recruitment {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        let lists = [("external_id", &self.external_id), ("record", &self.record)];
        for (field, names) in lists {
            if names.len() > 20 {
                return Err(Invalid::new(field, "at most 20 names", names.len()));
            }
            for (i, name) in names.iter().enumerate() {
                let fits = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
                if !(1..=64).contains(&name.len()) || !name.chars().all(fits) {
                    let expected = "1 to 64 letters, digits, underscores, hyphens and points";
                    let found = format!("{name:?}");
                    return Err(Invalid::new(format!("{field}[{i}]"), expected, found));
                }
            }
        }
        if self.require_external_id && self.external_id.is_empty() {
            let expected = "at least one name, since require_external_id is true";
            return Err(Invalid::new("external_id", expected, "none"));
        }
        for (i, host) in self.return_hosts.iter().enumerate() {
            let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || ".-:".contains(c);
            if !(1..=255).contains(&host.len()) || !host.chars().all(fits) {
                let expected = "a host in lower-case letters, such as app.prolific.com";
                let found = format!("{host:?}");
                return Err(Invalid::new(format!("return_hosts[{i}]"), expected, found));
            }
        }
        self.check_url("completed_url", &self.completed_url, &["{code}", "{external_id}"])?;
        for (field, url) in self.early_urls() {
            self.check_url(field, url, &["{external_id}"])?;
        }
        if !(1.0..=10_080.0).contains(&self.hold_min) {
            return Err(Invalid::new("hold_min", "minutes from 1 to 10080", self.hold_min));
        }
        Ok(())
    }

    /// The return URLs for people without a code, by field name.
    #[must_use]
    pub fn early_urls(&self) -> [(&'static str, &str); 5] {
        [
            ("screened_out_url", &self.screened_out_url),
            ("withdrawn_url", &self.withdrawn_url),
            ("finished_url", &self.finished_url),
            ("full_url", &self.full_url),
            ("closed_url", &self.closed_url),
        ]
    }

    /// Checks that a URL is empty, or that it is an https URL on one of the return hosts and has no
    /// placeholders except `places`.
    fn check_url(&self, field: &str, url: &str, places: &[&str]) -> Result<(), Invalid> {
        if url.is_empty() {
            return Ok(());
        }
        let found = || format!("{url:?}");
        let hosts = &self.return_hosts;
        let on_host = |host: &String| {
            let rest = url.strip_prefix("https://").and_then(|rest| rest.strip_prefix(&**host));
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['/', '?']))
        };
        if !hosts.iter().any(on_host) {
            let expected = if hosts.is_empty() {
                "recruitment.return_hosts to name the host of this address".to_owned()
            } else {
                format!("an address that begins with https:// and one of {}", hosts.join(", "))
            };
            return Err(Invalid::new(field, expected, found()));
        }
        let plain = places.iter().fold(url.to_owned(), |url, place| url.replace(place, ""));
        let fits = |c: char| c.is_ascii_graphic() && !"{}\"<>\\^`|".contains(c);
        if !plain.chars().all(fits) {
            let expected =
                format!("an address whose only places to fill are {}", places.join(", "));
            return Err(Invalid::new(field, expected, found()));
        }
        Ok(())
    }

    /// The URL with the code and the external id filled in, percent-encoded. Returns `None` if the
    /// URL is empty or a required value is missing.
    #[must_use]
    pub fn filled(url: &str, code: Option<&str>, external_id: Option<&str>) -> Option<String> {
        if url.is_empty() {
            return None;
        }
        let fill = |url: String, place: &str, text: Option<&str>| match text {
            Some(text) => Some(url.replace(place, &percent_encoded(text))),
            None => (!url.contains(place)).then_some(url),
        };
        // The id is filled in last, so that placeholders inside the id are not expanded.
        fill(fill(url.to_owned(), "{code}", code)?, "{external_id}", external_id)
    }
}

/// Percent-encodes everything except letters, digits and `-._~`.
fn percent_encoded(text: &str) -> String {
    let mut encoded = String::with_capacity(text.len());
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            encoded.push(char::from(byte));
        } else {
            encoded.push('%');
            for digit in [byte >> 4, byte & 15] {
                encoded.push(char::from(b"0123456789ABCDEF"[usize::from(digit)]));
            }
        }
    }
    encoded
}

/// Whether a trimmed text can be a person's id at a recruiting service; see [`normalised_id`].
#[must_use]
pub fn is_id(text: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || b" -_.@:+=/~".contains(&byte);
    (1..=MAX_ID_CHARS).contains(&text.len()) && text.bytes().all(fits)
}

/// Normalizes a person's id at a recruiting service for comparison: trims it and converts it to
/// lower case, so that `P1`, `p1` and ` P1 ` are one person. Only ASCII is accepted, because
/// services' ids are ASCII and other letters have several encodings that look the same.
///
/// # Errors
/// [`Invalid`] for an id that is empty, too long, or has characters other than the letters A to Z,
/// digits, spaces and `-_.@:+=/~`.
pub fn normalised_id(field: &str, id: &str) -> Result<String, Invalid> {
    let id = id.trim();
    let count = id.chars().count();
    if !(1..=MAX_ID_CHARS).contains(&count) {
        let expected = format!("1 to {MAX_ID_CHARS} characters without surrounding white space");
        return Err(Invalid::new(field, expected, format!("{count}")));
    }
    if !is_id(id) {
        let expected = "letters from A to Z, digits, spaces and -_.@:+=/~ only";
        return Err(Invalid::new(field, expected, "another character"));
    }
    Ok(id.to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_person_has_one_id() {
        for id in ["P1", "p1", " P1 ", "\u{a0}p1\n"] {
            assert_eq!(normalised_id("external_id", id).as_deref(), Ok("p1"));
        }
        for id in ["", "  ", "a\tb", "<b>", "a\u{202e}b", "a\u{0}", "a{code}", "é", "ｐ1"] {
            assert!(normalised_id("external_id", id).is_err(), "{id:?}");
        }
        assert!(normalised_id("external_id", &"x".repeat(129)).is_err());
    }

    #[test]
    fn return_links_lead_to_named_hosts_only() {
        let with = |hosts: &[&str], url: &str| {
            let return_hosts = hosts.iter().map(|&host| host.to_owned()).collect();
            let recruitment = Recruitment {
                return_hosts,
                completed_url: url.to_owned(),
                ..Recruitment::default()
            };
            recruitment.check().map_err(|error| error.field)
        };
        let host = ["app.prolific.com"];
        assert_eq!(with(&[], ""), Ok(()));
        assert_eq!(with(&host, "https://app.prolific.com/done?cc={code}&p={external_id}"), Ok(()));
        for url in [
            "http://app.prolific.com/",
            "https://app.prolific.com.evil.example/",
            "https://app.prolific.com@evil.example/",
            "https://evil.example/?app.prolific.com",
            "javascript:alert(1)",
            "https://app.prolific.com/{token}",
            "https://app.prolific.com/a b",
            "https://app.prolific.com\\@evil.example",
        ] {
            assert_eq!(with(&host, url), Err("completed_url".to_owned()), "{url}");
        }
        assert!(with(&[], "https://app.prolific.com/").is_err());
    }

    #[test]
    fn places_are_filled_with_encoded_text() {
        let filled =
            Recruitment::filled("https://h/?c={code}&p={external_id}", Some("A-1"), Some("a/ü"));
        assert_eq!(filled.as_deref(), Some("https://h/?c=A-1&p=a%2F%C3%BC"));
        for (url, code) in [("", Some("x")), ("https://h/?c={code}", None)] {
            assert_eq!(Recruitment::filled(url, code, Some("p")), None, "{url}");
        }
        assert_eq!(Recruitment::filled("https://h/{external_id}", Some("x"), None), None);
    }
}
