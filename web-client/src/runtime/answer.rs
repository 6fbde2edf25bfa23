//! Answers from the server, and failures of requests.

use sidestep::api::Problem;

/// Outcome of a request: the body of a 2xx response, or the failure.
pub type Answer = Result<Vec<u8>, Failure>;

/// The reason why a request failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// HTTP status of the response. 0 if the server could not be reached.
    pub status: u16,
    /// The server's error code. Empty if the server gave none.
    pub code: String,
    /// An error message for people.
    pub sentence: String,
    /// Where to send a participant whose participation has ended.
    pub return_url: Option<String>,
}

impl Failure {
    /// The failure if the server could not be reached.
    #[must_use]
    pub fn unreachable() -> Self {
        let sentence = "The server cannot be reached. Check the internet connection.";
        Self { status: 0, code: String::new(), sentence: sentence.to_owned(), return_url: None }
    }

    /// Whether the same request may succeed later.
    #[must_use]
    pub fn is_temporary(&self) -> bool {
        self.status >= 500 || matches!(self.status, 0 | 408 | 429)
    }
}

/// Interprets a response from the server.
///
/// # Errors
/// [`Failure`] if the status is not 2xx.
pub fn answer(status: u16, body: Vec<u8>) -> Answer {
    if (200..300).contains(&status) {
        return Ok(body);
    }
    Err(match crate::json::read::<Problem>(&body) {
        Some(Problem { code, message, return_url, .. }) => {
            Failure { status, code, sentence: sentence(message), return_url }
        }
        None => {
            let sentence = format!("The server answered with status {}.", u32::from(status));
            Failure { status, code: String::new(), sentence, return_url: None }
        }
    })
}

/// Parses the body of an answer.
///
/// # Errors
/// [`Failure`] if the server was not reached, refused, or sent something this page cannot read.
pub fn read<T: serde::de::DeserializeOwned>(answer: Answer) -> Result<T, Failure> {
    crate::json::read(&answer?).ok_or_else(|| Failure {
        status: 200,
        code: String::new(),
        sentence: "This page cannot read the server's answer. Please reload it.".to_owned(),
        return_url: None,
    })
}

/// Capitalizes a message and adds a full stop, because the server's messages may have neither.
fn sentence(mut message: String) -> String {
    if let Some(first) = message.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    if !message.ends_with(['.', '!', '?']) {
        message.push('.');
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_read_or_says_why_not() {
        let received = |status, body: &[u8]| answer(status, body.to_vec());
        assert_eq!(read(received(200, b"[1,2]")), Ok(vec![1, 2]));
        assert!(read::<Vec<u32>>(received(200, b"[1,")).is_err());
        let said = |message: &str| {
            let problem = format!(r#"{{"code":"busy","message":"{message}"}}"#);
            received(503, problem.as_bytes()).unwrap_err()
        };
        let full = said("the queue is full");
        assert!(full.is_temporary());
        assert_eq!((full.status, full.code.as_str()), (503, "busy"));
        assert_eq!(full.sentence, "The queue is full.");
        assert_eq!(said("Signed out.").sentence, "Signed out.");
        assert_eq!(said("ω is not finite").sentence, "ω is not finite.");
        let unknown = received(418, b"<html>").unwrap_err();
        assert!(!unknown.is_temporary() && unknown.sentence.contains("418"));
        assert!(Failure::unreachable().is_temporary());
    }
}
