//! A server in the test's process, accessed over HTTP.

use crate::behind::new_postgres_database;
use crate::process::binary;
use crate::{Address, Answer};
use reqwest::Method;
use sidestep::api::routes;
use sidestep_server::commands::analysis_args::AnalysisArgs;
use sidestep_server::commands::keeping_args::KeepingArgs;
use sidestep_server::commands::serve::{LogFormat, Running, ServeArgs, start};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// A short study with five scenes.
pub const SHORT_STUDY: &str = r#"
title = "Short"
phases = [
  { phase = "familiarisation", scenes = 1, show_danger_zone = true },
  { phase = "practice", scenes = 1 },
  { phase = "task", scenes = 3 },
]
"#;

/// A study with a robot that turns more slowly than the human, so the games have no closed form.
/// Human and robot have the same speed, so neither can catch the other from every state.
pub const UNEQUAL_STUDY: &str = r#"
title = "Unequal"
phases = [{ phase = "task", scenes = 7 }]
[parameters.robot]
turn_rate_radps = 0.35
"#;

/// A running server with its own temporary folder.
pub struct Server {
    /// The experimenter's key.
    pub key: String,
    address: Address,
    folder: TempDir,
    args: ServeArgs,
    running: Running,
}

/// A stopped server. It keeps its folder and its address.
pub struct Stopped {
    folder: TempDir,
    args: ServeArgs,
    key: String,
}

impl Deref for Server {
    type Target = Address;

    fn deref(&self) -> &Address {
        &self.address
    }
}

impl Server {
    /// Starts a server with the paper's study.
    pub async fn start() -> Self {
        Self::with_study("").await
    }

    /// Starts a server with a study file based on the paper's study, and with a site of placeholder
    /// files.
    pub async fn with_study(study: &str) -> Self {
        Self::with_study_and(study, |_| ()).await
    }

    /// Like [`Self::with_study`], but with changed arguments.
    pub async fn with_study_and(study: &str, change: fn(&mut ServeArgs)) -> Self {
        let folder = TempDir::new().expect("a folder");
        let site = folder.path().join("site");
        write_site(&site);
        Self::first(folder, study, site, change).await
    }

    /// Like [`Self::with_study`], but in a given folder.
    pub async fn within(folder: TempDir, study: &str) -> Self {
        let site = folder.path().join("site");
        write_site(&site);
        Self::first(folder, study, site, |_| ()).await
    }

    /// Starts a server with a study file based on the paper's study, and with the real site, which
    /// is beside the `sidestep` command.
    pub async fn with_client(study: &str) -> Self {
        Self::with_client_and(study, |_| ()).await
    }

    /// Like [`Self::with_client`], but with changed arguments.
    pub async fn with_client_and(study: &str, change: fn(&mut ServeArgs)) -> Self {
        let site = binary().with_file_name("site");
        Self::first(TempDir::new().expect("a folder"), study, site, change).await
    }

    /// Like [`Self::with_study`], but with language files in a folder.
    pub async fn with_files(study: &str, languages: &Path) -> Self {
        let folder = TempDir::new().expect("a folder");
        let site = folder.path().join("site");
        write_site(&site);
        let mut args = arguments(folder.path(), study, site).await;
        args.languages = Some(languages.to_owned());
        Stopped { folder, args, key: String::new() }.start_with(None, |_| ()).await
    }

    /// Like [`Self::with_study`], but on a copy of a database file.
    pub async fn with_database(study: &str, database: &Path) -> Self {
        let folder = TempDir::new().expect("a folder");
        let site = folder.path().join("site");
        write_site(&site);
        std::fs::copy(database, folder.path().join("sidestep.db")).expect("a copy");
        Self::on_file(folder, study, site, |_| ()).await
    }

    /// Like [`Self::with_study`], but always on a SQLite file. For tests of faults that only files
    /// have.
    pub async fn on_a_file(study: &str) -> Self {
        let folder = TempDir::new().expect("a folder");
        let site = folder.path().join("site");
        write_site(&site);
        Self::on_file(folder, study, site, |_| ()).await
    }

    /// Starts a server on the database at this address, with a study file if given.
    pub async fn on(database: String, study: Option<&str>) -> Self {
        let folder = TempDir::new().expect("a folder");
        let site = folder.path().join("site");
        write_site(&site);
        let mut args = arguments(folder.path(), study.unwrap_or_default(), site).await;
        args.database = database;
        args.study = args.study.filter(|_| study.is_some());
        Stopped { folder, args, key: String::new() }.start_with(None, |_| ()).await
    }

    /// Starts another server on the same database.
    pub async fn beside(&self) -> Self {
        let folder = TempDir::new().expect("a folder");
        let site = folder.path().join("site");
        write_site(&site);
        let mut args = ServeArgs { site: Some(site), study: None, ..self.args.clone() };
        args.listen = "127.0.0.1:0".to_owned();
        Stopped { folder, args, key: self.key.clone() }.start_with(None, |_| ()).await
    }

    async fn on_file(
        folder: TempDir,
        study: &str,
        site: PathBuf,
        change: fn(&mut ServeArgs),
    ) -> Self {
        let args = ServeArgs {
            database: file_in(folder.path()),
            ..arguments(folder.path(), study, site).await
        };
        Self::for_the_first_time(folder, args, change).await
    }

    async fn first(
        folder: TempDir,
        study: &str,
        site: PathBuf,
        change: fn(&mut ServeArgs),
    ) -> Self {
        let args = arguments(folder.path(), study, site).await;
        Self::for_the_first_time(folder, args, change).await
    }

    async fn for_the_first_time(
        folder: TempDir,
        args: ServeArgs,
        change: fn(&mut ServeArgs),
    ) -> Self {
        let server = Stopped { folder, args, key: String::new() }.start_with(None, change).await;
        assert!(server.running.new_key.is_some(), "a key at the first start");
        server
    }

    /// Stops the server.
    pub async fn stop(self) -> Stopped {
        let mut args = self.args;
        args.listen = self.running.address.to_string();
        let ended = self.running.stop().await;
        assert!(ended.is_ok(), "{ended:?}");
        Stopped { folder: self.folder, args, key: self.key }
    }

    /// Stops the server and restarts it on the same database at the same address.
    pub async fn restarted(self) -> Self {
        self.stop().await.start().await
    }

    /// Like [`Self::restarted`], but with a key from the environment or with changed arguments.
    pub async fn restarted_with(self, key: Option<&str>, change: fn(&mut ServeArgs)) -> Self {
        self.stop().await.start_with(key, change).await
    }

    /// Stops the server and restarts it with another study file, which replaces a study with the
    /// same slug.
    pub async fn restarted_with_study(self, study: &str) -> Self {
        let stopped = self.stop().await;
        stopped.write_study(study);
        stopped.start_with(None, |args| args.replace_study = true).await
    }

    /// The text that the server printed when it was ready.
    #[must_use]
    pub fn announcement(&self) -> String {
        self.running.announcement()
    }

    /// The address of the database, for commands.
    #[must_use]
    pub fn database(&self) -> String {
        self.args.database.clone()
    }

    /// A path in the server's folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Sends a `GET` request with the experimenter's key, and returns the answer.
    pub async fn admin(&self, route: &str) -> Answer {
        let request = self.request(Method::GET, route).bearer_auth(&self.key);
        Answer::of(request).await
    }

    /// The export of a study.
    ///
    /// # Panics
    /// If the server does not return it.
    pub async fn export(&self, slug: &str) -> String {
        self.admin_text(&routes::exports(slug)).await
    }

    /// Fetches a text file with the experimenter's key.
    ///
    /// # Panics
    /// If the server does not return it.
    pub async fn admin_text(&self, route: &str) -> String {
        let request = self.request(Method::GET, route);
        let response = request.bearer_auth(&self.key).send().await.expect("an answer");
        assert_eq!(response.status(), 200);
        response.text().await.expect("a file")
    }
}

impl Stopped {
    /// A path in the server's folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes another study file.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn write_study(&self, study: &str) {
        std::fs::write(self.path("study.toml"), with_slug(study)).expect("a study file");
    }

    /// Restarts the server at its previous address.
    ///
    /// # Panics
    /// If it prints a new key.
    pub async fn start(self) -> Server {
        let server = self.start_with(None, |_| ()).await;
        assert_eq!(server.running.new_key, None, "the key is shown once");
        server
    }

    /// Like [`Self::start`], but with a key from the environment or with changed arguments.
    ///
    /// # Panics
    /// If the server does not start, for example because the client has not been built.
    pub async fn start_with(
        mut self,
        key: Option<&str>,
        change: impl FnOnce(&mut ServeArgs),
    ) -> Server {
        change(&mut self.args);
        let running = start(&self.args, key).await.expect("a server");
        self.args.new_admin_key = false;
        let given = key.map(str::to_owned);
        Server {
            address: Address::new(format!("http://{}", running.address)),
            key: running.new_key.clone().or(given).unwrap_or(self.key),
            folder: self.folder,
            args: self.args,
            running,
        }
    }
}

/// The arguments of a server in `folder`, with this study file. Its slug is `default` unless the
/// file has one.
async fn arguments(folder: &Path, study: &str, site: PathBuf) -> ServeArgs {
    let file = folder.join("study.toml");
    std::fs::write(&file, with_slug(study)).expect("a study file");
    ServeArgs {
        demo: false,
        listen: "127.0.0.1:0".to_owned(),
        database: new_postgres_database().await.unwrap_or_else(|| file_in(folder)),
        study: Some(file),
        replace_study: false,
        languages: None,
        site: Some(site),
        new_admin_key: false,
        no_solve: false,
        open_demo: true,
        tls_cert: None,
        tls_key: None,
        trusted_proxy: Vec::new(),
        allowed_host: Vec::new(),
        keeping: KeepingArgs {
            backups: None,
            backups_kept: 14,
            check_every: 0.0,
            first: Duration::ZERO,
        },
        log_format: LogFormat::Text,
        analysis: AnalysisArgs {
            threads: None,
            memory_mib: 2048,
            hours: 24.0,
            program: Some(binary().to_owned()),
            // The default lowers the priority of analyses. Here, tests wait for analyses while
            // other tests occupy all processors.
            nice: 0,
        },
    }
}

/// A study file with a slug. Adds the slug `default` if the file has none.
#[must_use]
pub fn with_slug(study: &str) -> String {
    let has_one = study.lines().any(|line| line.starts_with("slug"));
    if has_one { study.to_owned() } else { format!("slug = \"default\"\n{study}") }
}

/// The address of the SQLite database in a folder.
fn file_in(folder: &Path) -> String {
    format!("sqlite:{}", folder.join("sidestep.db").display())
}

/// Writes a client bundle of placeholder files.
///
/// # Panics
/// If it cannot be written.
pub fn write_site(folder: &Path) {
    std::fs::create_dir_all(folder.join("assets")).expect("a folder");
    let write = |name: &str, text: &[u8]| {
        std::fs::write(folder.join(name), text).expect("a file of the site");
    };
    let pages = [
        "index",
        "participant",
        "participant_robots",
        "lab",
        "viewer",
        "reachability",
        "demo",
        "docs",
    ];
    for page in pages {
        let place = match page {
            "index" => "<!-- The server puts the open studies here. -->",
            _ => "<!-- The server puts the document here. -->",
        };
        let text = format!("<!doctype html><title>{page}</title>{place}");
        write(&format!("{page}.html"), text.as_bytes());
    }
    write("assets/app-0123abcd.js", b"export const plain = 1;");
    write("assets/app-0123abcd.js.br", b"not really brotli");
    write("assets/app-0123abcd.js.gz", b"not really gzip");
}
