//! Renders a drawing as PNG, with the fonts of this program.

use super::DrawError;
use sidestep::chart::{Align, Drawing, Form, Ink, Pen, Point, Shape, Text, colours};
use tiny_skia::{
    Color, FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, StrokeDash,
    Transform,
};
use ttf_parser::{Face, OutlineBuilder};

/// Pixels per unit of the drawing.
const SCALE: f32 = 2.0;

/// Upper bound on the number of pixels, so that no picture exhausts the memory.
const MOST_PIXELS: f64 = 1e8;

/// Renders a drawing as PNG on a light background, at twice its size.
///
/// # Errors
/// [`DrawError`] if the picture is too large.
pub fn png(drawing: &Drawing) -> Result<Vec<u8>, DrawError> {
    let [width, height] = drawing.size.map(|length| (length * f64::from(SCALE)).ceil());
    let too_large = || DrawError("the picture is too large".to_owned());
    if !(1.0..=MOST_PIXELS).contains(&(width * height)) {
        return Err(too_large());
    }
    let mut pixmap = Pixmap::new(width as u32, height as u32).ok_or_else(too_large)?;
    pixmap.fill(colour(colours::SURFACE.into()));
    let fonts = Fonts {
        regular: face(include_bytes!("fonts/DejaVuSans.ttf"))?,
        bold: face(include_bytes!("fonts/DejaVuSans-Bold.ttf"))?,
    };
    for shape in &drawing.shapes {
        draw(&mut pixmap, &fonts, shape);
    }
    pixmap.encode_png().map_err(|e| DrawError(e.to_string()))
}

struct Fonts {
    regular: Face<'static>,
    bold: Face<'static>,
}

fn face(font: &'static [u8]) -> Result<Face<'static>, DrawError> {
    Face::parse(font, 0).map_err(|e| DrawError(e.to_string()))
}

fn draw(pixmap: &mut Pixmap, fonts: &Fonts, shape: &Shape) {
    let Some(path) = outline(&shape.form, fonts) else {
        return;
    };
    // The halo of text is drawn below the text. Any other stroke is drawn on top of the fill.
    let has_seam = matches!(&shape.form, Form::Text(text) if text.halo);
    if has_seam {
        stroke(pixmap, &path, Pen::new(colours::SURFACE, 3.0));
    }
    if let Some(ink) = shape.fill {
        // Anti-aliasing would make the background visible between adjacent rectangles.
        let paint = Paint { anti_alias: !matches!(shape.form, Form::Boxes(_)), ..paint(ink) };
        pixmap.fill_path(&path, &paint, FillRule::Winding, scale(), None);
    }
    if let Some(pen) = shape.stroke {
        stroke(pixmap, &path, pen);
    }
}

fn stroke(pixmap: &mut Pixmap, path: &Path, Pen { ink, width, dash, .. }: Pen) {
    let dash = dash.and_then(|lengths| StrokeDash::new(lengths.map(|l| l as f32).into(), 0.0));
    let line_join = LineJoin::Round;
    let stroke = Stroke { width: width as f32, line_join, dash, ..Stroke::default() };
    pixmap.stroke_path(path, &paint(ink), &stroke, scale(), None);
}

fn scale() -> Transform {
    Transform::from_scale(SCALE, SCALE)
}

fn paint(ink: Ink) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(colour(ink));
    paint
}

fn colour(ink: Ink) -> Color {
    let [r, g, b] = ink.colour.light;
    Color::from_rgba8(r, g, b, (255.0 * ink.opacity.clamp(0.0, 1.0)).round() as u8)
}

/// The path of a form. Returns `None` if the form has no extent or a coordinate is not finite.
fn outline(form: &Form, fonts: &Fonts) -> Option<Path> {
    let mut path = PathBuilder::new();
    let mut joined = |points: &[Point]| {
        for (i, &[x, y]) in points.iter().enumerate() {
            let (x, y) = (x as f32, y as f32);
            if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
    };
    match form {
        Form::Line(points) => joined(points),
        Form::Polygon(points) => {
            joined(points);
            path.close();
        }
        Form::Circle { centre: [x, y], radius } => {
            path.push_circle(*x as f32, *y as f32, *radius as f32);
        }
        Form::Boxes(boxes) => {
            for &[left, top, right, bottom] in boxes {
                let [left, top, right, bottom] = [left, top, right, bottom].map(|at| at as f32);
                path.push_rect(Rect::from_ltrb(left, top, right, bottom)?);
            }
        }
        Form::Text(text) => {
            write(text, if text.bold { &fonts.bold } else { &fonts.regular }, &mut path)
        }
    }
    path.finish()
}

/// Adds the outlines of a line of text. A missing glyph becomes the font's replacement glyph.
fn write(text: &Text, face: &Face<'_>, path: &mut PathBuilder) {
    let scale = text.size as f32 / f32::from(face.units_per_em());
    let glyphs: Vec<_> =
        text.text.chars().map(|c| face.glyph_index(c).unwrap_or_default()).collect();
    let advance = |glyph| scale * f32::from(face.glyph_hor_advance(glyph).unwrap_or_default());
    let width: f32 = glyphs.iter().map(|glyph| advance(*glyph)).sum();
    let before = match text.align {
        Align::Left => 0.0,
        Align::Centre => 0.5 * width,
        Align::Right => width,
    };
    let at = [text.at[0] as f32 - before, text.base_line() as f32];
    let mut pen = GlyphPen { path, scale, at };
    for glyph in glyphs {
        face.outline_glyph(glyph, &mut pen);
        pen.at[0] += advance(glyph);
    }
}

/// Converts a font's units (y upwards) to the drawing's pixels (y downwards).
struct GlyphPen<'a> {
    path: &'a mut PathBuilder,
    scale: f32,
    at: [f32; 2],
}

impl GlyphPen<'_> {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        (self.at[0] + self.scale * x, self.at[1] - self.scale * y)
    }
}

impl OutlineBuilder for GlyphPen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.place(x1, y1), self.place(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) =
            (self.place(x1, y1), self.place(x2, y2), self.place(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_png(drawing: &Drawing) -> bool {
        png(drawing).is_ok_and(|bytes| bytes.starts_with(b"\x89PNG"))
    }

    #[test]
    fn every_form_is_drawn() {
        let mut drawing = Drawing::new("", "", [60.0, 40.0]);
        let empty = png(&drawing).unwrap();
        drawing.text("ψ ≤ ½ 文", [30.0, 10.0], 12.0, colours::TEXT, Align::Centre);
        drawing.with_halo();
        let with_text = png(&drawing).unwrap();
        drawing.boxes(vec![[0.0, 20.0, 5.0, 25.0]], colours::MAP);
        drawing.circle([20.0, 30.0], 4.0, Some(colours::HUMAN.into()), None);
        drawing.line([[30.0, 30.0], [50.0, 35.0]], Pen::new(colours::ROBOT, 1.0).dashed(3.0, 2.0));
        let all = png(&drawing).unwrap();
        assert!(empty.len() < with_text.len() && with_text.len() < all.len());
        assert!(is_png(&drawing));
    }

    #[test]
    fn a_picture_without_size_or_too_large_is_refused() {
        for size in [[0.0, 10.0], [1e6, 1e6], [f64::NAN, 1.0]] {
            assert!(!is_png(&Drawing::new("", "", size)), "{size:?}");
        }
    }
}
