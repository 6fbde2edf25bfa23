//! What is drawn.

pub(super) mod accuracy;
pub(super) mod calibration;
pub(super) mod confusion;
pub(super) mod decisions;
pub(super) mod gains;
pub(super) mod rollouts;

use super::html::{details, escaped, table};
use sidestep::chart::{
    Chart, Colour, ColourStyle, Drawing, LegendItem, Mark, Pen, Series, colours,
};
use sidestep::comparison::cell::ModelName;

/// Every chart is drawn for a telephone's width, px, and several stand side by side on a wider
/// page, so that letters keep their size.
const WIDTH: f64 = 340.0;

/// A model's colour and mark.
fn look(model: ModelName) -> (Colour, Mark) {
    let [svm, trees, regression, ..] = colours::SERIES;
    match model {
        ModelName::Svm | ModelName::SvmRbf | ModelName::SvmLinear => (svm, Mark::Circle),
        ModelName::Dt | ModelName::Boosted => (trees, Mark::Square),
        ModelName::Lr => (regression, Mark::Triangle),
    }
}

/// A dashed line that says nothing but where something is.
fn reference(name: &str, ends: [[f64; 2]; 2]) -> Series {
    Series::drawn(name, ends, Pen::new(colours::MUTED, 1.5).dashed(5.0, 3.0))
}

/// A figure: charts of that height side by side, what their signs mean, their numbers as tables,
/// and what they show. `caption` is HTML.
fn figure(charts: &[Chart], height: f64, caption: &str) -> String {
    let drawings: Vec<Drawing> =
        charts.iter().map(|chart| chart.drawing([WIDTH, height])).collect();
    drawn(charts, &drawings, "charts", caption)
}

/// Likewise with drawings of the charts. `class` is that of the block they stand in.
fn drawn(charts: &[Chart], drawings: &[Drawing], class: &str, caption: &str) -> String {
    let svg: String = (drawings.iter())
        .map(|drawing| format!("{}\n", drawing.element(ColourStyle::Properties)))
        .collect();
    let mut items: Vec<LegendItem> = Vec::new();
    for item in charts.iter().flat_map(Chart::legend) {
        if items.iter().all(|known| known.text != item.text) {
            items.push(item);
        }
    }
    let tables: String = charts.iter().map(numbers).collect();
    let tables =
        if tables.is_empty() { tables } else { details("The numbers of this figure", &tables) };
    format!(
        "<figure>\n<div class=\"{class}\">\n{svg}</div>\n{}{tables}<figcaption>{caption}</figcaption>\n</figure>\n",
        legend(&items)
    )
}

/// What signs mean.
fn legend(items: &[LegendItem]) -> String {
    let item = |LegendItem { sign, text }: &LegendItem| {
        let mut svg = sign.element(ColourStyle::Properties);
        svg.attributes.retain(|(name, _)| *name != "role");
        let size = [("width", "26"), ("height", "12"), ("aria-hidden", "true")];
        svg.attributes.extend(size.map(|(name, value)| (name, value.to_owned())));
        format!("<li>{svg}<span>{}</span></li>\n", escaped(text))
    };
    format!("<ul class=\"legend\">\n{}</ul>\n", items.iter().map(item).collect::<String>())
}

/// A chart's numbers as a table; empty where it has none.
fn numbers(chart: &Chart) -> String {
    let found = chart.table();
    if found.rows.is_empty() {
        return String::new();
    }
    let escape = |texts: &Vec<String>| texts.iter().map(|text| escaped(text)).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = found.rows.iter().map(escape).collect();
    table(&escaped(&found.caption), "numbers", &escape(&found.columns), &rows)
}
