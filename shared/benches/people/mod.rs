//! The training rows of eight synthetic people (`shared/tests/data/features.csv`), and the paper's
//! feature sets.

/// Number of columns of the feature set hrd.
pub(crate) const WIDTH: usize = 8;

/// Columns of the paper's seven feature sets: hrd, hr, hd, rd, h, r and d.
pub(crate) const SETS: [&[usize]; 7] = [
    &[0, 1, 2, 3, 4, 5, 6, 7],
    &[0, 1, 2, 3, 4, 5, 6],
    &[0, 1, 2, 3, 4, 5, 7],
    &[0, 1, 2, 3, 4, 6, 7],
    &[0, 1, 2, 3, 4, 5],
    &[0, 1, 2, 3, 4, 6],
    &[0, 1, 2, 3, 4, 7],
];

pub(crate) const FOLDS: usize = 5;

/// A person's training rows: values, folds, and classes in experiments I and II.
#[derive(Default)]
pub(crate) struct Person {
    pub(crate) values: Vec<f64>,
    pub(crate) folds: Vec<usize>,
    pub(crate) labels: [Vec<usize>; 2],
}

pub(crate) fn people() -> Vec<Person> {
    let mut people: Vec<Person> = (0..8).map(|_| Person::default()).collect();
    let mut reader =
        csv::Reader::from_reader(include_str!("../../tests/data/features.csv").as_bytes());
    for row in reader.deserialize() {
        let row: Vec<f64> = row.expect("a row of numbers");
        if row[1] < 40.0 {
            let person = &mut people[row[0] as usize];
            person.values.extend(&row[3..3 + WIDTH]);
            person.folds.push(row[1] as usize % FOLDS);
            person.labels[0].push((row[3 + WIDTH] + 1.0) as usize);
            person.labels[1].push(row[4 + WIDTH] as usize);
        }
    }
    people
}
