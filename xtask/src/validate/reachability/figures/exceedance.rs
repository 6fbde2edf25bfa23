//! How many states have a larger error than …

use anyhow::Result;

use super::canvas::{Axes, BLUE, GREEN, INK, ORANGE, Pen, Scale, legend, picture};
use crate::validate::reachability::report::Report;

pub(super) fn draw(report: &Report) -> Result<String> {
    picture([820, 396], |sheet| {
        let errors =
            [(1e-4, "0.1 mm"), (1e-3, "1 mm"), (1e-2, "1 cm"), (1e-1, "10 cm"), (1.0, "1 m")];
        let shares = [(1e-4, "0.01"), (1e-3, "0.1"), (1e-2, "1"), (1e-1, "10"), (1.0, "100")];
        let x = Scale::logarithmic((1e-4, 1.0), &errors, "error |V(polar) − V(closed form)|");
        let y = Scale::logarithmic((1e-4, 1.0), &shares, "states with a larger error, %");
        let axes = Axes::new(sheet, [76.0, 26.0, 590.0, 318.0], "", x, y)?;
        let colours = [("draft", ORANGE), ("standard", BLUE), ("fine", GREEN)];
        for polar in &report.polar {
            let colour = colours.iter().find(|(name, _)| *name == polar.accuracy);
            let colour = colour.map_or(ORANGE, |(_, colour)| *colour);
            let paper = polar.game == "paper";
            let pen = if paper { Pen::new(colour, 2.0) } else { Pen::dashed(colour, 2.0) };
            axes.line(&polar.exceedance, pen)?;
        }
        let [draft, standard, fine] = colours.map(|(_, colour)| Pen::new(colour, 2.0));
        let entries = [(draft, "draft"), (standard, "standard"), (fine, "fine")];
        legend(sheet, (692.0, 50.0), (0.0, 24.0), &entries)?;
        let games = [(Pen::new(INK, 1.5), "paper"), (Pen::dashed(INK, 1.5), "mitchell")];
        legend(sheet, (692.0, 146.0), (0.0, 24.0), &games)?;
        Ok(())
    })
}
