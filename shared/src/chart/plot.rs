//! A chart: two axes and the layers between them.

use super::axis::{Axis, Tick, beside_zero, fixed, number};
use super::clip::{line_inside, polygon_inside};
use super::colours::{ACCENT, GRID, LINE, MUTED, SURFACE, TEXT};
use super::drawing::{Align, Drawing, Pen, Point};
use super::layers::{Area, Cells, Layer, Note, Series, Swarm};
use super::legend::LegendItem;
use super::text::width_of;
use serde::Serialize;

/// A chart as data.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Title above the chart.
    pub title: String,
    /// Description for screen readers.
    pub description: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// The layers from bottom to top.
    pub layers: Vec<Layer>,
}

/// Position of the rectangle between a chart's axes in a drawing (px).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Distance from the left of the drawing.
    pub left: f64,
    /// Distance from the top of the drawing.
    pub top: f64,
    /// Length of the x axis.
    pub width: f64,
    /// Length of the y axis.
    pub height: f64,
}

/// The numbers of a chart as text, for readers who cannot see it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Table {
    /// The chart's title.
    pub caption: String,
    /// Names of the columns, with their units.
    pub columns: Vec<String>,
    /// The rows, with one entry per column. The first entry is the row's header.
    pub rows: Vec<Vec<String>>,
}

/// Font sizes (px).
const TICK_LETTERS: f64 = 11.0;
const NAME_LETTERS: f64 = 11.5;
const TITLE_LETTERS: f64 = 13.0;

impl Chart {
    /// A chart with axes and no layers.
    #[must_use]
    pub fn new(title: &str, description: &str, x: Axis, y: Axis) -> Self {
        let (title, description) = (title.to_owned(), description.to_owned());
        Self { title, description, x, y, layers: Vec::new() }
    }

    /// Adds a layer on top of the others.
    pub fn add(&mut self, layer: impl Into<Layer>) {
        self.layers.push(layer.into());
    }

    /// A drawing of this size (px), with the smallest margins that fit the labels.
    #[must_use]
    pub fn drawing(&self, size: [f64; 2]) -> Drawing {
        let mut drawing = Drawing::new(&self.title, &self.description, size);
        self.draw(&mut drawing, self.frame_within(size));
        drawing
    }

    /// The frame that fills a drawing of this size (px) together with the labels.
    #[must_use]
    pub fn frame_within(&self, [width, height]: [f64; 2]) -> Frame {
        let widths = |axis: &Axis| {
            axis.labels
                .iter()
                .flat_map(|(_, label)| label.split('\n'))
                .map(|label| width_of(label, TICK_LETTERS, false))
                .fold(0.0, f64::max)
        };
        let left = widths(&self.y) + 10.0;
        let right = if self.x.of_categories { 4.0 } else { (0.5 * widths(&self.x)).max(6.0) };
        let [above, below] = self.room();
        Frame { left, top: above, width: width - left - right, height: height - above - below }
    }

    /// Space for title, names and labels above and below the frame (px).
    #[must_use]
    pub fn room(&self) -> [f64; 2] {
        let title = if self.title.is_empty() { 0.0 } else { 20.0 };
        let name = if self.y.title().is_empty() { 0.0 } else { 18.0 };
        let lines = self.x.labels.iter().map(|(_, label)| label.split('\n').count()).max();
        let below = if self.x.title().is_empty() { 0.0 } else { 18.0 };
        [title + name + 6.0, 9.0 + 13.0 * lines.unwrap_or(0) as f64 + below]
    }

    /// Draws the axes with their names, the layers and the title.
    pub fn draw(&self, drawing: &mut Drawing, frame: Frame) {
        let [above, _] = self.room();
        let top = frame.top - above + 8.0;
        drawing.bold(&self.title, [frame.left, top], TITLE_LETTERS, TEXT, Align::Left);
        self.draw_axes(drawing, frame);
        self.draw_layers(drawing, frame);
    }

    fn draw_axes(&self, drawing: &mut Drawing, frame: Frame) {
        let Frame { left, top, width, height } = frame;
        let (right, bottom) = (left + width, top + height);
        let rule = |axis: &Axis, value: f64| {
            let pen = Pen::new(if value == 0.0 && !axis.logarithmic { LINE } else { GRID }, 1.0);
            (!axis.of_categories).then_some(pen)
        };
        for Tick { value, share, .. } in self.x.ticks() {
            if let Some(pen) = rule(&self.x, value) {
                let x = left + share * width;
                drawing.line([[x, top], [x, bottom]], pen);
            }
        }
        for Tick { value, share, .. } in self.y.ticks() {
            if let Some(pen) = rule(&self.y, value) {
                let y = bottom - share * height;
                drawing.line([[left, y], [right, y]], pen);
            }
        }
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        drawing.polygon(corners, None, Some(Pen::new(LINE, 1.0)));
        let colour = |axis: &Axis| if axis.of_categories { TEXT } else { MUTED };
        for Tick { share, label, .. } in self.x.ticks() {
            for (line, label) in label.split('\n').enumerate() {
                let at = [left + share * width, bottom + 12.0 + 13.0 * line as f64];
                drawing.text(label, at, TICK_LETTERS, colour(&self.x), Align::Centre);
            }
        }
        for Tick { share, label, .. } in self.y.ticks() {
            let at = [left - 6.0, bottom - share * height];
            drawing.text(&label, at, TICK_LETTERS, colour(&self.y), Align::Right);
        }
        let [_, below] = self.room();
        let middle = left + 0.5 * width;
        drawing.text(
            &self.x.title(),
            [middle, bottom + below - 6.0],
            NAME_LETTERS,
            MUTED,
            Align::Centre,
        );
        drawing.text(&self.y.title(), [left, top - 12.0], NAME_LETTERS, MUTED, Align::Left);
    }

    /// Draws only the layers, clipped to the frame.
    pub fn draw_layers(&self, drawing: &mut Drawing, frame: Frame) {
        for layer in &self.layers {
            match layer {
                Layer::Series(series) => self.series(drawing, frame, series),
                Layer::Swarm(swarm) => self.swarm(drawing, frame, swarm),
                Layer::Area(area) => self.area(drawing, frame, area),
                Layer::Cells(cells) => self.cells(drawing, frame, cells),
                Layer::Note(note) => self.note(drawing, frame, note),
            }
        }
    }

    /// Converts a point from the units of the axes to px in the drawing.
    #[must_use]
    pub fn place(&self, frame: Frame, [x, y]: Point) -> Point {
        [
            frame.left + frame.width * self.x.share(x),
            frame.top + frame.height * (1.0 - self.y.share(y)),
        ]
    }

    fn placed(&self, frame: Frame, points: &[Point]) -> Vec<Point> {
        points.iter().map(|point| self.place(frame, *point)).collect()
    }

    fn series(&self, drawing: &mut Drawing, frame: Frame, series: &Series) {
        let points: Vec<Point> =
            series.points.iter().map(|datum| self.place(frame, datum.at)).collect();
        if let Some(pen) = series.line {
            for piece in line_inside(&points, frame.edges()) {
                drawing.line(piece, pen);
            }
        }
        let Some((mark, ink)) = series.mark else {
            return;
        };
        let edge = Some(Pen::new(SURFACE, 1.0));
        for (datum, at) in series.points.iter().zip(points) {
            if frame.holds(at) {
                mark.draw(drawing, at, datum.radius, ink, edge);
                drawing.saying(&datum.says);
            }
        }
    }

    fn swarm(&self, drawing: &mut Drawing, frame: Frame, swarm: &Swarm) {
        let upright = self.x.of_categories;
        let along = |category: f64, value: f64| {
            self.place(frame, if upright { [category, value] } else { [value, category] })
        };
        let length = if upright { frame.width } else { frame.height };
        let room = 0.5 * length / swarm.groups.len().max(1) as f64;
        let aside = |[x, y]: Point, by: f64| if upright { [x + by, y] } else { [x, y + by] };
        for (i, group) in swarm.groups.iter().enumerate() {
            let place = i as f64 + 0.5;
            let many = group.values.len();
            let radius = if many <= 20 { 2.6 } else { 1.7 };
            for (j, value) in group.values.iter().enumerate().filter(|(_, value)| value.is_finite())
            {
                let at = aside(along(place, *value), 0.6 * room * spread(j, many));
                swarm.mark.draw(drawing, at, radius, swarm.ink, None);
                drawing.saying(&fixed(*value, swarm.places));
            }
            if group.values.is_empty() || !group.centre.is_finite() {
                continue;
            }
            let centre = along(place, group.centre);
            if swarm.interval.is_none() {
                let ends = [-0.8, 0.8].map(|by| aside(centre, by * room));
                drawing.line(ends, Pen::new(TEXT, 2.5));
                continue;
            }
            if let Some([low, high]) = group.interval {
                drawing.line([along(place, low), along(place, high)], Pen::new(ACCENT, 2.5));
            }
            super::Mark::Diamond.draw(
                drawing,
                centre,
                4.4,
                ACCENT.into(),
                Some(Pen::new(SURFACE, 1.0)),
            );
        }
    }

    fn area(&self, drawing: &mut Drawing, frame: Frame, area: &Area) {
        let points = self.placed(frame, &area.points);
        if points.iter().all(|point| frame.holds(*point)) {
            return drawing.polygon(points, area.fill, area.edge);
        }
        if area.fill.is_some() {
            drawing.polygon(polygon_inside(&points, frame.edges()), area.fill, None);
        }
        if let Some(pen) = area.edge {
            let closed: Vec<Point> = points.iter().chain(points.first()).copied().collect();
            for piece in line_inside(&closed, frame.edges()) {
                drawing.line(piece, pen);
            }
        }
    }

    fn cells(&self, drawing: &mut Drawing, frame: Frame, cells: &Cells) {
        let [left, top, right, bottom] = frame.edges();
        let placed = cells.boxes.iter().map(|&[x0, y0, x1, y1]| {
            let ([ax, ay], [bx, by]) = (self.place(frame, [x0, y0]), self.place(frame, [x1, y1]));
            [
                ax.min(bx).max(left),
                ay.min(by).max(top),
                ax.max(bx).min(right),
                ay.max(by).min(bottom),
            ]
        });
        let boxes = placed.filter(|[left, top, right, bottom]| left < right && top < bottom);
        drawing.boxes(boxes.collect(), cells.ink);
    }

    fn note(&self, drawing: &mut Drawing, frame: Frame, note: &Note) {
        let [x, y] = self.place(frame, note.at);
        if frame.holds([x, y]) {
            note.sign.draw(drawing, [x + note.offset[0], y + note.offset[1]], note.colour);
        }
    }

    /// The legend of the named layers.
    #[must_use]
    pub fn legend(&self) -> Vec<LegendItem> {
        LegendItem::of_layers(&self.layers)
    }

    /// The numbers of the swarms, with one row per category. A chart without swarms gives the
    /// numbers of the named series, with one row per x value in ascending order.
    #[must_use]
    pub fn table(&self) -> Table {
        let swarms: Vec<&Swarm> = self
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Swarm(swarm) => Some(swarm),
                _ => None,
            })
            .collect();
        let (columns, rows) =
            if swarms.is_empty() { self.series_table() } else { self.swarm_table(&swarms) };
        Table { caption: self.title.clone(), columns, rows }
    }

    fn swarm_table(&self, swarms: &[&Swarm]) -> (Vec<String>, Vec<Vec<String>>) {
        let (categories, values) =
            if self.x.of_categories { (&self.x, &self.y) } else { (&self.y, &self.x) };
        let title = values.title();
        let mut columns = vec![categories.title()];
        let labels = categories.labels.iter().map(|(_, label)| vec![label.replace('\n', " ")]);
        let mut rows: Vec<Vec<String>> = labels.collect();
        for swarm in swarms {
            columns.extend([swarm.centre, "least", "greatest"].map(|of| format!("{of} {title}")));
            columns.extend(swarm.interval.map(|interval| format!("{interval}, {title}")));
            columns.push("number".to_owned());
            for (row, group) in rows.iter_mut().zip(&swarm.groups) {
                let shown = |value: f64| {
                    if value.is_finite() { fixed(value, swarm.places) } else { String::new() }
                };
                let least = group.values.iter().copied().fold(f64::INFINITY, f64::min);
                let most = group.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                row.extend([group.centre, least, most].map(shown));
                if swarm.interval.is_some() {
                    let places = swarm.places;
                    let end = |value| match beside_zero(value, places) {
                        Some(words) => words.to_owned(),
                        None => fixed(value, places),
                    };
                    let told = group.interval.map(|ends| ends.map(end).join(" to "));
                    row.push(told.unwrap_or_default());
                }
                row.push(group.values.len().to_string());
            }
        }
        (columns, rows)
    }

    fn series_table(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let series: Vec<&Series> = self
            .layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Series(series) if !series.name.is_empty() => Some(series),
                _ => None,
            })
            .collect();
        let data = series.iter().flat_map(|series| &series.points);
        let mut all: Vec<f64> = data.map(|datum| datum.at[0]).filter(|x| x.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let column = |series: &&Series| {
            let unit =
                if self.y.unit.is_empty() { String::new() } else { format!(" ({})", self.y.unit) };
            format!("{}{unit}", series.name)
        };
        let columns = [self.x.title()].into_iter().chain(series.iter().map(column)).collect();
        let row = |x: f64| {
            let entry = |series: &&Series| {
                let mut here = series.points.iter().filter(|datum| datum.at[0] == x);
                here.next().map(|datum| brief(datum.at[1])).unwrap_or_default()
            };
            [number(x)].into_iter().chain(series.iter().map(entry)).collect()
        };
        (columns, all.into_iter().map(row).collect())
    }
}

impl Frame {
    /// Left, top, right and bottom (px).
    #[must_use]
    pub fn edges(&self) -> [f64; 4] {
        [self.left, self.top, self.left + self.width, self.top + self.height]
    }

    /// Whether a point is inside the frame or on its edge.
    #[must_use]
    pub fn holds(&self, [x, y]: Point) -> bool {
        const ROUNDING: f64 = 1e-6;
        let [left, top, right, bottom] = self.edges();
        (left - ROUNDING..=right + ROUNDING).contains(&x)
            && (top - ROUNDING..=bottom + ROUNDING).contains(&y)
    }
}

/// A number to four significant digits.
fn brief(value: f64) -> String {
    if value.is_finite() {
        number(format!("{value:.3e}").parse().unwrap_or(value))
    } else {
        String::new()
    }
}

/// Sideways offset of a dot, from −1 to 1, which keeps dots from hiding each other. It depends only
/// on the dot's index and on the number of dots.
fn spread(place: usize, count: usize) -> f64 {
    if count < 2 {
        return 0.0;
    }
    // Permutes the indices so that neighbouring dots are far apart.
    let place = (place * 5 + place / 7) % count;
    2.0 * place as f64 / (count - 1) as f64 - 1.0
}

#[cfg(test)]
mod tests;
