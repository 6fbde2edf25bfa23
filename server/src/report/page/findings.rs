//! What was found, in words that say no more than the numbers.

mod beside;

use super::html::{GainItem, count, fixed, gains, listed, p_is, p_value, signed};
use super::words;
use sidestep::comparison::Analysis;
use sidestep::comparison::findings::{Answer, Verdict};
use sidestep::comparison::gains::{Gain, LEVEL, Power};
use sidestep::comparison::tables::Metric;

/// One finding; texts are HTML.
pub(super) struct Finding {
    pub(super) verdict: Verdict,
    pub(super) headline: String,
    pub(super) body: String,
}

/// A verdict as a reader sees it.
pub(super) fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Shown => "shown",
        Verdict::Hint => "a hint only",
        Verdict::NotShown => "no difference shown",
        Verdict::TooFew => "too few people",
        Verdict::Described => "described, not tested",
    }
}

/// The class of a verdict's sign.
pub(super) fn verdict_class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Shown => "shown",
        Verdict::Hint => "hint",
        Verdict::NotShown | Verdict::TooFew => "not",
        Verdict::Described => "described",
    }
}

/// All findings, the main one first.
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

/// "SVM I".
fn name(gain: &Gain) -> String {
    words::model_in(gain.model, gain.experiment)
}

fn names<'a>(gains: impl Iterator<Item = &'a Gain>) -> String {
    listed(&gains.map(name).collect::<Vec<_>>())
}

/// What an answer comes to, of "safety levels" over "distance alone".
fn headline(answer: &Answer, what: &str, over: &str) -> String {
    let shown = |sign| answer.shown(sign);
    let (better, worse) = (shown(1.0).count(), shown(-1.0).count());
    match answer.verdict {
        Verdict::Shown if worse == 0 && better == answer.gains.len() => {
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
            let ([up, _], all, of) = (answer.hinted(), answer.below_level(), answer.gains.len());
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
fn what_could_be_shown(power: Power) -> String {
    let Power { participants, family, least_p, least_p_after_holm, needed } = power;
    let who = count(participants, "person", "people");
    if power.is_too_low() {
        return format!(
            "With {who} the paired test cannot reach p &lt; 0.05 at all: its smallest p-value is \
             {least_p:.3}. It takes six people, and {needed} after correction for {family} tests."
        );
    }
    if least_p_after_holm >= LEVEL {
        return format!(
            "With {who} the smallest p-value that the paired test can give is {least_p:.3}, or \
             {least_p_after_holm:.3} after Holm over {family} tests: nothing could have passed; \
             with {needed} people or more it can."
        );
    }
    String::new()
}

fn safety_over_distance(analysis: &Analysis) -> Option<Finding> {
    let found = analysis.findings.safety_over_distance.as_ref()?;
    let (answer, test) = (&found.answer, &found.main);
    let Power { participants: n, family, .. } = answer.power;
    let Gain { model, experiment, paired, holm, .. } = &test.gain;
    let interval = paired.interval.map_or_else(String::new, |[low, high]| {
        format!(
            "; typical gain {}, with a 95 % interval of {} to {}",
            signed(paired.typical, 1),
            signed(low, 1),
            signed(high, 1)
        )
    });
    let sure = if answer.power.is_too_low() {
        String::new()
    } else {
        format!(
            " (better for {better} of {n} people{interval}; paired Wilcoxon over people {p}, after \
             Holm over {family} tests {holm}; Mann–Whitney over people, which ignores that they are \
             the same people and has {hardly} power with n = {n}, {u}, after Holm {u_holm})",
            better = paired.better(),
            p = p_is(paired.p),
            holm = p_value(*holm),
            hardly = if n < 12 { "hardly any" } else { "less" },
            u = p_is(test.mann_whitney_persons),
            u_holm = p_value(test.mann_whitney_persons_holm),
        )
    };
    let more = if paired.mean < 0.0 { "fewer" } else { "more" };
    let main = format!(
        "With safety levels and distance ({hrd}) {model} predicts {gain} points {more} of the steps \
         right than with distance alone ({d}) in experiment {numeral}: {with} against {without} \
         %{sure}.",
        hrd = words::set("hrd"),
        d = words::set("d"),
        model = words::model_in_full(*model),
        gain = fixed(paired.mean.abs(), 1),
        numeral = experiment.numeral(),
        with = fixed(found.accuracies[0], 1),
        without = fixed(found.accuracies[1], 1),
    );
    let body = format!(
        "<p>{main}</p>\n<p>Points of accuracy that safety levels gain{}:</p>\n{}<p>{}</p>\n",
        by(answer.power),
        gains_of(answer, points),
        what_could_be_shown(answer.power)
    ) + &contrary(answer);
    Some(Finding {
        verdict: answer.verdict,
        headline: headline(answer, "Safety levels", "distance alone"),
        body: body.replace("<p></p>\n", ""),
    })
}

/// A paragraph on the comparisons in which the mean points the other way than the typical gain;
/// empty where there is none.
pub(super) fn contrary(answer: &Answer) -> String {
    let turned = names(answer.contrary());
    if turned.is_empty() {
        return turned;
    }
    format!(
        "<p>In {turned} the mean points the other way than most people’s gains: a few people change \
         by more than all others together. The test, and what is said above, are about the typical \
         gain.</p>\n"
    )
}

/// The test and family of the p-values beside some gains, after "; "; empty where none are shown.
fn by(power: Power) -> String {
    if power.is_too_low() {
        return String::new();
    }
    format!(
        "; paired Wilcoxon over {}, and after Holm over {} tests",
        count(power.participants, "person", "people"),
        power.family
    )
}

/// The gains of an answer as HTML.
fn gains_of(answer: &Answer, said: impl Fn(&Gain) -> String) -> String {
    let one = |gain: &Gain| GainItem {
        name: match gain.metric {
            Metric::Accuracy => name(gain),
            Metric::Start | Metric::End => words::model(gain.model).to_owned(),
        },
        gain: said(gain),
        p_values: (!answer.power.is_too_low()).then_some([gain.paired.p, gain.holm]),
    };
    gains(&answer.gains.iter().map(one).collect::<Vec<_>>())
}

fn points(gain: &Gain) -> String {
    signed(gain.paired.mean, 1)
}

fn start_and_end(analysis: &Analysis) -> Option<Finding> {
    let found = analysis.findings.start_and_end.as_ref()?;
    let steps = |gain: &Gain| {
        let seconds = signed(gain.paired.mean * analysis.data.scene.step_s, 2);
        format!("{} steps <span>({seconds} s)</span>", signed(gain.paired.mean, 1))
    };
    let one = |(answer, word): (&Answer, &str)| {
        format!(
            "<p>How much nearer the {word} step of avoidance is with {} than with {}, \
             penalised{}:</p>\n{}{}",
            words::set("hrd"),
            words::set("d"),
            by(answer.power),
            gains_of(answer, steps),
            contrary(answer)
        )
    };
    let body = [(&found.start, "first"), (&found.end, "last")].map(one).concat();
    let headline = match found.verdict {
        Verdict::Shown => {
            let said = |(answer, place): (&Answer, &str)| {
                let shown = answer.gains.iter().filter(|gain| gain.holm < LEVEL);
                let said = shown.map(|gain| {
                    let way = if gain.is_shown(1.0) { "better" } else { "worse" };
                    format!("{} ({place}, {way})", words::model(gain.model))
                });
                said.collect::<Vec<_>>()
            };
            format!(
                "Safety levels change how well the start or end of avoidance is found: {}.",
                listed(&[(&found.start, "start"), (&found.end, "end")].map(said).concat())
            )
        }
        Verdict::Hint => {
            let sum = |count: fn(&Answer) -> usize| count(&found.start) + count(&found.end);
            let (nearer, below) = (sum(|answer| answer.hinted()[0]), sum(Answer::below_level));
            let said = words::either(
                (nearer, "nearer"),
                (below - nearer, "further off"),
                sum(|answer| answer.gains.len()),
            );
            format!(
                "With safety levels the start or end of avoidance looks {said} than with distance \
                 alone, but not after correction."
            )
        }
        Verdict::TooFew => {
            "Too few people to show whether safety levels change how well the start or end of \
             avoidance is found."
                .to_owned()
        }
        _ => "When avoidance starts or ends: no difference between safety levels and distance \
              alone was shown."
            .to_owned(),
    };
    Some(Finding { verdict: found.verdict, headline, body })
}

/// The paper says that the robot's safety level helps more than the human's.
fn which_level(analysis: &Analysis) -> Option<Finding> {
    let answer = analysis.findings.which_level.as_ref()?;
    let headline = match answer.verdict {
        Verdict::TooFew => {
            "Too few people to show whether the human’s or the robot’s safety level says more."
                .to_owned()
        }
        Verdict::NotShown => {
            "Whether the human’s or the robot’s safety level says more: no difference was shown."
                .to_owned()
        }
        _ => headline(answer, "The human’s safety levels", "the robot’s"),
    };
    let body = format!(
        "<p>Points of accuracy of {} over {}{}. The paper finds the robot’s level the better one in \
         general, without a test of it.</p>\n{}",
        words::set("h"),
        words::set("r"),
        by(answer.power),
        gains_of(answer, points)
    );
    Some(Finding { verdict: answer.verdict, headline, body })
}
