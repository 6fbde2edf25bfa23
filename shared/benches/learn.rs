//! Training and inference at the size of the study's comparison: eight people, five folds of forty
//! trials, seven feature sets and two experiments.
//!
//! Budgets on one thread: 1.5 s for the whole comparison with logistic regression, 1.5 s for the
//! whole comparison with trees, 1 µs for a prediction by either model, and 10 s for boosting for
//! eight people on one feature set.

mod people;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use people::{FOLDS, Person, SETS, WIDTH, people};
use sidestep::learn::boosting::{BoostingSettings, fit, fit_by_folds};
use sidestep::learn::logistic::{LogisticSettings, fit_path};
use sidestep::learn::samples::Samples;
use sidestep::learn::tree::grow_each;
use sidestep::predict::scale::Scale;

/// Standardised rows for one fit, and their classes in experiments I and II.
struct Part {
    width: usize,
    values: Vec<f64>,
    labels: [Vec<usize>; 2],
}

impl Part {
    /// The rows of all training trials except the trials of `fold`, with the columns `set`.
    fn new(person: &Person, set: &[usize], fold: Option<usize>) -> Self {
        let kept = |i: &usize| fold.is_none_or(|fold| person.folds[*i] != fold);
        let rows: Vec<usize> = (0..person.folds.len()).filter(kept).collect();
        let row = |&i: &usize| set.iter().map(move |j| person.values[i * WIDTH + j]);
        let raw: Vec<f64> = rows.iter().flat_map(row).collect();
        let (_, values) = Scale::standardised(set.len(), &raw);
        let labels = |all: &Vec<usize>| rows.iter().map(|&i| all[i]).collect();
        let labels = [labels(&person.labels[0]), labels(&person.labels[1])];
        Self { width: set.len(), values, labels }
    }

    fn samples(&self, experiment: usize) -> Samples<'_> {
        let labels = &self.labels[experiment];
        Samples::new(self.width, &self.values, labels, 3 - experiment).expect("rows of numbers")
    }
}

/// The rows of every fit of the comparison.
fn parts(people: &[Person]) -> Vec<Part> {
    let mut parts = Vec::new();
    for person in people {
        for set in SETS {
            parts.extend((0..FOLDS).map(|fold| Part::new(person, set, Some(fold))));
        }
    }
    parts
}

fn logistic(criterion: &mut Criterion) {
    let people = people();
    let parts = parts(&people);
    let mut group = criterion.benchmark_group("logistic");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let strengths = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2];
    for (experiment, name) in ["which way", "whether"].into_iter().enumerate() {
        let settings = LogisticSettings::default();
        group.bench_function(format!("a path of six, {name}"), |bencher| {
            bencher.iter(|| fit_path(&parts[0].samples(experiment), &strengths, settings));
        });
    }
    group.bench_function("all folds of the comparison", |bencher| {
        bencher.iter(|| {
            for part in &parts {
                for experiment in [0, 1] {
                    let settings = LogisticSettings::default();
                    let models = fit_path(&part.samples(experiment), &strengths, settings);
                    black_box(models.expect("a fit"));
                }
            }
        });
    });
    let person = &people[0];
    let scale = Scale::fit(WIDTH, &person.values);
    let part = Part::new(person, SETS[0], None);
    let models = fit_path(&part.samples(0), &[1.0], LogisticSettings::default());
    let model = &models.expect("a fit")[0];
    let mut probabilities = [0.0; 3];
    group.bench_function("inference", |bencher| {
        bencher.iter(|| {
            let row = black_box(&person.values[800..800 + WIDTH]);
            model.probabilities_into(&scale, row, &mut probabilities);
            probabilities[1]
        });
    });
    group.finish();
}

fn trees(criterion: &mut Criterion) {
    let people = people();
    let parts = parts(&people);
    let mut group = criterion.benchmark_group("tree");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let leaves = [1, 5, 10, 20];
    for (experiment, name) in ["which way", "whether"].into_iter().enumerate() {
        let samples = parts[0].samples(experiment);
        group.bench_function(format!("four leaf sizes, {name}"), |bencher| {
            bencher.iter(|| grow_each(&samples, None, &leaves));
        });
        group.bench_function(format!("one leaf size, {name}"), |bencher| {
            bencher.iter(|| grow_each(&samples, None, &leaves[..1]));
        });
    }
    group.bench_function(
        "all folds of the comparison, with predictions at four depths",
        |bencher| {
            bencher.iter(|| {
                for (i, part) in parts.iter().enumerate() {
                    let person = &people[i / (SETS.len() * FOLDS)];
                    let set = SETS[i / FOLDS % SETS.len()];
                    for experiment in [0, 1] {
                        let trees = grow_each(&part.samples(experiment), None, &leaves);
                        for tree in trees.expect("trees") {
                            for tree in [2, 4, 6, 8].map(|depth| tree.truncated(depth)) {
                                // Predicts as many rows as a fold holds out.
                                for row in person.values.chunks_exact(WIDTH).step_by(FOLDS) {
                                    black_box(tree.class(&row[..set.len()]));
                                }
                            }
                        }
                    }
                }
            });
        },
    );
    let person = &people[0];
    let part = Part::new(person, SETS[0], None);
    let tree = grow_each(&part.samples(0), None, &[1]).expect("a tree").remove(0);
    let mut probabilities = [0.0; 3];
    let mut rows = part.values.chunks_exact(WIDTH).cycle();
    group.bench_function(format!("inference, depth {}", tree.depth()), |bencher| {
        bencher.iter(|| {
            tree.probabilities_into(black_box(rows.next().expect("rows")), &mut probabilities);
            probabilities[1]
        });
    });
    group.finish();
}

fn boosting(criterion: &mut Criterion) {
    let people = people();
    let mut group = criterion.benchmark_group("boosting");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let settings = BoostingSettings::default().with_rounds(100);
    let person = &people[0];
    let part = Part::new(person, SETS[0], None);
    for (experiment, name) in ["which way", "whether"].into_iter().enumerate() {
        let samples = part.samples(experiment);
        group.bench_function(format!("a hundred rounds, {name}"), |bencher| {
            bencher.iter(|| fit(&samples, &settings));
        });
    }
    group.bench_function("eight people by folds, which way", |bencher| {
        bencher.iter(|| {
            for person in &people {
                let part = Part::new(person, SETS[0], None);
                let settings = BoostingSettings::default();
                let found = fit_by_folds(&part.samples(0), &person.folds, &[1, 2, 3], &settings);
                black_box(found).expect("a fit");
            }
        });
    });
    let model = fit(&part.samples(0), &settings).expect("a model");
    let mut probabilities = [0.0; 3];
    let mut rows = part.values.chunks_exact(WIDTH).cycle();
    group.bench_function("inference, a hundred rounds", |bencher| {
        bencher.iter(|| {
            model.probabilities_into(black_box(rows.next().expect("rows")), &mut probabilities);
            probabilities[1]
        });
    });
    group.finish();
}

criterion_group!(benches, logistic, trees, boosting);
criterion_main!(benches);
