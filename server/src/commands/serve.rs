//! `sidestep serve`.

use super::{CommandError, print_line};
use crate::clock::now_ms;
use crate::formats::study_toml::read_study;
use crate::http::answers::Answers;
use crate::http::app::App;
use crate::http::auth::first_key;
use crate::http::bounded::Bounded;
use crate::http::listen;
use crate::http::routes::router;
use crate::http::site::{Site, default_folder};
use crate::http::throttle::Throttle;
use crate::jobs::analysis_worker::AnalysisWorker;
use crate::jobs::safety;
use crate::jobs::safety::Solver;
use crate::secrets;
use crate::store::{Missing, Store};
use sidestep::study::StudyConfig;
use std::fmt::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{Notify, oneshot};
use tokio::task::JoinHandle;

/// Serve participants and the laboratory.
///
/// Needs only a database file, which the first start creates. The first start also prints
/// the experimenter's key, once. If SIDESTEP_ADMIN_KEY is set (at least 16 characters), that
/// key is valid instead.
#[derive(Clone, Debug, clap::Args)]
pub struct ServeArgs {
    /// Address and port; port 0 takes any free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    pub listen: String,
    /// Database: sqlite: followed by a file, which is created if it does not exist.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
    /// Study file, TOML; missing fields take the paper's values [default: the study
    /// `default`, the paper's protocol].
    #[arg(long, value_name = "FILE")]
    pub study: Option<PathBuf>,
    /// Folder with the built client [default: `site` beside the executable].
    #[arg(long = "static", value_name = "DIR")]
    pub site: Option<PathBuf>,
    /// Create a new experimenter's key; the old key and all sessions become invalid.
    #[arg(long)]
    pub new_admin_key: bool,
    /// Solve no value functions on the server. For unequal vehicles, browsers then solve
    /// them at each replay, and predictors fall back to input frequencies.
    #[arg(long)]
    pub no_solve: bool,
    /// Threads for analyses [default: all processors but one, at least one].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub analysis_threads: Option<u16>,
}

/// Enrolments that may wait for their scenes: a lecture hall, twice over.
const PLANS_WAITING: usize = 2_000;

/// A server that accepts requests.
#[derive(Debug)]
pub struct Running {
    /// Where, with the real port.
    pub address: SocketAddr,
    /// The study that `/start` leads to.
    pub study: String,
    /// The experimenter's key, if it was made just now.
    pub new_key: Option<String>,
    store: Store,
    solver: Option<Solver>,
    analysis_worker: AnalysisWorker,
    stop: oneshot::Sender<()>,
    task: JoinHandle<()>,
}

/// Runs until SIGINT or SIGTERM.
///
/// # Errors
/// [`CommandError`] if it cannot start.
pub async fn run(args: ServeArgs) -> Result<(), CommandError> {
    let key = std::env::var("SIDESTEP_ADMIN_KEY").ok();
    let signal = stop_signal()?;
    let running = start(&args, key.as_deref()).await?;
    print_line(&running.announcement())?;
    signal.await;
    tracing::info!("stopping");
    running.stop().await;
    Ok(())
}

/// Starts a server and returns when it accepts requests.
///
/// # Errors
/// [`CommandError`] for a bad study file or key (input), a missing bundle, an
/// unusable database or a port in use (failure).
pub async fn start(args: &ServeArgs, key: Option<&str>) -> Result<Running, CommandError> {
    let environment_key = key.map(checked_key).transpose()?;
    if environment_key.is_some() && args.new_admin_key {
        let message = "--new-admin-key: expected no SIDESTEP_ADMIN_KEY beside it, found one; \
                       unset it to use a key that is made";
        return Err(CommandError::Input(message.to_owned()));
    }
    let given = args.study.as_deref().map(read_study).transpose();
    let given = given.map_err(CommandError::Input)?;
    let folder = args.site.clone().unwrap_or_else(default_folder);
    let site = Site::open(&folder).map_err(CommandError::Failure)?;
    let listener = TcpListener::bind(&args.listen).await.map_err(|error| {
        let listen = &args.listen;
        if error.kind() == std::io::ErrorKind::InvalidInput {
            let expected = "an address and a port, such as 127.0.0.1:8080";
            return CommandError::Input(format!("--listen: expected {expected}, found {listen}"));
        }
        let message = format!("--listen {listen}: {error}; choose another address or port");
        CommandError::Failure(message)
    })?;
    let address = listener.local_addr().map_err(CommandError::failure)?;

    let store = Store::open(&args.database, Missing::Create).await?;
    store.serve_alone()?;
    let study = prepare(&store, given).await?;
    let new_key = match environment_key {
        Some(_) => None,
        None => first_key(&store, args.new_admin_key).await.map_err(CommandError::failure)?,
    };
    let analysis_asked = Arc::new(Notify::new());
    let app = Arc::new(App {
        store: store.clone(),
        default_study: study.clone(),
        environment_key,
        throttle: Throttle::default(),
        drawing: Bounded::new(PLANS_WAITING),
        answers: Answers::default(),
        analysis_asked: Arc::clone(&analysis_asked),
        self_check: tokio::sync::OnceCell::new(),
    });
    let (stop, stopped) = oneshot::channel::<()>();
    let router = router(app, &site);
    let task = tokio::spawn(listen::serve(listener, router, async {
        // A dropped sender means the same as a sent stop.
        let _ = stopped.await;
    }));
    let solver = (!args.no_solve).then(|| Solver::start(store.clone()));
    let analysis_worker =
        AnalysisWorker::start(store.clone(), analysis_asked, args.analysis_threads);
    tracing::info!(%address, study, "serving");
    Ok(Running { address, study, new_key, store, solver, analysis_worker, stop, task })
}

impl Running {
    /// What the command prints when the server is ready.
    #[must_use]
    pub fn announcement(&self) -> String {
        let (address, study) = (self.address, &self.study);
        let mut text = format!(
            "Sidestep is ready.\n  participants  http://{address}/s/{study}\n  \
             laboratory    http://{address}/lab"
        );
        if let Some(key) = &self.new_key {
            let _ = write!(
                text,
                "\n  sign in with  http://{address}/lab#key={key}\n\
                 The key is shown this once: keep the link, or make another key with --new-admin-key."
            );
        }
        text
    }

    /// Finishes requests under way, then closes the database.
    pub async fn stop(self) {
        let _ = self.stop.send(());
        if let Some(solver) = self.solver {
            solver.stop().await;
        }
        self.analysis_worker.stop().await;
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the server ended badly");
        }
        self.store.close().await;
    }
}

/// Makes or updates the study, keeps its value functions if they take no solve, and
/// returns its name.
async fn prepare(store: &Store, given: Option<StudyConfig>) -> Result<String, CommandError> {
    let config = match given {
        Some(config) => config,
        // Without a file, an existing default study stays as it was made.
        None => {
            let config = StudyConfig::default();
            let known = store.study(&config.slug).await?;
            known.map_or(config, |study| (*study.config).clone())
        }
    };
    let study = store.put_study(&config, now_ms()).await?;
    safety::keep_exact(store, &study).await?;
    Ok(study.slug)
}

fn checked_key(key: &str) -> Result<[u8; 32], CommandError> {
    const SHORTEST: usize = 16;
    let count = key.chars().count();
    if count < SHORTEST {
        let message =
            format!("SIDESTEP_ADMIN_KEY: expected {SHORTEST} characters or more, found {count}");
        return Err(CommandError::Input(message));
    }
    Ok(secrets::hash(key))
}

#[cfg(unix)]
fn stop_signal() -> Result<impl Future<Output = ()>, CommandError> {
    use tokio::signal::unix::{SignalKind, signal};
    let listen = |kind| signal(kind).map_err(CommandError::failure);
    let mut interrupt = listen(SignalKind::interrupt())?;
    let mut terminate = listen(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

#[cfg(not(unix))]
fn stop_signal() -> Result<impl Future<Output = ()>, CommandError> {
    Ok(async {
        let _ = tokio::signal::ctrl_c().await;
    })
}
