//! Safety levels, range and input over time.

use crate::view::{Node, el};
use sidestep::api::TrialDetail;
use sidestep::scene::JointState;
use sidestep::vehicle::TurnInput;

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 130.0;
/// Part of the height for the input's strip and the time axis.
const FOOT: f64 = 34.0;

/// The chart stretches to its place, so that words stay outside of it.
pub(super) fn draw(trial: &TrialDetail, levels: &[(f64, f64)], time_s: f64) -> Node {
    let steps = trial.inputs.len() as f64;
    let radius = trial.parameters.danger_radius_m;
    let ranges: Vec<f64> =
        trial.states.iter().map(JointState::distance_m).map(|d| d - radius).collect();
    let of_levels = levels.iter().flat_map(|&(a, b)| [a, b]);
    let all = ranges.iter().copied().chain(of_levels);
    let (low, high) = all.fold((-1.0f64, 1.0f64), |(low, high), v| (low.min(v), high.max(v)));
    let x = |i: f64| i / steps * WIDTH;
    let y = |v: f64| (HEIGHT - FOOT) * (1.0 - (v - low) / (high - low)) + 4.0;
    let line = |class: &str, values: &mut dyn Iterator<Item = f64>| {
        let points: Vec<_> =
            values.enumerate().map(|(i, v)| format!("{:.1},{:.2}", x(i as f64), y(v))).collect();
        el("polyline").class(class).attr("points", points.join(" "))
    };
    let rule = |class: &str, v: f64| {
        el("line")
            .class(class)
            .attr("x1", 0)
            .attr("x2", WIDTH)
            .attr("y1", format!("{:.2}", y(v)))
            .attr("y2", format!("{:.2}", y(v)))
    };
    let every = if high - low > 12.0 { 5.0 } else { 2.0 };
    let ticks: Vec<f64> =
        (-20..=20).map(|i| f64::from(i) * every).filter(|v| (low..=high).contains(v)).collect();
    let rules = ticks.iter().map(|&v| rule(if v == 0.0 { "zero" } else { "rule" }, v));
    let inputs = trial.inputs.iter().enumerate().map(|(i, input)| {
        let (class, dy) = match input {
            TurnInput::Left => ("turn left", 0.0),
            TurnInput::Straight => ("turn straight", 4.0),
            TurnInput::Right => ("turn right", 6.0),
        };
        let height = if *input == TurnInput::Straight { 2.0 } else { 6.0 };
        el("rect")
            .class(class)
            .attr("x", format!("{:.2}", x(i as f64) + 1.0))
            .attr("y", HEIGHT - FOOT + 12.0 + dy - 1.0)
            .attr("width", format!("{:.2}", WIDTH / steps - 2.0))
            .attr("height", height)
    });
    let cursor = x(time_s / trial.parameters.step_s);
    let svg = el("svg")
        .attr("viewBox", format!("0 0 {WIDTH} {HEIGHT}"))
        .attr("preserveAspectRatio", "none")
        .attr("aria-hidden", "true")
        .children(rules)
        .child(line("range", &mut ranges.into_iter()))
        .child(line("robot", &mut levels.iter().map(|v| v.1)))
        .child(line("human", &mut levels.iter().map(|v| v.0)))
        .children(inputs)
        .child(
            el("line")
                .class("cursor")
                .attr("x1", format!("{cursor:.1}"))
                .attr("x2", format!("{cursor:.1}"))
                .attr("y1", 0)
                .attr("y2", HEIGHT - 14.0),
        );
    let percent = |v: f64| format!("top:{:.2}%", 100.0 * y(v) / HEIGHT);
    let unit = |v: f64| {
        if v == ticks[ticks.len() - 1] { format!("{v:.0} m") } else { format!("{v:.0}") }
    };
    let values =
        ticks.iter().map(|&v| el("span").class("y").attr("style", percent(v)).text(unit(v)));
    let duration = steps * trial.parameters.step_s;
    let seconds = (0..=10).map(|i| f64::from(i) * duration / 10.0);
    let seconds = seconds.map(|s| {
        let words = if s == duration { format!("{s:.0} s") } else { format!("{s:.0}") };
        el("span")
            .class("x")
            .attr("style", format!("left:{:.2}%", 100.0 * s / duration))
            .text(words)
    });
    el("div").class("plot").child(svg).children(values).children(seconds)
}
