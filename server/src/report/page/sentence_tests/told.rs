//! The numbers of an analysis, read from its files, in the words of the report.

use crate::report::{Content, each_file};
use sidestep::comparison::Analysis;
use std::collections::{BTreeMap, BTreeSet};

type Row = BTreeMap<String, String>;

/// The files of an analysis.
pub(super) struct Files(pub(super) BTreeMap<String, String>);

impl Files {
    pub(super) fn of(analysis: &Analysis) -> Self {
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

    pub(super) fn rows(&self, name: &str) -> Vec<Row> {
        let rows = csv::Reader::from_reader(self.0[name].as_bytes()).into_deserialize();
        rows.map(Result::unwrap).collect()
    }

    /// The accuracy of each person, in per cent.
    pub(super) fn accuracies(&self, model: &str, experiment: &str, features: &str) -> Vec<f64> {
        let is = |row: &Row| {
            (&*row["model"], &*row["experiment"], &*row["features"])
                == (model, experiment, features)
        };
        let own = self.rows("cells.csv").into_iter().filter(is);
        own.map(|row| 100.0 * row["test_accuracy"].parse::<f64>().unwrap()).collect()
    }
}

pub(super) fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

/// A comparison of two feature sets, read from the files.
pub(super) struct Told {
    pub(super) model: String,
    pub(super) numeral: &'static str,
    pub(super) metric: String,
    pub(super) people: usize,
    /// The gains, if cells.csv has them.
    pub(super) gains: Option<Vec<f64>>,
    pub(super) mean: f64,
    pub(super) p: f64,
    pub(super) holm: f64,
    pub(super) r: f64,
    pub(super) differing: usize,
    pub(super) row: Row,
}

const MODELS: [(&str, &str); 3] = [("svm", "SVM"), ("dt", "DT"), ("lr", "LR")];

impl Told {
    pub(super) fn all(
        files: &Files,
        file: &str,
        metric: &str,
        (first, second): (&str, &str),
    ) -> Vec<Self> {
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

    pub(super) fn full_name(&self) -> String {
        let (_, model) = MODELS.into_iter().find(|(word, _)| *word == self.model).unwrap();
        format!("{model} {}", self.numeral)
    }

    /// The name without the experiment, if the metric exists in only one experiment.
    pub(super) fn name(&self) -> String {
        let name = self.full_name();
        if self.metric == "accuracy" { name } else { name.replace(" II", "") }
    }

    pub(super) fn way(&self, p: f64) -> &'static str {
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

    /// All possible entries. The files give numbers with four decimal places and p-values with seven
    /// digits, so several rounded values are possible.
    pub(super) fn entries(&self) -> impl Iterator<Item = String> {
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

/// This number, and a number below and above it. The files have four decimal places, so the exact
/// number is between the two.
pub(super) fn near(number: f64) -> [f64; 3] {
    let less = if number == 0.0 { 0.0 } else { 6e-5 };
    [number - less, number, number + less]
}

pub(super) fn fixed(number: f64, places: usize) -> String {
    let text = format!("{number:.places$}").replace('-', "−");
    if text.chars().all(|c| "−0.".contains(c)) { text.replace('−', "") } else { text }
}

fn signed(number: f64, places: usize) -> String {
    let text = fixed(number, places);
    let bare = text.starts_with('−') || text.chars().all(|c| "0.".contains(c));
    if bare { text } else { format!("+{text}") }
}

pub(super) fn beside(number: f64) -> String {
    match signed(number, 1) {
        text if text == "0.0" && number > 0.0 => "just above 0".to_owned(),
        text if text == "0.0" && number < 0.0 => "just below 0".to_owned(),
        text => text,
    }
}

pub(super) fn p_value(p: f64) -> String {
    let told = (3..9).map(|places| format!("{p:.places$}"));
    let mut told = told.filter(|told| (told.parse::<f64>().unwrap() < 0.05) == (p < 0.05));
    if p < 0.001 { "< 0.001".to_owned() } else { told.next().unwrap() }
}

pub(super) fn p_is(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {}", p_value(p)) }
}

/// Joins names as in "a, b and c".
pub(super) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
