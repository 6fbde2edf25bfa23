//! How predictions fare that are fed with what they said.

use super::super::chart::{Axis, Chart, Margins, Mark, figure, legend};
use super::super::words;
use super::{mark, sign};
use sidestep::comparison::Analysis;
use sidestep::comparison::RolloutsOf;
use sidestep::comparison::cell::{HISTORY_SET, ModelName};
use sidestep::comparison::rollout::Horizon;

const HEIGHT: f64 = 240.0;

/// A curve: its class, mark and name, and its roll-outs.
struct Curve<'a> {
    class: &'static str,
    mark: Option<Mark>,
    name: &'static str,
    horizons: &'a [Horizon],
}

const HELD: &str = "<line class=\"curve held\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>";
const STRAIGHT: &str = "<line class=\"curve straight\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>";
const BOOSTED: &str = "<line class=\"curve boosted\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>\
                       <rect class=\"mark boosted\" x=\"9.5\" y=\"2.5\" width=\"7\" height=\"7\"/>";
const MEMORY: &str = "<line class=\"curve memory\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>\
                      <circle class=\"mark memory\" cx=\"13\" cy=\"6\" r=\"4\"/>";

/// What a curve is of: driver, feature set, class, mark and name.
type Line = (&'static str, &'static str, &'static str, Option<Mark>, &'static str);

/// Who does not think.
const SIMPLE: [Line; 2] = [
    ("held_input", "", "held", None, "held input"),
    ("straight", "", "straight", None, "straight on"),
];

/// Who knows more than the paper's models.
const BEYOND: [Line; 4] = [
    ("svm", "hrd_body", "svm", Some(Mark::Circle), "SVM"),
    ("boosted", "hrd_body", "boosted", Some(Mark::Square), "boosted trees"),
    ("lr", HISTORY_SET, "lr", Some(Mark::Triangle), "LR with memory"),
    ("boosted", HISTORY_SET, "memory", Some(Mark::Circle), "boosted trees with memory"),
];

/// Against the horizon: accuracy, position error and log loss; of the paper's models on B_hrd, and
/// of those that know more.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let papers = ModelName::PAPERS
        .map(|model| (model.word(), "hrd", model.word(), Some(mark(model)), words::model(model)));
    let simple = [(HELD, "holds the last input"), (STRAIGHT, "drives straight on")];
    let names = ModelName::PAPERS.map(|model| (sign(model), words::model(model)));
    let items: Vec<(&str, &str)> = names.into_iter().chain(simple).collect();
    let caption = format!(
        "<b>Roll-outs</b> of the paper’s models on {}, from every step of the test trials: each \
         predicted input moves the human, and the next prediction is made from there. Less is \
         better for distance and log loss. Windows overlap and are pooled over people, so that no \
         test is made of them.",
        words::set("hrd")
    );
    let first = figure(&charts(analysis, &papers), &legend(&items), &caption);
    let found = |line: &&Line| curve(&analysis.rollouts, line).is_some();
    if BEYOND.iter().filter(found).count() < 2 {
        return first;
    }
    let items = [
        (sign(ModelName::Svm), "SVM"),
        (BOOSTED, "boosted trees"),
        (sign(ModelName::Lr), "LR with memory"),
        (MEMORY, "boosted trees with memory"),
        simple[0],
        simple[1],
    ];
    let caption = format!(
        "<b>Roll-outs beyond the paper</b>: on {}, and with a memory of the inputs held so far. \
         Boosted trees: gradient-boosted decision trees.",
        words::set("hrd_body")
    );
    first + &figure(&charts(analysis, &BEYOND), &legend(&items), &caption)
}

/// Of these and of the simple drivers.
fn charts(analysis: &Analysis, lines: &[Line]) -> [String; 3] {
    let all = lines.iter().chain(&SIMPLE);
    let curves: Vec<Curve<'_>> = all.filter_map(|line| curve(&analysis.rollouts, line)).collect();
    let step_s = analysis.data.scene.step_s;
    [
        chart(&curves, step_s, "Accuracy", "accuracy (%)", |h| 100.0 * h.accuracy()),
        chart(
            &curves,
            step_s,
            "Distance from the person",
            "distance (m)",
            Horizon::mean_distance_m,
        ),
        chart(&curves, step_s, "Log loss", "log loss (nats)", Horizon::mean_log_loss),
    ]
}

fn curve<'a>(
    all: &'a [RolloutsOf],
    &(driver, features, class, mark, name): &Line,
) -> Option<Curve<'a>> {
    let of = all.iter().find(|of| of.driver == driver && of.features == features)?;
    Some(Curve { class, mark, name, horizons: &of.horizons })
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
