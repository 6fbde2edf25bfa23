//! The demonstration, driven with real keys and watched.

use crate::{ROBOT, sign_in, start, take};
use reqwest::Method;
use sidestep_tests::browser::count_pixels;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Browser, Server, Tab};

/// Without an account, a visitor drives a scene with the keys, gets points and a trained model, and
/// starts another scene.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn anybody_drives_and_is_predicted() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    tab.go(&server.origin).await;
    tab.press("demo").await;
    tab.until(&Tab::at("card")).await;
    take(&tab, "demo-ready").await;
    tab.key(" ").await;
    tab.until_step("demo", 5).await;
    tab.key_down("ArrowLeft").await;
    tab.until_step("demo", 20).await;
    let red = count_pixels(&tab.picture("demo-driving").await, ROBOT);
    assert!(red > 50, "the robot is drawn: {red}");
    tab.key_up("ArrowLeft").await;
    tab.press("layer-shade-rh").await;
    tab.until("document.querySelector('[data-testid=layer-shade-rh]').ariaPressed === 'true'")
        .await;
    tab.until_says("card", "at the closest").await;
    tab.until_says("model", "trained on 1 scene").await;
    assert!(tab.words("total").await.contains("1 scene"));
    take(&tab, "demo-over").await;
    // Space presses a button that the user has reached with the keyboard. After a mouse click on a
    // button, the space key starts a scene.
    let pressed = format!("{}.ariaPressed", Tab::at("legend-switch"));
    tab.run(&format!("{}.focus()", Tab::at("legend-switch"))).await;
    tab.key(" ").await;
    tab.until(&format!("{pressed} === 'true'")).await;
    tab.click("legend-switch").await;
    tab.until(&format!("{pressed} === 'false'")).await;
    tab.key(" ").await;
    tab.until_step("demo", 2).await;
    assert_eq!(tab.attribute("demo", "data-scene").await.as_deref(), Some("1"));
    tab.key("Escape").await;
    tab.until_step("demo", 0).await;

    tab.press("watch").await;
    tab.press("start").await;
    tab.until_step("demo", 3).await;
    tab.press("pause").await;
    let link: String = tab.eval("location.search").await;
    assert_eq!(link, "?driver=synthetic-1&show=shade-rh,v-hr,v-rh,danger-zone,shfrs,future,trail");
    tab.press("legend-switch").await;
    take(&tab, "demo-watched").await;
    browser.close().await;
}

/// Experimenters can open the demonstration from the navigation. Other people can open it only if
/// the server has `--open-demo`.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_operator_decides_who_may_drive() {
    let server = Server::with_client_and(SHORT_STUDY, |args| args.open_demo = false).await;
    let answer = server.request(Method::GET, "/demo").send().await.expect("an answer");
    assert_eq!(answer.status(), 404);
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    tab.go(&server.origin).await;
    tab.until(&format!("!{}", Tab::at("demo"))).await;
    sign_in(&tab, &server).await;
    tab.run("document.querySelector('nav a[href=\"/lab/demo\"]').click()").await;
    tab.until(&Tab::at("card")).await;
    tab.is_well().await;
    browser.close().await;
}
