//! Checks every direction, count, p-value and interval in the findings of the report. The expected
//! numbers are computed here from the CSV files of the same analysis. The check fails if a sentence
//! has a number that is not expected here.

mod told;
mod headlines;

use self::headlines::{expected, verdict};
use self::told::{Files, Told, beside, fixed, listed, near, number, p_is, p_value};
use super::testing::made_up_but;
use proptest::prelude::*;
use roxmltree::{Document, Node, ParsingOptions};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Cell;
use sidestep::comparison::gains::Power;
use sidestep::comparison::models::ModelName;
use sidestep::math::SeededRng;
use std::collections::BTreeSet;

/// All texts that the first paragraph of the first finding can have. The numbers in the files are
/// rounded, so several printed values are possible.
fn main_sentences(files: &Files, of: &Told) -> BTreeSet<String> {
    let mean = |set| {
        let all = files.accuracies(&of.model, "1", set);
        all.iter().sum::<f64>() / all.len() as f64
    };
    let printed = |number: f64, print: fn(f64) -> String| -> BTreeSet<String> {
        near(number).map(print).into()
    };
    let one = |number: f64| fixed(number, 1);
    let (n, row) = (of.people, &of.row);
    let begin = "With safety levels and distance (B hrd) the support vector machine predicts the right input";
    let as_often = |points: String| match points.as_str() {
        "0.0" => " as often, to a tenth of a point, as".to_owned(),
        _ => format!(
            " in {points} points {} of the steps than",
            if of.mean < 0.0 { "fewer" } else { "more" }
        ),
    };
    let mut all: BTreeSet<String> = near(of.mean.abs()).map(|mean| as_often(one(mean))).into();
    let mut add = |words: &str, numbers: BTreeSet<String>| {
        let longer = |told: &String| {
            numbers.iter().map(|of| format!("{told}{words}{of}")).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(longer).collect();
    };
    add(" with distance alone (B d) in experiment I: ", printed(mean("hrd"), one));
    add(" against ", printed(mean("d"), one));
    if n >= 6 {
        let better = of.gains.iter().flatten().filter(|gain| **gain > 1e-9).count();
        let mut words = format!(" % (better for {better} of {n} people");
        if of.differing < n {
            let tied = n - of.differing;
            words += &format!("; {tied} of {n} with equal results, which count for the mean only");
        }
        if !row["gain_low"].is_empty() {
            add(&(words + "; typical gain "), printed(number(row, "typical_gain"), beside));
            add(", with a 95 % interval of ", printed(number(row, "gain_low"), beside));
            add(" to ", printed(number(row, "gain_high"), beside));
            words = String::new();
        }
        words += &format!(
            "; paired Wilcoxon over people {}, after Holm over 48 tests {}; Mann–Whitney over people, which ignores that \
             both numbers are of the same people and so usually has less power, {}, after Holm {}).",
            p_is(of.p),
            p_value(of.holm),
            p_is(number(row, "mann_whitney_persons")),
            p_value(number(row, "mann_whitney_persons_holm")),
        );
        add(&words, [String::new()].into());
    } else {
        add(" %.", [String::new()].into());
    }
    all.into_iter().map(|told| format!("{begin}{told}")).collect()
}

/// The sentence about too few people. The smallest p-value that the paired test can give is computed
/// here, independently of the report's code.
fn power_sentence(people: usize, family: usize) -> String {
    let least = (0..people).fold(2.0, |p: f64, _| 0.5 * p).min(1.0);
    let needed = (1..60).find(|n| 2.0 * 0.5_f64.powi(*n) * (family as f64) < 0.05).unwrap();
    let power = Power::of(people, family);
    let percent = |share: f64| format!("{} %", fixed(100.0 * share, 0));
    let enough = match power.enough {
        Some(enough) => format!("; {enough} people do with 80 %."),
        None => ", and more than 100 are needed for 80 %.".to_owned(),
    };
    let not_enough = format!(
        "{needed} are not enough: they show a large effect (a mean gain of 0.8 standard deviations) with a probability of \
         {}{enough}",
        percent(power.needed_shown)
    );
    let who = if people == 1 { "1 person".to_owned() } else { format!("{people} people") };
    if people < 6 {
        return format!(
            "With {who} the paired test cannot reach p < 0.05 at all: its smallest p-value is {}. Fewer than six \
             people can show nothing in one test, and fewer than {needed} nothing after the correction for {family} \
             tests. {not_enough}",
            p_value(least)
        );
    }
    format!(
        "With {who} the smallest p-value that the paired test can give is {}, or {} after Holm over {family} tests: no \
         difference could be shown. Fewer than {needed} people can show nothing after this correction. {not_enough}",
        fixed(least, 3),
        fixed((least * family as f64).min(1.0), 3)
    )
}

/// The text of an element, with a space between elements.
fn text(of: Node<'_, '_>) -> String {
    let parts = of.descendants().filter(Node::is_text).filter_map(|node| node.text());
    let all = parts.collect::<Vec<_>>().join(" ");
    let all = all.split_whitespace().collect::<Vec<_>>().join(" ");
    [(" )", ")"), ("( ", "("), (" ,", ","), (" .", "."), (" ;", ";")]
        .into_iter()
        .fold(all, |text, (from, to)| text.replace(from, to))
}

fn has_class(node: &Node<'_, '_>, class: &str) -> bool {
    node.attribute("class").is_some_and(|all| all.split(' ').any(|one| one == class))
}

/// Checks that every sentence of the findings about comparisons agrees with the files.
fn check(analysis: &Analysis) {
    let files = Files::of(analysis);
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(&files.0["report.html"], options).unwrap();
    let list = document.descendants().find(|node| has_class(node, "findings")).unwrap();
    let found: Vec<Node<'_, '_>> = list.children().filter(Node::is_element).collect();
    for (i, (headline, all)) in expected(&files).into_iter().enumerate() {
        let sign = found[i].descendants().find(|node| has_class(node, "verdict")).unwrap();
        let said = found[i].descendants().find(|node| has_class(node, "headline")).unwrap();
        assert_eq!(text(sign), verdict(&all), "{headline}");
        assert_eq!(text(said), format!("{} {headline}", verdict(&all)));
        let mut known: BTreeSet<String> = all.iter().flat_map(Told::entries).collect();
        let contrary: Vec<String> =
            all.iter().filter(|of| of.p < 0.05 && of.mean * of.r < 0.0).map(Told::name).collect();
        if i == 0 {
            known.extend(main_sentences(&files, &all[0]));
        }
        let (people, family) = (
            all[0].people,
            if [0, 5].contains(&i) {
                48
            } else if i == 4 {
                24
            } else {
                6
            },
        );
        let mut told: BTreeSet<String> = BTreeSet::new();
        if 2.0 * 0.5_f64.powi(people as i32) * family as f64 >= 0.05 {
            told.insert(power_sentence(people, family));
        }
        for metric in ["accuracy", "D_start", "D_end"] {
            let unable = all.iter().filter(|of| of.metric == metric && of.differing < 6);
            let unable: Vec<String> = unable.map(Told::full_name).collect();
            if people >= 6 && !unable.is_empty() {
                told.insert(format!(
                    "In {} fewer than six people differ, so that the test cannot give p < 0.05.",
                    listed(&unable)
                ));
            }
        }
        known.extend(told.iter().cloned());
        let tests =
            format!("paired Wilcoxon over {people} people, and after Holm over {family} tests");
        let mut turned = Vec::new();
        for block in
            found[i].descendants().filter(|node| ["p", "li"].contains(&node.tag_name().name()))
        {
            let said = text(block);
            told.remove(&said);
            if let Some(rest) = said.strip_prefix("In ")
                && let Some((names, _)) =
                    rest.split_once(" the mean points the other way than the test.")
            {
                turned.push(names.to_owned());
                continue;
            }
            let is_new =
                block != found[i] && !has_class(&block, "headline") && !known.contains(&said);
            let rest = said.replace(&tests, "");
            assert!(
                !is_new || !rest.contains(|c: char| c.is_ascii_digit()),
                "not expected: {said}\n{known:#?}"
            );
        }
        assert!(told.is_empty(), "{headline}: {told:?}");
        if i != 4 {
            let expected = if contrary.is_empty() { Vec::new() } else { vec![listed(&contrary)] };
            assert_eq!(turned, expected);
        }
    }
}

/// A study of random people. For some people, models do equally well on every feature set. For the
/// others, the sets differ by some steps.
fn random(people: usize, tied: f64, lean: usize, seed: u64) -> Analysis {
    made_up_but(people, None, |results| {
        let mut rng = SeededRng::new(seed);
        let ties: Vec<bool> = (0..people).map(|_| rng.unit() < tied).collect();
        for Cell { participant, test, features, model, .. } in &mut results.comparison.cells {
            test.predicted.clone_from(&test.truth);
            let known = usize::from(features.contains('h') && *model != ModelName::Lr);
            let missed =
                if ties[*participant] { 3 } else { 2 + rng.below(9) - (lean * known).min(2) };
            let rows = test.predicted.len();
            // Do not miss step 3, the first step of avoidance.
            (0..missed).for_each(|i| test.predicted[(7 + i) % rows] = 9);
        }
    })
}

#[test]
fn sentences_are_what_the_files_say() {
    for people in [2, 7, 24] {
        for lean in [0, 2] {
            check(&random(people, 0.3, lean, people as u64));
        }
        check(&made_up_but(people, None, |_| {}));
    }
}

/// For 18 of 24 people, models do equally well with every set. For the others, every model is better
/// with safety levels in the first case, and worse in the second case.
#[test]
fn those_who_tie_turn_no_sentence_round() {
    for (worse, word) in [("d", "better"), ("hrd", "worse")] {
        let analysis = made_up_but(24, None, |results| {
            for cell in &mut results.comparison.cells {
                cell.test.predicted.clone_from(&cell.test.truth);
                if cell.features == worse && cell.participant < 6 {
                    (0..=cell.participant).for_each(|step| cell.test.predicted[step] = 9);
                }
            }
        });
        check(&analysis);
        let html = &Files::of(&analysis).0["report.html"];
        let headline =
            format!("Safety levels look {word} than distance alone in 6 of 6 comparisons");
        assert!(html.contains(&headline), "{word}");
        assert!(html.contains("18 of 24 with equal results") && !html.contains("the other way"));
    }
}

/// Number of studies to generate: the value of `SENTENCE_STUDIES`, or six.
fn studies() -> u32 {
    std::env::var("SENTENCE_STUDIES").map_or(6, |number| number.parse().unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(studies()))]

    #[test]
    fn no_sentence_contradicts_the_numbers(
        people in 4usize..=40, tied in 0.0..0.8f64, lean in 0usize..3, seed in any::<u64>()
    ) {
        check(&random(people, tied, lean, seed));
    }
}
