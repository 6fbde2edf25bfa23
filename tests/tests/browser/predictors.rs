//! The models of an analysis: from the list to a replay.

use crate::{LOOKS, picture, sign_in, start, take, until_predicted};
use reqwest::Method;
use serde_json::json;
use sidestep::api::{AnalysisDetail, AnalysisState, AnalysisSummary, routes};
use sidestep::scene::SceneParameters;
use sidestep_tests::browser::{NARROW, WIDE};
use sidestep_tests::{Answer, Driver, Server, Tab};
use std::time::Duration;

const STUDY: &str =
    "slug = \"default\"\ntitle = \"Short\"\nphases = [{ phase = \"task\", scenes = 8 }]\n";

/// Starts an analysis of the study, waits until it is done, and returns its id.
async fn analysed(server: &Server) -> String {
    let request = server.request(Method::POST, &routes::admin_analyses("default"));
    let request = request.bearer_auth(&server.key).json(&json!({ "paper_only": true }));
    let asked: AnalysisSummary = Answer::of(request).await.into(201);
    for _ in 0..600 {
        let now: AnalysisDetail = server.admin(&routes::admin_analysis(&asked.id)).await.into(200);
        if now.summary.state == AnalysisState::Done {
            return asked.id;
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    panic!("the analysis does not end");
}

async fn search(tab: &Tab) -> String {
    tab.eval("location.search").await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_model_goes_from_the_list_to_a_replay() {
    let (server, browser, tab) = start(STUDY).await;
    let mut drivers = Vec::new();
    for who in 1..=2 {
        let driver = Driver::enrol(&server).await;
        driver.drive_restlessly(&server, &SceneParameters::default(), who).await;
        drivers.push(driver);
    }
    let id = analysed(&server).await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}/lab/analyses/{id}", server.origin)).await;
    tab.until_says("range", "1–20 of 180").await;
    for look in LOOKS {
        tab.look(look.0, look.1).await;
        tab.run("document.getElementById('predictors').scrollIntoView()").await;
        picture(&tab, "predictors", look).await;
        tab.is_well().await;
    }
    tab.look(WIDE, false).await;
    tab.press("next").await;
    tab.until_says("range", "21–40 of 180").await;
    for (choice, value) in [("participant", "2"), ("model", "lr"), ("experiment", "1")] {
        tab.enter(&format!("only-{choice}"), value).await;
    }
    tab.until_says("range", "1–9 of 9").await;
    tab.until_search("?participant=2&model=lr&experiment=1").await;

    // The selection is in the address, and the file exists.
    tab.reload().await;
    tab.until_says("range", "1–9 of 9").await;
    let file = format!(
        "fetch({}.href).then(async it => [it.status, (await it.json()).format])",
        Tab::at("download")
    );
    let (status, format): (u16, String) = tab.eval(&file).await;
    assert_eq!((status, format.as_str()), (200, "sidestep-predictor/1"));

    // The last task was held out.
    tab.press("use-in-replay").await;
    tab.until_says("trial-use", "held out").await;
    tab.until(&Tab::at("regions")).await;
    let newest = &drivers[1].scenes()[7].0;
    assert_eq!(tab.eval::<String>("location.pathname").await, format!("/lab/replay/{newest}"));
    assert!(tab.words("predictor").await.contains("Logistic regression on hrd of participant 2"));
    let linked = search(&tab).await;
    take(&tab, "replay-held-out").await;

    // The first task was used in training, so there is a warning. The replay keeps its time, and
    // the model is in the address.
    tab.go(&format!("{}/lab/replay/{}", server.origin, drivers[1].scenes()[0].0)).await;
    until_predicted(&tab).await;
    tab.enter("slider", "3.4").await;
    tab.until_step("replay", 17).await;
    assert!(!tab.eval::<bool>(&format!("!!{}", Tab::at("trained-on-this"))).await);
    let model = format!("{id}/models/lr-1-hrd-2.json");
    tab.until_says("choose-predictor", "Logistic regression on hrd, ").await;
    let before: String = tab.words("regions").await;
    tab.enter("choose-predictor", &model).await;
    tab.until_says("trained-on-this", "This model was trained on this trial").await;
    tab.until(&Tab::at("regions")).await;
    let chosen = format!("{}.value", Tab::at("choose-predictor"));
    let slider = format!("{}.value", Tab::at("slider"));
    assert_eq!(tab.eval::<String>(&slider).await, "3.4");
    tab.until_search(&format!("{linked}&t=3.4")).await;
    assert_ne!(tab.words("regions").await, before, "another model predicts something else");
    take(&tab, "replay-trained-on-this").await;
    // In a narrow window the control is below the timeline.
    for look in [(NARROW, false), (NARROW, true)] {
        tab.look(look.0, look.1).await;
        tab.run(&format!("{}.scrollIntoView()", Tab::at("choose-predictor"))).await;
        picture(&tab, "replay-choose", look).await;
    }
    tab.look(WIDE, false).await;
    tab.reload().await;
    tab.until(&Tab::at("trained-on-this")).await;
    tab.until_says("choose-predictor", "Decision tree on hrd, ").await;
    assert_eq!(tab.eval::<String>(&chosen).await, model);
    // Choose a model of another kind, and follow a link to a model of the other participant.
    tab.enter("choose-predictor", &format!("{id}/models/svm_rbf-1-hrd_body-2.json")).await;
    tab.until_says("predictor", "SVM, RBF kernel on hrd_body").await;
    tab.until(&Tab::at("regions")).await;
    tab.enter("choose-predictor", "").await;
    tab.until_says("predictor", "too few earlier trials").await;
    tab.until_search("?t=3.4").await;
    tab.is_well().await;
    let of_other = "?analysis=ID&file=models/dt-1-hrd-1.json".replace("ID", &id);
    let address = format!("{}/lab/replay/{newest}{of_other}", server.origin);
    tab.go(&address).await;
    tab.until_says("trial-use", "participant 1, who did not drive this trial").await;
    tab.until(&format!("{chosen} === {:?}", format!("{id}/models/dt-1-hrd-1.json"))).await;
    tab.is_well().await;
    browser.close().await;
}
