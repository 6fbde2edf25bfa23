//! `sidestep design`.

mod files;

use super::solving::Interrupt;
use super::{CommandError, print_json, unwritable};
use crate::design::balance::Balance;
use crate::design::{draw, picture, usual_participants};
use crate::formats::atomic_folder::Draft;
use crate::languages::Languages;
use crate::threads;
use sidestep::invalid::Invalid;
use sidestep::study::StudyConfig;
use std::path::PathBuf;

/// Show the scenes of a study before anybody is invited: their strata as a picture and a table.
///
/// Draws the scenes that the first participants of the study will be given, and counts how evenly
/// they are spread. Coordinates of a scene: approach, the human's heading less the robot's (degrees
/// counter-clockwise; 180 is head-on); miss, the distance of closest approach if nobody turns (m;
/// positive if the human is to the right of the robot's path as the human sees it); entry, the time at
/// which the human would enter the danger zone (s). Each coordinate of a phase is cut into as many
/// strata as the phase has scenes, numbered from 0.
///
/// Writes strata.csv: phase, coordinate, stratum, low, high, unit (of low and high); planned, realised:
/// scenes in the stratum over all participants. scenes.csv: place (of the participant, from 0), phase,
/// index (of the scene in the phase, from 0); approach_stratum, miss_stratum, entry_stratum;
/// planned_miss_stratum, planned_entry_stratum (they differ where the planned cell has no admissible
/// scene); approach_deg, miss_m, entry_s; human_x, human_y (m), human_psi (rad), robot_x, robot_y,
/// robot_psi, goal_x, goal_y: the start; closest_m: the smallest distance if nobody turns (m).
/// design.svg and design.png: how the phase with most scenes is spread, and the first participant's
/// scenes seen from above.
///
/// Prints one line of JSON. For each phase: scenes; block, the participants after which the orders
/// repeat; drawn, scenes of all participants; exchanged, scenes that exchanged a miss or entry stratum
/// because a planned cell has no admissible scene; unfilled, strata of single participants without a
/// scene; and the smallest and greatest number of times that each approach stratum occurs at a
/// position and directly after each other one, and that each pair of strata occurs.
#[derive(Clone, Debug, clap::Args)]
pub struct DesignArgs {
    /// Study file (TOML). A field that it omits has the paper's value.
    #[arg(long, value_name = "FILE.toml")]
    study: PathBuf,
    /// Folder for the files; made if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder with language files, as for `sidestep serve`: the study's texts are checked against
    /// them.
    #[arg(long, value_name = "DIR")]
    languages: Option<PathBuf>,
    /// Number of participants whose scenes are drawn, 1 to 10000 [default: one block of the phase
    /// with most scenes, which is its number of scenes if that is even and otherwise twice it; 50 if
    /// that is more than 100].
    #[arg(long, value_name = "N")]
    participants: Option<u64>,
}

/// Most participants, and most scenes of all of them.
const PARTICIPANTS: u64 = 10_000;
const SCENES: u64 = 1_000_000;

/// Draws the scenes and writes the files: all of them, or none.
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

/// How many participants: those asked for, or as many as show how evenly the scenes are spread.
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
