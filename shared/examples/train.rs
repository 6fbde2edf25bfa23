//! Trains a predictor of a person's next input on the person's drives, and evaluates it on other
//! drives. `cargo run --release -p sidestep --example train`.
#![allow(clippy::print_stdout, reason = "it shows what was learned")]

use sidestep::features::FeatureSet;
use sidestep::learn::participant::{Driven, train};
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::synthetic::{Keys, SyntheticParticipant};
use std::error::Error;
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn Error>> {
    let parameters = SceneParameters::default(); // the paper's vehicles
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    let person = SyntheticParticipant::new(7, 0);
    let drives = (0..50).map(|trial| person.own_trial(trial, Keys::Clock).1);
    let drives: Vec<Driven> = drives.map(|drive| (drive.inputs, drive.states)).collect();
    let (seen, unseen) = drives.split_at(40);

    let features = FeatureSet::subset("hrd")?; // with both safety levels
    let predictor = train(&features, Some(&safety), seen)?.predictor;

    let (mut right, mut all, mut row) = (0, 0, vec![0.0; features.len()]);
    for (inputs, states) in unseen {
        for (step, input) in inputs.iter().enumerate() {
            features.compute_into(&states[..=step], &safety, &mut row);
            right += usize::from(predictor.class(&row) == input.sign());
            all += 1;
        }
    }
    println!("{right} of {all} inputs of unseen drives were predicted");
    Ok(())
}
