//! NGINX or HAProxy in front of two servers, with the configuration of `docs/deploy` but with free
//! ports and temporary files.
//!
//! Requires Debian's packages `nginx` and `haproxy`, which `cargo xtask test` installs.

use crate::{Address, Folder};
use rcgen::{CertificateParams, KeyPair};
use reqwest::Method;
use sidestep_server::client::http;
use std::fs::File;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};
use tokio::process::{Child, Command};
use tokio_rustls::rustls::RootCertStore;
use tokio_rustls::rustls::pki_types::CertificateDer;

/// Host name of the servers in the configuration files of `docs/deploy`.
pub const NAME: &str = "study.example.org";

/// Timeout until the proxy forwards requests.
const PATIENCE: Duration = Duration::from_secs(20);

/// Kind of proxy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// NGINX, configured by `nginx.conf`.
    Nginx,
    /// HAProxy, configured by `haproxy.cfg`.
    Haproxy,
}

/// A running proxy. Dropping it ends the proxy.
pub struct Front {
    /// The HTTPS address for participants.
    pub address: Address,
    /// The HTTP address, which redirects to the HTTPS address.
    pub plain: Address,
    kind: Kind,
    folder: Folder,
    _child: Child,
}

impl Front {
    /// Starts the proxy in front of these two servers and waits until it forwards requests.
    ///
    /// # Panics
    /// If the proxy is not installed, rejects its configuration, or does not answer.
    pub async fn start(kind: Kind, servers: [&Address; 2]) -> Self {
        let folder = Folder::default();
        let root = certificate(&folder);
        let [encrypted, plain] = [free_port(), free_port()];
        let servers = servers.map(|server| server.origin.trim_start_matches("http://"));
        let file =
            folder.file("configuration", adapted(kind, &folder, [encrypted, plain], servers));
        let mut command = match kind {
            Kind::Nginx => {
                let mut command = Command::new(program("nginx"));
                command.args(["-p", &folder.name(""), "-c", &file, "-g", "daemon off;"]);
                command
            }
            Kind::Haproxy => {
                // Allow fewer file descriptors than HAProxy's connections would need, as many
                // systems do.
                let mut command = Command::new("sh");
                command.args(["-c", "ulimit -n 20000 && exec \"$@\"", "sh"]);
                command.arg(program("haproxy")).args(["-db", "-f", &file]);
                command
            }
        };
        let log = File::create(folder.path("log")).expect("a log");
        command.stdin(Stdio::null()).stderr(log.try_clone().expect("the log")).stdout(log);
        let child = command.kill_on_drop(true).spawn();
        let mut child = child.unwrap_or_else(|error| panic!("{kind:?}: {error}"));

        let mut roots = RootCertStore::empty();
        roots.add(root).expect("a certificate");
        let client = http(roots).expect("versions of TLS");
        let here = SocketAddr::from(([127, 0, 0, 1], 0));
        let client = client.resolve(NAME, here).build().expect("a client");
        let [address, plain] = [("https", encrypted), ("http", plain)].map(|(scheme, port)| {
            Address::through(format!("{scheme}://{NAME}:{port}"), client.clone())
        });
        let begun = Instant::now();
        loop {
            let asked = address.request(Method::GET, "/readyz").send().await;
            if asked.as_ref().is_ok_and(|answer| answer.status() == 200) {
                break;
            }
            let ended = child.try_wait().expect("its state");
            assert!(
                ended.is_none() && begun.elapsed() < PATIENCE,
                "{kind:?}: {asked:?}: {}",
                folder.text("log")
            );
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        Self { address, plain, kind, folder, _child: child }
    }

    /// The proxy's log of requests.
    #[must_use]
    pub fn log(&self) -> String {
        self.folder.text(match self.kind {
            Kind::Nginx => "access.log",
            Kind::Haproxy => "log",
        })
    }
}

/// The configuration from `docs/deploy`, in which only ports, files and servers are replaced.
fn adapted(
    kind: Kind,
    folder: &Folder,
    [encrypted, plain]: [u16; 2],
    servers: [&str; 2],
) -> String {
    let deploy = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/deploy");
    let file = match kind {
        Kind::Nginx => "nginx.conf",
        Kind::Haproxy => "haproxy.cfg",
    };
    let mut text = std::fs::read_to_string(deploy.join(file)).expect(file);
    let mut put = |old: &str, new: &str| {
        assert!(text.contains(old), "{file} has {old}");
        text = text.replace(old, new);
    };
    put("127.0.0.1:8081", servers[0]);
    put("127.0.0.1:8082", servers[1]);
    put("/etc/ssl/sidestep/", &folder.name(""));
    match kind {
        Kind::Nginx => {
            put("user www-data;\n", "");
            put("/run/nginx.pid", &folder.name("pid"));
            put("/var/log/nginx/", &folder.name(""));
            put("listen 80;", &format!("listen 127.0.0.1:{plain};"));
            put("listen 443 ssl", &format!("listen 127.0.0.1:{encrypted} ssl"));
            // Temporary files go to folders that the user who runs the tests can write to.
            let folders = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"];
            let folders = folders.map(|one| format!("{one}_temp_path {};\n", folder.name(one)));
            put("http {\n", &format!("http {{\n{}", folders.concat()));
        }
        Kind::Haproxy => {
            put("    user haproxy\n    group haproxy\n", "");
            put("/run/haproxy.pid", &folder.name("pid"));
            put("bind :80\n", &format!("bind 127.0.0.1:{plain}\n"));
            put("bind :443 ", &format!("bind 127.0.0.1:{encrypted} "));
        }
    }
    text
}

/// Writes a self-signed certificate for [`NAME`] in the formats of both proxies.
fn certificate(folder: &Folder) -> CertificateDer<'static> {
    let params = CertificateParams::new(vec![NAME.to_owned()]).expect("a name");
    let key = KeyPair::generate().expect("a key");
    let certificate = params.self_signed(&key).expect("a certificate");
    let (chain, key) = (certificate.pem(), key.serialize_pem());
    folder.file("both.pem", format!("{chain}{key}"));
    folder.file("fullchain.pem", chain);
    folder.file("privkey.pem", key);
    certificate.der().clone()
}

/// A free port.
///
/// # Panics
/// If no port is free.
#[must_use]
pub fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("its address").port()
}

/// The path of a server program. Checks `/usr/sbin`, which might not be on the PATH.
fn program(name: &str) -> PathBuf {
    let installed = Path::new("/usr/sbin").join(name);
    if installed.is_file() { installed } else { name.into() }
}
