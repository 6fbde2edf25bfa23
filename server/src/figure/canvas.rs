//! A page in pixels from its top left corner, on plotters' SVG backend.

use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    Circle, DrawingArea, IntoDrawingArea, IntoFont, IntoTextStyle, PathElement, Polygon, RGBAColor,
    RGBColor, SVGBackend, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, ShapeStyle};

// The tokens of static/style.css.
pub(super) const SURFACE: RGBColor = RGBColor(0xff, 0xff, 0xff);
pub(super) const LINE: RGBColor = RGBColor(0xe4, 0xe2, 0xdd);
pub(super) const GRID: RGBColor = RGBColor(0xef, 0xed, 0xea);
pub(super) const TEXT: RGBColor = RGBColor(0x1c, 0x1e, 0x22);
pub(super) const MUTED: RGBColor = RGBColor(0x6a, 0x6d, 0x73);
pub(super) const HUMAN: RGBColor = RGBColor(0x2d, 0x6f, 0xe0);
pub(super) const ROBOT: RGBColor = RGBColor(0xe0, 0x45, 0x3a);
pub(super) const REGIONS: [RGBColor; 5] = [
    RGBColor(0xe2, 0x50, 0x4a),
    RGBColor(0xe6, 0xbd, 0x3c),
    RGBColor(0x46, 0xa0, 0x63),
    RGBColor(0x44, 0x77, 0xd3),
    RGBColor(0x93, 0x67, 0xcf),
];

/// The first is in the fonts of this program; the others are for whoever lacks it.
const FONT: &str = "DejaVu Sans, Verdana, sans-serif";

/// plotters counts in whole numbers: this many to a pixel.
const FINE: f64 = 20.0;

/// What plotters' SVG backend divides font sizes by.
const FONT_SCALE: f64 = 1.24;

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw: {0}")]
pub struct DrawError(pub String);

/// Something to draw on; a point is [right, down] in pixels.
pub(super) struct Canvas<'a>(DrawingArea<SVGBackend<'a>, Shift>);

/// Where a text is, seen from its anchor.
#[derive(Clone, Copy)]
pub(super) enum Align {
    Left,
    Centre,
    Right,
}

/// The SVG of that size which `draw` draws.
pub(super) fn page(
    title: &str,
    [width, height]: [f64; 2],
    draw: impl FnOnce(&Canvas<'_>) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    let size = (fine(width) as u32, fine(height) as u32);
    let mut svg = String::new();
    {
        let canvas = Canvas(SVGBackend::with_string(&mut svg, size).into_drawing_area());
        canvas.0.fill(&SURFACE).map_err(failed)?;
        draw(&canvas)?;
        canvas.0.present().map_err(failed)?;
    }
    let fine_size = format!("<svg width=\"{}\" height=\"{}\"", size.0, size.1);
    let shown = format!("<svg role=\"img\" width=\"{width}\" height=\"{height}\"");
    let svg = svg.replacen(&fine_size, &shown, 1);
    let named = format!("xmlns=\"http://www.w3.org/2000/svg\">\n<title>{title}</title>");
    Ok(svg.replacen("xmlns=\"http://www.w3.org/2000/svg\">", &named, 1))
}

fn fine(pixels: f64) -> i32 {
    (pixels * FINE).round() as i32
}

fn at([x, y]: [f64; 2]) -> (i32, i32) {
    (fine(x), fine(y))
}

fn failed(error: impl std::fmt::Display) -> DrawError {
    DrawError(error.to_string())
}

impl Canvas<'_> {
    pub(super) fn fill(&self, points: &[[f64; 2]], color: RGBAColor) -> Result<(), DrawError> {
        let points: Vec<_> = points.iter().map(|p| at(*p)).collect();
        self.0.draw(&Polygon::new(points, color.filled())).map_err(failed)
    }

    pub(super) fn stroke(
        &self,
        points: &[[f64; 2]],
        color: RGBAColor,
        width: f64,
    ) -> Result<(), DrawError> {
        let points: Vec<_> = points.iter().map(|p| at(*p)).collect();
        self.0.draw(&PathElement::new(points, line(color, width))).map_err(failed)
    }

    /// A closed curve.
    pub(super) fn outline(
        &self,
        points: &[[f64; 2]],
        color: RGBAColor,
        width: f64,
    ) -> Result<(), DrawError> {
        // One segment again, so that the corner at the joint is like the others.
        let closed: Vec<_> = points.iter().chain(points.iter().take(2)).copied().collect();
        self.stroke(&closed, color, width)
    }

    /// A closed curve in dashes and gaps of `dash` pixels.
    pub(super) fn dashes(
        &self,
        points: &[[f64; 2]],
        color: RGBAColor,
        width: f64,
        dash: f64,
    ) -> Result<(), DrawError> {
        let closed: Vec<_> = points.iter().chain(points.first()).copied().collect();
        self.broken(&closed, color, width, dash)
    }

    /// A line in dashes and gaps of `dash` pixels.
    pub(super) fn broken(
        &self,
        points: &[[f64; 2]],
        color: RGBAColor,
        width: f64,
        dash: f64,
    ) -> Result<(), DrawError> {
        let mut gone = 0.0;
        let mut piece: Vec<[f64; 2]> = Vec::new();
        for (from, to) in points.iter().zip(points.iter().skip(1)) {
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let length = dx.hypot(dy);
            let parts = (4.0 * length / dash).ceil().max(1.0);
            for part in 0..parts as usize {
                let share = part as f64 / parts;
                let point = [from[0] + share * dx, from[1] + share * dy];
                if (gone / dash) % 2.0 < 1.0 {
                    piece.push(point);
                } else if !piece.is_empty() {
                    self.stroke(&piece, color, width)?;
                    piece.clear();
                }
                gone += length / parts;
            }
        }
        if piece.len() > 1 { self.stroke(&piece, color, width) } else { Ok(()) }
    }

    pub(super) fn disc(
        &self,
        centre: [f64; 2],
        radius: f64,
        color: RGBAColor,
    ) -> Result<(), DrawError> {
        self.0.draw(&Circle::new(at(centre), fine(radius), color.filled())).map_err(failed)
    }

    /// A line of text, centred vertically on its anchor.
    pub(super) fn text(
        &self,
        text: &str,
        point: [f64; 2],
        size: f64,
        color: RGBColor,
        align: Align,
    ) -> Result<(), DrawError> {
        self.write(text, point, (size, FontStyle::Normal), color, align)
    }

    pub(super) fn bold(
        &self,
        text: &str,
        point: [f64; 2],
        size: f64,
        color: RGBColor,
        align: Align,
    ) -> Result<(), DrawError> {
        self.write(text, point, (size, FontStyle::Bold), color, align)
    }

    fn write(
        &self,
        text: &str,
        [x, y]: [f64; 2],
        (size, style): (f64, FontStyle),
        color: RGBColor,
        align: Align,
    ) -> Result<(), DrawError> {
        let across = match align {
            Align::Left => HPos::Left,
            Align::Centre => HPos::Center,
            Align::Right => HPos::Right,
        };
        let font = (FONT, size * FONT_SCALE * FINE, style).into_font();
        let style = font.color(&color).into_text_style(&self.0).pos(Pos::new(across, VPos::Center));
        self.0.draw(&Text::new(text.to_owned(), at([x, y]), style)).map_err(failed)
    }

    /// An arrow of `length` pixels around `middle`, `angle` counter-clockwise from the right.
    pub(super) fn arrow(
        &self,
        middle: [f64; 2],
        angle: f64,
        length: f64,
        color: RGBColor,
    ) -> Result<(), DrawError> {
        let (sin, cos) = sidestep::math::sin_cos(angle);
        let place = |along: f64, aside: f64| {
            [
                middle[0] + length * (along * cos - aside * sin),
                middle[1] - length * (along * sin + aside * cos),
            ]
        };
        self.stroke(&[place(-0.5, 0.0), place(0.2, 0.0)], color.mix(1.0), 2.2)?;
        self.fill(&[place(0.5, 0.0), place(0.08, 0.24), place(0.08, -0.24)], color.mix(1.0))
    }

    /// A vehicle at `middle` that heads along `angle`, as the participant sees it.
    pub(super) fn vehicle(
        &self,
        middle: [f64; 2],
        angle: f64,
        length: f64,
        color: RGBColor,
    ) -> Result<(), DrawError> {
        let (sin, cos) = sidestep::math::sin_cos(angle);
        let place = |[along, aside]: [f64; 2]| {
            [
                middle[0] + length * (along * cos - aside * sin),
                middle[1] - length * (along * sin + aside * cos),
            ]
        };
        let shape = [[0.6, 0.0], [-0.4, 0.38], [-0.2, 0.0], [-0.4, -0.38]].map(place);
        self.fill(&shape, color.mix(1.0))
    }
}

fn line(color: RGBAColor, width: f64) -> ShapeStyle {
    color.stroke_width(fine(width) as u32)
}

/// About `most` round numbers between the ends.
pub(super) fn ticks(low: f64, high: f64, most: usize) -> Vec<f64> {
    let axis: RangedCoordf64 = (low..high).into();
    axis.key_points(most)
}

/// A tick's number, without digits that round numbers do not have.
pub(super) fn number(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    // Minus as typographers write it; no negative zero.
    if rounded < 0.0 { format!("−{}", -rounded) } else { format!("{}", rounded.abs()) }
}
