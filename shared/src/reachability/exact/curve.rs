//! The level set {V = c} at one heading, in closed form.
//!
//! The frame is the evader's frame, rotated to the mean of the two headings (see
//! [`Halfway`](super::Halfway)). Where the range increases, the set {V ≤ c} is half a disc. Where
//! the range decreases, the set is the intersection of two convex regions. One region contains the
//! states from which the range falls to R + c or less if the evader turns right. The other region
//! is the same for left turns. The boundary of a region consists of a straight line, an involute of
//! a circle, and a circular arc, one for each [`Ending`](super::Ending) of the pursuit.

use super::{ExactValue, Sheet};
use crate::invalid::{Invalid, finite};
use crate::math::{PI, sin_cos, wrap_positive};

/// Rejects a heading that is not finite and a level (m) that no state can have.
pub(in crate::reachability) fn check_slice(
    psi: f64,
    level: f64,
    radius_m: f64,
) -> Result<(), Invalid> {
    finite("psi", psi)?;
    finite("level", level)?;
    if level <= -radius_m {
        let expected = format!("above -radius_m = {}", -radius_m);
        return Err(Invalid::new("level", expected, level));
    }
    Ok(())
}

/// Checks the tolerance of a curve (m); infinite means as coarse as possible.
pub(in crate::reachability) fn check_fineness(name: &str, fine_m: f64) -> Result<(), Invalid> {
    if fine_m > 0.0 { Ok(()) } else { Err(Invalid::new(name, "a number > 0", fine_m)) }
}

impl ExactValue {
    /// The boundary of {V ≤ `level`} at relative heading `psi` (rad), as a counter-clockwise
    /// polygon in the evader's frame (m), without a repeated end point. Its vertices are on the
    /// level curve, and its edges deviate from the curve by at most about `flatness_m`.
    ///
    /// # Errors
    /// [`Invalid`] for a `psi` that is not finite, a `level` that no state can have (not finite, or
    /// ≤ −R, where the set is at most the point r = 0), a `level` whose range in turning radii
    /// overflows, or a `flatness_m` that is not > 0.
    pub fn level_curve(
        &self,
        psi: f64,
        level: f64,
        flatness_m: f64,
    ) -> Result<Vec<[f64; 2]>, Invalid> {
        let mut curve = Vec::new();
        self.level_curve_into(psi, level, flatness_m, &mut curve)?;
        Ok(curve)
    }

    /// Like [`Self::level_curve`], but replaces the contents of `curve`.
    ///
    /// # Errors
    /// The errors of [`Self::level_curve`]; `curve` is then empty.
    pub fn level_curve_into(
        &self,
        psi: f64,
        level: f64,
        flatness_m: f64,
        curve: &mut Vec<[f64; 2]>,
    ) -> Result<(), Invalid> {
        curve.clear();
        check_slice(psi, level, self.radius_m)?;
        check_fineness("flatness_m", flatness_m)?;
        let range = (level + self.radius_m) / self.turning_radius_m;
        if !(range.is_finite() && range > 0.0) {
            let expected = format!(
                "a level whose range is a finite number > 0 in turning radii of {} m",
                self.turning_radius_m
            );
            return Err(Invalid::new("level", expected, level));
        }
        let half = 0.5 * wrap_positive(psi);
        let (sin_half, cos_half) = sin_cos(half);
        let right = Side { range, sin_half, cos_half, rest: PI - half };
        // The left side is the right side of the mirror image, as for the left sheet.
        let left = Side { range, sin_half, cos_half: -cos_half, rest: half };
        let flatness = flatness_m / self.turning_radius_m;
        // The points run clockwise in (ahead, right), and therefore counter-clockwise in the
        // evader's frame, whose y axis points to the left.
        let mut add = |[ahead, right]: [f64; 2]| {
            let [x, y] = super::slope([ahead, right], sin_half, cos_half);
            curve.push([x * self.turning_radius_m, y * self.turning_radius_m]);
        };
        // First the half circle from straight ahead to straight behind, where the range increases.
        for angle in places(PI, range, flatness) {
            let (sin, cos) = sin_cos(angle);
            add([range * cos, -range * sin]);
        }
        // Then the boundary of the left region, up to the point where it leaves the right region.
        // Last, the boundary of the right region, backwards.
        let (end, back) = (left.end(&right), right.end(&left));
        let places = left.places(end, flatness).chain([end]);
        for place in [Side::BEGINNING].into_iter().chain(places) {
            let [ahead, right] = left.point(place);
            add([-ahead, right]);
        }
        right.places(back, flatness).rev().for_each(|place| add(right.point(place)));
        Ok(())
    }
}

/// The boundary of the region where one sheet is at most `range`, from straight ahead to straight
/// behind. All lengths are in turning radii. The parameter of a boundary point, its *place*, is the
/// angle of the outward normal from straight ahead (rad). Along the straight line, the normal is
/// constant, so there the place runs from −1 to 0 instead.
struct Side {
    range: f64,
    sin_half: f64,
    cos_half: f64,
    /// The largest angle of the involute's normals (rad).
    rest: f64,
}

impl Side {
    /// The place where the straight line begins.
    const BEGINNING: f64 = -1.0;

    /// The point (ahead, right) at a place.
    fn point(&self, place: f64) -> [f64; 2] {
        if place <= 0.0 {
            return [self.range, (1.0 + place) * (2.0 + 2.0 * self.cos_half)];
        }
        let (sin, cos) = sin_cos(place);
        if place < self.rest {
            // At u = `place`, ahead·cos u + a·sin u − 2u equals the range, and its derivative is
            // zero. These two equations determine the point.
            let radius = self.range + 2.0 * place;
            [radius * cos - 2.0 * sin, radius * sin + 2.0 * (cos + self.cos_half)]
        } else {
            let radius = self.range + 2.0 * self.rest;
            [radius * cos - 2.0 * self.sin_half, radius * sin]
        }
    }

    /// The sheet's smallest range from (ahead, right).
    fn of(&self, [ahead, right]: [f64; 2]) -> f64 {
        Sheet::new(ahead, right, self.sin_half, self.cos_half, self.rest).range
    }

    /// The place where this boundary leaves the region of the other side, whose `ahead` has the
    /// opposite sign. The two boundaries cross once, since every ray from r = 0 leaves {V ≤ c}
    /// once.
    fn end(&self, other: &Side) -> f64 {
        let (mut inside, mut outside) = (Self::BEGINNING, PI);
        // Bisection to double precision.
        for _ in 0..52 {
            let middle = 0.5 * (inside + outside);
            let [ahead, right] = self.point(middle);
            if other.of([-ahead, right]) <= self.range {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// Places from the end of the straight line up to, but not including, `end`.
    fn places(&self, end: f64, flatness: f64) -> impl DoubleEndedIterator<Item = f64> {
        // If the straight line has no length, its end coincides with its beginning and is omitted.
        let has_line = self.cos_half > -1.0;
        places(end, self.range + 2.0 * self.rest, flatness).skip(usize::from(!has_line))
    }
}

/// Evenly spaced angles from 0 up to, but not including, `end`. The chords between them deviate
/// from an arc of this radius by at most `flatness`, unless the spacing reaches its lower or upper
/// limit.
fn places(
    end: f64,
    radius: f64,
    flatness: f64,
) -> impl DoubleEndedIterator<Item = f64> + ExactSizeIterator {
    let step = (8.0 * flatness / radius).sqrt().clamp(PI / 2048.0, PI / 8.0);
    let count = (end / step).ceil().max(0.0);
    (0..count as usize).map(move |i| end * i as f64 / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{TAU, atan2, hypot, wrap_angle};
    use proptest::prelude::*;

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        polygon.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
    }

    /// The range at which a ray from r = 0 leaves {V ≤ level}, by bisection on the value alone.
    fn leaves(game: &ExactValue, psi: f64, level: f64, bearing: f64) -> f64 {
        let (sin, cos) = sin_cos(bearing);
        let is_inside = |r: f64| game.value([r * cos, r * sin, psi]) <= level;
        let (mut inside, mut outside) = (0.0, game.range_bound_m(level));
        assert!(!is_inside(outside));
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            *(if is_inside(middle) { &mut inside } else { &mut outside }) = middle;
        }
        inside
    }

    /// The range at which a ray from r = 0 leaves a polygon around it.
    fn leaves_polygon(curve: &[[f64; 2]], bearing: f64) -> f64 {
        let (sin, cos) = sin_cos(bearing);
        let next = curve.iter().cycle().skip(1);
        let crossings = curve.iter().zip(next).filter_map(|(a, b)| {
            let [from, to] = [a, b].map(|p| cos * p[1] - sin * p[0]);
            let share = from / (from - to);
            let [x, y] = [0, 1].map(|d| a[d] + share * (b[d] - a[d]));
            (from <= 0.0 && to > 0.0).then_some(cos * x + sin * y)
        });
        crossings.filter(|&r| r > 0.0).fold(0.0, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn it_is_the_curve_that_the_value_has(
            speed_mps in 0.3..4.0f64,
            turn_rate_radps in 0.1..3.0f64,
            radius_m in 0.2..5.0f64,
            psi in -7.0..7.0f64,
            level in -0.9..6.0f64,
        ) {
            let game = ExactValue::new(speed_mps, turn_rate_radps, radius_m).unwrap();
            let level = if level < 0.0 { level * radius_m } else { level };
            let flatness_m = 0.01;
            let curve = game.level_curve(psi, level, flatness_m).unwrap();
            for &[x, y] in &curve {
                let value = game.value([x, y, psi]);
                prop_assert!((value - level).abs() < 1e-9, "V({x}, {y}) = {value}, not {level}");
            }
            for (from, to) in curve.iter().zip(curve.iter().cycle().skip(1)) {
                let turn = wrap_angle(atan2(to[1], to[0]) - atan2(from[1], from[0]));
                prop_assert!(turn > -1e-9, "it goes back by {turn} rad from {from:?}");
            }
            for i in 0..97 {
                let bearing = TAU * f64::from(i) / 97.0;
                let (truth, found) =
                    (leaves(&game, psi, level, bearing), leaves_polygon(&curve, bearing));
                let (sin, cos) = sin_cos(bearing);
                let miss = game.value([found * cos, found * sin, psi]) - level;
                prop_assert!(miss.abs() < 1.05 * flatness_m, "{bearing} rad: {found} m, not {truth} m");
            }
        }
    }

    #[test]
    fn same_heading_gives_the_danger_zone() {
        let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        let disc = game.level_curve(0.0, 0.0, 0.001).unwrap();
        assert!((area(&disc) - 9.0 * PI).abs() < 0.02, "{}", area(&disc));
        assert!(disc.iter().all(|p| (hypot(p[0], p[1]) - 3.0).abs() < 1e-12));
        let twice = disc.iter().zip(disc.iter().cycle().skip(1)).filter(|(a, b)| a == b).count();
        assert_eq!(twice, 0);
    }

    #[test]
    fn the_tip_is_not_cut_off() {
        let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        let curve = game.level_curve(PI, 0.0, 0.01).unwrap();
        let reach = curve.iter().map(|p| hypot(p[0], p[1])).fold(0.0, f64::max);
        // The published value is 13.021 m.
        assert!((reach - 13.021).abs() < 5e-4, "{reach}");
    }

    #[test]
    fn what_no_state_can_have_is_named() {
        let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        let mut curve = vec![[1.0, 1.0]];
        let mut refused = |psi, level, flatness_m| {
            let invalid = game.level_curve_into(psi, level, flatness_m, &mut curve).unwrap_err();
            assert!(curve.is_empty());
            invalid.to_string()
        };
        for (psi, level, flatness_m, expected) in [
            (0.0, -3.0, 0.01, "level: expected above -radius_m = -3, found -3"),
            (0.0, -4.0, 0.01, "level: expected above -radius_m = -3, found -4"),
            (f64::NAN, 0.0, 0.01, "psi: expected a finite number, found NaN"),
            (0.0, f64::INFINITY, 0.01, "level: expected a finite number, found inf"),
            (0.0, 0.0, 0.0, "flatness_m: expected a number > 0, found 0"),
            (0.0, 0.0, f64::NAN, "flatness_m: expected a number > 0, found NaN"),
        ] {
            assert_eq!(refused(psi, level, flatness_m), expected);
        }
        let tight = ExactValue::new(1e-9, 1.0, 3.0).unwrap();
        assert_eq!(tight.level_curve(0.0, 1e300, 0.01).unwrap_err().field, "level");
    }
}
