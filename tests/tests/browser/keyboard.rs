//! The whole participation with the keyboard alone, at 200 % zoom and with reduced motion.

use crate::hour::WHOLE_STUDY;
use crate::start;
use sidestep::api::{Texts, routes};
use sidestep_tests::Tab;

/// The focused element: its test id or tag name, whether its focus is visible, and its vertical
/// position on the page.
const FOCUS: &str = "(() => { const at = document.activeElement, box = at.getBoundingClientRect(); \
    const style = getComputedStyle(at); \
    const marked = style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) > 0; \
    const inside = box.top >= 0 && box.bottom <= innerHeight; \
    return [at.dataset.testid ?? at.tagName, marked && inside, box.top + scrollY] })()";

/// Moves the focus to a control with the Tab key. The focus is always visible, and never moves up
/// the page.
async fn reach(tab: &Tab, test_id: &str) {
    let mut above = f64::MIN;
    for _ in 0..20 {
        let (name, is_seen, top): (String, bool, f64) = tab.eval(FOCUS).await;
        if name != "H1" && name != "BODY" {
            assert!(is_seen, "the focus on {name} is not seen");
            // An option and its label, or two buttons side by side, have about the same height.
            assert!(top > above - 12.0, "{name} is above what had the focus before it");
            above = top;
        }
        if name == test_id {
            return;
        }
        tab.key("Tab").await;
        tab.until_painted().await;
    }
    panic!("the tab key does not come to {test_id}");
}

async fn use_key(tab: &Tab, test_id: &str, key: &str) {
    tab.until(&format!("{} && !{}.disabled", Tab::at(test_id), Tab::at(test_id))).await;
    reach(tab, test_id).await;
    tab.key(key).await;
}

/// Waits until a page with this element is shown and its title (`h1`) has the focus.
async fn headed(tab: &Tab, test_id: &str) {
    tab.words(test_id).await;
    tab.until("document.activeElement.tagName === 'H1' && scrollY === 0").await;
    tab.until_painted().await;
    tab.picture(&format!("zoomed-{test_id}")).await;
    tab.is_well().await;
}

/// Moves the focus to a group, and chooses the option at index `place`.
async fn choose(tab: &Tab, group: &str, first: &str, place: usize) {
    reach(tab, &format!("{group}-{first}")).await;
    tab.key(" ").await;
    for _ in 0..place {
        tab.key("ArrowDown").await;
    }
}

async fn drive(tab: &Tab, key: &str) {
    tab.until(&format!("document.activeElement === {}", Tab::at("start"))).await;
    tab.key(key).await;
    tab.until_step("scene", 5).await;
    tab.key_down("ArrowLeft").await;
    tab.until_step("scene", 10).await;
    tab.picture("zoomed-scene").await;
    tab.key_up("ArrowLeft").await;
    tab.until(&format!("!{}", Tab::at("scene"))).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_hour_with_the_keyboard_alone() {
    let (server, browser, tab) = start(WHOLE_STUDY).await;
    tab.zoom_and_calm().await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    headed(&tab, "consent").await;
    let moving = "getComputedStyle(document.querySelector('button')).transitionDuration";
    assert_eq!(tab.eval::<String>(moving).await, "0s");
    // A key that scrolls the page must not give consent.
    tab.key(" ").await;
    tab.key("Enter").await;
    use_key(&tab, "consent", "Enter").await;

    headed(&tab, "equipment").await;
    for key in ["ArrowLeft", "ArrowRight"] {
        tab.key(key).await;
    }
    use_key(&tab, "continue", " ").await;

    headed(&tab, "arena").await;
    use_key(&tab, "continue", "Enter").await;

    headed(&tab, "comprehension").await;
    let url = format!("{}?language=en", routes::texts("default"));
    let texts: Texts = server.get(&url).await.into(200);
    for (group, form) in texts.check.iter().enumerate() {
        choose(&tab, &format!("check-{group}"), "0", form.answer).await;
    }
    use_key(&tab, "submit", "Enter").await;
    tab.until(&format!("{}?.disabled === false", Tab::at("continue"))).await;
    headed(&tab, "continue").await;
    use_key(&tab, "continue", "Enter").await;

    // From the menu, open the question whether to withdraw, and go back.
    tab.until(&format!("document.activeElement === {}", Tab::at("start"))).await;
    tab.picture("zoomed-ready").await;
    reach(&tab, "SUMMARY").await;
    tab.key("Enter").await;
    use_key(&tab, "stop", "Enter").await;
    headed(&tab, "withdrawal").await;
    use_key(&tab, "back", "Enter").await;

    for key in [" ", "Enter", " "] {
        drive(&tab, key).await;
        tab.until(&["start", "rest", "questions"].map(Tab::at).join(" || ")).await;
        if tab.eval::<bool>(&format!("Boolean({})", Tab::at("rest"))).await {
            headed(&tab, "rest").await;
            use_key(&tab, "continue", "Enter").await;
        }
    }

    headed(&tab, "questions").await;
    choose(&tab, "answer-difficulty", "1", 3).await;
    choose(&tab, "answer-games", "never", 1).await;
    use_key(&tab, "submit", "Enter").await;
    headed(&tab, "completion-code").await;
    reach(&tab, "return").await;
    browser.close().await;
}
