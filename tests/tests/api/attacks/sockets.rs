//! Requests that are slow, long or ambiguous.

use sidestep_tests::{Driver, Server};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

async fn connect(server: &Server) -> TcpStream {
    TcpStream::connect(server.origin.trim_start_matches("http://")).await.unwrap()
}

/// Sends these bytes and returns the status of the response. Returns 0 if the connection is closed
/// without a response.
async fn status(server: &Server, bytes: &[u8]) -> u16 {
    let mut stream = connect(server).await;
    // The server can close the connection before it has read all bytes.
    let _ = stream.write_all(bytes).await;
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer).await;
    let line = String::from_utf8_lossy(&answer);
    line.split(' ').nth(1).and_then(|word| word.parse().ok()).unwrap_or(0)
}

/// A health-check request with these header lines.
fn get(lines: &str) -> Vec<u8> {
    format!("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{lines}\r\n")
        .into_bytes()
}

pub(super) async fn case_29_slow_requests_and_long_heads(server: &Server) {
    assert_eq!(status(server, &get("")).await, 200);
    let long = "x".repeat(9_000);
    let address = format!("GET /{long} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    assert_eq!(status(server, address.as_bytes()).await, 414);
    assert_eq!(status(server, &get(&"A: b\r\n".repeat(200))).await, 431);
    assert_eq!(status(server, &get(&format!("A: {}\r\n", "x".repeat(1 << 17)))).await, 431);
    for both in [
        "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n",
        "Content-Length: 5\r\nContent-Length: 6\r\n",
        "Content-Length: -1\r\n",
        "Transfer-Encoding: gzip\r\n",
        "A b: c\r\n",
        "A\0: c\r\n",
    ] {
        let mut request = get(both);
        request.extend_from_slice(b"0\r\n\r\n");
        assert_eq!(status(server, &request).await, 400, "{both:?}");
    }

    // Silent connections and connections with an unfinished head are closed after ten seconds.
    // Meanwhile, the server serves other clients.
    let begin = Instant::now();
    let mut slow = Vec::new();
    for i in 0..200 {
        let mut stream = connect(server).await;
        let head: &[u8] = if i % 2 == 0 { b"" } else { b"GET / HTTP/1.1\r\nHost: local" };
        stream.write_all(head).await.unwrap();
        slow.push(stream);
    }
    Driver::enrol(server).await.drive(server, 2).await;
    for stream in &mut slow {
        let mut rest = Vec::new();
        let read = stream.read_to_end(&mut rest);
        let closed = tokio::time::timeout(Duration::from_secs(60), read).await;
        assert!(closed.is_ok(), "it is open after a minute");
    }
    assert!(begin.elapsed() >= Duration::from_secs(9), "nobody is hurried");
}

pub(super) async fn case_31_bare_line_feeds_and_other_hosts(server: &Server) {
    for (request, expected) in [
        ("GET /healthz HTTP/1.1\nHost: localhost\r\nConnection: close\r\n\r\n", 400),
        ("GET /healthz HTTP/1.1\r\nHost: localhost\nConnection: close\r\n\r\n", 400),
        ("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\n\n", 400),
        ("GET /healthz HTTP/1.1\r\nConnection: close\r\n\r\n", 400),
        ("GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: a\r\nConnection: close\r\n\r\n", 400),
        ("GET /healthz HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n", 421),
        (
            "GET http://evil.example/healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
            421,
        ),
        ("GET /healthz HTTP/1.0\r\n\r\n", 200),
    ] {
        assert_eq!(status(server, request.as_bytes()).await, expected, "{request:?}");
    }
    // Several requests in one packet are answered in order.
    let mut stream = connect(server).await;
    let first = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let last = "GET /nothing HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    stream.write_all(format!("{first}{first}{last}").as_bytes()).await.unwrap();
    let mut answers = String::new();
    stream.read_to_string(&mut answers).await.unwrap();
    let statuses = answers.lines().filter(|line| line.starts_with("HTTP/1.1"));
    let statuses: Vec<_> = statuses.map(|line| line.split(' ').nth(1).unwrap()).collect();
    assert_eq!(statuses, ["200", "200", "404"]);
}
