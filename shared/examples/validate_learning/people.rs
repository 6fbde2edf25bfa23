//! The reference's synthetic people with its features, compared as `sidestep analyze` does.

use std::error::Error;
use std::ops::ControlFlow;

use serde::Deserialize;
use sidestep::comparison::cell::NamedSet;
use sidestep::comparison::tables::Comparison;
use sidestep::comparison::{ParticipantData, Settings, run};
use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::window::Trajectory;

#[allow(dead_code, reason = "the other page's example uses the rest")]
#[path = "../validate_shfrs/people.rs"]
mod recorded;

/// A row of features.csv: participant, trial and step, B_hrd, and both labels.
#[derive(Deserialize)]
struct Row {
    participant: usize,
    trial: usize,
    step: usize,
    features: [f64; 8],
    y1: i8,
    _y2: i8,
}

/// Tasks of each person, and steps of each task.
const TASKS: usize = 50;

/// The people of trials.csv. Their B_hrd is that of features.csv, which scikit-learn saw; other
/// features are computed.
pub(crate) fn people() -> Result<Vec<ParticipantData>, Box<dyn Error>> {
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    let all = FeatureSet::all();
    let names: Vec<&str> = all.features().map(|feature| feature.name).collect();
    let given = FeatureSet::subset("hrd")?;
    let places: Vec<Option<usize>> =
        given.features().map(|one| names.iter().position(|name| *name == one.name)).collect();
    let mut reader = csv::Reader::from_reader(&include_bytes!("../../tests/data/features.csv")[..]);
    let mut rows = reader.records();
    let mut people = Vec::new();
    for (number, drives) in recorded::drives()?.chunks(TASKS).enumerate() {
        let trials = drives.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
        let mut data = Dataset::from_trials(&all, &safety, trials);
        for (i, label) in data.labels.iter().enumerate() {
            let row: Row = rows.next().ok_or("fewer features than steps")??.deserialize(None)?;
            let place = (row.participant, row.trial, row.step, row.y1);
            if place != (number, data.trials[i], i % TASKS, label.sign()) {
                return Err(format!("features of another row at {place:?}").into());
            }
            for (place, value) in places.iter().zip(row.features) {
                data.values[i * all.len() + place.ok_or("no such feature")?] = value;
            }
        }
        let trajectory = |(inputs, states): &recorded::Drive| {
            let mut states = states.clone();
            if let (Some(last), Some(&input)) = (states.last(), inputs.last()) {
                states.push(last.advance(&parameters, input, parameters.step_s));
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

/// The comparison of the paper's seven sets with the protocol's grids.
pub(crate) fn compared(people: &[ParticipantData]) -> Result<Comparison, Box<dyn Error>> {
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    let settings = Settings { sets: NamedSet::papers()?, ..Settings::new()? };
    let go_on = |_| ControlFlow::Continue(());
    Ok(run(people, &parameters, &safety, &settings, None, &go_on)?.comparison)
}
