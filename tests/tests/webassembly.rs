//! WebAssembly in a real browser computes what this machine does, bit for bit.

use sidestep::comparison::learning_fingerprints;
use sidestep_tests::Browser;

/// Pages with the program `web-client/examples/fingerprint.rs`: compiled as the site's pages are
/// (small), and as the solver is (fast, with lanes of 128 bits).
const PAGES: [&str; 2] = ["SIDESTEP_FINGERPRINT_PAGE", "SIDESTEP_FINGERPRINT_SOLVER"];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_browser_learns_and_predicts_as_this_machine_does() {
    let here = learning_fingerprints().expect("fingerprints");
    let browser = Browser::start().await;
    for variable in PAGES {
        let path = std::env::var(variable);
        let path = path.unwrap_or_else(|_| {
            panic!("{variable}: run the tests with `cargo xtask test`, which builds that page")
        });
        let tab = browser.open(&format!("file://{path}")).await;
        tab.until("document.body?.textContent").await;
        let text: String = tab.eval("document.body.textContent").await;
        let there = serde_json::from_str::<Vec<(String, String)>>(&text);
        let there = there.unwrap_or_else(|_| panic!("{variable}: the page says {text:?}"));
        assert_eq!(there.len(), here.len(), "{variable}");
        let apart = here.iter().zip(&there).filter(|(here, there)| here != there);
        let apart: Vec<&str> = apart.map(|((stage, _), _)| stage.as_str()).collect();
        assert!(apart.is_empty(), "{variable}: other bits in {apart:?}");
    }
    browser.close().await;
}
