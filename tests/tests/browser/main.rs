//! Participants and experimenters in a real browser.

mod hour;
mod keyboard;
mod faults;
mod scenes;
mod studies;
mod laboratory;
mod predictors;
mod simulated;
mod viewer;

use sidestep::api::{TrialDetail, TrialPage, TrialUpload, routes};
use sidestep::chart::colours;
use sidestep_tests::browser::{NARROW, WIDE, count_pixels};
use sidestep_tests::participant::{
    answer_check, begin, drive, equipped, instructed, send_answers, understood,
};
use sidestep_tests::{Browser, Server, Tab};

const HUMAN: [u8; 3] = colours::HUMAN.light;
const ROBOT: [u8; 3] = colours::ROBOT.light;

/// Starts a server with this study, and a browser with an empty tab.
async fn start(study: &str) -> (Server, Browser, Tab) {
    let server = Server::with_client(study).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    (server, browser, tab)
}

async fn until_saved(tab: &Tab) {
    tab.until_says("saved", "✓").await;
}

async fn until_waiting(tab: &Tab) {
    tab.until_says("saved", "1 scene not sent yet").await;
}

async fn until_predicted(tab: &Tab) {
    tab.until_says("regions", "5.33").await;
}

/// The names of the records that the page has stored in the browser.
async fn kept(tab: &Tab) -> Vec<String> {
    let names = "new Promise(done => indexedDB.open('sidestep').onsuccess = event => { \
                 const store = event.target.result.transaction('kept').objectStore('kept'); \
                 store.getAllKeys().onsuccess = event => done(event.target.result) })";
    tab.eval(names).await
}

/// Makes the page record the trials that it sends.
const REMEMBER: &str = "const send = window.fetch; window.sent = []; window.fetch = (request) => { \
    if (request.method === 'PUT' && request.url.includes('/trials/')) \
        request.clone().text().then(text => window.sent.push(text)); \
    return send(request) };";

/// The recorded trials, oldest first.
async fn sent(tab: &Tab) -> Vec<TrialUpload> {
    let sent: Vec<String> = tab.eval("window.sent").await;
    sent.iter().map(|text| serde_json::from_str(text).expect("a trial")).collect()
}

/// The trials that the server has stored, oldest first.
async fn stored(server: &Server) -> Vec<TrialDetail> {
    let page: TrialPage = server.admin(&routes::admin_trials("default")).await.into(200);
    let mut trials = Vec::new();
    for summary in page.trials.into_iter().rev() {
        trials.push(server.admin(&routes::admin_trial(&summary.trial_id)).await.into(200));
    }
    trials
}

async fn sign_in(tab: &Tab, server: &Server) {
    tab.go(&format!("{}/lab#key={}", server.origin, server.key)).await;
    tab.until(&Tab::at("studies")).await;
    let address: String = tab.eval("location.href").await;
    assert!(!address.contains(&server.key), "the key must leave the address");
}

/// The combinations in which every page is checked: the size of the window, and whether the colour
/// scheme is dark.
const LOOKS: [((u32, u32), bool); 4] =
    [(WIDE, false), (WIDE, true), (NARROW, false), (NARROW, true)];

/// Takes a screenshot of a page for each entry of [`LOOKS`], and checks the page each time.
async fn take(tab: &Tab, name: &str) {
    for look in LOOKS {
        picture(tab, name, look).await;
        tab.is_well().await;
    }
    tab.look(WIDE, false).await;
}

async fn picture(tab: &Tab, name: &str, (size, dark): ((u32, u32), bool)) {
    tab.look(size, dark).await;
    tab.until_painted().await;
    let scheme = if dark { "dark" } else { "light" };
    tab.picture(&format!("{name}-{}-{scheme}", size.0)).await;
}

/// Checks that both level sets are drawn: switching a level set off removes pixels of its colour.
async fn draws_level_sets(tab: &Tab) {
    for (layer, colour) in [("v-hr", HUMAN), ("v-rh", ROBOT)] {
        let with = count_pixels(&tab.picture("level-set").await, colour);
        tab.press(&format!("layer-{layer}")).await;
        let without = count_pixels(&tab.picture("no-level-set").await, colour);
        assert!(with > without + 50, "{layer} draws something: {with} {without}");
        tab.press(&format!("layer-{layer}")).await;
    }
}

/// Like [`draws_level_sets`], but without the other layers, which might cover the level sets.
async fn draws_level_sets_alone(tab: &Tab) {
    let others = ["trail", "danger-zone", "shfrs", "future"];
    for layer in others {
        tab.press(&format!("layer-{layer}")).await;
    }
    draws_level_sets(tab).await;
    for layer in others {
        tab.press(&format!("layer-{layer}")).await;
    }
}
