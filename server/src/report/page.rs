//! The report, which is one self-contained HTML file, and the LaTeX tables. Their text and layout are
//! in `templates/`. This module computes the numbers that the templates print.

#[cfg(test)]
mod sentence_tests;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use super::charts::Figure;
use super::text::{self, beside_zero, count, fixed, grouped, p_places, signed};
use crate::support::clock::date_time;
use minijinja::syntax::SyntaxConfig;
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, Error, Output, State, UndefinedBehavior};
use serde_json::json;
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Experiment;
use sidestep::comparison::gains::Power;
use sidestep::comparison::models::{BEYOND, Grids, ModelName};
use sidestep::comparison::rollout::{DOUBT, Simple};
use sidestep::comparison::sets::{BODY_FRAME_SETS, PAPERS_SETS};
use sidestep::comparison::tables::{Metric, are_best};
use sidestep::scene::Evader;
use std::collections::BTreeMap;

const TEMPLATES: [(&str, &str); 7] = [
    ("report.html", include_str!("templates/report.html")),
    ("macros.html", include_str!("templates/macros.html")),
    ("findings.html", include_str!("templates/findings.html")),
    ("beyond.html", include_str!("templates/beyond.html")),
    ("tables.html", include_str!("templates/tables.html")),
    ("method.html", include_str!("templates/method.html")),
    ("tables.tex", include_str!("templates/tables.tex")),
];

/// The program's style sheets. Each pair has a sheet that begins with the design tokens, and the
/// text that follows the tokens.
const SHEETS: [(&str, &str); 2] = [
    (include_str!("../../../static/style.css"), "*, *::before"),
    (include_str!("../../../static/lab.css"), "/* The first page"),
];

/// The report.
///
/// # Errors
/// If a template uses an undefined value.
pub(super) fn html(analysis: &Analysis, figures: &[Figure]) -> Result<String, Error> {
    let mut numbers = numbers(analysis);
    numbers["tokens"] =
        SHEETS.map(|(sheet, after)| sheet.split(after).next().unwrap_or_default()).concat().into();
    numbers["style"] = include_str!("templates/style.css").into();
    // Templates refer to all optional figures, so a missing figure must be null.
    numbers["figures"] = OPTIONAL_FIGURES.into_iter().map(|name| (name, json!(null))).collect();
    for figure in figures {
        numbers["figures"][figure.name] = figure.on_page();
    }
    rendered("report.html", numbers)
}

/// Figures that not every analysis has.
const OPTIONAL_FIGURES: [&str; 6] =
    ["behaviour", "learning", "unseen", "importance", "decisions", "beyond"];

/// The paper's tables as LaTeX.
///
/// # Errors
/// If the template uses an undefined value.
pub(super) fn latex(analysis: &Analysis) -> Result<String, Error> {
    rendered("tables.tex", numbers(analysis))
}

fn rendered(name: &str, numbers: serde_json::Value) -> Result<String, Error> {
    let mut environment = Environment::new();
    let mut syntax = SyntaxConfig::builder();
    syntax.trim_blocks(true).lstrip_blocks(true).keep_trailing_newline(true);
    environment.set_syntax(syntax.build()?);
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_formatter(write);
    environment.add_filter("fixed", fixed);
    environment.add_filter("signed", signed);
    environment.add_filter("beside_zero", beside_zero);
    environment.add_filter("p_places", p_places);
    environment.add_filter("grouped", grouped);
    environment.add_filter("count", count);
    environment.add_filter("tex", text::tex);
    environment.add_filter("without_tags", without_tags);
    environment.add_filter("set", |name: &str| safe(text::set(name)));
    environment.add_filter("model", |Serde(model): Serde<ModelName>| model.row().short);
    environment.add_filter("full_name", |Serde(model): Serde<ModelName>| model.row().full);
    environment.add_filter("numeral", |Serde(of): Serde<Experiment>| of.numeral());
    environment
        .add_filter("best", |numbers: Vec<Option<f64>>, less: bool| are_best(&numbers, less));
    for (name, template) in TEMPLATES {
        environment.add_template(name, template)?;
    }
    environment.get_template(name)?.render(Value::from(Serde(numbers)))
}

fn safe(html: String) -> Value {
    Value::from_safe_string(html)
}

/// The text of HTML without its tags. Any other text is unchanged.
fn without_tags(of: &Value) -> Value {
    if of.is_safe() { safe(text::without_tags(&of.to_string())) } else { of.clone() }
}

/// Prints a value as in the rest of the program, for example 3 m instead of 3.0 m. Escapes HTML so that
/// it is also valid XML.
fn write(out: &mut Output<'_>, state: &mut State<'_, '_>, value: &Value) -> Result<(), Error> {
    let text = match f64::try_from(value.clone()) {
        Ok(number) if value.is_number() => number.to_string(),
        _ => value.to_string(),
    };
    let is_plain = value.is_safe() || *state.auto_escape() == AutoEscape::None;
    Ok(out.write_str(&if is_plain { text } else { text::html(&text) })?)
}

/// Descriptions of the models' hyper-parameters. Each description is a list of texts. The name of a
/// hyper-parameter follows each text except the last.
fn hyperparameters() -> Vec<Vec<(&'static str, Option<&'static str>)>> {
    let trained =
        ModelName::EVERY.map(|model| model.row().grid).into_iter().filter(|of| !of.is_empty());
    let pieces = |grid: &'static str| {
        let mut pieces = Vec::new();
        let mut rest = grid;
        while let Some((text, (name, after))) =
            rest.split_once('{').and_then(|(text, after)| Some((text, after.split_once('}')?)))
        {
            pieces.push((text, Some(name)));
            rest = after;
        }
        pieces.push((rest, None));
        pieces
    };
    trained.map(pieces).collect()
}

/// The names of drivers in roll-outs, by driver and feature set.
fn drivers() -> BTreeMap<String, &'static str> {
    let papers = ModelName::PAPERS.map(|model| (model.word(), "hrd", model.row().short));
    let beyond = BEYOND.map(|of| (of.model.word(), of.features, of.words));
    let simple = [
        (Simple::Held.word(), "", "holding the last input"),
        (Simple::Straight.word(), "", "driving straight on"),
    ];
    let all = papers.into_iter().chain(beyond).chain(simple);
    all.map(|(driver, features, words)| (format!("{driver} {features}"), words)).collect()
}

/// The numbers that the templates print.
fn numbers(analysis: &Analysis) -> serde_json::Value {
    let Analysis { data, settings, comparison, findings, .. } = analysis;
    let cells = || {
        let of = |experiment| ModelName::PAPERS.map(|model| (model, experiment));
        Experiment::ALL.into_iter().flat_map(of)
    };
    let body_sets = BODY_FRAME_SETS.map(|(set, _)| set);
    let table1 = cells().map(|(model, experiment)| {
        let mut beside = comparison.accuracies(model, experiment, &body_sets);
        beside.push(analysis.baseline_accuracy(experiment));
        let accuracies = comparison.accuracies(model, experiment, &PAPERS_SETS);
        json!({ "model": model, "experiment": experiment, "accuracies": accuracies, "beside": beside })
    });
    let table2 = ModelName::PAPERS.map(|model| {
        let distances = PAPERS_SETS.map(|set| comparison.distances(model, set));
        json!({ "model": model, "distances": distances })
    });
    let confusions = cells().map(|(model, experiment)| {
        let of = analysis.pooled(Some(model), experiment, "hrd");
        let confusion = of.map(|of| &of.confusion);
        json!({ "model": model, "experiment": experiment, "confusion": confusion })
    });
    let is_own = |name: &str| !PAPERS_SETS.contains(&name) && !body_sets.contains(&name);
    let own_sets = settings.sets.iter().filter(|set| is_own(&set.name));
    let tested = analysis.tests.iter().filter(|test| test.gain.metric == Metric::Accuracy).count();
    let exclusions = data.exclusions.iter().map(|who| (&who.participant, who.why()));
    json!({
        "data": data,
        "counts": analysis.counts(),
        "few": Power::of(comparison.participants.len(), 1).is_too_low(),
        "study_power": Power::of(comparison.participants.len(), tested),
        "effect": Power::EFFECT,
        "aim": Power::AIM,
        "most_people": Power::MOST,
        "doubt": DOUBT,
        "leaking_tasks": data.copied_trials.iter().map(|of| of.leaking).sum::<usize>(),
        "exclusions": exclusions.collect::<Vec<_>>(),
        "doubtful_levels": doubtful_levels(analysis),
        "sets": settings.sets,
        "own_sets": own_sets.collect::<Vec<_>>(),
        "papers_sets": PAPERS_SETS,
        "grids": settings.grids,
        "protocol": Grids::default(),
        "hyperparameters": hyperparameters(),
        "drivers": drivers(),
        "findings": findings,
        "behaviour": analysis.behaviour,
        "learning": analysis.learning,
        "unseen": analysis.unseen,
        "version": env!("CARGO_PKG_VERSION"),
        "driven": data.driven_at_ms.map(|ends| ends.map(day)),
        "table1": table1.collect::<Vec<_>>(),
        "table2": table2,
        "ablations": analysis.ablation,
        "leaking": analysis.leakage,
        "tests": analysis.tests,
        "confusions": confusions.collect::<Vec<_>>(),
    })
}

/// The numbers of an analysis, with all digits, as JSON: those that the templates print, and those in
/// the tables.
///
/// # Errors
/// No error occurs in practice, because every part can be written as JSON.
pub(super) fn numbers_json(analysis: &Analysis) -> serde_json::Result<String> {
    let mut all = numbers(analysis);
    let families = analysis.families.iter();
    all["beside"] = families
        .map(|of| json!({ "first": of.first, "second": of.second, "gains": of.gains }))
        .collect();
    let pooled = analysis.pooled.iter();
    all["calibration"] = pooled
        .map(|of| {
            let (model, experiment, features) = (of.model, of.experiment, &of.features);
            json!({ "model": model, "experiment": experiment, "features": features, "of": of.calibration })
        })
        .collect();
    all["rollouts"] = json!(analysis.rollouts);
    all["importance"] = json!(analysis.importance);
    serde_json::to_string(&all)
}

/// The day of a time in ms since 1970, in UTC: 2026-11-23.
fn day(ms: f64) -> String {
    date_time(ms as i64).chars().take(10).collect()
}

/// The safety levels that cannot distinguish states, each with the feature sets that contain it.
fn doubtful_levels(analysis: &Analysis) -> Vec<serde_json::Value> {
    let Some(quality) = &analysis.data.safety else { return Vec::new() };
    let sets = || analysis.settings.sets.iter().chain([&analysis.settings.history]);
    let levels = [("HR", Evader::Human), ("RH", Evader::Robot)].into_iter();
    let doubtful = levels.filter(|(_, evader)| !quality.level(*evader).is_sound());
    let told = |(name, evader)| {
        let sets = sets().filter(|set| set.features.has_level(evader)).map(|set| &set.name);
        let mut level = json!(quality.level(evader));
        level["name"] = json!(name);
        level["sets"] = json!(sets.collect::<Vec<_>>());
        level
    };
    doubtful.map(told).collect()
}
