//! A predictor from what one person drove: composes the library, decides nothing.

use sidestep::api::TrainedPredictor;
use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::learn::logistic::{LogisticSettings, fit};
use sidestep::learn::samples::Samples;
use sidestep::predict::Predictor;
use sidestep::predict::scale::Scale;
use sidestep::safety::SafetyLevels;
use sidestep::scene::JointState;
use sidestep::vehicle::TurnInput;

/// One trial to learn from.
pub type Driven = (Vec<TurnInput>, Vec<JointState>);

/// With fewer trials, a learned model says more about chance than about the person.
const MIN_TRIALS: usize = 5;

/// A logistic regression on `features` (experiment I: which way), or constant
/// probabilities with the reason why: too little to learn from, or no value functions
/// that safety levels could be read from.
///
/// # Errors
/// [`Invalid`] only for features or probabilities that do not fit, our own fault.
pub fn train(
    features: &FeatureSet,
    safety: Option<&SafetyLevels>,
    trials: &[Driven],
) -> Result<TrainedPredictor, Invalid> {
    let learned = enough(trials).and_then(|()| {
        let safety =
            safety.ok_or("this server has not solved the safety levels of these vehicles")?;
        learn(features, safety, trials).map_err(|invalid| format!("the fit failed: {invalid}"))
    });
    let (predictor, fallback) = match learned {
        Ok(predictor) => (predictor, None),
        Err(reason) => (frequencies(features, trials)?, Some(reason)),
    };
    Ok(TrainedPredictor { predictor: (&predictor).into(), trials: trials.len(), fallback })
}

fn enough(trials: &[Driven]) -> Result<(), String> {
    let n = trials.len();
    if n < MIN_TRIALS {
        return Err(format!("too few earlier trials ({n} of {MIN_TRIALS}) to learn from"));
    }
    let mut inputs = trials.iter().flat_map(|(inputs, _)| inputs);
    let first = inputs.next();
    if inputs.all(|input| Some(input) == first) {
        let word = first.map_or("no", |input| input.word());
        return Err(format!("the {n} earlier trials hold one kind of input only ({word})"));
    }
    Ok(())
}

/// Only inputs that occur are classes: nothing is known of the others.
fn learn(
    features: &FeatureSet,
    safety: &SafetyLevels,
    trials: &[Driven],
) -> Result<Predictor, Invalid> {
    let rows = trials.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
    let data = Dataset::from_trials(features, safety, rows);
    let occurring: Vec<TurnInput> = TurnInput::ALL
        .into_iter()
        .zip(data.class_counts())
        .filter_map(|(input, count)| (count > 0).then_some(input))
        .collect();
    let scale = Scale::fit(features.len(), &data.values);
    let width = features.len();
    let values: Vec<f64> = (0..)
        .zip(&data.values)
        .map(|(i, &value): (usize, _)| scale.apply(i % width, value))
        .collect();
    let class = |label: &TurnInput| occurring.iter().position(|input| input == label);
    let labels: Vec<usize> = data.labels.iter().filter_map(class).collect();
    let samples = Samples::new(width, &values, &labels, occurring.len())?;
    let model = fit(&samples, 1.0, LogisticSettings::default())?;
    let classes = occurring.into_iter().map(TurnInput::sign).collect();
    Ok(Predictor::logistic(features.clone(), classes, scale, model))
}

/// Inputs counted before any is seen: right, straight, left. Nothing is impossible
/// because it was not seen, and people drive straight for three steps in five.
const PRIOR: [f64; 3] = [1.0, 3.0, 1.0];

/// The frequencies of the inputs so far, with the prior's.
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
    use sidestep::predict::ModelFile;
    use sidestep::scene::{EncounterRange, SceneParameters, generate};
    use sidestep::trial::simulate;
    use std::ops::ControlFlow;

    fn solved(parameters: &SceneParameters) -> SafetyLevels {
        SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    fn driven(count: usize, turn: TurnInput) -> Vec<Driven> {
        driven_with(&SceneParameters::default(), count, turn)
    }

    fn driven_with(parameters: &SceneParameters, count: usize, turn: TurnInput) -> Vec<Driven> {
        let scenes = generate(parameters, &EncounterRange::default(), count, 3).unwrap();
        let drive = |(scene, _): &(sidestep::scene::Scene, _)| {
            let mut inputs = vec![TurnInput::Straight; parameters.steps];
            inputs[10..25].fill(turn);
            let states = simulate(parameters, scene.start(), &inputs);
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
        assert!(matches!(trained.predictor.model, ModelFile::Logistic(_)));
        assert_eq!(trained.predictor.classes, [0, 1]);
        assert_eq!(trained.trials, 5);
    }

    #[test]
    fn frequencies_where_there_is_too_little() {
        let safety = solved(&SceneParameters::default());
        let check = |trials: &[Driven], probabilities: [f64; 3], word: &str| {
            let trained = train(&hrd(), Some(&safety), trials).unwrap();
            assert_eq!(trained.predictor.classes, [-1, 0, 1]);
            assert_eq!(
                trained.predictor.model,
                ModelFile::Constant { probabilities: probabilities.to_vec() }
            );
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
        assert_eq!((trained.fallback, trained.predictor.features.len()), (None, 8));
        // Until they are solved, the reason is said.
        let trained = train(&hrd(), None, &trials).unwrap();
        assert!(trained.fallback.unwrap().contains("not solved"));
    }
}
