//! Large and small numbers within one problem.

use super::*;
use sidestep::reachability::DubinsCar;

const CAR: DubinsCar = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
const SECONDS: f64 = 3.0;
/// The obstacle: a disc of this radius, m, about (1.3, 0). The car drives to the origin.
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

/// How much larger, in cells, an obstacle may look whose edge is a jump of V.
const CELLS: f64 = 3.0;

/// Whatever height stands for an obstacle, the tube is between those of the obstacle as a distance and of one that is
/// larger by some cells: a jump of V is as wide as that. An obstacle that is larger only takes from the tube.
///
/// A wall that is higher than 1/ε rounds distances beside it away (V of a metre is lost in 10⁹ m of 24 bits), and the
/// next cells with them: then only the share of other signs is bounded, and nothing is said of walls a thousand times
/// as high. WENO5 does so from 10¹² on in any numbers: it adds 10⁻⁶ of the largest square of a slope to each measure of
/// smoothness, so the weight of a stencil across the wall falls to 10⁻¹² and no further.
fn check_heights<T: Real>(scheme: Scheme, epsilon: f64) {
    let too_high =
        if scheme == Scheme::Weno5 { epsilon.recip().min(1e12) } else { epsilon.recip() };
    let grid = Grid { axes: axes() };
    let cell = grid.axes[0].spacing();
    let distance = tube::<T>(&target, &|state| depth(state, 0.0), scheme);
    let larger = tube::<T>(&target, &|state| depth(state, CELLS * cell), scheme);
    let least = (0..grid.len()).map(|at| target(grid.node(grid.index(at)))).fold(1.0, f64::min);
    for exponent in [-9, -6, -3, 0, 1, 3, 5, 6, 9, 12] {
        let height: f64 = format!("1e{exponent}").parse().expect("a number");
        if height * epsilon > 1000.0 {
            continue;
        }
        let disc = |state: [f64; 3]| if depth(state, 0.0) < 0.0 { -height } else { height };
        let found = tube::<T>(&target, &disc, scheme);
        let (mut wrong, mut outside) = (0, 0);
        for at in 0..grid.len() {
            let state = grid.node(grid.index(at));
            let [value, low, high] = [&found, &distance, &larger].map(|of| of.values[at].to_f64());
            let bounds = least.max(-disc(state))..=target(state).max(-disc(state));
            let slack = 1e-6 * bounds.end().abs().max(0.5);
            assert!(bounds.start() - slack <= value && value <= bounds.end() + slack, "{state:?}");
            outside += usize::from(value <= 0.0 && low > cell || value > cell && high <= 0.0);
            wrong += usize::from((value <= 0.0) != (low <= 0.0) && depth(state, 0.5) > 0.0);
        }
        let share = wrong as f64 / grid.len() as f64;
        eprintln!("{} {epsilon:.0e} 1e{exponent}: {share:.4} {outside} outside", scheme.name());
        // A low wall is no worse than its height.
        if height >= 1.0 {
            let rounded = height >= too_high;
            assert!(rounded || outside == 0, "{scheme:?} {height}: {outside}");
            assert!(share < if rounded { 0.03 } else { 0.025 }, "{scheme:?} {height}: {share}");
        }
    }
}

#[test]
fn an_obstacle_may_have_any_height() {
    for scheme in SCHEMES {
        check_heights::<f32>(scheme, f32::EPSILON.into());
        check_heights::<f64>(scheme, f64::EPSILON);
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
