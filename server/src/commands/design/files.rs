//! The files that `sidestep design` writes.

use super::{CommandError, unwritable};
use crate::design::PhaseDesign;
use crate::design::balance::times;
use crate::figure;
use crate::formats::atomic_folder::Draft;
use csv::Writer;
use sidestep::chart::Drawing;
use sidestep::scene::{Coordinate, Scene, SceneParameters, StratifiedScene};
use sidestep::study::StudyConfig;
use sidestep::trial::{outcome, simulate};
use sidestep::vehicle::TurnInput;

/// The names of the files, in the order in which they are written.
pub(super) const FILES: [&str; 4] = ["strata.csv", "scenes.csv", "design.svg", "design.png"];

/// Writes the files into a draft.
pub(super) fn write(
    draft: &Draft,
    study: &StudyConfig,
    phases: &[PhaseDesign],
    picture: &Drawing,
) -> Result<(), CommandError> {
    let contents = [
        strata_csv(phases).map_err(CommandError::failure)?,
        scenes_csv(&study.parameters, phases).map_err(CommandError::failure)?,
        picture.svg().into_bytes(),
        figure::png(picture).map_err(CommandError::failure)?,
    ];
    FILES.into_iter().zip(contents).try_for_each(|(name, content)| {
        let path = draft.path().join(name);
        std::fs::write(&path, content).map_err(|e| unwritable(&path, &e))
    })
}

fn strata_csv(phases: &[PhaseDesign]) -> csv::Result<Vec<u8>> {
    let mut writer = Writer::from_writer(Vec::new());
    writer.write_record([
        "phase",
        "coordinate",
        "stratum",
        "low",
        "high",
        "unit",
        "planned",
        "realised",
    ])?;
    for PhaseDesign { phase, strata, people } in phases {
        for coordinate in Coordinate::ALL {
            let of = |cell: fn(&StratifiedScene) -> [usize; 3]| {
                let scenes = people.iter().flatten();
                times(phase.scenes, scenes, |scene| cell(scene)[coordinate as usize])
            };
            let [planned, realised] = [of(|scene| scene.planned), of(|scene| scene.strata)];
            for (stratum, (planned, realised)) in planned.into_iter().zip(realised).enumerate() {
                let ends = strata.ends(coordinate, stratum);
                let (unit, [low, high]) = match coordinate {
                    Coordinate::Approach => ("deg", ends.map(f64::to_degrees)),
                    Coordinate::Miss => ("m", ends),
                    Coordinate::Entry => ("s", ends),
                };
                writer.serialize((
                    (phase.phase.word(), coordinate.word(), stratum),
                    (low, high, unit),
                    (planned, realised),
                ))?;
            }
        }
    }
    whole(writer)
}

fn scenes_csv(parameters: &SceneParameters, phases: &[PhaseDesign]) -> csv::Result<Vec<u8>> {
    let mut writer = Writer::from_writer(Vec::new());
    writer.write_record([
        "place",
        "phase",
        "index",
        "approach_stratum",
        "miss_stratum",
        "entry_stratum",
        "planned_miss_stratum",
        "planned_entry_stratum",
        "approach_deg",
        "miss_m",
        "entry_s",
        "human_x",
        "human_y",
        "human_psi",
        "robot_x",
        "robot_y",
        "robot_psi",
        "goal_x",
        "goal_y",
        "closest_m",
        "robot",
    ])?;
    let participants = phases.first().map_or(0, |design| design.people.len());
    for place in 0..participants {
        for PhaseDesign { phase, people, .. } in phases {
            for (index, scene) in people[place].iter().enumerate() {
                let StratifiedScene { scene, encounter, strata, planned } = scene;
                let Scene { human, robot, goal, .. } = scene;
                writer.serialize((
                    (place, phase.phase.word(), index),
                    (strata, planned[1], planned[2]),
                    (encounter.approach_rad.to_degrees(), encounter.miss_m, encounter.entry_s),
                    (<[f64; 3]>::from(*human), <[f64; 3]>::from(*robot), goal),
                    closest_m(parameters, scene),
                    scene.robot_name(),
                ))?;
            }
        }
    }
    whole(writer)
}

/// The smallest distance in the trial if the human does not turn (m).
fn closest_m(parameters: &SceneParameters, scene: &Scene) -> f64 {
    let inputs = vec![TurnInput::Straight; parameters.steps];
    outcome(parameters, &inputs, &simulate(parameters, scene, &inputs)).closest_m
}

fn whole(writer: Writer<Vec<u8>>) -> csv::Result<Vec<u8>> {
    writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
}
