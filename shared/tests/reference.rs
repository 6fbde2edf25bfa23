//! The library against numbers that were found elsewhere (`tests/data/README.md`).

use sidestep::reachability::ExactValue;

/// The rows of a CSV file without its header, as numbers.
fn numbers(text: &str) -> Vec<Vec<f64>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().map(|row| row.expect("a row of numbers")).collect()
}

fn check_states(game: ExactValue, text: &str) {
    let rows = numbers(text);
    assert_eq!(rows.len(), 2000);
    for row in rows {
        let (state, expected) = ([row[0], row[1], row[2]], row[3]);
        let found = game.value(state);
        assert!((found - expected).abs() <= 1e-9, "V{state:?} = {found}, not {expected}");
    }
}

#[test]
fn exact_values_of_the_papers_game() {
    let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
    check_states(game, include_str!("data/states_paper.csv"));
}

#[test]
fn exact_values_of_mitchells_game() {
    let game = ExactValue::new(5.0, 1.0, 5.0).unwrap();
    check_states(game, include_str!("data/states_mitchell.csv"));
}
