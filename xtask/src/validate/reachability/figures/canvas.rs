//! A sheet of white paper, and axes with lines, dots and words in them.

use anyhow::{Context, Result};
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
pub(super) use plotters::prelude::RGBColor;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::validate::reachability::report::Curve;

/// Units of the drawing to a pixel.
const FINE: i32 = 4;

/// Black that is easy on the eye, for words and axes.
pub(super) const INK: RGBColor = RGBColor(36, 41, 47);
pub(super) const GREY: RGBColor = RGBColor(110, 119, 129);
const GRID: RGBColor = RGBColor(226, 230, 235);

// Okabe and Ito (2008): told apart by nearly everyone.
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const ORANGE: RGBColor = RGBColor(213, 94, 0);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const PURPLE: RGBColor = RGBColor(170, 76, 143);

const FONT: &str = "system-ui, -apple-system, Segoe UI, Helvetica, Arial, sans-serif";

/// A part of the sheet.
pub(super) type Sheet<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// An SVG of `width` by `height` pixels.
pub(super) fn picture(
    [width, height]: [i32; 2],
    draw: impl FnOnce(&Sheet<'_>) -> Result<()>,
) -> Result<String> {
    let mut svg = String::new();
    let [w, h] = [width, height].map(|pixels| (pixels * FINE) as u32);
    let sheet = SVGBackend::with_string(&mut svg, (w, h)).into_drawing_area();
    sheet.fill(&WHITE)?;
    draw(&sheet)?;
    sheet.present()?;
    drop(sheet);
    // Rectangles side by side must not show the paper between them.
    let style = "<style>rect{shape-rendering:crispEdges}</style>";
    let head = format!("width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {w} {h}\"");
    let (_, rest) = svg.split_once(">\n").context("the backend begins with the element svg")?;
    Ok(format!("<svg {head} xmlns=\"http://www.w3.org/2000/svg\">\n{style}\n{rest}"))
}

/// How a line is drawn.
#[derive(Clone, Copy)]
pub(super) struct Pen {
    pub(super) colour: RGBColor,
    pub(super) width: f64,
    pub(super) dashed: bool,
}

impl Pen {
    pub(super) const fn new(colour: RGBColor, width: f64) -> Self {
        Self { colour, width, dashed: false }
    }

    pub(super) const fn dashed(colour: RGBColor, width: f64) -> Self {
        Self { colour, width, dashed: true }
    }

    fn style(self) -> ShapeStyle {
        self.colour.stroke_width((self.width * f64::from(FINE)).round() as u32)
    }
}

/// Where words stand relative to their point.
#[derive(Clone, Copy)]
pub(super) enum Side {
    Left,
    Middle,
    Right,
}

/// An axis: from where to where, its ticks with their words, and what it shows.
pub(super) struct Scale {
    ends: (f64, f64),
    logarithmic: bool,
    ticks: Vec<(f64, String)>,
    title: String,
}

impl Scale {
    pub(super) fn linear(ends: (f64, f64), step: f64, title: &str) -> Self {
        let places = usize::from(step.fract() != 0.0);
        let first = (ends.0 / step - 1e-9).ceil() as i64;
        let last = (ends.1 / step + 1e-9).floor() as i64;
        let tick = |i: i64| i as f64 * step;
        let words = |at: f64| format!("{at:.places$}").replace('-', "−");
        let ticks = (first..=last).map(|i| (tick(i), words(tick(i)))).collect();
        Self { ends, logarithmic: false, ticks, title: title.to_owned() }
    }

    /// Ticks where it is said.
    pub(super) fn logarithmic(ends: (f64, f64), ticks: &[(f64, &str)], title: &str) -> Self {
        let ticks = ticks.iter().map(|(at, words)| (*at, (*words).to_owned())).collect();
        Self { ends, logarithmic: true, ticks, title: title.to_owned() }
    }

    /// 0 … 1 between the ends.
    fn share(&self, at: f64) -> f64 {
        let place = |at: f64| if self.logarithmic { at.log10() } else { at };
        let (low, high) = (place(self.ends.0), place(self.ends.1));
        (place(at) - low) / (high - low)
    }
}

/// Axes around a rectangle of the sheet.
pub(super) struct Axes<'a, 'b> {
    sheet: &'a Sheet<'b>,
    /// Left, top, width and height of the rectangle.
    frame: [f64; 4],
    x: Scale,
    y: Scale,
}

impl<'a, 'b> Axes<'a, 'b> {
    /// Draws ticks, grid and titles.
    pub(super) fn new(
        sheet: &'a Sheet<'b>,
        frame: [f64; 4],
        title: &str,
        x: Scale,
        y: Scale,
    ) -> Result<Self> {
        let axes = Self { sheet, frame, x, y };
        let [left, top, width, height] = frame;
        let (right, bottom) = (left + width, top + height);
        for (at, words) in &axes.x.ticks {
            let x = left + axes.x.share(*at) * width;
            stroke(sheet, &[(x, top), (x, bottom)], Pen::new(GRID, 0.75))?;
            write(sheet, (x, bottom + 13.0), words, 11.5, INK, Side::Middle)?;
        }
        for (at, words) in &axes.y.ticks {
            let y = bottom - axes.y.share(*at) * height;
            stroke(sheet, &[(left, y), (right, y)], Pen::new(GRID, 0.75))?;
            write(sheet, (left - 6.0, y), words, 11.5, INK, Side::Left)?;
        }
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        stroke(sheet, &corners, Pen::new(GREY, 1.0))?;
        let middle = left + 0.5 * width;
        write(sheet, (middle, bottom + 31.0), &axes.x.title, 12.5, INK, Side::Middle)?;
        write(sheet, (middle, top - 13.0), title, 13.5, INK, Side::Middle)?;
        let upright = words(12.5, INK, Side::Middle).transform(FontTransform::Rotate270);
        let at = units((left - 40.0, top + 0.5 * height));
        sheet.draw_text(&axes.y.title, &upright, at)?;
        Ok(axes)
    }

    /// Pixels of a point.
    pub(super) fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let [left, top, width, height] = self.frame;
        (left + self.x.share(x) * width, top + (1.0 - self.y.share(y)) * height)
    }

    /// The part of a line that is within the frame.
    pub(super) fn line(&self, points: &[(f64, f64)], pen: Pen) -> Result<()> {
        let placed: Vec<_> = points.iter().map(|point| self.place(*point)).collect();
        for piece in clipped(&placed, self.frame) {
            stroke(self.sheet, &piece, pen)?;
        }
        Ok(())
    }

    /// Closed curves.
    pub(super) fn curves(&self, curves: &[Curve], pen: Pen) -> Result<()> {
        for curve in curves {
            let closed: Vec<_> = curve.iter().chain(curve.first()).copied().collect();
            self.line(&closed, pen)?;
        }
        Ok(())
    }

    pub(super) fn dot(&self, point: (f64, f64), colour: RGBColor) -> Result<()> {
        let at = units(self.place(point));
        self.sheet.draw(&Circle::new(at, 3.2 * f64::from(FINE), colour.filled()))?;
        Ok(())
    }

    /// A filled rectangle between two opposite corners.
    pub(super) fn fill(&self, a: (f64, f64), b: (f64, f64), colour: RGBColor) -> Result<()> {
        let [a, b] = [a, b].map(|corner| units(self.place(corner)));
        self.sheet.draw(&Rectangle::new([a, b], colour.filled()))?;
        Ok(())
    }

    pub(super) fn rectangle(&self, a: (f64, f64), b: (f64, f64), pen: Pen) -> Result<()> {
        self.line(&[a, (b.0, a.1), b, (a.0, b.1), a], pen)
    }

    /// Words, so many pixels to the right of a point and below it.
    pub(super) fn say(
        &self,
        point: (f64, f64),
        (right, below): (f64, f64),
        words: &str,
        colour: RGBColor,
        side: Side,
    ) -> Result<()> {
        let (x, y) = self.place(point);
        write(self.sheet, (x + right, y + below), words, 12.0, colour, side)
    }

    /// An arrow head at the origin, heading along x: the evader.
    pub(super) fn evader(&self) -> Result<()> {
        let (x, y) = self.place((0.0, 0.0));
        let corners = [(9.0, 0.0), (-5.0, -5.0), (-2.0, 0.0), (-5.0, 5.0)];
        let corners = corners.map(|(dx, dy)| units((x + dx, y + dy)));
        self.sheet.draw(&Polygon::new(corners.to_vec(), INK.filled()))?;
        Ok(())
    }
}

/// A legend: samples of lines with words, downwards from a point.
pub(super) fn legend(
    sheet: &Sheet<'_>,
    (left, top): (f64, f64),
    apart: (f64, f64),
    entries: &[(Pen, &str)],
) -> Result<()> {
    for (i, (pen, words)) in entries.iter().enumerate() {
        let (x, y) = (left + apart.0 * i as f64, top + apart.1 * i as f64);
        stroke(sheet, &[(x, y), (x + 28.0, y)], *pen)?;
        write(sheet, (x + 36.0, y), words, 12.5, INK, Side::Right)?;
    }
    Ok(())
}

/// Words at a point of the sheet, centred vertically.
pub(super) fn write(
    sheet: &Sheet<'_>,
    at: (f64, f64),
    text: &str,
    size: f64,
    colour: RGBColor,
    side: Side,
) -> Result<()> {
    sheet.draw_text(text, &words(size, colour, side), units(at))?;
    Ok(())
}

fn words(size: f64, colour: RGBColor, side: Side) -> TextStyle<'static> {
    let horizontal = match side {
        Side::Left => HPos::Right,
        Side::Middle => HPos::Center,
        Side::Right => HPos::Left,
    };
    // The backend takes sizes for those of a line, 1.24 times a letter's.
    let font = (FONT, size * 1.24 * f64::from(FINE)).into_font();
    font.color(&colour).pos(Pos::new(horizontal, VPos::Center))
}

fn stroke(sheet: &Sheet<'_>, points: &[(f64, f64)], pen: Pen) -> Result<()> {
    let mut placed: Vec<_> = points.iter().map(|point| units(*point)).collect();
    placed.dedup();
    if pen.dashed {
        let (dash, gap) = (5 * FINE, 4 * FINE);
        sheet.draw(&DashedPathElement::new(placed, dash, gap, pen.style()))?;
    } else {
        sheet.draw(&PathElement::new(placed, pen.style()))?;
    }
    Ok(())
}

fn units((x, y): (f64, f64)) -> (i32, i32) {
    let unit = |pixels: f64| (pixels * f64::from(FINE)).round() as i32;
    (unit(x), unit(y))
}

/// The pieces of a line that lie in a rectangle (left, top, width, height).
fn clipped(line: &[(f64, f64)], [left, top, width, height]: [f64; 4]) -> Vec<Curve> {
    let mut pieces: Vec<Curve> = Vec::new();
    for ends in line.windows(2) {
        let (from, to) = (ends[0], ends[1]);
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        // Liang and Barsky: shares of the way at which it enters and leaves each side.
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for (speed, room) in [
            (-dx, from.0 - left),
            (dx, left + width - from.0),
            (-dy, from.1 - top),
            (dy, top + height - from.1),
        ] {
            if speed < 0.0 {
                enters = enters.max(room / speed);
            } else if speed > 0.0 {
                leaves = leaves.min(room / speed);
            } else if room < 0.0 {
                leaves = -1.0;
            }
        }
        if enters > leaves {
            continue;
        }
        let at = |share: f64| (from.0 + share * dx, from.1 + share * dy);
        match pieces.last_mut() {
            Some(piece) if enters == 0.0 && piece.last() == Some(&from) => piece.push(at(leaves)),
            _ => pieces.push(vec![at(enters), at(leaves)]),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_at_the_frame() {
        let frame = [0.0, 0.0, 10.0, 10.0];
        let inside = [(1.0, 1.0), (5.0, 5.0), (9.0, 1.0)];
        assert_eq!(clipped(&inside, frame), [inside.to_vec()]);
        // Out on the right and in again from above.
        let line = [(5.0, 5.0), (15.0, 5.0), (15.0, -5.0), (5.0, -5.0), (5.0, 5.0)];
        let pieces = clipped(&line, frame);
        assert_eq!(pieces, [vec![(5.0, 5.0), (10.0, 5.0)], vec![(5.0, 0.0), (5.0, 5.0)]]);
        assert!(clipped(&[(-1.0, -5.0), (-1.0, 15.0)], frame).is_empty());
        assert_eq!(clipped(&[(-5.0, 3.0), (15.0, 3.0)], frame), [[(0.0, 3.0), (10.0, 3.0)]]);
    }

    #[test]
    fn scales_have_ticks_within_their_ends() {
        let scale = Scale::linear((-6.0, 20.0), 5.0, "x, m");
        let words: Vec<_> = scale.ticks.iter().map(|tick| tick.1.as_str()).collect();
        assert_eq!(words, ["−5", "0", "5", "10", "15", "20"]);
        let scale = Scale::logarithmic((1e-3, 1e1), &[(0.1, "0.1")], "error, m");
        assert!((scale.share(0.1) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_picture_is_drawn_finely_and_shown_at_its_size() {
        let svg = picture([120, 80], |sheet| {
            let x = Scale::linear((0.0, 1.0), 0.5, "x, m");
            let y = Scale::linear((0.0, 1.0), 0.5, "y & z, m");
            let axes = Axes::new(sheet, [20.0, 20.0, 80.0, 40.0], "title", x, y)?;
            axes.line(&[(0.0, 0.0), (1.0, 1.0)], Pen::new(BLUE, 1.5))
        });
        let svg = svg.expect("a string can be drawn on");
        let head = "<svg width=\"120\" height=\"80\" viewBox=\"0 0 480 320\"";
        assert!(svg.starts_with(head), "{svg}");
        assert!(svg.ends_with("</svg>\n") && svg.contains("y &amp; z, m"), "{svg}");
        // From the left lower corner of the frame to the right upper one.
        assert!(svg.contains("points=\"80,240 400,80 \""), "{svg}");
    }
}
