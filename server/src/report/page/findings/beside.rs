//! Findings beside the paper's own tests: the body frame, baselines, roll-outs, calibration.

use super::super::compare::{LEVEL, Paired, too_few};
use super::super::html::{Gain, fixed, gains, grouped, listed, signed};
use super::super::words;
use super::{Finding, Verdict, by, contrary, name, power};
use crate::report::Analysis;
use sidestep::comparison::RolloutsOf;
use sidestep::comparison::cell::{Experiment, HISTORY_SET, ModelName};
use sidestep::comparison::metrics::{Calibration, Predictions};
use sidestep::comparison::rollout::{Horizon, Simple};
use sidestep::stats::rank::holm;

/// A comparison of a model and experiment, with its p-value after Holm over its family.
pub(in crate::report) struct Entry {
    pub(in crate::report) model: ModelName,
    pub(in crate::report) experiment: Experiment,
    pub(in crate::report) paired: Paired,
    pub(in crate::report) holm: f64,
}

impl Entry {
    fn name(&self) -> String {
        name(self.model, self.experiment)
    }
}

/// The families of tests that are not of the paper: what is compared with what, and each model
/// and experiment. The last is the baseline, of no features.
pub(in crate::report) fn families(
    analysis: &Analysis,
) -> [(&'static str, &'static str, Vec<Entry>); 3] {
    [
        ("d_body", "hrd", sets(analysis, "d_body", "hrd")),
        ("hrd_body", "d_body", sets(analysis, "hrd_body", "d_body")),
        ("hrd", "none", over_baseline(analysis)),
    ]
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
            entries.extend(paired.map(|paired| Entry { model, experiment, paired, holm: 1.0 }));
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

/// The finding that these entries make: their gains, of which `about` says what they are, and
/// what comes `after`, as HTML.
fn told(people: usize, entries: &[Entry], headline: String, about: &str, after: &str) -> Finding {
    let one = |entry: &Entry| Gain {
        name: entry.name(),
        gain: signed(entry.paired.mean, 1),
        p_values: (!too_few(people)).then_some([entry.paired.p, entry.holm]),
    };
    let gains = gains(&entries.iter().map(one).collect::<Vec<_>>());
    let way = |entry: &Entry| {
        let Paired { p, mean, typical, .. } = entry.paired;
        (entry.name(), p, [mean, typical])
    };
    let contrary = contrary(people, entries.iter().map(way));
    let by = by(people, entries.len());
    let body = format!("<p>{about}{by}:</p>\n{gains}{contrary}{after}");
    Finding { verdict: verdict(people, entries), headline, body }
}

/// The names of those that are shown to be up (1) or down (−1), and of those that are neither.
fn shown(entries: &[Entry], sign: f64) -> Vec<String> {
    let is = |entry: &&Entry| entry.holm < LEVEL && sign * entry.paired.typical > 0.0;
    entries.iter().filter(is).map(Entry::name).collect()
}

fn not_shown(entries: &[Entry]) -> Vec<String> {
    let is = |entry: &&Entry| entry.holm >= LEVEL;
    entries.iter().filter(is).map(Entry::name).collect()
}

/// "better in SVM I and DT I; worse in LR I; no difference was shown in DT II".
fn in_words(entries: &[Entry], better: &str, worse: &str) -> String {
    let parts = [
        (better, shown(entries, 1.0)),
        (worse, shown(entries, -1.0)),
        ("no difference was shown in", not_shown(entries)),
    ];
    let said = parts.iter().filter(|(_, names)| !names.is_empty());
    said.map(|(what, names)| format!("{what} {}", listed(names))).collect::<Vec<_>>().join("; ")
}

/// How many of them are up and how many down, with p below 5 % before correction.
fn ways(entries: &[Entry]) -> [usize; 2] {
    let below = || entries.iter().filter(|entry| entry.paired.p < LEVEL);
    [1.0, -1.0].map(|sign| below().filter(|entry| sign * entry.paired.typical > 0.0).count())
}

/// One feature set over another.
fn sets(analysis: &Analysis, first: &str, second: &str) -> Vec<Entry> {
    let of = |set| move |model, experiment| analysis.person_accuracies(model, experiment, set);
    family(of(first), of(second))
}

/// B_hrd over the person's commonest input.
fn over_baseline(analysis: &Analysis) -> Vec<Entry> {
    family(
        |model, experiment| analysis.person_accuracies(model, experiment, "hrd"),
        |_, experiment| analysis.person_baselines(experiment),
    )
}

/// Whether knowing on which side the robot is does as well as the safety levels.
pub(super) fn body_frame_instead(analysis: &Analysis) -> Option<Finding> {
    let entries = sets(analysis, "d_body", "hrd");
    if entries.is_empty() {
        return None;
    }
    let people = analysis.people();
    let all = entries.len();
    let headline = match verdict(people, &entries) {
        Verdict::Shown => {
            format!(
                "Knowing where the robot is in the human’s body frame, instead of the safety \
                 levels, predicts {}.",
                in_words(&entries, "better in", "worse in")
            )
        }
        Verdict::Hint => {
            let [up, down] = ways(&entries);
            let higher = entries.iter().filter(|entry| entry.paired.mean > 0.0).count();
            format!(
                "Knowing where the robot is in the human’s body frame predicts more on average than \
                 the safety levels in {higher} of {all} comparisons ({up} with p &lt; 0.05 for it, \
                 {down} against it, none after correction)."
            )
        }
        Verdict::TooFew => "Too few people to show a difference between a body frame and the \
                            safety levels."
            .to_owned(),
        _ => "Between a body frame and the safety levels no difference was shown.".to_owned(),
    };
    let about = format!(
        "The paper’s features do not say on which side the robot is; safety levels do in part. \
         Points of accuracy of {} (distance and body frame) over {}",
        words::set("d_body"),
        words::set("hrd"),
    );
    let after = "<p>A gain over distance alone is by itself no evidence that people reckon with \
                 safety levels.</p>\n";
    Some(told(people, &entries, headline, &about, after))
}

/// Whether the safety levels still help where it is known on which side the robot is.
pub(super) fn body_frame_too(analysis: &Analysis) -> Option<Finding> {
    let entries = sets(analysis, "hrd_body", "d_body");
    if entries.is_empty() {
        return None;
    }
    let people = analysis.people();
    let all = entries.len();
    let headline = match verdict(people, &entries) {
        Verdict::Shown => format!(
            "Once the body frame is known, the safety levels {}.",
            in_words(&entries, "add to it in", "take away from it in")
        ),
        Verdict::Hint => {
            let [up, down] = ways(&entries);
            let said = words::either((up, "better"), (down, "worse"), all);
            format!(
                "Once the body frame is known, predictions with the safety levels look {said} than \
                 without, but not after correction."
            )
        }
        Verdict::TooFew => {
            "Too few people to show whether the safety levels add anything to a body frame."
                .to_owned()
        }
        _ => "That the safety levels add anything to a body frame was not shown.".to_owned(),
    };
    let about =
        format!("Points of accuracy of {} over {}", words::set("hrd_body"), words::set("d_body"));
    Some(told(people, &entries, headline, &about, ""))
}

/// Whether models beat the person's commonest input.
pub(super) fn baseline(analysis: &Analysis) -> Option<Finding> {
    let entries = over_baseline(analysis);
    if entries.is_empty() {
        return None;
    }
    let people = analysis.people();
    let all = entries.len();
    let headline = match verdict(people, &entries) {
        Verdict::Shown if shown(&entries, 1.0).len() == all => {
            "Every model beats always saying the person’s commonest input.".to_owned()
        }
        Verdict::Shown => format!(
            "Always saying the person’s commonest input {}.",
            in_words(&entries, "is beaten by", "beats")
        ),
        Verdict::Hint => {
            let [up, down] = ways(&entries);
            format!(
                "Against always saying the person’s commonest input: {up} of {all} comparisons with \
                 p &lt; 0.05 for the model, {down} against it, none after correction."
            )
        }
        Verdict::TooFew => "Too few people to show whether models beat always saying the person’s \
                            commonest input."
            .to_owned(),
        _ => {
            "That models beat always saying the person’s commonest input was not shown.".to_owned()
        }
    };
    let about = format!("Points of accuracy on {} over the baseline", words::set("hrd"));
    let after = format!("<p>{}</p>\n", power(people, all)).replace("<p></p>\n", "");
    Some(told(people, &entries, headline, &about, &after))
}

/// Models that know more than the paper's: driver, feature set and name.
const BEYOND: [(&str, &str, &str); 4] = [
    ("svm", "hrd_body", "SVM with body frame"),
    ("boosted", "hrd_body", "boosted trees"),
    ("lr", HISTORY_SET, "LR with memory"),
    ("boosted", HISTORY_SET, "boosted trees with memory"),
];

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
    let seconds = fixed(analysis.context.scene.step_s * steps as f64, 1);
    let beyond: Vec<(&str, &Horizon)> = BEYOND
        .into_iter()
        .filter_map(|(driver, set, name)| Some((name, furthest(driver, set)?)))
        .collect();
    let beat = |all: &[(&str, &Horizon)]| {
        let right = all.iter().filter(|(_, of)| of.accuracy() > held.accuracy()).count();
        let near = |of: &Horizon| of.mean_distance_m() < held.mean_distance_m();
        (right, all.iter().filter(|(_, of)| near(of)).count(), all.len())
    };
    let (right, near, count) = beat(&models);
    let mut headline = format!(
        "{seconds} s ahead, {right} of the paper’s {count} models name the input more often right \
         than holding the last one, and {near} of {count} come closer to where the person was."
    );
    if !beyond.is_empty() {
        let (right, near, count) = beat(&beyond);
        headline.push_str(&format!(
            " Of {count} that know more, {right} are more often right and {near} come closer."
        ));
    }
    let one = |(name, of): (&str, &Horizon)| {
        let share = fixed(100.0 * of.accuracy(), 1);
        let off = fixed(of.mean_distance_m(), 2);
        format!("<li><span>{name}</span><b>{share} %</b><small>{off} m off</small></li>\n")
    };
    let simple = [("holding the last input", held), ("driving straight on", straight)];
    let said: String = models.into_iter().chain(beyond).chain(simple).map(one).collect();
    let body = format!(
        "<p>SVM, DT and LR on {}, the others with the body frame; share of windows that were right {seconds} s ahead, and mean distance from \
         where the person was. Pooled over people and {} overlapping windows, so that no test is \
         made.</p>\n<ul class=\"gains\">\n{said}</ul>\n",
        words::set("hrd"),
        grouped(held.windows)
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
    let one = |(name, of): &(String, Calibration)| {
        let error = fixed(100.0 * of.calibration_error, 1);
        let loss = fixed(of.log_loss, 2);
        format!(
            "<li><span>{name}</span><b>{error} points</b><small>log loss {loss} nats</small></li>\n"
        )
    };
    let said: String = found.iter().map(one).collect();
    let body = format!(
        "<p>Expected calibration error on {}. A model that is sure of nothing can be well calibrated \
         too: log loss counts both.</p>\n<ul class=\"gains\">\n{said}</ul>\n",
        words::set("hrd")
    );
    Some(Finding { verdict: Verdict::Described, headline, body })
}
