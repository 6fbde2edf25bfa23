//! {V = 0} in the evader's frame: whole, and enlarged around its farthest point.

use anyhow::Result;

use super::canvas::{Axes, BLUE, GREY, ORANGE, Pen, RGBColor, Scale, legend, picture};
use crate::validate::reachability::report::{Report, Slice};

/// Under the others, so wide that it shows on both sides of them.
const EXACT: Pen = Pen::new(RGBColor(176, 196, 214), 5.0);
const CARTESIAN: Pen = Pen::new(BLUE, 1.5);
const POLAR: Pen = Pen::dashed(ORANGE, 1.5);

pub(super) fn draw(report: &Report) -> Result<String> {
    let (width, height) = (247.0, 190.0);
    picture([930, 590], |sheet| {
        let entries = [
            (EXACT, "closed form"),
            (POLAR, "polar solver, standard"),
            (CARTESIAN, "Cartesian solver, WENO5, 51×40×50"),
        ];
        for (entry, left) in entries.iter().zip([150.0, 320.0, 550.0]) {
            legend(sheet, (left, 20.0), (0.0, 0.0), &[*entry])?;
        }
        for (i, slice) in report.slices.iter().enumerate() {
            let left = 56.0 + 307.0 * i as f64;
            let title = format!("ψ = {:.0}°", slice.psi_deg);
            let x = Scale::linear((-6.0, 20.0), 5.0, "x, m (ahead)");
            let y = Scale::linear((-10.0, 10.0), 5.0, "y, m (left)");
            let axes = Axes::new(sheet, [left, 66.0, width, height], &title, x, y)?;
            curves(&axes, slice)?;
            axes.evader()?;
            let (low, high) = window(slice.tip);
            axes.rectangle(low, high, Pen::new(GREY, 1.0))?;

            let x = Scale::linear((low.0, high.0), 0.5, "x, m");
            let y = Scale::linear((low.1, high.1), 0.5, "y, m");
            let axes = Axes::new(
                sheet,
                [left, 345.0, width, height],
                &format!("{title}, enlarged"),
                x,
                y,
            )?;
            curves(&axes, slice)?;
        }
        Ok(())
    })
}

/// 2.6 m × 2 m around a point, as the whole is 26 m × 20 m.
fn window((x, y): (f64, f64)) -> ((f64, f64), (f64, f64)) {
    let (x, y) = ((x * 10.0).round() / 10.0, (y * 10.0).round() / 10.0);
    ((x - 1.9, y - 1.0), (x + 0.7, y + 1.0))
}

fn curves(axes: &Axes<'_, '_>, slice: &Slice) -> Result<()> {
    axes.curves(&slice.exact, EXACT)?;
    axes.curves(&slice.cartesian, CARTESIAN)?;
    axes.curves(&slice.polar, POLAR)
}
