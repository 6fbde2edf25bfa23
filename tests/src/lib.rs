//! Support for end-to-end tests: a server on a free port with its own database and a small site,
//! people who drive, and the command as a process. Everything is removed when dropped.

pub mod behind;
pub mod browser;
pub mod database;
pub mod driver;
pub mod folder;
pub mod front;
pub mod load;
pub mod parsers;
pub mod participant;
#[cfg(unix)]
pub mod postgres;
#[cfg(unix)]
pub mod power;
pub mod process;
pub mod proxy;
pub mod server;
pub mod sqlite;

pub use behind::behind;
pub use browser::{Browser, Tab};
pub use database::Database;
pub use driver::{Driver, driven, driven_with, on_time, upload, upload_with};
pub use folder::Folder;
pub use process::{Process, run, sidestep};
pub use proxy::{Cut, Proxy};
pub use server::Server;

use reqwest::{Client, Method, RequestBuilder};
use serde_json::Value;
use sidestep_server::client::http;
use tokio_rustls::rustls::RootCertStore;

/// Address of a server.
#[derive(Clone, Debug)]
pub struct Address {
    /// `http://127.0.0.1:PORT`.
    pub origin: String,
    /// Sends requests; has no cookies and follows no redirects.
    client: Client,
}

impl Address {
    /// The server at that origin.
    #[must_use]
    pub fn new(origin: String) -> Self {
        let client = http(RootCertStore::empty()).expect("versions of TLS");
        Self::through(origin, client.build().expect("a client"))
    }

    /// The server at that origin, accessed by the test's own client.
    #[must_use]
    pub fn through(origin: String, client: Client) -> Self {
        Self { origin, client }
    }

    /// A request to a route.
    pub fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{route}", self.origin))
    }

    /// `GET` without any credentials.
    pub async fn get(&self, route: &str) -> Answer {
        Answer::of(self.request(Method::GET, route)).await
    }
}

/// The answer to a request: status, and the body as JSON (null if it is not JSON).
#[derive(Debug)]
pub struct Answer {
    /// Status.
    pub status: u16,
    /// Body.
    pub body: Value,
}

impl Answer {
    /// Sends a request and reads the whole answer.
    ///
    /// # Panics
    /// If the server cannot be reached.
    pub async fn of(request: reqwest::RequestBuilder) -> Self {
        let response = request.send().await.expect("an answer");
        let status = response.status().as_u16();
        let bytes = response.bytes().await.expect("a body");
        let body = serde_json::from_slice(&bytes).unwrap_or(Value::Null);
        Self { status, body }
    }

    /// Checks that this is a problem of that status, code and field, and returns
    /// its message.
    ///
    /// # Panics
    /// If it is not.
    pub fn problem(&self, status: u16, code: &str, field: Option<&str>) -> &str {
        assert_eq!(self.status, status, "{}", self.body);
        assert_eq!(self.body["code"], code, "{}", self.body);
        assert_eq!(self.body["field"].as_str(), field, "{}", self.body);
        self.body["message"].as_str().expect("a message")
    }

    /// The body as a `T`.
    ///
    /// # Panics
    /// If the status is another one or the body is not a `T`.
    pub fn into<T: serde::de::DeserializeOwned>(self, status: u16) -> T {
        assert_eq!(self.status, status, "{}", self.body);
        serde_json::from_value(self.body).expect("the body's type")
    }
}
