//! Actions of a participant on the real page, with real key presses.

use crate::{Server, Tab};
use sidestep::api::{Texts, routes};

/// Opens the study's page and goes on to the first scene.
pub async fn begin(tab: &Tab, server: &Server) {
    tab.go(&format!("{}/s/default", server.origin)).await;
    instructed(tab).await;
    understood(tab, server, "en").await;
}

/// Goes from the consent text to the instructions.
pub async fn instructed(tab: &Tab) {
    tab.press("consent").await;
    equipped(tab).await;
    tab.press("continue").await;
    tab.words("arena").await;
}

/// Presses both keys, to show the page that they work.
pub async fn equipped(tab: &Tab) {
    tab.words("equipment").await;
    for key in ["ArrowLeft", "ArrowRight"] {
        tab.key_down(key).await;
        tab.key_up(key).await;
    }
    tab.until(&format!("{}?.disabled === false", Tab::at("continue"))).await;
}

/// Goes from the instructions to the first scene. Answers a comprehension check correctly.
pub async fn understood(tab: &Tab, server: &Server, language: &str) {
    tab.press("continue").await;
    tab.until(&format!("{} || {}", Tab::at("start"), Tab::at("comprehension"))).await;
    if tab.eval::<bool>(&format!("!{}", Tab::at("start"))).await {
        answer_check(tab, server, language).await;
        tab.press("continue").await;
    }
    tab.words("start").await;
}

/// Answers the comprehension check correctly, and waits until the answers are stored.
pub async fn answer_check(tab: &Tab, server: &Server, language: &str) {
    send_answers(tab, server, language).await;
    tab.until(&format!("{}?.disabled === false", Tab::at("continue"))).await;
}

/// Answers the comprehension check correctly, but does not wait until the answers are stored.
pub async fn send_answers(tab: &Tab, server: &Server, language: &str) {
    let url = format!("{}?language={language}", routes::texts("default"));
    let texts: Texts = server.get(&url).await.into(200);
    for (place, form) in texts.check.iter().enumerate() {
        tab.press(&format!("check-{place}-{}", form.answer)).await;
    }
    tab.press("submit").await;
}

/// Drives a scene with one key held from step 5 to step 40, and waits until the scene has ended.
pub async fn drive(tab: &Tab, key: &str) {
    tab.press("start").await;
    tab.until_step("scene", 5).await;
    tab.key_down(key).await;
    tab.until_step("scene", 40).await;
    tab.key_up(key).await;
    tab.until(&format!("!{}", Tab::at("scene"))).await;
}
