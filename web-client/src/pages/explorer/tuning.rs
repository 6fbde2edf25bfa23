//! "Tune for p ≥ …": the goal of the tuning, its progress, and its result with the guarantee.

use super::predictor::Choice;
use super::{Explorer, Msg};
use crate::evaluation::tuning::{Aim, Found};
use crate::evaluation::{CONFIDENCE, Report};
use crate::form::FieldValue;
use crate::json;
use crate::pages::moment::select;
use crate::pages::parts::{alert, button, count, fact};
use crate::runtime::Answer;
use crate::view::{self, el};
use sidestep::chart::{fixed, number};
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::tuning::{Parts, Split};

type Node = view::Node<Msg>;

/// The goal of the tuning, and its result.
pub(super) struct Tuning {
    number: u32,
    /// The required probability that a trajectory stays inside F_1.
    p: f64,
    /// Whether the guarantee must hold with high confidence for the individual calibration.
    /// Otherwise it holds only on average.
    is_sure: bool,
    /// Progress of the tuner. `None` while it is idle.
    done: Option<f64>,
    found: Option<Found>,
    trouble: Option<String>,
}

/// Accepted probability that a calibration fails. It is the command line's default.
const DELTA: f64 = 0.05;

impl Default for Tuning {
    fn default() -> Self {
        let (done, found, trouble) = (None, None, None);
        Self { number: 0, p: 0.75, is_sure: false, done, found, trouble }
    }
}

impl Tuning {
    pub(super) fn set_p(&mut self, value: &FieldValue) {
        let p = value.number().unwrap_or(self.p).clamp(0.01, 0.99);
        self.aim(p, self.is_sure);
    }

    pub(super) fn set_guarantee(&mut self, value: &FieldValue) {
        self.aim(self.p, value.text() == "pac");
    }

    /// Sets the coverage and guarantee to tune for. If they change, discards the previous result.
    fn aim(&mut self, p: f64, is_sure: bool) {
        if (p, is_sure) != (self.p, self.is_sure) {
            (self.p, self.is_sure) = (p, is_sure);
            self.forget();
        }
    }

    /// Whether the tuner is working.
    pub(super) fn is_busy(&self) -> bool {
        self.done.is_some()
    }

    /// Ends tuning. Later reports are outdated.
    pub(super) fn stop(&mut self) {
        (self.done, self.number) = (None, self.number + 1);
    }

    /// Ends tuning and discards the result, which no longer applies.
    pub(super) fn forget(&mut self) {
        self.stop();
        (self.found, self.trouble) = (None, None);
    }

    pub(super) fn ask(&mut self, steps: usize, parts: Parts) -> Aim {
        self.forget();
        self.done = Some(0.0);
        let delta = self.is_sure.then_some(DELTA);
        Aim { number: self.number, p: self.p, delta, steps, parts }
    }

    /// Processes a report from the tuner. Returns whether it is the last one.
    pub(super) fn take(&mut self, answer: Answer) -> bool {
        let content = match answer {
            Ok(content) => content,
            Err(failure) => {
                (self.done, self.trouble) = (None, Some(failure.sentence));
                return true;
            }
        };
        let report = json::read::<Report>(&content);
        let Some(report) = report.filter(|report| report.number == self.number) else {
            return false;
        };
        let is_over = report.found.is_some() || report.trouble.is_some();
        self.done = (!is_over).then_some(report.done);
        (self.found, self.trouble) = (report.found, report.trouble);
        is_over
    }

    /// The result, with the tuned settings.
    pub(super) fn found(&self) -> Option<&Found> {
        self.found.as_ref()
    }

    /// Command-line flags for the required coverage and guarantee.
    pub(super) fn flags(&self) -> String {
        let guarantee = if self.is_sure { "pac" } else { "conformal" };
        format!("--probability {} --guarantee {guarantee}", fixed(self.p, 2))
    }

    fn guarantee(&self) -> Guarantee {
        if self.is_sure { Guarantee::Pac { delta: DELTA } } else { Guarantee::Conformal }
    }
}

/// The controls, and the result.
pub(super) fn section(explorer: &Explorer) -> Node {
    let it = &explorer.tuning;
    let p = fixed(it.p, 2);
    let slider = el("input")
        .attrs(&[("id", "aim"), ("type", "range"), ("min", "0.5"), ("max", "0.99")])
        .attrs(&[("step", "0.01"), ("data-own-keys", "")])
        .attr("value", it.p)
        .attr("aria-valuetext", format!("p of at least {p}"))
        .test_id("aim")
        .on_input(Msg::Aim);
    let slider = el("div")
        .class("pair knob")
        .child(el("label").attr("for", "aim").text("Coverage, p ≥"))
        .child(slider)
        .child(el("output").attr("for", "aim").text(p));
    let guarantees = vec![
        ("conformal".to_owned(), "on average over calibrations".to_owned()),
        ("pac".to_owned(), format!("with confidence {}", number(1.0 - DELTA))),
    ];
    let chosen = if it.is_sure { "pac" } else { "conformal" };
    let lacking = lacking(explorer, it.guarantee(), it.p);
    let act = match it.done {
        Some(done) => vec![
            el("progress")
                .attrs(&[("max", "1"), ("aria-label", "Tuned so far")])
                .attr("value", fixed(done, 3))
                .test_id("tuned"),
            button("stop-tuning", Msg::StopTuning).text("Stop"),
        ],
        None => {
            let is_possible =
                lacking.is_none() && explorer.playback.learned().is_some() && explorer.is_valid();
            vec![button("tune", Msg::Tune).attr_if(!is_possible, "disabled", "").text("Tune")]
        }
    };
    el("section")
        .class("knobs tuning")
        .child(el("h2").text("Tune for a coverage"))
        .child(el("p").class("quiet").text(
            "Finds which actions count, and the ε of the first set, with the least area for this coverage.",
        ))
        .child(slider)
        .child(select("guarantee", "Guaranteed", guarantees, chosen, Msg::Guarantee))
        .children(lacking.iter().map(|why| el("p").class("waiting").test_id("lacking").text(why)))
        .children(lacking.as_ref().and_then(|_| remedy(explorer)))
        .child(el("div").class("act").children(act))
        .children(it.trouble.as_deref().map(|why| alert("not-tuned", &format!("{why}."))))
        .children(it.found.as_ref().map(|found| result(explorer, found)))
}

/// The reason why there are too few tasks to calibrate a coverage of `p`. `None` if there are
/// enough.
pub(super) fn lacking(explorer: &Explorer, guarantee: Guarantee, p: f64) -> Option<String> {
    let needed = guarantee.needed(p).ok()?;
    let (choice, drives) = (&explorer.choice, &explorer.drives);
    let there = choice.parts(drives).calibration.len();
    let in_all = (needed as f64 / Split::USUAL.calibration).ceil();
    (there < needed).then(|| {
        format!(
            "p ≥ {} takes {} to calibrate with, of about {in_all} in all. Of the {} of this participant, {} did \
             not train the predictor, and {there} of those are for calibration.",
            fixed(p, 2),
            count(needed, "task"),
            count(drives.tasks.len(), "task"),
            choice.unseen(drives).len(),
        )
    })
}

/// Offers the predictor that sets tasks aside for calibration, if it sets aside enough of them.
fn remedy(explorer: &Explorer) -> Option<Node> {
    let it = &explorer.tuning;
    let needed = it.guarantee().needed(it.p).ok()?;
    let helps = Choice::set_aside(&explorer.drives).calibration.len() >= needed;
    helps.then(|| {
        let here = FieldValue::Text(Choice::HERE.to_owned());
        el("div").class("act").child(
            button("leave-tasks-aside", Msg::Choose(here))
                .text("Use a predictor that leaves enough tasks for calibration"),
        )
    })
}

/// The result, and its guarantee.
fn result(explorer: &Explorer, found: &Found) -> Node {
    let [chosen, calibrated, judged, without] = found.tasks;
    let coverage = found.coverage;
    let measured = match judged {
        0 => "no task was left to measure it".to_owned(),
        _ => {
            let inside = (coverage.value * judged as f64).round();
            // A small sample gives a wide interval. It agrees with p unless the whole interval is
            // below p.
            let agrees = if coverage.high >= found.p { "agrees with" } else { "is below" };
            format!(
                "{inside} of {judged} other tasks stayed inside: {} ({} % interval {}–{}), which {agrees} p ≥ {}",
                fixed(coverage.value, 2),
                number(100.0 * CONFIDENCE),
                fixed(coverage.low, 2),
                fixed(coverage.high, 2),
                number(found.p),
            )
        }
    };
    let facts = [
        fact(
            "guaranteed",
            format!("p ≥ {}, {} steps ahead", number(found.p), found.settings.steps),
        ),
        fact("actions", &found.actions),
        fact("ε of the first set", format!("{} rad/s", fixed(found.settings.epsilon[0], 4))),
        fact(
            "mean area",
            format!(
                "{} m², {} % of the worst case",
                fixed(found.mean_area_m2, 3),
                fixed(100.0 * found.share_of_worst_case, 0)
            ),
        ),
        fact("measured", measured),
    ];
    let left_out = match without {
        0 => String::new(),
        n => format!(" {} had no window of {} steps.", count(n, "task"), found.settings.steps),
    };
    let how = format!(
        "{} chose the actions, {calibrated} others set ε, and {judged} others measured the coverage: one \
         random window of each.{left_out} Exchangeable means that the next trajectory might as well have \
         been one of those that set ε: the same person in the same kind of scene, in any order.",
        count(chosen, "task"),
    );
    let in_use = explorer.wanted.begins_with(&found.settings);
    let using = if in_use {
        el("p").class("quiet").test_id("in-use").text("The controls above have these settings.")
    } else {
        el("p")
            .class("quiet")
            .text("The controls have changed since; the guarantee does not apply to them. ")
            .child(button("use-found", Msg::UseFound).text("Use these settings"))
    };
    el("div")
        .class("found")
        .attr("role", "status")
        .test_id("found")
        .child(el("dl").class("facts").children(facts))
        .child(el("p").class("statement").test_id("statement").text(&found.statement))
        .child(el("p").class("quiet").text(how))
        .child(using)
}
