//! A newcomer's path: `sidestep serve --demo`, the participants, a replay, and the report.

use crate::{sign_in, take};
use sidestep::api::{AnalysisPage, AnalysisState, routes};
use sidestep_tests::{Browser, Server, Tab};
use std::time::Duration;

/// Waits until an analysis of the demonstration is done, and returns the id of the newest one.
async fn analysed(server: &Server) -> String {
    for _ in 0..1500 {
        let page: AnalysisPage = server.admin(&routes::admin_analyses("demo")).await.into(200);
        let done = page.analyses.into_iter().find(|it| it.state == AnalysisState::Done);
        if let Some(done) = done {
            return done.id;
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    panic!("the analysis does not end");
}

/// Checks that the page labels the data as synthetic.
async fn is_marked(tab: &Tab) {
    assert!(tab.words("marked-synthetic").await.to_lowercase().contains("synthetic"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_newcomer_goes_from_the_demonstration_to_replay_and_report() {
    let server = Server::with_client_and("", |args| {
        args.demo = true;
        args.study = None;
    })
    .await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    sign_in(&tab, &server).await;
    // Pages respond while the demonstration is being filled, and follow its progress.
    tab.press("study-demo").await;
    is_marked(&tab).await;
    tab.until_says("counts", "12 participants").await;
    tab.until_says("status", "closed").await;
    let id = analysed(&server).await;
    take(&tab, "tour-participants").await;
    tab.go(&format!("{}/lab", server.origin)).await;
    is_marked(&tab).await;
    take(&tab, "tour-home").await;
    for page in ["trials", "analyses", "export", "configuration"] {
        tab.go(&format!("{}/lab/studies/demo/{page}", server.origin)).await;
        is_marked(&tab).await;
        take(&tab, &format!("tour-{page}")).await;
    }
    // Open an excluded participant, then another participant and one of this participant's scenes.
    for (number, name) in [(5, "tour-excluded"), (3, "tour-participant")] {
        tab.go(&format!("{}/lab/studies/demo?search={number}", server.origin)).await;
        tab.until("document.querySelectorAll('.people tbody tr').length === 1").await;
        tab.run("document.querySelector('.people tbody a').click()").await;
        tab.until(&Tab::at("timeline")).await;
        is_marked(&tab).await;
        take(&tab, name).await;
    }
    tab.run("document.querySelectorAll('[data-testid=replay-link]')[20].click()").await;
    tab.until(&Tab::at("regions")).await;
    is_marked(&tab).await;
    tab.key("ArrowRight").await;
    tab.until_step("replay", 1).await;
    tab.enter("slider", "3").await;
    tab.until_step("replay", 15).await;
    take(&tab, "tour-replay").await;

    tab.go(&format!("{}/lab/analyses/{id}", server.origin)).await;
    tab.until_says("synthetic", "Synthetic data").await;
    tab.until(&Tab::at("report")).await;
    take(&tab, "tour-analysis").await;
    tab.go(&format!("{}{}", server.origin, routes::analysis_file(&id, "report.html"))).await;
    let banner: String = tab.eval("document.querySelector('.banner').textContent").await;
    assert!(banner.contains("nothing here is about people"), "{banner}");
    browser.close().await;
}
