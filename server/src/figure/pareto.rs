//! Plots coverage against area. Each family of predictions has a panel, which also shows the curves
//! of the other families in grey.

use super::{MARGIN, headed};
use sidestep::chart::{Align, Chart, Drawing, Frame, colours, number};
use sidestep::shfrs::guarantee::Unit;
use sidestep::shfrs::pareto::Pareto;
use sidestep::shfrs::pareto_charts::{areas, panels, targets};

/// Size of a frame, and the margins to its left and right (px).
const FRAME: [f64; 2] = [210.0, 140.0];
const ROOM: [f64; 2] = [34.0, 16.0];
/// Space above a panel for its name and areas (px).
const NAMES: f64 = 34.0;
/// Number of panels side by side.
const COLUMNS: usize = 4;

/// Draws a panel for each family. It shows the family's curve and, for each calibrated level, a
/// mark with the interval of the coverage. `unit` is the unit of calibration, and `note` describes
/// the data.
#[must_use]
pub fn pareto(found: &Pareto, unit: Unit, note: &str) -> Drawing {
    let charts = panels(found);
    let [above, below] = charts.first().map_or([0.0; 2], Chart::room);
    let cell = [ROOM[0] + FRAME[0] + ROOM[1], NAMES + above + FRAME[1] + below + 14.0];
    let how = format!(
        "{} steps ahead  ·  levels calibrated on {} {}, judged on {} others  ·  one window each ({})",
        found.steps,
        found.calibration_trajectories,
        unit.word(),
        found.test_trajectories,
        found.window_choice.replace('_', " "),
    );
    let targets = targets(found);
    let targets = targets.iter().map(|target| format!("{target:.2}")).collect::<Vec<_>>();
    let signs = format!(
        "Dashed: coverage asked for ({})  ·  upright lines: {} % intervals  ·  grey: the other families  ·  coverage holds on average over {}",
        targets.join(", "),
        number(100.0 * found.confidence),
        unit.word()
    );
    let width = COLUMNS as f64 * cell[0];
    let mut drawing = headed("How much area a coverage costs", &[note, &how, &signs], width);
    let top = drawing.size[1] + 6.0;
    for (i, (chart, curve)) in charts.iter().zip(&found.curves).enumerate() {
        let left = MARGIN + (i % COLUMNS) as f64 * cell[0] + ROOM[0];
        let top = top + (i / COLUMNS) as f64 * cell[1];
        drawing.bold(&curve.family, [left, top + 8.0], 12.5, colours::TEXT, Align::Left);
        let areas = areas(found, curve);
        drawing.text(&areas, [left, top + 25.0], 11.5, colours::MUTED, Align::Left);
        let [width, height] = FRAME;
        chart.draw(&mut drawing, Frame { left, top: top + NAMES + above, width, height });
    }
    drawing.size[1] = top + charts.len().div_ceil(COLUMNS) as f64 * cell[1] + 6.0;
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::png;
    use sidestep::math::{exp, ln};
    use sidestep::shfrs::pareto::{ParetoCurve, ParetoPoint, ParetoRow};

    /// Families whose coverage is (area / 5)^power.
    fn comparison(families: usize) -> Pareto {
        let mut found = Pareto {
            window_choice: "random_one".to_owned(),
            steps: 10,
            calibration_trajectories: 120,
            test_trajectories: 120,
            confidence: 0.95,
            rows: Vec::new(),
            curves: Vec::new(),
        };
        for family in 0..families {
            let power = 0.2 + 0.4 * family as f64;
            let name = format!("family {family}");
            let point = |area: f64| ParetoPoint {
                level: area,
                coverage: exp(power * ln(area / 5.0)),
                mean_area_m2: area,
            };
            for target in [0.75, 0.9, 0.95] {
                let area = 5.0 * exp(ln(target) / power);
                found.rows.push(ParetoRow {
                    family: name.clone(),
                    target,
                    level_name: "area".to_owned(),
                    level: area,
                    coverage: target,
                    coverage_low: target - 0.08,
                    coverage_high: (target + 0.06).min(1.0),
                    mean_area_m2: area,
                });
            }
            let points = (0..=50).map(|i| point(0.1 * f64::from(i))).collect();
            found.curves.push(ParetoCurve { family: name, points });
        }
        found
    }

    #[test]
    fn every_family_has_a_panel_with_its_areas_and_marks() {
        let drawing = pareto(&comparison(9), Unit::Trajectories, "made-up families");
        let svg = drawing.svg();
        for family in 0..9 {
            assert_eq!(svg.matches(&format!(">family {family}<")).count(), 1);
        }
        // The area of family 0 at 0.75 is 5 · 0.75⁵.
        assert!(svg.contains("1.19, 2.95, 3.87 m²") && svg.contains("made-up families"));
        // Each panel has three marks, and there is no other circle.
        assert_eq!(svg.matches("<circle").count(), 9 * 3);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(png(&drawing).unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn one_point_is_drawn_without_a_curve() {
        let mut found = comparison(1);
        found.curves[0].points.truncate(1);
        found.curves[0].points[0].coverage = 0.0;
        let curves = |found| {
            pareto(found, Unit::Trajectories, "").svg().matches("stroke-width=\"2\"").count()
        };
        assert_eq!((curves(&comparison(1)), curves(&found)), (1, 0));
    }
}
