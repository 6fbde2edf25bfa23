//! Runs the comparison of `sidestep analyze` on the reference's synthetic people and features.

use std::error::Error;
use std::ops::ControlFlow;

use sidestep::comparison::sets::NamedSet;
use sidestep::comparison::tables::Comparison;
use sidestep::comparison::{ParticipantData, Settings, run};
use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::learn::participant::Driven;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::window::Trajectory;

use crate::learning::feature_rows;
use crate::recorded::{self, TASKS};

/// Number of steps of each task.
const STEPS: usize = 50;

/// The people of trials.csv. Their features B_hrd come from features.csv, which scikit-learn used.
/// The other features are computed by this function.
fn people(
    parameters: &SceneParameters,
    safety: &SafetyLevels,
) -> Result<Vec<ParticipantData>, Box<dyn Error>> {
    let all = FeatureSet::all();
    let names: Vec<&str> = all.features().map(|feature| feature.name).collect();
    let given = FeatureSet::subset("hrd")?;
    let places: Vec<Option<usize>> =
        given.features().map(|one| names.iter().position(|name| *name == one.name)).collect();
    let mut rows = feature_rows().into_iter();
    let mut people = Vec::new();
    for (number, drives) in recorded::drives().chunks(TASKS).enumerate() {
        let trials = drives.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
        let mut data = Dataset::from_trials(&all, safety, trials);
        for (i, label) in data.labels.iter().enumerate() {
            let row = rows.next().ok_or("fewer features than steps")?;
            let place = (row.participant, row.trial, row.step, row.y1);
            if place != (number, data.trials[i], i % STEPS, label.sign()) {
                return Err(format!("features of another row at {place:?}").into());
            }
            for (place, value) in places.iter().zip(row.features) {
                data.values[i * all.len() + place.ok_or("no such feature")?] = value;
            }
        }
        let trajectory = |(inputs, states): &Driven| {
            let mut states = states.clone();
            if let (Some(last), Some(&input)) = (states.last(), inputs.last()) {
                states.push(last.advance(parameters, input, 0.0, parameters.step_s));
            }
            let rates = inputs.iter().map(|&input| parameters.human.turn_rate(input));
            Trajectory::new(states, rates.collect())
        };
        people.push(ParticipantData {
            name: number.to_string(),
            line: None,
            numbers: (0..TASKS as u64).collect(),
            data,
            trajectories: drives.iter().map(trajectory).collect::<Result<_, _>>()?,
        });
    }
    Ok(people)
}

/// Compares the paper's seven sets on these people with the protocol's grids. Returns the people
/// and the comparison.
pub(crate) fn compared() -> Result<(Vec<ParticipantData>, Comparison), Box<dyn Error>> {
    let parameters = SceneParameters::default();
    let safety = recorded::safety();
    let people = people(&parameters, &safety)?;
    let settings = Settings { sets: NamedSet::papers()?, ..Settings::new()? };
    let go_on = |_| ControlFlow::Continue(());
    let comparison = run(&people, &parameters, &safety, &settings, None, &go_on)?.comparison;
    Ok((people, comparison))
}
