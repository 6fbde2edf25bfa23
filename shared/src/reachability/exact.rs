//! The value of the game of two identical vehicles, in closed form.
//!
//! Based on the barrier of Merz (1972) and Mitchell (2001, "Games of two identical vehicles"),
//! extended to every state. Lengths are scaled by the turning radius ρ = v/ω, so one formula holds
//! for all speeds and turn rates.
//!
//! While the range decreases, V + R is the larger of two *sheets*. One sheet is the smallest range
//! if the evader turns right until the end and the pursuer responds optimally. The other sheet is
//! the same for left turns. V has a kink where the sheets intersect; elsewhere the larger sheet is
//! smooth.

mod curve;

pub(super) use curve::{check_fineness, check_slice};

use crate::invalid::{Invalid, finite, length, positive};
use crate::math::{PI, atan2, hypot, sin_cos, wrap_positive};
use crate::parallel::parallel_parts;

/// Sheets that differ by at most this many turning radii count as equal. The tolerance is several
/// hundred times the sheets' rounding error at a range of a thousand turning radii.
const KINK: f64 = 1e-9;

/// The pursuer goes straight when its heading is within δ = 10⁻⁴ rad of the optimal heading. This
/// constant is 1 − cos δ, the magnitude of the pursuer's switching function |∂V/∂ψ|/ρ at δ. If the
/// pursuer keeps such a heading until the end, at most π/ω later, it loses less than 2·10⁻⁸ ρ.
const ALIGNED: f64 = 5e-9;

/// The squared ranges (in squared turning radii) that neither overflow nor lose digits.
const SQUARES: core::ops::RangeInclusive<f64> = 1e-280..=f64::MAX;

/// The value function of two vehicles with the same speed and largest turn rate.
///
/// # Example
/// ```
/// use sidestep::reachability::ExactValue;
///
/// # fn main() -> Result<(), sidestep::invalid::Invalid> {
/// let safety = ExactValue::new(2.0, 0.5, 3.0)?; // m/s, rad/s, m
/// // The pursuer is 4 m ahead and comes towards the evader: no turn helps.
/// let state = safety.analyze([4.0, 0.0, core::f64::consts::PI]);
/// assert!(state.value < 0.0); // m
/// // It drives away: at most the range that it has now, less the radius.
/// assert_eq!(safety.value([4.0, 0.0, 0.0]), 1.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactValue {
    /// Speed v of both vehicles (m/s).
    speed_mps: f64,
    /// Largest turn rate ω of both vehicles (rad/s).
    turn_rate_radps: f64,
    /// Turning radius ρ = v/ω (m).
    turning_radius_m: f64,
    /// Danger radius R (m).
    radius_m: f64,
}

impl ExactValue {
    /// The game of two vehicles of speed `speed_mps` and turn rates within
    /// ±`turn_rate_radps`, where a range of `radius_m` or less is a capture.
    ///
    /// # Errors
    /// [`Invalid`] if a parameter is not a finite number > 0.
    pub fn new(speed_mps: f64, turn_rate_radps: f64, radius_m: f64) -> Result<Self, Invalid> {
        positive("speed_mps", speed_mps)?;
        positive("turn_rate_radps", turn_rate_radps)?;
        positive("radius_m", radius_m)?;
        let turning_radius_m = speed_mps / turn_rate_radps;
        positive("speed_mps / turn_rate_radps", turning_radius_m)?;
        Ok(Self { speed_mps, turn_rate_radps, turning_radius_m, radius_m })
    }

    /// V (m) at the relative state (x, y, ψ). The pursuer is at (x, y) in the evader's frame (m; x
    /// ahead, y to the left). ψ is its heading relative to the evader's (rad, counter-clockwise,
    /// any real number). V ≤ 0 means that the pursuer can force a capture. The state must be
    /// finite, and its range must be at most 10³⁰⁸ turning radii.
    #[must_use]
    pub fn value(&self, state: [f64; 3]) -> f64 {
        let view = Halfway::new(self.turning_radius_m, state);
        if view.is_opening() {
            return self.metres(view.range);
        }
        let (right, left) = (view.right_sheet(), view.left_sheet());
        self.metres(view.range.min(right.range.max(left.range)))
    }

    /// Writes the value at each of `states` to `out`. The results have the same bits as
    /// [`Self::value`].
    ///
    /// # Errors
    /// [`Invalid`] if `out` and `states` differ in length, or if a coordinate is not finite. The
    /// error names the first such coordinate (for example `states[17].y`), and `out` is unchanged.
    pub fn values_into(&self, states: &[[f64; 3]], out: &mut [f64]) -> Result<(), Invalid> {
        check_states(states, out.len())?;
        self.fill(states, out);
        Ok(())
    }

    /// Like [`Self::values_into`], but on all available threads (in a browser, on one thread).
    ///
    /// # Errors
    /// The errors of [`Self::values_into`].
    pub fn parallel_values_into(
        &self,
        states: &[[f64; 3]],
        out: &mut [f64],
    ) -> Result<(), Invalid> {
        check_states(states, out.len())?;
        parallel_parts(states, out, PART, |states, out| self.fill(states, out));
        Ok(())
    }

    fn fill(&self, states: &[[f64; 3]], out: &mut [f64]) {
        for (value, &state) in out.iter_mut().zip(states) {
            *value = self.value(state);
        }
    }

    /// The value, its gradient and the optimal turn rates at a finite relative state.
    #[must_use]
    pub fn analyze(&self, state: [f64; 3]) -> ExactState {
        let view = Halfway::new(self.turning_radius_m, state);
        if view.is_opening() {
            return self.at_its_smallest(&view, state[1]);
        }
        let (right, left) = (view.right_sheet(), view.left_sheet());
        let nearest = right.range.max(left.range);
        // Far away, squares overflow in both sheets, and the sheets differ from the range only by
        // rounding errors.
        if nearest >= view.range || !nearest.is_finite() {
            return self.at_its_smallest(&view, state[1]);
        }
        // The left sheet is the right sheet of the mirror image, in which y, ψ and both turns have
        // the opposite sign.
        let (sheet, cos_half, side) = if right.range >= left.range {
            (right, view.cos_half, 1.0)
        } else {
            (left, -view.cos_half, -1.0)
        };
        let [dx, dy] = slope(sheet.direction, view.sin_half, cos_half);
        let twist = sheet.slope_psi(view.right, view.sin_half, cos_half);
        let ends_straight = sheet.ending != Ending::OppositeTurns && twist.abs() <= ALIGNED;
        let pursuer_side = match sheet.ending {
            _ if ends_straight => 0.0,
            Ending::OppositeTurns | Ending::Straight => side,
            Ending::SameTurns => -side,
        };
        ExactState {
            value: self.metres(nearest),
            gradient: [dx, side * dy, side * twist * self.turning_radius_m],
            evader_turn: -side * self.turn_rate_radps,
            pursuer_turn: pursuer_side * self.turn_rate_radps,
            on_kink: (right.range - left.range).abs() <= KINK,
        }
    }

    /// The analysis of a state whose current range is already the smallest range.
    fn at_its_smallest(&self, view: &Halfway, y: f64) -> ExactState {
        let Halfway { ahead, right, sin_half, cos_half, range, .. } = *view;
        // At range zero all directions are equally good, and the gradient is zero.
        let scale = if range > 0.0 { 1.0 / range } else { 0.0 };
        let direction = [ahead * scale, right * scale];
        let [dx, dy] = slope(direction, sin_half, cos_half);
        // Cosine and sine of the angle by which the pursuer must turn left to face the evader.
        let facing = sin_half * direction[1] - cos_half * direction[0];
        let turn_to_face = sin_half * direction[0] + cos_half * direction[1];
        let pursuer_side = if 1.0 - facing <= ALIGNED {
            0.0
        } else if turn_to_face >= 0.0 {
            1.0
        } else {
            -1.0
        };
        ExactState {
            value: self.metres(range),
            gradient: [dx, dy, 0.0],
            evader_turn: if y >= 0.0 { -self.turn_rate_radps } else { self.turn_rate_radps },
            pursuer_turn: pursuer_side * self.turn_rate_radps,
            on_kink: false,
        }
    }

    /// r − R (m) for a range r in turning radii.
    fn metres(&self, range: f64) -> f64 {
        self.turning_radius_m * range - self.radius_m
    }

    /// Speed v of both vehicles (m/s).
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Largest turn rate ω of both vehicles (rad/s).
    #[must_use]
    pub fn turn_rate_radps(&self) -> f64 {
        self.turn_rate_radps
    }

    /// Danger radius R (m).
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// A range (m) beyond which V > `level` at every bearing and heading.
    ///
    /// Both vehicles turn at full rate for at most π/ω, so the range decreases by at most twice the
    /// length of that manoeuvre.
    #[must_use]
    pub fn range_bound_m(&self, level: f64) -> f64 {
        2.0 * PI * self.turning_radius_m + self.radius_m + level
    }
}

/// Value, gradient and optimal turn rates of the game of two identical vehicles at one state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ExactState {
    /// V (m), with the same bits as [`ExactValue::value`].
    pub value: f64,
    /// (∂V/∂x, ∂V/∂y, ∂V/∂ψ) in m/m, m/m and m/rad. The first two components form a unit vector
    /// (zero at range zero).
    ///
    /// The gradient is one-sided where V is not smooth. On the kink it is the gradient on the side
    /// where the evader turns right. Where V = r − R, it is the gradient of r. On the surface that
    /// separates increasing from decreasing range, the gradients of both sides agree, except at
    /// equal headings (ψ = 0), where V bends in ψ on one side.
    pub gradient: [f64; 3],
    /// The evader's optimal turn rate, ±ω (rad/s). It is the turn rate of the larger sheet, or
    /// right (−ω) if both sheets are equal. It maximises a·(∂V/∂x·y − ∂V/∂y·x − ∂V/∂ψ). The factor
    /// of a is not zero while V < r − R.
    ///
    /// Where V = r − R, the factor is zero and the evader turns away from the pursuer: right if
    /// y ≥ 0, otherwise left. While it keeps this turn, the range never decreases.
    pub evader_turn: f64,
    /// The pursuer's optimal turn rate, −ω, 0 or ω (rad/s). It minimises b·∂V/∂ψ.
    ///
    /// It is zero where the pursuer's heading is within 10⁻⁴ rad of −(∂V/∂x, ∂V/∂y). The states
    /// with exactly this heading form a singular surface. On it, ∂V/∂ψ vanishes, and going straight
    /// keeps the pursuer on it to the end. If the best response is to turn opposite to the evader
    /// to the end, there is no singular surface and the turn rate is never zero. Where V = r − R,
    /// no turn can lower the value. The pursuer then turns to face the evader, or left if the
    /// evader is directly behind it.
    pub pursuer_turn: f64,
    /// Whether turning right and turning left are equally good for the evader: both sheets are
    /// below r, and they differ by at most 10⁻⁹ ρ.
    pub on_kink: bool,
}

/// Number of states that a thread computes as one part of the work. A part takes a fraction of a
/// millisecond.
pub(super) const PART: usize = 4096;

/// Rejects lengths that differ and a state that is not finite. The error names the coordinate.
pub(super) fn check_states(states: &[[f64; 3]], out: usize) -> Result<(), Invalid> {
    length("out", states.len(), out)?;
    let bad =
        states.iter().position(|state| !state.iter().all(|coordinate| coordinate.is_finite()));
    let Some(row) = bad else {
        return Ok(());
    };
    for (name, value) in ["x", "y", "psi"].into_iter().zip(states[row]) {
        finite(&format!("states[{row}].{name}"), value)?;
    }
    Ok(())
}

/// A relative state in turning radii, in the evader's frame rotated by h = ψ/2 to the mean of the
/// two headings. In this frame ṙ = 2 sin h · left / r in units of v, where left = −`right` is the
/// pursuer's offset to the left.
struct Halfway {
    /// The pursuer's offset along the mean heading.
    ahead: f64,
    /// The pursuer's offset to the right of the mean heading. If it is > 0, the range is
    /// decreasing.
    right: f64,
    /// h in [0, π).
    half: f64,
    sin_half: f64,
    cos_half: f64,
    range: f64,
}

impl Halfway {
    fn new(turning_radius_m: f64, [x, y, psi]: [f64; 3]) -> Self {
        let (x, y) = (x / turning_radius_m, y / turning_radius_m);
        let half = 0.5 * wrap_positive(psi);
        let (sin_half, cos_half) = sin_cos(half);
        let square = x * x + y * y;
        Self {
            ahead: x * cos_half + y * sin_half,
            right: x * sin_half - y * cos_half,
            half,
            sin_half,
            cos_half,
            // These operations are correctly rounded and several times faster than `hypot`, which
            // is needed only if the square underflows (vehicles that hardly turn) or overflows.
            range: if SQUARES.contains(&square) { square.sqrt() } else { hypot(x, y) },
        }
    }

    /// Whether the range increases, or would increase if the headings differed.
    fn is_opening(&self) -> bool {
        self.right <= 0.0
    }

    /// The sheet of an evader that turns right to the end.
    fn right_sheet(&self) -> Sheet {
        Sheet::new(self.ahead, self.right, self.sin_half, self.cos_half, PI - self.half)
    }

    /// The sheet of an evader that turns left to the end. In the mirror image (x, −y, 2π − ψ), h
    /// becomes π − h. So sin h is unchanged, and cos h and `ahead` change sign.
    fn left_sheet(&self) -> Sheet {
        Sheet::new(-self.ahead, self.right, self.sin_half, -self.cos_half, self.half)
    }
}

/// How the pursuer responds to an evader that turns one way to the end.
#[derive(Clone, Copy, PartialEq)]
enum Ending {
    /// The pursuer turns opposite to the evader until the range is smallest.
    OppositeTurns,
    /// The pursuer turns opposite to the evader until it can go straight to the nearest point.
    Straight,
    /// The pursuer first turns the same way as the evader, then goes straight until both headings
    /// are equal.
    SameTurns,
}

/// The smallest range when the evader turns right to the end.
#[derive(Clone, Copy)]
struct Sheet {
    /// The smallest range, in turning radii.
    range: f64,
    ending: Ending,
    /// The gradient (∂/∂ahead, ∂/∂right) of the range, a unit vector.
    direction: [f64; 2],
}

impl Sheet {
    /// The sheet at the state (`ahead`, `right` > 0, h), with `rest` = π − h.
    ///
    /// Inlined, so that the compiler omits the direction and its division where only the value is
    /// needed.
    #[inline]
    fn new(ahead: f64, right: f64, sin_half: f64, cos_half: f64, rest: f64) -> Self {
        let a = right - 2.0 * cos_half;
        if a <= 2.0 {
            return Self { range: ahead, ending: Ending::OppositeTurns, direction: [1.0, 0.0] };
        }
        // The range after going straight for 2u/ω is ahead·cos u + a·sin u − 2u. It is largest at
        // u = atan2(b, a) + acos(2/√(a² + b²)), which is in [0, π). The cosine and sine of u, times
        // a² + b², are rational in the root s.
        let b = -ahead;
        let s = ((a - 2.0) * (a + 2.0) + b * b).sqrt();
        let square = a * a + b * b;
        let (cos_u, sin_u) = (2.0 * a - b * s, 2.0 * b + a * s);
        // Tests u ≤ π − h by comparing the cosines.
        if cos_u >= -cos_half * square {
            Self {
                range: s - 2.0 * atan2(sin_u, cos_u),
                ending: Ending::Straight,
                direction: [cos_u / square, sin_u / square],
            }
        } else {
            // The distance between the centres of the two turning circles, which is constant while
            // both vehicles turn the same way.
            let along = ahead + 2.0 * sin_half;
            let between = (along * along + right * right).sqrt();
            Self {
                range: between - 2.0 * rest,
                ending: Ending::SameTurns,
                direction: [along / between, right / between],
            }
        }
    }

    /// ∂/∂ψ of the range: the pursuer's switching function, in turning radii.
    fn slope_psi(&self, right: f64, sin_half: f64, cos_half: f64) -> f64 {
        // 1 − cos of the angle from the pursuer's heading to −(∂V/∂x, ∂V/∂y).
        let off = 1.0 + (cos_half * self.direction[0] - sin_half * self.direction[1]);
        match self.ending {
            Ending::OppositeTurns => -0.5 * right,
            Ending::Straight => -off,
            Ending::SameTurns => off,
        }
    }
}

/// Converts a direction (ahead, right) to (x, y) in the evader's frame.
fn slope([ahead, right]: [f64; 2], sin_half: f64, cos_half: f64) -> [f64; 2] {
    [cos_half * ahead + sin_half * right, sin_half * ahead - cos_half * right]
}

#[cfg(test)]
mod tests;
