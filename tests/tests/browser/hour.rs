//! The whole participation, page by page, in all languages.

use crate::{LOOKS, answer_check, equipped, picture, start, take};
use sidestep_tests::browser::WIDE;
use sidestep_tests::{Browser, Server, Tab};

/// A study with every kind of page, and short pauses.
pub(crate) const WHOLE_STUDY: &str = r#"
slug = "default"
title = "Avoid the robot"
languages = ["en", "de", "es", "zh-CN"]

[[phases]]
phase = "familiarisation"
scenes = 1
show_danger_zone = true
feedback = true

[[phases]]
phase = "task"
scenes = 2

[trials]
countdown_s = 2
end_s = 2.0
rest_after = 1

[consent]
investigator = "Dr Ada Example"
institution = "University of Example"
contact = "ada@example.org"
ethics = "EX-2026-17"
retention = "Ten years, on servers of the university"

[consent.text]
en = """
You are invited to a study of **how people avoid robots**. Please read this page.

- You can ask questions at any time: [ada@example.org](mailto:ada@example.org).
- There are no risks beyond those of using a computer.
"""

[[questions]]
name = "difficulty"
kind = "scale"
required = true
text = { en = "How difficult were the scenes?" }
low = { en = "very easy" }
high = { en = "very difficult" }

[[questions]]
name = "games"
kind = "choice"
text = { en = "How often do you play video games?" }
options = [
  { value = "never", text = { en = "Never" } },
  { value = "weekly", text = { en = "Every week" } },
  { value = "daily", text = { en = "Every day" } },
]

[[questions]]
name = "strategy"
kind = "text"
text = { en = "How did you decide when to steer?" }

[closing.debrief]
en = "We study whether a computed **safety level** helps to predict when people start to steer."

[recruitment]
return_hosts = ["app.prolific.com"]
completed_url = "https://app.prolific.com/submissions/complete?cc={code}"
withdrawn_url = "https://app.prolific.com/submissions/complete?cc=LEFT"
"#;

/// Takes part in the study, and takes screenshots of every page for visual inspection.
async fn walk(tab: &Tab, server: &Server, language: &str) {
    let take = async |name: &str| take(tab, &format!("{name}-{language}")).await;
    tab.go(&format!("{}/s/default?PROLIFIC_PID=walk-{language}", server.origin)).await;
    tab.words("consent").await;
    choose_language(tab, language).await;
    take("1-welcome").await;
    tab.press("consent").await;
    equipped(tab).await;
    take("2-equipment").await;
    tab.press("choose-keys").await;
    tab.words("choosing").await;
    take("2-equipment-choosing").await;
    tab.press("usual-keys").await;
    equipped(tab).await;
    tab.press("continue").await;
    tab.words("arena").await;
    take("3-instructions").await;
    tab.press("continue").await;
    tab.words("comprehension").await;
    take("4-comprehension").await;
    tab.press("check-0-0").await;
    tab.press("check-1-0").await;
    tab.press("submit").await;
    tab.words("missing").await;
    assert_eq!(tab.eval::<String>("document.activeElement.name").await, "check-2");
    take("4-comprehension-missing").await;
    tab.press("check-2-0").await;
    tab.press("submit").await;
    tab.until("document.querySelector('fieldset .trouble')").await;
    take("4-comprehension-wrong").await;
    answer_check(tab, server, language).await;
    take("4-comprehension-right").await;
    tab.press("continue").await;
    tab.words("start").await;
    take("5-ready").await;
    tab.run(&format!("{}.open = true", Tab::at("menu"))).await;
    take("5-ready-menu").await;
    tab.press("start").await;
    tab.words("countdown").await;
    tab.picture(&format!("6-countdown-{language}")).await;
    tab.until_step("scene", 8).await;
    tab.key_down("ArrowLeft").await;
    // This scene continues during the checks of `take`, so the test only takes pictures of it. The
    // next scenes are checked.
    for look in LOOKS {
        picture(tab, &format!("7-scene-{language}"), look).await;
    }
    tab.key_up("ArrowLeft").await;
    tab.look(WIDE, false).await;
    tab.words("over").await;
    tab.picture(&format!("8-over-{language}")).await;
    for _ in 0..2 {
        tab.press("start").await;
        tab.until_step("scene", 1).await;
        tab.is_well().await;
        tab.until(&format!("{} || {}", Tab::at("rest"), Tab::at("questions"))).await;
        if tab.eval::<bool>(&format!("Boolean({})", Tab::at("rest"))).await {
            take("9-rest").await;
            tab.press("continue").await;
        }
    }
    tab.press("submit").await;
    tab.words("missing").await;
    assert_eq!(tab.eval::<String>("document.activeElement.name").await, "difficulty");
    take("10-questions").await;
    tab.press("stop").await;
    tab.words("withdrawal").await;
    take("11-withdrawal").await;
    tab.press("back").await;
    tab.press("answer-difficulty-4").await;
    tab.press("submit").await;
    tab.words("completion-code").await;
    take("12-done").await;
    let url = tab.attribute("return", "href").await.expect("a link back");
    assert!(url.starts_with("https://app.prolific.com/submissions/complete?cc="), "{url}");
}

async fn choose_language(tab: &Tab, language: &str) {
    let select = Tab::at("language");
    let changed = "dispatchEvent(new Event('input', {bubbles: true}))";
    tab.run(&format!("{select}.value = '{language}', {select}.{changed}")).await;
    tab.until(&format!("document.documentElement.lang === '{language}'")).await;
}

/// Pages before the consent: the first page, a link without a proper id, and a touch screen.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_pages_before_the_consent() {
    let (server, browser, tab) = start(WHOLE_STUDY).await;
    tab.go(&format!("{}/", server.origin)).await;
    tab.words("open-studies").await;
    take(&tab, "0-home").await;
    let unfilled = "PROLIFIC_PID=%7B%7B%25PROLIFIC_PID%25%7D%7D";
    tab.go(&format!("{}/s/default?{unfilled}", server.origin)).await;
    tab.until_says("stuck", "Your link is not complete").await;
    take(&tab, "0-link").await;
    tab.before_pages(
        "const ask = matchMedia; \
         window.matchMedia = query => query.includes('any-') ? {matches: query.includes('coarse')} \
         : ask(query)",
    )
    .await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    tab.words("touch").await;
    take(&tab, "0-touch").await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_hour_in_every_language() {
    let server = Server::with_client(WHOLE_STUDY).await;
    // Each language has its own browser, because a background tab gets no frames.
    let walks = ["en", "de", "es", "zh-CN"].map(async |language| {
        let browser = Browser::start().await;
        let tab = browser.open("about:blank").await;
        walk(&tab, &server, language).await;
        browser.close().await;
    });
    let [en, de, es, zh] = walks;
    tokio::join!(en, de, es, zh);
}
