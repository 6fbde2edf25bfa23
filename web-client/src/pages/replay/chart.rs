//! Safety levels, distance and inputs over time.

use super::Msg;
use crate::view::{self, drawn, el, still};
use sidestep::api::TrialDetail;
use sidestep::chart::{
    Axis, Chart, ColourStyle, Drawing, Frame, LegendItem, Pen, Series, Table, colours,
};
use sidestep::scene::Evader;
use sidestep::trial_view::{Playback, Probabilities};
use sidestep::vehicle::TurnInput;

type Node = view::Node<Msg>;

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 158.0;
const FRAME: Frame = Frame { left: 0.0, top: 4.0, width: WIDTH, height: 96.0 };
/// y (px, downwards) of the line that separates left turns (above it) from right turns (below it)
/// in the strip of inputs.
const MIDDLE: f64 = 117.0;
/// Height of the bar for a turn.
const BAR: f64 = 8.0;
/// Top and bottom (px) of the strip of predicted probabilities. From top to bottom, it is divided
/// into left, straight and right, in proportion to their probabilities.
const PREDICTED: [f64; 2] = [134.0, 154.0];
const LEFT: colours::Colour = colours::HUMAN;
const RIGHT: colours::Colour = colours::SERIES[1];

/// The parts that do not change with time, cached between frames.
pub(super) struct Strip {
    /// The data of the lines in the chart.
    lines: Chart,
    /// The whole chart without the mark at the current time.
    drawing: Node,
}

impl Strip {
    /// Draws the chart of a trial.
    pub(super) fn new(trial: &TrialDetail, playback: &Playback) -> Self {
        let lines = lines(trial, playback);
        let drawing = draw(trial, playback, &lines);
        Self { lines, drawing }
    }

    /// The chart with a mark at the current time. The drawing is stretched to fill its space, so
    /// text is kept outside of it.
    pub(super) fn view(&self, playback: &Playback) -> Node {
        let now = 100.0 * self.lines.x.share(playback.now().time_s);
        let now = el("i").class("now").attr("style", format!("left:{now:.3}%"));
        self.drawing.clone().child(now)
    }

    /// The legend.
    pub(super) fn legend(&self) -> Node {
        legend(&self.lines)
    }

    /// The chart's data as a table. Each row has the input that is held from its time on.
    pub(super) fn table(&self, trial: &TrialDetail, playback: &Playback) -> Table {
        table(trial, playback, &self.lines)
    }
}

fn lines(trial: &TrialDetail, playback: &Playback) -> Chart {
    let time = |i: usize| i as f64 * trial.parameters.step_s;
    let radius = trial.parameters.danger_radius_m;
    let pen = |evader, colour| match playback.is_doubtful(evader) {
        true => Pen::new(colours::MUTED, 2.0).dashed(1.0, 4.0),
        false => Pen::new(colour, 2.0),
    };
    let level = |evader, name: &str, colour, place: usize| {
        let points = playback.levels().iter().enumerate();
        let points = points.map(|(i, levels)| [time(i), levels[place]]);
        Series::drawn(name, points, pen(evader, colour))
    };
    let states = trial.states.iter().enumerate();
    let range = states.map(|(i, state)| [time(i), state.distance_m() - radius]);
    let range =
        Series::drawn("distance − radius", range, Pen::new(colours::MUTED, 1.25).dashed(4.0, 3.0));
    let human = level(Evader::Human, "human’s safety level", colours::HUMAN, 0);
    let robot = level(Evader::Robot, "robot’s safety level", colours::ROBOT, 1);
    let series = [range, robot, human];
    let values = series.iter().flat_map(|series| &series.points).map(|datum| datum.at[1]);
    let ends = values.fold([-1.0f64, 1.0], |[low, high], v| [low.min(v), high.max(v)]);
    let x = Axis::time("time", [0.0, playback.duration_s()], 10);
    let mut chart = Chart::new("", "", x, Axis::linear("", "m", ends, 5));
    for series in series {
        chart.add(series);
    }
    chart
}

fn draw(trial: &TrialDetail, playback: &Playback, chart: &Chart) -> Node {
    let mut drawing = Drawing::new("", "", [WIDTH, HEIGHT]);
    for tick in chart.y.ticks() {
        let colour = if tick.value == 0.0 { colours::MUTED } else { colours::LINE };
        let [_, y] = chart.place(FRAME, [0.0, tick.value]);
        drawing.line([[0.0, y], [WIDTH, y]], Pen::new(colour, 1.0));
    }
    chart.draw_layers(&mut drawing, FRAME);
    let inputs = &trial.inputs;
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
    let [top, bottom] = PREDICTED;
    for (place, colour) in [(0, LEFT), (1, colours::LINE), (2, RIGHT)] {
        let share = |p: &Probabilities, places: core::ops::Range<usize>| -> f64 {
            p[places].iter().map(|(_, p)| p).sum()
        };
        let bar = |(i, p): (usize, &Probabilities)| {
            let left = i as f64 * width;
            let edge = |places| top + (bottom - top) * share(p, places);
            [left + 1.0, edge(0..place), left + width - 1.0, edge(0..place + 1)]
        };
        // The last state has no input.
        let known = playback.forecast().iter().take(inputs.len()).enumerate();
        drawing.boxes(known.map(bar).collect(), colour);
    }
    let svg = still(&drawing.element(ColourStyle::Properties))
        .attr("preserveAspectRatio", "none")
        .attr("aria-hidden", "true");

    let label = |class: &str, style: String, words: String| {
        el("span").class(class).attr("style", style).text(words)
    };
    let top = |y: f64| format!("top:{:.2}%", 100.0 * y / HEIGHT);
    // Only the last label has the unit.
    let last = chart.y.ticks().count();
    let y_labels = chart.y.ticks().zip(1..).map(|(tick, n)| {
        let unit = if n == last { " m" } else { "" };
        let [_, y] = chart.place(FRAME, [0.0, tick.value]);
        label("y", top(y), format!("{}{unit}", tick.label))
    });
    let sides = [("left", MIDDLE - 0.9 * BAR), ("right", MIDDLE + 0.9 * BAR)];
    let sides = sides.map(|(side, y)| label("y", top(y), side.to_owned()));
    let is_known = !playback.forecast().is_empty();
    let middle = 0.5 * (PREDICTED[0] + PREDICTED[1]);
    let predicted = is_known.then(|| label("y", top(middle), "predicted".to_owned()));
    let last = chart.x.ticks().count();
    let x_labels = chart.x.ticks().zip(1..).map(|(tick, n)| {
        let unit = if n == last { format!(" {}", chart.x.unit) } else { String::new() };
        let left = format!("left:{:.2}%", 100.0 * tick.share);
        label("x", left, format!("{}{unit}", tick.label))
    });
    el("div")
        .class("plot")
        .child(svg)
        .children(y_labels)
        .children(sides)
        .children(predicted)
        .children(x_labels)
}

fn legend(chart: &Chart) -> Node {
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

fn table(trial: &TrialDetail, playback: &Playback, chart: &Chart) -> Table {
    let mut table = chart.table();
    table.columns.push("input".to_owned());
    let inputs = trial.inputs.iter().map(|input| input.word());
    for (row, input) in table.rows.iter_mut().zip(inputs.chain([""])) {
        row.push(input.to_owned());
    }
    let forecast = playback.forecast();
    if !forecast.is_empty() {
        let names = forecast[0].iter().map(|(input, _)| format!("predicted {}", input.word()));
        table.columns.extend(names);
        for (row, probabilities) in table.rows.iter_mut().zip(forecast) {
            row.extend(probabilities.iter().map(|(_, p)| format!("{:.0} %", 100.0 * p)));
        }
    }
    table
}
