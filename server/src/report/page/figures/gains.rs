//! How much one feature set gains over another: the answer in one picture.

use super::super::words;
use super::figure;
use sidestep::chart::{Axis, Chart, Group, Mark, Series, Swarm, colours};
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
    let charts: Vec<Chart> = all
        .iter()
        .map(|(heading, first, second, rows)| {
            let name = format!("{first} − {second}");
            chart(heading, rows, Axis::round(&name, "points of accuracy", [low, high], 6))
        })
        .collect();
    let rows = all.iter().map(|(.., rows)| rows.len()).max().unwrap_or(0) as f64;
    let caption = "<b>What each kind of knowledge gains.</b> Points of accuracy in experiments I \
                   (right, straight or left) and II (turn or not). Right of zero the first set \
                   is better. The interval holds every gain that the paired Wilcoxon test does not \
                   reject at 5 %, one test at a time; with fewer than six people there is none.";
    figure(&charts, 66.0 + ROW * rows, caption)
}

fn chart(heading: &str, rows: &[&Gain], x: Axis) -> Chart {
    let said: Vec<String> =
        rows.iter().map(|gain| format!("{}: mean {:+.1}", name(gain), gain.paired.mean)).collect();
    let description = format!("Mean gain in points. {}.", said.join("; "));
    let y = Axis::categories("", rows.iter().map(|gain| name(gain))).downwards();
    let mut chart = Chart::new(heading, &description, x, y);
    let zero = chart.y.ends.map(|y| [0.0, y]);
    chart.add(Series::line("", zero, colours::MUTED, 1.0));
    let group = |gain: &&Gain| Group {
        values: gain.paired.gains.clone(),
        mean: gain.paired.mean,
        interval: gain.paired.interval,
    };
    chart.add(Swarm {
        name: "a person".to_owned(),
        groups: rows.iter().map(group).collect(),
        mark: Mark::Circle,
        ink: colours::MUTED.at(0.55),
        intervals: true,
        places: 1,
    });
    chart
}

fn name(gain: &Gain) -> String {
    words::model_in(gain.model, gain.experiment)
}
