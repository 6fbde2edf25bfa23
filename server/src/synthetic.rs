//! Whether trials were driven by synthetic participants, so that nobody takes what is found in
//! them for something about people.

use crate::formats::trials_csv::{FileTrial, Person};
use sidestep::scene::JointState;
use sidestep::synthetic::{Keys, SyntheticParticipant};

/// The seed of the project's reference data, whose files do not say what they are.
pub const REFERENCE_SEED: u64 = 20_180_918;

/// The numbers of its people, who may be called otherwise in a copy.
const REFERENCE_PEOPLE: core::ops::Range<u64> = 0..8;

/// Why these people's trials are known to be synthetic, if they are: they are
/// marked, or those of the reference, which are driven again to see.
#[must_use]
pub fn recognised(people: &[Person]) -> Option<String> {
    let marked: Vec<&str> =
        people.iter().filter(|person| person.synthetic).map(|person| &person.name[..]).collect();
    if marked.len() == people.len() && !people.is_empty() {
        return Some("the file or the server marks all of them as synthetic".to_owned());
    }
    if !marked.is_empty() {
        let (some, all) = (marked.len(), people.len());
        // Who they are, as long as that can be read.
        let names = if some <= 12 { format!(": {}", marked.join(", ")) } else { String::new() };
        return Some(format!(
            "the file or the server marks {some} of {all} people as synthetic{names}"
        ));
    }
    let known = people.iter().any(is_of_the_reference);
    known.then(|| format!("the same as those of seed {REFERENCE_SEED}"))
}

fn is_of_the_reference(person: &Person) -> bool {
    let Some(trial) = person.trials.first() else {
        return false;
    };
    let own = person.name.parse::<u64>().ok();
    own.into_iter().chain(REFERENCE_PEOPLE).any(|number| begins_as(number, trial))
}

/// Whether the trial begins as that person's of the reference.
fn begins_as(number: u64, trial: &FileTrial) -> bool {
    let (scene, _) =
        SyntheticParticipant::new(REFERENCE_SEED, number).own_trial(trial.number, Keys::Free);
    let numbers = |state: &JointState| {
        let ([hx, hy, hpsi], [rx, ry, rpsi]) = (state.human.into(), state.robot.into());
        [hx, hy, hpsi, rx, ry, rpsi]
    };
    let near = |(a, b): (f64, f64)| (a - b).abs() < 1e-6;
    let (own, driven) = (numbers(&scene.start()), numbers(&trial.states[0]));
    own.into_iter().zip(driven).all(near)
}
