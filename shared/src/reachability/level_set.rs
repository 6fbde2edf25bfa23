//! Level curves that meet every ray from the origin once, for drawing.

use crate::math::{TAU, hypot, sin_cos};

/// How finely a curve is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveSettings {
    /// Rays of the first pass, evenly spaced.
    pub rays: usize,
    /// A ray is added where the curve leaves its chord by more than this, m.
    pub flatness_m: f64,
    /// Largest number of times that a gap between two rays is halved.
    pub max_depth: u32,
    /// Accuracy of each point along its ray, m.
    pub accuracy_m: f64,
    /// For curves through a grid: largest distance between neighbouring points, m.
    pub spacing_m: f64,
}

impl Default for CurveSettings {
    fn default() -> Self {
        Self { rays: 48, flatness_m: 0.01, max_depth: 9, accuracy_m: 1e-4, spacing_m: 0.15 }
    }
}

/// The boundary of {(x, y) : value(x, y) ≤ level} as a closed,
/// counter-clockwise polygon without repeated end point, m.
///
/// The set must contain the disc of radius `inner_m` around the origin, lie
/// inside the disc of radius `outer_m`, and meet every ray from the origin in
/// one interval. Sub-level sets of [`ExactValue`](super::ExactValue) at a fixed
/// heading do (inner: R + level, outer: its range bound).
pub fn radial_level_curve(
    value: impl Fn(f64, f64) -> f64,
    level: f64,
    inner_m: f64,
    outer_m: f64,
    settings: CurveSettings,
) -> Vec<[f64; 2]> {
    let point = |angle: f64| {
        let (sin, cos) = sin_cos(angle);
        let excess = |r: f64| value(r * cos, r * sin) - level;
        let r = crossing(excess, inner_m, outer_m, settings.accuracy_m);
        [r * cos, r * sin]
    };
    let mut curve = Vec::with_capacity(4 * settings.rays);
    let step = TAU / settings.rays as f64;
    let first = point(0.0);
    let mut from = first;
    for ray in 0..settings.rays {
        let angle = ray as f64 * step;
        let to = if ray + 1 == settings.rays { first } else { point(angle + step) };
        curve.push(from);
        refine(&point, (angle, from), (angle + step, to), settings, settings.max_depth, &mut curve);
        from = to;
    }
    curve
}

type RayPoint = (f64, [f64; 2]);

fn refine(
    point: &impl Fn(f64) -> [f64; 2],
    from: RayPoint,
    to: RayPoint,
    settings: CurveSettings,
    depth: u32,
    curve: &mut Vec<[f64; 2]>,
) {
    if depth == 0 {
        return;
    }
    let angle = 0.5 * (from.0 + to.0);
    let middle = point(angle);
    // The first two halvings are unconditional: the middle of a gap may lie on the chord although
    // the curve has a corner in the gap.
    if settings.max_depth - depth >= 2
        && chord_distance(middle, from.1, to.1) <= settings.flatness_m
    {
        return;
    }
    refine(point, from, (angle, middle), settings, depth - 1, curve);
    curve.push(middle);
    refine(point, (angle, middle), to, settings, depth - 1, curve);
}

fn chord_distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (ux, uy) = (b[0] - a[0], b[1] - a[1]);
    let (px, py) = (p[0] - a[0], p[1] - a[1]);
    let length = hypot(ux, uy);
    if length == 0.0 { hypot(px, py) } else { (ux * py - uy * px).abs() / length }
}

/// Where `excess` changes from ≤ 0 (at `low`) to > 0 (at `high`): the Illinois
/// variant of false position, which keeps its bracket.
fn crossing(excess: impl Fn(f64) -> f64, low: f64, high: f64, accuracy: f64) -> f64 {
    let (mut a, mut b) = (low, high);
    let (mut fa, mut fb) = (excess(a).min(0.0), excess(b));
    if fb <= 0.0 {
        return b;
    }
    let mut last_kept_low = None;
    for _ in 0..60 {
        let mut middle = if fb - fa > 0.0 { a - fa * (b - a) / (fb - fa) } else { 0.5 * (a + b) };
        if fa == 0.0 {
            // A flat start (the value equals the level all along) gives no slope.
            middle = 0.5 * (a + b);
        }
        let f = excess(middle);
        if f <= 0.0 {
            if middle - a < accuracy && f > -accuracy {
                a = middle;
                break;
            }
            (a, fa) = (middle, f);
            if last_kept_low == Some(false) {
                fb *= 0.5;
            }
            last_kept_low = Some(false);
        } else {
            if b - middle < accuracy && f < accuracy {
                b = middle;
                return 0.5 * (b + middle);
            }
            (b, fb) = (middle, f);
            if last_kept_low == Some(true) {
                fa *= 0.5;
            }
            last_kept_low = Some(true);
        }
        if b - a < accuracy {
            break;
        }
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::PI;
    use crate::reachability::ExactValue;

    fn curve(game: &ExactValue, psi: f64, level: f64) -> Vec<[f64; 2]> {
        radial_level_curve(
            |x, y| game.value([x, y, psi]),
            level,
            game.radius_m() + level,
            game.range_bound_m(level),
            CurveSettings::default(),
        )
    }

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        polygon.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
    }

    #[test]
    fn same_heading_gives_the_danger_zone() {
        let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        let disc = curve(&game, 0.0, 0.0);
        assert!((area(&disc) - 9.0 * PI).abs() < 0.03, "{}", area(&disc));
        assert!(disc.iter().all(|p| (hypot(p[0], p[1]) - 3.0).abs() < 1e-3));
    }

    #[test]
    fn every_point_lies_on_the_level() {
        let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        for level in [0.0, 1.0] {
            for i in 0..36 {
                let psi = f64::from(i) * TAU / 36.0;
                for [x, y] in curve(&game, psi, level) {
                    let v = game.value([x, y, psi]);
                    assert!((v - level).abs() < 2e-3, "V({x}, {y}, {psi}) = {v}, not {level}");
                }
            }
        }
    }

    #[test]
    fn the_tip_is_not_cut_off() {
        let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        let reach = curve(&game, PI, 0.0).iter().map(|p| hypot(p[0], p[1])).fold(0.0, f64::max);
        assert!((reach - 13.021).abs() < 5e-3, "{reach}");
    }
}
