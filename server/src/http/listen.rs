//! Accepting connections, with or without TLS, closing those that keep the server waiting, and stopping
//! after running requests.

use crate::http::connections::{Admitted, Connections, HEAD_LIMIT};
use crate::http::peer::Proxies;
use crate::http::tls::Certificates;
use crate::http::watched::{Received, Sent, Watched};
use axum::Router;
use axum::body::Body;
use axum::http::{HeaderValue, header};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use hyper_util::server::graceful::{GracefulShutdown, Watcher};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tower::ServiceExt;

/// Time between two searches for connections that take too long.
const SEARCH: Duration = Duration::from_secs(1);
/// Longest wait for running requests when the server stops.
const FAREWELL: Duration = Duration::from_secs(10);
/// Longest head of a request, bytes; also what a connection that waits for its next request keeps for reading.
const LONGEST_HEAD: usize = 1 << 14;

/// What answers, and to whom.
#[derive(Clone)]
pub struct Service {
    /// The routes.
    pub router: Router,
    /// The proxies whose word is taken.
    pub proxies: Arc<Proxies>,
    /// The certificate, if connections are encrypted here.
    pub certificates: Option<Arc<Certificates>>,
    /// The open connections.
    pub connections: Arc<Connections>,
}

/// Serves until `stop` completes, then waits for running requests.
pub async fn serve(listener: TcpListener, service: Service, stop: impl Future<Output = ()>) {
    let running = GracefulShutdown::new();
    let mut stop = std::pin::pin!(stop);
    let mut search = tokio::time::interval(SEARCH);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            _ = search.tick() => {
                service.connections.close_overdue();
                continue;
            }
            () = &mut stop => break,
        };
        match accepted {
            Ok((stream, from)) => {
                let peer = from.ip().to_canonical();
                let is_proxy = service.proxies.trusts(peer);
                // Without a place it is closed: every other connection waits for an answer.
                let Some(admitted) = service.connections.admit(peer, is_proxy) else { continue };
                tokio::spawn(converse(stream, peer, admitted, service.clone(), running.watcher()));
            }
            Err(error) => {
                // Most likely no file descriptor is left.
                tracing::warn!(%error, "a connection was not accepted");
                service.connections.make_room();
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
    drop(listener);
    let mut farewell = std::pin::pin!(tokio::time::timeout(FAREWELL, running.shutdown()));
    let in_time = loop {
        tokio::select! {
            ended = &mut farewell => break ended.is_ok(),
            _ = search.tick() => service.connections.close_overdue(),
        }
    };
    if !in_time {
        tracing::warn!("stopped with requests under way");
    }
}

/// Answers the requests of a connection, until it ends or has to make room.
async fn converse(
    stream: TcpStream,
    peer: IpAddr,
    admitted: Admitted,
    service: Service,
    watcher: Watcher,
) {
    let closed = admitted.watch.closed.clone();
    let stream = quick(stream);
    let conversation = async {
        match service.certificates.clone() {
            None => answer(stream, peer, &admitted, &service, watcher).await,
            Some(certificates) => {
                let shaken = certificates.acceptor().accept(stream);
                match tokio::time::timeout(HEAD_LIMIT, shaken).await {
                    Ok(Ok(stream)) => answer(stream, peer, &admitted, &service, watcher).await,
                    Ok(Err(error)) => tracing::debug!(%error, "a connection was not encrypted"),
                    Err(_) => tracing::debug!("a connection was not encrypted in time"),
                }
            }
        }
    };
    tokio::select! {
        () = closed.cancelled() => tracing::debug!("a connection was closed"),
        () = conversation => {}
    }
}

async fn answer<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(
    stream: S,
    peer: IpAddr,
    admitted: &Admitted,
    Service { router, proxies, certificates, .. }: &Service,
    watcher: Watcher,
) {
    let is_tls = certificates.is_some();
    let handle = service_fn(|request: hyper::Request<Incoming>| {
        let (router, watch) = (router.clone(), Arc::clone(&admitted.watch));
        let client = proxies.client(peer, is_tls, request.headers());
        let mut request = request.map(|body| Body::new(Received::new(body, admitted)));
        request.extensions_mut().insert(client);
        async move {
            let mut answer = router.oneshot(request).await?;
            if let Some(date) = date(SystemTime::now()) {
                answer.headers_mut().insert(header::DATE, date);
            }
            Ok::<_, std::convert::Infallible>(answer.map(|body| Sent::new(body, watch)))
        }
    });
    let stream = TokioIo::new(Watched::new(stream, Arc::clone(&admitted.watch)));
    let mut server = http1::Builder::new();
    // hyper's own date panics while the clock is before 1970.
    server.max_buf_size(LONGEST_HEAD).auto_date_header(false);
    // The client is responsible for a connection that breaks off.
    if let Err(error) = watcher.watch(server.serve_connection(stream, handle)).await {
        tracing::debug!(%error, "a connection ended early");
    }
}

/// The `Date` of an answer; none while the clock cannot be right.
fn date(now: SystemTime) -> Option<HeaderValue> {
    /// The year 10000, s since 1970: dates of HTTP have four digits for the year.
    const END: Duration = Duration::from_secs(253_402_300_800);
    let since = now.duration_since(UNIX_EPOCH).ok()?;
    (since < END).then(|| HeaderValue::from_str(&httpdate::fmt_http_date(now)).ok()).flatten()
}

/// Disables Nagle's algorithm: answers are written whole, so waiting only delays them.
fn quick(stream: TcpStream) -> TcpStream {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "TCP_NODELAY");
    }
    stream
}
