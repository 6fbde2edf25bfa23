//! The charts of the report.

mod decisions;
mod generalisation;
mod people;
mod rollouts;

use super::text::fixed;
use serde_json::{Value, json};
use sidestep::chart::{
    Align, Axis, Chart, Colour, ColourStyle, Datum, Drawing, Group, LegendItem, Mark, Pen, Series,
    Swarm, Table, colours,
};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Experiment;
use sidestep::comparison::gains::Gain;
use sidestep::comparison::models::ModelName;
use sidestep::comparison::tables::Metric;

/// Width of every chart (px), which fits a phone. A wider page shows several charts side by side, so
/// that the size of text stays the same.
const WIDTH: f64 = 340.0;

/// Charts that belong together and share one legend.
pub(super) struct Figure {
    /// The name in templates, which is also the name of the file.
    pub(super) name: &'static str,
    drawings: Vec<Drawing>,
    legend: Vec<LegendItem>,
    tables: Vec<Table>,
    /// Whether the charts are maps, whose tones need a scale.
    has_tones: bool,
}

/// A figure of charts with this height, side by side.
fn figure(name: &'static str, charts: &[Chart], height: f64) -> Figure {
    drawn(name, charts, |chart| chart.drawing([WIDTH, height]))
}

/// A figure of charts, each drawn by `draw`.
fn drawn(name: &'static str, charts: &[Chart], draw: impl Fn(&Chart) -> Drawing) -> Figure {
    let tables = charts.iter().map(Chart::table).filter(|table| !table.rows.is_empty());
    Figure {
        name,
        drawings: charts.iter().map(draw).collect(),
        legend: LegendItem::of_layers(charts.iter().flat_map(|chart| &chart.layers)),
        tables: tables.collect(),
        has_tones: false,
    }
}

/// Gap between the charts in a file and around them (px).
const GAP: f64 = 20.0;

impl Figure {
    /// The charts, their legend and their numbers, for a page.
    pub(super) fn on_page(&self) -> Value {
        let item = |LegendItem { sign, text }: &LegendItem| {
            let mut svg = sign.element(ColourStyle::Properties);
            svg.attributes.retain(|(name, _)| *name != "role");
            let size = [("width", "26"), ("height", "12"), ("aria-hidden", "true")];
            svg.attributes.extend(size.map(|(name, value)| (name, value.to_owned())));
            json!({ "sign": svg.to_string(), "text": text })
        };
        let drawings = self.drawings.iter().map(|of| of.element(ColourStyle::Properties));
        let tones = || (0..TONES).map(|tone| 100.0 * opacity(tone)).collect::<Vec<_>>();
        json!({
            "drawings": drawings.map(|svg| svg.to_string()).collect::<Vec<_>>(),
            "legend": self.legend.iter().map(item).collect::<Vec<_>>(),
            "tables": self.tables,
            "tones": self.has_tones.then(tones),
        })
    }

    /// The text of an SVG file with the charts in up to three columns and the legend below.
    pub(super) fn svg(&self) -> String {
        let columns = self.drawings.len().clamp(1, if self.has_tones { 2 } else { 3 });
        let width = GAP + columns as f64 * (WIDTH + GAP);
        let rows: Vec<&[Drawing]> = self.drawings.chunks(columns).collect();
        let height = |row: &[Drawing]| row.iter().map(|of| of.size[1]).fold(0.0, f64::max) + GAP;
        let mut drawing = Drawing::new(self.name, "", [width, 0.0]);
        let mut top = GAP;
        for row in rows {
            for (i, of) in row.iter().enumerate() {
                drawing.place(of, [GAP + i as f64 * (WIDTH + GAP), top]);
            }
            top += height(row);
        }
        if self.has_tones {
            let text = "probability of a turn";
            drawing.text(text, [GAP, top + 8.0], 12.0, colours::TEXT, Align::Left);
            for tone in 0..TONES {
                let left = GAP + 190.0 + 20.0 * tone as f64;
                let ink = colours::MAP.at(opacity(tone));
                drawing.boxes(vec![[left, top, left + 20.0, top + 16.0]], ink);
            }
            for (text, at, align) in [("0", 184.0, Align::Right), ("1", 396.0, Align::Left)] {
                drawing.text(text, [GAP + at, top + 8.0], 12.0, colours::MUTED, align);
            }
            top += 16.0 + GAP;
        }
        if !self.legend.is_empty() {
            top += drawing.legend(&self.legend, [GAP, top + 6.0], width - 2.0 * GAP) + GAP;
        }
        drawing.size[1] = top;
        drawing.svg()
    }
}

/// All figures of the report, in their order.
pub(super) fn all(analysis: &Analysis) -> Vec<Figure> {
    let mut figures = vec![gains(analysis)];
    figures.extend(people::behaviour(analysis));
    figures.extend([accuracies(analysis), distances(analysis)]);
    figures.extend(generalisation::learning(analysis));
    figures.extend(generalisation::unseen(analysis));
    figures.extend(generalisation::importance(analysis));
    figures.extend(decisions::decisions(analysis));
    figures.push(rollouts::rollouts(analysis));
    figures.extend(rollouts::beyond(analysis));
    figures.push(calibration(analysis));
    figures
}

/// Number of tones in a map.
const TONES: usize = 10;

fn opacity(tone: usize) -> f64 {
    (2 * tone + 1) as f64 / (2 * TONES) as f64
}

/// A model's colour and mark.
fn look(model: ModelName) -> (Colour, Mark) {
    let row = model.row();
    (colours::SERIES[row.colour], row.mark)
}

/// The question of an experiment.
fn question(experiment: Experiment) -> String {
    let words = match experiment {
        Experiment::TurnDirection => "right, straight or left",
        Experiment::Avoidance => "turn or not",
    };
    format!("{}: {words}", experiment.numeral())
}

/// A dashed line that only marks a reference.
fn reference(ends: [[f64; 2]; 2]) -> Series {
    Series::drawn("", ends, Pen::new(colours::MUTED, 1.5).dashed(5.0, 3.0))
}

/// The range of the numbers, extended to contain 0.
fn range(numbers: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    [numbers.clone().fold(0.0, f64::min), numbers.fold(0.0, f64::max)]
}

/// The gains of one feature set over another that the findings report. For each pair of sets: the
/// title of its chart, the name of its axis, and the gains.
fn gain_pairs(analysis: &Analysis) -> Vec<(&'static str, String, Vec<&Gain>)> {
    const PAIRS: [(&str, &str, &str); 3] = [
        ("hrd", "d", "Safety levels over distance alone"),
        ("d_body", "hrd", "Body frame over safety levels"),
        ("hrd_body", "d_body", "Safety levels beside body frame"),
    ];
    let pair = |(first, second, heading)| {
        (heading, format!("{first} − {second}"), analysis.gains(first, second))
    };
    PAIRS.into_iter().map(pair).filter(|(.., gains)| !gains.is_empty()).collect()
}

/// The gain of one feature set over another, in each model and experiment. This figure shows the
/// main result.
fn gains(analysis: &Analysis) -> Figure {
    let all = gain_pairs(analysis);
    let rows = all.iter().map(|(.., gains)| gains.len()).max().unwrap_or(0);
    let each = all.iter().flat_map(|(.., gains)| gains).flat_map(|gain| &gain.paired.gains);
    let range = range(each.copied());
    let chart = |(heading, pair, gains): &(&str, String, Vec<&Gain>)| {
        let name =
            |gain: &&Gain| format!("{} {}", gain.model.row().short, gain.experiment.numeral());
        let mean = |gain: &&Gain| format!("{}: mean {:+.1}", name(gain), gain.paired.mean);
        let means = gains.iter().map(mean).collect::<Vec<_>>().join("; ");
        let x = Axis::round(pair, "points of accuracy", range, 6);
        let y = Axis::categories("", gains.iter().map(name)).downwards();
        let mut chart = Chart::new(heading, &format!("Mean gain in points. {means}."), x, y);
        let zero = chart.y.ends.map(|y| [0.0, y]);
        chart.add(Series::line("", zero, colours::MUTED, 1.0));
        let group = |gain: &&Gain| Group {
            values: gain.paired.gains.clone(),
            centre: gain.paired.typical,
            interval: gain.paired.interval,
        };
        chart.add(Swarm {
            name: "a person".to_owned(),
            groups: gains.iter().map(group).collect(),
            mark: Mark::Circle,
            ink: colours::MUTED.at(0.55),
            centre: "typical gain",
            interval: Some("95 % interval"),
            places: 1,
        });
        chart
    };
    figure("gains", &all.iter().map(chart).collect::<Vec<_>>(), 66.0 + 30.0 * rows as f64)
}

/// A chart of one model with a dot for each person on each feature set.
struct PeopleChart<'a> {
    model: ModelName,
    heading: String,
    /// For each feature set, its name and a group with a number for each person.
    columns: Vec<(&'a str, Group)>,
    baseline: Option<f64>,
}

/// Accuracy of each model in both experiments.
fn accuracies(analysis: &Analysis) -> Figure {
    let sets = analysis.comparison.sets();
    let mut charts = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let means = analysis.comparison.accuracies(model, experiment, &sets);
            let column = |(&set, mean)| {
                let values = analysis.comparison.person_accuracies(model, experiment, set);
                (set, Group { values, centre: mean, interval: None })
            };
            charts.push(PeopleChart {
                model,
                heading: format!("{} {}", model.row().short, question(experiment)),
                columns: sets.iter().zip(means).map(column).collect(),
                baseline: Some(analysis.baseline_accuracy(experiment)),
            });
        }
    }
    people_charts("accuracies", &charts, ["accuracy", "%"])
}

/// D_start and D_end of each model.
fn distances(analysis: &Analysis) -> Figure {
    let (sets, experiment) = (analysis.comparison.sets(), Experiment::Avoidance);
    let mut charts = Vec::new();
    for (metric, word) in [(Metric::Start, "first"), (Metric::End, "last")] {
        for model in ModelName::PAPERS {
            let column = |&set| {
                let values = analysis.comparison.person_metric(metric, model, experiment, set);
                let mean = analysis.comparison.person_mean(metric, model, experiment, set);
                (set, Group { values, centre: mean, interval: None })
            };
            charts.push(PeopleChart {
                model,
                heading: format!("{}: {word} step of avoidance", model.row().short),
                columns: sets.iter().map(column).collect(),
                baseline: None,
            });
        }
    }
    people_charts("distances", &charts, ["distance", "steps"])
}

fn people_charts(file: &'static str, all: &[PeopleChart<'_>], [name, unit]: [&str; 2]) -> Figure {
    let groups = all.iter().flat_map(|of| &of.columns).map(|(_, group)| group);
    let numbers = groups.flat_map(|group| &group.values);
    let numbers = numbers.copied().chain(all.iter().filter_map(|of| of.baseline));
    let [_, high] = range(numbers.clone());
    // Readers compare accuracies by position, so their axis need not begin at zero. Distances are
    // measured from zero.
    let low = if unit == "%" { numbers.fold(high, f64::min) } else { 0.0 };
    let y = Axis::round(name, unit, [low, high], 5);
    let charts = all.iter().map(|of| people_chart(of, y.clone()));
    figure(file, &charts.collect::<Vec<_>>(), 220.0)
}

fn people_chart(of: &PeopleChart<'_>, y: Axis) -> Chart {
    let mean = |(set, group): &(&str, Group)| format!("{set} {}", fixed(group.centre, 1));
    let means = of.columns.iter().map(mean).collect::<Vec<_>>().join(", ");
    let label = |(set, _): &(&str, Group)| {
        let body = set.strip_suffix("_body").map(|letters| format!("{letters}\nbody"));
        body.unwrap_or_else(|| (*set).to_owned())
    };
    let x = Axis::categories("", of.columns.iter().map(label));
    let description = format!("Means over people by feature set: {means}.");
    let mut chart = Chart::new(&of.heading, &description, x, y);
    if let Some(baseline) = of.baseline {
        let ends = chart.x.ends.map(|x| [x, baseline]);
        chart.add(reference(ends));
    }
    let (colour, mark) = look(of.model);
    chart.add(Swarm {
        name: "a person".to_owned(),
        groups: of.columns.iter().map(|(_, group)| group.clone()).collect(),
        mark,
        ink: colour.at(0.55),
        centre: "mean",
        interval: None,
        places: 1,
    });
    chart
}

/// The accuracy of the models with the feature set B_hrd against their predicted probability.
fn calibration(analysis: &Analysis) -> Figure {
    figure(
        "calibration",
        &Experiment::ALL.map(|experiment| calibration_chart(analysis, experiment)),
        300.0,
    )
}

fn calibration_chart(analysis: &Analysis, experiment: Experiment) -> Chart {
    /// Bins with fewer rows are not drawn.
    const LEAST_ROWS: usize = 20;
    let least = 1.0 / experiment.classes().len() as f64;
    let from = (10.0 * least).floor() / 10.0;
    let x = Axis::linear("probability of the likeliest class", "", [from, 1.0], 8);
    let y = Axis::linear("share that was right", "", [0.0, 1.0], 5);
    let mut chart = Chart::new(&question(experiment), "", x, y);
    chart.add(reference([[from, from], [1.0, 1.0]]));
    let mut described = Vec::new();
    for model in ModelName::PAPERS {
        let all = analysis.pooled(Some(model), experiment, "hrd");
        let total = all.map_or(1, |of| of.calibration.rows).max(1) as f64;
        let kept = all.into_iter().flat_map(|of| of.bins).filter(|bin| bin.rows >= LEAST_ROWS);
        let datum = kept.map(|bin| {
            let n = bin.rows as f64;
            let [p, right] = [bin.confidence / n, bin.right as f64 / n];
            let says = format!("{} steps: {p:.2} said, {right:.2} right", bin.rows);
            Datum { at: [p, right], radius: 2.2 + 7.0 * (n / total).sqrt(), says }
        });
        let (colour, mark) = look(model);
        let mut series = Series::line(model.row().short, [], colour, 2.0).marked(mark);
        series.points = datum.collect();
        let points = series.points.iter().map(|of| format!("{:.2} {:.2}", of.at[0], of.at[1]));
        described.push(format!("{}: {}", series.name, points.collect::<Vec<_>>().join(", ")));
        chart.add(series);
    }
    chart.description = format!("Mean probability and share right. {}.", described.join("; "));
    chart
}
