//! Invalid links, people who join twice, and studies that change during a participation.

use super::{QUICK, complete, glide, participants, take_part, text};
use crate::{start, stored, until_saved};
use sidestep_tests::Browser;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn links_that_are_wrong_say_so_and_do_no_harm() {
    let (server, browser, tab) = start(QUICK).await;
    tab.go(&format!("{}/s/another", server.origin)).await;
    assert!(tab.words("stuck").await.contains("Study not found. Please check the link"));

    // Open a forged personal link in an unused browser.
    let forged = format!("{}/s/default#continue={}", server.origin, "0".repeat(64));
    tab.go(&forged).await;
    tab.until_says("trouble", "This personal link is not valid.").await;
    assert!(!tab.eval::<String>("location.href").await.contains("continue"));
    assert_eq!(participants(&server).await, 0);

    // Open the link in a participant's browser, where it does not end their session.
    take_part(&tab, &format!("{}/s/default", server.origin)).await;
    glide(&tab).await;
    until_saved(&tab).await;
    tab.go("about:blank").await;
    tab.go(&forged).await;
    tab.words("start").await;
    assert!(text(&tab).await.contains("Task 2 of 2"));
    glide(&tab).await;
    complete(&tab, &server, 2).await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whoever_joins_twice_with_one_id_is_one_participant() {
    let (server, browser, tab) = start(QUICK).await;
    let url = |id: &str| format!("{}/s/default?PROLIFIC_PID={id}", server.origin);
    take_part(&tab, &url("P1")).await;
    glide(&tab).await;
    until_saved(&tab).await;
    // Open the link with the same id, spelled differently, in another browser.
    let second = Browser::start().await;
    let other = second.open("about:blank").await;
    other.go(&url("%20p1%20")).await;
    other.press("consent").await;
    crate::equipped(&other).await;
    other.press("continue").await;
    other.words("start").await;
    assert!(text(&other).await.contains("Task 2 of 2"));
    glide(&other).await;
    complete(&other, &server, 2).await;
    second.close().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_study_that_is_closed_in_the_middle_lets_people_finish_and_an_archived_one_says_so() {
    for (status, words) in [("closed", ""), ("archived", "Nothing can be sent any more.")] {
        let (server, browser, tab) = start(QUICK).await;
        take_part(&tab, &format!("{}/s/default", server.origin)).await;
        glide(&tab).await;
        until_saved(&tab).await;
        let changed = QUICK.replace("title", &format!("status = \"{status}\"\ntitle"));
        let server = server.restarted_with_study(&changed).await;
        glide(&tab).await;
        if words.is_empty() {
            complete(&tab, &server, 2).await;
        } else {
            assert!(tab.words("ended").await.contains(words));
            assert_eq!(stored(&server).await.len(), 1);
            // The message also appears after a reload.
            tab.reload().await;
            tab.until(&format!("document.body.innerText.includes({words:?})")).await;
        }
        browser.close().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whoever_has_withdrawn_finds_the_end_and_the_link_again() {
    let study = format!(
        "{QUICK}\n[recruitment]\nreturn_hosts = [\"app.example.org\"]\n\
         withdrawn_url = \"https://app.example.org/left?p={{external_id}}\"\n"
    );
    let (server, browser, tab) = start(&study).await;
    take_part(&tab, &format!("{}/s/default?external_id=P-7", server.origin)).await;
    tab.press("stop").await;
    tab.press("withdraw-keep").await;
    for _ in 0..2 {
        tab.words("ended").await;
        let link = tab.attribute("return", "href").await;
        assert_eq!(link.as_deref(), Some("https://app.example.org/left?p=P-7"));
        tab.reload().await;
    }
    browser.close().await;
}
