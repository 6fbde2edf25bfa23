//! What is taken for what.

use super::super::html::grouped;
use super::super::words;
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::{Experiment, ModelName};

const SET: &str = "hrd";

/// A table for each model and experiment.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let entries = Experiment::ALL
        .into_iter()
        .flat_map(|experiment| ModelName::PAPERS.into_iter().map(move |model| (model, experiment)));
    let tables: String =
        entries.map(|(model, experiment)| table(analysis, model, experiment)).collect();
    format!(
        "<figure>\n<div class=\"charts\">\n{tables}</div>\n<figcaption><b>Confusion</b> on {}. Rows: \
         what people did; columns: what was predicted; per cent of the row, with the number of test \
         steps below. A deeper colour is a larger share.</figcaption>\n</figure>\n",
        words::set(SET)
    )
}

fn table(analysis: &Analysis, model: ModelName, experiment: Experiment) -> String {
    let counts = analysis.pooled(Some(model), experiment, SET).map(|of| of.confusion.clone());
    let counts = counts.unwrap_or_default();
    let classes = experiment.classes();
    let name = |class: &i8| words::class(experiment, *class);
    let columns: String =
        classes.iter().map(|class| format!("<th scope=\"col\">{}</th>", name(class))).collect();
    let row = |(class, counts): (&i8, Vec<usize>)| {
        let total = counts.iter().sum::<usize>().max(1) as f64;
        let entry = |count: usize| {
            let share = count as f64 / total;
            format!(
                "<td style=\"--share:{:.0}%\">{:.0} %<small>{}</small></td>",
                // Half the colour at most, so that the numbers stay legible.
                45.0 * share,
                100.0 * share,
                grouped(count)
            )
        };
        let entries: String = counts.into_iter().map(entry).collect();
        format!("<tr><th scope=\"row\">{}</th>{entries}</tr>\n", name(class))
    };
    let rows: String = classes.iter().zip(counts).map(row).collect();
    format!(
        "<table class=\"confusion\">\n<caption>{} {}</caption>\n<thead><tr><th scope=\"col\" \
         class=\"corner\">did ↓<br/>predicted →</th>{columns}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n",
        words::model(model),
        experiment.numeral()
    )
}
