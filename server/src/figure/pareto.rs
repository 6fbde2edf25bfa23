//! Coverage against area, with the table that belongs to it.

use super::canvas::{
    Align, Canvas, DrawError, GRID, LINE, MUTED, SURFACE, TEXT, number, page, ticks,
};
use plotters::prelude::{Color, RGBColor};
use sidestep::math::{TAU, sin_cos};
use sidestep::shfrs::pareto::{Pareto, ParetoRow};

/// Of the page, with names as long as are usual.
const SIZE: [f64; 2] = [800.0, 500.0];

/// The plot: left, right, top, bottom.
const PLOT: [f64; 4] = [50.0, 470.0, 112.0, 440.0];

/// The table's left edge; the right edges of its columns of numbers go back from the margin.
const TABLE: f64 = 500.0;
const MARGIN: f64 = 24.0;
const COLUMN: f64 = 38.0;

/// Of broken lines, pixels.
const DASH: f64 = 4.0;

/// Okabe and Ito's colours, which people with any colour vision tell apart; the one that is
/// too light on white is left out.
const COLORS: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x1c, 0x1e, 0x22),
];

/// The SVG of the comparison: a curve a family, a mark at each calibrated level with the
/// interval of its coverage, and the areas as a table. The first `featured` families are
/// drawn boldly, on top. `note` says what the data are.
///
/// # Errors
/// [`DrawError`] if plotters cannot draw it.
pub fn pareto(found: &Pareto, featured: usize, note: &str) -> Result<String, DrawError> {
    let figure = Figure::new(found, featured);
    page("Coverage against area", figure.size(), |canvas| {
        let heading = "How much area a coverage costs";
        canvas.bold(heading, [MARGIN, 32.0], 20.0, TEXT, Align::Left)?;
        let how = format!(
            "{} steps ahead  ·  levels calibrated on {} trajectories, judged on {} others  ·  one window each ({})",
            found.steps,
            found.calibration_trajectories,
            found.test_trajectories,
            found.window_choice.replace('_', " "),
        );
        canvas.text(&how, [MARGIN, 56.0], 11.5, MUTED, Align::Left)?;
        canvas.text(note, [MARGIN, 73.0], 11.5, MUTED, Align::Left)?;
        figure.axes(canvas)?;
        // The featured ones last, so that nothing lies on them.
        for family in (0..found.curves.len()).rev() {
            figure.curve(canvas, family)?;
        }
        for family in (0..found.curves.len()).rev() {
            figure.marks(canvas, family)?;
        }
        figure.table(canvas)
    })
}

struct Figure<'a> {
    found: &'a Pareto,
    featured: usize,
    targets: Vec<f64>,
    most_area: f64,
    least_coverage: f64,
}

impl<'a> Figure<'a> {
    fn new(found: &'a Pareto, featured: usize) -> Self {
        let mut targets: Vec<f64> = found.rows.iter().map(|row| row.target).collect();
        targets.sort_by(f64::total_cmp);
        targets.dedup();
        let points = found.curves.iter().flat_map(|curve| &curve.points);
        let areas = points.map(|point| point.mean_area_m2);
        let most_area = areas.chain(found.rows.iter().map(|row| row.mean_area_m2));
        let most_area = most_area.fold(0.0, f64::max).max(1e-3);
        // What is far below every target is of no interest.
        let least = found.rows.iter().map(|row| row.coverage_low.min(row.target));
        let least = least.fold(1.0, f64::min) - 0.15;
        let least_coverage = ((10.0 * least).floor() / 10.0).clamp(0.0, 0.9);
        Self { found, featured, targets, most_area: 1.04 * most_area, least_coverage }
    }

    /// Wider for long names, higher for many.
    fn size(&self) -> [f64; 2] {
        let names = self.found.curves.iter().map(|curve| curve.family.chars().count());
        // About the width of a bold letter.
        let name = 7.4 * names.max().unwrap_or(0) as f64;
        let wide = TABLE + 31.0 + name + 36.0 + self.targets.len().max(3) as f64 * COLUMN - 22.0;
        let high = PLOT[2] + 37.0 + 24.0 * self.found.curves.len() as f64 + 56.0;
        [SIZE[0].max(wide), SIZE[1].max(high)]
    }

    fn place(&self, area: f64, coverage: f64) -> [f64; 2] {
        let [left, right, top, bottom] = PLOT;
        let up = (coverage - self.least_coverage) / (1.02 - self.least_coverage);
        [left + (right - left) * area / self.most_area, bottom - (bottom - top) * up]
    }

    fn axes(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let [left, right, top, bottom] = PLOT;
        for area in ticks(0.0, self.most_area, 9) {
            let [x, _] = self.place(area, 1.0);
            canvas.stroke(&[[x, top], [x, bottom]], GRID.mix(1.0), 1.0)?;
            canvas.text(&number(area), [x, bottom + 14.0], 11.0, MUTED, Align::Centre)?;
        }
        for coverage in ticks(self.least_coverage, 1.0, 9) {
            let [_, y] = self.place(0.0, coverage);
            let color = if coverage == 1.0 { LINE } else { GRID };
            canvas.stroke(&[[left, y], [right, y]], color.mix(1.0), 1.0)?;
            canvas.text(&number(coverage), [left - 8.0, y], 11.0, MUTED, Align::Right)?;
        }
        canvas.stroke(&[[left, top], [left, bottom], [right, bottom]], LINE.mix(1.0), 1.2)?;
        for &target in &self.targets {
            let [_, y] = self.place(0.0, target);
            canvas.broken(&[[left, y], [right, y]], MUTED.mix(0.55), 1.0, DASH)?;
        }
        let below = [right, bottom + 34.0];
        canvas.text("mean area of the predicted set (m²)", below, 11.5, MUTED, Align::Right)?;
        let above = [left - 24.0, top - 12.0];
        let name = "share of trajectories inside; dashed: asked for";
        canvas.text(name, above, 11.5, MUTED, Align::Left)
    }

    fn color(&self, family: usize) -> RGBColor {
        COLORS[family % COLORS.len()]
    }

    fn curve(&self, canvas: &Canvas<'_>, family: usize) -> Result<(), DrawError> {
        let mut line: Vec<[f64; 2]> = Vec::new();
        let mut before = self.least_coverage;
        for point in &self.found.curves[family].points {
            if point.coverage >= self.least_coverage {
                // A staircase: a larger set holds no more until it holds one more trajectory.
                line.push(self.place(point.mean_area_m2, before));
                line.push(self.place(point.mean_area_m2, point.coverage));
                before = point.coverage;
            }
        }
        if line.len() < 2 {
            return Ok(());
        }
        if family < self.featured {
            canvas.stroke(&line, SURFACE.mix(0.8), 5.0)?;
        }
        self.line(canvas, &line, family)
    }

    /// Where colours come again, lines are broken.
    fn line(&self, canvas: &Canvas<'_>, line: &[[f64; 2]], family: usize) -> Result<(), DrawError> {
        let (opacity, width) = if family < self.featured { (1.0, 2.6) } else { (0.8, 1.5) };
        let color = self.color(family).mix(opacity);
        if Self::comes_again(family) {
            canvas.broken(line, color, width, DASH)
        } else {
            canvas.stroke(line, color, width)
        }
    }

    fn comes_again(family: usize) -> bool {
        family >= COLORS.len()
    }

    fn rows(&self, family: usize) -> impl Iterator<Item = &ParetoRow> {
        let name = &self.found.curves[family].family;
        self.found.rows.iter().filter(move |row| row.family == *name)
    }

    fn marks(&self, canvas: &Canvas<'_>, family: usize) -> Result<(), DrawError> {
        for row in self.rows(family) {
            let ends = [row.coverage_low, row.coverage_high]
                .map(|coverage| self.place(row.mean_area_m2, coverage));
            canvas.stroke(&ends, self.color(family).mix(0.45), 1.2)?;
            self.mark(canvas, self.place(row.mean_area_m2, row.coverage), family)?;
        }
        Ok(())
    }

    /// A shape of its own for each family, hollow where colours come again: colour is not all
    /// that tells them apart.
    fn mark(&self, canvas: &Canvas<'_>, [x, y]: [f64; 2], family: usize) -> Result<(), DrawError> {
        let radius = if family < self.featured { 5.6 } else { 4.6 };
        // Corners, and by how many of eighths of a turn the first is from the right.
        let (corners, first, depth) = match family % 8 {
            0 => (24, 0.0, 1.0),
            1 => (4, 1.0, 1.0),
            2 => (3, 2.0, 1.0),
            3 => (4, 0.0, 1.0),
            4 => (3, -2.0, 1.0),
            5 => (10, 2.0, 0.45),
            6 => (8, 1.0, 0.4),
            _ => (6, 2.0, 1.0),
        };
        let shape = |radius: f64| -> Vec<[f64; 2]> {
            let corner = |i: u32| {
                let angle = first * TAU / 8.0 + f64::from(i) * TAU / f64::from(corners);
                let (sin, cos) = sin_cos(angle);
                let reach = if i % 2 == 1 { depth * radius } else { radius };
                [x + reach * cos, y - reach * sin]
            };
            (0..corners).map(corner).collect()
        };
        canvas.fill(&shape(radius + 1.6), SURFACE.mix(1.0))?;
        canvas.fill(&shape(radius), self.color(family).mix(1.0))?;
        if Self::comes_again(family) {
            // Hollow.
            canvas.fill(&shape(0.5 * radius), SURFACE.mix(1.0))?;
        }
        Ok(())
    }

    fn table(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let right = self.size()[0] - MARGIN;
        let column = |i: usize| right - (self.targets.len() - 1 - i) as f64 * COLUMN;
        let top = PLOT[2] - 12.0;
        canvas.text("mean area (m²) for", [right, top], 11.5, MUTED, Align::Right)?;
        for (i, target) in self.targets.iter().enumerate() {
            let text = format!("{target:.2}");
            canvas.bold(&text, [column(i), top + 20.0], 11.5, TEXT, Align::Right)?;
        }
        let line = top + 32.0;
        canvas.stroke(&[[TABLE, line], [right, line]], LINE.mix(1.0), 1.0)?;
        let mut y = line + 17.0;
        for family in 0..self.found.curves.len() {
            self.line(canvas, &[[TABLE, y], [TABLE + 24.0, y]], family)?;
            self.mark(canvas, [TABLE + 12.0, y], family)?;
            let name = &self.found.curves[family].family;
            let at = [TABLE + 31.0, y];
            if family < self.featured {
                canvas.bold(name, at, 11.5, TEXT, Align::Left)?;
            } else {
                canvas.text(name, at, 11.5, TEXT, Align::Left)?;
            }
            for row in self.rows(family) {
                let Some(i) = self.targets.iter().position(|target| *target == row.target) else {
                    continue;
                };
                let text = format!("{:.2}", row.mean_area_m2);
                canvas.text(&text, [column(i), y], 11.5, TEXT, Align::Right)?;
            }
            y += 24.0;
        }
        canvas.stroke(&[[TABLE, y - 7.0], [right, y - 7.0]], LINE.mix(1.0), 1.0)?;
        let what = format!(
            "Upright lines: {}% intervals of the coverage.",
            number(100.0 * self.found.confidence)
        );
        canvas.text(&what, [TABLE, y + 8.0], 10.5, MUTED, Align::Left)?;
        let guarantee = "Coverage holds on average over trajectories.";
        canvas.text(guarantee, [TABLE, y + 23.0], 10.5, MUTED, Align::Left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::png;
    use sidestep::math::{exp, ln};
    use sidestep::shfrs::pareto::{ParetoCurve, ParetoPoint};

    /// Families whose coverage grows with the area as (area / 5)^power.
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
    fn every_family_has_its_curve_its_marks_and_its_line_of_the_table() {
        let svg = pareto(&comparison(9), 2, "made-up families").unwrap();
        for family in 0..9 {
            assert_eq!(svg.matches(&format!("family {family}\n")).count(), 1);
        }
        assert_eq!(svg.matches("0.95\n").count(), 1);
        // A white and a coloured shape for each of 3 marks and the sign in the table; those of
        // the two families whose colours came before are hollow.
        assert_eq!(svg.matches("<polygon").count(), 9 * 4 * 2 + 2 * 4);
        assert!(svg.contains("made-up families") && svg.contains("#0072B2"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(png(&svg).unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn one_point_is_drawn_without_a_curve() {
        let mut found = comparison(1);
        found.curves[0].points.truncate(1);
        found.curves[0].points[0].coverage = 0.0;
        // Bold lines: the curve, and the sign in the table.
        let bold = |found| pareto(found, 1, "").unwrap().matches("stroke-width=\"52\"").count();
        assert_eq!((bold(&comparison(1)), bold(&found)), (2, 1));
    }
}
