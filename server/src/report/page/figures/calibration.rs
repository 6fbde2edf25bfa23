//! How often a model is right when it says how sure it is.

use super::super::words;
use super::{figure, look, reference};
use sidestep::chart::{Axis, Chart, Datum, Series};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::{Experiment, ModelName};

const HEIGHT: f64 = 300.0;
const SET: &str = "hrd";

/// Calibration curves of the models on B_hrd.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let charts: Vec<Chart> =
        Experiment::ALL.into_iter().map(|experiment| chart(analysis, experiment)).collect();
    let caption = format!(
        "<b>Calibration</b> on {}. Test steps of all people, by the probability that the model \
         gives to its likeliest class, in bins of 0.1; larger marks stand for more steps. Below the \
         dashed diagonal a model is too sure of itself. Bins of fewer than 20 steps are left out.",
        words::set(SET)
    );
    figure(&charts, HEIGHT, &caption)
}

/// Bins with fewer rows say nothing.
const LEAST_ROWS: usize = 20;

fn chart(analysis: &Analysis, experiment: Experiment) -> Chart {
    let least = 1.0 / experiment.classes().len() as f64;
    let from = (10.0 * least).floor() / 10.0;
    let x = Axis::linear("probability of the likeliest class", "", [from, 1.0], 8);
    let y = Axis::linear("share that was right", "", [0.0, 1.0], 5);
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
    let mut chart = Chart::new(&heading, &description, x, y);
    chart.add(reference("", [[from, from], [1.0, 1.0]]));
    for (model, points) in &curves {
        let (colour, mark) = look(*model);
        let at = points.iter().map(|(point, ..)| *point);
        let mut series = Series::line(words::model(*model), at, colour, 2.0).marked(mark);
        let datum = |&(at, share, rows): &([f64; 2], f64, usize)| Datum {
            at,
            radius: 2.2 + 7.0 * share.sqrt(),
            says: format!("{rows} steps: {:.2} said, {:.2} right", at[0], at[1]),
        };
        series.points = points.iter().map(datum).collect();
        chart.add(series);
    }
    chart
}
