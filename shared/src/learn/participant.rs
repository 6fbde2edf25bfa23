//! Trains the predictor of one participant's turns on the trials of this participant.

use super::logistic::{LogisticSettings, fit};
use super::samples::Samples;
use crate::dataset::Dataset;
use crate::features::FeatureSet;
use crate::invalid::Invalid;
use crate::predict::Predictor;
use crate::predict::scale::Scale;
use crate::safety::SafetyLevels;
use crate::scene::JointState;
use crate::vehicle::TurnInput;

/// A trial for training: the input of each step, and the joint state before each step.
pub type Driven = (Vec<TurnInput>, Vec<JointState>);

/// A predictor, and how it was trained.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The predictor.
    pub predictor: Predictor,
    /// The reason why the predictor returns only the frequencies of the inputs. `None` if it
    /// contains a trained model.
    pub fallback: Option<String>,
}

/// Minimum number of trials. A model trained on fewer trials would mostly fit noise.
const MIN_TRIALS: usize = 5;

/// Trains a logistic regression on `features` that predicts the turn direction (experiment 1). If
/// training is impossible, for example because there are too few trials or no safety levels, the
/// predictor has constant probabilities and [`Trained::fallback`] states the reason.
///
/// # Example
/// ```
/// use core::ops::ControlFlow;
/// use sidestep::features::FeatureSet;
/// use sidestep::safety::SafetyLevels;
/// use sidestep::scene::SceneParameters;
/// use sidestep::synthetic::{Keys, SyntheticParticipant};
/// use sidestep::learn::participant::train;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let parameters = SceneParameters::default(); // the paper's vehicles
/// let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
/// let person = SyntheticParticipant::new(7, 0);
/// let drives = (0..10).map(|trial| person.own_trial(trial, Keys::Clock).1);
/// let drives: Vec<_> = drives.map(|drive| (drive.inputs, drive.states)).collect();
/// let features = FeatureSet::subset("hrd")?;
/// let trained = train(&features, Some(&safety), &drives)?;
/// assert_eq!(trained.fallback, None);
///
/// let (mut row, mut probabilities) = (vec![0.0; features.len()], [0.0; 3]);
/// features.compute_into(&drives[0].1[..1], &safety, &mut row);
/// trained.predictor.probabilities_into(&row, &mut probabilities); // right, straight, left
/// assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Invalid`] if features or probabilities are inconsistent, which would be a bug in this library.
pub fn train(
    features: &FeatureSet,
    safety: Option<&SafetyLevels>,
    trials: &[Driven],
) -> Result<Trained, Invalid> {
    train_early(features, safety, trials, MIN_TRIALS)
}

/// Like [`train`], but `least` is the minimum number of trials. Callers use it to show how a model
/// improves with more data.
///
/// # Errors
/// The errors of [`train`].
pub fn train_early(
    features: &FeatureSet,
    safety: Option<&SafetyLevels>,
    trials: &[Driven],
    least: usize,
) -> Result<Trained, Invalid> {
    let learned = enough(trials, least).and_then(|()| {
        let safety =
            safety.ok_or("this server has not solved the safety levels of these vehicles")?;
        let rows = trials.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
        logistic(&Dataset::from_trials(features, safety, rows))
            .map_err(|invalid| format!("the fit failed: {invalid}"))
    });
    Ok(match learned {
        Ok(predictor) => Trained { predictor, fallback: None },
        Err(reason) => {
            Trained { predictor: frequencies(features, trials)?, fallback: Some(reason) }
        }
    })
}

fn enough(trials: &[Driven], least: usize) -> Result<(), String> {
    let n = trials.len();
    if n < least {
        return Err(format!("too few earlier trials ({n} of {least}) to learn from"));
    }
    let mut inputs = trials.iter().flat_map(|(inputs, _)| inputs);
    let first = inputs.next();
    if inputs.all(|input| Some(input) == first) {
        let word = first.map_or("no", |input| input.word());
        return Err(format!("the {n} earlier trials contain only one kind of input ({word})"));
    }
    Ok(())
}

/// Trains a logistic regression (C = 1) on standardised rows. The classes are the inputs that occur
/// in the data, because nothing can be learned about other inputs.
///
/// # Errors
/// [`Invalid`] if there are no rows, fewer than two kinds of input occur, a number is not finite,
/// or the fit does not converge.
pub fn logistic(data: &Dataset) -> Result<Predictor, Invalid> {
    let occurring: Vec<TurnInput> = TurnInput::ALL
        .into_iter()
        .zip(data.class_counts())
        .filter_map(|(input, count)| (count > 0).then_some(input))
        .collect();
    let width = data.features.len();
    let (scale, values) = Scale::standardised(width, &data.values);
    let class = |label: &TurnInput| occurring.iter().position(|input| input == label);
    let labels: Vec<usize> = data.labels.iter().filter_map(class).collect();
    let samples = Samples::new(width, &values, &labels, occurring.len())?;
    let model = fit(&samples, 1.0, LogisticSettings::default())?;
    let classes = occurring.into_iter().map(TurnInput::sign).collect();
    Ok(Predictor::logistic(data.features.clone(), classes, scale, model))
}

/// Prior counts of right, straight and left. They give unseen inputs a positive probability. Their
/// proportions reflect that people drive straight in three of five steps.
const PRIOR: [f64; 3] = [1.0, 3.0, 1.0];

/// A predictor that returns the frequencies of the inputs so far, including the prior counts.
fn frequencies(features: &FeatureSet, trials: &[Driven]) -> Result<Predictor, Invalid> {
    let inputs = || trials.iter().flat_map(|(inputs, _)| inputs);
    let total = inputs().count() as f64 + PRIOR.iter().sum::<f64>();
    let share = |(class, prior): (TurnInput, f64)| {
        let count = inputs().filter(|&&input| input == class).count();
        (count as f64 + prior) / total
    };
    let shares = TurnInput::ALL.into_iter().zip(PRIOR).map(share).collect();
    let classes = TurnInput::ALL.map(TurnInput::sign).to_vec();
    Predictor::constant(features.clone(), classes, shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{EncounterRange, SceneParameters, generate};
    use crate::trial::simulate;
    use core::ops::ControlFlow;

    fn solved(parameters: &SceneParameters) -> SafetyLevels {
        SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    fn driven(count: usize, turn: TurnInput) -> Vec<Driven> {
        driven_with(&SceneParameters::default(), count, turn)
    }

    fn driven_with(parameters: &SceneParameters, count: usize, turn: TurnInput) -> Vec<Driven> {
        let scenes = generate(parameters, &EncounterRange::default(), count, 3).unwrap();
        let drive = |(scene, _): &(crate::scene::Scene, _)| {
            let mut inputs = vec![TurnInput::Straight; parameters.steps];
            inputs[10..25].fill(turn);
            let states = simulate(parameters, scene, &inputs);
            (inputs, states)
        };
        scenes.iter().map(drive).collect()
    }

    fn hrd() -> FeatureSet {
        FeatureSet::subset("hrd").unwrap()
    }

    #[test]
    fn a_model_of_the_classes_that_occur() {
        let safety = solved(&SceneParameters::default());
        let trained = train(&hrd(), Some(&safety), &driven(5, TurnInput::Left)).unwrap();
        assert_eq!(trained.fallback, None);
        assert_eq!(trained.predictor.classes(), [0, 1]);
    }

    #[test]
    fn frequencies_where_there_is_too_little() {
        let safety = solved(&SceneParameters::default());
        let check = |trials: &[Driven], probabilities: [f64; 3], word: &str| {
            let trained = train(&hrd(), Some(&safety), trials).unwrap();
            let expected =
                Predictor::constant(hrd(), vec![-1, 0, 1], probabilities.to_vec()).unwrap();
            assert_eq!(trained.predictor, expected);
            assert!(trained.fallback.unwrap().contains(word));
        };
        check(&[], [0.2, 0.6, 0.2], "(0 of 5)");
        let one = driven(1, TurnInput::Right);
        check(&one, [16.0 / 55.0, 38.0 / 55.0, 1.0 / 55.0], "(1 of 5)");
        let straight = driven(5, TurnInput::Straight);
        check(&straight, [1.0 / 255.0, 253.0 / 255.0, 1.0 / 255.0], "(straight)");
    }

    #[test]
    fn different_vehicles_are_learned_from_with_their_own_levels() {
        let mut parameters = SceneParameters::default();
        parameters.robot.turn_rate_radps = 0.35;
        let trials = driven_with(&parameters, 5, TurnInput::Left);
        let trained = train(&hrd(), Some(&solved(&parameters)), &trials).unwrap();
        assert_eq!((trained.fallback, trained.predictor.features().len()), (None, 8));
        // Without safety levels, the fallback states the reason.
        let trained = train(&hrd(), None, &trials).unwrap();
        assert!(trained.fallback.unwrap().contains("not solved"));
    }
}
