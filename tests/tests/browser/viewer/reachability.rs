//! The laboratory's page of value functions, with real keys, drags and movements of the mouse
//! wheel.

use crate::{ROBOT, sign_in, start, take};
use sidestep_tests::Tab;
use sidestep_tests::browser::{Mouse, count_pixels};
use sidestep_tests::server::SHORT_STUDY;

const PAGE: &str = "/lab/reachability";

/// The centre of an element, offset by fractions of the element's size.
async fn place(tab: &Tab, test_id: &str, [right, down]: [f64; 2]) -> [f64; 2] {
    let element = Tab::at(test_id);
    tab.eval(&format!(
        "(box => [box.left + box.width * {}, box.top + box.height * {}])\
         ({element}.getBoundingClientRect())",
        0.5 + right,
        0.5 + down
    ))
    .await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_value_function_is_read_played_and_solved() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    tab.run("document.querySelector('a[href=\"/lab/reachability\"]').click()").await;
    tab.until(&Tab::at("map")).await;
    assert!(tab.words("origin").await.contains("closed form"));
    take(&tab, "reachability").await;

    // Keys move the cross-hair, but not while the slider has the focus.
    let before = tab.words("numbers").await;
    tab.key("ArrowRight").await;
    let moved = tab.words("numbers").await;
    assert_ne!(before, moved);
    tab.run(&format!("{}.focus()", Tab::at("psi"))).await;
    tab.key("ArrowLeft").await;
    tab.until_says("map", "V (m)").await;
    tab.until("document.querySelector('output').textContent === '179°'").await;
    tab.run(&format!("{}.blur()", Tab::at("psi"))).await;

    // Moving the mouse shows numbers, and a click plays the game from that point.
    tab.mouse(Mouse::Move, place(&tab, "map", [0.1, -0.15]).await).await;
    tab.until("document.body.textContent.includes('under the pointer')").await;
    tab.mouse(Mouse::Press, place(&tab, "map", [0.1, -0.15]).await).await;
    tab.mouse(Mouse::Release, place(&tab, "map", [0.1, -0.15]).await).await;
    tab.until_says("played", "closest distance").await;
    tab.until("location.search.includes('play=yes')").await;
    take(&tab, "reachability-play").await;
    // The link restores the same game.
    let played = tab.words("played").await;
    tab.reload().await;
    assert_eq!(tab.words("played").await, played);
    tab.key("Escape").await;
    tab.until(&format!("!{}", Tab::at("played"))).await;

    // Other vehicles are solved in a worker.
    tab.enter("pursuer-turn-rate", "0.35").await;
    tab.until_says("origin", "solved here").await;
    eprintln!("{}", tab.words("origin").await);
    tab.enter("pursuer-turn-rate", "fast").await;
    tab.until_says("misread", "expected a finite number > 0, found fast").await;
    take(&tab, "reachability-misread").await;
    tab.enter("pursuer-turn-rate", "0.5").await;
    tab.enter("accuracy", "draft").await;
    tab.enter("method", "polar").await;
    tab.press("show-error").await;
    tab.until_says("errors", "greatest at 24 headings").await;
    take(&tab, "reachability-error").await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_tube_turns_by_hand_and_survives_the_loss_of_its_graphics() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    // Gives the test access to the graphics context, so that the test can lose it.
    tab.before_pages(
        "{ const get = HTMLCanvasElement.prototype.getContext; \
         HTMLCanvasElement.prototype.getContext = function (...given) { \
         if (window.withoutGraphics && given[0] === 'webgl2') return null; \
         const context = get.apply(this, given); \
         if (given[0] === 'webgl2') window.graphics = context; return context; } }",
    )
    .await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}{PAGE}?show=tube", server.origin)).await;
    tab.until("window.graphics").await;
    tab.until_painted().await;
    // On a busy machine, the page shows slices as soon as it has timed a frame, unless the user
    // insists on the solid.
    let insist = Tab::at("insist");
    tab.run(&format!(
        "new MutationObserver(() => {insist}?.click())\
         .observe(document.body, {{ childList: true, subtree: true }}), {insist}?.click()"
    ))
    .await;
    tab.until(&format!("!{}", Tab::at("no-graphics"))).await;
    tab.until_painted().await;
    let red = |picture: &image::RgbaImage| {
        picture.pixels().filter(|p| p.0[0] > 150 && p.0[1] < 140 && p.0[2] < 140).count()
    };
    let picture = tab.picture("tube").await;
    assert!(red(&picture) > 10_000, "the tube is drawn: {} red pixels", red(&picture));
    take(&tab, "reachability-tube").await;
    // A drag, the wheel and keys change the view of the tube.
    let [from, to] =
        [place(&tab, "tube", [0.0, 0.0]).await, place(&tab, "tube", [0.25, -0.1]).await];
    tab.mouse(Mouse::Move, from).await;
    tab.mouse(Mouse::Press, from).await;
    tab.mouse(Mouse::Drag, to).await;
    tab.mouse(Mouse::Release, to).await;
    tab.until("location.search.includes('around=-142')").await;
    tab.mouse(Mouse::Roll(-120.0), to).await;
    tab.until("location.search.includes('zoom=138')").await;
    tab.key("ArrowRight").await;
    tab.until("location.search.includes('around=-147')").await;
    tab.until_painted().await;
    let turned = tab.picture("tube-turned").await;
    assert!(red(&turned) > 10_000 && turned != picture);

    // The graphics context is lost, and then restored.
    tab.run("window.loss = graphics.getExtension('WEBGL_lose_context'), loss.loseContext()").await;
    tab.until_says("no-graphics", "cannot draw solids now").await;
    take(&tab, "reachability-no-graphics").await;
    tab.run("loss.restoreContext()").await;
    tab.until(&format!("!{}", Tab::at("no-graphics"))).await;
    tab.until_painted().await;
    assert!(red(&tab.picture("tube-restored").await) > 10_000);
    // A slow browser shows slices, reports the drawing time, and draws the solid if the user
    // insists.
    tab.before_pages(
        "{ const read = WebGL2RenderingContext.prototype.readPixels; \
         WebGL2RenderingContext.prototype.readPixels = function (...given) { \
         const until = performance.now() + 60; while (performance.now() < until); \
         return read.apply(this, given); } }",
    )
    .await;
    tab.reload().await;
    tab.until_says("no-graphics", "ms to draw the solid once").await;
    tab.press("insist").await;
    tab.until(&format!("!{}", Tab::at("no-graphics"))).await;
    tab.until_painted().await;
    assert!(red(&tab.picture("tube-insisted").await) > 10_000);
    // A browser without graphics.
    tab.before_pages("window.withoutGraphics = true").await;
    tab.reload().await;
    tab.until_says("no-graphics", "cannot draw solids now").await;
    assert!(count_pixels(&tab.picture("tube-without-graphics").await, ROBOT) > 100);
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_slow_solid_gives_way_to_slices_until_somebody_insists() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    // Everything that the page times takes two seconds on the page's clock.
    tab.before_pages(
        "{ const read = WebGL2RenderingContext.prototype.readPixels; let late = 0; \
         const now = Performance.prototype.now; \
         Performance.prototype.now = function () { return now.call(this) + late; }; \
         WebGL2RenderingContext.prototype.readPixels = function (...given) { \
         late += 2000; return read.apply(this, given); } }",
    )
    .await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}{PAGE}?show=tube", server.origin)).await;
    tab.until_says("no-graphics", "to draw the solid once").await;
    take(&tab, "reachability-slow").await;
    tab.press("insist").await;
    tab.until(&format!("!{}", Tab::at("no-graphics"))).await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_value_function_is_saved_as_the_command_line_writes_it() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    tab.before_pages(
        "{ const make = URL.createObjectURL; URL.createObjectURL = function (blob) { \
         blob.arrayBuffer?.().then(bytes => { window.saved = Array.from(new Uint8Array(bytes)); }); \
         return make.call(this, blob); } }",
    )
    .await;
    sign_in(&tab, &server).await;
    tab.go(&format!("{}{PAGE}?pursuer-turn-rate=0.35&accuracy=draft", server.origin)).await;
    tab.until_says("origin", "solved here").await;
    tab.run("window.saved = null").await;
    tab.press("save-npz").await;
    tab.until("window.saved?.length > 1000").await;
    let saved: Vec<u8> = tab.eval("window.saved").await;
    let folder = sidestep_tests::Folder::default();
    let flags = ["--pursuer-turn-rate", "0.35", "--accuracy", "draft"];
    let out = folder.name("v.npz");
    sidestep_tests::run(&[&["solve", "--out", &out][..], &flags].concat()).await.json();
    assert!(saved == std::fs::read(folder.path("v.npz")).unwrap(), "the same bytes");
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_wrong_or_did_not_converge_is_said() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    sign_in(&tab, &server).await;
    // The link has a value out of range, and then an incompatible method.
    tab.go(&format!("{}{PAGE}?radius=-1", server.origin)).await;
    tab.until_says("misread", "radius").await;
    tab.go(&format!("{}{PAGE}?method=exact&pursuer-speed=1", server.origin)).await;
    tab.until(&Tab::at("unsolved")).await;
    // A solve that did not converge, on the map and on the tube.
    for shown in ["value", "tube"] {
        let link =
            format!("{PAGE}?pursuer-speed=3&evader-turn-rate=1.5&accuracy=draft&show={shown}");
        tab.go(&format!("{}{link}", server.origin)).await;
        tab.until_says("not-converged", "did not converge").await;
    }
    take(&tab, "reachability-not-converged").await;
    browser.close().await;
}
