//! The README's advice on the number of participants agrees with the library.

use sidestep::stats::power::PowerCurve;

/// Lines of the table: an effect size, the power for each number of people, and the number of
/// people for a power of 80 %.
fn lines() -> Vec<String> {
    const PEOPLE: [usize; 5] = [11, 16, 20, 30, 40];
    const FAMILY: usize = 48;
    let line = |effect: f64| {
        let curve = PowerCurve::of(effect, 100);
        let percent = |people| format!("{:.0} %", 100.0 * curve.power(people, FAMILY));
        let enough = curve.people(0.8, FAMILY).expect("at most 100 people");
        format!("| {effect} | {} | {enough} |", PEOPLE.map(percent).join(" | "))
    };
    [0.5, 0.8, 1.2].map(line).to_vec()
}

#[test]
fn the_readme_states_the_power_that_the_library_computes() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md");
    let readme = std::fs::read_to_string(path).expect("the README");
    let lines = lines();
    for line in &lines {
        assert!(readme.contains(line), "expected in the README:\n{}", lines.join("\n"));
    }
}
