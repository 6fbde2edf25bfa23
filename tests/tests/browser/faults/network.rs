//! Network interruptions.

use super::{QUICK, complete, glide, participants, take_part, text};
use crate::{equipped, send_answers, start, stored, until_saved};
use sidestep_tests::{Browser, Cut, Proxy, Server, Tab};

const UNREACHABLE: &str = "The server cannot be reached.";
const KEEPS_TRYING: &str = "This page keeps trying.";

/// Drives two scenes, and cuts the network at the upload of the first one.
async fn cut_at_an_upload(cut: Cut) {
    let server = Server::with_client(QUICK).await;
    let proxy = Proxy::start(&server.origin).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    take_part(&tab, &format!("{}/s/default", proxy.origin)).await;
    proxy.cut(cut, "/trials/");
    glide(&tab).await;
    tab.until_says("saved", "1 scene not sent yet; it is saved on this computer.").await;
    // If only the response was lost, the server has already stored the scene.
    assert_eq!(stored(&server).await.len(), usize::from(cut == Cut::After), "{cut:?}");
    proxy.mend();
    until_saved(&tab).await;
    glide(&tab).await;
    complete(&tab, &server, 2).await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_cut_before_during_or_after_an_upload_stores_it_once() {
    let cases = [Cut::Before, Cut::During, Cut::After].map(cut_at_an_upload);
    let [before, during, after] = cases;
    tokio::join!(before, during, after);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_whole_session_without_network_ends_with_the_code() {
    let (server, browser, tab) = start(QUICK).await;
    take_part(&tab, &format!("{}/s/default", server.origin)).await;
    tab.offline(true).await;
    glide(&tab).await;
    tab.until_says("saved", "1 scene not sent yet; it is saved on this computer.").await;
    glide(&tab).await;
    tab.until_says("saved", "2 scenes not sent yet; they are saved on this computer.").await;
    assert!(
        text(&tab).await.contains("2 scenes are still to be sent. Please keep this page open.")
    );
    tab.is_accessible().await;
    assert!(stored(&server).await.is_empty());
    tab.offline(false).await;
    complete(&tab, &server, 2).await;
    browser.close().await;
}

/// A study with every kind of request except uploads of scenes.
const ASKING: &str = r#"
slug = "default"
title = "Asking"
phases = [{ phase = "task", scenes = 1 }]
[[questions]]
name = "hard"
kind = "scale"
required = true
text = { en = "How hard was it?" }
low = { en = "easy" }
high = { en = "hard" }
"#;

/// Performs an action whose first response from the server is lost.
async fn answer_lost(tab: &Tab, proxy: &Proxy, route: &'static str, act: impl AsyncFnOnce()) {
    proxy.cut(Cut::After, route);
    act().await;
    tab.until_says("trouble", UNREACHABLE).await;
    assert!(tab.words("trouble").await.contains(KEEPS_TRYING));
    proxy.mend();
    tab.until(&format!("!{}", Tab::at("trouble"))).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whatever_answer_is_lost_the_page_goes_on_by_itself() {
    let quick = QUICK.split_once("[parameters]").expect("its parameters").1;
    let quick = quick.split_once("[comprehension]").expect("its check").0;
    let server = Server::with_client(&format!("{ASKING}[parameters]{quick}")).await;
    let proxy = Proxy::start(&server.origin).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    let url = format!("{}/s/default", proxy.origin);

    // The response with the study and the response with its texts are both lost.
    answer_lost(&tab, &proxy, "/api/v1/studies/", async || tab.go(&url).await).await;
    tab.press("consent").await;
    equipped(&tab).await;
    answer_lost(&tab, &proxy, "/participants ", async || tab.press("continue").await).await;
    tab.words("arena").await;
    assert_eq!(participants(&server).await, 1);
    tab.press("continue").await;
    let check = async || {
        tab.words("comprehension").await;
        send_answers(&tab, &server, "en").await;
    };
    answer_lost(&tab, &proxy, "/me/comprehension", check).await;
    tab.press("continue").await;
    glide(&tab).await;
    tab.press("answer-hard-4").await;
    proxy.cut(Cut::After, "/me/answers");
    tab.press("submit").await;
    tab.until_says("trouble", KEEPS_TRYING).await;
    proxy.cut(Cut::After, "/me/complete");
    tab.until(&format!(
        "document.querySelector('h1').textContent.startsWith('Sending') && {}",
        Tab::at("trouble")
    ))
    .await;
    proxy.mend();
    complete(&tab, &server, 1).await;

    // The response with the progress is lost at a reload. Afterwards the page shows the code again.
    answer_lost(&tab, &proxy, "/participants/me ", async || tab.reload().await).await;
    complete(&tab, &server, 1).await;
    browser.close().await;
}
