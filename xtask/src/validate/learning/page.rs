//! The page: what is compared, how, and what came out.

use super::differences::{list, reasons};
use super::report::{Fingerprints, Report, Row, Table};
use crate::validate::words::{head, thousands};

/// The whole page.
pub(super) fn page(report: &Report) -> String {
    let sections = [
        introduction(report),
        guarantees(report),
        models(report),
        comparison(report),
        differences(report),
        distances(report),
        statistics(report),
        bits(&report.fingerprints),
    ];
    sections.join("\n")
}

fn introduction(report: &Report) -> String {
    let (cells, equal) = counts(report);
    format!(
        "# How near learning is to scikit-learn and scipy

<!-- Written by `cargo xtask validate`: change that, not this file. -->

Logistic regression, support vector machines, trees, cross-validation and rank tests are our own
code ([decision 0014](../decisions/0014-learning.md)). This page holds them against scikit-learn 1.9
and scipy 1.17 on the same rows: the eight **synthetic** participants of
`shared/tests/data/trials.csv` with the features of `features.csv`, 50 tasks each, the last ten for the
test. **No number here is about people.** `cargo xtask validate learning` computes all of ours anew;
what the others say is kept in `shared/tests/data`, whose README tells how it was made. Nothing is
random.

In short: {equal} of the {cells} cells of the paper's comparison have the same test accuracy, to the
row. The others are no errors of ours: where scikit-learn's solvers are taken to their end they get
what we get, and where a tree has to choose among equally good splits ours is one of those that it
may choose.
"
    )
}

fn counts(report: &Report) -> (usize, usize) {
    let models = &report.cells.models;
    (models.iter().map(|of| of.cells).sum(), models.iter().map(|of| of.equal).sum())
}

/// What is promised, what tests hold, and what is measured.
fn guarantees(report: &Report) -> String {
    let of = |both: [f64; 2]| both.into_iter().fold(0.0, f64::max);
    let Report { logistic, machines, trees, ranks, .. } = report;
    let (cells, equal) = counts(report);
    let largest = report.tables.first().map_or(f64::NAN, largest);
    let predictions: usize = machines.iter().map(|of| of.rows).sum();
    let rows: usize = trees.iter().map(|of| of.rows - of.ties).sum();
    let lines = [
        (
            "logistic regression, weights, against scikit-learn's Newton solver".to_owned(),
            "≤ 10⁻⁹".to_owned(),
            small(of(logistic.each_ref().map(|of| of.newton))),
        ),
        (
            "its probabilities, against the reference".to_owned(),
            "≤ 10⁻⁶".to_owned(),
            small(of(logistic.each_ref().map(|of| of.probability))),
        ),
        (
            "support vector machines, decision values".to_owned(),
            "≤ 10⁻⁵".to_owned(),
            small(of(machines.each_ref().map(|of| of.decision))),
        ),
        (
            format!("their predictions: different of {}", thousands(predictions)),
            "≤ 10".to_owned(),
            machines.iter().map(|of| of.different).sum::<usize>().to_string(),
        ),
        (
            format!("trees: different predictions of {} rows without ties", thousands(rows)),
            "0".to_owned(),
            trees.iter().map(|of| of.different).sum::<usize>().to_string(),
        ),
        (
            "the comparison: cells with the same test accuracy".to_owned(),
            "≥ 85 %".to_owned(),
            format!("{:.1} %", 100.0 * equal as f64 / cells as f64),
        ),
        (
            "Table I: largest difference of a mean, points".to_owned(),
            "≤ 0.3".to_owned(),
            format!("{largest:.2}"),
        ),
        (
            "exact p-values with ties, against scipy".to_owned(),
            "≤ 10⁻¹²".to_owned(),
            small(ranks.mann_whitney.max(ranks.wilcoxon)),
        ),
        (
            "native and WebAssembly: stages with other bits".to_owned(),
            "0".to_owned(),
            "0 (the test suite)".to_owned(),
        ),
    ];
    let mut table = vec![head("what | a test holds | measured", 1)];
    table.extend(lines.map(|(what, held, found)| format!("| {what} | {held} | {found} |")));
    format!("## What is guaranteed\n\n{}\n", table.join("\n"))
}

fn models(report: &Report) -> String {
    let of = |experiment: usize| ["I", "II"][experiment];
    let mut logistic = vec![head(
        "experiment | means, scales | weights: Newton | weights: L-BFGS | probabilities | compared",
        1,
    )];
    for (i, apart) in report.logistic.iter().enumerate() {
        logistic.push(format!(
            "| {} | {} | {} | {} | {} | {} |",
            of(i),
            small(apart.scale),
            small(apart.newton),
            small(apart.lbfgs),
            small(apart.probability),
            thousands(apart.probabilities),
        ));
    }
    let mut machines = vec![head("experiment | rows | predicted otherwise | decision values", 1)];
    for (i, apart) in report.machines.iter().enumerate() {
        machines.push(format!(
            "| {} | {} | {} | {} |",
            of(i),
            thousands(apart.rows),
            apart.different,
            small(apart.decision)
        ));
    }
    let mut trees = vec![head(
        "experiment | rows | ties | flagged by the reference | of the ties, otherwise | of the others, otherwise | \
         shares of the others' leaves",
        1,
    )];
    for (i, apart) in report.trees.iter().enumerate() {
        trees.push(format!(
            "| {} | {} | {} | {} | {} | {} | {} |",
            of(i),
            thousands(apart.rows),
            apart.ties,
            apart.flagged,
            apart.different_ties,
            apart.different,
            small(apart.share),
        ));
    }
    format!(
        "## The models

B_hrd of each participant with fixed settings, trained on tasks 0–39; largest differences over all
eight and, of what they say, over tasks 40–49.

**Logistic regression**, against `solver=\"newton-cholesky\"` taken to its end (C = 0.001, 1 and 100)
and against the reference's own models (L-BFGS, C = 1), which stop where that solver cannot see the
loss fall any more. The probabilities are the reference's, and differ by that.

{}

**Support vector machines**, RBF, C = 1, γ = scale.

{}

**Trees**, depth 6, leaves of at least 5. Some splits are equally good, and scikit-learn chooses
among them by a random state. *Ties* are rows of which not all trees of a thousand random states say
the same; the reference's own flag comes from six and misses some. Shares of a leaf are printed to
eight places there.

{}
",
        logistic.join("\n"),
        machines.join("\n"),
        trees.join("\n")
    )
}

const TITLES: &str = "model | experiment | from | hrd | hr | hd | rd | h | r | d";

/// Ours and the reference's, row under row.
fn beside(rows: &[Row], places: usize) -> String {
    let mut lines = vec![head(TITLES, 3)];
    for row in rows {
        let numbers = |numbers: &[f64]| {
            let cells: Vec<_> = numbers.iter().map(|n| format!("{n:.places$}")).collect();
            cells.join(" | ")
        };
        let experiment = if row.experiment == 1 { "I" } else { "II" };
        lines.push(format!("| {} | {experiment} | ours | {} |", row.model, numbers(&row.ours)));
        lines.push(format!("| | | reference | {} |", numbers(&row.reference)));
    }
    lines.join("\n")
}

/// The largest difference of a table.
fn largest(table: &Table) -> f64 {
    let of_row = |row: &Row| {
        let pairs = row.ours.iter().zip(&row.reference);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    table.rows.iter().map(of_row).fold(0.0, f64::max)
}

fn comparison(report: &Report) -> String {
    let mut rows = vec![head("model | cells | the same test accuracy", 1)];
    for of in &report.cells.models {
        rows.push(format!("| {} | {} | {} |", of.model, of.cells, of.equal));
    }
    let Some(first) = report.tables.first() else { return String::new() };
    format!(
        "## The whole comparison

Every model, experiment, feature set and participant: hyper-parameters by five folds of whole trials,
refit, test. A cell is equal if as many of the 500 test rows are predicted right.

{}

Table I, mean test accuracy over the participants in per cent. The largest difference is {:.2} points.

{}
",
        rows.join("\n"),
        largest(first),
        beside(&first.rows, 2)
    )
}

fn differences(report: &Report) -> String {
    let cells = &report.cells.different;
    format!(
        "## Every cell that differs, and why

{} cells. For each: how many rows are predicted right, of 2,000 in cross-validation and of 500 in the
test, under the setting that the reference chose and under ours. Three times: by scikit-learn as the
reference called it; by scikit-learn **to the end** (logistic regression by newton-cholesky to 10⁻¹²,
machines to 10⁻⁶; for trees the fewest and the most over 50 random states); by us.
`tests/peers/learning_again.py` made the first two.

{}

{}
",
        cells.len(),
        reasons(cells),
        list(cells)
    )
}

fn distances(report: &Report) -> String {
    let mut rows = vec![head("metric, experiment II | largest difference", 1)];
    for table in report.tables.iter().skip(1) {
        rows.push(format!("| {} | {:.2} |", table.name.replace(' ', ", "), largest(table)));
    }
    let penalised = |metric: &str| {
        let name = format!("{metric} penalised");
        let table = report.tables.iter().find(|table| table.name == name);
        table.map_or_else(String::new, |table| beside(&table.rows, 2))
    };
    format!(
        "## Table II

D_start and D_end in steps, *penalised* over all 80 test trajectories, *both* over the n in which human
and model avoid. They hang on single steps, so that one row that is predicted otherwise can move a
trajectory's distance by many steps.

{}

D_start, penalised:

{}

D_end, penalised:

{}
",
        rows.join("\n"),
        penalised("D_start"),
        penalised("D_end")
    )
}

fn statistics(report: &Report) -> String {
    let ranks = &report.ranks;
    format!(
        "## Statistics

p-values of {} comparisons of two feature sets, over the accuracies of the eight participants that the
reference prints, **with their ties**. scipy's are its permutation distributions
(`scipy.stats.permutation_test` over all splits and all signs), since its tests of these names fall back
to the normal approximation at a tie. Largest differences: Mann–Whitney {}, Wilcoxon {}. Accuracies are
compared as counts of rows; the reference compared them as they were rounded, and missed some ties.
Tests without ties, the normal approximation for many numbers, and Holm's correction are held against
scipy and published tables by the unit tests of `shared/src/stats/rank.rs`.
",
        ranks.compared,
        small(ranks.mann_whitney),
        small(ranks.wilcoxon)
    )
}

fn bits(count: &Fingerprints) -> String {
    format!(
        "## Native and WebAssembly

`learning_fingerprints` of the library hashes all bits of {} stages: every feature of 60 drives, with
safety levels from the closed form and from a game that is solved and sampled ({}); training of logistic
regression, both kernels, trees and boosting with cross-validation, calibration and refit, without and
with a memory ({}); and what each predictor, read back from its predictor.json, says of 2,500 states ({}).
`tests/tests/webassembly.rs` runs it here and in Chromium, compiled as the pages are and as the solver is
(with lanes of 128 bits), and fails if a single bit differs.
",
        count.features + count.training + count.inference,
        count.features,
        count.training,
        count.inference
    )
}

/// `6.7·10⁻⁶`.
fn small(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{number:.1e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let raised = |digit| match digit {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    format!("{mantissa}·10{}", exponent.chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_are_powers_of_ten() {
        let found = [0.0, 6.73e-6, 5.67e-12, 4.9e-9].map(small);
        assert_eq!(found, ["0", "6.7·10⁻⁶", "5.7·10⁻¹²", "4.9·10⁻⁹"]);
    }

    #[test]
    fn the_largest_difference_is_of_any_row() {
        let row = |ours: &[f64]| Row {
            model: "lr".to_owned(),
            experiment: 1,
            ours: ours.to_vec(),
            reference: vec![70.0, 80.0],
        };
        let rows = vec![row(&[70.0, 80.0]), row(&[70.1, 79.5])];
        assert_eq!(largest(&Table { name: "accuracy".to_owned(), rows }), 0.5);
    }

    #[test]
    fn no_cell_of_the_page_is_open() {
        let page = include_str!("../../../../docs/validation/learning.md");
        assert!(page.contains("## Every cell that differs"));
        assert!(!page.contains("| open |"), "a cell differs, and nothing explains it");
    }
}
