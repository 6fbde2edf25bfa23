//! Calibrated guarantees that predicted sets contain future trajectories.
//!
//! All guarantees are *marginal*: they hold over trajectories that are exchangeable with the
//! calibration trajectories, not for each scene or each participant. The split of the data
//! ([`Unit`]) determines which trajectories are exchangeable. New tasks of the same people are
//! exchangeable with these people's other tasks. Trajectories of new people are not, because the
//! trajectories of one person are alike. Guarantees also require that people's trajectories obey
//! the vehicle model of the prediction; `Trajectory::check` verifies this for recorded
//! trajectories.

use super::scores::Scores;
use crate::invalid::Invalid;
use crate::math::ln;
use crate::stats::{beta_cdf, binomial_at_least, open_probability};
use serde::Serialize;

/// The observations that a guarantee treats as exchangeable and a confidence interval treats as
/// independent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Unit {
    /// Trajectories, regardless of who drove them. Statements hold for new tasks of the same
    /// people.
    #[default]
    Trajectories,
    /// People, with one random trajectory drawn from each person. Statements hold for new people.
    /// If people are exchangeable, the drawn trajectories are exchangeable too, no matter how
    /// similar the trajectories of a person are and how many each person drove. So everything that
    /// holds for exchangeable scores also holds for the scores of the drawn trajectories. Dunn,
    /// Wasserman and Ramdas (Journal of the American Statistical Association 118, 2023) call this
    /// method subsampling once.
    People,
}

impl Unit {
    /// The name of this unit in results.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Trajectories => "trajectories",
            Self::People => "people",
        }
    }

    /// The number of calibration observations, in words.
    pub(super) fn calibrating(self, count: usize) -> String {
        match self {
            Self::Trajectories => format!("{count} trajectories"),
            Self::People => format!("{count} people, one random trajectory of each"),
        }
    }
}

/// How calibration trajectories determine a level.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Guarantee {
    /// Split conformal prediction: the level is the ⌈(n + 1)p⌉-th smallest score. The set contains
    /// the next trajectory with probability ≥ p, on average over calibrations.
    Conformal,
    /// Probably approximately correct: the level is the j-th smallest score, where j is the least
    /// rank with P(Beta(j, n + 1 − j) ≤ p) ≤ δ. Except in a share δ of calibrations, the sets
    /// contain a share ≥ p of future trajectories.
    Pac {
        /// Probability that the calibration fails, δ, in (0, 1).
        delta: f64,
    },
    /// Fixed-sequence testing, for sets that need not be nested (`paper` roll-outs). Levels are
    /// tested in sequence, the safest first. Testing stops at the first level with P(Bin(n, p) ≥
    /// hits) > δ, and the level before it is used. The guarantee is the same as for `Pac`, but it
    /// does not require nested sets.
    FixedSequence {
        /// Probability that the calibration fails, δ, in (0, 1).
        delta: f64,
        /// Number of levels to test, evenly spaced from the largest set down to ε = 0; at least 2.
        levels: usize,
    },
}

impl Guarantee {
    /// The name of this guarantee in results.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Conformal => "conformal",
            Self::Pac { .. } => "pac",
            Self::FixedSequence { .. } => "fixed_sequence",
        }
    }

    /// Checks that probabilities are in (0, 1) and that there are at least two levels.
    ///
    /// # Errors
    /// [`Invalid`] that names the field.
    pub fn check(&self) -> Result<(), Invalid> {
        match *self {
            Self::Conformal => {}
            Self::Pac { delta } => {
                open_probability("delta", delta)?;
            }
            Self::FixedSequence { delta, levels } => {
                open_probability("delta", delta)?;
                if levels < 2 {
                    return Err(Invalid::new("levels", "at least 2", levels));
                }
            }
        }
        Ok(())
    }

    /// The least number n of calibration trajectories for probability `p`: n ≥ p/(1 − p) for
    /// conformal prediction, pⁿ ≤ δ for the other guarantees.
    ///
    /// # Errors
    /// [`Invalid`] if `p` or δ is not in (0, 1).
    pub fn needed(&self, p: f64) -> Result<usize, Invalid> {
        self.check()?;
        open_probability("p", p)?;
        let least = match *self {
            Self::Conformal => p / (1.0 - p),
            Self::Pac { delta } | Self::FixedSequence { delta, .. } => ln(delta) / ln(p),
        };
        Ok((rounded_up(least) as usize).max(1))
    }

    /// Checks that `n` calibration trajectories suffice for probability `p`.
    ///
    /// # Errors
    /// [`Invalid`] that states how many are needed.
    pub fn enough(&self, n: usize, p: f64) -> Result<(), Invalid> {
        let needed = self.needed(p)?;
        if n >= needed {
            return Ok(());
        }
        let expected = format!("at least {needed} for p = {p} ({})", self.word());
        Err(Invalid::new("calibration trajectories", expected, n))
    }

    /// The rank, from 1, of the level among `n` ascending scores. With the score of this rank as
    /// the level, the sets of a nested family have the guarantee.
    ///
    /// # Errors
    /// [`Invalid`] if there are too few scores, a probability is not in (0, 1), or the guarantee is
    /// not for nested families.
    pub fn rank(&self, n: usize, p: f64) -> Result<usize, Invalid> {
        self.enough(n, p)?;
        match *self {
            Self::Conformal => Ok((rounded_up((n + 1) as f64 * p) as usize).min(n)),
            Self::Pac { delta } => {
                // P(Beta ≤ p) decreases with the rank.
                let unsure = |rank: usize| beta_cdf(p, rank as f64, (n + 1 - rank) as f64) > delta;
                let (mut no, mut yes) = (0, n);
                while yes - no > 1 {
                    let middle = usize::midpoint(no, yes);
                    if unsure(middle) { no = middle } else { yes = middle }
                }
                Ok(yes)
            }
            Self::FixedSequence { .. } => {
                Err(Invalid::new("guarantee", "conformal or pac, for nested sets", self.word()))
            }
        }
    }

    /// The parameters (a, b) = (rank, n + 1 − rank) of a Beta distribution. After a calibration
    /// with `n` scores, the share of trajectories that the sets will contain has this distribution.
    /// A choice that is made before the calibration must assume this distribution. A fixed sequence
    /// has the parameters of `Pac`.
    ///
    /// # Errors
    /// The errors of [`Self::enough`].
    pub fn held(&self, n: usize, p: f64) -> Result<(f64, f64), Invalid> {
        let as_nested = match *self {
            Self::FixedSequence { delta, .. } => Self::Pac { delta },
            other => other,
        };
        let rank = as_nested.rank(n, p)?;
        Ok((rank as f64, (n + 1 - rank) as f64))
    }

    /// The level at which these calibration scores guarantee probability `p`.
    ///
    /// # Errors
    /// The errors of [`Self::rank`].
    pub fn level(&self, scores: &Scores, p: f64) -> Result<f64, Invalid> {
        Ok(scores.ranked(self.rank(scores.len(), p)?))
    }

    /// The guarantee of a calibration with `calibration` units in words, to print beside every
    /// number.
    #[must_use]
    pub fn statement(&self, p: f64, calibration: usize, unit: Unit) -> String {
        let from = unit.calibrating(calibration);
        let (next, all, scope) = match unit {
            Unit::Trajectories => (
                "The next trajectory",
                "of trajectories",
                "trajectories exchangeable with these, as new tasks of the same people are; not for new \
                 people, and not for each scene or person",
            ),
            Unit::People => (
                "A trajectory of the next person",
                "of new people's trajectories",
                "people exchangeable with these, not for each scene or person",
            ),
        };
        match *self {
            Self::Conformal => format!(
                "{next} stays inside with probability at least {p}, on average over calibrations with {from}: a \
                 marginal guarantee over {scope}."
            ),
            Self::Pac { delta } | Self::FixedSequence { delta, .. } => format!(
                "With confidence {} in the calibration with {from}, a share of at least {p} {all} stays inside: a \
                 marginal guarantee over {scope}.",
                1.0 - delta
            ),
        }
    }
}

/// Tests settings in order, the safest first, and returns the index of the last setting before the
/// first failure. `hits(i)` is the number of the `n` calibration trajectories that the set of
/// setting i contains. The setting passes if P(Bin(n, p) ≥ hits) ≤ δ. Because testing stops at the
/// first failure, the probability that *any* accepted setting contains a share below p is at most δ
/// (fixed-sequence testing, as in Angelopoulos et al., Learn then Test). The order must not depend
/// on the calibration trajectories.
///
/// # Errors
/// [`Invalid`] if p or δ is not in (0, 1), there are more hits than trajectories, or the first
/// setting fails.
pub fn fixed_sequence(
    settings: usize,
    mut hits: impl FnMut(usize) -> Result<usize, Invalid>,
    n: usize,
    p: f64,
    delta: f64,
) -> Result<usize, Invalid> {
    Guarantee::Pac { delta }.enough(n, p)?;
    let mut accepted = None;
    for i in 0..settings {
        let held = hits(i)?;
        if held > n {
            return Err(Invalid::new(format!("hits[{i}]"), format!("at most {n}"), held));
        }
        if binomial_at_least(held, n, p) > delta {
            break;
        }
        accepted = Some(i);
    }
    accepted.ok_or_else(|| {
        let expected = format!("a first setting that passes for p = {p}, δ = {delta}");
        Invalid::new("settings", expected, if settings == 0 { "none" } else { "one that fails" })
    })
}

/// The least integer ≥ `x`, except that a rounding error above an integer is ignored. For example,
/// 0.55 · 20 is 11.000000000000002.
fn rounded_up(x: f64) -> f64 {
    let whole = x.round();
    if (x - whole).abs() <= 1e-9 * x.abs().max(1.0) { whole } else { x.ceil() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    #[test]
    fn ranks_are_those_of_the_formulas() {
        let conformal = |n, p| Guarantee::Conformal.rank(n, p);
        assert_eq!(conformal(9, 0.9).unwrap(), 9);
        assert_eq!(conformal(19, 0.55).unwrap(), 11);
        assert_eq!(conformal(50, 0.75).unwrap(), 39);
        for (n, p, delta) in [(22, 0.9, 0.1), (50, 0.75, 0.05), (400, 0.9, 0.01), (400, 0.3, 0.5)] {
            let rank = Guarantee::Pac { delta }.rank(n, p).unwrap();
            // Independent check: the binomial tail, summed from the other end.
            let doubt = |rank: usize| binomial_at_least(rank, n, p);
            assert!(doubt(rank) <= delta && (rank == 1 || doubt(rank - 1) > delta));
        }
    }

    #[test]
    fn too_few_trajectories_are_told_how_many_are_needed() {
        let needed = |guarantee: Guarantee, p| guarantee.needed(p).unwrap();
        assert_eq!(needed(Guarantee::Conformal, 0.75), 3);
        assert_eq!(needed(Guarantee::Conformal, 0.95), 19);
        assert_eq!(needed(Guarantee::Pac { delta: 0.05 }, 0.95), 59);
        assert_eq!(needed(Guarantee::FixedSequence { delta: 0.05, levels: 5 }, 0.9), 29);
        for guarantee in [Guarantee::Conformal, Guarantee::Pac { delta: 0.05 }] {
            for p in [0.05, 0.3, 0.75, 0.9, 0.95, 0.99] {
                let least = needed(guarantee, p);
                assert!(guarantee.rank(least, p).unwrap() <= least);
                if least > 1 {
                    assert!(guarantee.rank(least - 1, p).is_err());
                }
            }
        }
        let complaint = Guarantee::Pac { delta: 0.05 }.rank(58, 0.95).unwrap_err().to_string();
        let expected =
            "calibration trajectories: expected at least 59 for p = 0.95 (pac), found 58";
        assert_eq!(complaint, expected);
    }

    #[test]
    fn complaints_name_the_field() {
        for p in [0.0, 1.0, -0.1, f64::NAN] {
            assert_eq!(Guarantee::Conformal.rank(10, p).unwrap_err().field, "p");
            assert_eq!(Guarantee::Pac { delta: p }.rank(99, 0.5).unwrap_err().field, "delta");
            assert_eq!(fixed_sequence(1, |_| Ok(9), 9, 0.5, p).unwrap_err().field, "delta");
        }
        let sequence = Guarantee::FixedSequence { delta: 0.1, levels: 1 };
        assert_eq!(sequence.check().unwrap_err().field, "levels");
        let sequence = Guarantee::FixedSequence { delta: 0.1, levels: 9 };
        assert_eq!(sequence.rank(99, 0.5).unwrap_err().field, "guarantee");
        assert_eq!(fixed_sequence(0, |_| Ok(9), 9, 0.5, 0.1).unwrap_err().field, "settings");
        assert_eq!(fixed_sequence(2, |_| Ok(4), 9, 0.5, 0.1).unwrap_err().found, "one that fails");
        assert_eq!(fixed_sequence(2, |_| Ok(10), 9, 0.5, 0.1).unwrap_err().field, "hits[0]");
    }

    /// Scores are uniform, so a set of level s contains a share s of trajectories.
    #[test]
    fn guarantees_hold_over_a_thousand_calibrations() {
        let mut rng = SeededRng::new(11);
        let calibrations = 4000;
        let (p, delta) = (0.75, 0.05);
        for n in [50, 100, 400] {
            let (mut held, mut squares, mut failed) = (0.0, 0.0, 0);
            for _ in 0..calibrations {
                let scores = Scores::new((0..n).map(|_| rng.unit()).collect()).unwrap();
                let coverage = Guarantee::Conformal.level(&scores, p).unwrap();
                held += coverage;
                squares += coverage * coverage;
                failed += usize::from(Guarantee::Pac { delta }.level(&scores, p).unwrap() < p);
            }
            let many = calibrations as f64;
            let mean = held / many;
            let error = ((squares / many - mean * mean) / many).sqrt();
            assert!(mean >= p - 3.0 * error, "{n}: {mean}");
            let rank = Guarantee::Conformal.rank(n, p).unwrap();
            let exact = rank as f64 / (n + 1) as f64;
            assert!((mean - exact).abs() < 3.5 * error, "{n}: {mean} {exact}");
            let error = (delta * (1.0 - delta) / many).sqrt();
            assert!(failed as f64 / many <= delta + 3.0 * error, "{n}: {failed}");
            assert!(failed > 0, "as sharp as it can be");
        }
    }

    /// Simulates studies of 22 people with 10 tasks each. Four fifths of the people always stay
    /// inside sets of level 0.1. For the other people, only a share u of trajectories stays inside
    /// sets of level u. So sets of level u ≥ 0.1 contain a share 0.8 + 0.2 u of new people's
    /// trajectories, and the least level for p = 0.9 is 0.5.
    ///
    /// With one trajectory per person, the calibration fails as rarely as stated. With all
    /// trajectories, as if they were from 220 people, it fails far more often, because the result
    /// depends on whether 2 or 6 people steer differently.
    #[test]
    fn a_guarantee_for_new_people_needs_people_as_observations() {
        let mut rng = SeededRng::new(21);
        let (p, delta, people, tasks, studies) = (0.9, 0.1, 22, 10, 3000);
        let guarantee = Guarantee::Pac { delta };
        let mut failed = [0; 2];
        for _ in 0..studies {
            let (mut one_each, mut all) = (Vec::new(), Vec::new());
            for _ in 0..people {
                let is_erratic = rng.unit() < 0.2;
                let mut score = || if is_erratic { rng.unit() } else { 0.1 * rng.unit() };
                let own: Vec<f64> = (0..tasks).map(|_| score()).collect();
                one_each.push(own[0]);
                all.extend(own);
            }
            for (failed, scores) in failed.iter_mut().zip([one_each, all]) {
                let level = guarantee.level(&Scores::new(scores).unwrap(), p).unwrap();
                // At levels below 0.1, even the first group leaves the sets.
                *failed += usize::from(level < 0.5);
            }
        }
        let share = failed.map(|failed| failed as f64 / f64::from(studies));
        let error = (delta * (1.0 - delta) / f64::from(studies)).sqrt();
        assert!(share[0] <= delta + 3.0 * error, "{share:?}");
        assert!(share[1] > 0.2, "tasks as people: {share:?}");
    }

    #[test]
    fn statements_say_over_whom_they_hold() {
        let said = |unit| Guarantee::Conformal.statement(0.9, 12, unit);
        assert!(said(Unit::Trajectories).contains("12 trajectories"));
        assert!(said(Unit::Trajectories).contains("not for new people"));
        assert!(said(Unit::People).contains("12 people, one random trajectory of each"));
        assert!(!said(Unit::People).contains("not for new people"));
        let pac = Guarantee::Pac { delta: 0.05 }.statement(0.9, 40, Unit::People);
        assert!(pac.starts_with("With confidence 0.95") && pac.contains("new people's"), "{pac}");
    }

    /// The sets of the settings contain different shares of trajectories, in no particular order.
    /// The accepted setting is rarely wrong.
    #[test]
    fn a_fixed_sequence_is_seldom_wrong() {
        let mut rng = SeededRng::new(12);
        let (n, p, delta, calibrations) = (100, 0.75, 0.1, 4000);
        for shares in [
            [1.0, 0.95, 0.9, 0.74, 0.9, 0.6],
            [1.0, 0.749, 0.749, 0.749, 0.749, 0.749],
            [0.9, 0.85, 0.8, 0.749, 0.7, 0.65],
        ] {
            let mut wrong = 0;
            for _ in 0..calibrations {
                let drawn: Vec<f64> = (0..n).map(|_| rng.unit()).collect();
                let hits = |i: usize| Ok(drawn.iter().filter(|&&u| u < shares[i]).count());
                let accepted = fixed_sequence(shares.len(), hits, n, p, delta);
                wrong += usize::from(accepted.is_ok_and(|i| shares[..=i].iter().any(|&s| s < p)));
            }
            let error = (delta * (1.0 - delta) / f64::from(calibrations)).sqrt();
            let share = wrong as f64 / f64::from(calibrations);
            assert!(share <= delta + 3.0 * error, "{shares:?}: {share}");
        }
    }
}
