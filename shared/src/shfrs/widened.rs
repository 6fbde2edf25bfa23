//! Bounds widened by ε: the least ε that a recorded window needs, and the area of the reachable
//! set.

use super::window::Window;
use super::window_sets::same_steps;
use crate::bounds::InputBounds;
use crate::invalid::Invalid;
use crate::math::{PI, wrap_angle};
use crate::reach::polygon::signed_area;
use crate::reach::{Membership, PolygonSettings, ReachableSet, Tolerance};
use crate::scene::SceneParameters;
use crate::vehicle::Pose;

/// Scores exceed the exact least widening by at most this value (rad/s).
pub const RESOLUTION_RADPS: f64 = 1e-4;

/// The bounds of each step (rad/s), widened by `epsilon` ≥ 0 on both sides and clamped to
/// `turn_rate`.
///
/// # Errors
/// [`Invalid`] if there are no steps, a bound is outside `turn_rate`, or a lower bound exceeds its
/// upper bound.
pub fn widened(
    base: &[(f64, f64)],
    epsilon: f64,
    turn_rate: (f64, f64),
) -> Result<InputBounds, Invalid> {
    let lo = base.iter().map(|&(lo, _)| (lo - epsilon).max(turn_rate.0)).collect();
    let hi = base.iter().map(|&(_, hi)| (hi + epsilon).min(turn_rate.1)).collect();
    InputBounds::new(lo, hi, turn_rate)
}

/// The least widening of `base` (rad/s) with which a window's trajectory is inside the reachable
/// set at every step. The result is at most [`RESOLUTION_RADPS`] above the exact value.
///
/// The state after a step is inside if the recorded turn rates up to that step satisfy the bounds,
/// or if it is certainly in the reachable set, within `tolerance`. A set that admits every turn
/// rate contains every trajectory by definition, so a least widening always exists.
///
/// # Errors
/// [`Invalid`] if `base` and the window differ in length, or if `base` contains invalid bounds.
pub fn least_widening(
    base: &[(f64, f64)],
    window: &Window<'_>,
    parameters: &SceneParameters,
    tolerance: Tolerance,
) -> Result<f64, Invalid> {
    let range = parameters.human.turn_range();
    let by_inputs = enough_by_inputs(base, window, range)?;
    let start = window.now().human;
    let mut least = 0.0;
    // Later states usually need more widening. If they are tested first, few of the earlier states
    // need a test.
    for step in (1..=base.len()).rev() {
        let enough = by_inputs[step - 1];
        if enough <= least {
            break;
        }
        let base = &base[..step];
        let state = window.future()[step - 1].human;
        let inside = |epsilon: f64| -> Result<bool, Invalid> {
            let bounds = widened(base, epsilon, range)?;
            let set =
                ReachableSet::new(start, &bounds, parameters.human.speed_mps, parameters.step_s)?;
            Ok(set.state_membership(step, state, tolerance, 0) == Membership::Inside)
        };
        let below =
            needed_by_heading(base, state.psi - start.psi, (least, enough), parameters, tolerance);
        least = first_true((below, enough), inside)?.1;
    }
    Ok(least)
}

/// An interval that contains the result of [`least_widening`]. It is computed from turn rates and
/// headings alone, at a few per cent of the cost of the exact result.
///
/// # Errors
/// The errors of [`least_widening`].
pub fn widening_between(
    base: &[(f64, f64)],
    window: &Window<'_>,
    parameters: &SceneParameters,
    tolerance: Tolerance,
) -> Result<(f64, f64), Invalid> {
    let by_inputs = enough_by_inputs(base, window, parameters.human.turn_range())?;
    let start = window.now().human;
    let mut least = 0.0_f64;
    for step in (1..=base.len()).rev() {
        let enough = by_inputs[step - 1];
        if enough <= least {
            break;
        }
        let turned = window.future()[step - 1].human.psi - start.psi;
        let within = (least, enough);
        least = needed_by_heading(&base[..step], turned, within, parameters, tolerance);
    }
    Ok((least, by_inputs.last().copied().unwrap_or(0.0)))
}

/// For each step, the least widening with which the state after the step is certainly inside,
/// because the widened bounds admit either the recorded turn rates up to this step or every turn
/// rate. These widenings never decrease from step to step.
fn enough_by_inputs(
    base: &[(f64, f64)],
    window: &Window<'_>,
    range: (f64, f64),
) -> Result<Vec<f64>, Invalid> {
    same_steps(window, base.len())?;
    let lacking =
        |&(lo, hi): &(f64, f64), rates: (f64, f64)| (lo - rates.0).max(rates.1 - hi).max(0.0);
    let full = base.iter().map(|bounds| lacking(bounds, range)).fold(0.0, f64::max);
    let mut enough = 0.0_f64;
    let held = base.iter().zip(window.turn_rates()).map(|(bounds, &held)| {
        enough = enough.max(lacking(bounds, (held, held)));
        enough.min(full)
    });
    Ok(held.collect())
}

/// A lower bound, in the interval `within`, on the widening that allows the heading to change by
/// `turned` (rad). The heading is known only modulo 2π, so bounds that allow it to change by π or
/// more in one direction always pass the test.
fn needed_by_heading(
    base: &[(f64, f64)],
    turned: f64,
    within: (f64, f64),
    parameters: &SceneParameters,
    tolerance: Tolerance,
) -> f64 {
    let (range, step_s) = (parameters.human.turn_range(), parameters.step_s);
    let turned = wrap_angle(turned);
    let slack = tolerance.heading_rad + 1e-9;
    let admitted = |epsilon: f64| {
        let (low, high) = base.iter().fold((0.0, 0.0), |(low, high), &(lo, hi)| {
            let (lo, hi) = ((lo - epsilon).max(range.0), (hi + epsilon).min(range.1));
            (low + lo * step_s, high + hi * step_s)
        });
        let wide = low - slack <= -PI || PI <= high + slack;
        wide || (low - slack <= turned && turned <= high + slack)
    };
    first_true(within, |epsilon| Ok(admitted(epsilon))).map_or(within.0, |(below, _)| below)
}

/// Bisection for the value at which the monotone predicate `holds` becomes true. The predicate is
/// assumed to be true at the upper end of `within`. Returns an interval, no longer than
/// [`RESOLUTION_RADPS`], at whose lower end the predicate is false and at whose upper end it is true.
/// If the predicate is true at the lower end of `within`, both ends of the result are this lower end.
fn first_true(
    within: (f64, f64),
    holds: impl Fn(f64) -> Result<bool, Invalid>,
) -> Result<(f64, f64), Invalid> {
    let (mut no, mut yes) = within;
    if holds(no)? {
        return Ok((no, no));
    }
    while yes - no > RESOLUTION_RADPS {
        let middle = 0.5 * (no + yes);
        if holds(middle)? {
            yes = middle;
        } else {
            no = middle;
        }
    }
    Ok((no, yes))
}

/// Area (m²) of all positions that are reachable within the steps of `bounds`.
///
/// If straight driving is always admissible and reachable headings differ by less than π, the area
/// is Σ c_i (hi_i − lo_i) with c_i = (v²/6)((T − t_i)³ − (T − t_{i+1})³), T and t in seconds.
/// Otherwise, the area is the area of a polygon that is accurate to 0.1 mm.
///
/// # Errors
/// [`Invalid`] if a parameter is not finite and > 0.
pub fn tube_area_m2(bounds: &InputBounds, parameters: &SceneParameters) -> Result<f64, Invalid> {
    let (speed, step_s) = (parameters.human.speed_mps, parameters.step_s);
    let straight = bounds.lo().iter().zip(bounds.hi()).all(|(&lo, &hi)| lo <= 0.0 && 0.0 <= hi);
    let widths = || bounds.lo().iter().zip(bounds.hi()).map(|(lo, hi)| hi - lo);
    if straight && widths().sum::<f64>() * step_s < PI - 1e-6 {
        let left = |i: usize| (bounds.steps() - i) as f64 * step_s;
        let cube = |seconds: f64| seconds * seconds * seconds;
        let weighted = |(i, width)| (cube(left(i)) - cube(left(i + 1))) * width;
        return Ok(speed * speed / 6.0 * widths().enumerate().map(weighted).sum::<f64>());
    }
    let set = ReachableSet::new(Pose::new(0.0, 0.0, 0.0), bounds, speed, step_s)?;
    Ok(signed_area(&set.tube_polygon(PolygonSettings::default())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;
    use crate::shfrs::testing::{drive, drive_told};

    const RANGE: (f64, f64) = (-0.5, 0.5);

    fn random_base(rng: &mut SeededRng, steps: usize) -> Vec<(f64, f64)> {
        let rates = [-0.5_f64, 0.0, 0.5];
        let mut pair = || (rates[rng.below(3)], rates[rng.below(3)]);
        (0..steps).map(|_| pair()).map(|(a, b)| (a.min(b), a.max(b))).collect()
    }

    /// Reference implementation: whether the set at ε contains the trajectory.
    fn inside(base: &[(f64, f64)], window: &Window<'_>, epsilon: f64) -> bool {
        let bounds = widened(base, epsilon, RANGE).unwrap();
        let set = ReachableSet::new(window.now().human, &bounds, 2.0, 0.2).unwrap();
        let states: Vec<Pose> = window.future().iter().map(|state| state.human).collect();
        set.contains_trajectory(&states, Some(window.turn_rates()), Tolerance::default())
    }

    #[test]
    fn the_least_widening_is_where_the_trajectory_gets_inside() {
        let mut rng = SeededRng::new(3);
        let parameters = SceneParameters::default();
        for case in 0..300 {
            let steps = 1 + rng.below(10);
            let base = random_base(&mut rng, steps);
            let held: Vec<f64> = (0..steps).map(|_| [-0.5, 0.0, 0.5][rng.below(3)]).collect();
            // In half of the drives, the input changes within a step, but the recording does not
            // show the change.
            let driven = held.iter().map(|&rate| {
                if case % 2 == 0 || rng.unit() < 0.7 { rate } else { rate * rng.unit() }
            });
            let drive = drive_told(&driven.collect::<Vec<_>>(), &held);
            let window = Window::new(&drive, 0, steps).unwrap();
            let score = least_widening(&base, &window, &parameters, Tolerance::default()).unwrap();
            let (least, most) =
                widening_between(&base, &window, &parameters, Tolerance::default()).unwrap();
            assert!(0.0 <= least && least <= score && score <= most && most <= 1.0);
            let full = score >= 1.0 - 1e-12;
            assert!(full || inside(&base, &window, score), "{base:?} {held:?} {score}");
            let below = score - 1.01 * RESOLUTION_RADPS;
            assert!(below < 0.0 || !inside(&base, &window, below), "{base:?} {held:?} {score}");
        }
    }

    #[test]
    fn drives_that_do_what_was_predicted_need_no_widening() {
        let drive = drive(&[0.5, 0.0, -0.5]);
        let window = Window::new(&drive, 0, 3).unwrap();
        let score = |base: &[(f64, f64)]| {
            least_widening(base, &window, &SceneParameters::default(), Tolerance::default())
                .unwrap()
        };
        assert_eq!(score(&[(0.5, 0.5), (0.0, 0.0), (-0.5, -0.5)]), 0.0);
        assert_eq!(score(&[(-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5)]), 0.0);
        let opposite = score(&[(-0.5, -0.5), (0.0, 0.0), (-0.5, -0.5)]);
        assert!(opposite > 0.9 && opposite <= 1.0, "{opposite}");
    }

    /// Only the full set contains a drive that is impossible for this vehicle.
    #[test]
    fn impossible_drives_need_everything() {
        let drive = drive(&[1.5; 4]);
        let window = Window::new(&drive, 0, 4).unwrap();
        let score = least_widening(
            &[(0.0, 0.0); 4],
            &window,
            &SceneParameters::default(),
            Tolerance::default(),
        );
        assert_eq!(score.unwrap(), 0.5);
        let short = Window::new(&drive, 0, 3).unwrap();
        let complaint = least_widening(
            &[(0.0, 0.0); 4],
            &short,
            &SceneParameters::default(),
            Tolerance::default(),
        );
        assert_eq!(complaint.unwrap_err().to_string(), "window: expected 4 steps, found 3 steps");
    }

    #[test]
    fn the_closed_form_is_the_area_of_the_polygon() {
        let mut rng = SeededRng::new(4);
        let parameters = SceneParameters::default();
        for _ in 0..200 {
            let steps = 1 + rng.below(15);
            let base = random_base(&mut rng, steps);
            let bounds = widened(&base, rng.unit(), RANGE).unwrap();
            let set = ReachableSet::new(Pose::new(0.0, 0.0, 0.0), &bounds, 2.0, 0.2).unwrap();
            let polygon = signed_area(&set.tube_polygon(PolygonSettings::default()));
            let found = tube_area_m2(&bounds, &parameters).unwrap();
            assert!((found - polygon).abs() < 1e-3 * (1.0 + polygon), "{found} {polygon}");
        }
    }
}
