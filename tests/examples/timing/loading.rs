//! Time from opening the link to the first usable page, on a slow connection.

use crate::figures::quantile;
use serde::Deserialize;
use serde_json::{Value, json};
use sidestep_tests::{Browser, Server, Tab};

/// Number of runs, each with a fresh browser.
const RUNS: usize = 5;

const LATENCY_MS: f64 = 150.0;
const BITS_PER_S: f64 = 1.6e6;

/// Records when the consent button appears.
fn watch() -> String {
    format!(
        "window.usable_ms = null; new MutationObserver(() => {{ \
             if (window.usable_ms === null && {}) window.usable_ms = performance.now(); \
         }}).observe(document, {{ subtree: true, childList: true }});",
        Tab::at("consent")
    )
}

#[derive(Deserialize)]
struct Loaded {
    usable_ms: f64,
    /// Bytes transferred, including headers.
    bytes: f64,
    requests: usize,
}

pub(crate) async fn measured() -> Value {
    let server = Server::with_client("slug = \"default\"").await;
    let mut loaded = Vec::new();
    for _ in 0..RUNS {
        let browser = Browser::start().await;
        let tab = browser.open("about:blank").await;
        tab.slow_network(LATENCY_MS, BITS_PER_S / 8.0).await;
        tab.before_pages(&watch()).await;
        tab.go(&format!("{}/s/default", server.origin)).await;
        tab.words("consent").await;
        let entries = "[...performance.getEntriesByType('navigation'), \
                       ...performance.getEntriesByType('resource')]";
        let found = format!(
            "({{ usable_ms, bytes: {entries}.reduce((sum, entry) => sum + entry.transferSize, 0), \
             requests: {entries}.length }})"
        );
        loaded.push(tab.eval::<Loaded>(&found).await);
        browser.close().await;
    }
    let times: Vec<f64> = loaded.iter().map(|loaded| loaded.usable_ms).collect();
    json!({
        "runs": RUNS,
        "latency_ms": LATENCY_MS,
        "bits_per_s": BITS_PER_S,
        "median_ms": quantile(&times, 0.5),
        "max_ms": quantile(&times, 1.0),
        "bytes": loaded[0].bytes,
        "requests": loaded[0].requests,
    })
}
