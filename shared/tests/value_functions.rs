//! Value functions of solved games: against the closed form, against independent
//! solutions of unequal games, and as the rest of the program uses them.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use core::ops::ControlFlow;
use sidestep::math::{PI, SeededRng, TAU, atan2, hypot, sin_cos};
use sidestep::reach::polygon::signed_area;
use sidestep::reachability::polar;
use sidestep::reachability::{
    Accuracy, CartesianGrid, CurveSettings, Method, Nodes, Options, Precision, PursuitGame,
    SampledValue, Scheme, SolveError, Solved, ValueFunction, solve,
};
use sidestep::vehicle::VehicleModel;
use std::sync::OnceLock;

fn game(evader: [f64; 2], pursuer: [f64; 2], radius_m: f64) -> PursuitGame {
    let vehicle =
        |[speed_mps, turn_rate_radps]: [f64; 2]| VehicleModel { speed_mps, turn_rate_radps };
    PursuitGame { evader: vehicle(evader), pursuer: vehicle(pursuer), radius_m }
}

fn paper() -> PursuitGame {
    game([2.0, 0.5], [2.0, 0.5], 3.0)
}

/// The unequal pair of the reference.
fn unequal() -> PursuitGame {
    game([2.0, 0.5], [1.5, 0.8], 3.0)
}

fn solved(game: PursuitGame, options: &Options) -> Solved {
    solve(game, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn polar_of(game: PursuitGame) -> Solved {
    solved(game, &Options::default().with_method(Method::Polar))
}

fn paper_polar() -> &'static Solved {
    static SOLVED: OnceLock<Solved> = OnceLock::new();
    SOLVED.get_or_init(|| polar_of(paper()))
}

fn unequal_polar() -> &'static Solved {
    static SOLVED: OnceLock<Solved> = OnceLock::new();
    SOLVED.get_or_init(|| polar_of(unequal()))
}

fn rows(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

fn states(seed: u64, count: usize, range_m: f64) -> Vec<[f64; 3]> {
    let mut rng = SeededRng::new(seed);
    (0..count)
        .map(|_| {
            let (r, bearing) = (range_m * rng.unit(), rng.uniform(-PI, PI));
            let (sin, cos) = sin_cos(bearing);
            [r * cos, r * sin, rng.uniform(-PI, PI)]
        })
        .collect()
}

/// Errors of a solution near V = 0 of the closed form: (p99, largest, how many).
fn errors_near_zero(solved: &Solved, states: &[[f64; 3]]) -> (f64, f64, usize) {
    let exact = solved.function.game().exact().unwrap();
    let mut errors: Vec<f64> = states
        .iter()
        .map(|state| (exact.value(*state), solved.function.value(*state)))
        .filter(|(exact, _)| exact.abs() < 0.5)
        .map(|(exact, value)| (value - exact).abs())
        .collect();
    (quantile(&mut errors, 0.99), quantile(&mut errors, 1.0), errors.len())
}

#[test]
fn polar_is_within_two_centimetres_of_the_closed_form() {
    let reference = rows(include_str!("data/states_paper.csv"));
    let listed: Vec<_> = reference.iter().map(|row| [row[0], row[1], row[2]]).collect();
    for states in [listed, states(1, 200_000, 20.0)] {
        let (p99, worst, count) = errors_near_zero(paper_polar(), &states);
        eprintln!("|V| < 0.5 at {count} states: p99 {p99:.4}, largest {worst:.4} m");
        assert!(count > 50, "{count}");
        assert!(p99 <= 0.02, "{p99}");
        assert!(worst <= 0.12, "{worst}");
    }
    let volume = paper_polar().samples.volume();
    eprintln!("volume {volume}");
    assert!((volume / 358.14141 - 1.0).abs() < 3e-3, "{volume}");
}

#[test]
fn polar_scales_with_the_game() {
    // *mitchell* has a turning radius of 5 m and R = 5 m: lengths 5/3 and 5/4 of *paper*.
    let mitchell = polar_of(game([5.0, 1.0], [5.0, 1.0], 5.0));
    let (p99, worst, count) = errors_near_zero(&mitchell, &states(2, 100_000, 25.0));
    eprintln!("mitchell: {count} states: p99 {p99:.4}, largest {worst:.4} m");
    assert!(count > 1000 && p99 <= 0.03, "{p99}");
}

#[test]
fn small_and_large_vehicles_are_solved_alike() {
    let draft = Options::default().with_method(Method::Polar).with_accuracy(Accuracy::Draft);
    let life_size = solved(paper(), &draft);
    for scale in [1e-6, 0.1, 64.0, 1e9, f64::from(1 << 30)] {
        // All lengths times `scale`; times and turn rates as they were.
        let other = solved(game([2.0 * scale, 0.5], [2.0 * scale, 0.5], 3.0 * scale), &draft);
        assert_eq!(other.converged, Some(true), "{scale}");
        let again = ValueFunction::decode(&other.function.encode()).unwrap();
        let (mut found, mut sent) = (Vec::new(), Vec::new());
        for [x, y, psi] in states(9, 2000, 40.0) {
            let expected = life_size.function.value([x, y, psi]);
            let there = [x * scale, y * scale, psi];
            found.push((other.function.value(there) / scale - expected).abs());
            sent.push((again.value(there) / scale - expected).abs());
        }
        // Radii of other binary digits round otherwise and may stop a window of sweeps
        // sooner or later: the drift that a draft stops at is 1.2 mm.
        assert!(quantile(&mut found, 0.99) < 3e-3, "{scale}: {}", quantile(&mut found, 0.99));
        assert!(quantile(&mut found, 1.0) < 0.05, "{scale}: {}", quantile(&mut found, 1.0));
        assert!(quantile(&mut sent, 0.99) < 4e-3, "{scale}: {}", quantile(&mut sent, 0.99));
        if [64.0, f64::from(1 << 30)].contains(&scale) {
            assert_eq!(quantile(&mut found, 1.0), 0.0, "powers of two change no bit");
            assert_eq!(other.steps, life_size.steps);
        }
    }
    // Times: all rates and speeds times 8.
    let faster = solved(game([16.0, 4.0], [16.0, 4.0], 3.0), &draft);
    let same = life_size.samples.deficit().zip(faster.samples.deficit()).all(|(a, b)| a == b);
    assert!(same, "powers of two change no bit");
}

#[test]
fn a_pursuer_that_turns_faster_reaches_more_or_is_refused() {
    let draft = Options::default().with_accuracy(Accuracy::Draft);
    let mut last = 0.0;
    for rate in [1.0, 4.0, 10.0, 20.0] {
        let solved = solved(game([2.0, 0.5], [1.5, rate], 3.0), &draft);
        let volume = solved.samples.volume();
        assert!(solved.converged == Some(false) || volume > last, "{rate}: {volume} after {last}");
        last = volume;
    }
    for rate in [1e3, 1e9] {
        let complaint = refused(game([2.0, 0.5], [1.5, rate], 3.0), &draft);
        assert!(complaint.starts_with("turn_rate_radps"), "{complaint}");
    }
    let complaint = refused(game([1e-60, 0.5], [1.5, 0.5], 3.0), &draft);
    assert!(complaint.starts_with("evader"), "{complaint}");
    let huge = solved(game([1e39, 0.5e39], [2e39, 0.5e39], 3.0), &draft);
    assert!(huge.samples.volume() > 1e4, "a faster pursuer wins nearly everywhere");
}

/// The complaint names a radius, and a method, that are accepted.
#[test]
fn a_radius_that_the_polar_grid_cannot_follow_is_refused_with_a_way_out() {
    let wide = game([2.0, 0.5], [1.5, 0.8], 300.0);
    let complaint = refused(wide, &Options::default());
    assert!(complaint.starts_with("turn_rate_radps: expected turn rates that"), "{complaint}");
    let (_, most_m) = complaint.split_once("a radius of at most ").unwrap();
    let (most_m, other) = most_m.split_once(" m, or method ").unwrap();
    assert!(other.starts_with("cartesian)"), "{complaint}");
    let radius_m = most_m.parse::<f64>().unwrap() - 1e-3;
    let cartesian = Options::default().with_method(Method::Cartesian);
    for (game, options) in
        [(PursuitGame { radius_m, ..wide }, Options::default()), (wide, cartesian)]
    {
        let begun = solve(game, &options, &mut |_| ControlFlow::Break(()));
        assert_eq!(begun.unwrap_err(), SolveError::Cancelled);
    }
}

/// Fewer sweeps than drift is measured over: an infinite drift would be lost in JSON.
#[test]
fn a_solve_of_few_sweeps_stays_marked_in_its_bytes() {
    let few = |most_sweeps| {
        let settings = polar::Settings::default()
            .with_range_nodes(33)
            .with_angle_nodes(48)
            .with_most_sweeps(most_sweeps);
        polar::solve::<f32>(&unequal(), &settings, &mut |_| ControlFlow::Continue(()))
    };
    for most_sweeps in [1, 5, polar::WINDOW - 1, polar::WINDOW] {
        let solution = few(most_sweeps).unwrap();
        assert!(!solution.converged && solution.drift_m.is_finite(), "{most_sweeps} sweeps");
        let sampled = SampledValue::from_polar(unequal(), &solution).unwrap();
        let function = ValueFunction::Sampled(sampled.into());
        let again = ValueFunction::decode(&function.encode()).unwrap();
        assert_eq!(again.unsettled_m(), Some(solution.drift_m), "{most_sweeps} sweeps");
    }
    let SolveError::Invalid(complaint) = few(0).unwrap_err() else { panic!("not cancelled") };
    assert_eq!(complaint.to_string(), "most_sweeps: expected at least 1, found 0");
    let endless = SampledValue::clone(&unequal_polar().samples).unsettled(Some(f64::INFINITY));
    let again = ValueFunction::decode(&ValueFunction::Sampled(endless.into()).encode()).unwrap();
    assert_eq!(again.unsettled_m(), Some(f64::MAX));
}

#[test]
fn what_is_no_state_has_no_value() {
    for f in [&paper_polar().function, &ValueFunction::Exact(paper().exact().unwrap())] {
        for psi in [f64::NAN, f64::INFINITY] {
            assert!(f.value([5.0, 5.0, psi]).is_nan());
            let refused = f.level_curves(psi, 0.0, CurveSettings::default()).unwrap_err();
            assert_eq!(refused.field, "psi");
        }
        assert!(f.value([f64::NAN, 5.0, 1.0]).is_nan());
        for level in [f64::NAN, f64::INFINITY, -3.0, -9.0] {
            let mut curves = vec![vec![[1.0, 2.0]]];
            let settings = CurveSettings::default();
            let refused = f.level_curves_into(1.0, level, settings, &mut curves).unwrap_err();
            assert_eq!((refused.field.as_str(), curves.len()), ("level", 0));
        }
        let spacing_m = f64::NAN;
        let settings = CurveSettings::default().with_spacing(spacing_m);
        assert_eq!(f.level_curves(1.0, 0.0, settings).unwrap_err().field, "spacing_m");
    }
}

#[test]
fn a_batch_gives_the_same_bits() {
    for f in [&paper_polar().function, &ValueFunction::Exact(paper().exact().unwrap())] {
        // Three parts of a batch, the last one not full.
        let mut states = states(12, 10_000, 30.0);
        let mut values = vec![0.0; states.len()];
        f.values_into(&states, &mut values).unwrap();
        for (state, value) in states.iter().zip(&values) {
            assert_eq!(value.to_bits(), f.value(*state).to_bits(), "{state:?}");
        }
        states[9000][2] = f64::INFINITY;
        let mut untouched = vec![7.0; states.len()];
        let refused = f.values_into(&states, &mut untouched).unwrap_err();
        assert_eq!(refused.to_string(), "states[9000].psi: expected a finite number, found inf");
        let refused = f.values_into(&states[..9000], &mut untouched).unwrap_err();
        assert_eq!(refused.to_string(), "out: expected 9000 entries, found 10000 entries");
        assert_eq!(untouched, vec![7.0; states.len()]);
    }
}

#[test]
fn finer_grids_are_better() {
    let p99 = |accuracy| {
        let options = Options::default().with_method(Method::Polar).with_accuracy(accuracy);
        errors_near_zero(&solved(paper(), &options), &states(3, 100_000, 20.0)).0
    };
    let (draft, standard) = (p99(Accuracy::Draft), p99(Accuracy::Standard));
    eprintln!("p99: draft {draft:.4}, standard {standard:.4}");
    assert!(draft > 1.5 * standard && draft < 0.2, "{draft} {standard}");
}

#[test]
fn single_and_double_precision_agree() {
    let settings = polar::Settings::default().with_range_nodes(33).with_angle_nodes(48);
    let mut go = |_| ControlFlow::Continue(());
    let single = polar::solve::<f32>(&unequal(), &settings, &mut go).unwrap();
    let double = polar::solve::<f64>(&unequal(), &settings, &mut go).unwrap();
    let differences = single.deficit.iter().zip(&double.deficit);
    let mut differences: Vec<f64> = differences.map(|(a, b)| (f64::from(*a) - b).abs()).collect();
    // Cells on a kink flicker by centimetres, and not in step.
    let p99 = quantile(&mut differences, 0.99);
    assert!(p99 < 5e-3, "{p99}");
}

#[test]
fn unequal_pair_agrees_with_an_independent_solution() {
    let grid = CartesianGrid::new([81, 81, 60], [-20.0, 20.0, -20.0, 20.0]);
    let options = Options::default().with_horizon(6.0).with_grid(grid);
    let ours = solved(unequal(), &options);
    assert_eq!(ours.method, Method::Cartesian);
    // The estimates, from two grids, say little on the kinks themselves.
    let (count, within, worst) = compared(&ours);
    assert!(count == 2000 && within >= 0.99, "{count} {within}");
    assert!(worst <= 0.08, "{worst}");
}

#[test]
fn a_polar_grid_of_a_finite_horizon_agrees_with_an_independent_solution() {
    let ours = solved(unequal(), &Options::default().with_horizon(6.0));
    assert_eq!((ours.method, ours.converged), (Method::Polar, None));
    // On kinks the reference's estimates are too small: docs/validation/reachability.md.
    let (count, within, worst) = compared(&ours);
    assert!(count > 1500 && within >= 0.975, "{count} {within}");
    assert!(worst <= 0.15, "{worst}");
}

/// Vehicles that do not turn: the smallest distance of two points on straight lines, in time.
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

/// Long enough, a finite horizon gives the converged value, here of the closed form.
#[test]
fn a_long_horizon_gives_the_closed_form() {
    let options = Options::default().with_horizon(TAU).with_range(21.0);
    let (p99, worst, count) =
        errors_near_zero(&solved(paper(), &options), &states(2, 100_000, 15.0));
    eprintln!("{count} states: p99 {p99:.4}, largest {worst:.4} m");
    assert!(count > 1000 && p99 <= 0.01, "{p99}");
    assert!(worst <= 0.08, "{worst}");
}

/// −R ≤ V ≤ r − R, also between the nodes of a grid and on kinks, and far away V is the distance of the danger zone.
#[test]
fn values_are_from_minus_the_radius_to_the_distance_of_the_danger_zone() {
    let options = Options::default().with_accuracy(Accuracy::Draft);
    let ours = solved(unequal(), &options.with_horizon(6.0));
    let kinked = solved(game([1.0, 3.0], [5.0, 0.1], 1.0), &options);
    let radius_m = unequal().radius_m;
    let mut least = f64::INFINITY;
    for state in states(3, 200_000, 8.0) {
        let range_m = hypot(state[0], state[1]);
        let value = ours.function.value(state);
        assert!(value <= range_m - radius_m, "{state:?}: {value}");
        assert!(kinked.function.value(state) <= range_m - 1.0, "{state:?}");
        least = least.min(value);
    }
    assert!(-radius_m <= least && least < -0.99 * radius_m, "{least}");
    for far_m in [1e6, 1e155, 1e300] {
        let state = ours.function.state([-far_m, far_m, 1.0]);
        assert_eq!(state.value, hypot(far_m, far_m) - radius_m);
        assert!(!state.inside && state.gradient.iter().all(|slope| slope.is_finite()), "{state:?}");
    }
}

#[test]
fn a_horizon_that_no_solve_gets_to_the_end_of_is_refused() {
    let complaint = refused(unequal(), &Options::default().with_horizon(1e300));
    assert!(complaint.starts_with("horizon_s: expected at most "), "{complaint}");
    assert!(complaint.ends_with(" s, 1e8 time steps of this grid, found 1e300"), "{complaint}");
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

/// How many of the independent solution's states are on the grid, the share of these that are within their
/// own error estimates, and the largest difference, m.
fn compared(solved: &Solved) -> (usize, f64, f64) {
    let (mut count, mut within, mut worst) = (0, 0_usize, 0.0_f64);
    for row in &rows(include_str!("data/states_unequal.csv")) {
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

#[test]
fn converged_value_is_below_that_of_any_horizon_and_near_it() {
    let reference = rows(include_str!("data/states_unequal.csv"));
    let mut differences = Vec::new();
    for row in &reference {
        let value = unequal_polar().function.value([row[0], row[1], row[2]]);
        assert!(value <= row[3] + row[4] + 0.05, "{value} above {row:?}");
        differences.push((value - row[3]).abs());
    }
    // Most of the game is over after the 6 s of the reference.
    assert!(quantile(&mut differences, 0.9) <= 0.012);
}

#[test]
fn methods_choose_themselves_and_agree() {
    assert_eq!(Method::choose(&paper(), f64::INFINITY), Method::Exact);
    assert_eq!(Method::choose(&unequal(), f64::INFINITY), Method::Polar);
    assert_eq!(Method::choose(&paper(), 2.0), Method::Polar);
    let exact = solved(paper(), &Options::default());
    assert_eq!((exact.method, exact.steps), (Method::Exact, 0));
    assert!(matches!(exact.function, ValueFunction::Exact(_)));
    assert!((exact.samples.volume() / 358.14141 - 1.0).abs() < 1e-3);
}

#[test]
fn gradients_are_those_of_the_value() {
    for solved in [paper_polar(), unequal_polar()] {
        let f = &solved.function;
        let mut off = Vec::new();
        for state in states(4, 4000, 30.0) {
            let gradient = f.state(state).gradient;
            for d in 0..3 {
                let step = |h: f64| {
                    let mut moved = state;
                    moved[d] += h;
                    f.value(moved)
                };
                // The table is of single precision.
                let slope = (step(2e-3) - step(-2e-3)) / 4e-3;
                off.push((slope - gradient[d]).abs() / (1.0 + slope.abs()));
            }
        }
        // The rest crosses a face or a kink within the step.
        let p95 = quantile(&mut off, 0.95);
        assert!(p95 < 5e-3, "{p95}");
    }
}

#[test]
fn turns_are_those_of_the_closed_form() {
    let exact = paper().exact().unwrap();
    let (mut same, mut all) = (0, 0);
    for state in states(5, 20_000, 25.0) {
        let truth = exact.analyze(state);
        let closing = truth.value < hypot(state[0], state[1]) - 3.0 - 0.3;
        if closing && !truth.on_kink && truth.pursuer_turn != 0.0 {
            let found = paper_polar().function.state(state);
            all += 1;
            same += usize::from(
                found.evader_turn == truth.evader_turn
                    && (found.pursuer_turn == truth.pursuer_turn || truth.gradient[2].abs() < 0.2),
            );
        }
    }
    eprintln!("{same} of {all} states with the optimal turns");
    assert!(all > 1000 && same as f64 > 0.97 * all as f64, "{same} of {all}");
}

#[test]
fn symmetric_and_periodic() {
    let f = &unequal_polar().function;
    for [x, y, psi] in states(6, 2000, 50.0) {
        let value = f.value([x, y, psi]);
        assert!((value - f.value([x, -y, -psi])).abs() < 1e-5);
        assert!((value - f.value([x, y, psi + 3.0 * TAU])).abs() < 1e-5);
        assert!(value <= hypot(x, y) - 3.0 + 1e-4, "never above the present range");
        // Across the seams of bearing and heading.
        assert!((f.value([x, 1e-9, psi]) - f.value([x, -1e-9, psi])).abs() < 1e-5);
        assert!((f.value([x, y, 1e-9]) - f.value([x, y, -1e-9])).abs() < 1e-5);
    }
}

#[test]
fn beyond_the_grid_the_deficit_is_that_of_its_edge() {
    let f = &unequal_polar().function;
    let Nodes::Polar { range_m, .. } = unequal_polar().samples.nodes() else { panic!("polar") };
    for [x, y, psi] in states(7, 500, 1.0) {
        let r = hypot(x, y);
        let at = |range: f64| f.state([x / r * range, y / r * range, psi]);
        let edge = at(range_m - 1e-9);
        let far = at(3.0 * range_m);
        assert!(edge.inside && !far.inside);
        assert!((far.value - 2.0 * range_m - edge.value).abs() < 1e-3, "{edge:?} {far:?}");
        let radial = far.gradient[0] * x / r + far.gradient[1] * y / r;
        assert!((radial - 1.0).abs() < 1e-9);
    }
    // Cartesian: of the nearest point of the box.
    let grid =
        CartesianGrid::new([21, 21, 16], [-10.0, 10.0, -10.0, 10.0]).with_scheme(Scheme::Eno2);
    let options = Options::default().with_horizon(1.0).with_grid(grid);
    let f = solved(unequal(), &options).function;
    let (edge, far) = (f.state([10.0, 2.0, 1.0]), f.state([25.0, 2.0, 1.0]));
    assert!(edge.inside && !far.inside);
    let grown = hypot(25.0, 2.0) - hypot(10.0, 2.0);
    assert!((far.value - edge.value - grown).abs() < 1e-5);
}

#[test]
fn level_curves_lie_on_the_level_and_close() {
    let settings = CurveSettings::default();
    for solved in [paper_polar(), unequal_polar()] {
        for step in 0..24 {
            let psi = f64::from(step) * TAU / 24.0 + 0.03;
            for level in [0.0, 1.0] {
                let curves = solved.function.level_curves(psi, level, settings).unwrap();
                assert_eq!(curves.len(), 1, "psi {psi}");
                let mut off = Vec::new();
                for (a, b) in curves[0].iter().zip(curves[0].iter().cycle().skip(1)) {
                    off.push((solved.function.value([a[0], a[1], psi]) - level).abs());
                    assert!(hypot(b[0] - a[0], b[1] - a[1]) < 0.9, "a gap at {a:?}");
                }
                assert!(quantile(&mut off, 0.9) < 2e-3, "{}", quantile(&mut off, 0.9));
                assert!(quantile(&mut off, 1.0) < 0.05, "{}", quantile(&mut off, 1.0));
                if solved.function.game().identical() {
                    let exact = ValueFunction::Exact(paper().exact().unwrap());
                    let truth = signed_area(&exact.level_curves(psi, level, settings).unwrap()[0]);
                    let found = signed_area(&curves[0]);
                    assert!((found / truth - 1.0).abs() < 0.01, "psi {psi}: {found} {truth}");
                }
            }
        }
    }
}

#[test]
fn a_set_that_leaves_the_grid_closes_along_its_edge() {
    // Every state is lost to a pursuer that is twice as fast and as nimble.
    let options = Options::default().with_range(6.0);
    let solved = solved(game([1.0, 0.5], [2.0, 1.0], 3.0), &options);
    let curves = solved.function.level_curves(0.4, 0.0, CurveSettings::default()).unwrap();
    let reach = curves.iter().flatten().map(|p| hypot(p[0], p[1])).fold(0.0, f64::max);
    assert!((reach - 6.0).abs() < 1e-6, "{reach}");
    let widest = curves.iter().map(|curve| signed_area(curve)).fold(0.0, f64::max);
    assert!(widest > 0.95 * PI * 36.0, "{widest}");
}

#[test]
fn transport_is_small_and_close() {
    for solved in [paper_polar(), unequal_polar()] {
        let f = ValueFunction::Sampled(solved.samples.clone());
        let bytes = f.encode();
        let again = ValueFunction::decode(&bytes).unwrap();
        assert_eq!(again.id(), f.id(), "the same bytes again");
        let off = states(8, 50_000, 45.0)
            .into_iter()
            .map(|state| (again.value(state) - f.value(state)).abs())
            .fold(0.0, f64::max);
        eprintln!("{} bytes, largest error {off:.5} m", bytes.len());
        assert!(off <= 2e-3, "{off}");
        // What is sent is compressed besides.
        assert!(bytes.len() <= 1_500_000, "{}", bytes.len());
    }
}

#[test]
fn the_same_game_has_the_same_bytes_on_every_machine() {
    // Lanes, threads and platform change no bit; a change of the solver changes this.
    let function = &unequal_polar().function;
    assert_eq!(function.id(), UNEQUAL_ID);
}

const UNEQUAL_ID: &str = "ae16febc8395fd0e777401a005b1926f0dd079fb2cd6e94e3a385492c5c9a1f6";

#[test]
fn any_solve_can_be_stopped() {
    for options in [
        Options::default().with_method(Method::Polar),
        Options::default().with_method(Method::Cartesian).with_horizon(1.0),
        Options::default().with_horizon(1.0),
    ] {
        let mut calls = 0;
        let mut last = 0.0;
        let answer = solve(paper(), &options, &mut |progress| {
            calls += 1;
            assert!(progress.done >= last && progress.done <= 1.0);
            last = progress.done;
            if calls == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(answer.unwrap_err(), SolveError::Cancelled);
        assert_eq!(calls, 5);
    }
}

fn refused(game: PursuitGame, options: &Options) -> String {
    match solve(game, options, &mut |_| ControlFlow::Continue(())) {
        Err(SolveError::Invalid(complaint)) => complaint.to_string(),
        Err(other) => other.to_string(),
        Ok(_) => "solved".into(),
    }
}

#[test]
fn bad_requests_are_refused_by_name() {
    let options = Options::default();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let cases = [
            (game([bad, 0.5], [1.5, 0.8], 3.0), "evader.speed_mps"),
            (game([2.0, bad], [1.5, 0.8], 3.0), "evader.turn_rate_radps"),
            (game([2.0, 0.5], [bad, 0.8], 3.0), "pursuer.speed_mps"),
            (game([2.0, 0.5], [1.5, bad], 3.0), "pursuer.turn_rate_radps"),
            (game([2.0, 0.5], [1.5, 0.8], bad), "radius_m"),
        ];
        for (game, field) in cases {
            let complaint = refused(game, &options);
            assert!(complaint.starts_with(field), "{complaint}");
        }
    }
    for horizon_s in [0.0, -2.0, f64::NAN] {
        assert!(refused(paper(), &options.with_horizon(horizon_s)).starts_with("horizon_s"));
    }
    let timed = options.with_method(Method::Exact).with_horizon(2.0);
    assert!(refused(paper(), &timed).starts_with("horizon_s"));
    let exact = options.with_method(Method::Exact);
    assert!(refused(unequal(), &exact).starts_with("method"));
    assert!(refused(paper(), &options.with_threads(0)).starts_with("threads"));
    let near = options.with_method(Method::Polar).with_range(2.0);
    assert!(refused(paper(), &near).starts_with("range_m"));
    let huge = CartesianGrid::new([100_000, 100_000, 100_000], [-1.0, 1.0, -1.0, 1.0])
        .with_scheme(Scheme::Eno2)
        .with_precision(Precision::F64);
    for method in [Method::Cartesian, Method::Exact] {
        let options = options.with_method(method).with_grid(huge);
        let complaint = refused(paper(), &options);
        assert!(complaint.contains("memory") || complaint.contains("65536"), "{complaint}");
    }
    let small = CartesianGrid::new([3, 51, 50], huge.domain_m).with_precision(Precision::F64);
    let options = options.with_grid(small).with_horizon(1.0);
    assert!(refused(paper(), &options).starts_with("axes[0].nodes"));
}

#[test]
fn bad_tables_are_refused_by_name() {
    let nodes = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 9, angle_nodes: 12 };
    let good = vec![0.0_f32; nodes.count()];
    let new = |nodes, horizon, deficit: &[f32]| {
        SampledValue::new(unequal(), nodes, horizon, deficit, None).map(|_| ())
    };
    assert!(new(nodes, 1.0, &good).is_ok());
    assert_eq!(new(nodes, 0.0, &good).unwrap_err().field, "horizon_s");
    assert_eq!(new(nodes, 1.0, &good[1..]).unwrap_err().field, "value");
    let mut bad = good.clone();
    bad[17] = f32::NAN;
    assert_eq!(new(nodes, 1.0, &bad).unwrap_err().field, "value[17]");
    let odd = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 9, angle_nodes: 13 };
    assert_eq!(new(odd, 1.0, &good).unwrap_err().field, "angle_nodes");
    let sheet = SampledValue::new(unequal(), nodes, 1.0, &good, Some(&good)).unwrap_err();
    assert_eq!(sheet.field, "sheet");
}

#[test]
fn a_bearing_is_continuous_around_the_evader() {
    // The table's own arc tangent must not leave a step anywhere.
    let f = &paper_polar().function;
    let mut last = None;
    for step in 0..=20_000 {
        let angle = f64::from(step) * TAU / 20_000.0;
        let (sin, cos) = sin_cos(angle);
        let (x, y) = (10.0 * cos, 10.0 * sin);
        assert!((atan2(y, x) - angle).abs() < 1e-9 || angle > PI - 1e-9);
        let value = f.value([x, y, 2.0]);
        if let Some(last) = last {
            let jump: f64 = value - last;
            assert!(jump.abs() < 0.03, "{jump} at {angle}");
        }
        last = Some(value);
    }
}

/// Mitchell, Bayen and Tomlin (2005).
fn mitchell() -> PursuitGame {
    game([5.0, 1.0], [5.0, 1.0], 5.0)
}

/// The volume is that of the interpolated function, on coarse nodes too: sums along one axis had
/// 0.2 % too much there.
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

/// A finite horizon within which optimal play ends has the closed form's value. The domain just
/// holds what matters, and a finer grid is better.
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
