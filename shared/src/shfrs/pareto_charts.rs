//! Charts of coverage against area: one panel per family. Behind the family's curve, each panel shows
//! the curves of the other families in grey.

use super::pareto::{Pareto, ParetoCurve};
use crate::chart::{Axis, Chart, Colour, Mark, Pen, Point, Series, colours, fixed};

/// One chart for each family. It shows the family's curve (in the accent colour for SHFRS) and, at
/// each calibrated level, a mark with the interval of the coverage. All charts have the same axes.
#[must_use]
pub fn panels(found: &Pareto) -> Vec<Chart> {
    let axes = Axes::around(found);
    (0..found.curves.len()).map(|family| axes.panel(found, family)).collect()
}

/// The areas of a family at its calibrated levels, such as "2.07, 5.12, 5.21 m²".
#[must_use]
pub fn areas(found: &Pareto, curve: &ParetoCurve) -> String {
    let rows = found.rows.iter().filter(|row| row.family == curve.family);
    let areas: Vec<String> = rows.map(|row| fixed(row.mean_area_m2, 2)).collect();
    format!("{} m²", areas.join(", "))
}

/// The requested probabilities, ascending.
#[must_use]
pub fn targets(found: &Pareto) -> Vec<f64> {
    let mut targets: Vec<f64> = found.rows.iter().map(|row| row.target).collect();
    targets.sort_by(f64::total_cmp);
    targets.dedup();
    targets
}

/// The axes of all panels.
struct Axes {
    targets: Vec<f64>,
    most_area: f64,
    least_coverage: f64,
}

impl Axes {
    fn around(found: &Pareto) -> Self {
        let points = found.curves.iter().flat_map(|curve| &curve.points);
        let areas = points.map(|point| point.mean_area_m2);
        let areas = areas.chain(found.rows.iter().map(|row| row.mean_area_m2));
        // Coverage far below every target is of no interest.
        let least = found.rows.iter().map(|row| row.coverage_low.min(row.target));
        let least = least.fold(1.0, f64::min) - 0.15;
        Self {
            targets: targets(found),
            most_area: 1.04 * areas.fold(0.0, f64::max).max(1e-3),
            least_coverage: ((10.0 * least).floor() / 10.0).clamp(0.0, 0.9),
        }
    }

    fn panel(&self, found: &Pareto, family: usize) -> Chart {
        let x = Axis::linear("mean area", "m²", [0.0, self.most_area], 6);
        let y = Axis::linear("coverage", "", [self.least_coverage, 1.02], 5);
        let mut chart = Chart::new("", "", x, y);
        for &target in &self.targets {
            let pen = Pen::new(colours::MUTED.at(0.55), 1.0).dashed(4.0, 4.0);
            chart.add(Series::drawn("", [[0.0, target], [self.most_area, target]], pen));
        }
        for (_, other) in found.curves.iter().enumerate().filter(|(i, _)| *i != family) {
            chart.add(self.curve(other, colours::MUTED, 0.25, 1.0));
        }
        let curve = &found.curves[family];
        let colour = if curve.is_shfrs() { colours::ACCENT } else { colours::TEXT };
        chart.add(self.curve(curve, colour, 1.0, 2.0));
        let rows = || found.rows.iter().filter(|row| row.family == curve.family);
        for row in rows() {
            let ends = [row.coverage_low, row.coverage_high];
            let ends = ends.map(|coverage| [row.mean_area_m2, coverage]);
            chart.add(Series::line("", ends, colour.at(0.5), 1.2));
        }
        let marks = rows().map(|row| [row.mean_area_m2, row.coverage]);
        chart.add(Series::line("", marks, colour, 1.0).marked(Mark::Circle).without_line());
        chart
    }

    /// The curve is a staircase, because the coverage of a growing set stays constant until the set
    /// contains another trajectory.
    fn curve(&self, curve: &ParetoCurve, colour: Colour, opacity: f64, width: f64) -> Series {
        let mut line: Vec<Point> = Vec::new();
        let mut before = self.least_coverage;
        for point in &curve.points {
            if point.coverage >= self.least_coverage {
                line.push([point.mean_area_m2, before]);
                line.push([point.mean_area_m2, point.coverage]);
                before = point.coverage;
            }
        }
        Series::line("", line, colour.at(opacity), width)
    }
}
