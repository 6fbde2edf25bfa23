//! The files that `sidestep shfrs` writes.

use super::super::{CommandError, unwritable};
use super::evaluation::Evaluation;
use crate::figure;
use crate::formats::atomic_folder::Draft;
use csv::Writer;
use sidestep::predict::PredictorFile;
use sidestep::shfrs::pareto::Pareto;
use sidestep::shfrs::probability::Regions;

/// The names of the files, in the order in which they are written.
pub(super) const FILES: [&str; 8] = [
    "regions.csv",
    "tuning.csv",
    "pareto.csv",
    "danger.csv",
    "regions.svg",
    "pareto.svg",
    "predictor.json",
    "shfrs.json",
];

/// Writes the files into a draft, so that a folder never mixes the files of two runs.
pub(super) fn write(
    draft: &Draft,
    analysis: &Evaluation,
    predictor: &PredictorFile,
) -> Result<(), CommandError> {
    let json = |value: serde_json::Result<String>| {
        value.map(|text| text + "\n").map_err(CommandError::failure)
    };
    let texts = [
        regions_csv(&analysis.regions)?,
        tuning_csv(analysis)?,
        pareto_csv(&analysis.pareto)?,
        danger_csv(analysis)?,
        regions_svg(analysis)?,
        figure::pareto(&analysis.pareto, analysis.split, &note(analysis)).svg(),
        json(serde_json::to_string_pretty(predictor))?,
        json(serde_json::to_string_pretty(analysis))?,
    ];
    FILES.into_iter().zip(texts).try_for_each(|(name, text)| {
        let path = draft.path().join(name);
        std::fs::write(&path, text).map_err(|e| unwritable(&path, &e))
    })
}

fn note(analysis: &Evaluation) -> String {
    let n = analysis.participants;
    let kind = if analysis.synthetic.is_some() { "SYNTHETIC " } else { "" };
    format!(
        "{n} {kind}participant{}  ·  predictor: {}",
        if n == 1 { "" } else { "s" },
        analysis.predictor
    )
}

fn csv_text(
    write: impl FnOnce(&mut Writer<Vec<u8>>) -> csv::Result<()>,
) -> Result<String, CommandError> {
    let mut writer = Writer::from_writer(Vec::new());
    write(&mut writer).map_err(CommandError::failure)?;
    let bytes = writer.into_inner().map_err(|e| CommandError::failure(e.error()))?;
    String::from_utf8(bytes).map_err(CommandError::failure)
}

fn pareto_csv(pareto: &Pareto) -> Result<String, CommandError> {
    csv_text(|writer| {
        writer.write_record([
            "family",
            "target",
            "level_name",
            "level",
            "coverage",
            "coverage_low",
            "coverage_high",
            "mean_area_m2",
            "share_of_worst_case",
        ])?;
        pareto.rows.iter().try_for_each(|row| {
            writer.serialize((
                (&row.family, row.target, &row.level_name, row.level),
                (row.coverage, row.coverage_low, row.coverage_high),
                (row.mean_area_m2, pareto.share_of_worst_case(row)),
            ))
        })
    })
}

fn regions_csv(regions: &[Regions]) -> Result<String, CommandError> {
    csv_text(|writer| {
        writer.write_record([
            "window_choice",
            "set",
            "epsilon",
            "p_set",
            "p_set_low",
            "p_set_high",
            "p_region",
            "p_region_low",
            "p_region_high",
            "mean_area_m2",
            "windows",
            "trajectories",
            "confidence",
            "actions",
            "rollout",
            "steps",
            "tolerance_m",
            "tolerance_rad",
            "share_of_worst_case",
            "p_set_low_people",
            "p_set_high_people",
            "people",
        ])?;
        for found in regions {
            let p = &found.probabilities;
            let people = found.by_people.as_ref();
            for (j, epsilon) in found.epsilon.iter().enumerate() {
                let (set, region) = (p.inside[j], p.region[j]);
                writer.serialize((
                    (&found.window_choice, j + 1, epsilon),
                    (set.value, set.low, set.high),
                    (region.value, region.low, region.high),
                    (found.mean_area_m2[j], p.windows, p.trajectories, p.confidence),
                    (&found.actions, &found.rollout, found.steps),
                    (found.tolerance_m, found.tolerance_rad),
                    found.share_of_worst_case[j],
                    (people.map(|p| p.inside[j].low), people.map(|p| p.inside[j].high)),
                    people.map(|p| p.trajectories),
                ))?;
            }
        }
        Ok(())
    })
}

fn tuning_csv(analysis: &Evaluation) -> Result<String, CommandError> {
    csv_text(|writer| {
        writer.write_record([
            "guarantee",
            "p",
            "actions",
            "rollout",
            "epsilon",
            "mean_area_m2",
            "coverage",
            "coverage_low",
            "coverage_high",
            "confidence",
            "window_choice",
            "steps",
            "training",
            "calibration",
            "test",
            "statement",
            "share_of_worst_case",
            "unit",
        ])?;
        for tuned in &analysis.tuning {
            writer.serialize((
                (&tuned.guarantee, tuned.p, tuned.choice.to_string(), &tuned.rollout),
                (tuned.epsilon, tuned.mean_area_m2),
                (tuned.coverage.value, tuned.coverage.low, tuned.coverage.high, tuned.confidence),
                (&tuned.window_choice, tuned.steps),
                (tuned.training, tuned.calibration, tuned.test),
                &tuned.statement,
                (tuned.share_of_worst_case, tuned.unit.word()),
            ))?;
        }
        Ok(())
    })
}

fn danger_csv(analysis: &Evaluation) -> Result<String, CommandError> {
    csv_text(|writer| {
        writer.write_record([
            "participant",
            "trial",
            "step",
            "probability_low",
            "probability_high",
            "entered",
            "steps",
            "calibration",
        ])?;
        for row in &analysis.danger.windows {
            writer.serialize((
                (&row.participant, row.trial, row.step),
                (row.bounds.low, row.bounds.high, u8::from(row.entered)),
                (row.bounds.steps, row.bounds.calibration),
            ))?;
        }
        Ok(())
    })
}

fn regions_svg(analysis: &Evaluation) -> Result<String, CommandError> {
    // Use the probabilities over windows that begin at every step, as in a live display.
    let Some(found) = analysis.regions.first() else {
        return Err(CommandError::Failure("no trajectory is long enough".to_owned()));
    };
    let name = |(j, epsilon): (usize, &f64)| {
        let p = found.probabilities.region[j];
        format!("ε = {epsilon}: p = {:.2} ({:.2}–{:.2})", p.value, p.low, p.high)
    };
    let names: Vec<String> = found.epsilon.iter().enumerate().map(name).collect();
    let note =
        format!("{}  ·  {}  ·  p over windows from every step", found.actions, note(analysis));
    Ok(figure::regions("Where the human may be", &note, &analysis.panels, &names).svg())
}
