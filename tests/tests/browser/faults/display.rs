//! Screens with other frame rates, and zoomed pages.

use super::{QUICK, complete};
use crate::{HUMAN, REMEMBER, ROBOT, sent, start};
use serde::Deserialize;
use sidestep::trial::{Flag, LOW_FRAME_RATE_HZ};
use sidestep_tests::Tab;

/// Emulates a screen that shows this many frames per second, or fewer on a busy machine. Records
/// the times of the frames.
fn screen(hz: u32) -> String {
    format!(
        "window.shown = []; window.requestAnimationFrame = callback => {{ const gap = 1000 / {hz}; \
         const next = Math.ceil((performance.now() + 0.5) / gap) * gap; \
         return setTimeout(() => {{ shown.push(performance.timeOrigin + next); callback(next) }}, \
         next - performance.now()) }};"
    )
}

/// The intervals between frames in the ten seconds of a scene (ms), in ascending order.
async fn gaps(tab: &Tab, started_at_ms: f64) -> Vec<f64> {
    let mut shown: Vec<f64> = tab.eval("window.shown").await;
    shown.retain(|at_ms| (0.0..=10_000.0).contains(&(at_ms - started_at_ms)));
    let mut gaps: Vec<f64> = shown.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_by(f64::total_cmp);
    gaps
}

/// A screen of 20 Hz is slow. The other screens are slow only if the machine is too busy.
async fn scene_at(hz: u32) {
    let study = QUICK
        .replace("scenes = 2", "scenes = 1")
        .replace("steps = 15", "steps = 50")
        .replace("[trials]", "[trials]\nfullscreen = false");
    let (server, browser, tab) = start(&study).await;
    tab.before_pages(&(screen(hz) + REMEMBER)).await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    tab.press("consent").await;
    crate::equipped(&tab).await;
    let said: String = tab.eval("document.body.innerText").await;
    let before = said.split(" pictures per second").next().expect("a part");
    let measured_hz = before.rsplit([' ', '\n']).next().and_then(|word| word.parse::<u32>().ok());
    let measured_hz = measured_hz.unwrap_or_else(|| panic!("{hz} Hz: {said}"));
    assert!(hz >= 30 || measured_hz < 30, "{hz} Hz: {said}");
    let warns = said.contains("Please close other programs and tabs.");
    assert_eq!(warns, measured_hz < 30, "{hz} Hz: {said}");
    tab.press("continue").await;
    tab.press("continue").await;
    tab.press("start").await;
    let trials = complete(&tab, &server, 1).await;
    let sent = sent(&tab).await.swap_remove(0);
    assert_eq!((sent.inputs.len(), sent.sampled_at_ms.len()), (50, 50));
    for (step, &at_ms) in sent.sampled_at_ms.iter().enumerate() {
        assert!(at_ms >= 200.0 * step as f64, "{hz} Hz: step {step} at {at_ms} ms");
    }
    // The page measured the displayed frames, and the flag agrees with its measurement.
    let median_ms = sent.display.get("frame_gap_median_ms").and_then(|it| it.as_f64());
    let median_ms = median_ms.expect("a median");
    let gaps = gaps(&tab, sent.started_at_ms).await;
    let [low, high] = [2, 3].map(|fifths| gaps[gaps.len() * fifths / 5]);
    let is_measured = (low - 0.5..=high + 0.5).contains(&median_ms);
    assert!(is_measured, "{hz} Hz: {median_ms} ms, not {low} to {high} ms");
    let is_slow = 1000.0 / median_ms < LOW_FRAME_RATE_HZ;
    assert!(is_slow || hz >= 30, "{hz} Hz: {median_ms} ms");
    let flags = &trials[0].summary.flags;
    assert_eq!(flags.contains(&Flag::LowFrameRate), is_slow, "{hz} Hz: {median_ms} ms, {flags:?}");
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_screen_has_fifty_steps_and_a_slow_one_is_flagged() {
    // Run only two scenes at the same time, because each browser renders its frames on the CPU.
    tokio::join!(scene_at(144), scene_at(20));
    tokio::join!(scene_at(120), scene_at(60));
}

/// Moves the focus to a control with the Tab key, checks that the control is fully in the window,
/// and presses it.
async fn reach(tab: &Tab, test_id: &str) {
    tab.until(&format!("{0} && !{0}.disabled", Tab::at(test_id))).await;
    for _ in 0..60 {
        if tab.eval::<bool>(&format!("document.activeElement === {}", Tab::at(test_id))).await {
            assert!(tab.eval::<bool>(&inside(test_id)).await, "{test_id} is cut off");
            tab.key_down(" ").await;
            tab.key_up(" ").await;
            return;
        }
        tab.key_down("Tab").await;
        tab.key_up("Tab").await;
    }
    panic!("{test_id} cannot be reached with the tabulator");
}

/// A JavaScript expression that tells whether an element is fully in the window.
fn inside(test_id: &str) -> String {
    format!(
        "(() => {{ const at = {}.getBoundingClientRect(); return at.width > 0 && at.left >= 0 && \
         at.top >= 0 && at.right <= innerWidth + 0.5 && at.bottom <= innerHeight + 0.5 }})()",
        Tab::at(test_id)
    )
}

/// What a page recorded of itself in a frame of the scene.
#[derive(Deserialize)]
struct Shown {
    /// Whether the scene and the marks of both keys were fully in the window.
    is_inside: bool,
    /// The height of the scene in CSS pixels.
    height_px: f64,
    /// The canvas's pixels in the human's and in the robot's colour.
    human: usize,
    robot: usize,
}

/// Makes the page record the first frame after step 4 of a scene as `shown`. The page does this
/// itself, because four browsers on a busy machine can answer a test after the scene has ended.
fn record_a_frame() -> String {
    let inside = ["scene", "held-left", "held-right"].map(inside).join(" && ");
    let scene = Tab::at("scene");
    format!(
        "window.shown = null; const look = () => {{ const canvas = {scene}; \
         if (!(Number(canvas?.dataset.step) >= 4)) return requestAnimationFrame(look); \
         const {{data}} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
         const count = colour => {{ let n = 0; for (let i = 0; i < data.length; i += 4) \
         n += colour.every((c, k) => Math.abs(data[i + k] - c) <= 6); return n }}; \
         window.shown = {{is_inside: {inside}, height_px: canvas.clientHeight, \
         human: count({HUMAN:?}), robot: count({ROBOT:?})}} }}; requestAnimationFrame(look);"
    )
}

async fn zoomed(percent: u32) {
    let study = QUICK
        .replace("scenes = 2", "scenes = 1")
        .replace("steps = 15", "steps = 30")
        .replace("[trials]", "[trials]\nfullscreen = false");
    let (server, browser, tab) = start(&study).await;
    tab.zoom(percent).await;
    tab.before_pages(&record_a_frame()).await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    reach(&tab, "consent").await;
    crate::equipped(&tab).await;
    tab.is_well().await;
    reach(&tab, "continue").await;
    tab.words("arena").await;
    tab.is_well().await;
    reach(&tab, "continue").await;
    tab.words("start").await;
    tab.is_well().await;
    reach(&tab, "start").await;
    tab.until("window.shown").await;
    let shown: Shown = tab.eval("window.shown").await;
    assert!(shown.is_inside, "{percent} %");
    assert!(shown.height_px >= 150.0, "the scene is {} px high at {percent} %", shown.height_px);
    let (human, robot) = (shown.human, shown.robot);
    assert!(human > 20 && robot > 20, "{percent} %: {human} and {robot} pixels");
    tab.is_well().await;
    complete(&tab, &server, 1).await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_page_of_any_size_is_used_with_the_keyboard_alone() {
    let [half, usual, double, triple] = [50, 100, 200, 300].map(zoomed);
    tokio::join!(half, usual, double, triple);
}
