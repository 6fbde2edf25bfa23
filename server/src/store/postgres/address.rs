//! The address of a database: `postgres://USER:PASSWORD@HOST:PORT/DATABASE?…`.

use crate::store::OpenError;
use crate::tls_client;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use rustls::{ClientConfig, RootCertStore};
use std::error::Error;
use std::path::Path;
use std::time::Duration;
use tokio_postgres::Config;
use tokio_postgres::config::{Host, SslMode, TargetSessionAttrs};

/// How long a connection may take.
const CONNECT_PATIENCE: Duration = Duration::from_secs(5);

/// The environment variable with the password, as for PostgreSQL's own programs.
const PASSWORD: &str = "PGPASSWORD";

/// After this silence of the network a connection counts as lost.
const SILENCE: Duration = Duration::from_secs(10);

/// An address that was understood.
pub(super) struct Address {
    /// How to connect.
    pub(super) config: Config,
    /// How to encrypt.
    pub(super) tls: ClientConfig,
    /// What messages call the database: the address without the password.
    pub(super) name: String,
}

impl Address {
    pub(super) fn is_one(url: &str) -> bool {
        url.starts_with("postgres:") || url.starts_with("postgresql:")
    }

    /// # Errors
    /// [`OpenError::Address`], without the address, which may hold a password.
    pub(super) fn parse(url: &str) -> Result<Self, OpenError> {
        let refuse = |found: String| OpenError::Address { url: "postgres:…".to_owned(), found };
        let (url, certificates) = without_certificates(url);
        let mut config: Config = url.parse().map_err(|error| refuse(unreadable(&error)))?;
        if config.get_hosts().is_empty() {
            return Err(refuse("no host".to_owned()));
        }
        let is_cut = |host: &Host| matches!(host, Host::Tcp(name) if name.contains('@'));
        if config.get_hosts().iter().any(is_cut) {
            return Err(refuse("a user, password or host with @; write %40 for it".to_owned()));
        }
        if config.get_dbname().is_none() {
            return Err(refuse("no database".to_owned()));
        }
        // A password in the environment is in no list of processes.
        if config.get_password().is_none()
            && let Some(password) = std::env::var_os(PASSWORD)
        {
            config.password(password.as_encoded_bytes());
        }
        // Between machines nobody reads along, unless the address says that they may.
        if !url.contains("sslmode=") {
            let is_here = config.get_hosts().iter().all(is_this_machine);
            config.ssl_mode(if is_here { SslMode::Disable } else { SslMode::Require });
        }
        if config.get_connect_timeout().is_none() {
            config.connect_timeout(CONNECT_PATIENCE);
        }
        config.tcp_user_timeout(SILENCE).keepalives_idle(SILENCE);
        // Of several hosts, the one that takes writes.
        config.target_session_attrs(TargetSessionAttrs::ReadWrite);
        if config.get_application_name().is_none() {
            config.application_name("sidestep");
        }
        let roots = roots(certificates.as_deref()).map_err(refuse)?;
        let tls = tls_client::config(roots).map_err(|error| refuse(error.to_string()))?;
        Ok(Self { name: name(&config), config, tls })
    }
}

/// What is wrong with an address: the option, if it is one of PostgreSQL's, but nothing else of what was given.
fn unreadable(error: &tokio_postgres::Error) -> String {
    let reason = error.source().map_or_else(String::new, ToString::to_string);
    match reason.starts_with("invalid value for option") {
        true => format!("an {reason}"),
        false => "an address that cannot be read".to_owned(),
    }
}

/// The address without the file of certificates in it, and that file.
fn without_certificates(url: &str) -> (String, Option<String>) {
    let Some((before, query)) = url.split_once('?') else { return (url.to_owned(), None) };
    let (named, others): (Vec<&str>, Vec<&str>) =
        query.split('&').partition(|part| part.starts_with("sslrootcert="));
    let file = named.first().and_then(|part| part.split_once('=')).map(|(_, file)| file.to_owned());
    let others = others.join("&");
    let url = if others.is_empty() { before.to_owned() } else { format!("{before}?{others}") };
    (url, file)
}

fn is_this_machine(host: &Host) -> bool {
    match host {
        Host::Tcp(name) => {
            name == "localhost"
                || name.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
        }
        #[cfg(unix)]
        Host::Unix(_) => true,
    }
}

/// The certificates that are trusted: those of a file, or the system's.
fn roots(file: Option<&str>) -> Result<RootCertStore, String> {
    let Some(file) = file else { return Ok(tls_client::system_roots()) };
    let mut roots = RootCertStore::empty();
    let faulty = |found: String| format!("sslrootcert={file}: expected certificates, {found}");
    for certificate in
        CertificateDer::pem_file_iter(Path::new(file)).map_err(|error| faulty(error.to_string()))?
    {
        let certificate = certificate.map_err(|error| faulty(error.to_string()))?;
        roots.add(certificate).map_err(|error| faulty(error.to_string()))?;
    }
    if roots.is_empty() { Err(faulty("found none".to_owned())) } else { Ok(roots) }
}

/// The address without password and options.
fn name(config: &Config) -> String {
    let user = config.get_user().map_or_else(String::new, |user| format!("{user}@"));
    let ports = config.get_ports();
    let host = |(i, host): (usize, &Host)| {
        let port = ports.get(i).or(ports.first());
        let port = port.map_or_else(String::new, |port| format!(":{port}"));
        match host {
            Host::Tcp(name) => format!("{name}{port}"),
            #[cfg(unix)]
            Host::Unix(folder) => format!("{}{port}", folder.display()),
        }
    };
    let hosts: Vec<String> = config.get_hosts().iter().enumerate().map(host).collect();
    format!("postgres://{user}{}/{}", hosts.join(","), config.get_dbname().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(url: &str, found: &str) {
        let message = Address::parse(url).err().expect("it must be refused").to_string();
        assert!(message.contains(found) && !message.contains("secret"), "{message}");
    }

    #[test]
    fn an_address_that_is_refused_is_not_repeated() {
        check("postgres://me:secret@host:x/db", "`port`");
        check("postgres://me:secret@host/db?sslmode=secret", "`sslmode`");
        check("postgres://me:secret@host/db?secret=1", "cannot be read");
        check("postgres://me:secret@host:5432", "no database");
        check("postgres:///db?user=secret", "no host");
        check("postgres://me:secret@host/db?sslrootcert=/nowhere", "sslrootcert=/nowhere");
    }

    #[test]
    fn messages_name_the_database_without_the_password() {
        let address = Address::parse("postgres://me:secret@a:1,b:2/db?sslmode=disable");
        assert_eq!(address.expect("an address").name, "postgres://me@a:1,b:2/db");
    }

    #[test]
    fn other_machines_are_reached_by_tls() {
        let mode = |url: &str| Address::parse(url).expect("an address").config.get_ssl_mode();
        assert_eq!(mode("postgres://me@other/db"), SslMode::Require);
        assert_eq!(mode("postgres://me@127.0.0.1/db"), SslMode::Disable);
        assert_eq!(mode("postgres://me@other/db?sslmode=disable"), SslMode::Disable);
    }
}
