//! Layers of a chart, in the units of its axes.

use super::colours::{Colour, Ink};
use super::drawing::{Align, Drawing, Pen, Point};
use crate::math::{TAU, sin_cos};

/// A layer of a chart. Later layers cover earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer {
    /// Points with a line, marks or both.
    Series(Series),
    /// Dots for the numbers of each category.
    Swarm(Swarm),
    /// A closed curve.
    Area(Area),
    /// Cells of a map in one colour.
    Cells(Cells),
    /// Text or a symbol at a point.
    Note(Note),
}

/// Shape of a marker, so that series differ not only by colour.
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
    /// Draws the mark around a point, about as large as a circle of radius `radius` (px).
    pub fn draw(
        self,
        drawing: &mut Drawing,
        [x, y]: Point,
        radius: f64,
        ink: Ink,
        edge: Option<Pen>,
    ) {
        // Number of corners, angle of the first corner (counter-clockwise from the right, in units
        // of 45°), and size.
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
    /// Its position.
    pub at: Point,
    /// Radius of its mark (px).
    pub radius: f64,
    /// Tooltip; may be empty.
    pub says: String,
}

/// Points with a line, marks or both. Named series appear in the legend and the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend and the table; empty for a guide line.
    pub name: String,
    /// Its points. A non-finite point splits the line.
    pub points: Vec<Datum>,
    /// The line through the points.
    pub line: Option<Pen>,
    /// The mark at each point and its colour.
    pub mark: Option<(Mark, Ink)>,
}

impl Series {
    /// A line of width `width` (px).
    #[must_use]
    pub fn line(
        name: &str,
        points: impl IntoIterator<Item = Point>,
        ink: impl Into<Ink>,
        width: f64,
    ) -> Self {
        Self::drawn(name, points, Pen::new(ink, width))
    }

    /// A line drawn with `pen`.
    #[must_use]
    pub fn drawn(name: &str, points: impl IntoIterator<Item = Point>, pen: Pen) -> Self {
        let datum = |at| Datum { at, radius: 3.2, says: String::new() };
        let points = points.into_iter().map(datum).collect();
        Self { name: name.to_owned(), points, line: Some(pen), mark: None }
    }

    /// Adds marks in the line's colour at its points.
    #[must_use]
    pub fn marked(self, mark: Mark) -> Self {
        let ink = self.line.map_or(super::colours::TEXT.into(), |pen| pen.ink);
        Self { mark: Some((mark, ink)), ..self }
    }

    /// Removes the line and keeps the marks.
    #[must_use]
    pub fn without_line(self) -> Self {
        Self { line: None, ..self }
    }

    /// Sets the tooltip of each point.
    #[must_use]
    pub fn saying(mut self, says: impl Fn(Point) -> String) -> Self {
        self.points.iter_mut().for_each(|datum| datum.says = says(datum.at));
        self
    }
}

/// The numbers of one category of a swarm.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// One dot per number. The offset of a dot depends only on its index and the number of dots.
    pub values: Vec<f64>,
    /// The statistic named in [`Swarm::centre`], such as the mean.
    pub centre: f64,
    /// Interval of the centre, if any.
    pub interval: Option<[f64; 2]>,
}

/// Dots for all numbers of each category, and a symbol for their centre. One axis must have
/// categories.
#[derive(Clone, Debug, PartialEq)]
pub struct Swarm {
    /// Legend text for the dots.
    pub name: String,
    /// One group per category of the axis.
    pub groups: Vec<Group>,
    /// The dots' shape.
    pub mark: Mark,
    /// The dots' colour.
    pub ink: Ink,
    /// Name of the statistic that the centres show, such as "mean".
    pub centre: &'static str,
    /// Name of the centres' intervals, such as "95 % interval". With a name, each centre is drawn
    /// as a diamond on its interval. With `None`, the centres are drawn as bars without intervals.
    pub interval: Option<&'static str>,
    /// Decimal places of the numbers in tooltips.
    pub places: usize,
}

/// A closed curve, filled, outlined or both. Named areas appear in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// Name in the legend; may be empty.
    pub name: String,
    /// The vertices. The last one joins the first one.
    pub points: Vec<Point>,
    /// Fill colour, if any.
    pub fill: Option<Ink>,
    /// Style of its edge, if any.
    pub edge: Option<Pen>,
}

/// Axis-aligned rectangles in one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// Their colour.
    pub ink: Ink,
    /// The rectangles, each given by two opposite corners: x, y, x, y.
    pub boxes: Vec<[f64; 4]>,
}

/// What a note shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Sign {
    /// Text, its font size (px) and its alignment.
    Words(String, f64, Align),
    /// A vehicle: heading (rad, counter-clockwise from the right) and length (px).
    Vehicle(f64, f64),
    /// An arrow: direction (rad, as for a vehicle) and length (px).
    Arrow(f64, f64),
    /// A number on a disc, legible on every colour.
    Numeral(usize),
}

/// Text or a symbol at a point. It is drawn only if the point is inside the chart's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// The point, in the axes' units.
    pub at: Point,
    /// Offset of the anchor from the point: [right, down] (px).
    pub offset: Point,
    /// Its colour.
    pub colour: Colour,
    /// Text or symbol.
    pub sign: Sign,
}

impl Note {
    /// Text of the default size at a point, with a halo.
    #[must_use]
    pub fn words(text: &str, at: Point, offset: Point, colour: Colour, align: Align) -> Self {
        Self { at, offset, colour, sign: Sign::Words(text.to_owned(), 11.5, align) }
    }

    /// A symbol at a point.
    #[must_use]
    pub const fn sign(sign: Sign, at: Point, colour: Colour) -> Self {
        Self { at, offset: [0.0, 0.0], colour, sign }
    }
}

impl Sign {
    /// Draws the text or symbol at a point of the drawing (px).
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

/// Radius of the disc behind a numeral (px).
pub(super) const NUMERAL_RADIUS: f64 = 6.4;

/// The vertices of a circle, in the axes' units.
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
