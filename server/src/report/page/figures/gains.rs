//! How much one feature set gains over another: the answer in one picture.

use super::super::chart::{Anchor, Axis, Chart, Margins, Mark, figure, legend};
use super::super::words;
use sidestep::comparison::Analysis;
use sidestep::comparison::gains::Gain;

/// Which sets are compared, as in the findings, and how a chart is headed.
const PAIRS: [(&str, &str, &str); 3] = [
    ("hrd", "d", "Safety levels over distance alone"),
    ("d_body", "hrd", "Body frame over safety levels"),
    ("hrd_body", "d_body", "Safety levels beside body frame"),
];

const ROW: f64 = 30.0;

/// The gains of each model and experiment, with a dot for each person.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let all: Vec<_> = PAIRS
        .into_iter()
        .map(|(first, second, heading)| (heading, first, second, analysis.gains(first, second)))
        .filter(|(.., rows)| !rows.is_empty())
        .collect();
    let every = || all.iter().flat_map(|(.., rows)| rows).flat_map(|gain| &gain.paired.gains);
    let low = every().copied().fold(0.0, f64::min);
    let high = every().copied().fold(0.0, f64::max);
    let charts: Vec<String> = all
        .iter()
        .map(|(heading, first, second, rows)| {
            let axis =
                Axis::round(low, high, 6, &format!("{first} − {second} (points of accuracy)"));
            chart(heading, rows, axis)
        })
        .collect();
    let signs = legend(&[
        ("<circle class=\"dot\" cx=\"13\" cy=\"6\" r=\"3\"/>", "a person"),
        (
            "<line class=\"interval\" x1=\"1\" y1=\"6\" x2=\"25\" y2=\"6\"/>\
             <polygon class=\"diamond\" points=\"13,0.5 18,6 13,11.5 8,6\"/>",
            "mean, and 95 % interval of the typical gain",
        ),
    ]);
    let caption = "<b>What each kind of knowledge gains.</b> Points of accuracy in experiments I \
                   (right, straight or left) and II (turn or not). Right of the line the first set \
                   is better. The interval holds every gain that the paired Wilcoxon test does not \
                   reject at 5 %, one test at a time; with fewer than six people there is none.";
    figure(&charts, &signs, caption)
}

fn chart(heading: &str, rows: &[&Gain], axis: Axis) -> String {
    let height = 26.0 + ROW * rows.len() as f64 + 40.0;
    let none = Axis::exact(0.0, rows.len().max(1) as f64, vec![], "");
    let said: Vec<String> =
        rows.iter().map(|gain| format!("{}: mean {:+.1}", name(gain), gain.paired.mean)).collect();
    let description = format!("Mean gain in points. {}.", said.join("; "));
    let margins = Margins([50.0, 26.0, 12.0, 40.0]);
    let mut chart = Chart::new(heading, &description, height, margins, (axis, none));
    let [left, top, _, bottom] = chart.edges();
    let zero = chart.x(0.0);
    chart.segment("zero", [zero, top], [zero, bottom]);
    for (i, gain) in rows.iter().enumerate() {
        let paired = &gain.paired;
        let middle = top + ROW * (i as f64 + 0.5);
        chart.text("category", [left - 8.0, middle + 4.0], Anchor::End, &name(gain));
        let people = paired.gains.len();
        for (person, gain) in paired.gains.iter().enumerate() {
            let at = [chart.x(*gain), middle + 8.0 * spread(person, people)];
            chart.mark("dot", Mark::Circle, at, dot_radius(people), &format!("{gain:+.1} points"));
        }
        if let Some([from, to]) = paired.interval {
            chart.segment("interval", [chart.x(from), middle], [chart.x(to), middle]);
        }
        let x = chart.x(paired.mean);
        let diamond = [[x, middle - 6.0], [x + 5.5, middle], [x, middle + 6.0], [x - 5.5, middle]];
        chart.polygon("diamond", &diamond);
    }
    chart.finished()
}

fn name(gain: &Gain) -> String {
    words::model_in(gain.model, gain.experiment)
}

/// From −1 to 1, so that people's dots do not hide each other: the same for a person everywhere.
pub(super) fn spread(person: usize, people: usize) -> f64 {
    if people < 2 {
        return 0.0;
    }
    // Neighbours far apart.
    let place = (person * 5 + person / 7) % people;
    2.0 * place as f64 / (people - 1) as f64 - 1.0
}

/// Smaller where there are many.
pub(super) fn dot_radius(people: usize) -> f64 {
    if people <= 20 { 2.6 } else { 1.7 }
}
