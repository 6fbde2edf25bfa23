//! Charts as data, with one renderer for pages, reports and files.
//!
//! A [`Chart`] has two axes, and layers in the units of these axes. [`Chart::draw`] turns it into a
//! [`Drawing`]: lines, areas and text in pixels. [`Drawing::svg`] writes it as a standalone file;
//! [`Drawing::element`] returns a tree of SVG elements, which a page can turn into DOM nodes.
//! [`Chart::table`] returns the same numbers as a table, and [`Chart::legend`] explains the
//! symbols.
//!
//! ```
//! use sidestep::chart::{Axis, Chart, Mark, Series, colours};
//!
//! let time = Axis::time("time", [0.0, 8.0], 10); // round ticks for any duration
//! let range = Axis::round("distance", "m", [0.0, 11.3], 5); // ends widened to round numbers
//! let mut chart = Chart::new("How near they came", "From 11.3 m down to 3.1 m.", time, range);
//! let points = [[0.0, 11.3], [4.0, 3.1], [8.0, 6.0]];
//! chart.add(Series::line("human", points, colours::HUMAN, 2.0).marked(Mark::Circle));
//! let svg = chart.drawing([340.0, 220.0]).svg();
//! assert!(svg.contains("time (s)"));
//! assert_eq!(chart.table().rows[1], ["4", "3.1"]);
//! ```
//!
//! A page that scales a plot and places the labels itself takes the ticks from [`Axis::ticks`]
//! (each with its position as a fraction of the axis) and draws only [`Chart::layers`], with
//! [`Chart::draw_layers`].

pub mod colours;
mod drawing;
mod svg;
mod text;
mod axis;
mod clip;
mod layers;
mod legend;
mod headed;
mod plot;

pub use axis::{Axis, Tick, beside_zero, fixed, number, round_step};
pub use colours::{Colour, Ink};
pub use drawing::{Align, Drawing, Form, Pen, Point, Shape, Text};
pub use headed::{MARGIN, headed};
pub use layers::{Area, Cells, Datum, Group, Layer, Mark, Note, Series, Sign, Swarm, disc};
pub use legend::LegendItem;
pub use plot::{Chart, Frame, Table};
pub use svg::{ColourStyle, Element};
pub use text::{lowered, width_of};
