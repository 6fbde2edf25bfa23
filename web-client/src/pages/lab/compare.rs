//! Compares two analyses side by side: their input, and the accuracy of their models.

use super::analyses::settings;
use crate::form::FieldValue;
use crate::pages::parts::{cell, table};
use crate::view::{Node, el};
use sidestep::api::{AnalysisResult, AnalysisSummary, MeanAccuracy};
use std::collections::BTreeMap;

/// Lets the user choose another finished analysis, and shows the comparison as soon as that
/// analysis is loaded. `chosen` converts the chosen id to a message.
pub(super) fn section<M: Clone + 'static>(
    own: &AnalysisSummary,
    others: &[AnalysisSummary],
    other: Option<&AnalysisSummary>,
    chosen: impl Fn(FieldValue) -> M + 'static,
) -> Option<Node<M>> {
    let result = own.result.as_ref()?;
    let others = others.iter().filter(|of| of.id != own.id && of.result.is_some());
    let option = |of: &AnalysisSummary| {
        let is_chosen = other.is_some_and(|other| other.id == of.id);
        let people = of.result.as_ref().map_or(0, |result| result.participants);
        el("option")
            .attr("value", &of.id)
            .attr_if(is_chosen, "selected", "")
            .text(format!("{people} participants; {}; ", settings(&of.request)))
            .moment(of.created_at_ms)
    };
    let options: Vec<Node<M>> = others.map(option).collect();
    if options.is_empty() {
        return None;
    }
    let select = el("select")
        .attrs(&[("name", "other"), ("aria-label", "Another analysis")])
        .test_id("compare")
        .on_input(chosen)
        .child(el("option").attr("value", "").text("choose an analysis"))
        .children(options);
    let compared = other.and_then(|other| Some((other, other.result.as_ref()?)));
    Some(
        el("section")
            .child(el("h2").text("Compare with another analysis"))
            .child(el("p").child(select))
            .children(compared.map(|(other, theirs)| inputs((own, result), (other, theirs))))
            .children(compared.map(|(_, theirs)| accuracies(result, theirs))),
    )
}

/// The input of both analyses.
fn inputs<M>(
    (own, result): (&AnalysisSummary, &AnalysisResult),
    (other, theirs): (&AnalysisSummary, &AnalysisResult),
) -> Node<M> {
    let row = |name: &str, [own, other]: [String; 2]| {
        let differs = own != other;
        el("tr")
            .attr_if(differs, "class", "differs")
            .child(el("th").attr("scope", "row").text(name))
            .child(cell(own))
            .child(cell(other))
            .child(cell(if differs { "differs" } else { "same" }))
    };
    let both = |of: fn(&AnalysisResult) -> String| [of(result), of(theirs)];
    let short = |hash: &Option<String>| {
        hash.as_ref().map_or("not recorded".to_owned(), |hash| hash.chars().take(12).collect())
    };
    let rows = [
        row("Settings", [settings(&own.request), settings(&other.request)]),
        row("Participants", both(|of| of.participants.to_string())),
        row("Excluded", both(|of| of.excluded.len().to_string())),
        row("Data", [short(&result.data_sha256), short(&theirs.data_sha256)]),
        row("Sidestep", both(|of| of.version.clone().unwrap_or("not recorded".to_owned()))),
    ];
    scroll("Input of the two analyses")
        .child(table(["What went in", "This analysis", "The other", "Compared"], rows))
}

/// Mean accuracies of the models in both analyses.
fn accuracies<M>(result: &AnalysisResult, theirs: &AnalysisResult) -> Node<M> {
    let key = |of: &MeanAccuracy| (of.model.clone(), of.experiment, of.features.clone());
    let of = |accuracies: &[MeanAccuracy]| -> BTreeMap<_, f64> {
        accuracies.iter().map(|of| (key(of), of.percent)).collect()
    };
    let (own, other) = (of(&result.accuracies), of(&theirs.accuracies));
    let only_theirs = theirs.accuracies.iter().filter(|of| !own.contains_key(&key(of)));
    let percent = |number: Option<f64>| number.map_or("–".to_owned(), |n| format!("{n:.2}"));
    let rows: Vec<Node<M>> = (result.accuracies.iter())
        .chain(only_theirs)
        .map(|model| {
            let [own, other] = [&own, &other].map(|of| of.get(&key(model)).copied());
            let experiment = if model.experiment == 1 { "I" } else { "II" };
            let name = model.model.to_uppercase();
            let words = format!("{name} {experiment} on {}", model.features);
            let points =
                own.zip(other).map_or("–".to_owned(), |(own, other)| difference(own - other));
            el("tr")
                .child(el("th").attr("scope", "row").text(words))
                .child(cell(percent(own)))
                .child(cell(percent(other)))
                .child(cell(points))
        })
        .collect();
    if result.accuracies.is_empty() || theirs.accuracies.is_empty() {
        let words = "One of the two was computed by an earlier version, which stored no accuracies. \
                     Start it again to compare.";
        return el("p").class("quiet").text(words);
    }
    let columns = ["Model", "This analysis (%)", "The other (%)", "Difference (points)"];
    scroll("Accuracies of the two analyses")
        .test_id("accuracies")
        .child(table(columns, rows))
        .child(el("p").class("quiet").text(
            "Mean test accuracy over participants. Other participants, trials or settings change \
             the numbers; the difference is not tested.",
        ))
}

/// A container that scrolls horizontally, also with the keyboard.
fn scroll<M>(label: &str) -> Node<M> {
    el("div").class("scroll").attrs(&[("role", "group"), ("tabindex", "0"), ("aria-label", label)])
}

/// Formats a difference with its sign, except for 0.00.
fn difference(points: f64) -> String {
    match format!("{:.2}", points.abs()).as_str() {
        "0.00" => "0.00".to_owned(),
        size if points < 0.0 => format!("−{size}"),
        size => format!("+{size}"),
    }
}
