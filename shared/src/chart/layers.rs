//! What stands between the axes, in their units.

use super::colours::{Colour, Ink};
use super::drawing::{Align, Drawing, Pen, Point};
use crate::math::{TAU, sin_cos};

/// A layer of a chart; later ones cover earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer {
    /// Points joined by a line, marked, or both.
    Series(Series),
    /// Many numbers for each category.
    Swarm(Swarm),
    /// A closed curve.
    Area(Area),
    /// Cells of a map in one tone.
    Cells(Cells),
    /// Words or a sign at a point.
    Note(Note),
}

/// A form that marks a point: colour is not all that tells series apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// ●
    Circle,
    /// ■
    Square,
    /// ▲
    Triangle,
    /// ◆
    Diamond,
}

impl Mark {
    /// Around a point, about as large as a circle of that radius, px.
    pub fn draw(
        self,
        drawing: &mut Drawing,
        [x, y]: Point,
        radius: f64,
        ink: Ink,
        edge: Option<Pen>,
    ) {
        // Corners, eighths of a turn from the right to the first one, and size.
        let (corners, first, size) = match self {
            Self::Circle => return drawing.circle([x, y], radius, Some(ink), edge),
            Self::Square => (4, 1.0, 1.25),
            Self::Triangle => (3, 2.0, 1.3),
            Self::Diamond => (4, 0.0, 1.3),
        };
        let corner = |i: u32| {
            let (sin, cos) = sin_cos(first * TAU / 8.0 + f64::from(i) * TAU / f64::from(corners));
            [x + size * radius * cos, y - size * radius * sin]
        };
        drawing.polygon((0..corners).map(corner).collect::<Vec<_>>(), Some(ink), edge);
    }
}

/// A point of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Datum {
    /// Where it is.
    pub at: Point,
    /// Of its mark, px.
    pub radius: f64,
    /// What appears under a pointer; empty for nothing.
    pub says: String,
}

/// Points joined by a line, marked, or both. One with a name is in the legend and the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// In the legend and the table; empty for a line that only helps the eye.
    pub name: String,
    /// Its points. One that is not finite parts the line.
    pub points: Vec<Datum>,
    /// The line through the points.
    pub line: Option<Pen>,
    /// The mark at each point and its colour.
    pub mark: Option<(Mark, Ink)>,
}

impl Series {
    /// A line of that width, px.
    #[must_use]
    pub fn line(
        name: &str,
        points: impl IntoIterator<Item = Point>,
        ink: impl Into<Ink>,
        width: f64,
    ) -> Self {
        Self::drawn(name, points, Pen::new(ink, width))
    }

    /// A line drawn with that pen.
    #[must_use]
    pub fn drawn(name: &str, points: impl IntoIterator<Item = Point>, pen: Pen) -> Self {
        let datum = |at| Datum { at, radius: 3.2, says: String::new() };
        let points = points.into_iter().map(datum).collect();
        Self { name: name.to_owned(), points, line: Some(pen), mark: None }
    }

    /// Marks of the line's colour at its points.
    #[must_use]
    pub fn marked(self, mark: Mark) -> Self {
        let ink = self.line.map_or(super::colours::TEXT.into(), |pen| pen.ink);
        Self { mark: Some((mark, ink)), ..self }
    }

    /// Marks alone.
    #[must_use]
    pub fn without_line(self) -> Self {
        Self { line: None, ..self }
    }

    /// With what each point says under a pointer.
    #[must_use]
    pub fn saying(mut self, says: impl Fn(Point) -> String) -> Self {
        self.points.iter_mut().for_each(|datum| datum.says = says(datum.at));
        self
    }
}

/// The numbers of a category.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// One dot each, always in the same place of the category.
    pub values: Vec<f64>,
    /// Their mean, or what else the swarm says.
    pub centre: f64,
    /// Its interval.
    pub interval: Option<[f64; 2]>,
}

/// Dots for every number of each category of the axis that has categories, and a sign for their
/// centre.
#[derive(Clone, Debug, PartialEq)]
pub struct Swarm {
    /// What a dot is, in the legend.
    pub name: String,
    /// As many as the axis has categories.
    pub groups: Vec<Group>,
    /// The dots' form.
    pub mark: Mark,
    /// The dots' colour.
    pub ink: Ink,
    /// What the centres are, such as "mean".
    pub centre: &'static str,
    /// What their intervals are, such as "95 % interval"; a centre is then a diamond on its interval. None
    /// for bars without intervals.
    pub interval: Option<&'static str>,
    /// Decimal places of the numbers that dots say.
    pub places: usize,
}

/// A closed curve, filled, outlined or both. One with a name is in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// In the legend; empty for none.
    pub name: String,
    /// The last point joins the first one.
    pub points: Vec<Point>,
    /// What fills it.
    pub fill: Option<Ink>,
    /// How its edge is drawn.
    pub edge: Option<Pen>,
}

/// Upright rectangles in one tone.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// Their colour.
    pub ink: Ink,
    /// Two opposite corners each: x, y, x, y.
    pub boxes: Vec<[f64; 4]>,
}

/// What a note is.
#[derive(Clone, Debug, PartialEq)]
pub enum Sign {
    /// Words of that size, px.
    Words(String, f64, Align),
    /// A vehicle that heads along an angle, counter-clockwise from the right, of that length, px.
    Vehicle(f64, f64),
    /// An arrow along an angle, of that length, px.
    Arrow(f64, f64),
    /// A number on a disc that is legible on every colour.
    Numeral(usize),
}

/// Words or a sign at a point. It is drawn if the point is between the axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// The point.
    pub at: Point,
    /// From there to the anchor, [right, down] in px.
    pub offset: Point,
    /// Its colour.
    pub colour: Colour,
    /// What it is.
    pub sign: Sign,
}

impl Note {
    /// Words of the usual size at a point, which part from lines below them.
    #[must_use]
    pub fn words(text: &str, at: Point, offset: Point, colour: Colour, align: Align) -> Self {
        Self { at, offset, colour, sign: Sign::Words(text.to_owned(), 11.5, align) }
    }

    /// A sign at a point.
    #[must_use]
    pub const fn sign(sign: Sign, at: Point, colour: Colour) -> Self {
        Self { at, offset: [0.0, 0.0], colour, sign }
    }
}

impl Sign {
    /// Draws it around a point, px.
    pub(super) fn draw(&self, drawing: &mut Drawing, at: Point, colour: Colour) {
        match self {
            Self::Words(text, size, align) => {
                drawing.text(text, at, *size, colour, *align);
                drawing.with_halo();
            }
            Self::Vehicle(angle, length) => drawing.vehicle(at, *angle, *length, colour),
            Self::Arrow(angle, length) => drawing.arrow(at, *angle, *length, colour),
            Self::Numeral(number) => {
                drawing.circle(at, NUMERAL_RADIUS, Some(super::colours::SURFACE.at(0.92)), None);
                drawing.bold(&number.to_string(), at, 9.5, colour, Align::Centre);
            }
        }
    }
}

/// Of the disc below a numeral, px.
pub(super) const NUMERAL_RADIUS: f64 = 6.4;

/// The points of a circle in the axes' units.
#[must_use]
pub fn disc([x, y]: Point, radius: f64) -> Vec<Point> {
    let point = |i: u32| {
        let (sin, cos) = sin_cos(f64::from(i) * TAU / 180.0);
        [x + radius * cos, y + radius * sin]
    };
    (0..180).map(point).collect()
}

macro_rules! layers {
    ($($layer:ident),*) => {$(
        impl From<$layer> for Layer {
            fn from(layer: $layer) -> Self {
                Self::$layer(layer)
            }
        }
    )*};
}
layers!(Series, Swarm, Area, Cells, Note);
