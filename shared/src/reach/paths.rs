//! The two outermost paths. One has the lowest turn rate in every step, and the other has the highest.
//!
//! Inside `reach`, lengths are in seconds of travel (the speed is one), points are complex numbers,
//! and the human starts at the origin with heading 0.

use crate::bounds::InputBounds;
use crate::math::{sin_cos, sinc};
use nalgebra::Complex;

/// Up to this angle (rad), a few terms of the series give full precision.
const SMALL: f64 = 0.25;

/// e^{i·angle}.
pub(super) fn unit(angle: f64) -> Complex<f64> {
    if angle.abs() < SMALL {
        // The omitted terms are below 10⁻¹⁷. The code multiplies by constants, because divisions take
        // several times as long.
        let a2 = angle * angle;
        let cos = 1.0 - a2 * (1.0 / 90.0) * (1.0 - a2 * (1.0 / 132.0));
        let cos = 1.0 - a2 * (1.0 / 30.0) * (1.0 - a2 * (1.0 / 56.0) * cos);
        let cos = 1.0 - a2 * 0.5 * (1.0 - a2 * (1.0 / 12.0) * cos);
        return Complex::new(cos, angle * small_sinc(a2));
    }
    let (sin, cos) = sin_cos(angle);
    Complex::new(cos, sin)
}

/// sin(x)/x as a function of x² = `x2` < [`SMALL`]².
fn small_sinc(x2: f64) -> f64 {
    let rest = 1.0 - x2 * (1.0 / 72.0) * (1.0 - x2 * (1.0 / 110.0));
    1.0 - x2 * (1.0 / 6.0) * (1.0 - x2 * (1.0 / 20.0) * (1.0 - x2 * (1.0 / 42.0) * rest))
}

/// Displacement along an arc that starts in direction `heading` (rad) and turns at `rate` (rad/s) for
/// `seconds`.
pub(super) fn arc(heading: f64, rate: f64, seconds: f64) -> Complex<f64> {
    let half_turn = 0.5 * rate * seconds;
    unit(heading + half_turn) * chord(half_turn, seconds)
}

/// Length of the chord of an arc that takes `seconds` and turns by twice `half_turn`.
fn chord(half_turn: f64, seconds: f64) -> f64 {
    if half_turn.abs() < SMALL {
        seconds * small_sinc(half_turn * half_turn)
    } else {
        seconds * sinc(half_turn)
    }
}

/// The effect of turning at a constant rate for some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    pub(super) rate: f64,
    /// The angle α by which the heading turns, as e^{iα}.
    pub(super) turned: Complex<f64>,
    /// The displacement for an initial heading of 0 (s of travel).
    pub(super) moved: Complex<f64>,
}

impl Turn {
    pub(super) fn new(rate: f64, seconds: f64) -> Self {
        let half = unit(0.5 * rate * seconds);
        let moved = half * chord(0.5 * rate * seconds, seconds);
        Self { rate, turned: half * half, moved }
    }

    /// The turn at `rate` whose end tangents meet at a distance of `z`/2 from either end. Here z =
    /// (2/rate)·tan(rate·seconds/2), where `seconds` is the duration of the turn.
    pub(super) fn of_tangent(rate: f64, z: f64) -> Self {
        let tan = 0.5 * rate * z;
        let along = Complex::new(1.0, tan);
        let square = 1.0 / (1.0 + tan * tan);
        Self { rate, turned: along * along * square, moved: along * (z * square) }
    }

    pub(super) fn straight(seconds: f64) -> Self {
        Self { rate: 0.0, turned: Complex::new(1.0, 0.0), moved: Complex::new(seconds, 0.0) }
    }
}

/// Number of precomputed divisions of a step. Curves rarely need more pieces per step.
const MOST_KEPT: usize = 4;

/// A path whose rate is constant in each step.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Path {
    step_s: f64,
    /// For each step, the turn over the whole step, over half of it, over a third, and so on.
    steps: Vec<[Turn; MOST_KEPT]>,
    rates: Vec<f64>,
    /// Heading at the start and after each step; `facings` and `points` likewise.
    headings: Vec<f64>,
    facings: Vec<Complex<f64>>,
    points: Vec<Complex<f64>>,
}

impl Path {
    fn reset(&mut self, rates: &[f64], step_s: f64) {
        self.step_s = step_s;
        self.rates.clear();
        self.rates.extend_from_slice(rates);
        self.steps.clear();
        let pieces = |rate: f64| move |i: usize| Turn::new(rate, step_s / (i + 1) as f64);
        self.steps.extend(rates.iter().map(|&rate| core::array::from_fn(pieces(rate))));
        self.headings.clear();
        self.facings.clear();
        self.points.clear();
        let (mut heading, mut point) = (0.0, Complex::new(0.0, 0.0));
        for step in 0..=rates.len() {
            self.headings.push(heading);
            self.facings.push(unit(heading));
            self.points.push(point);
            if let Some(rate) = rates.get(step) {
                point += arc(heading, *rate, step_s);
                heading += rate * step_s;
            }
        }
    }

    /// Duration of a step (s).
    pub(super) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The turn over a whole step.
    pub(super) fn turn(&self, step: usize) -> Turn {
        self.steps[step][0]
    }

    /// The turn over one of `count` ≥ 1 equal pieces of a step.
    pub(super) fn piece(&self, step: usize, count: usize) -> Turn {
        match self.steps[step].get(count - 1) {
            Some(turn) => *turn,
            None => Turn::new(self.rates[step], self.step_s / count as f64),
        }
    }

    /// e^{i·heading} after `step` steps.
    pub(super) fn facing(&self, step: usize) -> Complex<f64> {
        self.facings[step]
    }

    /// Heading after `step` steps (rad, not wrapped).
    pub(super) fn heading(&self, step: usize) -> f64 {
        self.headings[step]
    }

    /// Position after `step` steps.
    pub(super) fn point(&self, step: usize) -> Complex<f64> {
        self.points[step]
    }

    /// Position and heading `seconds` after the beginning of step `step`.
    pub(super) fn within(&self, step: usize, seconds: f64) -> (Complex<f64>, f64) {
        let (rate, heading) = (self.rates[step], self.headings[step]);
        (self.points[step] + arc(heading, rate, seconds), heading + rate * seconds)
    }
}

/// Threshold (rad/s) for steps that last `seconds` in total. A bound that forbids driving straight by
/// less than this counts as zero. Otherwise, extremals would diverge beyond double precision. This
/// admits up to 10⁻⁵ rad more turn in total, and positions that are farther out by at most 10⁻⁵ of the
/// distance travelled.
pub(crate) fn nearly_zero(seconds: f64) -> f64 {
    1e-5 / seconds
}

/// Bounds that forbid driving straight by less than this (rad/s) count as grazing. Neighbouring
/// extremals then diverge so fast that the search misses some of the extremals between them.
const GRAZING: f64 = 0.01;

/// The corresponding threshold per step (rad).
const GRAZING_RAD: f64 = 0.002;

/// The bounds and their two outermost paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Paths {
    pub(super) step_s: f64,
    pub(super) lo: Vec<f64>,
    pub(super) hi: Vec<f64>,
    /// Lowest and highest speed in each step, as shares of the highest speed of all steps.
    pub(super) speeds: Vec<[f64; 2]>,
    /// The path with the lowest rates: the right-hand edge.
    pub(super) low: Path,
    /// The path with the highest rates: the left-hand edge.
    pub(super) high: Path,
}

impl Paths {
    #[cfg(test)]
    pub(super) fn new(bounds: &InputBounds, step_s: f64) -> Self {
        let mut paths = Self::default();
        paths.reset(bounds, step_s);
        paths
    }

    /// Replaces the bounds, with one constant speed in all steps, and reuses the buffers.
    pub(super) fn reset(&mut self, bounds: &InputBounds, step_s: f64) {
        self.step_s = step_s;
        self.speeds.clear();
        self.speeds.resize(bounds.steps(), [1.0; 2]);
        let nearly = nearly_zero(step_s * bounds.steps() as f64);
        self.lo.clear();
        self.lo.extend(bounds.lo().iter().map(|&lo| if lo < nearly { lo.min(0.0) } else { lo }));
        self.hi.clear();
        self.hi.extend(bounds.hi().iter().map(|&hi| if hi > -nearly { hi.max(0.0) } else { hi }));
        self.low.reset(&self.lo, step_s);
        self.high.reset(&self.hi, step_s);
    }

    pub(super) fn steps(&self) -> usize {
        self.lo.len()
    }

    /// Whether the vehicle has one constant speed in the first `steps` steps.
    pub(super) fn have_one_speed(&self, steps: usize) -> bool {
        self.speeds.iter().take(steps).all(|speeds| *speeds == [1.0; 2])
    }

    /// Whether driving straight is admissible in step `step`.
    pub(super) fn straight_admissible(&self, step: usize) -> bool {
        self.lo[step] <= 0.0 && 0.0 <= self.hi[step]
    }

    /// Whether driving straight is admissible in each of the first `steps` steps.
    pub(super) fn straight_always(&self, steps: usize) -> bool {
        (0..steps).all(|step| self.straight_admissible(step))
    }

    /// Whether, in one of the first `steps` steps, the bounds leave a choice but narrowly forbid driving
    /// straight.
    pub(super) fn graze_straight(&self, steps: usize) -> bool {
        let grazing = GRAZING.max(GRAZING_RAD / self.step_s);
        self.lo.iter().zip(&self.hi).take(steps).any(|(lo, hi)| {
            let forbidden_by = lo.max(-hi);
            lo < hi && 0.0 < forbidden_by && forbidden_by < grazing
        })
    }

    /// The range of φ (rad; from a value ≤ 0 to a value ≥ 0) with which extremals of the front can end
    /// after `steps` steps. Below the range the path keeps the highest rate throughout, above it the
    /// lowest rate. The lower end of the range is the largest right turn that the highest rates make
    /// from any step to the end. The upper end is the largest left turn of the lowest rates.
    pub(super) fn end_phi_range(&self, steps: usize) -> (f64, f64) {
        let (high, low) = (self.high.heading(steps), self.low.heading(steps));
        (0..steps).fold((0.0, 0.0), |(left, right): (f64, f64), step| {
            (left.min(high - self.high.heading(step)), right.max(low - self.low.heading(step)))
        })
    }

    /// Width of the range of headings (rad) along an outermost path in the first `steps` steps. Of the
    /// two paths, the one with the larger width counts.
    pub(super) fn swing(&self, steps: usize) -> f64 {
        let of = |path: &Path| {
            let headings = (0..=steps).map(|step| path.heading(step));
            let (low, high) = headings.fold((0.0, 0.0), |(low, high): (f64, f64), heading| {
                (low.min(heading), high.max(heading))
            });
            high - low
        };
        of(&self.low).max(of(&self.high))
    }

    /// Lowest and highest heading that occurs in the first `steps` steps (rad).
    pub(super) fn heading_range(&self, steps: usize) -> (f64, f64) {
        (0..=steps).fold((0.0, 0.0), |(low, high): (f64, f64), step| {
            (low.min(self.low.heading(step)), high.max(self.high.heading(step)))
        })
    }
}
