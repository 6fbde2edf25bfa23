//! Checks bounds on the probability that the human enters the danger zone, in simulated scenes.

use rayon::prelude::*;
use serde_json::json;
use sidestep::invalid::Invalid;
use sidestep::math::SeededRng;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::danger::danger_bounds;
use sidestep::shfrs::scores::Scores;
use sidestep::shfrs::window_sets::Prediction;

use crate::Found;
use crate::reacting::{PREDICTED, Population, choice};

const SCENES: usize = 4000;
/// Number of trajectories in a calibration.
const CALIBRATION: usize = 100;
const ALPHAS: [f64; 5] = [0.05, 0.1, 0.2, 0.3, 0.5];

/// Lower bound, upper bound, and whether the human entered.
type Scene = (f64, f64, bool);

pub(crate) fn check() -> Found {
    let parameters = SceneParameters::default();
    let Population { drives, scores } = Population::new(SCENES, &parameters)?;
    // Each scene has its own calibration, drawn from the other scenes.
    let scene = |i: usize| -> Result<Scene, Invalid> {
        let mut rng = SeededRng::new(67 + i as u64);
        let other = |_| scores[(i + 1 + rng.below(SCENES - 1)) % SCENES];
        let scores = Scores::new((0..CALIBRATION).map(other).collect())?;
        let prediction = Prediction::new(&parameters, &PREDICTED);
        let states = drives[i].states();
        let found = danger_bounds(&states[..1], &prediction, &choice(), &scores)?;
        let near =
            |state: &sidestep::scene::JointState| state.distance_m() <= parameters.danger_radius_m;
        Ok((found.low, found.high, states[1..].iter().any(near)))
    };
    let scenes: Vec<Scene> = (0..SCENES).into_par_iter().map(scene).collect::<Result<_, _>>()?;
    let share = |of: &dyn Fn(&Scene) -> bool| {
        scenes.iter().filter(|scene| of(scene)).count() as f64 / SCENES as f64
    };
    let mean = |of: &dyn Fn(&Scene) -> f64| scenes.iter().map(of).sum::<f64>() / SCENES as f64;
    let row = |alpha: f64| {
        json!({
            "alpha": alpha,
            // Binomial standard error of a share α of the scenes.
            "error": (alpha * (1.0 - alpha) / SCENES as f64).sqrt(),
            // Share of the scenes in which the human entered although U ≤ α, and share in which the
            // human stayed out although L ≥ 1 − α.
            "entered_against": share(&|&(_, high, entered)| entered && high <= alpha),
            "stayed_out_against": share(&|&(low, _, entered)| !entered && low >= 1.0 - alpha),
            // Share of the scenes with U ≤ α, and share with L ≥ 1 − α.
            "said_out": share(&|&(_, high, _)| high <= alpha),
            "said_in": share(&|&(low, _, _)| low >= 1.0 - alpha),
        })
    };
    Ok(json!({
        "scenes": SCENES,
        "calibration": CALIBRATION,
        // Means over the scenes: the lower bound L, the share in which the human entered, and the
        // upper bound U.
        "low": mean(&|scene| scene.0),
        "entered": share(&|scene| scene.2),
        "high": mean(&|scene| scene.1),
        // Share of the scenes whose bounds are less than 0.1 apart.
        "narrow": share(&|scene| scene.1 - scene.0 < 0.1),
        "rows": ALPHAS.map(row),
    }))
}
