//! A dot for each person on each feature set.

use super::super::chart::{Anchor, Axis, Chart, Margins, figure, legend};
use super::super::words;
use super::gains::{dot_radius, spread};
use super::mark;
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::{Experiment, ModelName};
use sidestep::comparison::tables::Metric;

const HEIGHT: f64 = 220.0;

/// A column of a chart: the name of its feature set, a number each person, and their mean.
struct Column<'a> {
    set: &'a str,
    people: Vec<f64>,
    mean: f64,
}

/// Accuracy of each model in both experiments.
pub(in super::super) fn accuracies(analysis: &Analysis) -> String {
    let sets = analysis.comparison.sets();
    let mut plots = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let means = analysis.comparison.accuracies(model, experiment, &sets);
            let column = |(&set, mean)| {
                let people = analysis.comparison.person_accuracies(model, experiment, set);
                Column { set, people, mean }
            };
            let columns = sets.iter().zip(means).map(column).collect();
            let heading = format!(
                "{} {}: {}",
                words::model(model),
                experiment.numeral(),
                words::question(experiment)
            );
            plots.push(Plot {
                model,
                heading,
                columns,
                baseline: Some(analysis.baseline_accuracy(experiment)),
            });
        }
    }
    let caption = "<b>Accuracy for each feature set.</b> Share of the test steps that are \
                   predicted right. Each dot is a person’s own model, a person always at the same \
                   place in a column; bars are means over people. “body” adds the robot’s position \
                   in the human’s body frame.";
    let base = (
        "<line class=\"baseline\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>",
        "always the person’s commonest input (mean)",
    );
    drawn(&plots, "accuracy (%)", &[base], caption)
}

/// D_start and D_end of each model.
pub(in super::super) fn distances(analysis: &Analysis) -> String {
    let sets = analysis.comparison.sets();
    let mut plots = Vec::new();
    for (metric, word) in [(Metric::Start, "first"), (Metric::End, "last")] {
        for model in ModelName::PAPERS {
            let column = |&set| {
                let people =
                    analysis.comparison.person_metric(metric, model, Experiment::Avoidance, set);
                Column {
                    set,
                    mean: analysis.comparison.person_mean(
                        metric,
                        model,
                        Experiment::Avoidance,
                        set,
                    ),
                    people,
                }
            };
            let columns = sets.iter().map(column).collect();
            let heading = format!("{}: {word} step of avoidance", words::model(model));
            plots.push(Plot { model, heading, columns, baseline: None });
        }
    }
    let caption = format!(
        "<b>When avoidance begins and ends.</b> How far the model’s first (<i>D</i><sub>start</sub>) \
         and last step (<i>D</i><sub>end</sub>) of avoidance is from the human’s: a dot is the mean \
         over a person’s test trials, penalised (no avoidance counts as one past the last step, or \
         as step −1). A step is {} s. Less is better.",
        analysis.data.scene.step_s
    );
    drawn(&plots, "distance (steps)", &[], &caption)
}

struct Plot<'a> {
    model: ModelName,
    heading: String,
    columns: Vec<Column<'a>>,
    baseline: Option<f64>,
}

fn drawn(plots: &[Plot<'_>], unit: &str, more: &[(&str, &str)], caption: &str) -> String {
    let all = || {
        let numbers = plots.iter().flat_map(|plot| plot.columns.iter().flat_map(|of| &of.people));
        numbers.copied().chain(plots.iter().filter_map(|plot| plot.baseline))
    };
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let from = if plots.iter().any(|plot| plot.baseline.is_some()) { low.min(high) } else { 0.0 };
    let axis = Axis::round(from, high, 5, unit);
    let charts: Vec<String> = plots.iter().map(|plot| chart(plot, axis.clone())).collect();
    let mut items = vec![
        ("<circle class=\"dot\" cx=\"13\" cy=\"6\" r=\"3\"/>", "a person"),
        ("<line class=\"mean\" x1=\"3\" y1=\"6\" x2=\"23\" y2=\"6\"/>", "mean over people"),
    ];
    items.extend(more);
    figure(&charts, &legend(&items), caption)
}

fn chart(plot: &Plot<'_>, y: Axis) -> String {
    let count = plot.columns.len().max(1) as f64;
    let x = Axis::exact(0.0, count, vec![], "");
    let said: Vec<String> =
        plot.columns.iter().map(|of| format!("{} {:.1}", of.set, of.mean)).collect();
    let description = format!("Means over people by feature set: {}.", said.join(", "));
    let margins = Margins([46.0, 26.0, 4.0, 36.0]);
    let mut chart = Chart::new(&plot.heading, &description, HEIGHT, margins, (x, y));
    let [left, _, right, bottom] = chart.edges();
    if let Some(baseline) = plot.baseline {
        let level = chart.y(baseline);
        chart.segment("baseline", [left, level], [right, level]);
    }
    let class = plot.model.word();
    for (i, Column { set, people, mean }) in plot.columns.iter().enumerate() {
        let middle = chart.x(i as f64 + 0.5);
        let (letters, body) = words::parts(set);
        chart.text("category", [middle, bottom + 14.0], Anchor::Middle, letters);
        if body {
            chart.text("category", [middle, bottom + 27.0], Anchor::Middle, "body");
        }
        let width = 0.5 * (right - left) / count;
        for (person, number) in people.iter().enumerate() {
            let at = [middle + 0.62 * width * spread(person, people.len()), chart.y(*number)];
            let says = format!("{number:.1}");
            chart.mark(
                &format!("dot {class}"),
                mark(plot.model),
                at,
                dot_radius(people.len()),
                &says,
            );
        }
        if !people.is_empty() {
            let level = chart.y(*mean);
            chart.segment("mean", [middle - 0.8 * width, level], [middle + 0.8 * width, level]);
        }
    }
    chart.finished()
}
