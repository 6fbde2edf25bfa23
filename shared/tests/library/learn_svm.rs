//! Support vector machines, compared with scikit-learn on recorded rows and with libsvm-rs on
//! random rows.

use crate::learning::{PEOPLE, WIDTH, apart, classes, peer, person, said};
use libsvm_rs::{KernelType, SvmNode, SvmParameter, SvmProblem, SvmType};
use sidestep::learn::svm::{
    Grid, Kernels, SvmSettings, Target, best, calibrate, cross_validate, fit,
};
use sidestep::math::{SeededRng, ln};
use sidestep::predict::scale::Scale;
use sidestep::predict::svm::{Kernel, Sigmoid, Svm, pair_count, pairs};

/// Sigmoids for tests that do not use the probabilities.
fn plain(classes: usize) -> Vec<Sigmoid> {
    vec![Sigmoid { a: -1.0, b: 0.0 }; pair_count(classes)]
}

#[test]
fn scikit_learns_svms_are_found_again() {
    let both = [1, 2].map(apart::svms);
    assert_eq!(both.iter().map(|apart| apart.rows).sum::<usize>(), 8000);
    let different: usize = both.iter().map(|apart| apart.different).sum();
    assert!(different <= 10, "{different} of 8000 predictions differ");
    for apart in both {
        assert!(apart.decision < 1e-5, "decision values differ by {}", apart.decision);
    }
}

/// scikit-learn computes the probability of each class against the rest, and we couple pairs of
/// classes. For two classes, the probabilities are the same. For three classes, they differ, so
/// only the log losses on test rows are compared.
#[test]
fn probabilities_do_as_well_as_scikit_learns() {
    for experiment in [1, 2] {
        let (mut ours, mut theirs, mut farthest, mut rows) = (0.0, 0.0, 0.0f64, 0.0);
        let classes = classes(experiment);
        for participant in 0..PEOPLE {
            let (training, test) = person(participant, experiment);
            let folds: Vec<usize> = training.places.iter().map(|(trial, _)| trial % 5).collect();
            let target = Target { labels: &training.labels, classes };
            let gamma = peer(participant, experiment).svc.gamma;
            let (scale, svm) = fit_calibrated(&training.values, target, &folds, gamma);
            let expected = said(participant, experiment);
            let rows_of = test.values.chunks(WIDTH).zip(&test.labels).zip(&expected);
            for ((row, &truth), expected) in rows_of {
                let expected = |class: usize| expected[&format!("svc_cal_p{class}")];
                let mut p = vec![0.0; classes];
                svm.probabilities_into(&scale, row, &mut p);
                assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                for (class, p) in p.iter().enumerate() {
                    farthest = farthest.max((p - expected(class)).abs());
                }
                ours -= ln(p[truth]);
                theirs -= ln(expected(truth));
                rows += 1.0;
            }
        }
        assert!(ours / rows < theirs / rows + 1e-3);
        // scikit-learn's SVMs are solved to a tolerance of 10⁻³, on rows that are standardised over
        // all folds together.
        assert!(classes == 3 || farthest < 5e-3, "{farthest}");
    }
}

/// RBF SVMs with C = 1, and sigmoids fitted to held-out rows.
fn fit_calibrated(rows: &[f64], target: Target<'_>, folds: &[usize], gamma: f64) -> (Scale, Svm) {
    let grid = Grid { c: vec![1.0], ..Grid::new(Kernels::Rbf(vec![gamma])) };
    let cells = cross_validate(WIDTH, rows, folds, &[target], &grid).expect("cells");
    let sigmoids = calibrate(target, &cells[0][0].decisions).expect("sigmoids");
    let settings = SvmSettings::new(Kernel::Rbf { gamma }, 1.0);
    fit(WIDTH, rows, target, settings, sigmoids).expect("SVMs")
}

/// Random rows around overlapping centres, with some duplicates.
fn random_rows(seed: u64, count: usize, width: usize, classes: usize) -> (Vec<f64>, Vec<usize>) {
    let mut rng = SeededRng::new(seed);
    let mut values = Vec::new();
    let mut labels = Vec::new();
    for i in 0..count {
        let label = i % classes;
        let row: Vec<f64> = (0..width)
            .map(|j| rng.uniform(-2.0, 2.0) + if j % classes == label { 1.0 } else { 0.0 })
            .collect();
        for _ in 0..1 + usize::from(i % 7 == 0) {
            values.extend(&row);
            labels.push(label);
        }
    }
    (values, labels)
}

#[test]
fn libsvm_finds_the_same_svms() {
    libsvm_rs::set_quiet(true);
    for seed in 0..12 {
        let (width, classes) = (2 + seed as usize % 3, 2 + seed as usize % 3);
        let (values, labels) = random_rows(seed, 70, width, classes);
        let target = Target { labels: &labels, classes };
        for (kernel, c) in [
            (Kernel::Linear, 0.1),
            (Kernel::Linear, 5.0),
            (Kernel::Rbf { gamma: 0.1 }, 100.0),
            (Kernel::Rbf { gamma: 0.5 }, 1.0),
            (Kernel::Rbf { gamma: 5.0 }, 0.1),
        ] {
            let settings = SvmSettings::new(kernel, c).with_tolerance(1e-9);
            let (scale, svm) = fit(width, &values, target, settings, plain(classes)).unwrap();
            let nodes = |row: &[f64]| -> Vec<SvmNode> {
                let value = |(j, &x): (usize, &f64)| SvmNode {
                    index: j as i32 + 1,
                    value: scale.apply(j, x),
                };
                row.iter().enumerate().map(value).collect()
            };
            // libsvm orders pairs by the first occurrence of the labels, which here equals our
            // order.
            let problem = SvmProblem {
                labels: labels.iter().map(|&label| label as f64).collect(),
                instances: values.chunks(width).map(nodes).collect(),
            };
            let (kernel_type, gamma) = match kernel {
                Kernel::Linear => (KernelType::Linear, 1.0),
                Kernel::Rbf { gamma } => (KernelType::Rbf, gamma),
                _ => unreachable!("libsvm is not asked for {kernel:?}"),
            };
            let parameter = SvmParameter {
                svm_type: SvmType::CSvc,
                kernel_type,
                gamma,
                c,
                eps: 1e-9,
                ..SvmParameter::default()
            };
            // libsvm stores its kernel matrix in single precision. The error is therefore at most ε
            // · C for each row, with the machine epsilon ε of f32.
            let rounding = f64::from(f32::EPSILON) * c * labels.len() as f64;
            let model = libsvm_rs::train::svm_train(&problem, &parameter);
            let (others, _) = random_rows(100 + seed, 50, width, classes);
            for row in others.chunks(width) {
                let mut expected = vec![0.0; pair_count(classes)];
                let class = libsvm_rs::predict::predict_values(&model, &nodes(row), &mut expected);
                let decisions = svm.decisions(&scale, row);
                for (decision, expected) in decisions.iter().zip(&expected) {
                    let apart = (decision - expected).abs();
                    assert!(apart < rounding, "seed {seed} {kernel:?} {c}: {decision} {expected}");
                }
                // If votes are equal, libsvm-rs takes the last class, while libsvm and this library
                // take the first.
                let mut votes = vec![0; classes];
                for ((a, b), decision) in pairs(classes).zip(&decisions) {
                    votes[if *decision > 0.0 { a } else { b }] += 1;
                }
                let most = votes.iter().max().unwrap();
                if votes.iter().filter(|count| *count == most).count() == 1 {
                    assert_eq!(svm.class(&scale, row) as f64, class);
                }
            }
        }
    }
}

#[test]
fn the_order_of_rows_changes_no_bit() {
    let (width, classes) = (3, 3);
    let (values, labels) = random_rows(3, 90, width, classes);
    let folds: Vec<usize> = (0..labels.len()).map(|i| i / 3 % 5).collect();
    let order = SeededRng::new(8).permutation(labels.len());
    let shuffled: Vec<f64> =
        order.iter().flat_map(|&i| values[i * width..(i + 1) * width].to_vec()).collect();
    let shuffled_labels: Vec<usize> = order.iter().map(|&i| labels[i]).collect();
    let shuffled_folds: Vec<usize> = order.iter().map(|&i| folds[i]).collect();
    for kernels in [Kernels::Linear, Kernels::Rbf(vec![0.1, 1.0])] {
        let grid = Grid::new(kernels);
        let target = Target { labels: &labels, classes };
        let cells = cross_validate(width, &values, &folds, &[target], &grid).unwrap().remove(0);
        let other = Target { labels: &shuffled_labels, classes };
        let others =
            cross_validate(width, &shuffled, &shuffled_folds, &[other], &grid).unwrap().remove(0);
        for (cell, other) in cells.iter().zip(&others) {
            assert_eq!(cell.accuracy, other.accuracy);
            for (place, &i) in order.iter().enumerate() {
                assert_eq!(other.decisions[place * 3..][..3], cell.decisions[i * 3..][..3]);
            }
        }
        let chosen = best(&cells).unwrap();
        let sigmoids = calibrate(target, &chosen.decisions).unwrap();
        assert_eq!(sigmoids, calibrate(other, &best(&others).unwrap().decisions).unwrap());
        let settings = SvmSettings::new(chosen.kernel, chosen.c);
        let first = fit(width, &values, target, settings, sigmoids.clone()).unwrap();
        let second = fit(width, &shuffled, other, settings, sigmoids).unwrap();
        assert_eq!(first, second);
    }
}

#[test]
fn a_cell_of_a_grid_is_a_fit_of_its_own() {
    let (width, classes) = (3, 3);
    let (values, labels) = random_rows(4, 90, width, classes);
    let avoid: Vec<usize> = labels.iter().map(|&label| usize::from(label != 1)).collect();
    let folds: Vec<usize> = (0..labels.len()).map(|i| i / 3 % 4).collect();
    let targets = [Target { labels: &labels, classes }, Target { labels: &avoid, classes: 2 }];
    for kernels in [Kernels::Linear, Kernels::Rbf(vec![0.03, 0.3, 3.0])] {
        let grid = Grid { tolerance: 1e-4, ..Grid::new(kernels) };
        let cells = cross_validate(width, &values, &folds, &targets, &grid).unwrap();
        for (target, cells) in targets.iter().zip(&cells) {
            let pairs = pair_count(target.classes);
            for cell in cells {
                for fold in 0..4 {
                    let (held, trained): (Vec<usize>, Vec<usize>) =
                        (0..labels.len()).partition(|&i| folds[i] == fold);
                    let row = |i: usize| &values[i * width..(i + 1) * width];
                    let training: Vec<f64> =
                        trained.iter().flat_map(|&i| row(i).to_vec()).collect();
                    let known: Vec<usize> = trained.iter().map(|&i| target.labels[i]).collect();
                    let part = Target { labels: &known, classes: target.classes };
                    let settings = SvmSettings::new(cell.kernel, cell.c);
                    let (scale, svm) =
                        fit(width, &training, part, settings, plain(target.classes)).unwrap();
                    let mut right = 0;
                    for &i in &held {
                        let decisions = svm.decisions(&scale, row(i));
                        let found = &cell.decisions[i * pairs..(i + 1) * pairs];
                        for (a, b) in decisions.iter().zip(found) {
                            assert!((a - b).abs() < 2e-3, "{:?} {} {a} {b}", cell.kernel, cell.c);
                        }
                        right += usize::from(svm.class(&scale, row(i)) == target.labels[i]);
                    }
                    let share = right as f64 / held.len() as f64;
                    assert!((cell.accuracy[fold] - share).abs() <= 1.01 / held.len() as f64);
                }
            }
        }
    }
}

#[test]
fn poor_data() {
    let settings =
        [SvmSettings::new(Kernel::Linear, 1.0), SvmSettings::new(Kernel::Rbf { gamma: 0.5 }, 1.0)];
    for settings in settings {
        let train = |width: usize, values: &[f64], labels: &[usize]| {
            fit(width, values, Target { labels, classes: 2 }, settings, plain(2))
        };
        assert_eq!(train(1, &[1.0, 2.0], &[0, 0]).unwrap_err().field, "labels");
        assert_eq!(train(1, &[1.0, f64::NAN], &[0, 1]).unwrap_err().field, "rows[1][0]");
        assert_eq!(train(1, &[1.0], &[0, 1]).unwrap_err().field, "rows");
        assert_eq!(train(1, &[1.0, 2.0], &[0, 2]).unwrap_err().field, "labels[1]");
        // With two samples, the decision boundary is midway between them.
        let (scale, svm) = train(1, &[1.0, 2.0], &[0, 1]).unwrap();
        assert!(svm.decisions(&scale, &[1.5])[0].abs() < 1e-6);
        assert!(svm.decisions(&scale, &[1.0])[0] > 0.1);
        // A constant feature changes nothing.
        let with = [[1.0, 7.0], [2.0, 7.0], [2.5, 7.0], [1.2, 7.0]].concat();
        let labels = [0, 1, 1, 0];
        let (scale, svm) = train(2, &with, &labels).unwrap();
        let (narrow_scale, narrow) = train(1, &[1.0, 2.0, 2.5, 1.2], &labels).unwrap();
        let (a, b) = (svm.decisions(&scale, &[1.4, 7.0]), narrow.decisions(&narrow_scale, &[1.4]));
        assert!((a[0] - b[0]).abs() < 1e-6);
        // Both classes have the same feature values, so the larger class wins.
        let same = vec![3.0; 10];
        let (scale, svm) = train(1, &same, &[0, 1, 1, 0, 1, 1, 1, 0, 1, 1]).unwrap();
        assert_eq!(svm.class(&scale, &[3.0]), 1);
        // An invalid C or tolerance is rejected.
        let bad = |settings: SvmSettings| {
            let target = Target { labels: &[0, 1], classes: 2 };
            fit(1, &[1.0, 2.0], target, settings, plain(2)).unwrap_err().field
        };
        assert_eq!(bad(settings.with_c(0.0)), "c");
        assert_eq!(bad(settings.with_tolerance(f64::NAN)), "tolerance");
    }
    let none = settings[0].with_kernel(Kernel::Rbf { gamma: 0.0 });
    let target = Target { labels: &[0, 1], classes: 2 };
    assert_eq!(fit(1, &[1.0, 2.0], target, none, plain(2)).unwrap_err().field, "gamma");
    assert_eq!(
        fit(1, &[1.0, 2.0], target, settings[1], plain(3)).unwrap_err().field,
        "sigmoids",
        "one a pair"
    );
}

#[test]
fn a_class_that_a_fold_lacks() {
    // Class 2 occurs only in fold 0, so SVMs that are trained on the other folds do not know it.
    let values: Vec<f64> = (0..12).map(f64::from).collect();
    let labels = [0, 1, 2, 2, 0, 1, 0, 1, 0, 1, 0, 1];
    let folds = [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2];
    let target = Target { labels: &labels, classes: 3 };
    for kernels in [Kernels::Linear, Kernels::Rbf(vec![0.5])] {
        let grid = Grid::new(kernels);
        let cells = cross_validate(1, &values, &folds, &[target], &grid).unwrap().remove(0);
        for cell in &cells {
            for held in cell.decisions[..4 * 3].chunks(3) {
                assert_eq!(held[1..], [1.0, 1.0], "0 and 1 against what was not there");
            }
            let sigmoids = calibrate(target, &cell.decisions).unwrap();
            assert!(sigmoids.iter().all(|s| s.a.is_finite() && s.b.is_finite()));
        }
        let complain = |folds: &[usize], grid: &Grid| {
            cross_validate(1, &values, folds, &[target], grid).unwrap_err().field
        };
        assert_eq!(complain(&[4; 12], &grid), "folds");
        assert_eq!(complain(&folds[..11], &grid), "rows");
        assert_eq!(complain(&folds, &Grid { c: vec![], ..grid.clone() }), "c");
        assert_eq!(complain(&folds, &Grid { c: vec![1.0, -1.0], ..grid.clone() }), "c[1]");
    }
    let grid = Grid::new(Kernels::Rbf(vec![0.5, 0.0]));
    assert_eq!(cross_validate(1, &values, &folds, &[target], &grid).unwrap_err().field, "gamma[1]");
    assert_eq!(calibrate(target, &[0.0]).unwrap_err().field, "decisions");
}
