//! Charts of roll-outs: how well models predict from a given moment on, if each prediction becomes
//! the next input.

use super::{Figure, figure, look, range};
use sidestep::chart::{Axis, Chart, Mark, Pen, Series, colours};
use sidestep::comparison::models::{BEYOND, Beyond, ModelName};
use sidestep::comparison::rollout::{Horizon, Simple};
use sidestep::comparison::{Analysis, RolloutsOf};
use sidestep::features::HISTORY_SET;

/// A curve of roll-outs. Its driver is the model or the simple rule that chooses the inputs.
#[derive(Clone, Copy)]
struct Line {
    driver: &'static str,
    features: &'static str,
    name: &'static str,
    pen: Pen,
    mark: Option<Mark>,
}

impl Line {
    /// The curve of a model on a feature set.
    fn of(model: ModelName, features: &'static str) -> Self {
        let (colour, mark) = look(model);
        let (driver, name, pen) = (model.word(), model.row().short, Pen::new(colour, 2.0));
        Self { driver, features, name, pen, mark: Some(mark) }
    }

    /// The curve of a simple driver.
    fn simple(driver: Simple, name: &'static str, dash: f64) -> Self {
        let pen = Pen::new(colours::MUTED, 2.0).dashed(dash, 3.0);
        Self { driver: driver.word(), features: "", name, pen, mark: None }
    }

    fn horizons<'a>(&self, all: &'a [RolloutsOf]) -> Option<&'a [Horizon]> {
        let of = all.iter().find(|of| of.driver == self.driver && of.features == self.features)?;
        Some(&of.horizons)
    }
}

/// The roll-outs of the paper's models on B_hrd.
pub(super) fn rollouts(analysis: &Analysis) -> Figure {
    let lines = ModelName::PAPERS.map(|model| Line::of(model, "hrd"));
    figure("rollouts", &rollout_charts(analysis, &lines), 250.0)
}

/// The roll-outs of models with more inputs than the paper's. Returns `None` if there are fewer than two.
pub(super) fn beyond(analysis: &Analysis) -> Option<Figure> {
    let lines = BEYOND.map(|Beyond { model, features, words, look }| {
        let mut line = Line::of(model, features);
        if features == HISTORY_SET {
            line.name = words;
        }
        if let Some((colour, mark)) = look {
            line.pen = Pen::new(colours::SERIES[colour], 2.0).dashed(9.0, 4.0);
            line.mark = Some(mark);
        }
        line
    });
    let found = lines.iter().filter(|line| line.horizons(&analysis.rollouts).is_some()).count();
    (found > 1).then(|| figure("beyond", &rollout_charts(analysis, &lines), 250.0))
}

/// Accuracy, position error and log loss against the horizon, for these lines and the simple drivers.
fn rollout_charts(analysis: &Analysis, lines: &[Line]) -> [Chart; 3] {
    let simple = [
        Line::simple(Simple::Held, "holds the last input", 6.0),
        Line::simple(Simple::Straight, "drives straight on", 2.0),
    ];
    let all = lines.iter().copied().chain(simple);
    let curves: Vec<(Line, &[Horizon])> =
        all.filter_map(|line| Some((line, line.horizons(&analysis.rollouts)?))).collect();
    let step_s = analysis.data.scene.step_s;
    let chart = |heading, axis, value| rollout_chart(&curves, step_s, heading, axis, value);
    [
        chart("Accuracy", ["accuracy", "%"], &|of| 100.0 * of.accuracy()),
        chart("Distance from the person", ["distance", "m"], &Horizon::mean_distance_m),
        chart("Log loss along the path", ["log loss", "nats"], &Horizon::mean_log_loss),
    ]
}

fn rollout_chart(
    curves: &[(Line, &[Horizon])],
    step_s: f64,
    heading: &str,
    [name, unit]: [&str; 2],
    value: &dyn Fn(&Horizon) -> f64,
) -> Chart {
    let all = curves.iter().flat_map(|(_, horizons)| *horizons).map(value);
    let [_, high] = range(all.clone());
    let low = if unit == "%" { all.fold(high, f64::min) } else { 0.0 };
    let steps = curves.iter().map(|(_, horizons)| horizons.len()).max().unwrap_or(1);
    let end_s = step_s * steps as f64;
    let last = curves.iter().filter_map(|(line, of)| Some((line.name, value(of.last()?))));
    let last = last.map(|(name, value)| format!("{name} {value:.2}")).collect::<Vec<_>>();
    let description = format!("{name} ({unit}) {end_s:.1} s ahead: {}.", last.join(", "));
    let x = Axis::time("time ahead", [0.0, end_s], 5);
    let y = Axis::round(name, unit, [low, high], 5);
    let mut chart = Chart::new(heading, &description, x, y);
    for (line, horizons) in curves {
        let point = |(i, h): (usize, &Horizon)| [step_s * (i + 1) as f64, value(h)];
        let points = horizons.iter().enumerate().map(point);
        let series = Series::drawn(line.name, points, line.pen);
        let says = |[s, value]: [f64; 2]| format!("{}, {s:.1} s: {value:.2}", line.name);
        chart.add(match line.mark {
            Some(mark) => series.marked(mark).saying(says),
            None => series,
        });
    }
    chart
}
