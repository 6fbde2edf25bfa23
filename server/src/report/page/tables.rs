//! The tables of the report.

use super::html::{details, escaped, fixed, p_value, signed, table};
use super::{published, words};
use sidestep::comparison::Analysis;
use sidestep::comparison::avoidance::Distances;
use sidestep::comparison::cell::{BODY_FRAME_SETS, Experiment, ModelName, PAPERS_SETS};
use sidestep::comparison::differences::Test;
use sidestep::comparison::gains::{LEVEL, Power};
use sidestep::comparison::tables::{Metric, are_best};
use sidestep::recording::Exclusion;

/// In place of p-values that could not be below 0.05.
const NO_TEST: &str =
    "With fewer than six people the paired test cannot give p &lt; 0.05: no p-value.";

fn headed(first: &str, more: &[&str]) -> Vec<String> {
    let sets = PAPERS_SETS.iter().map(|set| words::set(set));
    let more = more.iter().map(|name| (*name).to_owned());
    std::iter::once(first.to_owned()).chain(sets).chain(more).collect()
}

/// Numbers of the paper's seven sets, the best of them bold.
fn bold(numbers: &[Option<f64>], less_is_better: bool, places: usize) -> Vec<String> {
    let entry = |(number, best): (&Option<f64>, bool)| match number {
        Some(number) if best => format!("<strong>{}</strong>", fixed(*number, places)),
        Some(number) => fixed(*number, places),
        None => "–".to_owned(),
    };
    numbers.iter().zip(are_best(numbers, less_is_better)).map(entry).collect()
}

fn papers_row(numbers: Option<[f64; 7]>, less_is_better: bool) -> Vec<String> {
    let numbers = numbers.map_or_else(Vec::new, |numbers| numbers.map(Some).to_vec());
    bold(&numbers, less_is_better, 2)
        .into_iter()
        .map(|entry| format!("<span class=\"paper\">{entry}</span>"))
        .collect()
}

/// Table I, with the baseline and the body frame.
pub(super) fn accuracy(analysis: &Analysis) -> String {
    let mut rows = Vec::new();
    for experiment in Experiment::ALL {
        let baseline = analysis.baseline_accuracy(experiment);
        for model in ModelName::PAPERS {
            let numeral = experiment.numeral();
            let name = format!("{} ({numeral})", words::model(model));
            let numbers = analysis.comparison.accuracies(model, experiment, &PAPERS_SETS);
            let numbers: Vec<Option<f64>> = numbers.into_iter().map(Some).collect();
            let body: Vec<&str> = BODY_FRAME_SETS.iter().map(|(set, _)| *set).collect();
            let beside = analysis.comparison.accuracies(model, experiment, &body);
            let beside = beside.into_iter().chain([baseline]).map(|number| fixed(number, 2));
            let ours = std::iter::once(name).chain(bold(&numbers, false, 2)).chain(beside);
            rows.push(ours.collect());
            let theirs = papers_row(published::accuracies(model, experiment), false);
            let name = "<span class=\"paper\">the paper</span>".to_owned();
            rows.push(std::iter::once(name).chain(theirs).chain(vec![String::new(); 3]).collect());
        }
    }
    let body = BODY_FRAME_SETS.map(|(set, _)| words::set(set));
    let columns = headed("", &[&body[0], &body[1], "commonest input"]);
    let caption = "<b>Table I.</b> Accuracy on the test trials, mean over people, per cent. \
                   <b>Bold</b>: the best of the paper’s seven sets in its row.";
    table(caption, "numbers pairs", &columns, &rows)
}

/// Table II in both forms.
pub(super) fn distances(analysis: &Analysis) -> String {
    let mut rows = Vec::new();
    for (metric, symbol) in [(Metric::Start, "start"), (Metric::End, "end")] {
        for model in ModelName::PAPERS {
            let found = PAPERS_SETS.map(|set| analysis.comparison.distances(model, set));
            let symbol = format!("<i>D</i><sub>{symbol}</sub>");
            let form = |of: fn(&Distances, Metric) -> Option<f64>| -> Vec<Option<f64>> {
                found.iter().map(|distances| of(distances, metric)).collect()
            };
            let mut row = |name: String, entries: Vec<String>| {
                rows.push(std::iter::once(name).chain(entries).collect());
            };
            row(
                format!("{}, {symbol}, penalised", words::model(model)),
                bold(&form(penalised), true, 2),
            );
            let both = bold(&form(both_avoid), true, 2);
            let with_n = both
                .into_iter()
                .zip(&found)
                .map(|(entry, distances)| format!("{entry}<small>n = {}</small>", distances.both));
            row(format!("{}, {symbol}, both avoid", words::model(model)), with_n.collect());
            let theirs = papers_row(published::distances(model, metric), true);
            row("<span class=\"paper\">the paper</span>".to_owned(), theirs);
        }
    }
    let trials = analysis.comparison.distances(ModelName::Svm, "hrd").trajectories;
    let caption = format!(
        "<b>Table II.</b> Distance of the model’s first and last step of avoidance from the \
         human’s, mean over {trials} test trials, steps of {} s. <i>Penalised</i>: no avoidance \
         counts as one past the last step, or as step −1. <i>Both avoid</i>: only the n trials in \
         which human and model avoid; a model that seldom avoids looks good there. The paper does \
         not say which it used. <b>Bold</b>: best of the row; with different n a best of “both \
         avoid” means little.",
        analysis.data.scene.step_s
    );
    table(&caption, "numbers triples", &headed("", &[]), &rows)
}

/// Of one form.
pub(in crate::report) fn penalised(of: &Distances, metric: Metric) -> Option<f64> {
    Some(if metric == Metric::End { of.end_penalised } else { of.start_penalised })
}

/// Of the other.
pub(in crate::report) fn both_avoid(of: &Distances, metric: Metric) -> Option<f64> {
    if metric == Metric::End { of.end_both } else { of.start_both }
}

/// Whether participants are too few for any paired test to show anything.
pub(super) fn too_few(analysis: &Analysis) -> bool {
    Power::of(analysis.comparison.participants.len(), 1).is_too_low()
}

/// What a body frame explains.
pub(super) fn ablation(analysis: &Analysis) -> String {
    let few = too_few(analysis);
    let rows = analysis.ablation.iter().map(|row| {
        let (name, set) = match row.model {
            Some(model) => (words::model(model).to_owned(), words::set(&row.features)),
            None => ("commonest input".to_owned(), "–".to_owned()),
        };
        let none = || "–".to_owned();
        vec![
            format!("{name} ({})", row.experiment.numeral()),
            set,
            fixed(row.accuracy, 2),
            fixed(row.log_loss, 3),
            row.over_d.map_or_else(none, |(gain, _)| signed(gain, 2)),
            row.over_d.filter(|_| !few).map_or_else(none, |(_, p)| p_value(p)),
        ]
    });
    let columns = [
        "model",
        "features",
        "accuracy (%)",
        "log loss (nats)",
        "gain over <i>B</i><sub>d</sub> (points)",
        "paired Wilcoxon p",
    ];
    let p_values = if few { NO_TEST } else { "p-values are of one test each, without correction." };
    let caption = format!(
        "<b>Ablation.</b> The baseline, and the same models with and without safety levels and the \
         robot’s position in the human’s body frame. {p_values}"
    );
    table(&caption, "numbers", &columns.map(str::to_owned), &rows.collect::<Vec<_>>())
}

/// Every test, a table each metric.
pub(super) fn tests(analysis: &Analysis) -> String {
    let few = too_few(analysis);
    let metrics = [
        (Metric::Accuracy, "Accuracy", "points"),
        (Metric::Start, "<i>D</i><sub>start</sub>", "steps"),
        (Metric::End, "<i>D</i><sub>end</sub>", "steps"),
    ];
    let one = |(metric, name, unit): (Metric, &str, &str)| {
        let tests = || analysis.tests.iter().filter(|test| test.gain.metric == metric);
        let rows = tests().map(|test: &Test| {
            let of = &test.gain;
            let p = |p: f64, holm: f64| {
                let after = match holm < LEVEL {
                    true => format!("<strong>{}</strong>", p_value(holm)),
                    false => p_value(holm),
                };
                format!("{}<small>{after}</small>", p_value(p))
            };
            vec![
                format!("{} ({})", words::model(of.model), of.experiment.numeral()),
                format!("{} over {}", words::set(test.first), words::set(test.second)),
                signed(of.paired.mean, 2),
                if few { "–".to_owned() } else { p(of.paired.p, of.holm) },
                p(test.mann_whitney_persons, test.mann_whitney_persons_holm),
                p(test.mann_whitney_trajectories, test.mann_whitney_trajectories_holm),
            ]
        });
        let columns = [
            "model",
            "sets",
            &format!("gain ({unit})"),
            "paired Wilcoxon, people",
            "Mann–Whitney, people",
            "Mann–Whitney, trials",
        ]
        .map(str::to_owned);
        let count = tests().count();
        let caption = format!(
            "<b>{name}</b>: p-values, below each the same after Holm over the {count} tests of its \
             column; <b>bold</b> where that is below 0.05. Trials of a person are not independent: \
             the last column is too sure. {}",
            if few { NO_TEST } else { "" }
        );
        details(
            &format!("All {count} tests of {name}"),
            &table(&caption, "numbers", &columns, &rows.collect::<Vec<_>>()),
        )
    };
    metrics.map(one).concat()
}

/// What a split by time step would claim; empty unless it was asked for.
pub(super) fn leakage(analysis: &Analysis) -> String {
    if analysis.leakage.is_empty() {
        return String::new();
    }
    let rows = analysis.leakage.iter().map(|row| {
        vec![
            format!("{} ({})", words::model(row.model), row.experiment.numeral()),
            fixed(row.grouped, 2),
            fixed(row.leaking, 2),
            signed(row.overstated(), 2),
        ]
    });
    let columns = ["model", "whole trials (%)", "single steps (%)", "overstated by (points)"];
    let first =
        analysis.settings.sets.first().map_or_else(String::new, |set| words::set(&set.name));
    let caption = format!(
        "<b>Leakage.</b> Accuracy on {first} when whole trials are held back, as everywhere else in \
         this report, and when single steps are, so that their neighbours are learned from."
    );
    table(&caption, "numbers", &columns.map(str::to_owned), &rows.collect::<Vec<_>>())
}

/// The participants who are excluded, and why.
pub(super) fn exclusions(analysis: &Analysis) -> String {
    let one = |who: &Exclusion| {
        format!("<li><b>{}</b>: {}</li>\n", escaped(&who.participant), escaped(&who.why()))
    };
    let all: String = analysis.data.exclusions.iter().map(one).collect();
    format!("<ul class=\"exclusions\">\n{all}</ul>\n")
}
