//! The laboratory's pages.

use crate::{draws_level_sets_alone, sign_in, start, take, until_predicted};
use reqwest::Method;
use sidestep::api::{StudyInfo, TrialDetail, routes};
use sidestep::safety::value_function;
use sidestep::scene::Evader;
use sidestep::trial::simulation_fingerprint;
use sidestep_tests::browser::{NARROW, Vision, WIDE};
use sidestep_tests::server::{SHORT_STUDY, UNEQUAL_STUDY};
use sidestep_tests::{Browser, Driver, Server, Tab, driven_with};
use std::ops::ControlFlow;
use std::time::Duration;

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
async fn the_page_about_the_interface_is_read_by_everybody() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    for (size, dark) in [(WIDE, false), (NARROW, true)] {
        tab.look(size, dark).await;
        tab.go(&format!("{}{}", server.origin, routes::DOCS)).await;
        tab.is_well().await;
        tab.run("document.querySelectorAll('details').forEach(it => it.open = true)").await;
        tab.is_well().await;
        let elsewhere = "performance.getEntriesByType('resource').map(it => it.name)\
                         .filter(name => !name.startsWith(location.origin))";
        assert_eq!(tab.eval::<Vec<String>>(elsewhere).await, Vec::<String>::new());
    }
    // A link to a type opens the description of the type.
    tab.go(&format!("{}{}", server.origin, routes::DOCS)).await;
    tab.run("location.hash = 'TrialUpload'").await;
    tab.until("document.getElementById('TrialUpload').closest('details').open").await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wrong_addresses_and_keys_are_answered_in_words() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    tab.go(&format!("{}/lab#key=not-the-key-at-all", server.origin)).await;
    assert_eq!(tab.words("trouble").await, "That key is not valid.");
    // After a response, the field still has its input and the focus.
    let key = Tab::at("key");
    tab.run(&format!("{key}.value = 'neither is this'")).await;
    tab.press("sign-in").await;
    tab.until(&format!("{} && !{}.disabled", Tab::at("trouble"), Tab::at("sign-in"))).await;
    assert_eq!(tab.eval::<String>(&format!("{key}.value")).await, "neither is this");
    // Paste the right link while the page is open.
    tab.run(&format!("location.hash = '#key={}'", server.key)).await;
    tab.until(&Tab::at("studies")).await;
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
async fn the_laboratory_goes_from_page_to_page_without_loading() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    Driver::enrol(&server).await.drive(&server, 2).await;
    // A second study, with another title.
    let study = "slug = \"second\"\ntitle = \"Pilot\"\n";
    let server = server.restarted_with_study(study).await;
    sign_in(&tab, &server).await;
    tab.run("window.loadedOnce = true").await;
    let title = "document.title";
    assert_eq!(tab.eval::<String>(title).await, "Studies · Sidestep laboratory");
    tab.press("study-default").await;
    tab.press("tab-trials").await;
    tab.until(&Tab::at("trials")).await;
    assert_eq!(tab.eval::<String>(title).await, "Short: trials · Sidestep laboratory");
    let times: Vec<String> =
        tab.eval("[...document.querySelectorAll('time')].map(t => t.textContent)").await;
    assert!(times.len() == 2 && times.iter().all(|time| time.len() > 8), "{times:?}");

    // Go to a replay, whose title (`h1`) gets the focus, and back.
    tab.press("replay-link").await;
    until_predicted(&tab).await;
    assert!(tab.eval::<String>(title).await.starts_with("default / participant 1"));
    assert_eq!(tab.eval::<String>("document.activeElement.tagName").await, "H1");
    // The resolution of the canvas follows its displayed size.
    let canvas = Tab::at("replay");
    let fits = format!("{canvas}.height === {canvas}.clientHeight");
    tab.until(&fits).await;
    let before: usize = tab.eval(&format!("{canvas}.height")).await;
    tab.press("numbers-switch").await;
    tab.until(&format!("{fits} && {canvas}.height < {before}")).await;
    tab.back().await;
    tab.until(&Tab::at("trials")).await;

    // Go to the other study, and to an address without a page.
    tab.run("document.querySelector('nav a[href=\"/lab\"]').click()").await;
    tab.press("study-second").await;
    tab.until(&Tab::at("nobody")).await;
    assert_eq!(tab.eval::<String>(title).await, "Pilot: participants · Sidestep laboratory");
    assert_eq!(tab.eval::<String>("location.pathname").await, "/lab/studies/second");
    assert!(tab.eval::<bool>("window.loadedOnce").await);
    tab.go(&format!("{}/lab/nothing", server.origin)).await;
    assert!(tab.words("stuck").await.contains("no page at this address"));
    tab.is_well().await;
    browser.close().await;
}

/// A replay can be recorded as a complete WebM file. The file is completed even if the user goes to
/// the next trial during the recording.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_replay_is_filmed() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    let sent = Driver::enrol(&server).await.drive(&server, 2).await;
    sign_in(&tab, &server).await;
    // A film of four seconds: on a busy machine, the browser needs a second until it encodes the first frame.
    tab.go(&format!("{}/lab/replay/{}?t=6", server.origin, sent[0].0)).await;
    until_predicted(&tab).await;
    // Intercept downloads.
    let offers = "offer = URL.createObjectURL, \
                  URL.createObjectURL = blob => (film = blob, offer.call(URL, blob))";
    tab.run(offers).await;
    tab.press("film").await;
    tab.until("window.film").await;
    assert_eq!(tab.eval::<String>("film.type").await, "video/webm");
    let bytes: Vec<u8> = tab.eval("film.arrayBuffer().then(all => [...new Uint8Array(all)])").await;
    // The bytes are EBML, and name a codec that every browser plays.
    assert_eq!(bytes[..4], [0x1a, 0x45, 0xdf, 0xa3]);
    assert!(bytes.windows(4).any(|name| name == b"V_VP"));
    assert!(bytes.len() > 5_000, "{} bytes", bytes.len());
    tab.until("document.querySelector('[data-testid=film]').ariaPressed === 'false'").await;

    tab.run("window.film = null").await;
    tab.key("Home").await;
    tab.press("film").await;
    tab.until("document.querySelector('#replay').dataset.step > 2").await;
    tab.key("n").await;
    tab.until(&format!("location.pathname.endsWith('{}')", sent[1].0)).await;
    tab.until("window.film?.size > 5000").await;
    until_predicted(&tab).await;

    tab.run("delete window.MediaRecorder").await;
    tab.press("film").await;
    tab.until_says("unfilmed", "cannot record films").await;
    tab.is_well().await;
    browser.close().await;
}

/// Drives the first scene with the study's own vehicles. Returns the trial's id.
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
    tab.enter("slider", &(0.2 * step as f64).to_string()).await;
    tab.until_step("replay", step).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn unequal_vehicles_have_level_sets_from_either_solver() {
    // The server must not solve the games, so the browser solves them.
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

    // The bytes equal the bytes of the native library.
    let trial: TrialDetail = server.admin(&routes::admin_trial(&id)).await.into(200);
    for evader in Evader::ALL {
        assert_eq!(trial.value_function(evader), None);
        let game = trial.parameters.game(evader);
        let text = serde_json::to_string(&game).expect("a game as JSON");
        let text = format!("{{\"game\":{text}}}");
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

    // On a server that solves, the same trial starts no worker.
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

/// Cases: the solver is slow, is stopped, fails, or is missing.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_solve_shows_progress_stops_and_fails_in_words() {
    let server = Server::with_client_and(UNEQUAL_STUDY, |args| args.no_solve = true).await;
    let id = drive_unequal(&server).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    // Replaces the browser's `Worker` by one that stays at 42 %.
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
    // The solver's program is missing.
    tab.run(
        "window.failed = 0, window.Worker = class extends RealWorker { \
         constructor(program, options) { super(program + '-gone.js', options); \
         this.addEventListener('error', () => failed += 1); } }",
    )
    .await;
    tab.press("solve-again").await;
    tab.until_says("unsolved", "could not be loaded").await;
    // Wait until both games have failed, because a game that fails later would not be solved again.
    tab.until("failed === 2").await;
    // With the real `Worker`, the solve succeeds.
    tab.run("window.Worker = RealWorker").await;
    tab.press("solve-again").await;
    until_regions(&tab).await;
    tab.until(&format!("!{}", Tab::at("unsolved"))).await;
    draws_level_sets_alone(&tab).await;
    tab.is_well().await;
    browser.close().await;
}

/// Takes screenshots of every page, wide and narrow, light and dark, for visual inspection.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_page_fits_its_window() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    let sent = Driver::enrol(&server).await.drive(&server, 2).await;
    tab.go(&server.origin).await;
    let take = async |name: &str| take(&tab, name).await;
    take("home").await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}/lab/studies/default/trials", server.origin)).await;
    tab.until(&Tab::at("trials")).await;
    take("trials").await;
    tab.go(&format!("{}/lab/replay/{}", server.origin, sent[1].0)).await;
    until_predicted(&tab).await;
    seek(&tab, 17).await;
    take("replay").await;
    tab.enter("sets", "steps").await;
    take("replay-by-step").await;
    tab.enter("sets", "tube").await;
    tab.enter("colours", "safe").await;
    for layer in ["shade-hr", "samples", "avoidance"] {
        tab.press(&format!("layer-{layer}")).await;
    }
    take("replay-everything").await;
    let visions = [Vision::Protanopia, Vision::Deuteranopia, Vision::Tritanopia];
    for vision in visions.into_iter().chain([Vision::None]) {
        tab.see(&vision).await;
        tab.until_painted().await;
        tab.picture(&format!("replay-everything-{}", vision.as_ref())).await;
    }
    tab.go(&format!("{}/lab/self-check", server.origin)).await;
    tab.words("verdict").await;
    take("self-check").await;
    tab.press("sign-out").await;
    tab.until("location.pathname === '/'").await;
    let out = server.request(Method::GET, routes::SESSION).send().await.expect("an answer");
    assert_eq!(out.status(), 401);
    tab.go(&format!("{}/lab", server.origin)).await;
    tab.words("key").await;
    // The browser logs the expected 401 as an error, so `is_well` would fail here.
    for (size, name) in [(WIDE, "sign-in-1280-light"), (NARROW, "sign-in-390-light")] {
        tab.look(size, false).await;
        tab.until_painted().await;
        tab.picture(name).await;
        tab.is_accessible().await;
    }
    browser.close().await;
}
