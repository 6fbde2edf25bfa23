//! Checks every direction, count, p-value and interval in the findings of the report. The expected
//! numbers are computed here from the CSV files of the same analysis. The check fails if a sentence
//! has a number that is not expected here.

use super::testing::made_up_but;
use crate::report::{Content, each_file};
use proptest::prelude::*;
use roxmltree::{Document, Node, ParsingOptions};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Cell;
use sidestep::comparison::gains::Power;
use sidestep::comparison::models::ModelName;
use sidestep::math::SeededRng;
use std::collections::{BTreeMap, BTreeSet};

type Row = BTreeMap<String, String>;

/// The files of an analysis.
struct Files(BTreeMap<String, String>);

impl Files {
    fn of(analysis: &Analysis) -> Self {
        let mut files = BTreeMap::new();
        let mut put = |name: &str, content: Content<'_>| {
            let mut text = Vec::new();
            content(&mut text)?;
            files.insert(name.to_owned(), String::from_utf8(text).unwrap());
            Ok(())
        };
        each_file(analysis, &mut put).unwrap();
        Self(files)
    }

    fn rows(&self, name: &str) -> Vec<Row> {
        let rows = csv::Reader::from_reader(self.0[name].as_bytes()).into_deserialize();
        rows.map(Result::unwrap).collect()
    }

    /// The accuracy of each person, in per cent.
    fn accuracies(&self, model: &str, experiment: &str, features: &str) -> Vec<f64> {
        let is = |row: &Row| {
            (&*row["model"], &*row["experiment"], &*row["features"])
                == (model, experiment, features)
        };
        let own = self.rows("cells.csv").into_iter().filter(is);
        own.map(|row| 100.0 * row["test_accuracy"].parse::<f64>().unwrap()).collect()
    }
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

/// A comparison of two feature sets, read from the files.
struct Told {
    model: String,
    numeral: &'static str,
    metric: String,
    people: usize,
    /// The gains, if cells.csv has them.
    gains: Option<Vec<f64>>,
    mean: f64,
    p: f64,
    holm: f64,
    r: f64,
    differing: usize,
    row: Row,
}

const MODELS: [(&str, &str); 3] = [("svm", "SVM"), ("dt", "DT"), ("lr", "LR")];

impl Told {
    fn all(files: &Files, file: &str, metric: &str, (first, second): (&str, &str)) -> Vec<Self> {
        let people: BTreeSet<String> = files
            .rows("cells.csv")
            .into_iter()
            .map(|mut row| row.remove("participant").unwrap())
            .collect();
        let mut all = Vec::new();
        for (experiment, numeral) in [("1", "I"), ("2", "II")] {
            for (model, _) in MODELS {
                let is = |row: &Row| {
                    (&*row["model"], &*row["experiment"], &*row["first"], &*row["second"])
                        == (model, experiment, first, second)
                        && row.get("metric").is_none_or(|of| of == metric)
                };
                let Some(row) = files.rows(file).into_iter().find(is) else { continue };
                let gains = (metric == "accuracy" && second != "none").then(|| {
                    let [a, b] =
                        [first, second].map(|set| files.accuracies(model, experiment, set));
                    a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>()
                });
                let n = |column| number(&row, column);
                let told = Self {
                    model: model.to_owned(),
                    numeral,
                    metric: metric.to_owned(),
                    people: people.len(),
                    mean: n("gain"),
                    p: n("wilcoxon_persons"),
                    holm: n("wilcoxon_persons_holm"),
                    r: n("rank_biserial"),
                    differing: n("differing") as usize,
                    gains,
                    row,
                };
                told.agrees();
                all.push(told);
            }
        }
        all
    }

    /// Checks that p-value, interval, estimate, direction and counts agree with each other and with
    /// cells.csv.
    fn agrees(&self) {
        let said = format!("{:?}", self.row);
        if let Some(gains) = &self.gains {
            let differ: Vec<f64> = gains.iter().copied().filter(|gain| gain.abs() > 1e-9).collect();
            assert_eq!(differ.len(), self.differing, "{said}");
            let mean = gains.iter().sum::<f64>() / gains.len() as f64;
            assert!((mean - self.mean).abs() < 1e-4, "{said}");
            // The rank-biserial correlation is the number of pairs with a positive mean minus the
            // number of pairs with a negative mean, divided by the number of pairs.
            let pairs = (0..differ.len()).flat_map(|i| (i..differ.len()).map(move |j| (i, j)));
            let sign = |(i, j): (usize, usize)| match differ[i] + differ[j] {
                sum if sum.abs() < 1e-9 => 0.0,
                sum => sum.signum(),
            };
            let (balance, count) =
                pairs.fold((0.0, 0usize), |(sum, count), pair| (sum + sign(pair), count + 1));
            assert!((balance / count.max(1) as f64 - self.r).abs() < 1e-4, "{said}");
        }
        if self.row["gain_low"].is_empty() {
            assert!(self.differing < 6 && self.p >= 0.05, "{said}");
            return;
        }
        let [low, typical, high] =
            ["gain_low", "typical_gain", "gain_high"].map(|of| number(&self.row, of));
        assert!(low <= typical && typical <= high, "{said}");
        assert_eq!(low <= 0.0 && 0.0 <= high, self.p >= 0.05, "{said}");
        assert!(self.p >= 0.05 || typical * self.r > 0.0, "{said}");
    }

    fn full_name(&self) -> String {
        let (_, model) = MODELS.into_iter().find(|(word, _)| *word == self.model).unwrap();
        format!("{model} {}", self.numeral)
    }

    /// The name without the experiment, if the metric exists in only one experiment.
    fn name(&self) -> String {
        let name = self.full_name();
        if self.metric == "accuracy" { name } else { name.replace(" II", "") }
    }

    fn way(&self, p: f64) -> &'static str {
        match p < 0.05 {
            true if self.r > 0.0 => "better",
            true => "worse",
            false => "open",
        }
    }

    /// An entry in the list below the sentence.
    fn entry(&self, mean: f64, r: f64, [p, holm]: [f64; 2]) -> String {
        let mean = match self.metric.as_str() {
            "accuracy" => signed(mean, 1),
            _ => format!("{} steps ({} s)", signed(mean, 1), signed(0.2 * mean, 2)),
        };
        if self.people < 6 {
            return format!("{} {mean}", self.name());
        }
        let differ = match self.differing < self.people {
            true => format!(" {} of {} differ", self.differing, self.people),
            false => String::new(),
        };
        let (p, r, holm) = (p_is(p), signed(r, 2), p_value(holm));
        format!("{} {mean} {p}, r {r} Holm {holm}{differ}", self.name())
    }

    /// The entries for every possible rounding of the numbers with four places and of the p-values
    /// with seven digits.
    fn entries(&self) -> impl Iterator<Item = String> {
        let means = near(self.mean).into_iter();
        let alike = |p: f64| [p * (1.0 - 6e-7), p, p * (1.0 + 6e-7)].map(|p| p.min(1.0));
        let p_values = move || {
            alike(self.p).into_iter().flat_map(move |p| alike(self.holm).map(|holm| [p, holm]))
        };
        means.flat_map(move |mean| {
            near(self.r)
                .into_iter()
                .flat_map(move |r| p_values().map(move |p| self.entry(mean, r, p)))
        })
    }
}

/// Numbers near this one that files print equally with four places.
fn near(number: f64) -> [f64; 3] {
    let less = if number == 0.0 { 0.0 } else { 6e-5 };
    [number - less, number, number + less]
}

fn fixed(number: f64, places: usize) -> String {
    let text = format!("{number:.places$}").replace('-', "−");
    if text.chars().all(|c| "−0.".contains(c)) { text.replace('−', "") } else { text }
}

fn signed(number: f64, places: usize) -> String {
    let text = fixed(number, places);
    let bare = text.starts_with('−') || text.chars().all(|c| "0.".contains(c));
    if bare { text } else { format!("+{text}") }
}

fn beside(number: f64) -> String {
    match signed(number, 1) {
        text if text == "0.0" && number > 0.0 => "just above 0".to_owned(),
        text if text == "0.0" && number < 0.0 => "just below 0".to_owned(),
        text => text,
    }
}

fn p_value(p: f64) -> String {
    let told = (3..9).map(|places| format!("{p:.places$}"));
    let mut told = told.filter(|told| (told.parse::<f64>().unwrap() < 0.05) == (p < 0.05));
    if p < 0.001 { "< 0.001".to_owned() } else { told.next().unwrap() }
}

fn p_is(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {}", p_value(p)) }
}

/// Joins names as in "a, b and c".
fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

fn that(all: &[Told], way: &str, p: fn(&Told) -> f64) -> Vec<String> {
    all.iter().filter(|of| of.way(p(of)) == way).map(Told::name).collect()
}

fn before(of: &Told) -> f64 {
    of.p
}

fn after(of: &Told) -> f64 {
    of.holm
}

fn verdict(all: &[Told]) -> &'static str {
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

/// The expected headline of each finding about a comparison, in order, with its comparisons.
fn expected(files: &Files) -> Vec<(String, Vec<Told>)> {
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

/// The first paragraph of the first finding, for every possible rounding of the numbers in the files.
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

/// The sentence about too few people. The smallest p-value is computed here.
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

/// A study of random people. For some people, models do equally well on every set. For the others,
/// models do better or worse by some steps.
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
            // This leaves out the first step of avoidance, which is the third step.
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

/// 18 of 24 people do equally well with every set. For the others, every model is better with
/// safety levels, or worse in the reverse case.
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
