//! WebAssembly in a real browser computes what this machine does, bit for bit.

use sidestep::comparison::learning_fingerprints;
use sidestep_tests::Browser;

/// Where the page with the program `web-client/examples/fingerprint.rs` is.
const PAGE: &str = "SIDESTEP_FINGERPRINT_PAGE";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_browser_learns_and_predicts_as_this_machine_does() {
    let here = learning_fingerprints().expect("fingerprints");
    let path = std::env::var(PAGE).unwrap_or_else(|_| {
        panic!("{PAGE}: run the tests with `cargo xtask test`, which builds that page")
    });
    let browser = Browser::start().await;
    let tab = browser.open(&format!("file://{path}")).await;
    tab.until("document.body?.textContent").await;
    let text: String = tab.eval("document.body.textContent").await;
    let there = serde_json::from_str::<Vec<(String, String)>>(&text);
    let there = there.unwrap_or_else(|_| panic!("the page says {text:?}"));
    assert_eq!(there.len(), here.len());
    let apart = here.iter().zip(&there).filter(|(here, there)| here != there);
    let apart: Vec<&str> = apart.map(|((stage, _), _)| stage.as_str()).collect();
    assert!(apart.is_empty(), "other bits in {apart:?}");
    browser.close().await;
}
