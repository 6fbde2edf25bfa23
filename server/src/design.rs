//! The assignment of a study's scenes to its participants, for a preview before anyone is invited.

pub mod balance;

use crate::figure;
use balance::Balance;
use sidestep::chart::Drawing;
use sidestep::invalid::Invalid;
use sidestep::scene::{Stratification, StratifiedScene, williams_block};
use sidestep::study::{PhaseConfig, StudyConfig};

/// The scenes of a phase for all participants.
#[derive(Clone, Debug)]
pub struct PhaseDesign {
    /// The phase.
    pub phase: PhaseConfig,
    /// The strata of the phase.
    pub strata: Stratification,
    /// The scenes of each participant, in order. The index of a participant is their place in the
    /// design, from 0.
    pub people: Vec<Vec<StratifiedScene>>,
}

/// The default number of participants for the preview. It is the block of the phase with the most
/// scenes, which is the number of participants after which the orders repeat. If a block has more
/// than 100 participants, it is 50.
#[must_use]
pub fn usual_participants(study: &StudyConfig) -> u64 {
    let largest = study.phases.iter().map(|phase| phase.scenes).max().unwrap_or(1);
    let block = williams_block(largest) as u64;
    if block > 100 { 50 } else { block }
}

/// The scenes of the first participants of a study, by phase.
///
/// # Errors
/// [`Invalid`] if no scene is admissible.
pub fn draw(study: &StudyConfig, participants: u64) -> Result<Vec<PhaseDesign>, Invalid> {
    let mut designs = study
        .phases
        .iter()
        .map(|&phase| {
            let strata = Stratification::new(&study.parameters, &study.encounters, phase.scenes)?;
            Ok(PhaseDesign { phase, strata, people: Vec::new() })
        })
        .collect::<Result<Vec<_>, Invalid>>()?;
    for place in 0..participants {
        for (design, (_, scenes)) in designs.iter_mut().zip(study.stratified(place)?) {
            design.people.push(scenes);
        }
    }
    Ok(designs)
}

/// Draws the phase with the most scenes. If there are several such phases, draws the last one,
/// because tasks come last.
#[must_use]
pub fn picture(study: &StudyConfig, phases: &[PhaseDesign]) -> Drawing {
    let Some(shown) = phases.iter().max_by_key(|design| design.phase.scenes) else {
        return Drawing::new(&study.title, "", [1.0, 1.0]);
    };
    let counts: Vec<String> = study
        .phases
        .iter()
        .map(|phase| format!("{} {}", phase.phase.word(), phase.scenes))
        .collect();
    let balance = Balance::of(shown);
    let percent = 100.0 * balance.exchanged as f64 / (balance.drawn as f64).max(1.0);
    let notes = [
        format!(
            "Study {}  ·  {} participants  ·  scenes of each: {}  ·  shown here: {}",
            study.slug,
            shown.people.len(),
            counts.join(", "),
            shown.phase.phase.word(),
        ),
        format!(
            "{percent:.0} % of the scenes are from another stratum than planned, because the study’s \
             settings allow no scene in the planned one  ·  strata without a scene: {} of {}",
            balance.unfilled,
            3 * balance.drawn,
        ),
    ];
    figure::design(&notes, &study.parameters, &shown.strata, &shown.people)
}
