//! `sidestep serve`.

mod studies;

use self::studies::{of_people, prepare};
use super::analysis_args::AnalysisArgs;
use super::demo::{self, Demo};
use super::keeping_args::KeepingArgs;
use super::{CommandError, print_line};
use crate::http::app::App;
use crate::http::bounded::{Bounded, TakingTurns};
use crate::http::connections::{Connections, Limits};
use crate::http::experimenters::first_key;
use crate::http::hosts::Hosts;
use crate::http::layers::router;
use crate::http::listen;
use crate::http::pace::{Guesses, Pace};
use crate::http::peer::Proxies;
use crate::http::site::{Site, default_folder};
use crate::http::tls::Certificates;
use crate::jobs::analysis::worker::AnalysisWorker;
use crate::jobs::keeper::{Keeper, Keeping};
use crate::jobs::safety::Solver;
use crate::languages::Languages;
use crate::languages::library::Library;
use crate::metrics::Metrics;
use crate::store::{Purpose, Store};
use crate::support::secrets::chosen::ChosenKey;
use ipnet::IpNet;
use sidestep::api::DataCheck;
use std::fmt::Write;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{Notify, oneshot, watch};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Serve participants and the laboratory.
///
/// Needs only a database file, which the first start creates. The first start also prints the
/// experimenter's key, only once. To choose the key yourself, set SIDESTEP_ADMIN_KEY to it (at
/// least 16 characters) or to its hash from `sidestep hash-key`.
#[derive(Clone, Debug, clap::Args)]
pub struct ServeArgs {
    /// Address and port; port 0 takes any free port.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    pub listen: String,
    /// Database: sqlite:FILE, created if it does not exist, or postgres://USER@HOST/DATABASE.
    ///
    /// Several servers may share a PostgreSQL database. With --demo, the default is
    /// sqlite:sidestep-demo.db, so that demonstration data never mix with yours.
    #[arg(
        long,
        value_name = "URL",
        default_value = "sqlite:sidestep.db",
        default_value_if("demo", "true", "sqlite:sidestep-demo.db")
    )]
    pub database: String,
    /// Fill the study `demo` with synthetic participants and analyse it, in less than a minute.
    ///
    /// The server answers requests meanwhile. The study is marked as synthetic everywhere and
    /// accepts no people. A restart resumes an interrupted fill; otherwise it changes nothing.
    #[arg(long, conflicts_with = "study")]
    pub demo: bool,
    /// Study file (TOML), with at least a slug; omitted fields take the paper's values.
    ///
    /// By default, the server has the studies in its database. If the database is empty, the server
    /// creates the study `default` with the paper's protocol.
    #[arg(long, value_name = "FILE")]
    pub study: Option<PathBuf>,
    /// Accept a study file that differs from the study with this slug in the database.
    ///
    /// New participants get the file's configuration; existing participants keep theirs.
    #[arg(long, requires = "study")]
    pub replace_study: bool,
    /// Folder with language files for the participant's page; see `sidestep languages`.
    ///
    /// Files are named after their languages (de.toml). They replace sentences or add languages.
    #[arg(long, value_name = "DIR")]
    pub languages: Option<PathBuf>,
    /// Folder with the built client [default: `site` beside the executable].
    #[arg(long = "static", value_name = "DIR")]
    pub site: Option<PathBuf>,
    /// Create a new experimenter's key. The old key and all sessions become invalid.
    #[arg(long)]
    pub new_admin_key: bool,
    /// Solve no value functions on the server.
    ///
    /// For unequal vehicles, browsers then solve them at each replay, and predictors fall back to
    /// input frequencies.
    #[arg(long)]
    pub no_solve: bool,
    /// Let everyone drive the demonstration at /demo. Experimenters can always drive it at /lab/demo.
    #[arg(long)]
    pub open_demo: bool,
    /// Serve HTTPS with this certificate chain (PEM), the server's certificate first.
    ///
    /// When the file changes, new connections get the new certificate. On Unix, SIGHUP reloads it at once.
    #[arg(long, value_name = "FILE", requires = "tls_key", conflicts_with = "demo")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of the certificate (PEM), without a password.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// Trusted proxies, by address or network, such as 10.0.0.0/8 [default: none].
    ///
    /// Their X-Forwarded-For (or Forwarded) and X-Forwarded-Proto headers set the client address
    /// and scheme of a request. From other clients, the server ignores these headers.
    #[arg(long, value_name = "ADDRESS", num_args = 1.., value_parser = net)]
    pub trusted_proxy: Vec<IpNet>,
    /// Further host names of this server, such as study.example.org. Requests for any other host
    /// get status 421.
    ///
    /// Loopback names and the listening address are always accepted. By default, the server accepts
    /// no other names if it listens on a loopback address and has no --trusted-proxy. Otherwise it
    /// accepts all names.
    #[arg(long, value_name = "NAME", num_args = 1.., value_parser = host)]
    pub allowed_host: Vec<String>,
    /// Backups and checks of the stored data.
    #[command(flatten)]
    pub keeping: KeepingArgs,
    /// Format of the log on stderr.
    ///
    /// Each entry about a request has the request's id, which the response also has (X-Request-Id).
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
    /// Resource limits of analyses.
    #[command(flatten)]
    pub analysis: AnalysisArgs,
}

/// Format of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines of text.
    Text,
    /// A JSON object on each line.
    Json,
}

/// Maximum number of enrolments that wait for their scenes. This is twice the number of seats in a
/// large lecture hall.
const PLANS_WAITING: usize = 2_000;

/// The pause after drawing the scenes of an enrolment, as a multiple of the drawing time.
const DRAWING_PAUSE: u32 = 2;

/// Upper bound on the number of connections, if the system allows the process to open enough files.
const MOST_CONNECTIONS: u64 = 50_000;

/// Open files reserved for everything except connections, such as the database, the site and analyses.
const FILES_KEPT: u64 = 256;

/// Maximum number of open site files. A file stays open until the client has read it.
const SITE_FILES: u64 = 4_096;

/// Maximum total size of incomplete request bodies (bytes).
const BODY_BYTES: usize = 64 << 20;

/// A server that accepts requests.
#[derive(Debug)]
pub struct Running {
    /// The listening address, with the actual port.
    pub address: SocketAddr,
    /// Names of the studies for real participants, without synthetic studies. `/start` redirects to
    /// the first one.
    pub studies: Vec<String>,
    /// The experimenter's key, if this start created it.
    pub new_key: Option<String>,
    store: Store,
    solver: Option<Solver>,
    analysis_worker: AnalysisWorker,
    keeper: Keeper,
    demo: Option<Demo>,
    /// Whether the demonstration is being filled.
    fills_demo: bool,
    stop: oneshot::Sender<()>,
    task: JoinHandle<()>,
    /// The task that renews the certificate, if there is a certificate.
    renewal: Option<JoinHandle<()>>,
}

/// Runs until SIGINT or SIGTERM.
///
/// # Errors
/// [`CommandError`] if the server cannot start.
pub async fn run(args: ServeArgs) -> Result<(), CommandError> {
    let key = std::env::var("SIDESTEP_ADMIN_KEY").ok();
    let signal = stop_signal()?;
    let running = start(&args, key.as_deref()).await?;
    running.store.rescue_elsewhere();
    print_line(&running.announcement())?;
    signal.await;
    tracing::info!("stopping");
    running.stop().await
}

/// Starts a server and returns once it accepts requests.
///
/// # Errors
/// [`CommandError`] for a bad study file or key (input), a missing bundle, an
/// unusable database or a port in use (failure).
pub async fn start(args: &ServeArgs, key: Option<&str>) -> Result<Running, CommandError> {
    let environment_key = key
        .map(ChosenKey::of)
        .transpose()
        .map_err(|why| CommandError::Input(format!("SIDESTEP_ADMIN_KEY: {why}")))?;
    let certificates = match (&args.tls_cert, &args.tls_key) {
        (Some(certificate), Some(key)) => Some(Certificates::open(certificate, key)),
        _ => None,
    };
    let certificates = certificates.transpose().map_err(CommandError::Input)?.map(Arc::new);
    if environment_key.is_some() && args.new_admin_key {
        let message = "--new-admin-key: expected no SIDESTEP_ADMIN_KEY beside it, found one; \
                       unset it to use the new key";
        return Err(CommandError::Input(message.to_owned()));
    }
    let keeping = args.keeping.keeping(&args.database)?;
    let languages = Languages::load(args.languages.as_deref()).map_err(CommandError::Input)?;
    let given = args.study.as_deref().map(|path| languages.read_study(path)).transpose();
    let given = given.map_err(CommandError::Input)?;
    let folder = args.site.clone().unwrap_or_else(default_folder);
    let no_site = |why| match &args.site {
        Some(folder) => CommandError::Input(format!("--static {}: {why}", folder.display())),
        None => CommandError::Failure(why),
    };
    let site = Site::open(&folder).map_err(no_site)?.with_demo(args.open_demo);
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

    let store = Store::open(&args.database, Purpose::Alone).await?;
    let fills_demo = args.demo && demo::prepare(&store, &args.database).await?;
    let names = prepare(&store, given.as_ref(), args.replace_study).await?;
    let studies = of_people(&store, &names).await?;
    let new_key = match &environment_key {
        Some(_) => None,
        None => first_key(&store, args.new_admin_key).await.map_err(CommandError::failure)?,
    };
    // No people take part in a demonstration, so no processor is reserved for them.
    let children = args.analysis.children(args.demo);
    let analysis_limits = args.analysis.limits(&children);
    let kept_by = children.clone();
    let analysis_asked = Arc::new(Notify::new());
    let study_stored = Arc::new(Notify::new());
    let stopping = CancellationToken::new();
    let all = most_connections();
    let limits = Limits { all, each: (all / 4).max(1), body_bytes: BODY_BYTES };
    let connections = Arc::new(Connections::new(limits));
    let (found, checked) = watch::channel(DataCheck::default());
    let app = Arc::new(App {
        store: store.clone(),
        default_study: studies.first().unwrap_or(&names[0]).clone(),
        library: Library::new(languages),
        environment_key,
        pace: Pace::new(&store),
        guesses: Guesses::new(&store),
        drawing: Bounded::new(PLANS_WAITING).with_pauses(DRAWING_PAUSE),
        hashing: TakingTurns::default(),
        metrics: Metrics::new(&store),
        connections: Arc::clone(&connections),
        analysis_asked: Arc::clone(&analysis_asked),
        analysis_limits,
        study_stored: Arc::clone(&study_stored),
        self_check: tokio::sync::OnceCell::new(),
        data_check: checked,
        writes_backups: keeping.backups.is_some(),
        lengths: Arc::default(),
        stopping: stopping.clone(),
    });
    let (stop, stopped) = oneshot::channel::<()>();
    let proxies = Proxies::new(args.trusted_proxy.clone());
    let hosts = Hosts::new(&args.allowed_host, address.ip(), &proxies);
    let service = listen::Service {
        router: router(app, &site, hosts),
        proxies: Arc::new(proxies),
        certificates: certificates.clone(),
        connections,
    };
    let renewal = certificates.map(renewal).transpose()?;
    let task = tokio::spawn(listen::serve(listener, service, async move {
        // Dropping the sender also stops the server.
        let _ = stopped.await;
        stopping.cancel();
    }));
    let solver =
        (!args.no_solve).then(|| Solver::start(store.clone(), study_stored, children.clone()));
    let asked = Arc::clone(&analysis_asked);
    let analysis_worker = AnalysisWorker::start(store.clone(), asked, children, analysis_limits);
    let keeping = Keeping { code: store.code().await?, ..keeping };
    let keeper = Keeper::start(keeping, kept_by, found);
    let demo =
        args.demo.then(|| Demo::start(store.clone(), address, analysis_asked, new_key.clone()));
    tracing::info!(%address, study = names[0], "serving");
    Ok(Running {
        address,
        studies,
        new_key,
        store,
        solver,
        analysis_worker,
        keeper,
        demo,
        fills_demo,
        stop,
        task,
        renewal,
    })
}

impl Running {
    /// The scheme and the address.
    #[must_use]
    pub fn origin(&self) -> String {
        let scheme = if self.renewal.is_some() { "https" } else { "http" };
        format!("{scheme}://{}", self.address)
    }

    /// The message when the server is ready.
    #[must_use]
    pub fn announcement(&self) -> String {
        let address = self.address;
        let origin = self.origin();
        let mut text = "Sidestep is ready.".to_owned();
        for study in &self.studies {
            let _ = write!(text, "\n  participants  {origin}/s/{study}");
        }
        let _ = write!(text, "\n  laboratory    {origin}/lab");
        if let Some(key) = &self.new_key {
            let _ = write!(
                text,
                "\n  sign in with  {origin}/lab#key={key}\n\
                 The key is shown at this start only: keep the link, or make another key with --new-admin-key."
            );
        }
        if self.fills_demo {
            let _ = write!(text, "\n{}", demo::announcement(address));
        }
        text
    }

    /// Stops the server. Requests in progress are finished, and then the database is closed.
    ///
    /// # Errors
    /// [`CommandError::Failure`] if another program changed the database file and its content could
    /// not be written to another file.
    pub async fn stop(self) -> Result<(), CommandError> {
        if let Some(demo) = self.demo {
            demo.stop().await;
        }
        let _ = self.stop.send(());
        if let Some(renewal) = self.renewal {
            renewal.abort();
        }
        if let Some(solver) = self.solver {
            solver.stop().await;
        }
        self.analysis_worker.stop().await;
        self.keeper.stop().await;
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the server failed");
        }
        self.store.close().await;
        match self.store.unrescued() {
            None => Ok(()),
            Some(error) => Err(CommandError::Failure(format!(
                "{}: {error}; its content could not be written to another file: see the log, and keep the rest of the file and \
                 its -wal",
                self.store.name()
            ))),
        }
    }
}

/// Parses a network. A single address counts as a network.
fn net(text: &str) -> Result<IpNet, String> {
    let address = |text: &str| text.parse::<IpAddr>().ok().map(IpNet::from);
    let found = text.parse().ok().or_else(|| address(text));
    found.ok_or_else(|| {
        "expected an address or a network, such as 127.0.0.1 or 10.0.0.0/8".to_owned()
    })
}

/// A host name, without a port.
fn host(text: &str) -> Result<String, String> {
    let is_address = text.parse::<IpAddr>().is_ok();
    let fits = |c: char| c.is_ascii_alphanumeric() || "-.".contains(c);
    match is_address || !text.is_empty() && text.chars().all(fits) {
        true => Ok(text.to_owned()),
        false => Err("expected the name of a host, such as study.example.org".to_owned()),
    }
}

/// The maximum number of connections: the limit on open files minus the files reserved for
/// everything else. Raises the process's limit as far as the system allows.
#[cfg(unix)]
fn most_connections() -> usize {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    let raised = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum });
    if let Err(error) = raised {
        tracing::warn!(%error, "the limit of open files was not raised");
    }
    let files = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    let kept = FILES_KEPT.min(files / 2);
    let rest = files - kept;
    let connections = rest - SITE_FILES.min(rest / 2);
    usize::try_from(connections.min(MOST_CONNECTIONS)).unwrap_or(usize::MAX)
}

#[cfg(not(unix))]
fn most_connections() -> usize {
    (MOST_CONNECTIONS / 10) as usize
}

/// Reloads the certificate when its files change, and on SIGHUP.
#[cfg(unix)]
fn renewal(certificates: Arc<Certificates>) -> Result<JoinHandle<()>, CommandError> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut hangup = signal(SignalKind::hangup()).map_err(CommandError::failure)?;
    Ok(tokio::spawn(async move {
        let asked = Notify::new();
        let signals = async {
            while hangup.recv().await.is_some() {
                asked.notify_one();
            }
        };
        tokio::join!(signals, certificates.renew(&asked));
    }))
}

/// Reloads the certificate when its files change.
#[cfg(not(unix))]
fn renewal(certificates: Arc<Certificates>) -> Result<JoinHandle<()>, CommandError> {
    Ok(tokio::spawn(async move { certificates.renew(&Notify::new()).await }))
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
