//! WebAssembly in a real browser computes the same results as this machine, bit for bit. The
//! client's browser adapter delivers complete forms, and moves elements without changing their
//! content.

use sidestep::comparison::learning_fingerprints;
use sidestep_tests::{Browser, Tab};

/// Environment variable with the path of the page that runs `web-client/examples/fingerprint.rs`.
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn forms_arrive_whole_and_rows_keep_what_is_in_them() {
    let path = std::env::var("SIDESTEP_FORMS_PAGE");
    let path = path.expect("run the tests with `cargo xtask test`, which builds that page");
    let browser = Browser::start().await;
    let tab = browser.open(&format!("file://{path}")).await;
    tab.until_says("said", "woken 2").await;

    // Fill in every kind of field.
    let fill = "(() => { \
        const at = name => document.querySelector(`[data-testid=\"${name}\"]`); \
        at('area').value = 'two\\nlines'; at('number').value = '2.5'; at('right').checked = true; \
        at('one').value = 'b'; })()";
    tab.run(fill).await;
    tab.press("submit").await;
    tab.until_says("said", "Form(").await;
    let expected = r#"Form([("text", Text("preset")), ("area", Text("two\nlines")), ("number", Number(Some(2.5))), ("empty", Number(None)), ("ticked", Checked(true)), ("unticked", Checked(false)), ("radio", Text("right")), ("one", Text("b"))])"#;
    assert_eq!(tab.words("said").await, expected);
    tab.enter("live", "c").await;
    tab.until_says("said", "Text(\"c\")").await;

    // A row that moves keeps its text, focus and selection.
    let row = Tab::at("row-2");
    tab.run(&format!("{row}.value = 'typed', {row}.focus(), {row}.setSelectionRange(1, 3)")).await;
    tab.press("rotate").await;
    tab.until(&format!("{}.firstChild.contains({row})", Tab::at("rows"))).await;
    let kept = format!(
        "[{row}.value, String(document.activeElement === {row}), `${{{row}.selectionStart}}–${{{row}.selectionEnd}}`]"
    );
    assert_eq!(tab.eval::<Vec<String>>(&kept).await, ["typed", "true", "1–3"]);

    // Numbers survive a round trip through the browser's JSON bit for bit.
    tab.press("numbers").await;
    tab.until_says("said", "lost").await;
    assert_eq!(tab.words("said").await, "lost []");

    // Storage reports its success and each kind of refusal.
    tab.press("keep").await;
    tab.until_says("said", "Ok(())").await;
    tab.run(
        "IDBObjectStore.prototype.put = () => { throw new DOMException('', 'QuotaExceededError') }",
    )
    .await;
    tab.press("keep").await;
    tab.until_says("said", "Err(Full)").await;
    tab.run("IDBObjectStore.prototype.put = () => { throw new DOMException('', 'SecurityError') }")
        .await;
    tab.press("keep").await;
    tab.until_says("said", "Err(Denied)").await;
    tab.is_quiet();
    browser.close().await;
}
