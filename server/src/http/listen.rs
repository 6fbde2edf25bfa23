//! Accepts connections with or without TLS, closes connections whose clients are too slow, and stops
//! gracefully.

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

/// Interval between two checks for overdue connections.
const SEARCH: Duration = Duration::from_secs(1);
/// Grace period for running requests when the server stops.
const FAREWELL: Duration = Duration::from_secs(10);
/// Maximum length of a request's head (bytes). Also the size of the read buffer of an idle connection.
const LONGEST_HEAD: usize = 1 << 14;

/// The routes that a listener serves, and its connections.
#[derive(Clone)]
pub struct Service {
    /// The routes.
    pub router: Router,
    /// The trusted proxies.
    pub proxies: Arc<Proxies>,
    /// The certificate, if this server terminates TLS.
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
                // If there is no free slot, the new connection is closed, because all other clients
                // wait for a response.
                let Some(admitted) = service.connections.admit(peer, is_proxy) else { continue };
                tokio::spawn(converse(stream, peer, admitted, service.clone(), running.watcher()));
            }
            Err(error) => {
                // The most likely cause is that the process has run out of file descriptors.
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

/// Serves a connection until it ends or is closed to make room.
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
    // hyper's own date panics if the clock is before 1970.
    server.max_buf_size(LONGEST_HEAD).auto_date_header(false);
    // An interrupted connection is not an error of the server.
    if let Err(error) = watcher.watch(server.serve_connection(stream, handle)).await {
        tracing::debug!(%error, "a connection ended early");
    }
}

/// The `Date` of a response. Returns `None` if the clock is outside the years 1970 to 9999.
fn date(now: SystemTime) -> Option<HeaderValue> {
    /// Beginning of the year 10000 (s since 1970), because HTTP dates have four-digit years.
    const END: Duration = Duration::from_secs(253_402_300_800);
    let since = now.duration_since(UNIX_EPOCH).ok()?;
    (since < END).then(|| HeaderValue::from_str(&httpdate::fmt_http_date(now)).ok()).flatten()
}

/// Disables Nagle's algorithm. Responses are written immediately, so the algorithm would only delay
/// them.
fn quick(stream: TcpStream) -> TcpStream {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "TCP_NODELAY");
    }
    stream
}
