//! A server within the test, as a browser or a script sees it.

use crate::Answer;
use reqwest::{Client, Method, RequestBuilder};
use sidestep::api::routes;
use sidestep_server::commands::serve::{Running, ServeArgs, start};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A study that is driven quickly: five scenes.
pub const SHORT_STUDY: &str = r#"
title = "Short"
phases = [
  { phase = "familiarisation", scenes = 1, show_danger_zone = true },
  { phase = "practice", scenes = 1 },
  { phase = "task", scenes = 3 },
]
"#;

/// A running server with its own folder.
pub struct Server {
    /// `http://127.0.0.1:PORT`.
    pub origin: String,
    /// The experimenter's key.
    pub key: String,
    /// Sends requests; keeps no cookies.
    pub client: Client,
    folder: TempDir,
    running: Running,
}

impl Server {
    /// The paper's study.
    pub async fn start() -> Self {
        Self::with_study("").await
    }

    /// A study file over the paper's study.
    ///
    /// # Panics
    /// If the server does not start.
    pub async fn with_study(study: &str) -> Self {
        let folder = TempDir::new().expect("a folder");
        std::fs::write(folder.path().join("study.toml"), study).expect("a study file");
        write_site(&folder.path().join("site"));
        let running = start(&args(folder.path()), None).await.expect("a server");
        let key = running.new_key.clone().expect("a key at the first start");
        Self {
            origin: format!("http://{}", running.address),
            key,
            client: Client::new(),
            folder,
            running,
        }
    }

    /// Stops the server and starts it again on the same database.
    ///
    /// # Panics
    /// If it does not start again.
    pub async fn restarted(self) -> Self {
        self.running.stop().await;
        let running = start(&args(self.folder.path()), None).await.expect("a server again");
        assert_eq!(running.new_key, None, "the key is shown once");
        Self { origin: format!("http://{}", running.address), running, ..self }
    }

    /// The database's address for commands.
    #[must_use]
    pub fn database(&self) -> String {
        database(self.folder.path())
    }

    /// A path in the server's own folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A request to a route.
    #[must_use]
    pub fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{route}", self.origin))
    }

    /// `GET` without any credentials.
    pub async fn get(&self, route: &str) -> Answer {
        Answer::of(self.request(Method::GET, route)).await
    }

    /// `GET` with the experimenter's key.
    pub async fn admin(&self, route: &str) -> Answer {
        let request = self.request(Method::GET, route).bearer_auth(&self.key);
        Answer::of(request).await
    }

    /// The study's export.
    ///
    /// # Panics
    /// If there is none.
    pub async fn export(&self, slug: &str) -> String {
        let request = self.request(Method::GET, &routes::export(slug));
        let response = request.bearer_auth(&self.key).send().await.expect("an answer");
        assert_eq!(response.status(), 200);
        response.text().await.expect("a file")
    }
}

fn database(folder: &Path) -> String {
    format!("sqlite:{}", folder.join("sidestep.db").display())
}

fn args(folder: &Path) -> ServeArgs {
    ServeArgs {
        listen: "127.0.0.1:0".to_owned(),
        database: database(folder),
        study: Some(folder.join("study.toml")),
        site: Some(folder.join("site")),
        new_admin_key: false,
    }
}

/// A client bundle of nothing but names.
///
/// # Panics
/// If it cannot be written.
pub fn write_site(folder: &Path) {
    std::fs::create_dir_all(folder.join("assets")).expect("a folder");
    let write = |name: &str, text: &[u8]| {
        std::fs::write(folder.join(name), text).expect("a file of the site");
    };
    for page in ["index", "participant", "lab"] {
        let text = format!("<!doctype html><title>{page}</title>");
        write(&format!("{page}.html"), text.as_bytes());
    }
    write("assets/app-0123abcd.js", b"export const plain = 1;");
    write("assets/app-0123abcd.js.br", b"not really brotli");
    write("assets/app-0123abcd.js.gz", b"not really gzip");
}
