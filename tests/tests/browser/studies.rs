//! Running studies, and access to the laboratory.

use crate::{sign_in, start, take};
use serde_json::json;
use sidestep::api::{Completed, Enrolled, KeySummary, routes};
use sidestep::scene::SceneParameters;
use sidestep_tests::browser::{Browser, Tab};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server};

async fn come(server: &Server, external_id: &str) -> Driver {
    let body = json!({ "consent": true, "external_id": external_id });
    Driver { enrolled: Driver::ask(server, body).await.into(201) }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_study_is_watched_as_it_runs() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.until(&Tab::at("first-steps")).await;
    take(&tab, "lab-first-steps").await;
    tab.press("study-default").await;
    tab.until(&Tab::at("nobody")).await;
    take(&tab, "participants-none").await;

    // People join and drive, and the page shows this without a reload.
    tab.run("window.loadedOnce = true").await;
    let finishes = come(&server, "5f3a9c").await;
    tab.until_says("participants", "joined").await;
    finishes.drive(&server, 5).await;
    let code = finishes.complete(&server).await;
    let code: Completed = code.into(200);
    tab.until_says("participants", &code.completion_code).await;
    come(&server, "77be01").await.drive(&server, 2).await;
    come(&server, "c0ffee").await.drive(&server, 4).await;
    come(&server, "d00d1e").await.withdraw(&server, "keep").await;
    tab.until_says("counts", "4 participants").await;
    tab.until_says("participants", "withdrawn").await;
    let is_first = "document.querySelector('.people tbody th').textContent";
    assert_eq!(tab.eval::<String>(is_first).await, "1");
    take(&tab, "participants").await;
    tab.run("document.querySelector('.meanings').open = true").await;
    take(&tab, "participants-meanings").await;

    // Sort, filter and search the list.
    tab.press("sort-stored").await;
    tab.until("document.querySelector('.people th[aria-sort=descending]')").await;
    tab.press("sort-number").await;
    tab.until(&format!("{is_first} === '4'")).await;
    tab.press("stage-withdrawn").await;
    tab.until("document.querySelectorAll('.people tbody tr').length === 1").await;
    assert!(tab.eval::<String>("location.search").await.contains("stage=withdrawn"));
    tab.press("stage-all").await;
    let submit = |form: &str| format!("document.querySelector('{form}').requestSubmit()");
    tab.enter("search", "77BE01").await;
    tab.run(&submit("[role=search]")).await;
    tab.until(&format!("{is_first} === '2'")).await;
    tab.until("document.querySelectorAll('.people tbody tr').length === 1").await;
    assert!(tab.eval::<bool>("window.loadedOnce").await);
    // The address restores the same list.
    tab.reload().await;
    tab.until("document.querySelectorAll('.people tbody tr').length === 1").await;
    assert_eq!(tab.eval::<String>(&format!("{}.value", Tab::at("search"))).await, "77BE01");
    tab.go(&format!("{}/lab", server.origin)).await;
    tab.until(&Tab::at("studies")).await;
    take(&tab, "lab-studies").await;

    // One participant in detail.
    tab.press("study-default").await;
    tab.press("participant-link").await;
    tab.until(&Tab::at("timeline")).await;
    assert_eq!(
        tab.eval::<usize>("document.querySelectorAll('.timeline-of-trials li').length").await,
        5
    );
    tab.enter("note", "Called at noon.\nWill come again.").await;
    tab.press("add-note").await;
    tab.until_says("notes", "Will come again").await;
    assert_eq!(tab.eval::<String>(&format!("{}.value", Tab::at("note"))).await, "");
    tab.press("exclude-open").await;
    tab.enter("reason-field", "held the phone").await;
    take(&tab, "profile").await;
    tab.press("exclude").await;
    tab.until_says("reason", "held the phone").await;
    tab.press("delete").await;
    take(&tab, "profile-excluded").await;
    tab.press("include").await;
    tab.until(&Tab::at("exclude-open")).await;
    tab.press("replay-link").await;
    tab.until(&Tab::at("replay")).await;
    tab.back().await;
    tab.press("delete").await;
    tab.press("sure").await;
    tab.until_says("no-trials", "deleted").await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn keys_are_made_and_revoked() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}/lab/access", server.origin)).await;
    tab.until(&Tab::at("keys")).await;
    tab.enter("key-name", "nightly export").await;
    tab.run(&format!("{}.click()", Tab::at("access-export"))).await;
    tab.press("make-key").await;
    let secret = tab.words("secret").await;
    assert_eq!(tab.eval::<String>(&format!("{}.value", Tab::at("key-name"))).await, "");
    tab.until_says("keys", "nightly export").await;
    tab.until_says("audit", "key made").await;
    take(&tab, "access").await;

    // The key's sign-in link gives only this access.
    let link = tab.words("sign-in-link").await;
    let guest = Browser::start().await;
    let other = guest.open(&link).await;
    other.until(&Tab::at("studies")).await;
    other.go(&format!("{}/lab/access", server.origin)).await;
    assert!(other.words("mine").await.contains("download all data"));
    take(&other, "access-export").await;

    let made: Vec<KeySummary> = server.admin(routes::ADMIN_KEYS).await.into(200);
    let id = made.iter().find(|key| key.name == "nightly export").expect("the key").id;
    tab.press(&format!("revoke-{id}")).await;
    tab.press(&format!("sure-{id}")).await;
    tab.until_says("keys", "revoked").await;
    let request = server.request(reqwest::Method::GET, routes::SESSION).bearer_auth(&secret);
    assert_eq!(request.send().await.expect("an answer").status(), 401);
    // The other browser is signed out at its next request.
    other.go(&format!("{}/lab", server.origin)).await;
    assert!(other.words("key").await.is_empty());
    guest.close().await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_study_is_made_changed_and_closed_in_the_browser() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.press("new-study").await;
    tab.until(&Tab::at("design")).await;
    take(&tab, "new-study").await;
    tab.press("as-text").await;
    let text = "slug = \"pilot\"\ntitle = \"Pilot of the spring\"\n\n[[phases]]\nphase = \"task\"\nscenes = ";
    tab.enter("toml", &format!("{text}none\n")).await;
    tab.until_says("complaint", "Line 6").await;
    take(&tab, "new-study-complaint").await;
    tab.enter("toml", &format!("{text}12\n")).await;
    tab.until(&Tab::at("sound")).await;
    tab.press("store").await;
    tab.until("location.pathname === '/lab/studies/pilot/configuration'").await;
    tab.until(&Tab::at("links")).await;
    let body = json!({ "consent": true });
    let first: Enrolled = Driver::ask_in(&server, "pilot", body.clone()).await.into(201);
    assert_eq!(first.plan.scenes().count(), 12);

    // Change the number of scenes for later participants.
    tab.reload().await;
    tab.until(&Tab::at("design")).await;
    tab.press("as-text").await;
    let shown: String = tab.eval(&format!("{}.value", Tab::at("toml"))).await;
    assert!(shown.contains("Pilot of the spring") && shown.contains("scenes = 12"), "{shown}");
    tab.enter("toml", &shown.replace("scenes = 12", "scenes = 8")).await;
    tab.until_says("changes", "phases[0].scenes").await;
    tab.press("store").await;
    assert!(tab.words("keeps").await.starts_with("1 participant has begun"));
    take(&tab, "configuration-confirm").await;
    tab.press("confirm").await;
    tab.until(&Tab::at("stored")).await;
    let later: Enrolled = Driver::ask_in(&server, "pilot", body.clone()).await.into(201);
    assert_eq!(later.plan.scenes().count(), 8);
    tab.press("set-closed").await;
    tab.until(&Tab::at("set-open")).await;
    Driver::ask_in(&server, "pilot", body).await.problem(403, "closed", None);
    tab.until_says("versions", "phases[0].scenes").await;
    take(&tab, "configuration").await;
    tab.press("copy").await;
    tab.until("document.title.startsWith('New study')").await;
    tab.until(&Tab::at("design")).await;
    tab.press("as-text").await;
    let copy: String = tab.eval(&format!("{}.value", Tab::at("toml"))).await;
    assert!(copy.starts_with("slug = \"pilot-copy\"\nstatus = \"closed\"\n"), "{copy}");
    tab.until_painted().await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_study_is_made_in_the_form() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.press("new-study").await;
    tab.until(&Tab::at("design")).await;
    // The title determines the slug, until the user enters one.
    tab.enter("field-title", "Made in a form").await;
    let name = format!("{}.value === 'made-in-a-form'", Tab::at("field-slug"));
    tab.until(&name).await;
    tab.enter("field-slug", "My Study").await;
    tab.until_says("beside", "lower-case letters").await;
    take(&tab, "form-complaint").await;
    tab.enter("field-slug", "in-a-form").await;
    tab.press("field-phases.practice").await;
    tab.until(&format!("!{}", Tab::at("field-phases[2].scenes"))).await;
    // The number is typed with keys, so the fields must stay while the server checks the draft.
    tab.run(&format!("{}.select()", Tab::at("field-phases[1].scenes"))).await;
    for key in ["1", "2"] {
        tab.key(key).await;
    }
    tab.enter("field-consent.investigator", "Ada Example").await;
    let open = |section: &str| format!("{}.open = true", Tab::at(&format!("section-{section}")));
    for section in ["questions", "comprehension", "encounters", "recruitment"] {
        tab.run(&open(section)).await;
    }
    tab.press("add-questions").await;
    let focused = "document.activeElement.dataset.testid";
    assert_eq!(tab.eval::<String>(focused).await, "field-questions[0].text.en");
    tab.enter("field-questions[0].text.en", "How hard was it?").await;

    tab.enter("field-questions[0].kind", "scale").await;
    tab.until(&Tab::at("field-questions[0].low.en")).await;
    tab.press("add-comprehension.questions").await;
    tab.until(&Tab::at("complaint")).await;
    tab.press("remove-comprehension.questions[0]").await;
    tab.press("fill-prolific").await;
    tab.until(&Tab::at("sound")).await;
    take(&tab, "form").await;
    tab.press("as-text").await;
    let text: String = tab.eval(&format!("{}.value", Tab::at("toml"))).await;
    for said in ["slug = \"in-a-form\"", "scenes = 12", "kind = \"scale\"", "PROLIFIC_PID"] {
        assert!(text.contains(said), "{said} in {text}");
    }
    assert!(!text.contains("practice"), "{text}");
    tab.press("as-form").await;
    let number = format!("{}.value", Tab::at("field-phases[1].scenes"));
    assert_eq!(tab.eval::<String>(&number).await, "12");
    tab.press("store").await;
    tab.until("location.pathname === '/lab/studies/in-a-form/configuration'").await;
    // A new study is closed, so that it can be tried before it is opened.
    tab.until(&Tab::at("set-open")).await;
    take(&tab, "configuration-closed").await;
    let body = json!({ "consent": true, "external_id": "p1" });
    Driver::ask_in(&server, "in-a-form", body.clone()).await.problem(403, "closed", None);
    let rehearsal = Browser::start().await;
    let page = format!("{}/s/in-a-form?simulate=1&speed=30", server.origin);
    let page = rehearsal.open(&page).await;
    assert!(page.words("completion-code").await.starts_with("PILOT-"));
    page.is_well().await;
    rehearsal.close().await;
    // Participants from a recruiting service would have no way back. Therefore the page warns, and
    // opening the study takes a second press.
    tab.press("set-open").await;
    tab.until_says("opening", "completed_url").await;
    tab.press("not-yet").await;
    tab.until(&format!("!{}", Tab::at("opening"))).await;
    tab.press("set-open").await;
    tab.press("open-anyway").await;
    tab.until(&Tab::at("links")).await;
    let first: Enrolled = Driver::ask_in(&server, "in-a-form", body).await.into(201);
    assert_eq!(first.plan.scenes().count(), 18);

    // Change the number for later participants. The user is asked before unsaved changes are lost.
    tab.until(&Tab::at("design")).await;
    tab.until(&Tab::at("field-phases[1].scenes")).await;
    tab.enter("field-phases[1].scenes", "10").await;
    tab.until_says("changes", "phases[1].scenes").await;
    tab.run("window.confirm = () => { window.wasAsked = true; return false; }").await;
    tab.press("tab-trials").await;
    assert!(tab.eval::<bool>("window.wasAsked === true").await);
    assert!(tab.eval::<String>("location.pathname").await.ends_with("/configuration"));
    tab.press("store").await;
    tab.press("confirm").await;
    tab.until_says("versions", "phases[1].scenes").await;
    let info: sidestep::api::StudyInfo = server.get(&routes::study("in-a-form")).await.into(200);
    assert_eq!(info.phases[1].scenes, 10);
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_analysis_is_started_and_read_in_the_browser() {
    let study =
        "slug = \"default\"\ntitle = \"Short\"\nphases = [{ phase = \"task\", scenes = 8 }]\n";
    let (server, browser, tab) = start(study).await;
    for who in 1..=2 {
        let driver = Driver::enrol(&server).await;
        driver.drive_restlessly(&server, &SceneParameters::default(), who).await;
    }
    sign_in(&tab, &server).await;
    tab.press("study-default").await;
    tab.press("tab-analyses").await;
    tab.until(&Tab::at("new-analysis")).await;
    take(&tab, "analyses-none").await;
    tab.press("ask").await;
    tab.until_says("analyses", "done").await;
    // Start another analysis for the comparison.
    tab.run(&format!("{}.querySelector('[name=leakage]').click()", Tab::at("new-analysis"))).await;
    tab.press("ask").await;
    let both = format!("{}.innerText.match(/done/g)?.length === 2", Tab::at("analyses"));
    tab.until(&both).await;
    take(&tab, "analyses").await;
    tab.press("open-analysis").await;
    tab.until(&Tab::at("report")).await;
    // The report is shown in a frame without any permissions.
    tab.until(&format!("{}.contentWindow.length === 0", Tab::at("report"))).await;
    assert!(tab.words("files").await.contains("report.html"));
    take(&tab, "analysis").await;
    let other = format!("{}.options[1].value", Tab::at("compare"));
    let other: String = tab.eval(&other).await;
    tab.enter("compare", &other).await;
    tab.until_says("accuracies", "SVM I on hrd").await;
    take(&tab, "analyses-compared").await;
    tab.press("delete").await;
    tab.press("sure").await;
    tab.until(&format!("{}.innerText.match(/done/g)?.length === 1", Tab::at("analyses"))).await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_study_is_taken_away_in_the_browser() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.press("study-default").await;
    tab.press("tab-export").await;
    tab.until(&Tab::at("no-trials")).await;
    take(&tab, "export-none").await;
    come(&server, "5f3a9c").await.drive(&server, 5).await;
    tab.until(&Tab::at("export-form")).await;
    take(&tab, "export").await;
    // Check the content of the download.
    tab.press("format-parquet").await;
    let form = Tab::at("export-form");
    let query = format!("new URLSearchParams(new FormData({form})).toString()");
    let query: String = tab.eval(&query).await;
    assert!(query.starts_with("format=parquet"), "{query}");
    let archive = format!(
        "fetch({form}.action + '?' + {query:?}).then(answer => answer.blob()).then(blob => \
         blob.slice(0, 2).text()).then(text => window.begins = text)"
    );
    tab.run(&archive).await;
    tab.until("window.begins === 'PK'").await;
    tab.until_painted().await;
    tab.is_well().await;
    browser.close().await;
}
