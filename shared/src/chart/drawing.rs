//! Drawings: lines, areas and text in pixels from the top left corner.

use super::colours::{Colour, Ink, SURFACE};
use crate::math::sin_cos;

/// A point: [right, down] (px) in a drawing, or [x, y] in the units of a chart's axes.
pub type Point = [f64; 2];

/// Style of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Its colour.
    pub ink: Ink,
    /// Width (px).
    pub width: f64,
    /// Lengths of dashes and gaps (px); `None` for a solid line.
    pub dash: Option<[f64; 2]>,
    /// Width of the halo in the background colour on each side of the line (px).
    pub halo: f64,
}

impl Pen {
    /// A solid pen.
    #[must_use]
    pub fn new(ink: impl Into<Ink>, width: f64) -> Self {
        Self { ink: ink.into(), width, dash: None, halo: 0.0 }
    }

    /// This pen with dashes and gaps of these lengths (px).
    #[must_use]
    pub const fn dashed(self, dash: f64, gap: f64) -> Self {
        Self { dash: Some([dash, gap]), ..self }
    }

    /// This pen with a halo of this width (px), which keeps the line visible on any background.
    #[must_use]
    pub const fn halo(self, width: f64) -> Self {
        Self { halo: width, ..self }
    }
}

/// Alignment of a line of text at its anchor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The text begins at the anchor.
    Left,
    /// The text is centred at the anchor.
    Centre,
    /// The text ends at the anchor.
    Right,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// The text.
    pub text: String,
    /// Its anchor, at half the cap height.
    pub at: Point,
    /// Font size (px).
    pub size: f64,
    /// Whether it is bold.
    pub bold: bool,
    /// Alignment at the anchor.
    pub align: Align,
    /// Whether a halo in the background colour separates the text from lines below it.
    pub halo: bool,
}

impl Text {
    /// y of the baseline (px).
    #[must_use]
    pub fn base_line(&self) -> f64 {
        self.at[1] + 0.365 * self.size
    }
}

/// The geometry of a shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// A polyline.
    Line(Vec<Point>),
    /// A closed curve; the last point joins the first one.
    Polygon(Vec<Point>),
    /// A circle.
    Circle {
        /// Its centre.
        centre: Point,
        /// Radius (px).
        radius: f64,
    },
    /// Axis-aligned rectangles without gaps between neighbours: left, top, right, bottom.
    Boxes(Vec<[f64; 4]>),
    /// A line of text.
    Text(Text),
}

/// A shape in a drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Its geometry.
    pub form: Form,
    /// Fill colour, if any.
    pub fill: Option<Ink>,
    /// Style of its edge, if any.
    pub stroke: Option<Pen>,
    /// Tooltip; may be empty.
    pub says: String,
}

/// A picture: shapes from bottom to top.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Width and height (px).
    pub size: [f64; 2],
    /// Its title.
    pub title: String,
    /// Description for screen readers; may be empty.
    pub description: String,
    /// The shapes.
    pub shapes: Vec<Shape>,
}

impl Drawing {
    /// An empty drawing.
    #[must_use]
    pub fn new(title: &str, description: &str, size: [f64; 2]) -> Self {
        let (title, description) = (title.to_owned(), description.to_owned());
        Self { size, title, description, shapes: Vec::new() }
    }

    fn add(&mut self, form: Form, fill: Option<Ink>, stroke: Option<Pen>) -> &mut Shape {
        if let Some(pen) = stroke.filter(|pen| pen.halo > 0.0) {
            let seam = Pen::new(SURFACE.at(0.8), pen.width + 2.0 * pen.halo);
            let shape =
                Shape { form: form.clone(), fill: None, stroke: Some(seam), says: String::new() };
            self.shapes.push(shape);
        }
        self.shapes.push(Shape { form, fill, stroke, says: String::new() });
        let last = self.shapes.len() - 1;
        &mut self.shapes[last]
    }

    /// A polyline.
    pub fn line(&mut self, points: impl Into<Vec<Point>>, pen: Pen) {
        let points = points.into();
        if points.len() > 1 {
            self.add(Form::Line(points), None, Some(pen));
        }
    }

    /// A closed curve.
    pub fn polygon(&mut self, points: impl Into<Vec<Point>>, fill: Option<Ink>, edge: Option<Pen>) {
        let points = points.into();
        if points.len() > 1 {
            self.add(Form::Polygon(points), fill, edge);
        }
    }

    /// A circle.
    pub fn circle(&mut self, centre: Point, radius: f64, fill: Option<Ink>, edge: Option<Pen>) {
        self.add(Form::Circle { centre, radius }, fill, edge);
    }

    /// Axis-aligned rectangles: left, top, right, bottom.
    pub fn boxes(&mut self, boxes: Vec<[f64; 4]>, ink: impl Into<Ink>) {
        if !boxes.is_empty() {
            self.add(Form::Boxes(boxes), Some(ink.into()), None);
        }
    }

    /// A line of text whose capitals are vertically centred on the anchor.
    pub fn text(&mut self, text: &str, at: Point, size: f64, ink: impl Into<Ink>, align: Align) {
        self.words(text, at, size, ink, align, false);
    }

    /// Like [`Drawing::text`], but in bold.
    pub fn bold(&mut self, text: &str, at: Point, size: f64, ink: impl Into<Ink>, align: Align) {
        self.words(text, at, size, ink, align, true);
    }

    fn words(
        &mut self,
        text: &str,
        at: Point,
        size: f64,
        ink: impl Into<Ink>,
        align: Align,
        bold: bool,
    ) {
        if !text.is_empty() {
            let text = Text { text: text.to_owned(), at, size, bold, align, halo: false };
            self.add(Form::Text(text), Some(ink.into()), None);
        }
    }

    /// Gives the last shape a halo if it is text.
    pub fn with_halo(&mut self) {
        if let Some(Shape { form: Form::Text(text), .. }) = self.shapes.last_mut() {
            text.halo = true;
        }
    }

    /// Gives the last shape a tooltip.
    pub fn saying(&mut self, says: &str) {
        if let Some(shape) = self.shapes.last_mut() {
            says.clone_into(&mut shape.says);
        }
    }

    /// A vehicle in the shape that participants see. `angle` (rad) is counter-clockwise from the
    /// right.
    pub fn vehicle(&mut self, middle: Point, angle: f64, length: f64, colour: Colour) {
        let shape = [[0.6, 0.0], [-0.4, 0.38], [-0.2, 0.0], [-0.4, -0.38]];
        let points = turned(&shape, middle, angle, length);
        self.polygon(points, Some(colour.into()), None);
    }

    /// An arrow centred at `middle`. `angle` (rad) is counter-clockwise from the right.
    pub fn arrow(&mut self, middle: Point, angle: f64, length: f64, colour: Colour) {
        self.line(turned(&[[-0.5, 0.0], [0.2, 0.0]], middle, angle, length), Pen::new(colour, 2.2));
        let head = turned(&[[0.5, 0.0], [0.08, 0.24], [0.08, -0.24]], middle, angle, length);
        self.polygon(head, Some(colour.into()), None);
    }

    /// Adds all shapes of another drawing, with its top left corner at `corner`.
    pub fn place(&mut self, other: &Self, corner: Point) {
        let moved = |[x, y]: Point| [x + corner[0], y + corner[1]];
        self.shapes.extend(other.shapes.iter().cloned().map(|mut shape| {
            match &mut shape.form {
                Form::Line(points) | Form::Polygon(points) => {
                    points.iter_mut().for_each(|point| *point = moved(*point));
                }
                Form::Circle { centre, .. } => *centre = moved(*centre),
                Form::Boxes(boxes) => {
                    for [left, top, right, bottom] in boxes {
                        [*left, *top] = moved([*left, *top]);
                        [*right, *bottom] = moved([*right, *bottom]);
                    }
                }
                Form::Text(text) => text.at = moved(text.at),
            }
            shape
        }));
    }
}

/// Scales, rotates and moves a shape of length 1 that is given by points [along, aside].
fn turned(shape: &[Point], middle: Point, angle: f64, length: f64) -> Vec<Point> {
    let (sin, cos) = sin_cos(angle);
    let place = |&[along, aside]: &Point| {
        [
            middle[0] + length * (along * cos - aside * sin),
            middle[1] - length * (along * sin + aside * cos),
        ]
    };
    shape.iter().map(place).collect()
}
