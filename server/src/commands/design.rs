//! `sidestep design`.

mod files;

use super::solving::Interrupt;
use super::{CommandError, print_json, unwritable};
use crate::design::balance::Balance;
use crate::design::{draw, picture, usual_participants};
use crate::formats::atomic_folder::Draft;
use crate::languages::Languages;
use crate::support::threads;
use sidestep::invalid::Invalid;
use sidestep::study::StudyConfig;
use std::path::PathBuf;

/// Preview the scenes of a study before inviting anyone: their strata as a picture and a table.
///
/// Draws the scenes of the study's first participants, and counts how evenly the scenes are spread.
/// A scene has three coordinates. Approach is the human's heading minus the robot's (degrees
/// counter-clockwise; 180 is head-on). Miss is the distance of closest approach if nobody turns (m;
/// positive if the human is to the right of the robot's path relative to the human). Entry is the
/// time at which the human would enter the danger zone (s). Each coordinate of a phase is divided
/// into one stratum per scene of the phase, numbered from 0.
///
/// Writes strata.csv: phase, coordinate, stratum, low, high, unit (of low and high); planned,
/// realised: scenes in the stratum over all participants. scenes.csv: place (of the participant,
/// from 0), phase, index (of the scene in the phase, from 0); approach_stratum, miss_stratum,
/// entry_stratum; planned_miss_stratum, planned_entry_stratum (different if the planned cell has no
/// admissible scene); approach_deg, miss_m, entry_s; human_x, human_y (m), human_psi (rad),
/// robot_x, robot_y, robot_psi, goal_x, goal_y: the start; closest_m: the smallest distance if the
/// human does not turn (m); robot: its name in the study. design.svg and design.png: the spread of
/// the phase with the most scenes, and the first participant's scenes from above, if nobody turns.
///
/// Prints one line of JSON with, for each phase: scenes; block, the number of participants after
/// which the orders repeat; drawn, the number of scenes of all participants; exchanged, the number
/// of scenes with another miss or entry stratum because the planned cell has no admissible scene;
/// unfilled, the number of strata of single participants without a scene; and the smallest and
/// greatest counts of each approach stratum at a position, of each approach stratum directly after
/// each other one, and of each pair of strata.
#[derive(Clone, Debug, clap::Args)]
pub struct DesignArgs {
    /// Study file (TOML); omitted fields take the paper's values.
    #[arg(long, value_name = "FILE.toml")]
    study: PathBuf,
    /// Folder for the files; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder with language files, as for `sidestep serve`, against which the study's texts are checked.
    #[arg(long, value_name = "DIR")]
    languages: Option<PathBuf>,
    /// Number of participants to draw scenes for, 1 to 10000 [default: one block].
    ///
    /// A block is the number of scenes of the phase with the most scenes, doubled if it is odd. If
    /// a block is more than 100, the default is 50.
    #[arg(long, value_name = "N")]
    participants: Option<u64>,
}

/// Upper bounds on the number of participants, and on the total number of their scenes.
const PARTICIPANTS: u64 = 10_000;
const SCENES: u64 = 1_000_000;

/// Draws the scenes and writes all files or none.
///
/// # Errors
/// [`CommandError`] for a bad flag or study (input), or files that cannot be written (failure).
pub async fn run(args: DesignArgs) -> Result<(), CommandError> {
    let interrupt = Interrupt::listen();
    let languages = Languages::load(args.languages.as_deref()).map_err(CommandError::Input)?;
    let file = languages.read_study(&args.study).map_err(CommandError::Input)?;
    let participants = participants(file.config(), args.participants)?;
    let draft = Draft::begin(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let work = move || {
        let study = file.config();
        let wrong = |invalid: Invalid| CommandError::Input(file.complaint(&invalid));
        let phases = draw(study, participants).map_err(wrong)?;
        let picture = picture(study, &phases);
        files::write(&draft, study, &phases, &picture)?;
        let balances: Vec<Balance> = phases.iter().map(Balance::of).collect();
        Ok::<_, CommandError>((draft, balances))
    };
    let found = interrupt.unless_stopped(threads::run("design", None, work)).await;
    let (draft, phases) = found?.map_err(CommandError::failure)??;
    draft.keep(&[], &interrupt.token).map_err(|e| interrupt.unwritten(&args.out, &e))?;
    for balance in &phases {
        balance.explain();
    }
    print_json(&serde_json::json!({
        "folder": args.out,
        "files": files::FILES,
        "participants": participants,
        "phases": phases,
    }))
}

/// The requested number of participants. The default is large enough to show how evenly the scenes are
/// distributed.
fn participants(study: &StudyConfig, wanted: Option<u64>) -> Result<u64, CommandError> {
    let scenes: u64 = study.phases.iter().map(|phase| phase.scenes as u64).sum();
    let most = PARTICIPANTS.min(SCENES / scenes.max(1));
    let Some(wanted) = wanted else { return Ok(usual_participants(study)) };
    if (1..=most).contains(&wanted) {
        return Ok(wanted);
    }
    let message = format!(
        "--participants: expected a whole number from 1 to {most} (with {scenes} scenes each), \
         found {wanted}"
    );
    Err(CommandError::Input(message))
}
