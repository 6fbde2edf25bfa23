//! The sections about probabilities.

use crate::validate::shfrs::report::{Coverage, Danger, Families, Family};
use crate::validate::words::{head, thousands};

pub(super) fn coverage(coverage: &Coverage) -> String {
    let mut rows = vec![head(
        "p | n | conformal: mean share | ± | rank/(n + 1) | PAC: failures | fixed sequence: failures",
        0,
    )];
    for row in &coverage.rows {
        let needs = format!("needs {}", row.pac_needs);
        let failures =
            |share: Option<f64>| share.map_or_else(|| needs.clone(), |share| format!("{share:.3}"));
        rows.push(format!(
            "| {} | {} | {:.4} | {:.4} | {:.4} | {} | {} |",
            row.p,
            row.n,
            row.conformal_mean,
            row.conformal_error,
            row.conformal_expected,
            failures(row.pac_failures),
            failures(row.fixed_failures),
        ));
    }
    let (delta, many) = (coverage.delta, coverage.calibrations as f64);
    let error = (delta * (1.0 - delta) / many).sqrt();
    format!(
        "## Guarantees

{} made-up people who turn away from a robot that comes near drive for ten steps each. They are
taken as everybody there is, so that the share of people that a level holds can be counted. {} times,
n of them are drawn (with replacement) and a level is calibrated on them for a share p:
*conformal* (the share is at least p on average), *PAC* and *fixed sequence* (it is at least p
in all but a share δ = {delta} of calibrations; {} levels, with the paper's roll-outs, whose sets are
not nested: {} times a drive was lost to a larger ε).

Conformal is as it should be where the mean is not below p by more than its standard error (±)
explains; for scores without ties its expectation is rank/(n + 1). Failures may exceed {delta} by no
more than the binomial error, ±{error:.3}. Where n is too small, the library refuses and says how
many it needs.

{}
",
        thousands(coverage.population),
        thousands(coverage.calibrations),
        coverage.levels,
        thousands(coverage.not_nested),
        rows.join("\n")
    )
}

pub(super) fn danger(danger: &Danger) -> String {
    let mut rows = vec![head("α | U ≤ α | and entered | ± | L ≥ 1 − α | and stayed out", 0)];
    for row in &danger.rows {
        let error = (row.alpha * (1.0 - row.alpha) / danger.scenes as f64).sqrt();
        rows.push(format!(
            "| {} | {:.4} | {:.4} | {error:.4} | {:.4} | {:.4} |",
            row.alpha, row.said_out, row.entered_against, row.said_in, row.stayed_out_against
        ));
    }
    format!(
        "## Entering the danger zone

The same people in {} scenes, each with a calibration of its own on {} other drives. L and U bound
the probability that the human comes within 3 m of the robot in the next ten steps. On average L is
{:.3}, U is {:.3}, and the human entered in {:.3} of the scenes. In {:.0} % of the scenes the two are
less than 0.1 apart. What is guaranteed, for any α: that the human enters although U ≤ α happens in
no more than a share α of scenes, and that they stay out although L ≥ 1 − α likewise. Shares of all
scenes, with the binomial error of α:

{}
",
        thousands(danger.scenes),
        danger.calibration,
        danger.low,
        danger.high,
        danger.entered,
        100.0 * danger.narrow,
        rows.join("\n")
    )
}

/// Areas, m², that the reference reports for shares of .75, .90 and .95 (of its own synthetic
/// people, by a predictor of its own).
const REFERENCE: [(&str, [f64; 3]); 6] = [
    ("SHFRS, adaptive set", [0.81, 1.82, 2.36]),
    ("SHFRS, best fixed k", [1.59, 3.00, 3.89]),
    ("SHFRS, the paper's k", [1.59, 3.87, 4.95]),
    ("constant-velocity cone", [4.32, 5.28, 5.31]),
    ("hold the input", [3.44, 4.32, 4.67]),
    ("per-mode empirical sets", [0.77, 2.52, 5.31]),
];

pub(super) fn families(families: &Families) -> String {
    let targets: Vec<_> = families.targets.iter().map(|p| format!("p = {p}")).collect();
    let titles = |unit: &str| targets.iter().map(|p| format!("{p}{unit}")).collect::<Vec<_>>();
    let mut rows = vec![head(
        &format!("family | {} | {}", titles(": m²").join(" | "), titles(": inside").join(" | ")),
        1,
    )];
    for family in &families.families {
        let areas: Vec<_> =
            family.cells.iter().map(|cell| format!("{:.2}", cell.area_m2)).collect();
        let shares: Vec<_> = family
            .cells
            .iter()
            .map(|cell| format!("{:.2} ({:.2}–{:.2})", cell.coverage, cell.low, cell.high))
            .collect();
        let (areas, shares) = (areas.join(" | "), shares.join(" | "));
        rows.push(format!("| {} | {areas} | {shares} |", family.family));
    }
    let mut reference = vec![head("family | .75: m² | .90: m² | .95: m²", 1)];
    for (family, areas) in REFERENCE {
        let areas = areas.map(|area| format!("{area:.2}")).join(" | ");
        reference.push(format!("| {family} | {areas} |"));
    }
    let least = of_least_area(families);
    format!(
        "## What it buys: coverage against area

{} drives of **synthetic** people (`shared/tests/data/README.md`), parted at random: {} to train
the predictor (logistic regression on B_hrd) and to choose actions by, {} to calibrate on, {} to
measure. Each family is calibrated so that a new trajectory stays inside for {} steps with
probability p (conformal, one random window a trajectory). Mean area of the tube, and share inside
in the test part with its {:.0} % interval; both are means over {} splits of the same drives. *Best*
means chosen on the training part. A family that reaches the same p with less area says more.

{}

**Least area: {least}.**
Families that know which input is held at present have an advantage over SHFRS with this predictor,
which sees the present state alone: where the human is, not whether they have begun to turn.

The reference found, with other synthetic people and with a predictor that also knows what the
human did before:

{}

That is why ours are larger; compare within a table, not across.
",
        thousands(families.drives),
        families.training,
        families.calibration,
        families.test,
        families.steps,
        100.0 * families.confidence,
        families.splits,
        rows.join("\n"),
        reference.join("\n")
    )
}

/// The families that need least area, and for which targets.
fn of_least_area(families: &Families) -> String {
    let area =
        |family: &Family, i: usize| family.cells.get(i).map_or(f64::NAN, |cell| cell.area_m2);
    let least = |i: usize| {
        let by_area = |a: &&Family, b: &&Family| area(a, i).total_cmp(&area(b, i));
        families.families.iter().min_by(by_area).map_or("none", |family| &family.family)
    };
    let best: Vec<_> = families.targets.iter().enumerate().map(|(i, p)| (least(i), p)).collect();
    let words = |run: &[(&str, &f64)]| {
        let targets: Vec<_> = run.iter().map(|(_, p)| p.to_string()).collect();
        format!("{} (p = {})", run[0].0, targets.join(", "))
    };
    best.chunk_by(|a, b| a.0 == b.0).map(words).collect::<Vec<_>>().join("; ")
}
