//! A dot for each person on each feature set.

use super::super::words;
use super::{figure, look, reference};
use sidestep::chart::{Axis, Chart, Group, Swarm, fixed};
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
                   place in a column; bars are means over people. Dashed: always the \
                   person’s most frequent input (mean). “body” adds the robot’s position \
                   in the human’s body frame.";
    drawn(&plots, ["accuracy", "%"], caption)
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
    drawn(&plots, ["distance", "steps"], &caption)
}

struct Plot<'a> {
    model: ModelName,
    heading: String,
    columns: Vec<Column<'a>>,
    baseline: Option<f64>,
}

fn drawn(plots: &[Plot<'_>], [name, unit]: [&str; 2], caption: &str) -> String {
    let all = || {
        let numbers = plots.iter().flat_map(|plot| plot.columns.iter().flat_map(|of| &of.people));
        numbers.copied().chain(plots.iter().filter_map(|plot| plot.baseline))
    };
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let from = if plots.iter().any(|plot| plot.baseline.is_some()) { low.min(high) } else { 0.0 };
    let axis = Axis::round(name, unit, [from, high], 5);
    let charts: Vec<Chart> = plots.iter().map(|plot| chart(plot, axis.clone())).collect();
    figure(&charts, HEIGHT, caption)
}

fn chart(plot: &Plot<'_>, y: Axis) -> Chart {
    let said: Vec<String> =
        plot.columns.iter().map(|of| format!("{} {}", of.set, fixed(of.mean, 1))).collect();
    let description = format!("Means over people by feature set: {}.", said.join(", "));
    let sets = plot.columns.iter().map(|Column { set, .. }| {
        let (letters, body) = words::parts(set);
        if body { format!("{letters}\nbody") } else { letters.to_owned() }
    });
    let mut chart = Chart::new(&plot.heading, &description, Axis::categories("", sets), y);
    if let Some(baseline) = plot.baseline {
        let ends = chart.x.ends.map(|x| [x, baseline]);
        chart.add(reference("", ends));
    }
    let (colour, mark) = look(plot.model);
    let group =
        |of: &Column<'_>| Group { values: of.people.clone(), mean: of.mean, interval: None };
    chart.add(Swarm {
        name: "a person".to_owned(),
        groups: plot.columns.iter().map(group).collect(),
        mark,
        ink: colour.at(0.55),
        intervals: false,
        places: 1,
    });
    chart
}
