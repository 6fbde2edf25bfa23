//! Findings beside the paper's own tests: the body frame, baselines, roll-outs, calibration.

use super::super::html::{fixed, grouped};
use super::super::words;
use super::{Finding, by, contrary, gains_of, names, points, what_could_be_shown};
use sidestep::comparison::Analysis;
use sidestep::comparison::findings::{Answer, BEYOND, Verdict};
use sidestep::comparison::metrics::Calibration;
use sidestep::comparison::rollout::Horizon;

/// The finding that an answer makes: its gains, which `about` introduces, and what comes `after`,
/// as HTML.
fn told(answer: &Answer, headline: String, about: &str, after: &str) -> Finding {
    let (by, gains, contrary) = (by(answer.power), gains_of(answer, points), contrary(answer));
    let body = format!("<p>{about}{by}:</p>\n{gains}{contrary}{after}");
    Finding { verdict: answer.verdict, headline, body }
}

/// "better in SVM I and DT I; worse in LR I; no difference was shown in DT II".
fn in_words(answer: &Answer, better: &str, worse: &str) -> String {
    let parts = [
        (better, names(answer.shown(1.0))),
        (worse, names(answer.shown(-1.0))),
        ("no difference was shown in", names(answer.not_shown())),
    ];
    let said = parts.iter().filter(|(_, names)| !names.is_empty());
    said.map(|(what, names)| format!("{what} {names}")).collect::<Vec<_>>().join("; ")
}

/// Whether knowing on which side the robot is does as well as the safety levels.
pub(super) fn body_frame_instead(analysis: &Analysis) -> Option<Finding> {
    let answer = analysis.findings.body_frame_instead.as_ref()?;
    let all = answer.gains.len();
    let headline = match answer.verdict {
        Verdict::Shown => {
            format!(
                "Knowing where the robot is in the human’s body frame, instead of the safety \
                 levels, predicts {}.",
                in_words(answer, "better in", "worse in")
            )
        }
        Verdict::Hint => {
            let [up, down] = answer.hinted();
            let higher = answer.higher_on_average();
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
    Some(told(answer, headline, &about, after))
}

/// Whether the safety levels still help where it is known on which side the robot is.
pub(super) fn body_frame_too(analysis: &Analysis) -> Option<Finding> {
    let answer = analysis.findings.body_frame_too.as_ref()?;
    let all = answer.gains.len();
    let headline = match answer.verdict {
        Verdict::Shown => format!(
            "Once the body frame is known, the safety levels {}.",
            in_words(answer, "add to it in", "take away from it in")
        ),
        Verdict::Hint => {
            let [up, down] = answer.hinted();
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
    Some(told(answer, headline, &about, ""))
}

/// Whether models beat the person's commonest input.
pub(super) fn baseline(analysis: &Analysis) -> Option<Finding> {
    let answer = analysis.findings.over_baseline.as_ref()?;
    let all = answer.gains.len();
    let headline = match answer.verdict {
        Verdict::Shown if answer.shown(1.0).count() == all => {
            "Every model beats always saying the person’s commonest input.".to_owned()
        }
        Verdict::Shown => format!(
            "Always saying the person’s commonest input {}.",
            in_words(answer, "is beaten by", "beats")
        ),
        Verdict::Hint => {
            let [up, down] = answer.hinted();
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
    let after = format!("<p>{}</p>\n", what_could_be_shown(answer.power)).replace("<p></p>\n", "");
    Some(told(answer, headline, &about, &after))
}

/// The names of the models of [`BEYOND`].
const BEYOND_NAMES: [&str; BEYOND.len()] =
    ["SVM with body frame", "boosted trees", "LR with memory", "boosted trees with memory"];

/// At the furthest horizon, beside simple drivers.
pub(super) fn rollouts(analysis: &Analysis) -> Option<Finding> {
    let found = analysis.findings.rollouts.as_ref()?;
    let seconds = fixed(analysis.data.scene.step_s * found.steps as f64, 1);
    let (papers, beyond) = (found.papers_beaten, found.beyond_beaten);
    let mut headline = format!(
        "{seconds} s ahead, {} of the paper’s {} models name the input more often right than \
         holding the last one, and {} of {} come closer to where the person was.",
        papers.more_often_right, papers.of, papers.closer, papers.of
    );
    if beyond.of > 0 {
        headline.push_str(&format!(
            " Of {} models with extra features, {} are more often right and {} come closer.",
            beyond.of, beyond.more_often_right, beyond.closer
        ));
    }
    let one = |name: &str, of: &Horizon| {
        let share = fixed(100.0 * of.accuracy(), 1);
        let off = fixed(of.mean_distance_m(), 2);
        format!("<li><span>{name}</span><b>{share} %</b><small>{off} m off</small></li>\n")
    };
    let name_of = |driver, set| {
        let place = BEYOND.iter().position(|of| *of == (driver, set));
        place.map_or(driver, |place| BEYOND_NAMES[place])
    };
    let mut said = String::new();
    said.extend(found.papers.iter().map(|(model, of)| one(words::model(*model), of)));
    said.extend(found.beyond.iter().map(|(driver, set, of)| one(name_of(driver, set), of)));
    said.push_str(&one("holding the last input", &found.held));
    said.push_str(&one("driving straight on", &found.straight));
    let body = format!(
        "<p>SVM, DT and LR on {}, the others with the body frame; share of windows that were right \
         {seconds} s ahead, and mean distance from where the person was. Pooled over people and {} \
         overlapping windows, so that no test is made.</p>\n<ul class=\"gains\">\n{said}</ul>\n",
        words::set("hrd"),
        grouped(found.held.windows)
    );
    Some(Finding { verdict: Verdict::Described, headline, body })
}

/// Whether the probabilities can be believed.
pub(super) fn calibration(analysis: &Analysis) -> Option<Finding> {
    let found = analysis.findings.calibration.as_ref()?;
    let [low, high] = found.errors.map(|error| fixed(100.0 * error, 1));
    let headline = format!("Stated probabilities are off by {low} to {high} points on average.");
    let one = |(name, of): (String, &Calibration)| {
        let error = fixed(100.0 * of.calibration_error, 1);
        let loss = fixed(of.log_loss, 2);
        format!(
            "<li><span>{name}</span><b>{error} points</b><small>log loss {loss} nats</small></li>\n"
        )
    };
    let entries = found.entries.iter();
    let entries = entries.map(|(model, of, found)| (words::model_in(*model, *of), found));
    let said: String = entries.map(one).collect();
    let body = format!(
        "<p>Expected calibration error on {}. A model that is sure of nothing can be well calibrated \
         too: log loss counts both.</p>\n<ul class=\"gains\">\n{said}</ul>\n",
        words::set("hrd")
    );
    Some(Finding { verdict: Verdict::Described, headline, body })
}
