//! Lines, areas and words in pixels from the top left corner.

use super::colours::{Colour, Ink, SURFACE};
use crate::math::sin_cos;

/// [right, down], px; in a chart's own units [x, y].
pub type Point = [f64; 2];

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Its colour.
    pub ink: Ink,
    /// px.
    pub width: f64,
    /// Lengths of dashes and of gaps, px.
    pub dash: Option<[f64; 2]>,
    /// How far a seam in the colour of the surface shows on both sides of the line, px.
    pub halo: f64,
}

impl Pen {
    /// A solid line.
    #[must_use]
    pub fn new(ink: impl Into<Ink>, width: f64) -> Self {
        Self { ink: ink.into(), width, dash: None, halo: 0.0 }
    }

    /// In dashes and gaps of these lengths, px.
    #[must_use]
    pub const fn dashed(self, dash: f64, gap: f64) -> Self {
        Self { dash: Some([dash, gap]), ..self }
    }

    /// With a seam of that width, px, so that it shows on any ground.
    #[must_use]
    pub const fn halo(self, width: f64) -> Self {
        Self { halo: width, ..self }
    }
}

/// Which end of a line of text is at its anchor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The text begins there.
    Left,
    /// The text's middle is there.
    Centre,
    /// The text ends there.
    Right,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// What it says.
    pub text: String,
    /// Its anchor, at half the height of its capitals.
    pub at: Point,
    /// px.
    pub size: f64,
    /// Bold or regular.
    pub bold: bool,
    /// Which end is at the anchor.
    pub align: Align,
    /// Whether a seam in the colour of the surface parts it from lines below.
    pub halo: bool,
}

impl Text {
    /// How far below its anchor the base line is, px.
    #[must_use]
    pub fn base_line(&self) -> f64 {
        self.at[1] + 0.365 * self.size
    }
}

/// The form of something drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// A line through points.
    Line(Vec<Point>),
    /// A closed curve; the last point joins the first one.
    Polygon(Vec<Point>),
    /// A circle.
    Circle {
        /// Its centre.
        centre: Point,
        /// px.
        radius: f64,
    },
    /// Upright rectangles without a seam between neighbours: left, top, right, bottom.
    Boxes(Vec<[f64; 4]>),
    /// Words.
    Text(Text),
}

/// Something drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Its form.
    pub form: Form,
    /// What fills it.
    pub fill: Option<Ink>,
    /// How its edge is drawn.
    pub stroke: Option<Pen>,
    /// What appears under a pointer; empty for nothing.
    pub says: String,
}

/// A picture: shapes, the first one at the bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Width and height, px.
    pub size: [f64; 2],
    /// Its name.
    pub title: String,
    /// What it shows, for readers who do not see it; may be empty.
    pub description: String,
    /// What is drawn.
    pub shapes: Vec<Shape>,
}

impl Drawing {
    /// An empty one.
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

    /// A line through points.
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

    /// Upright rectangles: left, top, right, bottom.
    pub fn boxes(&mut self, boxes: Vec<[f64; 4]>, ink: impl Into<Ink>) {
        if !boxes.is_empty() {
            self.add(Form::Boxes(boxes), Some(ink.into()), None);
        }
    }

    /// A line of text, its capitals centred on the anchor.
    pub fn text(&mut self, text: &str, at: Point, size: f64, ink: impl Into<Ink>, align: Align) {
        self.words(text, at, size, ink, align, false);
    }

    /// Likewise in bold.
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

    /// Lets the last text stand out from the lines below it.
    pub fn with_halo(&mut self) {
        if let Some(Shape { form: Form::Text(text), .. }) = self.shapes.last_mut() {
            text.halo = true;
        }
    }

    /// Lets the last shape say something under a pointer.
    pub fn saying(&mut self, says: &str) {
        if let Some(shape) = self.shapes.last_mut() {
            says.clone_into(&mut shape.says);
        }
    }

    /// A vehicle, as participants see it. `angle` is counter-clockwise from the right.
    pub fn vehicle(&mut self, middle: Point, angle: f64, length: f64, colour: Colour) {
        let shape = [[0.6, 0.0], [-0.4, 0.38], [-0.2, 0.0], [-0.4, -0.38]];
        let points = turned(&shape, middle, angle, length);
        self.polygon(points, Some(colour.into()), None);
    }

    /// An arrow around `middle`. `angle` is counter-clockwise from the right.
    pub fn arrow(&mut self, middle: Point, angle: f64, length: f64, colour: Colour) {
        self.line(turned(&[[-0.5, 0.0], [0.2, 0.0]], middle, angle, length), Pen::new(colour, 2.2));
        let head = turned(&[[0.5, 0.0], [0.08, 0.24], [0.08, -0.24]], middle, angle, length);
        self.polygon(head, Some(colour.into()), None);
    }

    /// Everything of another drawing, its top left corner at `corner`.
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

/// Points [along, aside] of a shape of length 1 that points along `angle`.
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
