//! Support for end-to-end tests: a server on a free port with its own database and a small site,
//! simulated participants, and the command as a process. Dropping these objects cleans up after
//! them.

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

/// Address of a server, and a client to access it.
#[derive(Clone, Debug)]
pub struct Address {
    /// `http://127.0.0.1:PORT`.
    pub origin: String,
    /// Sends requests without cookies and does not follow redirects.
    client: Client,
}

impl Address {
    /// The server at this origin.
    #[must_use]
    pub fn new(origin: String) -> Self {
        let client = http(RootCertStore::empty()).expect("versions of TLS");
        Self::through(origin, client.build().expect("a client"))
    }

    /// The server at this origin, accessed by the given client.
    #[must_use]
    pub fn through(origin: String, client: Client) -> Self {
        Self { origin, client }
    }

    /// A request to a route.
    pub fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{route}", self.origin))
    }

    /// Sends a `GET` request without credentials, and returns the answer.
    pub async fn get(&self, route: &str) -> Answer {
        Answer::of(self.request(Method::GET, route)).await
    }
}

/// The answer to a request: status, and the body as JSON (null if it is not JSON).
#[derive(Debug)]
pub struct Answer {
    /// The HTTP status.
    pub status: u16,
    /// The body as JSON; null if it is not JSON.
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

    /// Checks that this answer is a problem with this status, code and field, and returns its
    /// message.
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
    /// If the status differs or the body is not a `T`.
    pub fn into<T: serde::de::DeserializeOwned>(self, status: u16) -> T {
        assert_eq!(self.status, status, "{}", self.body);
        serde_json::from_value(self.body).expect("the body's type")
    }
}
