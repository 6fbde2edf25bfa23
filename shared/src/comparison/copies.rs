//! Finds bit-identical drives: one person under several names, or copies among one person's trials.

use super::tables::ComparedParticipant;
use crate::recording::{RecordedParticipant, RecordedTrial};
use crate::scene::JointState;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Bit-identical trials (inputs and states) of one participant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CopiedTrials {
    /// The participant's name or number in the data.
    pub participant: String,
    /// For each copied drive, the numbers of all trials with this drive (at least two).
    pub trials: Vec<Vec<u64>>,
    /// The number of test tasks that are identical to a training task (data leakage).
    pub leaking: usize,
}

fn bits(trial: &RecordedTrial) -> Vec<u64> {
    let inputs = trial.inputs.iter().map(|input| f64::from(input.sign()));
    let poses = trial.states.iter().flat_map(|JointState { human, robot }| [*human, *robot]);
    inputs.chain(poses.flat_map(<[f64; 3]>::from)).map(f64::to_bits).collect()
}

/// Returns the indices of equal keys, with one list for each key that occurs more than once.
fn alike<K: Ord>(keys: impl IntoIterator<Item = K>) -> Vec<Vec<usize>> {
    let mut places: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    for (place, key) in keys.into_iter().enumerate() {
        places.entry(key).or_default().push(place);
    }
    let mut alike: Vec<Vec<usize>> =
        places.into_values().filter(|places| places.len() > 1).collect();
    alike.sort_unstable();
    alike
}

fn recorded<'a>(all: &[&'a RecordedParticipant], name: &str) -> &'a [RecordedTrial] {
    let of = all.iter().copied().find(|participant| participant.name == name);
    of.map_or(&[], |participant| &participant.trials)
}

/// The names of participants whose trials are all identical to the trials of another participant.
pub(super) fn same_trials(
    all: &[&RecordedParticipant],
    compared: &[ComparedParticipant],
) -> Vec<String> {
    let of = |person: &ComparedParticipant| -> Vec<u64> {
        recorded(all, &person.name).iter().flat_map(bits).collect()
    };
    let mut places = alike(compared.iter().map(of)).concat();
    places.sort_unstable();
    places.into_iter().map(|place| compared[place].name.clone()).collect()
}

/// The participants with copies among their own trials.
pub(super) fn copied_trials(
    all: &[&RecordedParticipant],
    compared: &[ComparedParticipant],
) -> Vec<CopiedTrials> {
    let of = |person: &ComparedParticipant| {
        let own = recorded(all, &person.name);
        let places = alike(own.iter().map(bits));
        let numbers = |places: Vec<usize>| places.into_iter().map(|i| own[i].number).collect();
        let trials: Vec<Vec<u64>> = places.into_iter().map(numbers).collect();
        let tested: BTreeSet<u64> = person.test_trials.iter().copied().collect();
        let leaking = |same: &Vec<u64>| {
            let tested = same.iter().filter(|number| tested.contains(number)).count();
            if tested < same.len() { tested } else { 0 }
        };
        let leaking = trials.iter().map(leaking).sum();
        let participant = person.name.clone();
        (!trials.is_empty()).then_some(CopiedTrials { participant, trials, leaking })
    };
    compared.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Phase;
    use crate::vehicle::{Pose, TurnInput};

    fn trial(number: u64, x: f64, input: TurnInput) -> RecordedTrial {
        let state = JointState { human: Pose::new(x, 0.0, 0.0), robot: Pose::new(9.0, 0.0, 0.0) };
        RecordedTrial {
            line: None,
            number,
            phase: Phase::Task,
            attempt: 1,
            trial_id: None,
            inputs: vec![input],
            states: vec![state],
            started_at_ms: None,
            sampled_at_ms: None,
            flags: Vec::new(),
            robot: None,
        }
    }

    /// Of tasks 0 to 4, task 4 is for testing. Task 4 repeats task 1, and task 3 repeats task 0.
    #[test]
    fn trials_that_were_copied_are_found_and_those_that_leak_are_counted() {
        use TurnInput::{Left, Right};
        let drives = [(0.0, Left), (1.0, Left), (1.0, Right), (0.0, Left), (1.0, Left)];
        let trials = (0..).zip(drives).map(|(number, (x, input))| trial(number, x, input));
        let person = |name: &str, trials: &[RecordedTrial]| RecordedParticipant {
            name: name.to_owned(),
            trials: trials.to_vec(),
            ..RecordedParticipant::default()
        };
        let all: Vec<RecordedTrial> = trials.collect();
        let people = [person("a", &all), person("b", &all[..3]), person("c", &all[..3])];
        let compared = people.each_ref().map(|of| ComparedParticipant {
            name: of.name.clone(),
            test_trials: vec![4],
            training_trials: vec![0, 1, 2, 3],
            steps: 1,
        });
        let recorded: Vec<&RecordedParticipant> = people.iter().collect();
        let found = copied_trials(&recorded, &compared);
        let trials = vec![vec![0, 3], vec![1, 4]];
        assert_eq!(found, [CopiedTrials { participant: "a".to_owned(), trials, leaking: 1 }]);
        assert_eq!(same_trials(&recorded, &compared), ["b", "c"]);
    }
}
