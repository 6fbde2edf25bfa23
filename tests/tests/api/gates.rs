//! Checks before every request: TLS, proxies, host names, rate limits and connection limits.

use rcgen::{CertificateParams, KeyPair};
use reqwest::{Method, Response};
use serde_json::json;
use sidestep::api::routes;
use sidestep_tests::process::Said;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Folder, Server, run};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, crypto::ring, version};
use tokio_rustls::{TlsConnector, rustls};

/// Writes `cert.pem` and `key.pem` of a self-signed certificate that is valid from 1 January of
/// `years.start` to 1 January of `years.end`. Returns the certificate.
fn certificate(
    folder: &Folder,
    name: &str,
    years: std::ops::Range<i32>,
) -> CertificateDer<'static> {
    let mut params = CertificateParams::new(vec![name.to_owned()]).unwrap();
    let new_year = |year: i32| rcgen::date_time_ymd(year, 1, 1);
    (params.not_before, params.not_after) = (new_year(years.start), new_year(years.end));
    let key = KeyPair::generate().unwrap();
    let certificate = params.self_signed(&key).unwrap();
    folder.file("key.pem", key.serialize_pem());
    folder.file("cert.pem", certificate.pem());
    CertificateDer::from_pem_slice(certificate.pem().as_bytes()).unwrap()
}

async fn encrypted(
    port: u16,
    root: &CertificateDer<'static>,
    version: &'static rustls::SupportedProtocolVersion,
) -> std::io::Result<TlsStream<TcpStream>> {
    let mut roots = RootCertStore::empty();
    roots.add(root.clone()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_protocol_versions(&[version])
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let stream = TcpStream::connect(("127.0.0.1", port)).await?;
    let name = ServerName::try_from("localhost").unwrap();
    TlsConnector::from(Arc::new(config)).connect(name, stream).await
}

/// Sends a request and reads the whole response. The connection stays open.
async fn ask(stream: &mut TlsStream<TcpStream>, head: &str, body: &str) -> String {
    let length = body.len();
    let request = format!(
        "{head} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
         Content-Length: {length}\r\n\r\n{body}"
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    loop {
        answer.push(stream.read_u8().await.unwrap());
        let text = String::from_utf8_lossy(&answer);
        let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
        let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
        if body.len() == length.map_or(0, |length| length.parse().unwrap()) {
            return text.into_owned();
        }
    }
}

#[tokio::test]
async fn tls_with_a_certificate_that_is_renewed() {
    let folder = Folder::default();
    let first = certificate(&folder, "localhost", 2025..4026);
    let files = ["cert.pem", "key.pem"].map(|name| folder.path(name));
    let server = Server::with_study_and(SHORT_STUDY, |_| ()).await.stop().await;
    let server = server
        .start_with(None, move |args| {
            (args.tls_cert, args.tls_key) = (Some(files[0].clone()), Some(files[1].clone()));
            args.listen = "127.0.0.1:0".to_owned();
        })
        .await;
    let port = server.origin.rsplit_once(':').unwrap().1.parse().unwrap();
    assert!(server.announcement().contains(&format!("https://127.0.0.1:{port}/lab")));

    for version in [&version::TLS12, &version::TLS13] {
        let mut stream = encrypted(port, &first, version).await.unwrap();
        let body = json!({ "key": server.key }).to_string();
        let answer = ask(&mut stream, "POST /api/v1/admin/session", &body).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        assert!(answer.contains("Max-Age=2592000; Secure"), "{answer}");
        assert!(answer.contains("strict-transport-security: max-age=31536000"), "{answer}");
    }
    // Commands also work over TLS.
    let url = format!("https://localhost:{port}");
    let args =
        ["simulate", "--url", &url, "--study", "default", "--participants", "1", "--seed", "1"];
    let mut command = tokio::process::Command::new(sidestep_tests::process::binary());
    let command = command.args(args).env("SSL_CERT_FILE", folder.path("cert.pem"));
    let done = Said::from(command.output().await.unwrap()).json();
    assert_eq!(done["flags"], json!({}), "{done}");
    let unknown = run(&args).await;
    unknown.refused(1, &[&url, "no answer", "certificate"]);
    // The server does not answer without encryption.
    let plain = server.request(Method::GET, "/healthz").send().await;
    assert!(plain.is_err());

    let mut old = encrypted(port, &first, &version::TLS13).await.unwrap();
    let renewed = certificate(&folder, "localhost", 2025..4027);
    for _ in 0..600 {
        if encrypted(port, &renewed, &version::TLS13).await.is_ok() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let mut new = encrypted(port, &renewed, &version::TLS13).await.expect("the new certificate");
    assert!(encrypted(port, &first, &version::TLS13).await.is_err());
    for stream in [&mut old, &mut new] {
        assert!(ask(stream, "GET /healthz", "").await.ends_with("ok\n"), "it stays open");
    }
    // If the new files are invalid, the server keeps its certificate.
    folder.file("cert.pem", "nonsense");
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert!(encrypted(port, &renewed, &version::TLS13).await.is_ok());
}

#[tokio::test]
async fn certificates_that_cannot_be_used_are_named() {
    let folder = Folder::default();
    let site = folder.name("site");
    sidestep_tests::server::write_site(&folder.path("site"));
    let database = folder.database("sidestep.db");
    let start = async |cert: &str, key: &str| -> Said {
        let (cert, key) = (folder.name(cert), folder.name(key));
        run(&[
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--static",
            &site,
            "--database",
            &database,
            "--tls-cert",
            &cert,
            "--tls-key",
            &key,
        ])
        .await
    };
    certificate(&folder, "localhost", 2025..4026);
    let cert = std::fs::read(folder.path("cert.pem")).unwrap();
    folder.file("other.pem", KeyPair::generate().unwrap().serialize_pem());
    folder.file("text.pem", "no PEM");
    let damaged = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
    folder.file("damaged.pem", damaged);
    for (cert, key, words) in [
        ("none.pem", "key.pem", ["--tls-cert", "none.pem", "No such file"]),
        ("text.pem", "key.pem", ["--tls-cert", "text.pem", "found no certificate"]),
        ("key.pem", "key.pem", ["--tls-cert", "key.pem", "found no certificate"]),
        ("damaged.pem", "key.pem", ["--tls-cert", "damaged.pem", "found a damaged one"]),
        ("cert.pem", "cert.pem", ["--tls-key", "cert.pem", "found nothing of that kind"]),
        ("cert.pem", "other.pem", ["--tls-key", "other.pem", "found another key"]),
    ] {
        start(cert, key).await.refused(2, &words);
    }
    folder.file("valid.pem", cert);
    for (years, words) in [(2017..2018, "valid until"), (2126..2127, "valid from")] {
        certificate(&folder, "localhost", years);
        start("cert.pem", "key.pem").await.refused(2, &["--tls-cert", "valid now", words]);
    }
    let alone = run(&["serve", "--tls-cert", &folder.name("valid.pem")]).await;
    alone.refused(2, &["--tls-key"]);
    assert!(!folder.path("sidestep.db").exists(), "nothing was made");
}

/// A server behind a proxy on this machine.
async fn behind_a_proxy() -> Server {
    Server::with_study_and(SHORT_STUDY, |args| {
        args.trusted_proxy = vec!["127.0.0.1/32".parse().unwrap()];
        args.allowed_host = vec!["study.example".to_owned()];
    })
    .await
}

#[tokio::test]
async fn a_trusted_proxy_says_who_asks_and_how() {
    let server = behind_a_proxy().await;
    let sign_in = async |key: &str, from: &str, scheme: &str| -> Response {
        let request = server.request(Method::POST, routes::SESSION).json(&json!({ "key": key }));
        let request = request.header("x-forwarded-for", from).header("x-forwarded-proto", scheme);
        request.header("host", "study.example").send().await.unwrap()
    };
    let secure = sign_in(&server.key, "192.0.2.7", "https").await;
    assert!(secure.headers()["set-cookie"].to_str().unwrap().ends_with("; Secure"));
    assert_eq!(secure.headers()["strict-transport-security"], "max-age=31536000");
    let plain = sign_in(&server.key, "192.0.2.7", "http").await;
    assert!(!plain.headers()["set-cookie"].to_str().unwrap().contains("Secure"));
    assert!(plain.headers().get("strict-transport-security").is_none());
    // Only the address that the proxy itself added counts.
    for i in 0..10 {
        let guess = sign_in("guess", &format!("198.51.100.{i}, 192.0.2.7"), "https").await;
        assert_eq!(guess.status(), 401);
    }
    assert_eq!(sign_in("guess", "192.0.2.7", "https").await.status(), 429);
    assert_eq!(sign_in("guess", "192.0.2.8", "https").await.status(), 401);
    assert_eq!(sign_in(&server.key, "192.0.2.7", "https").await.status(), 200);
}

#[tokio::test]
async fn nobody_else_says_who_asks() {
    let server = Server::with_study(SHORT_STUDY).await;
    let guess = async |from: &str| {
        let request =
            server.request(Method::POST, routes::SESSION).json(&json!({ "key": "guess" }));
        let request = request.header("x-forwarded-for", from).header("x-forwarded-proto", "https");
        let answer = request.send().await.unwrap();
        assert!(answer.headers().get("strict-transport-security").is_none());
        answer.status().as_u16()
    };
    for i in 0..10 {
        assert_eq!(guess(&format!("192.0.2.{i}")).await, 401);
    }
    assert_eq!(guess("192.0.2.99").await, 429);
}

#[tokio::test]
async fn who_asks_too_fast_waits_and_others_do_not() {
    let server = behind_a_proxy().await;
    let get = async |from: &str, token: &str| {
        let request = server.request(Method::GET, routes::ME).bearer_auth(token);
        Answer::of(request.header("x-forwarded-for", from)).await
    };
    // One token is used from many addresses until it is rate-limited.
    let driver = Driver::enrol(&server).await;
    let token = &driver.enrolled.token;
    let mut refused = None;
    for i in 0..10_000 {
        let answer = get(&format!("198.51.{}.{}", i / 250, i % 250), token).await;
        if answer.status == 429 {
            refused = Some((i, answer));
            break;
        }
        assert_eq!(answer.status, 200);
    }
    let (count, refused) = refused.expect("a limit");
    assert!(count >= 600, "{count}");
    assert!(refused.problem(429, "throttled", None).contains("with this token"));
    let other = Driver::enrol(&server).await;
    assert_eq!(get("198.51.0.1", &other.enrolled.token).await.status, 200);

    // One address enrols until it is rate-limited.
    let enrol = async |from: &str| {
        let request = server.request(Method::POST, &routes::participants("default"));
        Answer::of(request.header("x-forwarded-for", from).json(&json!({ "consent": false }))).await
    };
    let mut count = 0;
    while enrol("192.0.2.7").await.status == 422 {
        count += 1;
    }
    assert!(count >= 1_000, "{count}");
    enrol("192.0.2.7").await.problem(429, "throttled", None);
    enrol("192.0.2.8").await.problem(422, "invalid", Some("consent"));
}

#[tokio::test]
async fn metrics_are_for_this_machine_and_for_keys() {
    let server = behind_a_proxy().await;
    let get = |from: &str| server.request(Method::GET, "/metrics").header("x-forwarded-for", from);
    Answer::of(get("192.0.2.7")).await.problem(401, "unauthorized", None);
    assert_eq!(Answer::of(get("192.0.2.7").bearer_auth(&server.key)).await.status, 200);
    let direct = Server::with_study(SHORT_STUDY).await;
    // Unknown methods share one label, so they cannot fill the memory.
    for number in 0..3 {
        let method = Method::from_bytes(format!("BREW{number}").as_bytes()).unwrap();
        assert_eq!(Answer::of(direct.request(method, "/start")).await.status, 405);
    }
    let metrics = direct.request(Method::GET, "/metrics").send().await.unwrap();
    assert_eq!(metrics.status(), 200);
    let metrics = metrics.text().await.unwrap();
    let line = "sidestep_http_request_seconds_count{method=\"(other)\",route=\"/start\"} 3";
    assert!(metrics.contains(line) && !metrics.contains("BREW"), "{metrics}");
    // A request with this header is refused, because it might come from outside through a proxy
    // that is not configured as trusted.
    let through = direct.request(Method::GET, "/metrics").header("x-forwarded-for", "127.0.0.1");
    Answer::of(through).await.problem(401, "unauthorized", None);
}

#[tokio::test]
async fn a_key_that_was_chosen_and_its_hash() {
    const KEY: &str = "correct horse battery staple";
    let mut child = std::process::Command::new(sidestep_tests::process::binary());
    let child = child.arg("hash-key").stdin(std::process::Stdio::piped());
    let mut child = child.stdout(std::process::Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    std::io::Write::write_all(&mut stdin, format!("{KEY}\n").as_bytes()).unwrap();
    drop(stdin);
    let hash = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
    let hash = hash.trim_end();
    assert!(hash.starts_with("$argon2id$"), "{hash}");

    let server = Server::with_study(SHORT_STUDY).await.restarted_with(Some(hash), |_| ()).await;
    let sign_in = async |server: &Server, key: &str| {
        let request = server.request(Method::POST, routes::SESSION).json(&json!({ "key": key }));
        request.send().await.unwrap()
    };
    // The right key is accepted, even on its first use, although someone else guesses from the same
    // address.
    for i in 0..20 {
        sign_in(&server, &format!("a guess with number {i}")).await;
    }
    // The rate limiter might permit one more attempt by now, which gets status 401.
    let status = sign_in(&server, hash).await.status().as_u16();
    assert!([401, 429].contains(&status), "the hash opens nothing, found {status}");
    let right = sign_in(&server, KEY).await;
    assert_eq!(right.status(), 200);
    let cookie = right.headers()["set-cookie"].to_str().unwrap().split(';').next().unwrap();
    let session = async |server: &Server| {
        let request = server.request(Method::GET, routes::SESSION).header("cookie", cookie);
        Answer::of(request).await.status
    };
    assert_eq!(session(&server).await, 200);
    let server = server.restarted_with(Some(hash), |_| ()).await;
    assert_eq!(session(&server).await, 200, "the session outlives a restart");
    // If the key changes, the sessions of the old key end.
    let server = server.restarted_with(Some("another key that was chosen"), |_| ()).await;
    assert_eq!(session(&server).await, 401);
    // In PostgreSQL, the guesses are remembered across a restart, so a wrong key gets 429 for a
    // while.
    let status = sign_in(&server, KEY).await.status().as_u16();
    assert!([401, 429].contains(&status), "the old key opens nothing, found {status}");
}

/// Many idle connections and half-sent bodies do not affect other clients.
#[tokio::test]
async fn idle_connections_and_half_bodies_take_nothing_from_others() {
    let server = Server::with_study(SHORT_STUDY).await;
    let address = server.origin.trim_start_matches("http://");
    let mut idle = Vec::new();
    for _ in 0..2_000 {
        match TcpStream::connect(address).await {
            Ok(stream) => idle.push(stream),
            Err(error) => panic!("{} connections: {error}", idle.len()),
        }
    }
    let half = format!(
        "POST /api/v1/studies/default/participants HTTP/1.1\r\nHost: localhost\r\n\
         Content-Type: application/json\r\nContent-Length: 262144\r\n\r\n{}",
        " ".repeat(200_000)
    );
    for stream in idle.iter_mut().take(500) {
        // The server closes some of these connections, because the total size of their bodies is
        // too large.
        let _ = stream.write_all(half.as_bytes()).await;
    }
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 5).await;
    assert_eq!(driver.complete(&server).await.status, 200);
}
