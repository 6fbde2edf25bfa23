//! Gradient-boosted trees for the multinomial deviance (Friedman 2001, with Newton steps and a
//! penalty on leaves as in Chen and Guestrin 2016).
//!
//! In each round, one small tree per score is fitted to the gradient of the deviance with respect
//! to this score. A fraction (`rate`) of the tree's Newton step is added to the score. Before
//! training, columns are cut into quantile bins. Training uses no random numbers.
//!
//! Gradients and Hessians are rounded to multiples of 2⁻⁴⁰ and summed as integers. The sums and all
//! splits therefore depend only on sets of rows and not on their order, so permuting the rows gives
//! a bit-identical model. Ties are broken as in [`tree`](super::tree).

mod settings;
mod bins;
mod newton;
mod grower;
mod booster;

use super::samples::Samples;
use crate::invalid::{Invalid, length};
use crate::predict::boosting::{Boosted, Summand};
use booster::{Booster, to_shares};
pub use settings::BoostingSettings;

/// The settings that grouped cross-validation chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Maximum depth of the trees.
    pub depth: usize,
    /// Number of rounds.
    pub rounds: usize,
    /// Mean of −log P(class) over the held-out rows.
    pub log_loss: f64,
}

/// Trains for the number of rounds in the settings. The initial scores are the logarithms of
/// (n_c + 1) / (n + K), so a class that does not occur gets a small but positive probability.
///
/// # Errors
/// [`Invalid`] if there are fewer than two classes, a setting is out of range, there are more
/// than 2²¹ rows or a number is beyond single precision.
pub fn fit(samples: &Samples<'_>, settings: &BoostingSettings) -> Result<Boosted, Invalid> {
    settings.check()?;
    let mut booster = Booster::new(samples, settings)?;
    for _ in 0..settings.rounds {
        booster.round();
    }
    Ok(booster.finish())
}

/// Chooses the depth and the number of rounds with the lowest log loss on the held-out rows of all
/// folds. Then trains a model with this depth and number of rounds on all rows. `folds` contains
/// the fold of each row, counted from 0. All rows of a trial must be in the same fold. If several
/// numbers of rounds tie, the smallest is chosen. If several depths tie, the first in `depths` is
/// chosen.
///
/// # Errors
/// The errors of [`fit`], and [`Invalid`] if `folds` and the rows differ in length, there are fewer
/// than two folds, a fold is empty, or `depths` is empty.
pub fn fit_by_folds(
    samples: &Samples<'_>,
    folds: &[usize],
    depths: &[usize],
    settings: &BoostingSettings,
) -> Result<(Boosted, Chosen), Invalid> {
    length("folds", samples.labels().len(), folds.len())?;
    let parts = parts(samples, folds)?;
    let mut best: Option<Chosen> = None;
    for &depth in depths {
        let settings = BoostingSettings { depth, ..*settings };
        settings.check()?;
        let chosen = best_rounds(samples, &parts, &settings)?;
        if best.is_none_or(|best| chosen.log_loss < best.log_loss) {
            best = Some(chosen);
        }
    }
    let chosen = best.ok_or_else(|| Invalid::new("depths", "at least one", "none"))?;
    let settings = BoostingSettings { depth: chosen.depth, rounds: chosen.rounds, ..*settings };
    Ok((fit(samples, &settings)?, chosen))
}

/// Values and labels of some rows.
#[derive(Default)]
struct Part {
    values: Vec<f64>,
    labels: Vec<usize>,
}

/// The training rows and the held-out rows of each fold.
fn parts(samples: &Samples<'_>, folds: &[usize]) -> Result<Vec<[Part; 2]>, Invalid> {
    let count = folds.iter().max().map_or(0, |last| last + 1);
    if count < 2 {
        return Err(Invalid::new("folds", "at least 2", count));
    }
    let part = |fold: usize| {
        let mut parts = [Part::default(), Part::default()];
        for ((row, &label), &of) in samples.rows().zip(samples.labels()).zip(folds) {
            let part = &mut parts[usize::from(of == fold)];
            part.values.extend(row);
            part.labels.push(label);
        }
        match parts.iter().all(|part| !part.labels.is_empty()) {
            true => Ok(parts),
            false => Err(Invalid::new("folds", "rows in each", format!("none in {fold}"))),
        }
    };
    (0..count).map(part).collect()
}

/// Finds the number of rounds with the lowest log loss on held-out rows. Each round is added to the
/// models of all folds before the next round, so no fold is trained longer than needed.
fn best_rounds(
    samples: &Samples<'_>,
    parts: &[[Part; 2]],
    settings: &BoostingSettings,
) -> Result<Chosen, Invalid> {
    let n = samples.labels().len() as f64;
    let mut folds = Vec::with_capacity(parts.len());
    for [kept, left_out] in parts {
        let kept = Samples::new(samples.width(), &kept.values, &kept.labels, samples.classes())?;
        let booster = Booster::new(&kept, settings)?;
        let scores = LeftOut::new(left_out, samples.width(), booster.intercepts());
        folds.push((booster, scores));
    }
    let loss = folds.iter().map(|(_, left_out)| left_out.log_loss()).sum::<f64>() / n;
    let mut best = Chosen { depth: settings.depth, rounds: 0, log_loss: loss };
    for rounds in 1..=settings.rounds {
        let mut loss = 0.0;
        for (booster, left_out) in &mut folds {
            left_out.add(booster.round());
            loss += left_out.log_loss();
        }
        let log_loss = loss / n;
        if log_loss < best.log_loss {
            best = Chosen { rounds, log_loss, ..best };
        } else if rounds - best.rounds > settings.patience {
            break;
        }
    }
    Ok(best)
}

/// Scores of held-out rows.
struct LeftOut<'a> {
    part: &'a Part,
    width: usize,
    outputs: usize,
    /// Rows × scores.
    scores: Vec<f64>,
}

impl<'a> LeftOut<'a> {
    fn new(part: &'a Part, width: usize, intercepts: &[f64]) -> Self {
        let scores = intercepts.repeat(part.labels.len());
        Self { part, width, outputs: intercepts.len(), scores }
    }

    /// Adds the values of a round's trees to the scores.
    fn add(&mut self, trees: &[Summand]) {
        let rows = self.part.values.chunks_exact(self.width);
        for (row, scores) in rows.zip(self.scores.chunks_exact_mut(self.outputs)) {
            for (score, tree) in scores.iter_mut().zip(trees) {
                *score += tree.value(row);
            }
        }
    }

    /// Σ of −log P(class).
    fn log_loss(&self) -> f64 {
        let mut shares = vec![0.0; self.outputs];
        let mut loss = 0.0;
        for (scores, &label) in self.scores.chunks_exact(self.outputs).zip(&self.part.labels) {
            shares.copy_from_slice(scores);
            // With two classes, the only score belongs to the second class, and the first class has
            // score 0.
            let own = if self.outputs > 1 { scores[label] } else { scores[0] * label as f64 };
            loss += to_shares(&mut shares) - own;
        }
        loss
    }
}
