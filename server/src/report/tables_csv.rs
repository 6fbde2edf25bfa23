//! The tables of an analysis as CSV. The same results give the same bytes.

mod further;

use csv::Writer;
use serde::Serialize;
use sha2::{Digest, Sha256};
use sidestep::comparison::Analysis;
use sidestep::comparison::cell::Experiment;
use sidestep::comparison::gains::{Gain, Paired};
use sidestep::comparison::models::ModelName;
use sidestep::comparison::rollout::Simple;
use sidestep::comparison::sets::PAPERS_SETS;
use std::io::{self, Write};

/// A function that writes a table.
pub(super) type Table = fn(&Analysis, &mut dyn Write) -> io::Result<()>;

/// The tables that every analysis has.
const TABLES: [(&str, Table); 14] = [
    ("cells.csv", cells),
    ("table1.csv", table1),
    ("table2.csv", table2),
    ("tests.csv", tests),
    ("beside.csv", beside),
    ("ablation.csv", ablation),
    ("calibration.csv", calibration),
    ("rollouts.csv", rollouts),
    ("predictions.csv", predictions),
    ("behaviour.csv", further::behaviour),
    ("behaviour_trials.csv", further::behaviour_trials),
    ("learning.csv", further::learning),
    ("unseen.csv", further::unseen),
    ("importance.csv", further::importance),
];

/// The table that exists only if the analysis has results about leakage.
const LEAKAGE: (&str, Table) = ("leakage.csv", leakage);

/// The table that exists only if the study names its robots.
const ROBOTS: (&str, Table) = ("behaviour_robots.csv", further::behaviour_robots);

/// The tables of this analysis, each with the name of its file and its writer.
pub(super) fn tables(analysis: &Analysis) -> impl Iterator<Item = (&'static str, Table)> {
    let leakage = (!analysis.leakage.is_empty()).then_some(LEAKAGE);
    let robots = (!analysis.behaviour.robots.is_empty()).then_some(ROBOTS);
    TABLES.into_iter().chain(leakage).chain(robots)
}

/// Writes a header and rows. A row is a tuple, and its fields include the values of nested tuples.
fn write(
    out: &mut dyn Write,
    header: &str,
    rows: impl IntoIterator<Item = impl Serialize>,
) -> io::Result<()> {
    let mut out = Writer::from_writer(out);
    out.write_record(header.split(','))?;
    for row in rows {
        out.serialize(row)?;
    }
    out.flush()
}

/// A number with four decimal places. It is in per cent, steps or metres.
fn places(number: f64) -> String {
    // Never print −0.
    format!("{:.4}", number + 0.0).replace("-0.0000", "0.0000")
}

fn p_value(p: f64) -> String {
    format!("{p:.6e}")
}

fn cells(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,participant,cv_accuracy,test_accuracy,hyperparameters,\
                  test_balanced_accuracy";
    let rows = analysis.comparison.cells.iter().map(|cell| {
        (
            cell.model.word(),
            cell.experiment.number(),
            &cell.features,
            &analysis.comparison.participants[cell.participant].name,
            cell.cv_accuracy.to_string(),
            cell.test.accuracy().to_string(),
            &cell.hyperparameters,
            cell.test.balanced_accuracy().to_string(),
        )
    });
    write(out, header, rows)
}

fn table1(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = format!("model,experiment,{}", PAPERS_SETS.join(","));
    let rows = ModelName::ALL.into_iter().flat_map(|model| {
        Experiment::ALL.map(|experiment| {
            let numbers = analysis.comparison.accuracies(model, experiment, &PAPERS_SETS);
            let numbers: Vec<String> = numbers.into_iter().map(places).collect();
            (model.word(), experiment.number(), numbers)
        })
    });
    write(out, &header, rows)
}

fn table2(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = format!("model,metric,convention,{}", PAPERS_SETS.join(","));
    let rows = ModelName::ALL.into_iter().flat_map(|model| {
        let distances = PAPERS_SETS.map(|set| analysis.comparison.distances(model, set));
        let ends =
            [("D_start", distances.map(|of| of.start)), ("D_end", distances.map(|of| of.end))];
        ends.into_iter().flat_map(move |(metric, of)| {
            [
                ("penalised", of.map(|of| places(of.penalised))),
                ("both", of.map(|of| of.both.map_or_else(String::new, places))),
                ("n", distances.map(|of| of.both.to_string())),
            ]
            .map(|row| (model.word(), metric, row))
        })
    });
    write(out, &header, rows)
}

/// The ends of an interval. They are empty if the results differ for too few participants.
fn ends(paired: &Paired) -> [String; 2] {
    paired.interval.map_or_else(Default::default, |ends| ends.map(signed_places))
}

/// Prints four decimal places, but never prints a nonzero number as zero. So the printed interval
/// contains 0 only if the exact interval does.
fn signed_places(number: f64) -> String {
    /// The smallest positive number with four places.
    const LEAST: f64 = 1e-4;
    places(if number == 0.0 { 0.0 } else { number.abs().max(LEAST).copysign(number) })
}

fn tests(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,metric,first,second,gain,mann_whitney_persons,\
                  mann_whitney_trajectories,wilcoxon_persons,mann_whitney_persons_holm,\
                  mann_whitney_trajectories_holm,wilcoxon_persons_holm,typical_gain,gain_low,\
                  gain_high,rank_biserial,differing";
    let rows = analysis.tests.iter().map(|test| {
        let Gain { model, experiment, metric, paired, holm, .. } = &test.gain;
        let p_values = [
            test.mann_whitney_persons,
            test.mann_whitney_trajectories,
            paired.p,
            test.mann_whitney_persons_holm,
            test.mann_whitney_trajectories_holm,
            *holm,
        ];
        (
            (model.word(), experiment.number(), metric.word(), test.first, test.second),
            (places(paired.mean), p_values.map(p_value)),
            (signed_places(paired.typical), ends(paired)),
            (places(paired.rank_biserial), paired.differing),
        )
    });
    write(out, header, rows)
}

/// The families of tests that are not in the paper.
fn beside(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,first,second,gain,typical_gain,gain_low,gain_high,\
                  wilcoxon_persons,wilcoxon_persons_holm,rank_biserial,differing";
    let rows = analysis.families.iter().flat_map(|family| {
        family.gains.iter().map(|Gain { model, experiment, paired, holm, .. }| {
            (
                (model.word(), experiment.number(), family.first, family.second),
                (places(paired.mean), signed_places(paired.typical), ends(paired)),
                (p_value(paired.p), p_value(*holm), places(paired.rank_biserial)),
                paired.differing,
            )
        })
    });
    write(out, header, rows)
}

fn ablation(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,accuracy_percent,log_loss,gain_over_d,wilcoxon_persons,\
                  balanced_accuracy_percent";
    let rows = analysis.ablation.iter().map(|row| {
        (
            row.model.map_or("constant", ModelName::word),
            row.experiment.number(),
            &row.features,
            places(row.accuracy),
            places(row.log_loss),
            row.over_d.map(|(gain, _)| places(gain)),
            row.over_d.map(|(_, p)| p_value(p)),
            places(row.balanced),
        )
    });
    write(out, header, rows)
}

fn calibration(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,rows,log_loss,brier,calibration_error";
    let rows = analysis.pooled.iter().map(|of| {
        (
            of.model.map_or("constant", ModelName::word),
            of.experiment.number(),
            &of.features,
            of.calibration.rows,
            places(of.calibration.log_loss),
            places(of.calibration.brier),
            places(of.calibration.calibration_error),
        )
    });
    write(out, header, rows)
}

fn rollouts(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "driver,features,horizon,windows,accuracy_percent,log_loss,distance_m,\
                  accuracy_over_straight,distance_of_straight";
    let straight = analysis.rollouts.iter().find(|of| of.driver == Simple::Straight.word());
    let rows = analysis.rollouts.iter().flat_map(|of| {
        of.horizons.iter().enumerate().map(move |(i, horizon)| {
            let skill = straight.map(|straight| horizon.over(&straight.horizons[i]));
            (
                (&of.driver, &of.features, i + 1, horizon.windows),
                places(100.0 * horizon.accuracy()),
                places(horizon.mean_log_loss()),
                places(horizon.mean_distance_m()),
                skill.map(|skill| places(skill.accuracy_points)),
                skill.and_then(|skill| skill.distance_share).map(places),
            )
        })
    });
    write(out, header, rows)
}

fn leakage(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let rows = analysis.leakage.iter().map(|of| {
        (of.model.word(), of.experiment.number(), places(of.grouped), places(of.leaking))
    });
    write(out, "model,experiment,grouped_percent,leaking_percent", rows)
}

fn predictions(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,participant,trial,step,truth,predicted,p_right,\
                  p_straight,p_left,p_avoid";
    let rows = analysis.comparison.cells.iter().flat_map(|cell| {
        let person = &analysis.comparison.participants[cell.participant];
        let test = &cell.test;
        test.each().enumerate().map(move |(row, probabilities)| {
            let of = |class: i8| {
                let place = test.classes.iter().position(|known| *known == class);
                place.map(|place| probabilities[place].to_string())
            };
            let probabilities = match cell.experiment {
                Experiment::TurnDirection => [of(-1), of(0), of(1), None],
                Experiment::Avoidance => [None, of(0), None, of(1)],
            };
            (
                (cell.model.word(), cell.experiment.number(), &cell.features, &person.name),
                (person.test_trials[row / person.steps], row % person.steps),
                (test.truth[row], test.predicted[row], probabilities),
            )
        })
    });
    write(out, header, rows)
}

/// Converts a name to a part of a file name. Bytes other than letters, digits, points, dashes and
/// underscores are percent-encoded (%20), so that two names never collide. A name that is too long
/// for a file system is truncated, and the first digits of its hash make it unique.
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

/// Maximum length of a name within a file name (bytes). File systems allow 255 bytes for the whole
/// file name, which also has the model and other parts.
const LONGEST: usize = 160;

/// Number of hexadecimal digits of the hash in a truncated name.
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
