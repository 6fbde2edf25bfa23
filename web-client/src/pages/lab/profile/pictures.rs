//! A trial as a small picture. It shows both paths, the robot's danger zone at the closest
//! approach, and the inputs as a strip.

use super::Msg;
use crate::pages::parts;
use crate::view::{self, el};
use sidestep::api::TrialPicture;
use sidestep::vehicle::TurnInput;

type Node = view::Node<Msg>;

/// Width and height of a picture (px).
const SIZE: [f64; 2] = [168.0, 108.0];

/// Height of the strip of inputs (px).
const STRIP: f64 = 10.0;

/// Margin around the paths (m).
const MARGIN_M: f64 = 1.5;

/// The picture of a trial with its numbers and a link to the replay.
pub(super) fn card(trial: &TrialPicture, danger_radius_m: f64) -> Node {
    let summary = &trial.summary;
    let scene = summary.scene_words();
    let entered = summary.outcome.first_step_in_danger.is_some();
    let flags = parts::flags(&summary.flags);
    let closest = el("span")
        .class(if entered { "robot" } else { "quiet" })
        .text(format!("{:.2} m", summary.outcome.closest_m));
    let link = el("a")
        .attr("href", format!("/lab/replay/{}", summary.trial_id))
        .test_id("replay-link")
        .child(picture(trial, danger_radius_m))
        .child(
            el("span")
                .class("caption")
                .child(el("span").child(el("span").class("unseen").text("Replay ")).text(scene))
                .child(closest),
        );
    let item = el("li").key(&summary.trial_id).child(link);
    if flags.is_empty() { item } else { item.child(el("small").class("waiting").text(flags)) }
}

/// Explains the pictures.
pub(super) fn legend() -> Node {
    let key =
        |class: &str, words: &str| el("span").class("key").child(el("i").class(class)).text(words);
    el("p")
        .class("quiet picture-legend")
        .child(key("human", "participant"))
        .child(key("robot", "robot, with its danger zone at the closest approach"))
        .child(key("left", "left"))
        .child(key("right", "right"))
        .text("in the strip of inputs; the distance is the smallest between the two")
}

fn picture(trial: &TrialPicture, danger_radius_m: f64) -> Node {
    let [width, height] = SIZE;
    let all = || trial.human.iter().chain(&trial.robot);
    let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
        all().map(|at| at[axis]).fold(start, pick)
    };
    let low = [0, 1].map(|axis| bound(axis, f64::min, f64::INFINITY) - MARGIN_M);
    let high = [0, 1].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY) + MARGIN_M);
    let room = height - STRIP - 4.0;
    let scale = (width / (high[0] - low[0])).min(room / (high[1] - low[1]));
    let scale = if scale.is_finite() { scale } else { 1.0 };
    // Maps positions to the picture, centred and with y pointing upwards.
    let middle = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
    let place = |[x, y]: [f64; 2]| {
        [0.5 * width + scale * (x - middle[0]), 0.5 * room - scale * (y - middle[1])]
    };
    let line = |path: &[[f64; 2]], class: &str| {
        let points: Vec<_> =
            path.iter().map(|&at| place(at)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        el("polyline").class(class).attr("points", points.join(" "))
    };
    let end = |path: &[[f64; 2]], class: &str| {
        path.last().map(|&at| place(at)).map(|[x, y]| {
            el("circle")
                .class(class)
                .attr("cx", format!("{x:.1}"))
                .attr("cy", format!("{y:.1}"))
                .attr("r", 2.5)
        })
    };
    let distance =
        |(human, robot): (&[f64; 2], &[f64; 2])| (human[0] - robot[0]).hypot(human[1] - robot[1]);
    let pairs = || trial.human.iter().zip(&trial.robot);
    let closest = pairs().min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    let zone = closest.map(|(_, &robot)| place(robot)).map(|[x, y]| {
        el("circle")
            .class("zone")
            .attr("cx", format!("{x:.1}"))
            .attr("cy", format!("{y:.1}"))
            .attr("r", format!("{:.1}", scale * danger_radius_m))
    });
    el("svg")
        .attr("viewBox", format!("0 0 {width} {height}"))
        .attr("aria-hidden", "true")
        .children(zone)
        .child(line(&trial.robot, "way robot"))
        .child(line(&trial.human, "way human"))
        .children(end(&trial.robot, "end robot"))
        .children(end(&trial.human, "end human"))
        .children(strip(&trial.inputs.0))
}

/// The strip of inputs over time. Left turns are above the axis, right turns below it.
fn strip(inputs: &[TurnInput]) -> Vec<Node> {
    let [width, height] = SIZE;
    let step = width / inputs.len().max(1) as f64;
    let middle = height - 0.5 * STRIP;
    let mut drawn = vec![el("path").class("axis").attr("d", format!("M0 {middle}H{width}"))];
    let mut begin = 0;
    for run in inputs.chunk_by(|a, b| a == b) {
        let (class, top) = match run[0] {
            TurnInput::Left => ("left", middle - 0.5 * STRIP),
            TurnInput::Right => ("right", middle),
            TurnInput::Straight => ("", 0.0),
        };
        if !class.is_empty() {
            drawn.push(
                el("rect")
                    .class(class)
                    .attr("x", format!("{:.1}", begin as f64 * step))
                    .attr("y", format!("{top:.1}"))
                    .attr("width", format!("{:.1}", run.len() as f64 * step))
                    .attr("height", 0.5 * STRIP),
            );
        }
        begin += run.len();
    }
    drawn
}
