//! Charts of learning curves, of models trained on other people, and of the loss when a model lacks a
//! feature.

use super::{Figure, figure, look, question, range, reference};
use sidestep::chart::{Axis, Chart, Group, Mark, Pen, Series, Swarm, colours};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Experiment;
use sidestep::comparison::generalisation::{LearningPoint, Unseen};
use sidestep::comparison::importance::Importance;
use sidestep::comparison::models::{CURVE_MODELS, ModelName};

/// Accuracy against the number of training tasks. Returns `None` if every person has too few tasks.
pub(super) fn learning(analysis: &Analysis) -> Option<Figure> {
    let charts = Experiment::ALL.map(|experiment| learning_chart(analysis, experiment));
    (!analysis.learning.is_empty()).then(|| figure("learning", &charts, 300.0))
}

fn learning_chart(analysis: &Analysis, experiment: Experiment) -> Chart {
    let of_experiment = || analysis.learning.iter().filter(|of| of.experiment == experiment);
    let baseline = analysis.baseline_accuracy(experiment);
    let numbers = of_experiment().map(|of| of.accuracy).chain([baseline]);
    let [_, high] = range(numbers.clone());
    let low = numbers.fold(high, f64::min);
    let most = of_experiment().map(|of| of.tasks).fold(0.0, f64::max);
    let x = Axis::linear("tasks that train", "", [0.0, most], 6);
    let y = Axis::round("accuracy", "%", [low, high], 5);
    let mut chart = Chart::new(&question(experiment), "", x, y);
    chart.add(reference([[0.0, baseline], [most, baseline]]));
    let mut described = Vec::new();
    for (model, set) in curves() {
        let is = |of: &&LearningPoint| of.model == model && of.features == set;
        let points: Vec<&LearningPoint> = of_experiment().filter(is).collect();
        let (colour, mark) = look(model);
        let name = format!("{} on {set}", model.row().short);
        let pen = Pen::new(colour, 2.0);
        let pen = if set == "hrd" { pen } else { pen.dashed(5.0, 3.0) };
        let at = points.iter().map(|of| [of.tasks, of.accuracy]);
        let says = |[tasks, accuracy]: [f64; 2]| format!("{name}, {tasks} tasks: {accuracy:.1} %");
        let list = points.iter().map(|of| format!("{} tasks {:.1}", of.tasks, of.accuracy));
        described.push(format!("{name}: {}", list.collect::<Vec<_>>().join(", ")));
        chart.add(Series::drawn(&name, at, pen).marked(mark).saying(says));
    }
    chart.description = format!("Mean accuracy in per cent. {}.", described.join("; "));
    chart
}

/// The curves that are drawn: a solid line for hrd, and a dashed line for d.
fn curves() -> impl Iterator<Item = (ModelName, &'static str)> {
    CURVE_MODELS.into_iter().flat_map(|model| ["hrd", "d"].map(|set| (model, set)))
}

/// The gain of a person's own model over a model that was trained on other people.
pub(super) fn unseen(analysis: &Analysis) -> Option<Figure> {
    let all: Vec<&Unseen> = analysis.unseen.iter().collect();
    let gains = || all.iter().flat_map(|of| of.own.paired.gains.iter().copied());
    gains().next()?;
    let chart = |experiment: Experiment| {
        let of: Vec<&&Unseen> = all.iter().filter(|of| of.own.experiment == experiment).collect();
        let name = |of: &&&Unseen| format!("{} {}", of.own.model.row().short, of.features);
        let mean = |of: &&&Unseen| format!("{}: {:+.1}", name(of), of.own.paired.mean);
        let means = of.iter().map(mean).collect::<Vec<_>>().join("; ");
        let x = Axis::round("own − others’", "points of accuracy", range(gains()), 6);
        let y = Axis::categories("", of.iter().map(name)).downwards();
        let heading = question(experiment);
        let mut chart = Chart::new(&heading, &format!("Mean gain in points. {means}."), x, y);
        let zero = chart.y.ends.map(|y| [0.0, y]);
        chart.add(Series::line("", zero, colours::MUTED, 1.0));
        let group = |of: &&&Unseen| Group {
            values: of.own.paired.gains.clone(),
            centre: of.own.paired.typical,
            interval: of.own.paired.interval,
        };
        chart.add(Swarm {
            name: "a person".to_owned(),
            groups: of.iter().map(group).collect(),
            mark: Mark::Circle,
            ink: colours::MUTED.at(0.55),
            centre: "typical gain",
            interval: Some("95 % interval"),
            places: 1,
        });
        chart
    };
    Some(figure("unseen", &Experiment::ALL.map(chart), 250.0))
}

/// The accuracy that each of the paper's models loses without each feature, for two feature sets in
/// both experiments.
pub(super) fn importance(analysis: &Analysis) -> Option<Figure> {
    let losses = || analysis.importance.iter().flat_map(|of| of.losses.iter().copied());
    losses().next()?;
    let mut charts = Vec::new();
    for set in ["hrd", "hrd_body"] {
        for experiment in Experiment::ALL {
            for model in ModelName::PAPERS {
                let is = |of: &&Importance| {
                    (of.model, of.experiment, &of.features[..]) == (model, experiment, set)
                };
                let of: Vec<&Importance> = analysis.importance.iter().filter(is).collect();
                let heading = format!("{} {} on {set}", model.row().short, experiment.numeral());
                charts.push(importance_chart(&heading, model, &of, range(losses())));
            }
        }
    }
    Some(figure("importance", &charts, 300.0))
}

fn importance_chart(heading: &str, model: ModelName, of: &[&Importance], range: [f64; 2]) -> Chart {
    let name = |of: &Importance| match of.permuted.contains('+') {
        true => "heading (3)".to_owned(),
        false => of.permuted.clone(),
    };
    let means: Vec<String> = of.iter().map(|of| format!("{}: {:.1}", name(of), of.mean)).collect();
    let x = Axis::round("loss", "points of accuracy", range, 6);
    let y = Axis::categories("", of.iter().map(|of| name(of))).downwards();
    let mut chart =
        Chart::new(heading, &format!("Mean loss in points. {}.", means.join("; ")), x, y);
    let zero = chart.y.ends.map(|y| [0.0, y]);
    chart.add(Series::line("", zero, colours::MUTED, 1.0));
    let (colour, mark) = look(model);
    let group =
        |of: &&Importance| Group { values: of.losses.clone(), centre: of.mean, interval: None };
    chart.add(Swarm {
        name: "a person".to_owned(),
        groups: of.iter().map(group).collect(),
        mark,
        ink: colour.at(0.55),
        centre: "mean",
        interval: None,
        places: 1,
    });
    chart
}
