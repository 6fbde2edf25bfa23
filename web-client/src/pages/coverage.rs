//! How often predicted sets contain the future: the question to the evaluator, and the counts in
//! its answer.

use crate::evaluation::Report;
use crate::evaluation::counting::Question;
use crate::json;
use crate::runtime::Answer;
use crate::view::{Node, el};
use sidestep::chart::lowered;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::probability::Regions;
use sidestep::stats::Estimate;

/// The newest question and its answer so far.
#[derive(Default)]
pub(super) struct Coverage {
    /// Whether all tasks are counted. Otherwise only the tasks that did not train the predictor are
    /// counted.
    pub(super) counts_all: bool,
    /// Number of the last request to the evaluator.
    number: u32,
    /// Number of tasks to count.
    pub(super) tasks: usize,
    /// Fraction of these tasks that are counted so far.
    pub(super) done: f64,
    /// Counts for this question, or counts for the previous question until the new ones arrive.
    regions: Option<Regions>,
    /// Whether the counts are for the previous question.
    is_old: bool,
    /// The reason why nothing can be counted.
    pub(super) trouble: Option<String>,
}

impl Coverage {
    pub(super) fn new(counts_all: bool) -> Self {
        Self { counts_all, ..Self::default() }
    }

    /// Returns the number of the next request. Reports with other numbers are outdated from then
    /// on.
    pub(super) fn next(&mut self) -> u32 {
        self.number += 1;
        self.number
    }

    /// Discards all counts.
    pub(super) fn forget(&mut self) {
        self.next();
        (self.regions, self.trouble, self.done, self.tasks) = (None, None, 0.0, 0);
    }

    /// Creates a question about these settings and tasks.
    pub(super) fn ask(&mut self, settings: ShfrsFile, tasks: Vec<usize>) -> Question {
        (self.tasks, self.done, self.is_old, self.trouble) = (tasks.len(), 0.0, true, None);
        Question { number: self.next(), settings, tasks }
    }

    /// Parses a report of the evaluator. Returns `None` if it answers an outdated request.
    pub(super) fn newest(&mut self, answer: Answer) -> Option<Report> {
        let content = match answer {
            Ok(content) => content,
            Err(failure) => {
                (self.regions, self.trouble) = (None, Some(failure.sentence));
                return None;
            }
        };
        json::read::<Report>(&content).filter(|report| report.number == self.number)
    }

    /// Stores a report.
    pub(super) fn take(&mut self, report: Report) {
        self.done = report.done;
        self.trouble = report.trouble;
        if report.regions.is_some() || self.trouble.is_some() {
            (self.regions, self.is_old) = (report.regions, false);
        }
    }

    /// Returns the counts if they are for this number of sets. The flag says whether they are for
    /// the previous settings.
    pub(super) fn regions(&self, sets: usize) -> Option<(&Regions, bool)> {
        let regions = self.regions.as_ref().filter(|regions| regions.epsilon.len() == sets)?;
        Some((regions, self.is_old))
    }
}

/// Rewords an error in the settings for this page, where sets and steps are numbered from 1.
pub(super) fn worded(said: &str) -> String {
    for (field, words) in [("epsilon[", "ε of F"), ("k[", "k of step ")] {
        let parts = said.strip_prefix(field).and_then(|rest| rest.split_once(']'));
        let place = parts.and_then(|(place, rest)| Some((place.parse::<usize>().ok()?, rest)));
        if let Some((place, rest)) = place {
            let place = place + 1;
            let place = if field == "k[" { place.to_string() } else { lowered(place) };
            return format!("{words}{place}{rest}");
        }
    }
    match said.strip_prefix("steps: ") {
        Some(rest) => format!("Steps ahead, T: {rest}"),
        None => said.to_owned(),
    }
}

/// A probability with its confidence interval, as a number and as a bar.
pub(super) fn chance<M>(p: Estimate) -> Node<M> {
    let [low, value, high] = [p.low, p.value, p.high].map(|share| 100.0 * share);
    let bar = el("span")
        .class("interval")
        .attr("aria-hidden", "true")
        .child(el("i").attr("style", format!("left:{low:.1}%;right:{:.1}%", 100.0 - high)))
        .child(el("b").attr("style", format!("left:{value:.1}%")));
    let interval =
        if p.low == p.high { String::new() } else { format!(" {:.2}–{:.2}", p.low, p.high) };
    el("td")
        .class("chance")
        .child(bar)
        .text(format!("{:.3}", p.value))
        .child(el("small").text(interval))
}
