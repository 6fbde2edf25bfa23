//! How predictions fare that are fed with what they said.

use super::super::chart::{Axis, Chart, Margins, Mark, figure, legend};
use super::super::words;
use super::{mark, sign};
use crate::analysis::Analysis;
use sidestep::comparison::RolloutsOf;
use sidestep::comparison::cell::ModelName;
use sidestep::comparison::rollout::{Horizon, Simple};

const HEIGHT: f64 = 240.0;

/// A curve: its class, mark and name, and its roll-outs.
struct Curve<'a> {
    class: &'static str,
    mark: Option<Mark>,
    name: String,
    horizons: &'a [Horizon],
}

/// Against the horizon: accuracy, log loss and position error, on B_hrd.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let curves = curves(&analysis.rollouts);
    let step_s = analysis.context.step_s;
    let accuracy = chart(&curves, step_s, "Accuracy", "accuracy (%)", |h| 100.0 * h.accuracy());
    let distance = chart(
        &curves,
        step_s,
        "Distance from where the human was",
        "distance (m)",
        Horizon::mean_distance_m,
    );
    let loss = chart(&curves, step_s, "Log loss", "log loss (nats)", Horizon::mean_log_loss);
    let held = "<line class=\"curve held\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>";
    let straight = "<line class=\"curve straight\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>";
    let names = ModelName::PAPERS.map(|model| (sign(model), words::model(model)));
    let baselines = [(held, "holds the last input"), (straight, "drives straight on")];
    let items: Vec<(&str, &str)> = names.into_iter().chain(baselines).collect();
    let caption = format!(
        "<b>Roll-outs</b> of models on {}, from every step of the test trials: each predicted input \
         moves the human, and the next prediction is made from there. Less is better for distance \
         and log loss. Windows overlap and are pooled over people, so that no test is made of them.",
        words::set("hrd")
    );
    figure(&[accuracy, distance, loss], &legend(&items), &caption)
}

/// Of the paper's models on B_hrd, and of the simple drivers.
fn curves(all: &[RolloutsOf]) -> Vec<Curve<'_>> {
    let find = |driver: &str, features: &str| {
        all.iter().find(|of| of.driver == driver && of.features == features)
    };
    let models = ModelName::PAPERS.into_iter().filter_map(|model| {
        let horizons = &find(model.word(), "hrd")?.horizons;
        let (class, name) = (model.word(), words::model(model).to_owned());
        Some(Curve { class, mark: Some(mark(model)), name, horizons })
    });
    let simple =
        [(Simple::Held, "held", "held input"), (Simple::Straight, "straight", "straight on")];
    let simple = simple.into_iter().filter_map(|(driver, class, name)| {
        let horizons = &find(driver.word(), "")?.horizons;
        Some(Curve { class, mark: None, name: name.to_owned(), horizons })
    });
    models.chain(simple).collect()
}

fn chart(
    curves: &[Curve<'_>],
    step_s: f64,
    heading: &str,
    unit: &str,
    value: fn(&Horizon) -> f64,
) -> String {
    let all = || curves.iter().flat_map(|curve| curve.horizons).map(value);
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    // Shares are told apart from where they are; a distance from nothing.
    let low = if unit.contains('%') { low.min(high) } else { 0.0 };
    let steps = curves.iter().map(|curve| curve.horizons.len()).max().unwrap_or(1);
    let x = Axis::round(0.0, step_s * steps as f64, 5, "time ahead (s)");
    let said = curves
        .iter()
        .filter_map(|curve| Some(format!("{} {:.2}", curve.name, value(curve.horizons.last()?))));
    let description = format!(
        "{unit} {:.1} s ahead: {}.",
        step_s * steps as f64,
        said.collect::<Vec<_>>().join(", ")
    );
    let margins = Margins([46.0, 26.0, 12.0, 40.0]);
    let axes = (x, Axis::round(low, high, 5, unit));
    let mut chart = Chart::new(heading, &description, HEIGHT, margins, axes);
    for curve in curves {
        let point = |(i, h): (usize, &Horizon)| [step_s * (i + 1) as f64, value(h)];
        let points: Vec<[f64; 2]> = curve.horizons.iter().enumerate().map(point).collect();
        let line: Vec<[f64; 2]> = points.iter().map(|point| chart.at(*point)).collect();
        chart.line(&format!("curve {}", curve.class), &line);
        for ([seconds, value], at) in points.iter().zip(&line) {
            if let Some(mark) = curve.mark {
                let says = format!("{}, {seconds:.1} s: {value:.2}", curve.name);
                chart.mark(&format!("mark {}", curve.class), mark, *at, 3.2, &says);
            }
        }
    }
    chart.finished()
}
