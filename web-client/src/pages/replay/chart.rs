//! Safety levels, distance and input over time.

use super::{Msg, Replay};
use crate::view::{self, drawn, el};
use sidestep::chart::{
    Axis, Chart, ColourStyle, Drawing, Frame, LegendItem, Pen, Series, Table, colours,
};
use sidestep::scene::Evader;
use sidestep::vehicle::TurnInput;

type Node = view::Node<Msg>;

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 130.0;
const FRAME: Frame = Frame { left: 0.0, top: 4.0, width: WIDTH, height: 96.0 };
/// The line of the strip above which left turns are, and below which right turns are.
const MIDDLE: f64 = 116.0;
/// Height of the bar of a turn.
const BAR: f64 = 7.0;
const LEFT: colours::Colour = colours::HUMAN;
const RIGHT: colours::Colour = colours::SERIES[1];

/// The lines as data.
pub(super) fn lines(replay: &Replay) -> Chart {
    let Replay { trial, levels, .. } = replay;
    let time = |i: usize| i as f64 * trial.parameters.step_s;
    let radius = trial.parameters.danger_radius_m;
    let pen = |evader, colour| match replay.is_doubtful(evader) {
        true => Pen::new(colours::MUTED, 2.0).dashed(1.0, 4.0),
        false => Pen::new(colour, 2.0),
    };
    let level = |evader, name: &str, colour, pick: fn(&(f64, f64)) -> f64| {
        let points = levels.iter().enumerate().map(|(i, levels)| [time(i), pick(levels)]);
        Series::drawn(name, points, pen(evader, colour))
    };
    let states = trial.states.iter().enumerate();
    let range = states.map(|(i, state)| [time(i), state.distance_m() - radius]);
    let range =
        Series::drawn("distance − radius", range, Pen::new(colours::MUTED, 1.25).dashed(4.0, 3.0));
    let human = level(Evader::Human, "human’s safety level", colours::HUMAN, |v| v.0);
    let robot = level(Evader::Robot, "robot’s safety level", colours::ROBOT, |v| v.1);
    let series = [range, robot, human];
    let values = series.iter().flat_map(|series| &series.points).map(|datum| datum.at[1]);
    let ends = values.fold([-1.0f64, 1.0], |[low, high], v| [low.min(v), high.max(v)]);
    let x = Axis::time("time", [0.0, replay.duration_s()], 10);
    let mut chart = Chart::new("", "", x, Axis::linear("", "m", ends, 5));
    for series in series {
        chart.add(series);
    }
    chart
}

/// The chart. It stretches to its place, so that words stay outside of its drawing.
pub(super) fn draw(replay: &Replay, chart: &Chart) -> Node {
    let mut drawing = Drawing::new("", "", [WIDTH, HEIGHT]);
    for tick in chart.y.ticks() {
        let colour = if tick.value == 0.0 { colours::MUTED } else { colours::LINE };
        let [_, y] = chart.place(FRAME, [0.0, tick.value]);
        drawing.line([[0.0, y], [WIDTH, y]], Pen::new(colour, 1.0));
    }
    chart.draw_layers(&mut drawing, FRAME);
    let inputs = &replay.trial.inputs;
    let width = WIDTH / inputs.len() as f64;
    let bars = |held: TurnInput, top: f64, height: f64| {
        let steps = inputs.iter().enumerate().filter(|(_, input)| **input == held);
        let bar = |(i, _)| {
            let left = i as f64 * width;
            [left + 1.0, top, left + width - 1.0, top + height]
        };
        steps.map(bar).collect::<Vec<_>>()
    };
    drawing.boxes(bars(TurnInput::Left, MIDDLE - BAR, BAR), LEFT);
    drawing.boxes(bars(TurnInput::Straight, MIDDLE - 0.5, 1.0), colours::LINE);
    drawing.boxes(bars(TurnInput::Right, MIDDLE, BAR), RIGHT);
    let now = WIDTH * chart.x.share(replay.time_s);
    drawing.line([[now, 0.0], [now, MIDDLE + BAR]], Pen::new(colours::TEXT, 1.5));
    let svg = drawn(drawing.element(ColourStyle::Properties))
        .attr("preserveAspectRatio", "none")
        .attr("aria-hidden", "true");

    let label = |class: &str, style: String, words: String| {
        el("span").class(class).attr("style", style).text(words)
    };
    let top = |y: f64| format!("top:{:.2}%", 100.0 * y / HEIGHT);
    // The unit stands at the last label alone.
    let last = chart.y.ticks().count();
    let y_labels = chart.y.ticks().zip(1..).map(|(tick, n)| {
        let unit = if n == last { " m" } else { "" };
        let [_, y] = chart.place(FRAME, [0.0, tick.value]);
        label("y", top(y), format!("{}{unit}", tick.label))
    });
    let sides = [("left", MIDDLE - 0.9 * BAR), ("right", MIDDLE + 0.9 * BAR)];
    let sides = sides.map(|(side, y)| label("y", top(y), side.to_owned()));
    let last = chart.x.ticks().count();
    let x_labels = chart.x.ticks().zip(1..).map(|(tick, n)| {
        let unit = if n == last { format!(" {}", chart.x.unit) } else { String::new() };
        let left = format!("left:{:.2}%", 100.0 * tick.share);
        label("x", left, format!("{}{unit}", tick.label))
    });
    el("div").class("plot").child(svg).children(y_labels).children(sides).children(x_labels)
}

/// What the signs mean.
pub(super) fn legend(chart: &Chart) -> Node {
    let mut items = chart.legend();
    items.reverse();
    items.push(LegendItem::area("turns left", Some(LEFT.into()), None));
    items.push(LegendItem::area("turns right", Some(RIGHT.into()), None));
    let items = items.into_iter().map(|item| {
        let sign = drawn(item.sign.element(ColourStyle::Properties)).attr("aria-hidden", "true");
        el("span").class("key").child(sign).child(el("span").text(item.text))
    });
    el("span").class("legend").children(items)
}

/// The chart's numbers, and the input held from each time on.
pub(super) fn table(replay: &Replay, chart: &Chart) -> Table {
    let mut table = chart.table();
    table.columns.push("input".to_owned());
    let inputs = replay.trial.inputs.iter().map(|input| input.word());
    for (row, input) in table.rows.iter_mut().zip(inputs.chain([""])) {
        row.push(input.to_owned());
    }
    table
}
