//! What participants and experimenters do, in a real browser.

use reqwest::Method;
use sidestep::api::{StudyInfo, StudySummary, TrialDetail, TrialPage, routes};
use sidestep::chart::colours;
use sidestep::safety::value_function;
use sidestep::scene::Evader;
use sidestep::trial::simulation_fingerprint;
use sidestep::vehicle::TurnInput;
use sidestep_tests::browser::{NARROW, WIDE, count_pixels};
use sidestep_tests::server::{SHORT_STUDY, UNEQUAL_STUDY};
use sidestep_tests::{Browser, Driver, Server, Tab, driven_with};
use std::ops::ControlFlow;
use std::time::Duration;

const HUMAN: [u8; 3] = colours::HUMAN.light;
const ROBOT: [u8; 3] = colours::ROBOT.light;

/// A server with this study, a browser and an empty tab of it.
async fn start(study: &str) -> (Server, Browser, Tab) {
    let server = Server::with_client(study).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    (server, browser, tab)
}

/// Takes part in the study, up to the first scene.
async fn begin(tab: &Tab, server: &Server) {
    tab.go(&format!("{}/s/default", server.origin)).await;
    tab.press("consent").await;
    tab.press("continue").await;
}

/// Drives a scene with one key held from step 5 to step 40.
async fn drive(tab: &Tab, key: &str) {
    tab.press("start").await;
    tab.until_step("scene", 5).await;
    tab.key_down(key).await;
    tab.until_step("scene", 40).await;
    tab.key_up(key).await;
    tab.until(&format!("!{}", Tab::at("scene"))).await;
}

async fn until_saved(tab: &Tab) {
    tab.until_says("saved", "✓").await;
}

async fn until_waiting(tab: &Tab) {
    tab.until_says("saved", "1 scene not uploaded yet").await;
}

async fn until_predicted(tab: &Tab) {
    tab.until_says("regions", "5.33").await;
}

/// The names of what the browser keeps for the page.
async fn kept(tab: &Tab) -> Vec<String> {
    let names = "new Promise(done => indexedDB.open('sidestep').onsuccess = event => { \
                 const store = event.target.result.transaction('kept').objectStore('kept'); \
                 store.getAllKeys().onsuccess = event => done(event.target.result) })";
    tab.eval(names).await
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
    tab.until(&format!("{} || document.querySelector('.empty')", Tab::at("trials"))).await;
    let address: String = tab.eval("location.href").await;
    assert!(!address.contains(&server.key), "the key must leave the address");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_scene_from_key_press_to_predicted_set() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    begin(&tab, &server).await;

    // Drive, and look at the canvas meanwhile.
    tab.press("start").await;
    tab.until_step("scene", 5).await;
    tab.key_down("ArrowLeft").await;
    tab.until_step("scene", 20).await;
    let picture = tab.picture("scene-driving").await;
    assert!(count_pixels(&picture, HUMAN) > 100, "the blue vehicle is drawn");
    assert!(count_pixels(&picture, ROBOT) > 300, "the robot and its goal are drawn");
    assert_eq!(tab.attribute("scene", "data-phase").await.as_deref(), Some("familiarisation"));
    let trial_id = tab.attribute("scene", "data-trial").await.expect("a trial");
    tab.until_step("scene", 40).await;
    tab.key_up("ArrowLeft").await;
    until_saved(&tab).await;
    tab.is_well().await;

    // The trial is in the database, whole and exact.
    let trials = stored(&server).await;
    assert_eq!(trials.len(), 1);
    let trial = &trials[0];
    assert_eq!(trial.summary.trial_id, trial_id);
    assert_eq!((trial.inputs.len(), trial.states.len()), (50, 51));
    assert!(trial.replay.exact, "{:?}", trial.replay);
    assert_eq!(trial.replay.max_position_error_m, 0.0);
    let lefts: Vec<_> = (0..50).filter(|&i| trial.inputs[i] == TurnInput::Left).collect();
    assert!((28..=37).contains(&lefts.len()), "held for about 35 steps: {lefts:?}");
    assert!(lefts.windows(2).all(|pair| pair[1] == pair[0] + 1), "{lefts:?}");
    assert!(trial.inputs.iter().all(|&input| input != TurnInput::Right));

    // It is in the export.
    let export = server.export("default").await;
    let mut reader = csv::Reader::from_reader(export.as_bytes());
    let headers = reader.headers().expect("a header").clone();
    let column = |name: &str| headers.iter().position(|h| h == name).expect("a column");
    let (hx, omega) = (column("hx"), column("omega"));
    let rows: Vec<_> = reader.records().map(|row| row.expect("a row")).collect();
    assert_eq!(rows.len(), 50);
    for (i, row) in rows.iter().enumerate() {
        let number = |at: usize| row[at].parse::<f64>().expect("a number");
        assert_eq!(number(hx).to_bits(), trial.states[i].human.x.to_bits());
        assert_eq!(number(omega), 0.5 * f64::from(trial.inputs[i].sign()));
    }

    // It is replayed with everything drawn on it.
    sign_in(&tab, &server).await;
    assert!(tab.words("trials").await.contains("familiarisation 1"));
    tab.press("replay-link").await;
    until_predicted(&tab).await;
    assert_eq!(tab.attribute("replay", "data-trial").await, Some(trial_id));
    tab.run(&format!("{}.focus()", Tab::at("slider"))).await;
    for _ in 0..10 {
        tab.key_down("ArrowRight").await;
        tab.key_up("ArrowRight").await;
    }
    tab.until_step("replay", 10).await;
    let picture = tab.picture("replay").await;
    for (j, region) in colours::REGIONS.iter().enumerate() {
        assert!(count_pixels(&picture, region.light) >= 5, "region {} is drawn", j + 1);
    }
    draws_level_sets(&tab).await;
    tab.press("play").await;
    tab.until_step("replay", 50).await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_is_down_loses_nothing() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    begin(&tab, &server).await;

    // Down when the scene ends; the page sends it when the server is back.
    tab.press("start").await;
    tab.until_step("scene", 10).await;
    let stopped = server.stop().await;
    until_waiting(&tab).await;
    let server = stopped.start().await;
    until_saved(&tab).await;
    assert_eq!(stored(&server).await.len(), 1);

    // Down again, and the page is closed before the server is back.
    tab.press("start").await;
    tab.until_step("scene", 10).await;
    let stopped = server.stop().await;
    until_waiting(&tab).await;
    tab.go("about:blank").await;
    let server = stopped.start().await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    until_saved(&tab).await;
    let trials = stored(&server).await;
    assert_eq!(trials.len(), 2);
    assert!(trials.iter().all(|trial| trial.replay.exact));
    let kept = kept(&tab).await;
    assert!(kept.iter().any(|name| name == "sidestep.session.default"), "{kept:?}");
    assert!(!kept.iter().any(|name| name.contains("outbox")), "{kept:?} should be forgotten");
    // The next scene is the third.
    drive(&tab, "d").await;
    until_saved(&tab).await;
    assert_eq!(stored(&server).await.len(), 3);
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_whole_participation_ends_with_a_code() {
    let (server, browser, tab) = start(r#"phases = [{ phase = "task", scenes = 2 }]"#).await;
    begin(&tab, &server).await;
    drive(&tab, "a").await;
    drive(&tab, "ArrowRight").await;
    let code = tab.words("completion-code").await;
    assert!(code.len() >= 8, "{code}");
    // Coming back shows the same code, and enrols nobody else.
    tab.reload().await;
    assert_eq!(tab.words("completion-code").await, code);
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    assert_eq!((studies[0].participants, studies[0].trials), (1, 2));
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_browser_simulates_as_the_server_does() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}/lab/self-check", server.origin)).await;
    let here = tab.words("fingerprint-here").await;
    assert_eq!(here, simulation_fingerprint(20_180_918, 10_000));
    assert_eq!(here, tab.words("fingerprint-server").await);
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wrong_addresses_and_keys_are_answered_in_words() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    tab.go(&format!("{}/lab#key=not-the-key-at-all", server.origin)).await;
    assert_eq!(tab.words("trouble").await, "That key is not valid.");
    // What was typed is still there after an answer, and so is the focus.
    let key = Tab::at("key");
    tab.run(&format!("{key}.value = 'neither is this'")).await;
    tab.press("sign-in").await;
    tab.until(&format!("{} && !{}.disabled", Tab::at("trouble"), Tab::at("sign-in"))).await;
    assert_eq!(tab.eval::<String>(&format!("{key}.value")).await, "neither is this");
    // The right link, pasted while the page is open.
    tab.run(&format!("location.hash = '#key={}'", server.key)).await;
    tab.until("document.querySelector('.empty')").await;
    let address: String = tab.eval("location.href").await;
    assert!(!address.contains('#'), "{address}");
    tab.press("sign-out").await;
    tab.until("location.pathname === '/'").await;
    let status: u64 = tab.eval("fetch('/api/v1/admin/studies').then(r => r.status)").await;
    assert_eq!(status, 401);
    let nowhere = browser.open(&format!("{}/s/no-such-study", server.origin)).await;
    assert!(nowhere.words("stuck").await.contains("Study not found"));
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_browser_that_stores_nothing_still_completes() {
    let (server, browser, tab) = start(r#"phases = [{ phase = "task", scenes = 1 }]"#).await;
    tab.before_pages(
        "IDBObjectStore.prototype.put = () => { \
         throw new DOMException('no room', 'QuotaExceededError') };",
    )
    .await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    tab.press("consent").await;
    assert!(tab.words("not-kept").await.contains("no storage left"));
    tab.press("continue").await;
    drive(&tab, "a").await;
    assert!(tab.words("completion-code").await.len() >= 8);
    assert_eq!(stored(&server).await.len(), 1);
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_laboratory_goes_from_page_to_page_without_loading() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    Driver::enrol(&server).await.drive(&server, 2).await;
    // A second study, with other words.
    let study = "slug = \"second\"\ntitle = \"Pilot\"\n";
    let server = server.restarted_with_study(study).await;
    sign_in(&tab, &server).await;
    tab.run("window.loadedOnce = true").await;
    let title = "document.title";
    assert_eq!(tab.eval::<String>(title).await, "Short · Sidestep laboratory");
    let times: Vec<String> =
        tab.eval("[...document.querySelectorAll('time')].map(t => t.textContent)").await;
    assert!(times.len() == 2 && times.iter().all(|time| time.len() > 8), "{times:?}");

    // To a replay, whose heading takes the focus, and back.
    tab.press("replay-link").await;
    until_predicted(&tab).await;
    assert!(tab.eval::<String>(title).await.starts_with("default / participant 1"));
    assert_eq!(tab.eval::<String>("document.activeElement.tagName").await, "H1");
    // The canvas has the pixels of its size, whatever changes that.
    let canvas = Tab::at("replay");
    let fits = format!("{canvas}.height === {canvas}.clientHeight");
    tab.until(&fits).await;
    let before: usize = tab.eval(&format!("{canvas}.height")).await;
    tab.run("document.querySelector('details').open = true").await;
    tab.until(&format!("{fits} && {canvas}.height < {before}")).await;
    tab.run("history.back()").await;
    tab.until(&Tab::at("trials")).await;

    // To the other study, and to an address without a page.
    tab.enter("study", "second").await;
    tab.until("document.querySelector('.empty')").await;
    assert_eq!(tab.eval::<String>(title).await, "Pilot · Sidestep laboratory");
    assert_eq!(tab.eval::<String>("location.search").await, "?study=second");
    take(&tab, "studies").await;
    assert!(tab.eval::<bool>("window.loadedOnce").await);
    tab.go(&format!("{}/lab/nothing", server.origin)).await;
    assert!(tab.words("stuck").await.contains("no page at this address"));
    tab.is_well().await;
    browser.close().await;
}

/// Drives the first scene with the study's own vehicles; the trial's id.
async fn drive_unequal(server: &Server) -> String {
    let study: StudyInfo = server.get(&routes::study("default")).await.into(200);
    let driver = Driver::enrol(server).await;
    let (id, scene) = driver.scenes().swap_remove(0);
    let answer = driver.send(server, &id, &driven_with(&study.parameters, &scene)).await;
    assert_eq!(answer.status, 201, "{}", answer.body);
    id
}

/// Moves a replay to a step.
async fn seek(tab: &Tab, step: usize) {
    tab.enter("slider", &step.to_string()).await;
    tab.until_step("replay", step).await;
}

/// Takes pictures wide and narrow, light and dark, and checks that nothing is cut off and that
/// the page reports no error.
async fn take(tab: &Tab, name: &str) {
    for (size, dark) in [(WIDE, false), (WIDE, true), (NARROW, false), (NARROW, true)] {
        tab.look(size, dark).await;
        tab.until_painted().await;
        let scheme = if dark { "dark" } else { "light" };
        tab.picture(&format!("{name}-{}-{scheme}", size.0)).await;
        tab.is_well().await;
    }
    tab.look(WIDE, false).await;
}

/// Both level sets are on the canvas: something goes when they are switched off.
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn unequal_vehicles_have_level_sets_from_either_solver() {
    // The server is not to solve, so the browser does.
    let server = Server::with_client_and(UNEQUAL_STUDY, |args| args.no_solve = true).await;
    let id = drive_unequal(&server).await;
    let replay = format!("/lab/replay/{id}");
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    tab.before_pages(
        "window.heard = []; window.Worker = class extends Worker { constructor(...given) { \
         super(...given); this.addEventListener('message', e => heard.push(e.data)); } };",
    )
    .await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}{replay}", server.origin)).await;
    tab.until_says("safety-levels", "solved in this browser").await;
    until_regions(&tab).await;
    let shares: usize = tab.eval("heard.filter(m => typeof m === 'number').length").await;
    assert!(shares > 10, "progress is reported: {shares}");
    seek(&tab, 15).await;
    seek(&tab, 15).await;
    draws_level_sets_alone(&tab).await;
    take(&tab, "replay-solved-here").await;

    // The bytes are those of the native library, bit for bit.
    let trial: TrialDetail = server.admin(&routes::admin_trial(&id)).await.into(200);
    for evader in Evader::ALL {
        assert_eq!(trial.value_function(evader), None);
        let game = trial.parameters.game(evader);
        let text = serde_json::to_string(&game).expect("a game as JSON");
        let (hash, bytes, ms): (String, usize, f64) = tab
            .eval(&format!(
                "(async () => {{ \
               const begun = performance.now(); \
               const bytes = await new Promise((done, failed) => {{ \
                 const program = document.getElementById('app').dataset.solver; \
                 const worker = new Worker(program, {{type: 'module', name: '{text}'}}); \
                 worker.onerror = failed; \
                 worker.onmessage = ({{data}}) => {{ \
                   if (data instanceof Uint8Array) done(data); \
                   if (typeof data === 'string') failed(new Error(data)); }} }}); \
               const ms = performance.now() - begun; \
               const hash = new Uint8Array(await crypto.subtle.digest('SHA-256', bytes)); \
               const hex = [...hash].map(o => o.toString(16).padStart(2, '0')).join(''); \
               return [hex, bytes.length, ms] }})()"
            ))
            .await;
        let native = value_function(game, &mut |_| ControlFlow::Continue(()));
        assert_eq!(hash, native.expect("a solution").id());
        eprintln!(
            "{evader:?}: {bytes} bytes, {ms:.0} ms in the browser, the worker's start included"
        );
    }
    tab.is_well().await;

    // The same trial on a server that solves: no worker is started.
    let server = server.restarted_with(None, |args| args.no_solve = false).await;
    let functions = || async {
        let trial: TrialDetail = server.admin(&routes::admin_trial(&id)).await.into(200);
        Evader::ALL.map(|evader| trial.value_function(evader).map(str::to_owned))
    };
    while functions().await.iter().any(Option::is_none) {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    tab.go(&format!("{}{replay}", server.origin)).await;
    tab.until_says("safety-levels", "solved by the server").await;
    until_regions(&tab).await;
    let heard: usize = tab.eval("heard.length").await;
    assert_eq!(heard, 0);
    seek(&tab, 15).await;
    draws_level_sets_alone(&tab).await;
    take(&tab, "replay-solved-by-server").await;
    browser.close().await;
}

async fn until_regions(tab: &Tab) {
    tab.until(&Tab::at("regions")).await;
}

/// A solver that is slow, is stopped, fails, or is not there.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_solve_shows_progress_stops_and_fails_in_words() {
    let server = Server::with_client_and(UNEQUAL_STUDY, |args| args.no_solve = true).await;
    let id = drive_unequal(&server).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    // Stands in for the browser's own: 42 % in, and no further.
    tab.before_pages(
        "window.ended = 0; window.RealWorker = Worker; window.Worker = class { constructor() { \
         setTimeout(() => this.onmessage(new MessageEvent('message', {data: 0.42})), 50); } \
         terminate() { ended += 1; } };",
    )
    .await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}/lab/replay/{id}", server.origin)).await;
    tab.until_says("solved-percent", "42 %").await;
    take(&tab, "replay-solving").await;
    tab.press("stop-solving").await;
    assert!(tab.words("unsolved").await.contains("stopped"));
    assert_eq!(tab.eval::<usize>("ended").await, 2);
    take(&tab, "replay-unsolved").await;
    // A program that is not there.
    tab.run(
        "window.failed = 0, window.Worker = class extends RealWorker { \
         constructor(program, options) { super(program + '-gone.js', options); \
         this.addEventListener('error', () => failed += 1); } }",
    )
    .await;
    tab.press("solve-again").await;
    tab.until_says("unsolved", "could not be loaded").await;
    // Both games: the one that fails later would not be solved again.
    tab.until("failed === 2").await;
    // And with the real one all is well.
    tab.run("window.Worker = RealWorker").await;
    tab.press("solve-again").await;
    until_regions(&tab).await;
    tab.until(&format!("!{}", Tab::at("unsolved"))).await;
    draws_level_sets_alone(&tab).await;
    tab.is_well().await;
    browser.close().await;
}

/// Takes pictures of every page, wide and narrow, light and dark, for people to look at.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_page_fits_its_window() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    let sent = Driver::enrol(&server).await.drive(&server, 2).await;
    tab.go(&server.origin).await;
    let take = async |name: &str| take(&tab, name).await;
    take("home").await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    tab.words("consent").await;
    take("welcome").await;
    tab.press("consent").await;
    tab.words("continue").await;
    take("instructions").await;
    tab.press("continue").await;
    tab.words("start").await;
    take("ready").await;
    tab.press("start").await;
    tab.until_step("scene", 8).await;
    take("scene").await;
    until_saved(&tab).await;
    sign_in(&tab, &server).await;
    take("trials").await;
    tab.go(&format!("{}/lab/replay/{}", server.origin, sent[1].0)).await;
    until_predicted(&tab).await;
    seek(&tab, 17).await;
    take("replay").await;
    tab.press("by-step").await;
    take("replay-by-step").await;
    tab.go(&format!("{}/lab/self-check", server.origin)).await;
    tab.words("verdict").await;
    take("self-check").await;
    tab.press("sign-out").await;
    tab.until("location.pathname === '/'").await;
    let out = server.request(Method::GET, routes::SESSION).send().await.expect("an answer");
    assert_eq!(out.status(), 401);
    tab.go(&format!("{}/lab", server.origin)).await;
    tab.words("key").await;
    // The browser itself notes the 401 that the page asked for.
    for (size, name) in [(WIDE, "sign-in-1280-light"), (NARROW, "sign-in-390-light")] {
        tab.look(size, false).await;
        tab.until_painted().await;
        tab.picture(name).await;
    }
    browser.close().await;
}
