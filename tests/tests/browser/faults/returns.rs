//! On every page of the study, participants reload the page or close its tab, or their browser is
//! killed.

use super::{complete, participants, text};
use crate::{answer_check, equipped, stored};
use sidestep::trial::Flag;
use sidestep_tests::{Browser, Server, Tab};

/// A study that shows each page long enough for the test to leave it, even on a busy machine.
const STUDY: &str = r#"
slug = "default"
title = "Every page"
phases = [{ phase = "task", scenes = 2 }]

[trials]
countdown_s = 5
end_s = 5.0
rest_after = 1

[[questions]]
name = "hard"
kind = "scale"
required = true
text = { en = "How hard was it?" }
low = { en = "easy" }
high = { en = "hard" }
"#;

#[derive(Clone, Copy, Debug)]
enum Away {
    Reload,
    Close,
    Kill,
}

/// A participant whose page is repeatedly reloaded or closed, or whose browser is killed.
struct Person {
    away: Away,
    url: String,
    browser: Browser,
    tab: Tab,
}

impl Person {
    async fn new(away: Away, server: &Server) -> Self {
        let url = format!("{}/s/default", server.origin);
        let browser = Browser::start().await;
        let tab = browser.open(&url).await;
        Self { away, url, browser, tab }
    }

    /// Leaves the page and comes back.
    async fn back(self) -> Self {
        let Self { away, url, browser, tab } = self;
        let (browser, tab) = match away {
            Away::Reload => {
                tab.reload().await;
                (browser, tab)
            }
            Away::Close => {
                let next = browser.open("about:blank").await;
                tab.close().await;
                next.go(&url).await;
                (browser, next)
            }
            Away::Kill => {
                drop(tab);
                let browser = browser.killed().await;
                let tab = browser.open(&url).await;
                (browser, tab)
            }
        };
        Self { away, url, browser, tab }
    }
}

async fn walk(away: Away) {
    let server = Server::with_client(STUDY).await;
    let mut person = Person::new(away, &server).await;

    // Without an enrolment, the page starts with the consent text.
    person.tab.words("consent").await;
    person = person.back().await;
    person.tab.press("consent").await;
    person.tab.words("equipment").await;
    person = person.back().await;
    person.tab.press("consent").await;
    equipped(&person.tab).await;
    person.tab.press("continue").await;

    // Before the first scene, the page continues with the instructions.
    person.tab.words("arena").await;
    person = person.back().await;
    person.tab.words("arena").await;
    assert_eq!(participants(&server).await, 1, "{away:?}");
    person.tab.press("continue").await;
    person.tab.words("comprehension").await;
    person = person.back().await;
    person.tab.words("arena").await;
    person.tab.press("continue").await;
    answer_check(&person.tab, &server, "en").await;
    person.tab.press("continue").await;
    person.tab.words("start").await;
    person = person.back().await;
    // A passed check is not asked again.
    person.tab.words("arena").await;
    person.tab.press("continue").await;
    person.tab.press("start").await;
    person.tab.words("countdown").await;
    person = person.back().await;
    person.tab.words("arena").await;
    person.tab.press("continue").await;

    // A scene that has started to move is repeated, and the repetition is counted.
    person.tab.press("start").await;
    person.tab.until_step("scene", 3).await;
    person = person.back().await;
    person.tab.words("start").await;
    assert!(text(&person.tab).await.contains("Task 1 of 2"), "{away:?}");
    person.tab.press("start").await;
    person.tab.words("over").await;
    crate::until_saved(&person.tab).await;
    assert_eq!(stored(&server).await.len(), 1, "{away:?}");
    person = person.back().await;
    person.tab.words("start").await;
    assert!(text(&person.tab).await.contains("Task 2 of 2"), "{away:?}");
    person.tab.press("start").await;
    person.tab.words("questions").await;
    person = person.back().await;
    person.tab.press("answer-hard-4").await;
    person.tab.press("submit").await;
    let code = person.tab.words("completion-code").await;
    person = person.back().await;
    assert_eq!(person.tab.words("completion-code").await, code, "{away:?}");
    let trials = complete(&person.tab, &server, 2).await;
    let shown_before = trials.iter().map(|t| t.summary.flags.contains(&Flag::ShownBefore));
    assert_eq!(shown_before.collect::<Vec<_>>(), [true, false], "{away:?}");
    person.browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whoever_comes_back_goes_on_as_the_same_person_at_every_page() {
    let [reload, close, kill] = [Away::Reload, Away::Close, Away::Kill].map(walk);
    tokio::join!(reload, close, kill);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rest_is_over_when_the_page_comes_back_and_the_next_scene_waits() {
    let study = STUDY.replace("end_s = 5.0", "end_s = 0.0");
    let server = Server::with_client(&study).await;
    let mut person = Person::new(Away::Reload, &server).await;
    person.tab.press("consent").await;
    equipped(&person.tab).await;
    person.tab.press("continue").await;
    crate::understood(&person.tab, &server, "en").await;
    person.tab.press("start").await;
    person.tab.words("rest").await;
    crate::until_saved(&person.tab).await;
    person = person.back().await;
    person.tab.words("start").await;
    assert!(text(&person.tab).await.contains("Task 2 of 2"));
    assert_eq!(stored(&server).await.len(), 1);
    person.browser.close().await;
}
