//! Memory of the page as the number of trials grows.

use serde_json::{Value, json};
use sidestep_tests::{Browser, Server};

/// Makes the page count its uploads, and expose the memory of its WebAssembly program.
const BEFORE: &str = "window.count = 0; \
    const send = window.fetch; window.fetch = (request) => { \
        if (request.method === 'PUT' && request.url.includes('/trials/')) window.count += 1; \
        return send(request) }; \
    const start = WebAssembly.instantiateStreaming; \
    WebAssembly.instantiateStreaming = async (...given) => { \
        const program = await start.call(WebAssembly, ...given); \
        if (!window.memory) window.memory = program.instance.exports.memory; \
        return program };";

/// Numbers of trials after which memory is measured.
const AFTER: [usize; 7] = [1, 10, 20, 30, 40, 50, 59];

/// Measures the memory while a simulated participant drives the paper's whole protocol.
pub(crate) async fn measured() -> Value {
    let server = Server::with_client("slug = \"default\"").await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    tab.before_pages(BEFORE).await;
    tab.go(&format!("{}/s/default?simulate=7&speed=20", server.origin)).await;
    let mut rows = Vec::new();
    for count in AFTER {
        tab.until(&format!("count >= {count}")).await;
        let script = tab.heap_bytes().await;
        let program: f64 = tab.eval("memory.buffer.byteLength").await;
        rows.push(json!({ "trials": count, "script_bytes": script, "program_bytes": program }));
    }
    browser.close().await;
    json!(rows)
}
