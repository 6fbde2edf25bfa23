//! What was found, in words that say no more than the numbers.

mod beside;

pub(in crate::report) use beside::families;

use super::compare::{LEVEL, Paired, least_p, mean, people_needed, too_few};
use super::html::{Gain, count, fixed, gains, listed, p_is, p_value, signed};
use super::words;
use crate::report::Analysis;
use sidestep::comparison::cell::{Experiment, ModelName};
use sidestep::comparison::tables::{Metric, Test};

/// One answer; texts are HTML.
pub(super) struct Finding {
    pub(super) verdict: Verdict,
    pub(super) headline: String,
    pub(super) body: String,
}

/// How sure it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// p below 5 % for some of the card's tests, after correction for all of their family.
    Shown,
    /// p below 5 % for some of the card's tests, but for none after correction.
    Hint,
    /// No p below 5 %.
    NotShown,
    /// Fewer people than any test needs.
    TooFew,
    /// No test is made.
    Described,
}

impl Verdict {
    /// As a reader sees it.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Shown => "shown",
            Self::Hint => "a hint only",
            Self::NotShown => "no difference shown",
            Self::TooFew => "too few people",
            Self::Described => "described, not tested",
        }
    }

    /// The class of its sign.
    pub(super) fn class(self) -> &'static str {
        match self {
            Self::Shown => "shown",
            Self::Hint => "hint",
            Self::NotShown | Self::TooFew => "not",
            Self::Described => "described",
        }
    }

    /// Of all p-values of a card, of `people` people, each with itself after correction.
    fn of(people: usize, p_values: impl Iterator<Item = (f64, f64)>) -> Self {
        let (raw, corrected) = p_values.fold((1.0f64, 1.0f64), |(raw, corrected), (p, after)| {
            (raw.min(p), corrected.min(after))
        });
        if corrected < LEVEL {
            Self::Shown
        } else if too_few(people) {
            Self::TooFew
        } else if raw < LEVEL {
            Self::Hint
        } else {
            Self::NotShown
        }
    }
}

/// All of them, the main one first.
pub(super) fn findings(analysis: &Analysis) -> Vec<Finding> {
    let all = [
        safety_over_distance(analysis),
        beside::body_frame_instead(analysis),
        beside::body_frame_too(analysis),
        beside::baseline(analysis),
        start_and_end(analysis),
        which_level(analysis),
        beside::rollouts(analysis),
        beside::calibration(analysis),
    ];
    all.into_iter().flatten().collect()
}

/// The tests of one metric and pair, and how many are in their family.
fn tests<'a>(analysis: &'a Analysis, metric: Metric, pair: (&str, &str)) -> (Vec<&'a Test>, usize) {
    let family = analysis.tests.iter().filter(|test| test.metric == metric);
    let of_pair = family.clone().filter(|test| (test.first, test.second) == pair);
    let mut of_pair: Vec<&Test> = of_pair.collect();
    // In the order in which everything else is told.
    of_pair.sort_by_key(|test| test.experiment);
    (of_pair, family.count())
}

/// "SVM I".
fn name(model: ModelName, experiment: Experiment) -> String {
    format!("{} {}", words::model(model), experiment.numeral())
}

fn names<'a>(tests: impl Iterator<Item = &'a Test>) -> String {
    listed(&tests.map(|test| name(test.model, test.experiment)).collect::<Vec<_>>())
}

/// What the verdict on some tests comes to, of "safety levels" over "distance alone".
fn headline(verdict: Verdict, tests: &[&Test], what: &str, over: &str) -> String {
    let shown = |sign: f64| {
        tests.iter().copied().filter(move |test| {
            test.wilcoxon_persons_holm < LEVEL && sign * test.typical_gain > 0.0
        })
    };
    let (better, worse) = (shown(1.0).count(), shown(-1.0).count());
    match verdict {
        Verdict::Shown if worse == 0 && better == tests.len() => {
            format!("{what} predict better than {over}, in every model and experiment.")
        }
        Verdict::Shown if worse == 0 => {
            format!("{what} predict better than {over} in {}.", names(shown(1.0)))
        }
        Verdict::Shown if better == 0 => {
            format!("{what} predict worse than {over} in {}.", names(shown(-1.0)))
        }
        Verdict::Shown => format!(
            "{what} predict better than {over} in {}, and worse in {}.",
            names(shown(1.0)),
            names(shown(-1.0))
        ),
        Verdict::Hint => {
            let below = tests.iter().copied().filter(|test| test.wilcoxon_persons < LEVEL);
            let up = below.clone().filter(|test| test.typical_gain > 0.0).count();
            let (all, of) = (below.count(), tests.len());
            let way = match up {
                0 => "worse",
                up if up == all => "better",
                _ => "different",
            };
            format!(
                "{what} look {way} than {over} in {all} of {of} comparisons, but not after \
                 correction for the number of tests."
            )
        }
        Verdict::NotShown => format!("No difference between {} and {over} was shown.", lower(what)),
        Verdict::TooFew => {
            format!("Too few people to show whether {} predict better than {over}.", lower(what))
        }
        Verdict::Described => String::new(),
    }
}

fn lower(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

/// What a test of so many people could have shown.
fn power(people: usize, family: usize) -> String {
    let least = least_p(people);
    let after = (least * family as f64).min(1.0);
    let who = count(people, "person", "people");
    if too_few(people) {
        return format!(
            "With {who} the paired test cannot reach p &lt; 0.05 at all: its smallest p-value is \
             {least:.3}. It takes six people, and {} after correction for {family} tests.",
            people_needed(family)
        );
    }
    if after >= LEVEL {
        return format!(
            "With {who} the smallest p-value that the paired test can give is {least:.3}, or \
             {after:.3} after Holm over {family} tests: nothing could have passed; with {} people \
             or more it can.",
            people_needed(family)
        );
    }
    String::new()
}

fn safety_over_distance(analysis: &Analysis) -> Option<Finding> {
    let (tests, family) = tests(analysis, Metric::Accuracy, ("hrd", "d"));
    let p_values = tests.iter().map(|test| (test.wilcoxon_persons, test.wilcoxon_persons_holm));
    let verdict = Verdict::of(analysis.people(), p_values);
    let first = *tests.first()?;
    let of = |set| analysis.person_accuracies(first.model, first.experiment, set);
    let (with, without) = (of("hrd"), of("d"));
    let paired = Paired::of(&with, &without)?;
    let n = analysis.people();
    let interval = paired.interval.map_or_else(String::new, |[low, high]| {
        format!(
            "; typical gain {}, with a 95 % interval of {} to {}",
            signed(first.typical_gain, 1),
            signed(low, 1),
            signed(high, 1)
        )
    });
    let sure = if too_few(n) {
        String::new()
    } else {
        format!(
            " (better for {better} of {n} people{interval}; paired Wilcoxon over people {p}, after \
             Holm over {family} tests {holm}; Mann–Whitney over people, which ignores that they are \
             the same people and has {hardly} power with n = {n}, {u}, after Holm {u_holm})",
            better = paired.better(),
            p = p_is(first.wilcoxon_persons),
            holm = p_value(first.wilcoxon_persons_holm),
            hardly = if n < 12 { "hardly any" } else { "less" },
            u = p_is(first.mann_whitney_persons),
            u_holm = p_value(first.mann_whitney_persons_holm),
        )
    };
    let more = if first.gain < 0.0 { "fewer" } else { "more" };
    let main = format!(
        "With safety levels and distance ({hrd}) {model} predicts {gain} points {more} of the steps \
         right than with distance alone ({d}) in experiment {numeral}: {with} against {without} \
         %{sure}.",
        hrd = words::set("hrd"),
        d = words::set("d"),
        model = words::model_in_full(first.model),
        gain = fixed(first.gain.abs(), 1),
        numeral = first.experiment.numeral(),
        with = fixed(mean(&with), 1),
        without = fixed(mean(&without), 1),
    );
    let headline = headline(verdict, &tests, "Safety levels", "distance alone");
    let body = format!(
        "<p>{main}</p>\n<p>Points of accuracy that safety levels gain{}:</p>\n{}<p>{}</p>\n",
        by(n, family),
        gains_of(n, &tests, points),
        power(n, family)
    ) + &contrary(n, tests.iter().map(ways));
    Some(Finding { verdict, headline, body: body.replace("<p></p>\n", "") })
}

/// A comparison's name, p-value, and mean and typical gain.
pub(super) type Ways = (String, f64, [f64; 2]);

/// Says of which comparisons below [`LEVEL`] the mean points the other way than the typical gain,
/// in a paragraph; nothing where there is none.
pub(super) fn contrary(people: usize, comparisons: impl Iterator<Item = Ways>) -> String {
    let turned = comparisons
        .filter(|(_, p, [mean, typical])| *p < LEVEL && mean * typical <= 0.0 && !too_few(people));
    let turned: Vec<String> = turned.map(|(name, ..)| name).collect();
    if turned.is_empty() {
        return String::new();
    }
    format!(
        "<p>In {} the mean points the other way than most people’s gains: a few people change by \
         more than all others together. The test, and what is said above, are about the typical \
         gain.</p>\n",
        listed(&turned)
    )
}

fn ways(test: &&Test) -> Ways {
    let gains = [test.gain, test.typical_gain];
    (name(test.model, test.experiment), test.wilcoxon_persons, gains)
}

/// What the p-values beside some gains are of, after "; "; nothing where none are shown.
fn by(people: usize, family: usize) -> String {
    if too_few(people) {
        return String::new();
    }
    format!(
        "; paired Wilcoxon over {}, and after Holm over {family} tests",
        count(people, "person", "people")
    )
}

/// The gains of some tests of so many people, as HTML.
fn gains_of(people: usize, tests: &[&Test], gain: impl Fn(&Test) -> String) -> String {
    let one = |test: &&Test| Gain {
        name: match test.metric {
            Metric::Accuracy => name(test.model, test.experiment),
            Metric::Start | Metric::End => words::model(test.model).to_owned(),
        },
        gain: gain(test),
        p_values: (!too_few(people)).then_some([test.wilcoxon_persons, test.wilcoxon_persons_holm]),
    };
    gains(&tests.iter().map(one).collect::<Vec<_>>())
}

fn points(test: &Test) -> String {
    signed(test.gain, 1)
}

fn start_and_end(analysis: &Analysis) -> Option<Finding> {
    let mut body = String::new();
    let (mut all, mut p_values) = (Vec::new(), Vec::new());
    for (metric, word) in [(Metric::Start, "first"), (Metric::End, "last")] {
        let (tests, family) = tests(analysis, metric, ("hrd", "d"));
        let steps = |test: &Test| {
            let seconds = signed(test.gain * analysis.context.scene.step_s, 2);
            format!("{} steps <span>({seconds} s)</span>", signed(test.gain, 1))
        };
        body.push_str(&format!(
            "<p>How much nearer the {word} step of avoidance is with {} than with {}, \
             penalised{}:</p>\n{}",
            words::set("hrd"),
            words::set("d"),
            by(analysis.people(), family),
            gains_of(analysis.people(), &tests, steps)
        ));
        p_values
            .extend(tests.iter().map(|test| (test.wilcoxon_persons, test.wilcoxon_persons_holm)));
        body.push_str(&contrary(analysis.people(), tests.iter().map(ways)));
        all.extend(tests);
    }
    if all.is_empty() {
        return None;
    }
    let verdict = Verdict::of(analysis.people(), p_values.into_iter());
    let headline = match verdict {
        Verdict::Shown => {
            let shown = all.iter().filter(|test| test.wilcoxon_persons_holm < LEVEL);
            let said = shown.map(|test| {
                let place = if test.metric == Metric::Start { "start" } else { "end" };
                let way = if test.typical_gain > 0.0 { "better" } else { "worse" };
                format!("{} ({place}, {way})", words::model(test.model))
            });
            format!(
                "Safety levels change how well the start or end of avoidance is found: {}.",
                listed(&said.collect::<Vec<_>>())
            )
        }
        Verdict::Hint => {
            let below = || all.iter().filter(|test| test.wilcoxon_persons < LEVEL);
            let nearer = below().filter(|test| test.typical_gain > 0.0).count();
            let said = super::words::either(
                (nearer, "nearer"),
                (below().count() - nearer, "further off"),
                all.len(),
            );
            format!(
                "With safety levels the start or end of avoidance looks {said} than with distance \
                 alone, but not after correction."
            )
        }
        Verdict::TooFew => {
            "Too few people to show whether safety levels change how well the start \
                            or end of avoidance is found."
                .to_owned()
        }
        _ => "When avoidance starts or ends: no difference between safety levels and distance \
              alone was shown."
            .to_owned(),
    };
    Some(Finding { verdict, headline, body })
}

/// The paper says that the robot's safety level helps more than the human's.
fn which_level(analysis: &Analysis) -> Option<Finding> {
    let (tests, family) = tests(analysis, Metric::Accuracy, ("h", "r"));
    if tests.is_empty() {
        return None;
    }
    let p_values = tests.iter().map(|test| (test.wilcoxon_persons, test.wilcoxon_persons_holm));
    let verdict = Verdict::of(analysis.people(), p_values);
    let headline = match verdict {
        Verdict::TooFew => {
            "Too few people to show whether the human’s or the robot’s safety level says more."
                .to_owned()
        }
        Verdict::NotShown => {
            "Whether the human’s or the robot’s safety level says more: no difference was shown."
                .to_owned()
        }
        _ => headline(verdict, &tests, "The human’s safety levels", "the robot’s"),
    };
    let body = format!(
        "<p>Points of accuracy of {} over {}{}. The paper finds the robot’s level the better one in \
         general, without a test of it.</p>\n{}",
        words::set("h"),
        words::set("r"),
        by(analysis.people(), family),
        gains_of(analysis.people(), &tests, points)
    );
    Some(Finding { verdict, headline, body })
}
