//! Latency from a key press to the first frame that shows the turn.

use crate::figures::distribution;
use crate::scenes::{BEFORE, STUDY, sent};
use serde::Deserialize;
use serde_json::{Value, json};
use sidestep::chart::colours;
use sidestep::math::SeededRng;
use sidestep_tests::participant::begin;
use sidestep_tests::{Browser, Server};
use std::time::Duration;

/// Number of scenes, with two key presses in each.
const SCENES: usize = 8;

/// Makes the page record the times of key presses, and the direction of the human's arrow in each
/// frame that paints it. The outline of an arrow has seven corners, of which the fourth is the tip.
fn watch() -> String {
    let [r, g, b] = colours::HUMAN.light;
    format!(
        "window.downs = []; window.headings = []; let frame = 0, corners = []; \
         addEventListener('keydown', event => downs.push(event.timeStamp), true); \
         const ask = window.requestAnimationFrame; \
         window.requestAnimationFrame = call => ask(stamp => {{ frame = stamp; call(stamp) }}); \
         const canvas = CanvasRenderingContext2D.prototype; \
         const {{ beginPath, lineTo, fill }} = canvas; \
         canvas.beginPath = function () {{ corners = []; return beginPath.call(this) }}; \
         canvas.lineTo = function (x, y) {{ corners.push([x, y]); return lineTo.call(this, x, y) }}; \
         canvas.fill = function () {{ \
             if (corners.length === 7 && this.fillStyle === '#{r:02x}{g:02x}{b:02x}') {{ \
                 const [a, , , tip, , , z] = corners; \
                 const x = tip[0] - (a[0] + z[0]) / 2, y = tip[1] - (a[1] + z[1]) / 2; \
                 headings.push([frame, Math.atan2(-y, x)]); }} \
             return fill.call(this) }};"
    )
}

/// Times of key presses (ms, on the browser's clock), and directions of the arrow.
#[derive(Deserialize)]
struct Seen {
    downs: Vec<f64>,
    /// Time of the frame (ms) and heading (rad).
    headings: Vec<(f64, f64)>,
}

pub(crate) async fn measured() -> Value {
    let server = Server::with_client(STUDY).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    tab.before_pages(BEFORE).await;
    tab.before_pages(&watch()).await;
    begin(&tab, &server).await;
    let mut rng = SeededRng::new(1);
    let (mut waits, mut shown, mut gaps) = (Vec::new(), Vec::new(), Vec::new());
    let mut digits = 0;
    for scene in 0..SCENES {
        tab.run("downs.length = headings.length = 0").await;
        tab.press("start").await;
        tokio::time::sleep(Duration::from_millis(3000)).await;
        for key in ["ArrowLeft", "ArrowRight"] {
            tokio::time::sleep(Duration::from_millis(rng.below(200) as u64)).await;
            tab.key_down(key).await;
            tokio::time::sleep(Duration::from_millis(1500)).await;
            tab.key_up(key).await;
            tokio::time::sleep(Duration::from_millis(1000)).await;
        }
        tokio::time::sleep(Duration::from_millis(4000)).await;
        tab.until(&format!("sent.length > {scene}")).await;
        let seen: Seen = tab.eval("({ downs, headings })").await;
        let trial = sent(&tab).await.swap_remove(scene);
        gaps.extend(seen.headings.windows(2).map(|pair| pair[1].0 - pair[0].0));
        let presses = trial.key_events.iter().filter(|event| event.down).map(|event| event.t_ms);
        for (t_ms, stamp) in presses.zip(&seen.downs) {
            // The trial's time starts with the scene. The browser's time starts with the page.
            let wait = (t_ms / 200.0).ceil() * 200.0 - t_ms;
            let due = stamp + wait;
            let before = seen.headings.iter().rfind(|(at, _)| *at <= due).expect("a frame").1;
            let turned = |(at, heading): &&(f64, f64)| *at > due && (heading - before).abs() > 1e-9;
            let frame = seen.headings.iter().find(turned).expect("the turn is shown").0;
            waits.push(wait);
            shown.push(frame - due);
            digits = digits.max(decimals(*stamp));
        }
    }
    browser.close().await;
    json!({
        "presses": shown.len(),
        "resolution_ms": 10f64.powi(-digits),
        "to_due_ms": distribution(&waits),
        "due_to_frame_ms": distribution(&shown),
        "frame_gap_ms": distribution(&gaps),
    })
}

/// Number of decimals of a time, at most 4.
fn decimals(ms: f64) -> i32 {
    let is_whole = |digits: &i32| {
        let scaled = ms * 10f64.powi(*digits);
        (scaled - scaled.round()).abs() < 1e-3
    };
    (0..4).find(is_whole).unwrap_or(4)
}
