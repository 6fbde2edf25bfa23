//! Finds the smallest set that contains the next drive with probability ≥ 0.9, with a guarantee,
//! and then predicts online. `cargo run --release -p sidestep --example tune`.
#![allow(clippy::print_stdout, reason = "it shows what was tuned")]

use sidestep::clearance::OnlinePredictor;
use sidestep::features::FeatureSet;
use sidestep::learn::participant::{Driven, train};
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::tuning::{Split, TuningSettings, candidates, tune};
use sidestep::shfrs::window::Trajectory;
use sidestep::shfrs::window_sets::Prediction;
use sidestep::synthetic::{Keys, SyntheticParticipant};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    let person = SyntheticParticipant::new(7, 0);
    let drives = (0..120).map(|trial| person.own_trial(trial, Keys::Clock).1);
    let mut drives: Vec<Driven> = drives.map(|drive| (drive.inputs, drive.states)).collect();
    let unseen = drives.split_off(40); // a guarantee needs drives that the predictor has not seen
    let predictor = train(&FeatureSet::subset("hrd")?, Some(&safety), &drives)?.predictor;

    let driven = |(inputs, states): Driven| Trajectory::driven(states, &inputs, &parameters);
    let unseen = unseen.into_iter().map(driven).collect::<Result<Vec<_>, _>>()?;
    let sample = Split::default().parts(unseen.len())?.sample(&unseen);
    let settings = TuningSettings::new(0.9, Guarantee::Conformal, candidates(3, 10));
    let human = PredictedHuman::new(&predictor, &safety, &parameters)?;
    let tuned = tune(&sample, Prediction::new(&parameters, &human), &settings)?;
    println!("{}\nmean area {:.2} m², {}", tuned.statement, tuned.mean_area_m2, tuned.choice);

    let mut online = OnlinePredictor::tuned(&tuned, &[1.0], predictor, safety, parameters)?;
    online.push(unseen[0].states()[0])?;
    let first = &online.predict()?[0];
    println!("turns of the next steps: {:.2?} to {:.2?} rad/s", first.lo(), first.hi());
    Ok(())
}
