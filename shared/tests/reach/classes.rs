//! Six classes of bounds, from the paper's class to half a turn per step over 100 steps.

use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng, exp};

/// Describes random bounds for up to `steps` steps, with turn rates of up to `most` rad/s to either
/// side.
pub(crate) struct Class {
    pub(crate) speed_mps: f64,
    pub(crate) step_s: f64,
    pub(crate) most: f64,
    pub(crate) steps: usize,
}

const fn class(speed_mps: f64, step_s: f64, most: f64, steps: usize) -> Class {
    Class { speed_mps, step_s, most, steps }
}

pub(crate) const CLASSES: [Class; 6] = [
    class(2.0, 0.2, 0.5, 15),
    class(10.0, 0.5, 3.0, 12),
    class(2.0, 0.2, 3.0, 25),
    class(1.5, 0.1, 6.0, 50),
    class(2.0, 0.2, 0.5, 100),
    class(2.0, 1.0, PI, 100),
];

impl Class {
    /// Random bounds of several kinds, for at most the class's number of steps.
    pub(crate) fn bounds(&self, rng: &mut SeededRng) -> InputBounds {
        let most = self.most;
        let straight = rng.below(3) == 0;
        // The bounds change in each step, or are constant over long stretches.
        let (count, stretches) = (1 + rng.below(self.steps), rng.below(2) == 0);
        let change = rng.below(count);
        let mut held = (0.0, 0.0);
        let bounds = (0..count).map(|step| {
            if stretches && step > 0 && step != change {
                return held;
            }
            let (a, b) = (rng.uniform(-most, most), rng.uniform(-most, most));
            held = match rng.below(6) {
                _ if straight => (-a.abs(), b.abs()),
                0 => (a, a),
                1 => (-most, most),
                2 => (a, (a + 0.2 * b.abs()).min(most)),
                _ => (a.min(b), a.max(b)),
            };
            held
        });
        let (lo, hi) = bounds.unzip();
        InputBounds::new(lo, hi, (-most, most)).expect("bounds in order and in range")
    }

    /// Like [`Self::bounds`], but half of the steps exclude straight driving, by between almost
    /// nothing and a tenth of the highest rate.
    #[allow(dead_code, reason = "the benchmark has no use for it")]
    pub(crate) fn grazing(&self, rng: &mut SeededRng) -> InputBounds {
        let any = self.bounds(rng);
        let bounds = any.lo().iter().zip(any.hi()).map(|(&lo, &hi)| {
            let by = 0.1 * self.most * exp(rng.uniform(-18.0, 0.0));
            match rng.below(4) {
                0 => (by, hi.max(by)),
                1 => (lo.min(-by), -by),
                _ => (lo, hi),
            }
        });
        let (lo, hi) = bounds.unzip();
        InputBounds::new(lo, hi, (-self.most, self.most)).expect("bounds in order and in range")
    }
}
