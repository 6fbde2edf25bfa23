//! Determines the client of a request: its address, and whether its connection is encrypted. Behind a
//! trusted proxy, the proxy reports both.

use axum::http::{HeaderMap, HeaderName, header};
use ipnet::IpNet;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// The client of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Client {
    /// The client's address. Behind a trusted proxy, it is the address that the proxy reports.
    pub address: IpAddr,
    /// Whether the client connects through TLS, to this server or to a trusted proxy.
    pub is_secure: bool,
    /// Whether the client is a program on this machine that is not a proxy.
    pub is_local: bool,
    /// Whether a trusted proxy has forwarded the request.
    pub is_proxied: bool,
}

impl Default for Client {
    /// An unknown client.
    fn default() -> Self {
        let address = IpAddr::V4(Ipv4Addr::UNSPECIFIED);
        Self { address, is_secure: false, is_local: false, is_proxied: false }
    }
}

/// The trusted proxies. Only their `X-Forwarded-*` and `Forwarded` headers are used.
#[derive(Clone, Debug, Default)]
pub struct Proxies(Vec<IpNet>);

const FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");
const FORWARDED_PROTO: HeaderName = HeaderName::from_static("x-forwarded-proto");

impl Proxies {
    /// The proxies with these addresses or in these networks.
    #[must_use]
    pub fn new(nets: Vec<IpNet>) -> Self {
        Self(nets)
    }

    /// Whether there are no trusted proxies.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether `address` is a trusted proxy.
    #[must_use]
    pub fn trusts(&self, address: IpAddr) -> bool {
        self.0.iter().any(|net| net.contains(&address))
    }

    /// The client of a request that came from `peer` with these headers. `is_tls` states whether it
    /// came through TLS.
    ///
    /// Each proxy appends the address of its peer, so the list in the header is read from its end.
    /// The first address that is not a trusted proxy is the client. Earlier entries come from the
    /// client itself and are ignored.
    #[must_use]
    pub fn client(&self, peer: IpAddr, is_tls: bool, headers: &HeaderMap) -> Client {
        let peer = peer.to_canonical();
        if !self.trusts(peer) {
            let speaks_for_others = [FORWARDED_FOR, header::FORWARDED, header::VIA];
            let is_local =
                peer.is_loopback() && !speaks_for_others.iter().any(|it| headers.contains_key(it));
            return Client { address: peer, is_secure: is_tls, is_local, is_proxied: false };
        }
        let forwarded = || parameters(headers, "for");
        let mut hops = elements(headers, &FORWARDED_FOR);
        if hops.is_empty() {
            hops = forwarded();
        }
        let mut address = peer;
        for hop in hops.iter().rev() {
            // Stop at an invalid address, and ignore the addresses before it.
            let Some(before) = address_of(hop) else { break };
            address = before;
            if !self.trusts(address) {
                break;
            }
        }
        let mut schemes = elements(headers, &FORWARDED_PROTO);
        if schemes.is_empty() {
            schemes = parameters(headers, "proto");
        }
        let is_secure =
            schemes.last().map_or(is_tls, |scheme| scheme.eq_ignore_ascii_case("https"));
        Client { address, is_secure, is_local: false, is_proxied: true }
    }
}

/// The unit by which rate limits count clients: an IPv4 address, or an IPv6 network with a 64-bit
/// prefix. The devices of a household or laboratory share such a network.
#[must_use]
pub fn origin(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) if !address.is_loopback() => {
            let [a, b, c, d, ..] = address.segments();
            IpAddr::V6(Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0))
        }
        other => other,
    }
}

/// The list elements in all headers with this name.
fn elements(headers: &HeaderMap, name: &HeaderName) -> Vec<String> {
    let lines = headers.get_all(name).iter().map(|line| line.to_str().unwrap_or("?"));
    lines.flat_map(|line| line.split(',')).map(|element| element.trim().to_owned()).collect()
}

/// The values of this parameter in the elements of `Forwarded`.
fn parameters(headers: &HeaderMap, name: &str) -> Vec<String> {
    let elements = elements(headers, &header::FORWARDED);
    let of = |element: &String| {
        element.split(';').find_map(|pair| {
            let (found, value) = pair.trim().split_once('=')?;
            let is_wanted = found.trim().eq_ignore_ascii_case(name);
            is_wanted.then(|| value.trim().trim_matches('"').to_owned())
        })
    };
    elements.iter().filter_map(of).collect()
}

/// An address, with or without a port.
fn address_of(text: &str) -> Option<IpAddr> {
    let plain = text.parse::<IpAddr>().ok();
    let with_port = || text.parse::<std::net::SocketAddr>().ok().map(|socket| socket.ip());
    let in_brackets = || text.strip_prefix('[')?.strip_suffix(']')?.parse().ok();
    plain.or_else(with_port).or_else(in_brackets).map(|address| address.to_canonical())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(peer: &str, pairs: &[(&'static str, &str)]) -> (String, bool, bool) {
        let proxies = Proxies::new(vec![
            "127.0.0.1/32".parse().unwrap(),
            "10.0.0.0/8".parse().unwrap(),
            "fd00::1/128".parse().unwrap(),
        ]);
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.append(*name, value.parse().unwrap());
        }
        let client = proxies.client(peer.parse().unwrap(), false, &headers);
        (client.address.to_string(), client.is_secure, client.is_local)
    }

    #[test]
    fn the_last_address_that_no_trusted_proxy_has() {
        let for_ = "x-forwarded-for";
        let check = |pairs: &[(&'static str, &str)], address: &str| {
            assert_eq!(of("127.0.0.1", pairs).0, address, "{pairs:?}");
        };
        check(&[], "127.0.0.1");
        check(&[(for_, "192.0.2.7")], "192.0.2.7");
        check(&[(for_, "198.51.100.1, 192.0.2.7")], "192.0.2.7");
        check(&[(for_, "198.51.100.1"), (for_, "192.0.2.7, 10.1.2.3")], "192.0.2.7");
        check(&[(for_, "192.0.2.7:4711")], "192.0.2.7");
        check(&[(for_, "192.0.2.7, unknown, 10.1.2.3")], "10.1.2.3");
        check(&[(for_, "::ffff:192.0.2.7")], "192.0.2.7");
        check(
            &[("forwarded", "for=192.0.2.7;proto=https, for=\"[2001:db8::1]:80\"")],
            "2001:db8::1",
        );
        check(&[(for_, "192.0.2.7"), ("forwarded", "for=198.51.100.1")], "192.0.2.7");
    }

    #[test]
    fn strangers_speak_for_themselves_alone() {
        let pairs = [("x-forwarded-for", "127.0.0.1"), ("x-forwarded-proto", "https")];
        assert_eq!(of("192.0.2.9", &pairs), ("192.0.2.9".to_owned(), false, false));
        let nobody =
            Proxies::default().client(IpAddr::from([127, 0, 0, 1]), false, &HeaderMap::new());
        assert!(nobody.is_local);
        let headers = [(FORWARDED_FOR, "192.0.2.7".parse().unwrap())].into_iter().collect();
        let proxy = Proxies::default().client(IpAddr::from([127, 0, 0, 1]), false, &headers);
        assert!(!proxy.is_local, "a proxy that nobody named speaks for somebody else");
    }

    #[test]
    fn the_last_proxy_says_whether_the_way_is_encrypted() {
        assert!(of("127.0.0.1", &[("x-forwarded-proto", "http, https")]).1);
        assert!(!of("127.0.0.1", &[("x-forwarded-proto", "https, http")]).1);
        assert!(of("127.0.0.1", &[("forwarded", "for=192.0.2.7;proto=HTTPS")]).1);
        assert!(!of("127.0.0.1", &[]).1);
    }

    #[test]
    fn neighbours_in_version_6_are_one_origin() {
        let at = |text: &str| origin(text.parse().unwrap());
        assert_eq!(at("2001:db8:1:2:3:4:5:6"), at("2001:db8:1:2::9"));
        assert_ne!(at("2001:db8:1:2::1"), at("2001:db8:1:3::1"));
        assert_eq!(at("::ffff:192.0.2.7"), at("192.0.2.7"));
    }
}
