//! Actions of participants and experimenters, in a real browser.

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

/// A server with this study, a browser and an empty tab of it.
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

/// The names of the page's records in the browser.
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

/// The trials on the server, oldest first.
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

/// The looks of every page: the window's size, and whether it is dark.
const LOOKS: [((u32, u32), bool); 4] =
    [(WIDE, false), (WIDE, true), (NARROW, false), (NARROW, true)];

/// Takes screenshots of a page in every look, and checks each.
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

/// Checks that both level sets are on the canvas: pixels disappear when they are switched off.
async fn draws_level_sets(tab: &Tab) {
    for (layer, colour) in [("v-hr", HUMAN), ("v-rh", ROBOT)] {
        let with = count_pixels(&tab.picture("level-set").await, colour);
        tab.press(&format!("layer-{layer}")).await;
        let without = count_pixels(&tab.picture("no-level-set").await, colour);
        assert!(with > without + 50, "{layer} draws something: {with} {without}");
        tab.press(&format!("layer-{layer}")).await;
    }
}

/// The same without the other layers, which might cover them.
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
