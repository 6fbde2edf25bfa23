//! The headline that each finding must have.

use super::told::{Files, Told, listed};

fn that(all: &[Told], way: &str, p: fn(&Told) -> f64) -> Vec<String> {
    all.iter().filter(|of| of.way(p(of)) == way).map(Told::name).collect()
}

fn before(of: &Told) -> f64 {
    of.p
}

fn after(of: &Told) -> f64 {
    of.holm
}

pub(super) fn verdict(all: &[Told]) -> &'static str {
    match all {
        _ if all.iter().any(|of| of.holm < 0.05) => "shown",
        _ if all.iter().any(|of| of.p < 0.05) => "a hint only",
        _ if all.iter().all(|of| of.differing < 6) => "too few people",
        _ => "no difference shown",
    }
}

fn each_way(all: &[Told], better: &str, worse: &str) -> String {
    let parts = [
        (better, "better"),
        (worse, "worse"),
        ("no difference was shown after correction in", "open"),
    ];
    let part = |(words, way): (&str, &str)| match &that(all, way, after)[..] {
        [] => None,
        names => Some(format!("{words} {}", listed(names))),
    };
    parts.into_iter().filter_map(part).collect::<Vec<_>>().join("; ")
}

fn either(all: &[Told], better: &str, worse: &str) -> String {
    let counts = ["better", "worse"].map(|way| that(all, way, before).len());
    let words = match counts {
        [up, 0] => format!("{better} in {up}"),
        [0, down] => format!("{worse} in {down}"),
        [up, down] => format!("{better} in {up} and {worse} in {down}"),
    };
    format!("{words} of {} comparisons", all.len())
}

fn over(all: &[Told], what: &str, other: &str) -> String {
    let begin = format!("{}{}", what[..1].to_uppercase(), &what[1..]);
    let [better, worse] = ["better", "worse"].map(|way| that(all, way, after));
    match verdict(all) {
        "shown" if better.len() == all.len() => {
            format!("{begin} predict better than {other}, in every model and experiment.")
        }
        "shown" if worse.is_empty() => {
            format!("{begin} predict better than {other} in {}.", listed(&better))
        }
        "shown" if better.is_empty() => {
            format!("{begin} predict worse than {other} in {}.", listed(&worse))
        }
        "shown" => format!(
            "{begin} predict better than {other} in {}, and worse in {}.",
            listed(&better),
            listed(&worse)
        ),
        "a hint only" => {
            let [up, down] = ["better", "worse"].map(|way| that(all, way, before).len());
            let word = if down == 0 {
                "better than"
            } else if up == 0 {
                "worse than"
            } else {
                "different from"
            };
            let (some, of) = (up + down, all.len());
            format!(
                "{begin} look {word} {other} in {some} of {of} comparisons, but not after correction for the number \
                 of tests."
            )
        }
        "too few people" => {
            format!("Too few people to show whether {what} predict better than {other}.")
        }
        _ => format!("No difference between {what} and {other} was shown."),
    }
}

fn chosen(all: &[Told], [shown, hint, few, none]: [String; 4]) -> String {
    match verdict(all) {
        "shown" => shown,
        "a hint only" => hint,
        "too few people" => few,
        _ => none,
    }
}

/// The expected headline of each finding about a comparison, in order. Each headline is returned
/// with the comparisons that determine it.
pub(super) fn expected(files: &Files) -> Vec<(String, Vec<Told>)> {
    let of = |file: &str, pair| Told::all(files, file, "accuracy", pair);
    let safety = of("tests.csv", ("hrd", "d"));
    let instead = of("beside.csv", ("d_body", "hrd"));
    let too = of("beside.csv", ("hrd_body", "d_body"));
    let baseline = of("beside.csv", ("hrd", "none"));
    let mut ends = Told::all(files, "tests.csv", "D_start", ("hrd", "d"));
    ends.extend(Told::all(files, "tests.csv", "D_end", ("hrd", "d")));
    let level = of("tests.csv", ("h", "r"));
    let frame = "the robot’s position in the human’s body frame instead of the safety levels";
    let commonest = "always predicting the person’s commonest input";
    let shown_ends: Vec<String> = ends
        .iter()
        .filter(|of| of.holm < 0.05)
        .map(|of| {
            let word = if of.metric == "D_start" { "start" } else { "end" };
            format!("{} ({word}, {})", of.name(), of.way(of.holm))
        })
        .collect();
    let headlines = [
        over(&safety, "safety levels", "distance alone"),
        chosen(&instead, [
            format!("With {frame}, models predict {}.", each_way(&instead, "better in", "worse in")),
            format!(
                "With {frame}, predictions look {}, but not after correction.",
                either(&instead, "better", "worse")
            ),
            "Too few people to show a difference between the body frame and the safety levels.".to_owned(),
            "No difference between the body frame and the safety levels was shown.".to_owned(),
        ]),
        chosen(&too, [
            format!(
                "Once the body frame is known, the safety levels {}.",
                each_way(&too, "improve predictions in", "worsen them in")
            ),
            format!(
                "Once the body frame is known, predictions with the safety levels look {} than without, but not \
                 after correction.",
                either(&too, "better", "worse")
            ),
            "Too few people to show whether the safety levels add anything to the body frame.".to_owned(),
            "It was not shown that the safety levels add anything to the body frame.".to_owned(),
        ]),
        chosen(&baseline, [
            match that(&baseline, "better", after).len() == baseline.len() {
                true => format!("Every model does better than {commonest}."),
                false => format!(
                    "Compared with {commonest}, models are {}.",
                    each_way(&baseline, "better in", "worse in")
                ),
            },
            format!(
                "Models look {} than {commonest}, but not after correction.",
                either(&baseline, "better", "worse")
            ),
            format!("Too few people to show whether models do better than {commonest}."),
            format!("It was not shown that models do better than {commonest}."),
        ]),
        chosen(&ends, [
            format!(
                "Safety levels change how well models find the start or end of avoidance: {}.",
                listed(&shown_ends)
            ),
            format!(
                "With safety levels, the predicted start or end of avoidance looks {} than with distance alone, but \
                 not after correction.",
                either(&ends, "nearer", "further off")
            ),
            "Too few people to show whether safety levels change how well models find the start or end of avoidance."
                .to_owned(),
            "For the start and end of avoidance, no difference between safety levels and distance alone was shown."
                .to_owned(),
        ]),
        match verdict(&level) {
            "too few people" => {
                "Too few people to show whether the human’s or the robot’s safety level predicts better.".to_owned()
            }
            "no difference shown" => {
                "No difference between the human’s and the robot’s safety level was shown.".to_owned()
            }
            _ => over(&level, "models with the human’s safety level", "those with the robot’s"),
        },
    ];
    headlines.into_iter().zip([safety, instead, too, baseline, ends, level]).collect()
}
