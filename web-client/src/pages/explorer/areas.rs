//! The area that a given coverage needs, for SHFRS and for simpler predictions, as charts and
//! tables.

use super::{Explorer, Msg, tuning};
use crate::evaluation::Report;
use crate::evaluation::areas::{AreaQuestion, LEAST_TARGET};
use crate::json;
use crate::pages::parts::{self, alert, cell, count};
use crate::runtime::Answer;
use crate::view::{self, drawn, el};
use sidestep::bounds::Rollout;
use sidestep::chart::{ColourStyle, Element, fixed, number};
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::pareto::{Pareto, ParetoCurve, ParetoRow};
use sidestep::shfrs::pareto_charts::{areas, panels};
use sidestep::shfrs::tuning::Parts;

type Node = view::Node<Msg>;

/// The last question to the comparer, and its answer so far.
#[derive(Default)]
pub(super) struct Areas {
    number: u32,
    /// Whether the comparer already has the tasks and the predictor.
    pub(super) is_introduced: bool,
    /// The settings of the last question, normalized by [`without_epsilon`].
    asked: Option<ShfrsFile>,
    done: f64,
    /// The results and their charts, for these settings or, until the new results arrive, for the
    /// previous settings.
    found: Option<(Pareto, Vec<Element>)>,
    is_old: bool,
    trouble: Option<String>,
}

/// Size of a chart (px).
const CHART: [f64; 2] = [258.0, 168.0];

impl Areas {
    /// Discards everything.
    pub(super) fn forget(&mut self) {
        *self = Self { number: self.number + 1, ..Self::default() };
    }

    /// Marks the results as outdated if these settings need another comparison. Returns whether
    /// they do.
    pub(super) fn outdate(&mut self, wanted: &ShfrsFile) -> bool {
        let is_other = self.asked.as_ref().is_some_and(|asked| *asked != without_epsilon(wanted));
        if is_other {
            (self.asked, self.is_old) = (None, true);
            self.number += 1;
        }
        is_other
    }

    /// Hides outdated results. If the current sets cannot be counted, they cannot be compared
    /// either.
    pub(super) fn hide(&mut self) {
        if self.is_old {
            self.found = None;
        }
    }

    /// Creates a question about the area. Returns `None` if the current question is still valid.
    pub(super) fn ask(&mut self, wanted: &ShfrsFile, parts: Parts) -> Option<AreaQuestion> {
        if self.asked.is_some() {
            return None;
        }
        self.number += 1;
        (self.done, self.is_old, self.trouble) = (0.0, true, None);
        self.asked = Some(without_epsilon(wanted));
        Some(AreaQuestion { number: self.number, settings: wanted.clone(), parts })
    }

    /// Processes a report from the comparer, unless it answers an outdated question.
    pub(super) fn take(&mut self, answer: Answer) {
        let content = match answer {
            Ok(content) => content,
            Err(failure) => {
                (self.found, self.trouble) = (None, Some(failure.sentence));
                return;
            }
        };
        let report = json::read::<Report>(&content);
        let Some(report) = report.filter(|report| report.number == self.number) else { return };
        (self.done, self.trouble) = (report.done, report.trouble);
        if self.trouble.is_some() {
            self.found = None;
        } else if let Some(pareto) = report.pareto {
            let draw = |chart: sidestep::chart::Chart| {
                chart.drawing(CHART).element(ColourStyle::Properties)
            };
            let charts = panels(&pareto).into_iter().map(draw).collect();
            (self.found, self.is_old) = (Some((pareto, charts)), false);
        }
    }
}

/// Normalizes settings: removes the widenings and the kind of roll-outs. They do not affect the
/// comparison, because its curve covers every ε and it always uses `base` roll-outs.
fn without_epsilon(settings: &ShfrsFile) -> ShfrsFile {
    let mut settings = settings.clone();
    (settings.epsilon, settings.rollout) = (Vec::new(), Rollout::Base);
    settings
}

impl Explorer {
    /// The reason why there are too few tasks for a comparison.
    pub(super) fn lacks_tasks_to_compare(&self) -> Option<String> {
        tuning::lacking(self, Guarantee::Conformal, LEAST_TARGET)
    }
}

/// The section with the charts and tables.
pub(super) fn section(explorer: &Explorer) -> Node {
    let it = &explorer.areas;
    let is_busy = it.asked.is_some() && it.done < 1.0 && it.trouble.is_none();
    let bar = el("progress")
        .attrs(&[("max", "1"), ("aria-label", "Predictions compared")])
        .attr("value", fixed(it.done, 3))
        .attr_if(!is_busy, "class", "done")
        .test_id("compared");
    // Results are shown only for valid settings.
    let found = it.found.as_ref().filter(|_| explorer.is_valid());
    let nothing = found.is_none() && it.trouble.is_none();
    let waiting = nothing.then(|| match explorer.lacks_tasks_to_compare() {
        Some(why) => el("p").class("waiting").test_id("not-comparable").text(why),
        None if !explorer.is_valid() => {
            el("p").class("quiet").text("Nothing is predicted with these settings.")
        }
        None => el("p")
            .class("quiet")
            .text("Compared with simpler predictions once the sets are counted."),
    });
    let found = found.into_iter().flat_map(|(pareto, charts)| {
        [
            el("p").class("quiet").test_id("areas-words").text(words(pareto)),
            grid(it, pareto, charts),
        ]
        .into_iter()
        .chain([twin(pareto)])
    });
    el("section")
        .class("areas")
        .child(el("h2").text("How much area a coverage costs"))
        .child(bar)
        .children(waiting)
        .children(found)
        .children(it.trouble.as_deref().map(|why| alert("not-compared", &format!("{why}."))))
}

fn words(pareto: &Pareto) -> String {
    format!(
        "Each line: every size of one prediction, judged on {} with one random window each. Dots: sizes \
         calibrated on {} others for the coverage at the dashed line, with {} % intervals. Further left is \
         better.",
        count(pareto.test_trajectories, "task"),
        pareto.calibration_trajectories,
        number(100.0 * pareto.confidence),
    )
}

fn grid(it: &Areas, pareto: &Pareto, charts: &[Element]) -> Node {
    let chart = |(curve, chart): (&ParetoCurve, &Element)| {
        let caption = el("figcaption")
            .class(if curve.is_shfrs() { "ours" } else { "" })
            .child(el("b").text(&curve.family))
            .child(el("span").text(areas(pareto, curve)));
        el("figure").child(caption).child(drawn(chart.clone()).attr("aria-hidden", "true"))
    };
    el("div")
        .class(if it.is_old { "panels old" } else { "panels" })
        .test_id("panels")
        .children(pareto.curves.iter().zip(charts).map(chart))
}

/// Coverages at which the table samples the curves.
const READ_AT: [f64; 5] = [0.5, 0.75, 0.9, 0.95, 1.0];

/// The numbers of the charts as tables.
fn twin(pareto: &Pareto) -> Node {
    let row =
        |row: &ParetoRow| {
            let coverage = format!(
                "{} ({}–{})",
                fixed(row.coverage, 2),
                fixed(row.coverage_low, 2),
                fixed(row.coverage_high, 2)
            );
            el("tr").child(el("th").attr("scope", "row").text(&row.family)).children([
                cell(number(row.target)),
                cell(fixed(row.level, 3)),
                cell(coverage),
                cell(fixed(row.mean_area_m2, 2)),
                cell(pareto.share_of_worst_case(row).map_or_else(
                    || "—".to_owned(),
                    |share| format!("{} %", fixed(100.0 * share, 0)),
                )),
            ])
        };
    let columns = ["prediction", "asked", "size", "coverage", "mean area / m²", "share of worst"];
    let calibrated = parts::table(columns, pareto.rows.iter().map(row));
    let read = |curve: &ParetoCurve| {
        let at = |coverage: f64| {
            let point = curve.points.iter().find(|point| point.coverage >= coverage);
            cell(point.map_or_else(|| "—".to_owned(), |point| fixed(point.mean_area_m2, 2)))
        };
        el("tr").child(el("th").attr("scope", "row").text(&curve.family)).children(READ_AT.map(at))
    };
    let columns = READ_AT.map(|coverage| format!("p ≥ {}", number(coverage)));
    let columns = ["mean area / m² on the line".to_owned()].into_iter().chain(columns);
    let lines = parts::table(columns, pareto.curves.iter().map(read));
    let scroll = |label: &str, table: Node| {
        el("div")
            .class("scroll")
            .attrs(&[("tabindex", "0"), ("role", "region"), ("aria-label", label)])
            .child(table)
    };
    el("details")
        .class("table-twin")
        .test_id("areas-twin")
        .child(el("summary").text("Numbers"))
        .child(scroll("Calibrated sizes", calibrated))
        .child(scroll("Areas on the lines", lines))
}
