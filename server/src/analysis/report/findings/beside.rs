//! Findings beside the paper's own tests: the body frame, baselines, roll-outs, calibration.

use super::super::compare::{LEVEL, Paired};
use super::super::html::{fixed, p_is, p_value, signed};
use super::super::words;
use super::{Finding, Verdict, name, power};
use crate::analysis::Analysis;
use sidestep::comparison::RolloutsOf;
use sidestep::comparison::cell::{Experiment, ModelName};
use sidestep::comparison::metrics::Predictions;
use sidestep::comparison::rollout::{Horizon, Simple};
use sidestep::stats::rank::holm;

/// A comparison of a model and experiment, with its p-value after Holm over its family.
struct Entry {
    name: String,
    paired: Paired,
    holm: f64,
}

/// Every model and experiment, `first` over `second`.
fn family(
    first: impl Fn(ModelName, Experiment) -> Vec<f64>,
    second: impl Fn(ModelName, Experiment) -> Vec<f64>,
) -> Vec<Entry> {
    let mut entries = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let paired = Paired::of(&first(model, experiment), &second(model, experiment));
            let name = name(model, experiment);
            entries.extend(paired.map(|paired| Entry { name, paired, holm: 1.0 }));
        }
    }
    let p_values: Vec<f64> = entries.iter().map(|entry| entry.paired.p).collect();
    for (entry, p) in entries.iter_mut().zip(holm(&p_values)) {
        entry.holm = p;
    }
    entries
}

fn verdict(people: usize, entries: &[Entry]) -> Verdict {
    Verdict::of(people, entries.iter().map(|entry| (entry.paired.p, entry.holm)))
}

fn said(entries: &[Entry]) -> String {
    let one = |entry: &Entry| {
        format!(
            "{} {} ({}, after Holm {})",
            entry.name,
            signed(entry.paired.mean, 1),
            p_is(entry.paired.p),
            p_value(entry.holm)
        )
    };
    entries.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// How many of them are up and how many down, by this p-value.
fn ways(entries: &[Entry], p: fn(&Entry) -> f64) -> [usize; 2] {
    let below = || entries.iter().filter(|entry| p(entry) < LEVEL);
    [1.0, -1.0].map(|sign| below().filter(|entry| sign * entry.paired.mean > 0.0).count())
}

/// Whether knowing on which side the robot is does as well as the safety levels.
pub(super) fn body_frame(analysis: &Analysis) -> Option<Finding> {
    let of = |set: &'static str| {
        move |model, experiment| analysis.person_accuracies(model, experiment, set)
    };
    let instead = family(of("d_body"), of("hrd"));
    let added = family(of("hrd_body"), of("d_body"));
    if instead.is_empty() || added.is_empty() {
        return None;
    }
    let verdict = verdict(analysis.people(), &instead);
    let all = instead.len();
    let higher = instead.iter().filter(|entry| entry.paired.mean > 0.0).count();
    let headline = match verdict {
        Verdict::Shown => {
            let [up, down] = ways(&instead, |entry| entry.holm);
            format!(
                "A body frame instead of the safety levels: better in {up} and worse in {down} of \
                 {all} comparisons after correction."
            )
        }
        Verdict::Hint => {
            let [up, down] = ways(&instead, |entry| entry.paired.p);
            format!(
                "Knowing where the robot is in the human’s body frame predicts more on average than \
                 the safety levels in {higher} of {all} comparisons ({up} with p &lt; 0.05 for it, \
                 {down} against it, none after correction)."
            )
        }
        _ => "Between a body frame and the safety levels no difference was shown.".to_owned(),
    };
    let [up, down] = ways(&added, |entry| entry.holm);
    let more = match (up, down) {
        (0, 0) => "that the safety levels add anything to it was not shown",
        (_, 0) => "safety levels add to it in some",
        (0, _) => "safety levels take away from it in some",
        _ => "safety levels add to it in some and take away in others",
    };
    let body = format!(
        "<p>The paper’s features do not say on which side the robot is; safety levels do in part. \
         Points of {} (distance and body frame) over {}: {}. Once the body frame is known, {more}; \
         {} over {}: {}. Holm over {all} tests each. A gain over distance alone is therefore no \
         evidence that people reckon with safety levels.</p>",
        words::set("d_body"),
        words::set("hrd"),
        said(&instead),
        words::set("hrd_body"),
        words::set("d_body"),
        said(&added)
    );
    Some(Finding { verdict, headline, body })
}

/// Whether models beat the person's commonest input.
pub(super) fn baseline(analysis: &Analysis) -> Option<Finding> {
    let entries = family(
        |model, experiment| analysis.person_accuracies(model, experiment, "hrd"),
        |_, experiment| analysis.person_baselines(experiment),
    );
    if entries.is_empty() {
        return None;
    }
    let people = analysis.people();
    let verdict = verdict(people, &entries);
    let all = entries.len();
    let headline = match verdict {
        Verdict::Shown => match ways(&entries, |entry| entry.holm) {
            [up, _] if up == all => "Every model beats always saying the person’s commonest \
                                     input."
                .to_owned(),
            [up, 0] => format!("Models beat the person’s commonest input in {up} of {all} cases."),
            [up, down] => format!(
                "Models beat the person’s commonest input in {up} of {all} cases, and lose to it in \
                 {down}."
            ),
        },
        Verdict::Hint => {
            let [up, down] = ways(&entries, |entry| entry.paired.p);
            format!(
                "Against always saying the person’s commonest input: {up} of {all} comparisons with \
                 p &lt; 0.05 for the model, {down} against it, none after correction."
            )
        }
        _ => {
            "That models beat always saying the person’s commonest input was not shown.".to_owned()
        }
    };
    let body = format!(
        "<p>Points of accuracy on {} over the baseline: {}. Holm over {all} tests.</p><p>{}</p>",
        words::set("hrd"),
        said(&entries),
        power(people, all)
    );
    Some(Finding { verdict, headline, body: body.replace("<p></p>", "") })
}

/// At the furthest horizon, beside who does not think.
pub(super) fn rollouts(analysis: &Analysis) -> Option<Finding> {
    let all = &analysis.rollouts;
    let furthest = |driver: &str, features: &str| -> Option<&Horizon> {
        let own = |of: &&RolloutsOf| of.driver == driver && of.features == features;
        all.iter().find(own)?.horizons.last()
    };
    let steps = all.first()?.horizons.len();
    let models: Vec<(&str, &Horizon)> = ModelName::PAPERS
        .into_iter()
        .filter_map(|model| Some((words::model(model), furthest(model.word(), "hrd")?)))
        .collect();
    let held = furthest(Simple::Held.word(), "")?;
    let straight = furthest(Simple::Straight.word(), "")?;
    if models.is_empty() {
        return None;
    }
    let seconds = fixed(analysis.context.step_s * steps as f64, 1);
    let count = models.len();
    let right = models.iter().filter(|(_, of)| of.accuracy() > held.accuracy()).count();
    let near =
        models.iter().filter(|(_, of)| of.mean_distance_m() < held.mean_distance_m()).count();
    let headline = format!(
        "{seconds} s ahead, {right} of {count} models name the input more often right than holding \
         the last one; {near} of {count} come closer to where the person was."
    );
    let one = |(name, of): (&str, &Horizon)| {
        let share = fixed(100.0 * of.accuracy(), 1);
        format!("{name} {share} % right, {} m off", fixed(of.mean_distance_m(), 2))
    };
    let simple = [("holding the last input", held), ("driving straight on", straight)];
    let said: Vec<String> = models.into_iter().chain(simple).map(one).collect();
    let body = format!(
        "<p>On {} {seconds} s ahead: {}. Pooled over people and {} overlapping windows, so that no \
         test is made.</p>",
        words::set("hrd"),
        said.join("; "),
        held.windows
    );
    Some(Finding { verdict: Verdict::Described, headline, body })
}

/// Whether the probabilities can be believed.
pub(super) fn calibration(analysis: &Analysis) -> Option<Finding> {
    let mut found = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let cells = analysis.comparison.of(model, experiment, "hrd");
            let all = Predictions::together(experiment.classes(), cells.map(|cell| &cell.test));
            if all.rows() > 0 {
                found.push((name(model, experiment), all.calibration()));
            }
        }
    }
    let errors = || found.iter().map(|(_, of)| 100.0 * of.calibration_error);
    let (low, high) = (errors().fold(f64::INFINITY, f64::min), errors().fold(0.0, f64::max));
    if found.is_empty() {
        return None;
    }
    let headline = format!(
        "Stated probabilities are off by {} to {} points on average.",
        fixed(low, 1),
        fixed(high, 1)
    );
    let one = |(name, of): &(String, sidestep::comparison::metrics::Calibration)| {
        format!(
            "{name} {} points, log loss {} nats",
            fixed(100.0 * of.calibration_error, 1),
            fixed(of.log_loss, 2)
        )
    };
    let said: Vec<String> = found.iter().map(one).collect();
    let body = format!(
        "<p>Expected calibration error on {}: {}. A model that is sure of nothing can be well \
         calibrated too: log loss counts both.</p>",
        words::set("hrd"),
        said.join("; ")
    );
    Some(Finding { verdict: Verdict::Described, headline, body })
}
