//! The alternative to Sidestep: oTree on SQLite. Its participants submit pages with a field of 4
//! KB.

use std::cell::Cell;
use std::fs;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::Stdio;
use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::Value;
use sidestep_server::client::http;
use sidestep_tests::Folder;
use sidestep_tests::load::figures::row;
use sidestep_tests::load::{Latencies, http::Connection};
use tokio::process::{Child, Command};
use tokio::task::JoinSet;
use tokio_rustls::rustls::RootCertStore;

/// Environment variable with the path of the command `otree`, which `cargo xtask bench` installs.
const COMMAND: &str = "SIDESTEP_OTREE";

const SETTINGS: &str = "
SESSION_CONFIGS = [dict(name='store', app_sequence=['store'], num_demo_participants=1)]
SESSION_CONFIG_DEFAULTS = dict(real_world_currency_per_point=1.0, participation_fee=0.0, doc='')
PARTICIPANT_FIELDS = []
SESSION_FIELDS = []
LANGUAGE_CODE = 'en'
REAL_WORLD_CURRENCY_CODE = 'USD'
USE_POINTS = True
ADMIN_USERNAME = 'admin'
ADMIN_PASSWORD = 'of a benchmark'
SECRET_KEY = 'of a benchmark'
";

const APP: &str = "
from otree.api import *

class C(BaseConstants):
    NAME_IN_URL = 'store'
    PLAYERS_PER_GROUP = None
    NUM_ROUNDS = ROUNDS

class Subsession(BaseSubsession):
    pass

class Group(BaseGroup):
    pass

class Player(BasePlayer):
    data = models.LongStringField()

class Store(Page):
    form_model = 'player'
    form_fields = ['data']

page_sequence = [Store]
";

const PAGE: &str = "{{ block content }}{{ formfields }}{{ next_button }}{{ endblock }}\n";

/// Pages per participant. oTree creates all rows of a session when the session starts, so more
/// pages make the start slower.
const ROUNDS: usize = 60;

/// Measures the submissions per second over this number of connections. Returns `None` if oTree is
/// not available.
pub(crate) async fn measure(folder: &Folder, connections: usize, seconds: f64) -> Option<f64> {
    let Some(command) = std::env::var_os(COMMAND).map(PathBuf::from) else {
        row("oTree", "not measured", "it could not be installed from PyPI");
        return None;
    };
    let server = match Server::start(folder, command).await {
        Ok(server) => server,
        Err(error) => {
            row("oTree", "not measured", format!("it did not start: {error}"));
            return None;
        }
    };
    match server.submissions(connections, seconds).await {
        Ok((per_s, latencies)) => {
            row(&format!("oTree, {connections} connections"), format!("{per_s:.0}/s"), latencies);
            Some(per_s)
        }
        Err(error) => {
            row("oTree", "not measured", error);
            None
        }
    }
}

/// A running oTree server. Dropping it stops the server.
struct Server {
    address: SocketAddr,
    _child: Child,
}

impl Server {
    async fn start(folder: &Folder, command: PathBuf) -> io::Result<Self> {
        let project = folder.path("otree");
        for made in ["store", "_static", "_templates"] {
            fs::create_dir_all(project.join(made))?;
        }
        fs::write(project.join("settings.py"), SETTINGS)?;
        let app = APP.replace("ROUNDS = ROUNDS", &format!("ROUNDS = {ROUNDS}"));
        fs::write(project.join("store/__init__.py"), app)?;
        fs::write(project.join("store/Store.html"), PAGE)?;
        let address = TcpListener::bind("127.0.0.1:0")?.local_addr()?;
        // oTree restarts itself by its command's name, so the command must be on the PATH.
        let beside = command.parent().map(PathBuf::from);
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let folders = beside.into_iter().chain(std::env::split_paths(&folders));
        let path = std::env::join_paths(folders).map_err(io::Error::other)?;
        let mut child = Command::new(command)
            .env("PATH", path)
            // oTree's web server in one process, as `otree prodserver` starts it.
            .args(["prodserver1of2", &address.port().to_string()])
            .current_dir(&project)
            .env("OTREE_PRODUCTION", "1")
            .env_remove("DATABASE_URL")
            .env_remove("OTREE_AUTH_LEVEL")
            .stdout(Stdio::null())
            .stderr(fs::File::create(project.join("log"))?)
            .kill_on_drop(true)
            .spawn()?;
        let limit = Instant::now() + Duration::from_secs(60);
        while tokio::net::TcpStream::connect(address).await.is_err() {
            if child.try_wait()?.is_some() || Instant::now() > limit {
                return Err(io::Error::other(fs::read_to_string(project.join("log"))?));
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        Ok(Self { address, _child: child })
    }

    /// Creates a session, and returns the codes of its participants.
    async fn session(&self, participants: usize) -> io::Result<Vec<String>> {
        let address = self.address;
        let json = async |request: reqwest::RequestBuilder| {
            let answer = request.send().await.map_err(io::Error::other)?;
            answer.json::<Value>().await.map_err(io::Error::other)
        };
        let client = http(RootCertStore::empty()).map_err(io::Error::other)?;
        let client = client.build().map_err(io::Error::other)?;
        let sessions = format!("http://{address}/api/sessions");
        let body = serde_json::json!({
            "session_config_name": "store", "num_participants": participants,
        });
        let made = json(client.post(&sessions).json(&body)).await?;
        let code = made["code"].as_str().ok_or_else(|| io::Error::other("no session"))?;
        let session = json(client.get(format!("{sessions}/{code}"))).await?;
        let codes = session["participants"].as_array().into_iter().flatten();
        Ok(codes.filter_map(|one| one["code"].as_str().map(str::to_owned)).collect())
    }

    /// Submits pages over this number of connections for `seconds` s. Returns the submissions per
    /// second and their latencies.
    async fn submissions(&self, connections: usize, seconds: f64) -> io::Result<(f64, Latencies)> {
        // Enough participants for 400 submissions per second.
        let participants = (400.0 * seconds / ROUNDS as f64) as usize + connections;
        let mut codes = self.session(participants).await?;
        let form = Rc::new([b"data=", &[b'x'; 4_096][..]].concat());
        let (count, latencies) = (Rc::new(Cell::new(0_u32)), Rc::default());
        let begin = Instant::now();
        let end = begin + Duration::from_secs_f64(seconds);
        let mut tasks = JoinSet::new();
        for _ in 0..connections {
            let own = codes.split_off(codes.len() - participants / connections);
            let (form, count) = (Rc::clone(&form), Rc::clone(&count));
            let latencies: Rc<std::cell::RefCell<Latencies>> = Rc::clone(&latencies);
            let address = self.address;
            tasks.spawn_local(async move {
                let mut connection = Connection::open(address, None).await?;
                for code in own {
                    // A request for this link starts the participation.
                    let begun = format!("/InitializeParticipant/{code}");
                    connection.send("GET", &begun, None, b"").await?;
                    for page in 1..=ROUNDS {
                        let due = Instant::now();
                        if due > end {
                            return Ok(());
                        }
                        let route = format!("/p/{code}/store/Store/{page}");
                        let status = connection.post_form(&route, &form).await?.status;
                        if status != 302 {
                            return Err(io::Error::other(format!("a page was answered {status}")));
                        }
                        latencies.borrow_mut().note(due.elapsed());
                        count.set(count.get() + 1);
                    }
                }
                Ok(())
            });
        }
        while let Some(task) = tasks.join_next().await {
            task.map_err(io::Error::other)??;
        }
        Ok((f64::from(count.get()) / begin.elapsed().as_secs_f64(), latencies.take()))
    }
}
