//! The page: what is computed, how it was measured and what came out.

mod geometry;
mod statistics;

use super::figure3::{PICTURE, Panel};
use super::report::{Kind, Report};
use crate::validate::words::{head, minus};

/// The whole page.
pub(super) fn page(report: &Report, panels: &[Panel]) -> String {
    let sections = [
        introduction(),
        geometry::vectors(&report.vectors),
        geometry::brute_force(report),
        geometry::twin(&report.twin),
        geometry::membership(&report.membership),
        figure3(panels),
        statistics::coverage(&report.coverage),
        statistics::danger(&report.danger),
        statistics::families(&report.families),
        limits(report),
    ];
    sections.join("\n")
}

fn introduction() -> String {
    "# How good the reachable sets and their probabilities are

<!-- Written by `cargo xtask validate`: change that, not this file. -->

A predictor and Algorithm 1 of the paper bound the human's turn rate in each of the coming steps.
The *forward reachable set* is where the human can then be: at each step, or at any time up to the
last one (the *tube*). SHFRS are five such sets, each around the one before, with the share of
trajectories that stay inside each. This page measures the geometry of the sets and what the
probabilities promise. Speed 2 m/s, steps of 0.2 s, turn rates within ±0.5 rad/s throughout.
`cargo xtask validate` computes every number and the picture anew, in the same way each time.
Random numbers come from fixed seeds. **No number here is about people**: the people are made up,
or synthetic.

Bounds are of four kinds, since their geometry differs:

| kind | admits in each step |
|---|---|
| *everything* | every turn rate |
| *straight* | straight and a random range about it, sometimes straight alone |
| *one side* | a random range of turns to one side, the same side throughout |
| *any* | any range, of any sign; some steps leave no choice |
"
    .to_owned()
}

fn figure3(panels: &[Panel]) -> String {
    let list = |numbers: &[f64]| {
        let words: Vec<_> = numbers.iter().map(f64::to_string).collect();
        words.join(", ")
    };
    let k = |k: &[usize]| k.iter().map(usize::to_string).collect::<Vec<_>>().join(" ");
    let mut settings = vec![head("panel | ε, rad/s | k | bounds before widening, rad/s", 4)];
    let mut areas = vec![head("panel | tube | F₁ | F₂ | F₃ | F₄ | F₅", 2)];
    let row = |name: &str, what: &str, numbers: &[f64]| {
        let cells: Vec<_> = numbers.iter().map(|area| format!("{area:.2}")).collect();
        format!("| {name} | {what} | {} |", cells.join(" | "))
    };
    let mut farthest = 0.0_f64;
    for panel in panels {
        settings.push(format!(
            "| {} | {} | {} | {} |",
            panel.name,
            list(&panel.epsilon),
            k(&panel.k),
            raw(&panel.raw)
        ));
        areas.push(row(panel.name, "found, m²", &panel.areas));
        areas.push(row("", "reference, m²", &panel.reference));
        let differences = panel.areas.iter().zip(panel.reference).map(|(a, b)| (a - b).abs());
        farthest = differences.fold(farthest, f64::max);
    }
    format!(
        "## The paper's Figure 3

![Three panels of nested regions, as tubes and at single steps]({PICTURE})

A made-up human who turns right once the robot is near, with the settings of the paper's three
panels. The inputs are in [figure3](figure3); `sidestep bounds` and `sidestep reach` computed the
tables, `sidestep plot --kind regions` the picture. The predictor is a threshold on how far ahead
the robot is: beyond it straight is likely, before it right; left never is. The paper prints no
areas; the reference computed them by other code from bounds like these.

{}

{}

The largest difference is {farthest:.3} m².
",
        settings.join("\n"),
        areas.join("\n")
    )
}

/// Bounds step by step, with equal neighbours counted.
fn raw(bounds: &[(f64, f64)]) -> String {
    let runs = bounds.chunk_by(|a, b| a == b);
    let run = |run: &[(f64, f64)]| {
        let (lo, hi) = run[0];
        minus(format!("{}× [{lo}, {hi}]", run.len()))
    };
    runs.map(run).collect::<Vec<_>>().join(", ")
}

fn limits(report: &Report) -> String {
    let rows = &report.membership.rows;
    let outside: usize = rows.iter().map(|row| row.outside).sum();
    let farthest = rows.iter().map(|row| row.farthest_m).fold(0.0, f64::max);
    let missed = if outside == 0 {
        "none of the drives above was".to_owned()
    } else {
        format!("{outside} of the drives above were, by {:.1} mm at most", 1000.0 * farthest)
    };
    format!(
        "## Limits

- **Holes are filled.** Where headings span more than a full turn, a set may surround positions
  that cannot be reached in exactly that time; polygons contain them.
- **Rears without straight driving** are searched, not derived: a reachable state may be found
  outside by a sliver; {missed}.
- **Guarantees are marginal**: over trajectories like those that were calibrated on, not for each
  scene or person; and only for one window a trajectory.
- **The model is exact, people are not.** These are the sets of a vehicle of constant speed
  whose turn rate is bounded. Whether people keep to the bounds is what the probabilities are for.
"
    )
}

fn kind(kind: Kind) -> &'static str {
    match kind {
        Kind::Everything => "everything",
        Kind::Straight => "straight",
        Kind::OneSide => "one side",
        Kind::Any => "any",
    }
}

/// Metres as millimetres, to so many places as are worth reading.
fn mm(metres: f64) -> String {
    let mm = 1000.0 * metres;
    minus(match mm.abs() {
        0.0 => "0".to_owned(),
        size if size < 0.1 => format!("{mm:.4}"),
        size if size < 10.0 => format!("{mm:.2}"),
        _ => format!("{mm:.1}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_counted() {
        let bounds = [(-0.5, 0.0), (-0.5, 0.0), (-0.5, -0.5)];
        assert_eq!(raw(&bounds), "2× [−0.5, 0], 1× [−0.5, −0.5]");
    }

    #[test]
    fn lengths_have_the_places_they_need() {
        assert_eq!(
            [mm(0.0), mm(0.000_012), mm(-0.0012), mm(0.0534)],
            ["0", "0.0120", "−1.20", "53.4"]
        );
    }

    #[test]
    fn the_page_shows_the_picture() {
        let page = include_str!("../../../../docs/validation/shfrs.md");
        assert!(page.contains(&format!("]({PICTURE})")));
        assert_eq!(page.matches("![").count(), 1);
    }
}
