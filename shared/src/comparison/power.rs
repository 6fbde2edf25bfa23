//! The power of the paired test, which shows what can be learned from a given number of
//! participants.

use crate::stats::power::PowerCurve;
use crate::stats::rank::is_shown;
use serde::Serialize;
use std::sync::OnceLock;

/// Power of the paired test with some number of participants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Power {
    /// Number of participants.
    pub participants: usize,
    /// Number of tests that are corrected together.
    pub family: usize,
    /// The smallest possible p-value of the test.
    pub least_p: f64,
    /// The smallest possible p-value after Holm's correction over the family.
    pub least_p_after_holm: f64,
    /// The smallest number of participants for which [`Self::least_p_after_holm`] is below
    /// [`LEVEL`](crate::stats::rank::LEVEL). This number is necessary, but not always sufficient.
    pub needed: usize,
    /// The probability that a single test with these participants shows an effect of
    /// [`Self::EFFECT`].
    pub shown: f64,
    /// The same probability after Holm's correction, if no other test of the family shows an
    /// effect.
    pub shown_after_holm: f64,
    /// [`Self::shown_after_holm`] for [`Self::needed`] participants.
    pub needed_shown: f64,
    /// The smallest number of participants for which the corrected test shows the effect with a
    /// probability of at least [`Self::AIM`]. `None` if this number is larger than [`Self::MOST`].
    pub enough: Option<usize>,
}

impl Power {
    /// The effect size d_z for which power is computed: the mean gain divided by the standard
    /// deviation of the gains. Cohen calls 0.8 large (Statistical Power Analysis for the Behavioral
    /// Sciences, 1988).
    pub const EFFECT: f64 = 0.8;
    /// The power that studies commonly aim for.
    pub const AIM: f64 = 0.8;
    /// Maximum number of participants for the power computation.
    pub const MOST: usize = 100;

    /// The power for this number of participants and a family of this number of tests.
    #[must_use]
    pub fn of(participants: usize, family: usize) -> Self {
        static CURVE: OnceLock<PowerCurve> = OnceLock::new();
        let curve = CURVE.get_or_init(|| PowerCurve::of(Self::EFFECT, Self::MOST));
        let least = |people: usize| (0..people.min(1000)).fold(2.0, |p: f64, _| 0.5 * p).min(1.0);
        let enough = |people: &usize| is_shown(least(*people) * family.max(1) as f64);
        let needed = (1..60).find(enough).unwrap_or(60);
        Self {
            participants,
            family,
            least_p: least(participants),
            least_p_after_holm: (least(participants) * family as f64).min(1.0),
            needed,
            shown: curve.power(participants, 1),
            shown_after_holm: curve.power(participants, family),
            needed_shown: curve.power(needed, family),
            enough: curve.people(Self::AIM, family),
        }
    }

    /// Whether there are too few participants for any paired test to show an effect.
    #[must_use]
    pub fn is_too_low(&self) -> bool {
        !is_shown(self.least_p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::rank::LEVEL;

    #[test]
    fn participants_that_a_test_needs() {
        assert_eq!([5, 6].map(|n| Power::of(n, 1).least_p), [0.0625, 0.03125]);
        assert_eq!([5, 6].map(|n| Power::of(n, 1).is_too_low()), [true, false]);
        assert_eq!([1, 48].map(|family| Power::of(9, family).needed), [6, 11]);
        assert!(Power::of(11, 48).least_p_after_holm < LEVEL);
    }

    /// The test shows an effect only if all eleven participants gain. The probability of this is
    /// Φ(0.8)¹¹ = 0.073, so eleven participants can show an effect but rarely do.
    #[test]
    fn eleven_people_are_not_enough() {
        let eleven = Power::of(11, 48);
        assert!((eleven.shown_after_holm - 0.073).abs() < 0.01, "{eleven:?}");
        assert_eq!(eleven.needed_shown, eleven.shown_after_holm);
        // An independent simulation gave 0.61 for one test, and 0.75 for 30 people after Holm's
        // correction.
        assert!((eleven.shown - 0.61).abs() < 0.03, "{eleven:?}");
        assert!((Power::of(30, 48).shown_after_holm - 0.75).abs() < 0.03);
        assert!(eleven.enough.is_some_and(|enough| enough > 30), "{eleven:?}");
    }
}
