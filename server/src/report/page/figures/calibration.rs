//! How often a model is right when it says how sure it is.

use super::super::chart::{Axis, Chart, Margins, figure, legend};
use super::super::words;
use super::{mark, sign};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::{Experiment, ModelName};

const HEIGHT: f64 = 300.0;
const SET: &str = "hrd";

/// Calibration curves of the models on B_hrd.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let charts: Vec<String> =
        Experiment::ALL.into_iter().map(|experiment| chart(analysis, experiment)).collect();
    let names = ModelName::PAPERS.map(|model| (sign(model), words::model(model)));
    let perfect =
        ("<line class=\"perfect\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>", "as sure as right");
    let items: Vec<(&str, &str)> = names.into_iter().chain([perfect]).collect();
    let caption = format!(
        "<b>Calibration</b> on {}. Test steps of all people, by the probability that the model \
         gives to its likeliest class, in bins of 0.1; larger marks stand for more steps. Below the \
         diagonal a model is too sure of itself. Bins of fewer than 20 steps are left out.",
        words::set(SET)
    );
    figure(&charts, &legend(&items), &caption)
}

/// Bins with fewer rows say nothing.
const LEAST_ROWS: usize = 20;

fn chart(analysis: &Analysis, experiment: Experiment) -> String {
    let least = 1.0 / experiment.classes().len() as f64;
    let from = (10.0 * least).floor() / 10.0;
    let ticks: Vec<f64> = (0..=10).map(|i| f64::from(i) / 10.0).filter(|t| *t >= from).collect();
    let levels = vec![0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
    let x = Axis::exact(from, 1.0, ticks, "probability of the likeliest class");
    let y = Axis::exact(0.0, 1.0, levels, "share that was right");
    let curves = ModelName::PAPERS.map(|model| {
        let all = analysis.pooled(Some(model), experiment, SET);
        let total = all.map_or(1, |of| of.calibration.rows).max(1) as f64;
        let kept = all.into_iter().flat_map(|of| of.bins).filter(|bin| bin.rows >= LEAST_ROWS);
        let point = kept.map(|bin| {
            let n = bin.rows as f64;
            ([bin.confidence / n, bin.right as f64 / n], n / total, bin.rows)
        });
        (model, point.collect::<Vec<_>>())
    });
    let said = curves.iter().map(|(model, points)| {
        let said = points.iter().map(|([p, right], ..)| format!("{p:.2} {right:.2}"));
        format!("{}: {}", words::model(*model), said.collect::<Vec<_>>().join(", "))
    });
    let description =
        format!("Mean probability and share right. {}.", said.collect::<Vec<_>>().join("; "));
    let heading = format!("{}: {}", experiment.numeral(), words::question(experiment));
    let margins = Margins([46.0, 26.0, 12.0, 40.0]);
    let mut chart = Chart::new(&heading, &description, HEIGHT, margins, (x, y));
    let ends = [[from, from], [1.0, 1.0]].map(|point| chart.at(point));
    chart.segment("perfect", ends[0], ends[1]);
    for (model, points) in &curves {
        let line: Vec<_> = points.iter().map(|(point, ..)| chart.at(*point)).collect();
        chart.line(&format!("curve {}", model.word()), &line);
    }
    for (model, points) in &curves {
        for (point, share, rows) in points {
            let says = format!("{rows} steps: {:.2} said, {:.2} right", point[0], point[1]);
            let (at, r) = (chart.at(*point), 2.2 + 7.0 * share.sqrt());
            chart.mark(&format!("mark {}", model.word()), mark(*model), at, r, &says);
        }
    }
    chart.finished()
}
