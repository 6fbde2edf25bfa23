//! The host names of this server.

use crate::http::error::ApiError;
use crate::http::peer::Proxies;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, Version, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::IpAddr;
use std::sync::Arc;

/// The host names of this server. Requests for any other name are refused, because such a name
/// points to this server by mistake or in a DNS rebinding attack.
#[derive(Clone, Debug)]
pub struct Hosts {
    names: Vec<String>,
    listens_at: IpAddr,
    /// Whether all names are accepted because no name was configured.
    any: bool,
}

impl Hosts {
    /// The names of a server that listens on this address. Loopback names and the address itself
    /// are always accepted. If `names` is empty, the server accepts all names, unless it listens
    /// only on a loopback address and has no trusted proxy.
    #[must_use]
    pub fn new(names: &[String], listens_at: IpAddr, proxies: &Proxies) -> Self {
        let names: Vec<_> = names.iter().map(|name| plain(name)).collect();
        let any = names.is_empty() && !(listens_at.is_loopback() && proxies.is_empty());
        Self { names, listens_at, any }
    }

    fn accepts(&self, authority: &str) -> bool {
        let name = plain(authority);
        let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        let is_here = match address {
            Ok(address) => address.is_loopback() || address == self.listens_at,
            Err(_) => name == "localhost" || name.ends_with(".localhost"),
        };
        is_here || self.any && !name.is_empty() || self.names.contains(&name)
    }
}

/// A host in lower case, without a port or a trailing dot.
fn plain(authority: &str) -> String {
    let host = match authority.rsplit_once(':') {
        Some((host, port)) if !port.contains(']') && !host.ends_with(':') => host,
        _ => authority,
    };
    host.trim_end_matches('.').to_ascii_lowercase()
}

/// Refuses requests that name several hosts, a host other than this server, or no host. Only
/// HTTP/1.0 requests do not have to name a host.
pub async fn known_host(State(hosts): State<Arc<Hosts>>, request: Request, next: Next) -> Response {
    match check(&hosts, request.version(), request.headers(), request.uri().authority()) {
        Ok(()) => next.run(request).await,
        Err(error) => error.into_response(),
    }
}

fn check(
    hosts: &Hosts,
    version: Version,
    headers: &HeaderMap,
    authority: Option<&axum::http::uri::Authority>,
) -> Result<(), ApiError> {
    let bad = |message: &str| Err(ApiError::new(StatusCode::BAD_REQUEST, "host", message));
    let mut given = headers.get_all(header::HOST).iter();
    let named = match (given.next(), given.next()) {
        (Some(host), None) => Some(host.to_str().unwrap_or_default()),
        (None, _) if version < Version::HTTP_11 => None,
        (None, _) => return bad("expected a header Host, found none"),
        (Some(_), Some(_)) => return bad("expected one header Host, found several"),
    };
    for name in named.into_iter().chain(authority.map(|it| it.as_str())) {
        if !hosts.accepts(name) {
            let message = "this server does not answer under that name; its operator can add the name \
                           with --allowed-host";
            return Err(ApiError::new(StatusCode::MISDIRECTED_REQUEST, "unknown_host", message));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hosts(names: &[&str], listens_at: &str, proxies: &[&str]) -> Hosts {
        let names: Vec<_> = names.iter().map(|&name| name.to_owned()).collect();
        let proxies = proxies.iter().map(|net| net.parse().unwrap()).collect();
        Hosts::new(&names, listens_at.parse().unwrap(), &Proxies::new(proxies))
    }

    #[test]
    fn this_machine_and_the_names_that_are_given() {
        let ours = hosts(&["Study.Example"], "192.0.2.1", &[]);
        for name in [
            "study.example",
            "STUDY.example.:443",
            "localhost:8080",
            "127.0.0.1",
            "[::1]:80",
            "192.0.2.1:8080",
            "a.localhost",
        ] {
            assert!(ours.accepts(name), "{name}");
        }
        for name in
            ["evil.example", "192.0.2.2", "study.example.evil", "", "localhost.evil.example"]
        {
            assert!(!ours.accepts(name), "{name}");
        }
    }

    #[test]
    fn without_names_only_a_server_that_others_reach_takes_all() {
        for (listens_at, proxies, any) in [
            ("127.0.0.1", &[][..], false),
            ("::1", &[], false),
            ("127.0.0.1", &["127.0.0.1/32"], true),
            ("0.0.0.0", &[], true),
        ] {
            assert_eq!(
                hosts(&[], listens_at, proxies).accepts("study.example"),
                any,
                "{listens_at}"
            );
        }
        assert!(!hosts(&[], "0.0.0.0", &[]).accepts(""));
    }
}
