//! A typed client of the HTTP interface, for commands, tests and programs in Rust.
//!
//! A [`Client`] is for one server. A [`Participation`] acts for an enrolled participant, with their
//! token. A [`Laboratory`] acts for an experimenter, with their key. Each method sends one request.
//! Its errors name the server and the requested item, and contain the server's message.

mod participation;
mod laboratory;

pub use laboratory::Laboratory;
pub use participation::Participation;

use crate::support::tls_client;
use reqwest::{Method, RequestBuilder, Url};
use rustls::RootCertStore;
use serde::Serialize;
use serde::de::DeserializeOwned;
use sidestep::api::{Enrolled, Enrolment, Problem, StudyInfo, Texts, routes};
use std::error::Error;
use std::time::Duration;

/// Request timeout, a little longer than the server's own timeout for a request.
const PATIENCE: Duration = Duration::from_secs(40);

/// The reason why a request did not succeed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ClientError {
    /// The server did not respond.
    #[error("{origin}: no answer: {why}; is a server running there?")]
    Unreachable {
        /// The server's address.
        origin: String,
        /// The innermost cause, such as a connection that was refused.
        why: String,
    },
    /// The server refused the request.
    #[error("{origin}: {what} was refused ({status}): {}", said(problem.as_ref()))]
    Refused {
        /// The server's address.
        origin: String,
        /// The requested item.
        what: &'static str,
        /// The HTTP status of the response.
        status: u16,
        /// The body of the response, if it has the format of a Sidestep server.
        problem: Option<Problem>,
    },
    /// The response is not from a Sidestep server of this version.
    #[error("{origin}: {what}: not the answer of a Sidestep server: {why}")]
    NotUnderstood {
        /// The server's address.
        origin: String,
        /// The requested item.
        what: &'static str,
        /// What is wrong with the response.
        why: String,
    },
}

impl ClientError {
    /// The problem code with which the server refused the request.
    #[must_use]
    pub fn code(&self) -> Option<&str> {
        match self {
            Self::Refused { problem: Some(problem), .. } => Some(&problem.code),
            _ => None,
        }
    }
}

/// The server's message. It does not repeat the request, because the request contains the token.
fn said(problem: Option<&Problem>) -> String {
    match problem {
        None => "not in the words of a Sidestep server".to_owned(),
        Some(Problem { message, field: Some(field), .. }) => format!("{field}: {message}"),
        Some(Problem { message, field: None, .. }) => message.clone(),
    }
}

/// An HTTP client builder that trusts these root certificates. The client sends requests directly
/// to the server, without a proxy, and follows no redirects.
///
/// # Errors
/// The error of [`tls_client::config`], which is not expected.
pub fn http(trusted: RootCertStore) -> Result<reqwest::ClientBuilder, rustls::Error> {
    let tls = tls_client::config(trusted)?;
    let builder = reqwest::Client::builder().tls_backend_preconfigured(tls);
    Ok(builder.redirect(reqwest::redirect::Policy::none()).no_proxy())
}

/// A server to which requests are sent.
#[derive(Clone, Debug)]
pub struct Client {
    http: reqwest::Client,
    /// The server's address, without a slash at the end.
    origin: String,
}

impl Client {
    /// The server at an address such as `http://127.0.0.1:8080`. Returns `None` if the address is
    /// not an http or https address, or has a password or a query. The server's certificate must be
    /// from an authority that this system trusts.
    ///
    /// # Errors
    /// If the HTTP client cannot be built.
    pub fn at(url: &str) -> Option<anyhow::Result<Self>> {
        let parsed = Url::parse(url).ok()?;
        let plain = matches!(parsed.scheme(), "http" | "https")
            && parsed.has_host()
            && parsed.username().is_empty()
            && parsed.password().is_none()
            && parsed.query().is_none()
            && parsed.fragment().is_none();
        let origin = parsed.as_str().trim_end_matches('/').to_owned();
        plain.then(|| {
            // Loading the system's certificate authorities takes milliseconds, and an address
            // without TLS does not need them.
            let trusted = match parsed.scheme() {
                "https" => tls_client::system_roots(),
                _ => RootCertStore::empty(),
            };
            Ok(Self { http: http(trusted)?.timeout(PATIENCE).build()?, origin })
        })
    }

    /// The server's address, without a slash at the end.
    #[must_use]
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// The study's information for participants.
    ///
    /// # Errors
    /// [`ClientError`]; `not_found` if there is no such study.
    pub async fn study(&self, slug: &str) -> Result<StudyInfo, ClientError> {
        self.ask("the study", self.request(Method::GET, &routes::study(slug))).await
    }

    /// The texts of the participant's page, in a language such as `en`.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn texts(&self, slug: &str, language: &str) -> Result<Texts, ClientError> {
        let route = format!("{}?language={language}", routes::texts(slug));
        self.ask("the texts", self.request(Method::GET, &route)).await
    }

    /// Enrols a participant and returns their participation.
    ///
    /// # Errors
    /// [`ClientError`]; `closed`, `full`, `archived`, `screened_out` or `withdrawn` if the study
    /// does not accept the person.
    pub async fn enrol<V: Serialize>(
        &self,
        slug: &str,
        body: &Enrolment<V>,
    ) -> Result<Participation, ClientError> {
        let post = self.request(Method::POST, &routes::participants(slug)).json(body);
        let enrolled: Enrolled = self.ask("the enrolment", post).await?;
        Ok(Participation::new(self.clone(), enrolled))
    }

    /// A client for the laboratory that sends this key.
    #[must_use]
    pub fn laboratory(&self, key: &str) -> Laboratory {
        Laboratory::new(self.clone(), key.to_owned())
    }

    fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.http.request(method, format!("{}{route}", self.origin))
    }

    /// Sends the request and parses the JSON of a successful response.
    async fn ask<T: DeserializeOwned>(
        &self,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<T, ClientError> {
        let body = self.bytes(what, request).await?;
        serde_json::from_slice(&body).map_err(|error| ClientError::NotUnderstood {
            origin: self.origin.clone(),
            what,
            why: error.to_string(),
        })
    }

    /// Sends the request and returns the body of a successful response.
    async fn bytes(
        &self,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<Vec<u8>, ClientError> {
        let origin = || self.origin.clone();
        let unreachable = |error: reqwest::Error| ClientError::Unreachable {
            origin: origin(),
            why: root_cause(&error),
        };
        let response = request.send().await.map_err(unreachable)?;
        let status = response.status();
        let body = response.bytes().await.map_err(unreachable)?;
        if status.is_success() {
            return Ok(body.to_vec());
        }
        let problem = serde_json::from_slice(&body).ok();
        Err(ClientError::Refused { origin: origin(), what, status: status.as_u16(), problem })
    }
}

/// The innermost error, such as a connection that was refused.
fn root_cause(error: &reqwest::Error) -> String {
    let mut cause: &dyn Error = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses() {
        let origin = |url| Client::at(url).map(|client| client.unwrap().origin);
        assert_eq!(origin("http://[::1]:80/").as_deref(), Some("http://[::1]"));
        assert_eq!(origin("http://lab:8080/study/").as_deref(), Some("http://lab:8080/study"));
        assert_eq!(origin("https://lab").as_deref(), Some("https://lab"));
        for bad in ["", "lab:8080", "ftp://lab", "http://", "http://a:b@lab", "http://lab?x"] {
            assert_eq!(origin(bad), None, "{bad}");
        }
    }
}
