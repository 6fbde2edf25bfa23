//! Games with a finite horizon, compared with an independent solution, a formula and the closed
//! form.

use super::{errors_near_zero, game, mitchell, paper, quantile, rows, solved, states, unequal};
use sidestep::math::{SeededRng, TAU, hypot, sin_cos};
use sidestep::reachability::{Accuracy, CartesianGrid, Method, Options, Solved};

#[test]
fn unequal_pair_agrees_with_an_independent_solution() {
    let grid = CartesianGrid::new([81, 81, 60], [-20.0, 20.0, -20.0, 20.0]);
    let options = Options::default().with_horizon(6.0).with_grid(grid);
    let ours = solved(unequal(), &options);
    assert_eq!(ours.method, Method::Cartesian);
    // The reference's error estimates come from two grids. They are unreliable on the kinks
    // themselves.
    let (count, within, worst) = compared(&ours);
    assert!(count == 2000 && within >= 0.99, "{count} {within}");
    assert!(worst <= 0.08, "{worst}");
}

#[test]
fn a_polar_grid_of_a_finite_horizon_agrees_with_an_independent_solution() {
    let ours = solved(unequal(), &Options::default().with_horizon(6.0));
    assert_eq!((ours.method, ours.converged), (Method::Polar, None));
    // On kinks, the reference's estimates are too small (see docs/validation/reachability.md).
    let (count, within, worst) = compared(&ours);
    assert!(count > 1500 && within >= 0.975, "{count} {within}");
    assert!(worst <= 0.15, "{worst}");
}

/// Returns the number of the independent solution's states that are on the grid, the share of them
/// within their own error estimates, and the largest difference (m).
fn compared(solved: &Solved) -> (usize, f64, f64) {
    let (mut count, mut within, mut worst) = (0, 0_usize, 0.0_f64);
    for row in &rows(include_str!("../data/states_unequal.csv")) {
        let found = solved.function.state([row[0], row[1], row[2]]);
        if found.inside {
            let off = (found.value - row[3]).abs();
            count += 1;
            within += usize::from(off <= row[4]);
            worst = worst.max(off);
        }
    }
    let share = within as f64 / count as f64;
    eprintln!("{count} states, {share:.4} within their estimates; largest difference {worst:.4} m");
    (count, share, worst)
}

/// For vehicles that do not turn, the value is the minimum distance over time of two points on
/// straight lines, minus the radius.
#[test]
fn without_turns_the_nearest_approach_is_a_formula() {
    let game = game([2.0, 1e-5], [3.0, 1e-5], 2.5);
    for horizon_s in [0.1, 0.7, 3.0] {
        let options = Options::default().with_horizon(horizon_s).with_range(16.0);
        let ours = solved(game, &options);
        let mut errors = Vec::new();
        for [x, y, psi] in states(17, 20_000, 11.0) {
            let (sin, cos) = sin_cos(psi);
            let velocity = [3.0 * cos - 2.0, 3.0 * sin];
            let closing = -(x * velocity[0] + y * velocity[1]);
            let speed = hypot(velocity[0], velocity[1]);
            let t = (closing / (speed * speed)).clamp(0.0, horizon_s);
            let nearest = hypot(x + t * velocity[0], y + t * velocity[1]) - 2.5;
            errors.push((ours.function.value([x, y, psi]) - nearest).abs());
        }
        let quantiles = [0.5, 0.9, 0.99, 1.0].map(|share| quantile(&mut errors, share));
        eprintln!("{horizon_s} s: {quantiles:.4?} m");
        assert!(quantiles[0] < 1e-3 && quantiles[2] < 0.05, "{quantiles:?}");
    }
}

/// A sufficiently long finite horizon gives the converged value, which is the closed form here.
#[test]
fn a_long_horizon_gives_the_closed_form() {
    let options = Options::default().with_horizon(TAU).with_range(21.0);
    let (p99, worst, count) =
        errors_near_zero(&solved(paper(), &options), &states(2, 100_000, 15.0));
    eprintln!("{count} states: p99 {p99:.4}, largest {worst:.4} m");
    assert!(count > 1000 && p99 <= 0.01, "{p99}");
    assert!(worst <= 0.08, "{worst}");
}

/// A finite horizon that covers optimal play gives the closed form's value. The domain just covers
/// the relevant states, and a finer grid is more accurate.
#[test]
fn a_grid_for_a_finite_horizon_holds_what_matters() {
    let exact = mitchell().exact().unwrap();
    let errors = |accuracy| {
        let options = Options::default().with_horizon(3.2).with_accuracy(accuracy);
        let solved = solved(mitchell(), &options);
        let mut rng = SeededRng::new(41);
        let mut errors = Vec::new();
        while errors.len() < 20_000 {
            let [x, y] = [rng.uniform(-12.0, 25.0), rng.uniform(-20.0, 20.0)];
            let state = [x, y, rng.uniform(0.0, TAU)];
            let truth = exact.value(state);
            if truth.abs() > 1.0 {
                continue;
            }
            let found = solved.function.state(state);
            assert!(found.inside, "{state:?}");
            errors.push((found.value - truth).abs());
        }
        let most = errors.iter().copied().fold(0.0, f64::max);
        let quantiles = [0.5, 0.9, 0.99].map(|share| quantile(&mut errors, share));
        eprintln!(
            "{accuracy:?}: {quantiles:.3?}, at most {most:.3} m, {:?}",
            solved.samples.nodes()
        );
        (quantiles[2], most)
    };
    let (draft, standard) = (errors(Accuracy::Draft), errors(Accuracy::Standard));
    assert!(standard.0 < 0.5 * draft.0 && standard.1 < draft.1, "{draft:?} {standard:?}");
    assert!(standard.0 < 0.02, "{standard:?}");
}

/// The volume is computed from the interpolated function, so it is also accurate on coarse nodes.
/// Sums along one axis were 0.2 % too large on such nodes.
#[test]
fn the_volume_on_coarse_nodes_is_right() {
    let grid = CartesianGrid::new([51, 40, 50], [-6.0, 20.0, -10.0, 10.0]);
    let exact = solved(mitchell(), &Options::default().with_method(Method::Exact).with_grid(grid));
    let options = Options::default().with_horizon(2.8).with_grid(grid);
    let off = |solved: &Solved| 100.0 * (solved.samples.volume() / 885.81943 - 1.0);
    let (exact, weno5) = (off(&exact), off(&solved(mitchell(), &options)));
    eprintln!("volume: closed form {exact:+.3} %, WENO5 {weno5:+.3} %");
    assert!(exact.abs() < 0.06, "{exact} %");
    assert!(weno5.abs() < 0.1, "{weno5} %");
}

#[test]
fn threads_change_no_bit_of_a_finite_horizon() {
    let options = Options::default().with_horizon(2.0).with_accuracy(Accuracy::Draft);
    let of = |threads| solved(unequal(), &options.with_threads(threads));
    let (one, three) = (of(1), of(3));
    assert_eq!((one.threads, three.threads), (1, 3));
    let same =
        one.samples.deficit().zip(three.samples.deficit()).all(|(a, b)| a.to_bits() == b.to_bits());
    assert!(same);
    let sheets = one.samples.sheet().unwrap().zip(three.samples.sheet().unwrap());
    assert!(sheets.into_iter().all(|(a, b)| a.to_bits() == b.to_bits()));
}
