//! Do calibrated levels keep their guarantees? Calibrations are drawn from a population that is
//! completely known, so the coverage of a level is counted, not estimated.

use rayon::prelude::*;
use serde_json::{Value, json};
use sidestep::bounds::Rollout;
use sidestep::invalid::Invalid;
use sidestep::math::SeededRng;
use sidestep::reach::ReachableSet;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::guarantee::{Guarantee, fixed_sequence};
use sidestep::shfrs::scores::Scores;
use sidestep::shfrs::window::Trajectory;
use sidestep::shfrs::window_sets::Prediction;
use sidestep::vehicle::Pose;

use crate::reacting::{PREDICTED, Population, choice, window};
use crate::{Found, SPEED_MPS, STEP_S};

const POPULATION: usize = 4000;
const CALIBRATIONS: usize = 1000;
const DELTA: f64 = 0.05;
/// Number of levels that a fixed sequence tests.
const LEVELS: usize = 21;

/// Level i of a fixed sequence (rad/s), in descending order.
fn level(i: usize, most: f64) -> f64 {
    most * (LEVELS - 1 - i) as f64 / (LEVELS - 1) as f64
}

/// Whether the set at each level contains the drive, with `paper` roll-outs.
fn held(drive: &Trajectory, parameters: &SceneParameters) -> Result<Vec<bool>, Invalid> {
    let prediction = Prediction::new(parameters, &PREDICTED);
    let window = window(drive)?;
    let future: Vec<Pose> = window.future().iter().map(|state| state.human).collect();
    let holds = |i: usize| {
        // A set that admits every turn rate contains everything by definition.
        if i == 0 {
            return Ok(true);
        }
        let epsilon = level(i, prediction.full_range());
        let settings = prediction.settings(vec![epsilon], &choice(), Rollout::Paper)?;
        let bounds = &prediction.bounds(window.history(), &settings)?.sets[0];
        let set = ReachableSet::new(window.now().human, bounds, SPEED_MPS, STEP_S)?;
        Ok(set.contains_trajectory(&future, Some(window.turn_rates()), prediction.tolerance))
    };
    (0..LEVELS).map(holds).collect()
}

struct Everyone {
    /// Scores in ascending order.
    sorted: Vec<f64>,
    held: Vec<Vec<bool>>,
    /// Coverage of each level of the fixed sequence in the population.
    shares: Vec<f64>,
}

fn row(everyone: &Everyone, scores: &[f64], p: f64, n: usize) -> Result<Value, Invalid> {
    let mut rng = SeededRng::new(66);
    let holds = |level: f64| {
        let hits = everyone.sorted.partition_point(|&score| score <= level);
        hits as f64 / everyone.sorted.len() as f64
    };
    let pac = Guarantee::Pac { delta: DELTA };
    let pac_needs = pac.needed(p)?;
    let (mut sum, mut squares, mut failed) = (0.0, 0.0, [0_usize; 2]);
    for _ in 0..CALIBRATIONS {
        let drawn: Vec<usize> = (0..n).map(|_| rng.below(scores.len())).collect();
        let calibration = Scores::new(drawn.iter().map(|&i| scores[i]).collect())?;
        let share = holds(Guarantee::Conformal.level(&calibration, p)?);
        sum += share;
        squares += share * share;
        if n < pac_needs {
            continue;
        }
        failed[0] += usize::from(holds(pac.level(&calibration, p)?) < p);
        let hits = |i: usize| Ok(drawn.iter().filter(|&&drive| everyone.held[drive][i]).count());
        let accepted = fixed_sequence(LEVELS, hits, n, p, DELTA)?;
        failed[1] += usize::from(everyone.shares[accepted] < p);
    }
    let many = CALIBRATIONS as f64;
    let mean = sum / many;
    let share = |failed: usize| (n >= pac_needs).then_some(failed as f64 / many);
    Ok(json!({
        "p": p,
        "n": n,
        // Coverage of a conformal level in the population: its mean over the calibrations, the
        // standard error of the mean, and the expected value for scores without ties.
        "conformal_mean": mean,
        "conformal_error": ((squares / many - mean * mean) / many).sqrt(),
        "conformal_expected": Guarantee::Conformal.rank(n, p)? as f64 / (n + 1) as f64,
        // Share of the calibrations whose level has a coverage below p. Null if n is too small.
        "pac_failures": share(failed[0]),
        "fixed_failures": share(failed[1]),
        // Number of trajectories that a PAC level needs.
        "pac_needs": pac_needs,
    }))
}

pub(crate) fn check() -> Found {
    let parameters = SceneParameters::default();
    let Population { drives, scores } = Population::new(POPULATION, &parameters)?;
    let held: Vec<Vec<bool>> =
        drives.par_iter().map(|drive| held(drive, &parameters)).collect::<Result<_, _>>()?;
    let share = |i: usize| held.iter().filter(|held| held[i]).count() as f64 / drives.len() as f64;
    let shares = (0..LEVELS).map(share).collect();
    let lost = |held: &Vec<bool>| held.windows(2).filter(|pair| pair[1] && !pair[0]).count();
    let not_nested: usize = held.iter().map(lost).sum();
    let mut sorted = scores.clone();
    sorted.sort_by(f64::total_cmp);
    let everyone = Everyone { sorted, held, shares };
    let mut rows = Vec::new();
    for p in [0.75, 0.9, 0.95] {
        for n in [50, 100, 400] {
            rows.push(row(&everyone, &scores, p, n)?);
        }
    }
    Ok(json!({
        "population": POPULATION,
        "calibrations": CALIBRATIONS,
        "delta": DELTA,
        "levels": LEVELS,
        // Number of pairs of successive levels, over all drives, for which the smaller set contains
        // the drive and the larger set does not. `paper` roll-outs are not nested.
        "not_nested": not_nested,
        // Binomial standard error of a share DELTA of the calibrations.
        "failure_error": (DELTA * (1.0 - DELTA) / CALIBRATIONS as f64).sqrt(),
        "rows": rows,
    }))
}
