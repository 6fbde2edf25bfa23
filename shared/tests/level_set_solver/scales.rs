//! Large and small numbers within one problem.

use super::*;
use sidestep::reachability::DubinsCar;

const CAR: DubinsCar = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
const SECONDS: f64 = 3.0;
/// The obstacle: a disc of this radius, m, about (1, 0). The car drives to the origin.
const RADIUS: f64 = 0.5;
const HALF_SIDE: f64 = 3.0;

fn axes() -> [Axis; 3] {
    let side = Axis::bounded(-HALF_SIDE, HALF_SIDE, 31);
    [side, side, Axis::periodic(0.0, TAU, 20)]
}

fn target([x, y, _]: [f64; 3]) -> f64 {
    hypot(x, y) - 0.45
}

fn depth([x, y, _]: [f64; 3], more: f64) -> f64 {
    hypot(x - 1.3, y) - RADIUS - more
}

fn tube<T: Real>(
    target: &(dyn Fn([f64; 3]) -> f64 + Sync),
    avoid: &(dyn Fn([f64; 3]) -> f64 + Sync),
    scheme: Scheme,
) -> Solution<T, 3> {
    let problem = problem(&CAR, axes(), target, (Kind::Tube, BACKWARD), SECONDS)
        .with_avoid(Region::Static(avoid));
    solved(&problem, &Settings::new(scheme).with_threads(2).with_slices(2))
}

/// Whatever height stands for an obstacle, the tube is between those of the obstacle as a distance and of one that is
/// larger by some cells: a jump of V is as wide as that. An obstacle that is larger only takes from the tube.
fn check_heights<T: Real>(scheme: Scheme) {
    let grid = Grid { axes: axes() };
    let cell = grid.axes[0].spacing();
    let cells = if scheme == Scheme::Upwind { 4.0 } else { 3.0 };
    let distance = tube::<T>(&target, &|state| depth(state, 0.0), scheme);
    let larger = |more: f64| tube::<T>(&target, &|state| depth(state, more * cell), scheme);
    // A step carries a share of a jump into the next cell, and a share of that into the one behind it: the number of cells
    // in which it counts grows with the logarithm of its height.
    let larger = [larger(cells), larger(cells + 1.0)];
    let least = (0..grid.len()).map(|at| target(grid.node(grid.index(at)))).fold(1.0, f64::min);
    for exponent in [-9, -6, -3, 0, 1, 3, 5, 7, 9, 30] {
        let height = if exponent < 0 {
            (0..-exponent).fold(1.0, |height, _| 0.1 * height)
        } else {
            (0..exponent).fold(1.0, |height, _| 10.0 * height)
        };
        let disc = |state: [f64; 3]| if depth(state, 0.0) < 0.0 { -height } else { height };
        let found = tube::<T>(&target, &disc, scheme);
        let (mut wrong, mut outside) = (0, 0);
        for at in 0..grid.len() {
            let state = grid.node(grid.index(at));
            let higher = &larger[usize::from(exponent > 7)];
            let [value, low, high] = [&found, &distance, higher].map(|of| of.values[at].to_f64());
            let bounds = least.max(-disc(state))..=target(state).max(-disc(state));
            let slack = 1e-6 * bounds.end().abs().max(0.5);
            assert!(bounds.start() - slack <= value && value <= bounds.end() + slack, "{state:?}");
            // A low wall of this height is no worse than its height; 10³⁰ counts in more cells than one more.
            if (0..10).contains(&exponent) {
                outside += usize::from(value <= 0.0 && low > cell || value > cell && high <= 0.0);
            }
            wrong += usize::from((value <= 0.0) != (low <= 0.0) && depth(state, 0.5) > 0.0);
        }
        eprintln!("{} 1e{exponent}: {wrong} other signs, {outside} outside", scheme.name());
        assert_eq!(outside, 0, "{scheme:?} 1e{exponent}");
        assert!(exponent < 0 || (wrong as f64) < 0.025 * grid.len() as f64, "{scheme:?}: {wrong}");
    }
}

#[test]
fn an_obstacle_may_have_any_height() {
    for scheme in SCHEMES {
        check_heights::<f32>(scheme);
        check_heights::<f64>(scheme);
    }
}

fn check_equivariance<T: Real>(exponents: [i32; 4]) {
    let distance = |state| depth(state, 0.0);
    for scheme in SCHEMES {
        let once = tube::<T>(&target, &distance, scheme);
        for exponent in exponents {
            let factor = libm::ldexp(1.0, exponent);
            let scaled = tube::<T>(
                &|state| factor * target(state),
                &|state| factor * distance(state),
                scheme,
            );
            let mut pairs = once.values.iter().zip(&scaled.values);
            assert!(
                pairs.all(|(a, b)| factor * a.to_f64() == b.to_f64()),
                "{scheme:?} times 2^{exponent}"
            );
        }
    }
}

/// V(s l, s g) = s V(l, g), to the bit for powers of two.
#[test]
fn units_of_v_do_not_matter() {
    check_equivariance::<f32>([-60, -1, 13, 90]);
    check_equivariance::<f64>([-400, -30, 3, 900]);
}
