use super::gram::{Entry, entry};
use super::smo::DualSolution;
use super::*;
use crate::math::SeededRng;
use crate::parallel::Kernel as _;

/// Two overlapping clouds, with rows of a third class and some duplicate rows among them.
fn clouds(seed: u64, count: usize, width: usize) -> (Vec<f64>, Vec<i8>) {
    let mut rng = SeededRng::new(seed);
    let (mut rows, mut sides) = (Vec::new(), Vec::new());
    for i in 0..count {
        let side = [1, -1, 0, 1, 1][i % 5];
        let row: Vec<f64> =
            (0..width).map(|_| rng.uniform(-1.5, 1.5) + 0.4 * f64::from(side)).collect();
        for _ in 0..1 + usize::from(i % 11 == 0) {
            rows.extend(&row);
            sides.push(side);
        }
    }
    (rows, sides)
}

/// Measures how far a solution violates the optimality conditions, recomputed from scratch. Returns
/// the greatest gradient among variables that can rise, minus the least gradient among variables
/// that can fall, and |Σ β|.
fn breach<T: Entry>(gram: &Gram<T>, sides: &[i8], solution: &DualSolution, c: f64) -> (f64, f64) {
    let (mut top, mut bottom) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut total = 0.0;
    for (i, &side) in sides.iter().enumerate() {
        let beta = *entry(&solution.beta, i);
        let (lower, upper) = (c * f64::from(side.min(0)), c * f64::from(side.max(0)));
        assert!((lower..=upper).contains(&beta), "{beta}");
        total += beta;
        let sum: f64 = (0..sides.len())
            .map(|j| entry(gram.row(i), j).to_f64() * entry(&solution.beta, j))
            .sum();
        let gradient = f64::from(side) - sum;
        if beta < upper {
            top = top.max(gradient);
        }
        if beta > lower {
            bottom = bottom.min(gradient);
        }
        if lower < beta && beta < upper {
            let inside = solution.intercept - gradient;
            assert!(inside.abs() <= 1e-3, "free rows are on the margin: {inside}");
        }
    }
    (top - bottom, total.abs())
}

fn check_conditions<T: Entry>(tolerance: f64) {
    for (seed, gamma) in [(1, 0.01), (2, 0.1), (3, 1.0), (4, 20.0)] {
        let (rows, sides) = clouds(seed, 300, 4);
        let mut gram = Gram::<T>::empty(false);
        gram.set_data(4, &rows, sides.len());
        gram.set_gamma(gamma);
        let mut dense = Dense::new();
        let mut smo = Smo::new(&mut gram, &sides, 0.1, None, &mut dense);
        let strengths = [0.1, 1.0, 10.0, 100.0, 1000.0];
        let solutions = strengths.map(|c| smo.solve(c, tolerance, 10_000_000).unwrap());
        (0..sides.len()).for_each(|i| gram.want(i));
        for (c, solution) in strengths.into_iter().zip(&solutions) {
            let (gap, total) = breach(&gram, &sides, solution, c);
            assert!(gap <= 1.01 * tolerance, "γ {gamma}, C {c}: {gap}");
            assert!(total <= 1e-10 * c, "γ {gamma}, C {c}: Σ β = {total}");
        }
    }
}

#[test]
fn conditions_of_the_optimum_hold_in_single_precision() {
    check_conditions::<f32>(1e-3);
}

#[test]
fn conditions_of_the_optimum_hold_in_double_precision() {
    check_conditions::<f64>(1e-9);
}

#[test]
fn linear_svms_are_those_of_pairwise_steps() {
    for (seed, width) in [(5, 1), (6, 3), (7, 9)] {
        let (mut rows, sides) = clouds(seed, 120, width);
        // A duplicate feature and a constant feature.
        if width == 9 {
            for row in rows.chunks_mut(width) {
                (row[7], row[8]) = (row[6], 0.0);
            }
        }
        let mut gram = Gram::<f64>::of_products(width, &rows);
        for c in [0.01, 0.1, 1.0, 10.0] {
            let mut dense = Dense::new();
            let solution = Smo::new(&mut gram, &sides, c, None, &mut dense)
                .solve(c, 1e-10, 10_000_000)
                .unwrap();
            let plane = linear::fit(width, &rows, &sides, c).unwrap();
            for i in 0..sides.len() {
                let sum: f64 = (0..sides.len())
                    .map(|j| entry(gram.row(i), j) * entry(&solution.beta, j))
                    .sum();
                let decision = plane.decision(&rows[i * width..(i + 1) * width]);
                let apart = sum + solution.intercept - decision;
                assert!(apart.abs() < 1e-7, "width {width}, C {c}: {apart}");
            }
        }
    }
}

/// Checks the optimality conditions of a linear SVM. `rounding` is the tolerance for w and for
/// Σ y α, in units of 1 + C.
fn check_plane(width: usize, rows: &[f64], sides: &[i8], c: f64, rounding: f64) {
    let plane = linear::fit(width, rows, sides, c).unwrap();
    let mine = (0..sides.len()).filter(|&i| sides[i] != 0);
    let (mut weights, mut total) = (vec![0.0; width], 0.0);
    for (i, &alpha) in mine.zip(&plane.alpha) {
        let (row, side) = (&rows[i * width..(i + 1) * width], f64::from(sides[i]));
        let slack = side * plane.decision(row) - 1.0;
        assert!((-1e-12..=c * (1.0 + 1e-12)).contains(&alpha));
        // Rows with 0 < α < C are on the margin, rows with α = C are inside it, and rows with α = 0
        // are outside it.
        assert!(alpha * slack.max(0.0) < 1e-8 * (1.0 + c), "{alpha} {slack}");
        assert!((c - alpha) * (-slack).max(0.0) < 1e-8 * (1.0 + c), "{alpha} {slack}");
        total += side * alpha;
        for (weight, x) in weights.iter_mut().zip(row) {
            *weight += side * alpha * x;
        }
    }
    assert!(total.abs() < rounding * (1.0 + c), "{total}");
    for (a, b) in weights.iter().zip(&plane.weights) {
        assert!((a - b).abs() < rounding * (1.0 + c), "{a} {b}");
    }
}

#[test]
fn conditions_of_the_optimum_hold_for_linear_svms() {
    for (seed, width) in [(8, 2), (9, 8)] {
        let (rows, sides) = clouds(seed, 400, width);
        for c in [0.01, 1.0, 100.0] {
            check_plane(width, &rows, &sides, c, 1e-9);
        }
    }
}

/// With few rows and nearly dependent features, the iteration with full corrector steps can cycle.
/// It does so in the first three cases.
#[test]
fn linear_svms_do_not_go_in_circles() {
    let check = |seed, count, width, c| {
        let (mut rows, sides) = clouds(seed, count, width);
        for row in rows.chunks_mut(width) {
            (row[0], row[2]) = (row[1] * row[1], row[1] + 0.01 * row[2]);
        }
        // Features that depend on each other up to 1 % cost four digits of accuracy.
        check_plane(width, &rows, &sides, c, 1e-7);
    };
    check(1392, 130, 9, 1.0);
    check(1482, 130, 9, 1.0);
    check(3598, 40, 4, 0.01);
    for seed in 0..1000 {
        for c in [0.01, 0.1, 1.0, 10.0] {
            check(seed, 23, 8, c);
            check(seed, 40, 4, c);
        }
    }
}

/// One to three rows against all others. Each feature distinguishes a single row. Cycling starts
/// far from the central path, outside the default neighbourhood.
#[test]
fn linear_svms_of_a_single_row_are_fitted() {
    for count in [200, 1280, 1878, 1950, 2000, 2500, 2999] {
        for width in [1, 2, 3] {
            let mut rows = vec![0.0; count * width];
            (0..width).for_each(|i| rows[i * width + i] = 1.0);
            let order: Vec<usize> = (0..count).collect();
            let (_, rows) = standardised(width, &rows, &order, &order);
            for turns in 1..=3 {
                let sides: Vec<i8> = (0..count).map(|i| if i < turns { 1 } else { -1 }).collect();
                for c in [0.01, 0.1, 1.0, 10.0] {
                    check_plane(width, &rows, &sides, c, 1e-7);
                }
            }
        }
    }
}

#[test]
fn lanes_change_no_bit() {
    let (rows, sides) = clouds(10, 150, 5);
    let mut wide = Gram::<f32>::empty(true);
    wide.set_data(5, &rows, sides.len());
    let mut narrow = Gram::<f32>::empty(false);
    narrow.set_data(5, &rows, sides.len());
    // The cached distances are reused for the second γ.
    for gamma in [0.7, 0.3] {
        wide.set_gamma(gamma);
        narrow.set_gamma(gamma);
        for i in (0..sides.len()).rev() {
            wide.want(i);
            let mut row = vec![gram::Block::all(0.0); narrow.blocks()];
            narrow.row_into_plainly(i, &mut row);
            for j in 0..sides.len() {
                assert_eq!(entry(wide.row(i), j).to_bits(), entry(&row, j).to_bits());
            }
        }
    }
    let shares: Vec<(usize, f64)> = (0..50).map(|i| (i, 0.1 * i as f64 - 1.0)).collect();
    let zero = vec![gram::Block::all(0.0); wide.blocks()];
    let (mut first, mut second) = (zero.clone(), zero);
    let combine = |sums| gram::Combine { gram: &wide, rows: &shares, first: 0, sums };
    combine(&mut first[..]).run();
    crate::parallel::in_widest_lanes(combine(&mut second[..]));
    let bits =
        |sums: &[gram::Block<f64>]| gram::entries(sums).map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&first), bits(&second));
}

#[test]
fn too_few_steps_are_an_error() {
    let (rows, sides) = clouds(11, 300, 4);
    let labels: Vec<usize> = sides.iter().map(|&side| usize::from(side > 0)).collect();
    let settings =
        SvmSettings { max_steps: 5, ..SvmSettings::new(Kernel::Rbf { gamma: 0.1 }, 100.0) };
    let target = Target { labels: &labels, classes: 2 };
    let sigmoids = vec![Sigmoid { a: -1.0, b: 0.0 }];
    assert_eq!(fit(4, &rows, target, settings, sigmoids).unwrap_err().field, "c");
}

#[test]
fn the_first_of_equal_cells_is_best() {
    let cell = |c: f64, accuracy: &[f64]| GridCell {
        kernel: Kernel::Linear,
        c,
        accuracy: accuracy.to_vec(),
        decisions: vec![],
    };
    // The last three cells have the same numbers, but their sums round differently.
    let cells = [
        cell(1.0, &[0.5, 0.5, 0.5]),
        cell(2.0, &[0.7, 0.1, 0.8]),
        cell(3.0, &[0.8, 0.7, 0.1]),
        cell(4.0, &[0.1, 0.8, 0.7]),
    ];
    assert_eq!(best(&cells).unwrap().c, 2.0);
    assert!(best(&[]).is_none());
}
