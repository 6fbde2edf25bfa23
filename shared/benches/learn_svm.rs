//! Training and inference of support vector machines at the size of the study's comparison: eight
//! people, seven feature sets, two experiments, five folds, 16 radial and 4 linear settings.
//!
//! Budgets on one thread: 28 s for the whole comparison, and 20 µs for a prediction.

mod people;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use people::{Person, SETS, WIDTH, people};
use sidestep::learn::svm::{
    Grid, Kernels, SvmSettings, Target, best, calibrate, cross_validate, fit,
};
use sidestep::math::SeededRng;
use sidestep::predict::scale::Scale;
use sidestep::predict::svm::{Sigmoid, Svm};

/// Cross-validates, calibrates and refits the SVMs of one person on one feature set.
fn compare(person: &Person, set: &[usize], kernels: Kernels) {
    let row = |row: &[f64]| set.iter().map(|&j| row[j]).collect::<Vec<f64>>();
    let values: Vec<f64> = person.values.chunks(WIDTH).flat_map(row).collect();
    let [turn, avoid] = &person.labels;
    let targets = [Target { labels: turn, classes: 3 }, Target { labels: avoid, classes: 2 }];
    let grid = Grid::new(kernels);
    let cells = cross_validate(set.len(), &values, &person.folds, &targets, &grid).expect("cells");
    for (target, cells) in targets.into_iter().zip(&cells) {
        let cell = best(cells).expect("a cell");
        let sigmoids = calibrate(target, &cell.decisions).expect("sigmoids");
        let settings = SvmSettings::new(cell.kernel, cell.c);
        black_box(fit(set.len(), &values, target, settings, sigmoids).expect("a fit"));
    }
}

fn radial() -> Kernels {
    Kernels::Rbf(vec![0.01, 0.03, 0.1, 0.3])
}

fn training(criterion: &mut Criterion) {
    let people = people();
    let mut group = criterion.benchmark_group("svm");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    group.bench_function("radial, one person, one set", |bencher| {
        bencher.iter(|| compare(&people[0], SETS[0], radial()));
    });
    group.bench_function("linear, one person, one set", |bencher| {
        bencher.iter(|| compare(&people[0], SETS[0], Kernels::Linear));
    });
    group.bench_function("radial and linear, one person, all sets", |bencher| {
        bencher.iter(|| {
            for set in SETS {
                compare(&people[0], set, radial());
                compare(&people[0], set, Kernels::Linear);
            }
        });
    });
    group.finish();
}

/// The whole comparison. Run it alone with `cargo bench --bench learn_svm -- whole`.
fn whole(criterion: &mut Criterion) {
    let people = people();
    let mut group = criterion.benchmark_group("svm whole");
    group.sample_size(10);
    for (name, kernels) in [("radial", radial()), ("linear", Kernels::Linear)] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for person in &people {
                    for set in SETS {
                        compare(person, set, kernels.clone());
                    }
                }
            });
        });
    }
    group.finish();
}

fn inference(criterion: &mut Criterion) {
    let mut rng = SeededRng::new(1);
    let mut rows = |count: usize, width: usize| -> Vec<Vec<f64>> {
        (0..count).map(|_| (0..width).map(|_| rng.uniform(-2.0, 2.0)).collect()).collect()
    };
    let (vectors, dual) = (rows(2000, WIDTH), rows(3, 2000));
    let sigmoids = vec![Sigmoid { a: -1.0, b: 0.0 }; 3];
    let radial = Svm::rbf(WIDTH, 3, 0.1, &vectors, &dual, vec![0.0; 3], sigmoids.clone());
    let linear = Svm::linear(WIDTH, 3, &rows(3, WIDTH), vec![0.0; 3], sigmoids);
    let scale = Scale::new(vec![0.5; WIDTH], vec![2.0; WIDTH]).expect("a scale");
    let row = rows(1, WIDTH).remove(0);
    let mut group = criterion.benchmark_group("svm inference");
    for (name, svm) in [("2,000 support vectors", radial), ("linear", linear)] {
        let svm = svm.expect("an SVM");
        let mut probabilities = [0.0; 3];
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                svm.probabilities_into(&scale, black_box(&row), &mut probabilities);
                probabilities[1]
            });
        });
    }
    group.finish();
}

criterion_group!(benches, inference, training, whole);
criterion_main!(benches);
