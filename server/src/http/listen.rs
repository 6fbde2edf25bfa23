//! Accepting connections, with time limits for slow senders, and stopping after running requests.

use axum::Router;
use axum::body::Body;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use std::net::IpAddr;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tower::ServiceExt;

/// The address of a request's client.
#[derive(Clone, Copy, Debug)]
pub struct Client(pub IpAddr);

/// Longest time for the head of a request, and between two requests.
const HEAD_LIMIT: Duration = Duration::from_secs(30);
/// Longest wait for running requests when the server stops.
const FAREWELL: Duration = Duration::from_secs(10);

/// Serves until `stop` completes, then waits for running requests.
pub async fn serve(listener: TcpListener, router: Router, stop: impl Future<Output = ()>) {
    let mut server = http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(HEAD_LIMIT);
    let connections = GracefulShutdown::new();
    let mut stop = std::pin::pin!(stop);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = &mut stop => break,
        };
        match accepted {
            Ok((stream, from)) => {
                let router = router.clone();
                let client = Client(from.ip());
                let answer = service_fn(move |mut request: hyper::Request<Incoming>| {
                    request.extensions_mut().insert(client);
                    router.clone().oneshot(request.map(Body::new))
                });
                let connection = server.serve_connection(TokioIo::new(quick(stream)), answer);
                let connection = connections.watch(connection);
                tokio::spawn(async move {
                    // The client is responsible for a connection that breaks off.
                    if let Err(error) = connection.await {
                        tracing::debug!(%error, "a connection ended early");
                    }
                });
            }
            Err(error) => {
                // Most likely no file descriptor is left; other connections will release some.
                tracing::warn!(%error, "a connection was not accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
    drop(listener);
    if tokio::time::timeout(FAREWELL, connections.shutdown()).await.is_err() {
        tracing::warn!("stopped with requests under way");
    }
}

/// Disables Nagle's algorithm: answers are written whole, so waiting only delays them.
fn quick(stream: TcpStream) -> TcpStream {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "TCP_NODELAY");
    }
    stream
}
