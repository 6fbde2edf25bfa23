//! How predictions fare that are fed with what they said.

use super::super::words;
use super::{figure, look};
use sidestep::chart::{Axis, Chart, Mark, Pen, Series, colours};
use sidestep::comparison::Analysis;
use sidestep::comparison::RolloutsOf;
use sidestep::comparison::cell::{HISTORY_SET, ModelName};
use sidestep::comparison::rollout::Horizon;

const HEIGHT: f64 = 250.0;

/// A curve: driver, feature set, name, pen and mark.
#[derive(Clone, Copy)]
struct Line {
    driver: &'static str,
    features: &'static str,
    name: &'static str,
    pen: Pen,
    mark: Option<Mark>,
}

impl Line {
    /// Of a model on a feature set.
    fn of(model: ModelName, features: &'static str) -> Self {
        let (colour, mark) = look(model);
        let (driver, name, pen) = (model.word(), words::model(model), Pen::new(colour, 2.0));
        Self { driver, features, name, pen, mark: Some(mark) }
    }

    /// Of a driver who does not think.
    fn simple(driver: &'static str, name: &'static str, dash: f64) -> Self {
        let pen = Pen::new(colours::MUTED, 2.0).dashed(dash, 3.0);
        Self { driver, features: "", name, pen, mark: None }
    }

    fn horizons<'a>(&self, all: &'a [RolloutsOf]) -> Option<&'a [Horizon]> {
        let of = all.iter().find(|of| of.driver == self.driver && of.features == self.features)?;
        Some(&of.horizons)
    }
}

/// Against the horizon: accuracy, position error and log loss; of the paper's models on B_hrd, and
/// of those that know more.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let caption = format!(
        "<b>Roll-outs</b> of the paper’s models on {}, from every step of the test trials: each \
         predicted input moves the human, and the next prediction is made from there. Less is \
         better for distance and log loss. Windows overlap and are pooled over people, so that no \
         test is made of them.",
        words::set("hrd")
    );
    let papers = ModelName::PAPERS.map(|model| Line::of(model, "hrd"));
    let first = figure(&charts(analysis, &papers), HEIGHT, &caption);
    let memory = Pen::new(colours::SERIES[3], 2.0).dashed(9.0, 4.0);
    let beyond = [
        Line::of(ModelName::Svm, "hrd_body"),
        Line::of(ModelName::Boosted, "hrd_body"),
        Line { name: "LR with memory", ..Line::of(ModelName::Lr, HISTORY_SET) },
        Line {
            name: "boosted trees with memory",
            pen: memory,
            mark: Some(Mark::Diamond),
            ..Line::of(ModelName::Boosted, HISTORY_SET)
        },
    ];
    let found = |line: &&Line| line.horizons(&analysis.rollouts).is_some();
    if beyond.iter().filter(found).count() < 2 {
        return first;
    }
    let caption = format!(
        "<b>Roll-outs beyond the paper</b>: on {}, and with a memory of the inputs held so far. \
         Boosted trees: gradient-boosted decision trees.",
        words::set("hrd_body")
    );
    first + &figure(&charts(analysis, &beyond), HEIGHT, &caption)
}

/// Of these and of the simple drivers.
fn charts(analysis: &Analysis, lines: &[Line]) -> [Chart; 3] {
    let simple = [
        Line::simple("held_input", "holds the last input", 6.0),
        Line::simple("straight", "drives straight on", 2.0),
    ];
    let all = lines.iter().copied().chain(simple);
    let curves: Vec<(Line, &[Horizon])> =
        all.filter_map(|line| Some((line, line.horizons(&analysis.rollouts)?))).collect();
    let step_s = analysis.data.scene.step_s;
    [
        chart(&curves, step_s, "Accuracy", ["accuracy", "%"], |h| 100.0 * h.accuracy()),
        chart(&curves, step_s, "Distance from the person", ["distance", "m"], |h| {
            h.mean_distance_m()
        }),
        chart(&curves, step_s, "Log loss", ["log loss", "nats"], |h| h.mean_log_loss()),
    ]
}

fn chart(
    curves: &[(Line, &[Horizon])],
    step_s: f64,
    heading: &str,
    [name, unit]: [&str; 2],
    value: fn(&Horizon) -> f64,
) -> Chart {
    let all = || curves.iter().flat_map(|(_, horizons)| *horizons).map(value);
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    // Shares are told apart from where they are; a distance from nothing.
    let low = if unit == "%" { low.min(high) } else { 0.0 };
    let steps = curves.iter().map(|(_, horizons)| horizons.len()).max().unwrap_or(1);
    let end_s = step_s * steps as f64;
    let said = curves
        .iter()
        .filter_map(|(line, of)| Some(format!("{} {:.2}", line.name, value(of.last()?))));
    let said = said.collect::<Vec<_>>().join(", ");
    let description = format!("{name} ({unit}) {end_s:.1} s ahead: {said}.");
    let (x, y) =
        (Axis::time("time ahead", [0.0, end_s], 5), Axis::round(name, unit, [low, high], 5));
    let mut chart = Chart::new(heading, &description, x, y);
    for (line, horizons) in curves {
        let point = |(i, h): (usize, &Horizon)| [step_s * (i + 1) as f64, value(h)];
        let points = horizons.iter().enumerate().map(point);
        let series = Series::drawn(line.name, points, line.pen);
        let says =
            |[seconds, value]: [f64; 2]| format!("{}, {seconds:.1} s: {value:.2}", line.name);
        chart.add(match line.mark {
            Some(mark) => series.marked(mark).saying(says),
            None => series,
        });
    }
    chart
}
