//! Two predictors side by side, a predictor from a file, and the model finder.

use crate::{LOOKS, picture, sign_in, start, until_predicted};
use sidestep_tests::browser::WIDE;
use sidestep_tests::{Driver, Tab};

const STUDY: &str = "title = \"Two\"\nphases = [{ phase = \"task\", scenes = 8 }]\n";

const FILE: &str = r#"{"format":"sidestep-predictor/1","kind":"constant","features":[],"classes":[-1,0,1],"probabilities":[0.1,0.2,0.7]}"#;

/// Whether a canvas has a pixel that is not transparent.
fn is_painted(canvas: &str) -> String {
    format!(
        "(() => {{ const it = {}; return it && it.width > 100 && it.getContext('2d')\
         .getImageData(0, 0, it.width, it.height).data.some((v, i) => i % 4 === 3 && v > 0) }})()",
        Tab::at(canvas)
    )
}

/// Selects a file with this content in a field, as a user does.
async fn open(tab: &Tab, field: &str, content: &str) {
    let script = format!(
        "(() => {{ const files = new DataTransfer(); \
         files.items.add(new File([{content:?}], 'predictor.json')); const field = {}; \
         field.files = files.files; \
         field.dispatchEvent(new Event('input', {{ bubbles: true }})) }})()",
        Tab::at(field)
    );
    tab.run(&script).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_predictors_are_seen_side_by_side() {
    let (server, browser, tab) = start(STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 8).await;
    sign_in(&tab, &server).await;
    let trial = &driver.scenes()[7].0;
    tab.go(&format!("{}/lab/replay/{trial}?t=2.4", server.origin)).await;
    until_predicted(&tab).await;
    tab.key("b").await;
    tab.until(&is_painted("replay-beside")).await;
    tab.until_says("numbers-beside", "100 %").await;
    tab.until_search("?beside=constant-velocity&t=2.4").await;
    tab.enter("choose-predictor", "history").await;
    tab.until_says("predictor", "Trained on the 7 trials before").await;
    for look in LOOKS {
        tab.look(look.0, look.1).await;
        tab.until(&is_painted("replay-beside")).await;
        tab.until(&is_painted("replay")).await;
        picture(&tab, "replay-beside", look).await;
        tab.is_well().await;
    }
    tab.look(WIDE, false).await;
    // Both replays share one clock.
    tab.run("document.activeElement.blur()").await;
    tab.key("ArrowRight").await;
    tab.until_step("replay", 13).await;
    tab.until_step("replay-beside", 13).await;
    // Open a valid file, and then an invalid one.
    open(&tab, "predictor-file-beside", FILE).await;
    tab.until_says("predictor-beside", "from a file on this computer").await;
    tab.until_says("numbers-beside", "70 %").await;
    open(&tab, "predictor-file-beside", "{").await;
    tab.until_says("unusable-beside", "It is not JSON").await;
    tab.until_says("numbers-beside", "70 %").await;
    picture(&tab, "replay-file", (WIDE, false)).await;
    // The link restores both predictors.
    tab.enter("choose-predictor-beside", "hold-the-input").await;
    tab.until_search("?predictor=history&beside=hold-the-input&t=2.6").await;
    tab.reload().await;
    tab.until(&is_painted("replay-beside")).await;
    tab.until_says("predictor-beside", "holds the input").await;
    // Sets that are learned from the seven earlier trials show their own levels, and no
    // probabilities of inputs.
    for (way, level) in [("gaussian", "Mahalanobis radius"), ("empirical", "share of futures")] {
        tab.enter("choose-predictor-beside", way).await;
        tab.until_says("predictor-beside", "Trained on the 7 trials before").await;
        tab.until_says("legend", &format!("beside: F₅: {level}")).await;
        tab.until_says("numbers-beside", "41 windows of 1 task").await;
        for look in LOOKS {
            tab.look(look.0, look.1).await;
            tab.until(&is_painted("replay-beside")).await;
            picture(&tab, &format!("replay-{way}"), look).await;
            tab.is_well().await;
        }
        tab.look(WIDE, false).await;
    }
    tab.until_search("?predictor=history&beside=empirical&t=2.6").await;
    // The model finder says that there are no models yet.
    tab.press("find-models-beside").await;
    tab.until_says("finder-empty", "No analysis of this study is done").await;
    tab.is_well().await;
    tab.press("finder-close").await;
    tab.run("document.activeElement.blur()").await;
    tab.key("b").await;
    tab.until(&format!("!{}", Tab::at("replay-beside"))).await;
    tab.until(&is_painted("replay")).await;
    browser.close().await;
}
