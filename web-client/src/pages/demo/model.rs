//! The model of the driver, which learns from each scene, and the quality of its predictions.

use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::learn::participant::{Driven, Trained, train_early};
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::probability::regions;
use sidestep::shfrs::window::{Trajectory, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;
use sidestep::shfrs::{PredictedHuman, ShfrsSettings};
use sidestep::trial_view::{Learned, Playback};

/// The model that was learned from the driver.
pub(super) struct Model {
    driven: Vec<Driven>,
    /// Whether the model is fitted. Otherwise it has only the frequencies of the inputs.
    pub(super) is_fitted: bool,
    /// The predictor.
    pub(super) learned: Learned,
    /// For each scene, how well it was predicted by the model learned before it.
    pub(super) foreseen: Vec<Foreseen>,
}

/// How well a scene was predicted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Foreseen {
    /// Fraction of the steps whose input was predicted as the most probable one.
    pub(super) inputs: f64,
    /// For each set, smallest first: the fraction of the windows whose true future stayed inside
    /// the set.
    pub(super) inside: Vec<f64>,
}

/// Minimum number of scenes to train on. On this page, one scene is enough, so that users can watch
/// the model learn.
const LEAST: usize = 1;

/// Confidence level of intervals. This page does not show them.
const CONFIDENCE: f64 = 0.95;

impl Model {
    /// Creates the model of an unknown driver.
    pub(super) fn new(safety: &SafetyLevels) -> Result<Self, Invalid> {
        let (learned, is_fitted) = learn(safety, &[])?;
        Ok(Self { driven: Vec::new(), is_fitted, learned, foreseen: Vec::new() })
    }

    /// Number of scenes that the model has learned from.
    pub(super) fn scenes(&self) -> usize {
        self.driven.len()
    }

    /// For each set, the fraction of all scenes' windows whose true future stayed inside. It is the
    /// mean over the scenes, because all scenes have the same number of windows.
    pub(super) fn inside(&self) -> Vec<f64> {
        let sets = self.foreseen.first().map_or(0, |foreseen| foreseen.inside.len());
        let mean = |set| {
            let shares = self.foreseen.iter().map(|foreseen| foreseen.inside[set]);
            shares.sum::<f64>() / self.foreseen.len() as f64
        };
        (0..sets).map(mean).collect()
    }

    /// Compares a scene with the model's prediction, then learns from the scene.
    pub(super) fn learn(&mut self, scene: &Playback, safety: &SafetyLevels) -> Result<(), Invalid> {
        self.foreseen.push(self.compare(scene, safety)?);
        let recorded = scene.recorded();
        self.driven.push((recorded.inputs.clone(), recorded.states.clone()));
        (self.learned, self.is_fitted) = learn(safety, &self.driven)?;
        Ok(())
    }

    fn compare(&self, scene: &Playback, safety: &SafetyLevels) -> Result<Foreseen, Invalid> {
        let recorded = scene.recorded();
        let likeliest = scene.forecast().iter().map(|probabilities| {
            let likeliest = probabilities.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            likeliest.map(|(input, _)| *input)
        });
        let right =
            recorded.inputs.iter().zip(likeliest).filter(|(done, said)| Some(**done) == *said);
        let inputs = right.count() as f64 / recorded.inputs.len() as f64;
        let inside = inside(&recorded.parameters, recorded, &self.learned, safety)?;
        Ok(Foreseen { inputs, inside })
    }
}

/// For each set, the fraction of the windows of a trial whose future stayed inside the set.
fn inside(
    parameters: &SceneParameters,
    recorded: &sidestep::trial_view::Recorded,
    learned: &Learned,
    safety: &SafetyLevels,
) -> Result<Vec<f64>, Invalid> {
    let rates = recorded.inputs.iter().map(|&input| parameters.human.turn_rate(input)).collect();
    let trajectory = Trajectory::new(recorded.states.clone(), rates)?;
    let human = PredictedHuman::new(&learned.predictor, safety, parameters)?;
    let prediction = Prediction::new(parameters, &human);
    let choice = WindowChoice::EveryStep;
    let settings = &learned.settings.bounds;
    let counted = regions(&[trajectory], choice, prediction, settings, CONFIDENCE)?;
    Ok(counted.probabilities.inside.iter().map(|share| share.value).collect())
}

/// Trains a logistic regression on all features. If there is too little to learn from, the
/// predictor has only the frequencies of the inputs.
fn learn(safety: &SafetyLevels, driven: &[Driven]) -> Result<(Learned, bool), Invalid> {
    let features = FeatureSet::subset("hrd")?;
    let Trained { predictor, fallback } = train_early(&features, Some(safety), driven, LEAST)?;
    let settings = ShfrsSettings::paper(predictor.classes().len())?;
    Ok((Learned { predictor, settings }, fallback.is_none()))
}
