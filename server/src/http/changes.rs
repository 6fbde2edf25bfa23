//! Server-sent events for open pages. An event tells a page that something has changed, and the page then
//! requests its data again. Events contain no data, so access is checked when the data are requested.

use crate::http::app::App;
use crate::http::experimenters::Reader;
use axum::extract::State;
use axum::response::Sse;
use axum::response::sse::{Event, KeepAlive};
use futures_util::{Stream, StreamExt};
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;

/// Minimum interval between two events, regardless of the number of commits.
const PAUSE: Duration = Duration::from_secs(1);

/// Maximum duration of a response. The browser then reconnects, and its session is checked again.
const LONGEST: Duration = Duration::from_secs(300);

/// `GET /api/v1/admin/changes`: an event `change` immediately and after every commit, at most one
/// per second. The data of an event is the number of commits since the server started.
pub async fn follow(
    Reader(me): Reader,
    State(app): State<Arc<App>>,
) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    let stopping = app.stopping.clone().cancelled_owned();
    let events = events(app.store.commits())
        .take_until(stopping)
        .take_until(Box::pin(tokio::time::sleep(LONGEST)))
        .take_until(Box::pin(me.revoked(app.store.clone())));
    Sse::new(events).keep_alive(KeepAlive::default())
}

fn events(commits: watch::Receiver<u64>) -> impl Stream<Item = Result<Event, Infallible>> {
    futures_util::stream::unfold((commits, true), async |(mut commits, is_first)| {
        if !is_first {
            tokio::time::sleep(PAUSE).await;
            commits.changed().await.ok()?;
        }
        let count = *commits.borrow_and_update();
        let event = Event::default().event("change").data(count.to_string());
        Some((Ok(event.retry(PAUSE)), (commits, false)))
    })
}
