//! Selects the choice of actions with the least area.

use crate::bounds::{ActionModel, BoundsSettings};
use crate::invalid::Invalid;
use crate::parallel::{default_threads, parallel_map};
use crate::shfrs::widened::{least_widening, tube_area_m2, widened, widening_between};
use crate::shfrs::window::Window;
use crate::shfrs::window_sets::Prediction;
use crate::stats::beta_quantile;

/// Bounds that one or more candidates have for one window, and an interval that contains the score
/// of these bounds.
struct Base {
    bounds: Vec<(f64, f64)>,
    /// Lower bound on the score.
    least: f64,
    /// Upper bound on the score. It equals `least` once the score is computed.
    most: f64,
}

/// Ranks among `n` ≥ 1 training scores at which the calibrated level can lie. The share of
/// trajectories that the calibrated set will contain has the Beta distribution (a, b). The ranks
/// are at equally likely quantiles of this share.
///
/// Several ranks are necessary because the area can jump from one score to the next. If only the
/// rank of the mean share were used, a candidate could be best at this rank by chance.
pub(super) fn ranks((a, b): (f64, f64), n: usize) -> [usize; RANKS] {
    core::array::from_fn(|i| {
        let share = beta_quantile((i as f64 + 0.5) / RANKS as f64, a, b);
        (((n + 1) as f64 * share).ceil() as usize).clamp(1, n)
    })
}

/// Number of equally likely quantiles.
const RANKS: usize = 9;

/// Approximate share of the work that is done once every candidate's bounds are known.
const BOUNDS_KNOWN: f64 = 0.5;

/// The candidate whose tubes have the least area, summed over the training windows and over levels.
/// A candidate's levels are its scores at each of the ascending `ranks`. On a tie, the first
/// candidate is returned.
///
/// Computing scores takes most of the time. So each score first gets an interval from turn rates
/// and headings alone. These intervals give a lower bound on each candidate's levels, and therefore
/// on its area. Candidates are visited in ascending order of this lower bound, until the bound
/// exceeds the least area found so far. For a visited candidate, only the scores that could be at
/// one of the ranks are computed.
pub(super) fn least_area(
    windows: &[Window<'_>],
    prediction: &Prediction<'_, impl ActionModel + Sync>,
    families: &[BoundsSettings],
    ranks: &[usize],
    progress: &mut dyn FnMut(f64),
) -> Result<usize, Invalid> {
    let (parameters, tolerance) = (prediction.parameters, prediction.tolerance);
    // For each window, its distinct bounds, and the index of each candidate's bounds.
    let bounds_of = |window: &Window<'_>| {
        let (mut bases, mut of) = (Vec::<Base>::new(), Vec::with_capacity(families.len()));
        for family in families {
            let bounds = prediction.bounds(window.history(), family)?.raw;
            let known = bases.iter().position(|base| base.bounds == bounds);
            of.push(known.unwrap_or(bases.len()));
            if known.is_none() {
                let (least, most) = widening_between(&bounds, window, parameters, tolerance)?;
                bases.push(Base { bounds, least, most });
            }
        }
        Ok((bases, of))
    };
    let (mut bases, mut of) = (Vec::new(), Vec::new());
    for windows_at_once in windows.chunks(8 * default_threads()) {
        let found: Vec<(Vec<Base>, Vec<usize>)> = parallel_map(windows_at_once, bounds_of)?;
        for (its_bases, its_places) in found {
            bases.push(its_bases);
            of.push(its_places);
        }
        progress(BOUNDS_KNOWN * bases.len() as f64 / windows.len() as f64);
    }
    let ranked = |bases: &[Vec<Base>], candidate: usize, of_base: fn(&Base) -> f64| {
        let mut found: Vec<f64> =
            bases.iter().zip(&of).map(|(bases, of)| of_base(&bases[of[candidate]])).collect();
        found.sort_by(f64::total_cmp);
        ranks.iter().map(|rank| found[rank - 1]).collect::<Vec<f64>>()
    };
    let area = |bases: &[Vec<Base>], candidate: usize, levels: &[f64]| {
        levels.chunk_by(|a, b| a == b).try_fold(0.0, |sum, equal| {
            let one = bases.iter().zip(&of).try_fold(0.0, |sum, (bases, of)| {
                let base = &bases[of[candidate]].bounds;
                let bounds = widened(base, equal[0], prediction.turn_rate())?;
                Ok::<_, Invalid>(sum + tube_area_m2(&bounds, parameters)?)
            })?;
            Ok::<_, Invalid>(sum + one * equal.len() as f64)
        })
    };
    let all: Vec<usize> = (0..families.len()).collect();
    let at_least = parallel_map(&all, |&candidate| {
        area(&bases, candidate, &ranked(&bases, candidate, |base| base.least))
    })?;
    let mut order = all;
    order.sort_by(|&a, &b| at_least[a].total_cmp(&at_least[b]).then(a.cmp(&b)));
    let mut best: Option<(f64, usize)> = None;
    for (visited, candidate) in order.into_iter().enumerate() {
        progress(BOUNDS_KNOWN + (1.0 - BOUNDS_KNOWN) * visited as f64 / families.len() as f64);
        if best.is_some_and(|(area, _)| at_least[candidate] > area) {
            break;
        }
        let low = ranked(&bases, candidate, |base| base.least);
        let high = ranked(&bases, candidate, |base| base.most);
        let open: Vec<usize> = (0..windows.len())
            .filter(|&i| {
                let base = &bases[i][of[i][candidate]];
                let may_be = |(low, high): (&f64, &f64)| base.least < *high && *low < base.most;
                base.least < base.most && low.iter().zip(&high).any(may_be)
            })
            .collect();
        let scores = parallel_map(&open, |&i| {
            let base = &bases[i][of[i][candidate]].bounds;
            least_widening(base, &windows[i], parameters, tolerance)
        })?;
        for (&i, &score) in open.iter().zip(&scores) {
            let base = &mut bases[i][of[i][candidate]];
            (base.least, base.most) = (score, score);
        }
        let levels = ranked(&bases, candidate, |base| base.least);
        let found = (area(&bases, candidate, &levels)?, candidate);
        if best.is_none_or(|best| found < best) {
            best = Some(found);
        }
    }
    Ok(best.map_or(0, |(_, candidate)| candidate))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Rollout;
    use crate::math::SeededRng;
    use crate::scene::SceneParameters;
    use crate::shfrs::testing::{Always, drive};
    use crate::shfrs::tuning::candidates;
    use crate::shfrs::window::{Trajectory, WindowChoice};

    /// Reference implementation of [`least_area`]: computes every score of every candidate.
    fn plainly(
        windows: &[Window<'_>],
        prediction: &Prediction<'_, Always>,
        families: &[BoundsSettings],
        ranks: &[usize],
    ) -> (f64, usize) {
        let area = |family: &BoundsSettings| {
            let base =
                |window: &Window<'_>| prediction.bounds(window.history(), family).unwrap().raw;
            let (parameters, tolerance) = (prediction.parameters, prediction.tolerance);
            let score = |window: &Window<'_>| {
                least_widening(&base(window), window, parameters, tolerance).unwrap()
            };
            let mut scores: Vec<f64> = windows.iter().map(score).collect();
            scores.sort_by(f64::total_cmp);
            let area = |window: &Window<'_>, level: f64| {
                let range = prediction.turn_rate();
                let bounds = widened(&base(window), level, range).unwrap();
                tube_area_m2(&bounds, parameters).unwrap()
            };
            let of_level = |level| windows.iter().map(|window| area(window, level)).sum::<f64>();
            ranks.iter().map(|rank| of_level(scores[rank - 1])).sum::<f64>()
        };
        let areas = families.iter().map(area).enumerate().map(|(i, area)| (area, i));
        areas.min_by(|a, b| a.partial_cmp(b).unwrap()).unwrap()
    }

    #[test]
    fn leaving_out_scores_changes_nothing() {
        let parameters = SceneParameters::default();
        let mut rng = SeededRng::new(8);
        for (probabilities, held) in [
            ([0.2, 0.5, 0.3], (18.0, 12.0)),
            ([0.1, 0.8, 0.1], (25.0, 6.0)),
            ([0.6, 0.1, 0.3], (40.0, 2.0)),
        ] {
            let model = Always(probabilities);
            let prediction = Prediction::new(&parameters, &model);
            let drives: Vec<Trajectory> = (0..30)
                .map(|_| {
                    let rates: Vec<f64> =
                        (0..5).map(|_| [-0.5, 0.0, 0.0, 0.5][rng.below(4)]).collect();
                    drive(&rates)
                })
                .collect();
            let windows = WindowChoice::EveryStep.windows(&drives, 5);
            let windows: Vec<Window<'_>> = windows.into_iter().flatten().collect();
            let families: Vec<BoundsSettings> = candidates(3, 5)
                .iter()
                .map(|choice| prediction.settings(vec![0.0], choice, Rollout::Base).unwrap())
                .collect();
            let ranks = ranks(held, windows.len());
            let found = least_area(&windows, &prediction, &families, &ranks, &mut |_| {}).unwrap();
            let plain = plainly(&windows, &prediction, &families, &ranks);
            assert_eq!(found, plain.1);
        }
    }
}
