//! The tables of an analysis as CSV. Same results, same bytes.

use csv::Writer;
use sha2::{Digest, Sha256};
use sidestep::comparison::Analysis;
use sidestep::comparison::avoidance::Distances;
use sidestep::comparison::cell::{Experiment, ModelName, PAPERS_SETS};
use sidestep::comparison::gains::Gain;
use sidestep::comparison::tables::Pooled;
use std::io::{self, Write};

/// Of every analysis.
const TABLES: [(&str, Table); 9] = [
    ("cells.csv", cells),
    ("table1.csv", table1),
    ("table2.csv", table2),
    ("tests.csv", tests),
    ("beside.csv", beside),
    ("ablation.csv", ablation),
    ("calibration.csv", calibration),
    ("rollouts.csv", rollouts),
    ("predictions.csv", predictions),
];

/// Of those in which it was asked for.
const LEAKAGE: (&str, Table) = ("leakage.csv", leakage);

/// Every table of this analysis: the name of its file, and what writes it.
pub(super) fn tables(analysis: &Analysis) -> impl Iterator<Item = (&'static str, Table)> {
    let leakage = (!analysis.leakage.is_empty()).then_some(LEAKAGE);
    TABLES.into_iter().chain(leakage)
}

pub(super) type Table = fn(&Analysis, &mut dyn Write) -> io::Result<()>;

/// Rows of strings as CSV.
fn write(
    out: &mut dyn Write,
    header: &[&str],
    rows: impl IntoIterator<Item = Vec<String>>,
) -> io::Result<()> {
    let mut out = Writer::from_writer(out);
    out.write_record(header)?;
    for row in rows {
        out.write_record(row)?;
    }
    out.flush()
}

/// Four places: of per cent, steps or metres.
fn places(number: f64) -> String {
    // Never −0.
    format!("{:.4}", number + 0.0).replace("-0.0000", "0.0000")
}

fn p_value(p: f64) -> String {
    format!("{p:.6e}")
}

fn with_sets(first: &[&'static str]) -> Vec<&'static str> {
    first.iter().copied().chain(PAPERS_SETS).collect()
}

fn cells(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = [
        "model",
        "experiment",
        "features",
        "participant",
        "cv_accuracy",
        "test_accuracy",
        "hyperparameters",
    ];
    let rows = analysis.comparison.cells.iter().map(|cell| {
        vec![
            cell.model.word().to_owned(),
            cell.experiment.number().to_string(),
            cell.features.clone(),
            analysis.comparison.participants[cell.participant].name.clone(),
            cell.cv_accuracy.to_string(),
            cell.test.accuracy().to_string(),
            cell.hyperparameters.clone(),
        ]
    });
    write(out, &header, rows)
}

fn table1(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let mut rows = Vec::new();
    for model in ModelName::ALL {
        for experiment in Experiment::ALL {
            let mut row = vec![model.word().to_owned(), experiment.number().to_string()];
            let numbers = analysis.comparison.accuracies(model, experiment, &PAPERS_SETS);
            row.extend(numbers.into_iter().map(places));
            rows.push(row);
        }
    }
    write(out, &with_sets(&["model", "experiment"]), rows)
}

/// A form of a distance: its name, and which it is.
type Form = (&'static str, fn(&Distances) -> Option<f64>);

fn table2(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let optional = |number: Option<f64>| number.map_or_else(String::new, places);
    let start: [Form; 2] = [("penalised", |d| Some(d.start_penalised)), ("both", |d| d.start_both)];
    let end: [Form; 2] = [("penalised", |d| Some(d.end_penalised)), ("both", |d| d.end_both)];
    let mut rows = Vec::new();
    for model in ModelName::ALL {
        let distances = PAPERS_SETS.map(|set| analysis.comparison.distances(model, set));
        for (metric, forms) in [("D_start", start), ("D_end", end)] {
            let row = |convention: &str, numbers: [String; PAPERS_SETS.len()]| {
                let first = [model.word(), metric, convention].map(str::to_owned);
                first.into_iter().chain(numbers).collect()
            };
            for (convention, form) in forms {
                rows.push(row(convention, distances.map(|d| optional(form(&d)))));
            }
            rows.push(row("n", distances.map(|d| d.both.to_string())));
        }
    }
    write(out, &with_sets(&["model", "metric", "convention"]), rows)
}

fn tests(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = [
        "model",
        "experiment",
        "metric",
        "first",
        "second",
        "gain",
        "mann_whitney_persons",
        "mann_whitney_trajectories",
        "wilcoxon_persons",
        "mann_whitney_persons_holm",
        "mann_whitney_trajectories_holm",
        "wilcoxon_persons_holm",
        "typical_gain",
        "gain_low",
        "gain_high",
    ];
    let rows = analysis.tests.iter().map(|test| {
        let Gain { model, experiment, metric, paired, holm } = &test.gain;
        let [low, high] = ends(paired.interval);
        vec![
            model.word().to_owned(),
            experiment.number().to_string(),
            metric.word().to_owned(),
            test.first.to_owned(),
            test.second.to_owned(),
            places(paired.mean),
            p_value(test.mann_whitney_persons),
            p_value(test.mann_whitney_trajectories),
            p_value(paired.p),
            p_value(test.mann_whitney_persons_holm),
            p_value(test.mann_whitney_trajectories_holm),
            p_value(*holm),
            places(paired.typical),
            low,
            high,
        ]
    });
    write(out, &header, rows)
}

/// The ends of an interval; empty where participants are too few for one.
fn ends(interval: Option<[f64; 2]>) -> [String; 2] {
    interval.map_or_else(Default::default, |ends| ends.map(places))
}

/// The families of tests beside the paper's.
fn beside(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = [
        "model",
        "experiment",
        "first",
        "second",
        "gain",
        "typical_gain",
        "gain_low",
        "gain_high",
        "wilcoxon_persons",
        "wilcoxon_persons_holm",
    ];
    let rows = analysis.families.iter().flat_map(|family| {
        family.gains.iter().map(|Gain { model, experiment, paired, holm, .. }| {
            let [low, high] = ends(paired.interval);
            vec![
                model.word().to_owned(),
                experiment.number().to_string(),
                family.first.to_owned(),
                family.second.to_owned(),
                places(paired.mean),
                places(paired.typical),
                low,
                high,
                p_value(paired.p),
                p_value(*holm),
            ]
        })
    });
    write(out, &header, rows)
}

fn ablation(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = [
        "model",
        "experiment",
        "features",
        "accuracy_percent",
        "log_loss",
        "gain_over_d",
        "wilcoxon_persons",
    ];
    let rows = analysis.ablation.iter().map(|row| {
        vec![
            row.model.map_or("constant", ModelName::word).to_owned(),
            row.experiment.number().to_string(),
            row.features.clone(),
            places(row.accuracy),
            places(row.log_loss),
            row.over_d.map_or(String::new(), |(gain, _)| places(gain)),
            row.over_d.map_or(String::new(), |(_, p)| p_value(p)),
        ]
    });
    write(out, &header, rows)
}

fn calibration(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header =
        ["model", "experiment", "features", "rows", "log_loss", "brier", "calibration_error"];
    let row = |of: &Pooled| {
        vec![
            of.model.map_or("constant", ModelName::word).to_owned(),
            of.experiment.number().to_string(),
            of.features.clone(),
            of.calibration.rows.to_string(),
            places(of.calibration.log_loss),
            places(of.calibration.brier),
            places(of.calibration.calibration_error),
        ]
    };
    write(out, &header, analysis.pooled.iter().map(row))
}

fn rollouts(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header =
        ["driver", "features", "horizon", "windows", "accuracy_percent", "log_loss", "distance_m"];
    let rows = analysis.rollouts.iter().flat_map(|of| {
        of.horizons.iter().enumerate().map(|(i, horizon)| {
            vec![
                of.driver.clone(),
                of.features.clone(),
                (i + 1).to_string(),
                horizon.windows.to_string(),
                places(100.0 * horizon.accuracy()),
                places(horizon.mean_log_loss()),
                places(horizon.mean_distance_m()),
            ]
        })
    });
    write(out, &header, rows)
}

fn leakage(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let rows = analysis.leakage.iter().map(|found| {
        vec![
            found.model.word().to_owned(),
            found.experiment.number().to_string(),
            places(found.grouped),
            places(found.leaking),
        ]
    });
    write(out, &["model", "experiment", "grouped_percent", "leaking_percent"], rows)
}

fn predictions(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = [
        "model",
        "experiment",
        "features",
        "participant",
        "trial",
        "step",
        "truth",
        "predicted",
        "p_right",
        "p_straight",
        "p_left",
        "p_avoid",
    ];
    let mut out = Writer::from_writer(out);
    out.write_record(header)?;
    for cell in &analysis.comparison.cells {
        let person = &analysis.comparison.participants[cell.participant];
        let steps = (0..cell.test.rows())
            .map(|row| (person.test_trials[row / person.steps], row % person.steps));
        let test = &cell.test;
        for ((((trial, step), truth), predicted), row) in
            steps.zip(&test.truth).zip(&test.predicted).zip(test.each())
        {
            let of = |class: i8| test.classes.iter().position(|c| *c == class).map(|k| row[k]);
            let probabilities = match cell.experiment {
                Experiment::TurnDirection => [of(-1), of(0), of(1), None],
                Experiment::Avoidance => [None, of(0), None, of(1)],
            };
            out.write_field(cell.model.word())?;
            out.write_field(cell.experiment.number().to_string())?;
            out.write_field(&cell.features)?;
            out.write_field(&person.name)?;
            out.write_field(trial.to_string())?;
            out.write_field(step.to_string())?;
            out.write_field(truth.to_string())?;
            out.write_field(predicted.to_string())?;
            for p in probabilities {
                out.write_field(p.map_or_else(String::new, |p| format!("{p:.6}")))?;
            }
            out.write_record(None::<&[u8]>)?;
        }
    }
    out.flush()
}

/// A name as part of a file's name: bytes of what is not a letter, digit, point, dash or
/// underscore are written as in addresses, %20, so that no two names become one. What would be too
/// long for a file system is cut, and told apart by the beginning of its hash.
pub(super) fn file_name(name: &str) -> String {
    let part = |c: char| match c {
        c if c.is_alphanumeric() || ".-_".contains(c) => c.to_string(),
        c => c.to_string().bytes().map(|byte| format!("%{byte:02X}")).collect(),
    };
    let all: String = name.chars().map(part).collect();
    if all.len() <= LONGEST {
        return all;
    }
    let hash = hex::encode(Sha256::digest(name));
    let cut = all.floor_char_boundary(LONGEST - 1 - HASH_DIGITS);
    format!("{}~{}", &all[..cut], &hash[..HASH_DIGITS])
}

/// Bytes of a name in a file's name: file systems have room for 255, with the model and the rest.
const LONGEST: usize = 160;

/// Of the hash of a name that is cut.
const HASH_DIGITS: usize = 16;

#[cfg(test)]
mod tests {
    use super::{LONGEST, file_name};

    #[test]
    fn names_become_names_of_files_of_their_own() {
        assert_eq!(["p 7", "../é", "7"].map(file_name), ["p%207", "..%2Fé", "7"]);
        let long = |end: &str| file_name(&format!("{}{end}", "漢 ".repeat(63)));
        assert!(long("a").len() <= LONGEST && long("a") != long("b"));
        assert_eq!(file_name(&"x".repeat(LONGEST)), "x".repeat(LONGEST));
    }
}
