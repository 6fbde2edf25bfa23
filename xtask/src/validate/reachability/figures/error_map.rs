//! Where the errors are: a map with a colour bar.

use anyhow::Result;

use super::canvas::{Axes, INK, Pen, RGBColor, Scale, Sheet, Side, picture, write};
use crate::validate::reachability::report::{ErrorMap, Report};

/// Errors above this, m, have this colour.
const LEVELS: [(f64, RGBColor); 7] = [
    (0.0, RGBColor(247, 246, 242)),
    (0.001, RGBColor(253, 226, 182)),
    (0.002, RGBColor(253, 187, 120)),
    (0.005, RGBColor(239, 118, 84)),
    (0.01, RGBColor(203, 60, 88)),
    (0.02, RGBColor(130, 30, 110)),
    (0.05, RGBColor(45, 10, 70)),
];

pub(super) fn draw(report: &Report) -> Result<String> {
    let map = &report.error_map;
    picture([930, 636], |sheet| {
        let x = Scale::linear((-6.0, 15.0), 2.0, "x, m (ahead)");
        let y = Scale::linear((-8.0, 8.0), 2.0, "y, m (left)");
        let axes = Axes::new(sheet, [62.0, 20.0, 735.0, 560.0], "", x, y)?;
        // Level upon level, so that no white shows between neighbours.
        for (level, colour) in LEVELS {
            for [row, from, to] in runs(map, level) {
                let corner = |column: usize, row: usize| {
                    let at = |origin: f64, i: usize| origin + map.cell_m * (i as f64 - 0.5);
                    (at(map.origin.0, column), at(map.origin.1, row))
                };
                axes.fill(corner(from, row), corner(to, row + 1), colour)?;
            }
        }
        axes.curves(&map.zero, Pen::new(INK, 1.3))?;
        axes.say((13.1, 0.0), (8.0, -12.0), "V = 0", INK, Side::Right)?;
        axes.evader()?;
        bar(sheet)
    })
}

/// Row, first column and the one after the last of each stretch of errors above `level`.
fn runs(map: &ErrorMap, level: f64) -> Vec<[usize; 3]> {
    let mut runs = Vec::new();
    for (j, row) in map.rows.iter().enumerate() {
        let mut from = None;
        for i in 0..=row.len() {
            let inside = row.get(i).is_some_and(|error| *error >= level);
            match (inside, from) {
                (true, None) => from = Some(i),
                (false, Some(start)) => {
                    runs.push([j, start, i]);
                    from = None;
                }
                _ => {}
            }
        }
    }
    runs
}

fn bar(sheet: &Sheet<'_>) -> Result<()> {
    let (left, top, height) = (830.0, 60.0, 490.0);
    let each = height / LEVELS.len() as f64;
    let scale = || Scale::logarithmic((1.0, 10.0), &[], "");
    let axes = Axes::new(sheet, [left, top, 22.0, height], "", scale(), scale())?;
    write(sheet, (left + 11.0, top - 18.0), "|error|, cm", 12.5, INK, Side::Middle)?;
    for (i, (level, colour)) in LEVELS.iter().enumerate() {
        let share = |i: usize| 10_f64.powf(i as f64 / LEVELS.len() as f64);
        axes.fill((1.0, share(i)), (10.0, share(i + 1)), *colour)?;
        let bottom = top + height - each * i as f64;
        let words = format!("{}", (level * 1000.0).round() / 10.0);
        write(sheet, (left + 30.0, bottom), &words, 11.5, INK, Side::Right)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_a_level_are_one_rectangle() {
        let rows = vec![vec![0.0, 0.02, 0.03, 0.0, 0.5], vec![0.0; 5]];
        let map = ErrorMap { origin: (0.0, 0.0), cell_m: 0.1, rows, zero: vec![] };
        assert_eq!(runs(&map, 0.01), [[0, 1, 3], [0, 4, 5]]);
        assert_eq!(runs(&map, 0.0), [[0, 0, 5], [1, 0, 5]]);
    }
}
