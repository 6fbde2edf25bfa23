//! The address of a database: `postgres://USER:PASSWORD@HOST:PORT/DATABASE?…`. It can name several
//! hosts: the primary and its standbys.

use crate::store::OpenError;
use sqlx::ConnectOptions;
use sqlx::postgres::{PgConnectOptions, PgSslMode};
use std::time::Duration;

/// Default timeout of a connection attempt.
const PATIENCE: Duration = Duration::from_secs(5);

/// The options that sqlx reads from an address.
const OPTIONS: [&str; 19] = [
    "application_name",
    "dbname",
    "host",
    "hostaddr",
    "options",
    "password",
    "port",
    "ssl-ca",
    "ssl-cert",
    "ssl-key",
    "ssl-mode",
    "ssl-root-cert",
    "sslcert",
    "sslkey",
    "sslmode",
    "sslrootcert",
    "statement-cache-capacity",
    "user",
    "connect_timeout",
];

/// A parsed address.
pub(super) struct Address {
    /// Connection options for each host.
    pub(super) hosts: Vec<PgConnectOptions>,
    /// Timeout of a connection attempt.
    pub(super) patience: Duration,
    /// The database's name in messages: the address without the password.
    pub(super) name: String,
}

impl Address {
    pub(super) fn is_one(url: &str) -> bool {
        url.starts_with("postgres:") || url.starts_with("postgresql:")
    }

    /// # Errors
    /// [`OpenError::Address`], without the address, which may contain a password.
    pub(super) fn parse(url: &str) -> Result<Self, OpenError> {
        Self::read(url)
            .map_err(|found| OpenError::Address { url: "postgres:…".to_owned(), found })
    }

    /// The error names invalid options and a missing certificate file, but quotes no other part of the
    /// address.
    fn read(url: &str) -> Result<Self, String> {
        let unreadable = || "an address that cannot be read".to_owned();
        let (scheme, rest) = url.split_once("://").ok_or_else(unreadable)?;
        let (place, query) = rest.split_once('?').unwrap_or((rest, ""));
        let (authority, database) = place.split_once('/').unwrap_or((place, ""));
        let (user, hosts) = authority.rsplit_once('@').unwrap_or(("", authority));
        if user.contains('@') {
            return Err("a user, password or host with @; write %40 for it".to_owned());
        }
        let (mut patience, mut others) = (PATIENCE, Vec::new());
        for option in query.split('&').filter(|option| !option.is_empty()) {
            let (name, value) = option.split_once('=').unwrap_or((option, ""));
            let refused = || format!("an invalid value for option `{name}`");
            match name {
                "connect_timeout" => {
                    patience = Duration::from_secs(value.parse().map_err(|_| refused())?);
                    continue;
                }
                // `read-write` is the only value that makes sense.
                "target_session_attrs" if value == "read-write" => continue,
                "target_session_attrs" => return Err(refused()),
                "sslmode" | "ssl-mode" => drop(value.parse::<PgSslMode>().map_err(|_| refused())?),
                "sslrootcert" | "ssl-root-cert" | "ssl-ca" => certificates(name, value)?,
                _ if OPTIONS.contains(&name) || name.starts_with("options[") => {}
                _ if name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') => {
                    return Err(format!(
                        "the option `{name}`, which PostgreSQL's addresses do not have"
                    ));
                }
                _ => return Err(unreadable()),
            }
            others.push(option);
        }
        let is_elsewhere =
            |option: &&str| option.starts_with("host=") || option.starts_with("hostaddr=");
        if hosts.is_empty() && !others.iter().any(is_elsewhere) {
            return Err("no host".to_owned());
        }
        let at = if user.is_empty() { String::new() } else { format!("{user}@") };
        let one = |host: &str| {
            if host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_err()) {
                return Err("an invalid value for option `port`".to_owned());
            }
            let url = format!("{scheme}://{at}{host}/{database}?{}", others.join("&"));
            let options: PgConnectOptions = url.parse().map_err(|_| unreadable())?;
            // By default, a connection between machines uses TLS and verifies the server's
            // certificate, so that nobody can eavesdrop or impersonate the server. Options of the
            // address can change this.
            let is_chosen = others.iter().any(|option| option.starts_with("ssl"));
            let mode = match (is_chosen, options.get_ssl_mode()) {
                (false, _) if is_this_machine(&options) => PgSslMode::Disable,
                (false, _) | (true, PgSslMode::Require) => PgSslMode::VerifyFull,
                (true, mode) => mode,
            };
            let options = options.ssl_mode(mode).statement_cache_capacity(STATEMENTS);
            let options = match options.get_application_name() {
                Some(_) => options,
                None => options.application_name("sidestep"),
            };
            Ok(options.disable_statement_logging())
        };
        let hosts: Vec<_> = hosts.split(',').map(one).collect::<Result<_, _>>()?;
        if hosts[0].get_database().is_none() {
            return Err("no database".to_owned());
        }
        Ok(Self { name: name(&hosts), hosts, patience })
    }
}

/// Maximum number of cached prepared statements. The store has fewer statements, except for the
/// many combinations of list filters.
const STATEMENTS: usize = 256;

/// Checks that a file holds certificates.
fn certificates(option: &str, file: &str) -> Result<(), String> {
    let faulty = |found: String| format!("{option}={file}: expected certificates, {found}");
    let text = std::fs::read(file).map_err(|error| faulty(error.to_string()))?;
    let marker = b"-----BEGIN CERTIFICATE-----";
    match text.windows(marker.len()).any(|part| part == marker) {
        true => Ok(()),
        false => Err(faulty("found none".to_owned())),
    }
}

fn is_this_machine(options: &PgConnectOptions) -> bool {
    let host = options.get_host();
    let is_loopback = |address: std::net::IpAddr| address.is_loopback();
    options.get_socket().is_some()
        || host.starts_with('/')
        || host == "localhost"
        || host.trim_matches(['[', ']']).parse().is_ok_and(is_loopback)
}

/// The address without password and options.
fn name(hosts: &[PgConnectOptions]) -> String {
    let first = &hosts[0];
    let host = |options: &PgConnectOptions| match options.get_socket() {
        Some(folder) => folder.display().to_string(),
        None => format!("{}:{}", options.get_host(), options.get_port()),
    };
    let hosts: Vec<String> = hosts.iter().map(host).collect();
    let (user, database) = (first.get_username(), first.get_database().unwrap_or_default());
    format!("postgres://{user}@{}/{database}", hosts.join(","))
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
        check("postgres://me:secret@host/db?bogus=secret", "`bogus`");
        check("postgres://me:secret@host/db?%73=secret", "cannot be read");
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
    fn other_machines_are_reached_by_tls_and_known_by_their_certificate() {
        let mode = |url: &str| {
            let mode = Address::parse(url).expect("an address").hosts[0].get_ssl_mode();
            format!("{mode:?}")
        };
        assert_eq!(mode("postgres://me@other/db"), "VerifyFull");
        assert_eq!(mode("postgres://me@other/db?sslmode=require"), "VerifyFull");
        assert_eq!(mode("postgres://me@127.0.0.1/db"), "Disable");
        assert_eq!(mode("postgres://me@other/db?sslmode=disable"), "Disable");
    }
}
