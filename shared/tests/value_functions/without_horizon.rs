//! Games without a horizon, on a polar grid, compared with the closed form and an independent
//! solution.

use super::{
    errors_near_zero, game, paper, paper_polar, polar_of, quantile, refused, rows, solved, states,
    unequal, unequal_polar,
};
use core::ops::ControlFlow;
use sidestep::math::hypot;
use sidestep::reachability::polar;
use sidestep::reachability::{Accuracy, Method, Options, ValueFunction};

#[test]
fn polar_is_within_two_centimetres_of_the_closed_form() {
    let reference = rows(include_str!("../data/states_paper.csv"));
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
    // *mitchell* has a turning radius of 5 m and R = 5 m. These lengths are 5/4 and 5/3 of the
    // lengths of *paper*.
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
        // All lengths are multiplied by `scale`. Times and turn rates are unchanged.
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
        // Radii with other binary digits round differently, so the solve can stop one window of
        // sweeps earlier or later. A draft stops at a drift of 1.2 mm.
        assert!(quantile(&mut found, 0.99) < 3e-3, "{scale}: {}", quantile(&mut found, 0.99));
        assert!(quantile(&mut found, 1.0) < 0.05, "{scale}: {}", quantile(&mut found, 1.0));
        assert!(quantile(&mut sent, 0.99) < 4e-3, "{scale}: {}", quantile(&mut sent, 0.99));
        if [64.0, f64::from(1 << 30)].contains(&scale) {
            assert_eq!(quantile(&mut found, 1.0), 0.0, "powers of two change no bit");
            assert_eq!(other.steps, life_size.steps);
        }
    }
    // Scale the time: multiply all turn rates and speeds by 8.
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
    // Values of cells on a kink oscillate by centimetres, with different phases in the two solves.
    let p99 = quantile(&mut differences, 0.99);
    assert!(p99 < 5e-3, "{p99}");
}

#[test]
fn converged_value_is_below_that_of_any_horizon_and_near_it() {
    let reference = rows(include_str!("../data/states_unequal.csv"));
    let mut differences = Vec::new();
    for row in &reference {
        let value = unequal_polar().function.value([row[0], row[1], row[2]]);
        assert!(value <= row[3] + row[4] + 0.05, "{value} above {row:?}");
        differences.push((value - row[3]).abs());
    }
    // Most encounters end within the reference's horizon of 6 s.
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
fn the_same_game_has_the_same_bytes_on_every_machine() {
    // SIMD lanes, threads and platform change no bit. A change of the solver changes this ID.
    let function = &unequal_polar().function;
    assert_eq!(function.id(), UNEQUAL_ID);
}

const UNEQUAL_ID: &str = "ae16febc8395fd0e777401a005b1926f0dd079fb2cd6e94e3a385492c5c9a1f6";
