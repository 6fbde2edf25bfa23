//! V over x and y at one relative heading, as a picture.

use super::scale::{DARK, LIGHT, Scale};
use crate::chart::{
    Align, Area, Axis, Cells, Chart, Drawing, Frame, Ink, Layer, Note, Pen, Point, Sign, colours,
    disc, fixed,
};
use crate::math::{TAU, hypot};
use crate::picture::Window;
use crate::reachability::{CurveSettings, Nodes, ValueFunction};

/// Widths of the left margin, the gap before the colour bar, the bar, and the right margin (px).
const LEFT: f64 = 40.0;
const GAP: f64 = 58.0;
const BAR: f64 = 18.0;
const RIGHT: f64 = 22.0;

/// A map in the evader's frame, with axes and colour bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The picture.
    pub drawing: Drawing,
    chart: Chart,
    frame: Frame,
}

/// The part of the plane that maps of a function show: {V ≤ R/3} at every heading and the danger
/// disc, with a margin. It does not extend beyond the function's nodes.
#[must_use]
pub fn domain(function: &ValueFunction) -> Window {
    const HEADINGS: u32 = 24;
    let radius_m = function.game().radius_m;
    let coarse = CurveSettings { flatness_m: 0.03 * radius_m, spacing_m: f64::INFINITY };
    let mut window = Window::square(radius_m);
    for heading in 0..HEADINGS {
        let psi = f64::from(heading) * TAU / f64::from(HEADINGS);
        let curves = function.level_curves(psi, radius_m / 3.0, coarse).unwrap_or_default();
        for point in curves.into_iter().flatten() {
            window = window.including(point, 0.0);
        }
    }
    let [wide, high] = [0, 1].map(|d| window.high[d] - window.low[d]);
    let room = 0.05 * wide.max(high);
    // Limits the aspect ratio of a map.
    let [more_wide, more_high] =
        [(0.9 * high - wide).max(0.0), (0.62 * wide - high).max(0.0)].map(|more| 0.5 * more + room);
    let low = [window.low[0] - more_wide, window.low[1] - more_high];
    let high = [window.high[0] + more_wide, window.high[1] + more_high];
    match function {
        ValueFunction::Sampled(samples) => {
            let ends = match samples.nodes() {
                Nodes::Cartesian { x, y, .. } => [[x.low, y.low], [x.high, y.high]],
                Nodes::Polar { range_m, .. } => [[-range_m; 2], [range_m; 2]],
            };
            let [least, most] = ends;
            Window {
                low: [0, 1].map(|d| low[d].max(least[d])),
                high: [0, 1].map(|d| high[d].min(most[d])),
            }
        }
        ValueFunction::Exact(_) => Window { low, high },
    }
}

impl Map {
    /// V at the heading `psi` (rad), in a picture of this width (px). Each band between
    /// neighbouring levels has one tone. The levels are labelled, {V = 0} is the strongest line,
    /// and the danger disc is dashed.
    #[must_use]
    pub fn of_value(
        function: &ValueFunction,
        psi: f64,
        window: Window,
        scale: &Scale,
        width: f64,
    ) -> Self {
        let title = format!("V at ψ = {}°", fixed(psi.to_degrees(), 0));
        let mut map = Self::empty(&title, window, width);
        let radius_m = function.game().radius_m;
        let metre_px = map.frame.width / (window.high[0] - window.low[0]);
        let settings = CurveSettings {
            flatness_m: 0.25 / metre_px,
            spacing_m: (4.0 / metre_px).max(0.05 * radius_m),
        };
        map.ground(function, window, scale.tone(scale.levels.len()).into());
        // A level that no state attains has no curves.
        let of_level = |level| function.level_curves(psi, level, settings).unwrap_or_default();
        let curves: Vec<(f64, Vec<Vec<Point>>)> =
            scale.levels.iter().map(|&level| (level, of_level(level))).collect();
        // Draws the largest set first, because each set is a subset of the next level's set.
        for (band, (level, curves)) in curves.iter().enumerate().rev() {
            let mut sized: Vec<_> = curves.iter().map(|curve| (area(curve), curve)).collect();
            sized.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
            for (area, points) in sized {
                // A hole, whose curve runs clockwise, has the tone above the level.
                let tone = scale.tone(if area < 0.0 { band + 1 } else { band });
                let edge = (*level != 0.0).then(|| Pen::new(LIGHT.at(0.55), 1.0));
                let (name, fill) = (String::new(), Some(tone.into()));
                map.chart.add(Area { name, points: points.clone(), fill, edge });
            }
        }
        for points in curves.iter().filter(|(level, _)| *level == 0.0).flat_map(|(_, all)| all) {
            for pen in [Pen::new(DARK, 5.0), Pen::new(LIGHT, 2.6)] {
                map.outline(points.clone(), pen);
            }
        }
        map.outline(disc([0.0; 2], radius_m), Pen::new(LIGHT, 1.2).dashed(5.0, 4.0));
        map.label(&curves, scale);
        map.finish("V", scale)
    }

    /// Fills the area of the function's nodes with the colour of the highest values.
    fn ground(&mut self, function: &ValueFunction, window: Window, ink: Ink) {
        let [x, y] = [0, 1].map(|d| [window.low[d], window.high[d]]);
        let corner_m = hypot(x[0].abs().max(x[1].abs()), y[0].abs().max(y[1].abs()));
        if let ValueFunction::Sampled(samples) = function
            && let Nodes::Polar { range_m, .. } = samples.nodes()
            && range_m < corner_m
        {
            let points = disc([0.0; 2], range_m);
            self.chart.add(Area { name: String::new(), points, fill: Some(ink), edge: None });
        } else {
            self.chart.add(Cells { ink, boxes: vec![[x[0], y[0], x[1], y[1]]] });
        }
    }

    /// A quantity (m) on a grid over `window`, row by row from the bottom, in a picture of this
    /// width (px).
    pub(super) fn of_cells(
        title: &str,
        values: &[f64],
        columns: usize,
        window: Window,
        scale: &Scale,
        width: f64,
    ) -> Self {
        let mut map = Self::empty(title, window, width);
        let rows = values.len() / columns.max(1);
        let size = [
            (window.high[0] - window.low[0]) / columns.max(1) as f64,
            (window.high[1] - window.low[1]) / rows.max(1) as f64,
        ];
        let mut boxes = vec![Vec::new(); scale.levels.len() + 1];
        for (row, values) in values.chunks(columns.max(1)).enumerate() {
            let y = [row, row + 1].map(|row| window.low[1] + row as f64 * size[1]);
            let mut begin = 0;
            // Merges neighbouring cells of the same tone into one box.
            while begin < values.len() {
                let band = scale.band(values[begin]);
                let same = values[begin..].iter().take_while(|v| scale.band(**v) == band).count();
                let x = [begin, begin + same].map(|at| window.low[0] + at as f64 * size[0]);
                boxes[band].push([x[0], y[0], x[1], y[1]]);
                begin += same;
            }
        }
        for (band, boxes) in boxes.into_iter().enumerate().filter(|(_, boxes)| !boxes.is_empty()) {
            map.chart.add(Cells { ink: scale.tone(band).into(), boxes });
        }
        map
    }

    /// Draws the chart and the colour bar.
    pub(super) fn finish(mut self, name: &str, scale: &Scale) -> Self {
        let Frame { left, top, width, height } = self.frame;
        self.chart.draw(&mut self.drawing, self.frame);
        let bar = Frame { left: left + width + GAP, top, width: BAR, height };
        scale.draw(name, &mut self.drawing, bar);
        self
    }

    fn empty(title: &str, window: Window, width: f64) -> Self {
        let [wide, high] = [0, 1].map(|d| window.high[d] - window.low[d]);
        let across = width - LEFT - GAP - BAR - RIGHT;
        let up = across * high / wide;
        let axis = |name: &str, d: usize, px: f64| {
            Axis::linear(name, "m", [window.low[d], window.high[d]], (px / 56.0).max(2.0) as usize)
        };
        let x = axis("x, ahead of the evader", 0, across);
        let y = axis("y, to its left", 1, up);
        let chart = Chart::new("", "", x, y);
        let [above, below] = chart.room();
        let frame = Frame { left: LEFT, top: above + 4.0, width: across, height: up };
        let drawing = Drawing::new(title, "", [width, above + 8.0 + up + below]);
        Self { drawing, chart, frame }
    }

    fn outline(&mut self, points: Vec<Point>, pen: Pen) {
        self.chart.add(Area { name: String::new(), points, fill: None, edge: Some(pen) });
    }

    /// Places each level's label where its curve is far from the previous labels.
    fn label(&mut self, curves: &[(f64, Vec<Vec<Point>>)], scale: &Scale) {
        const ROOM: f64 = 16.0;
        let mut placed: Vec<Point> = Vec::new();
        let [left, top, right, bottom] = self.frame.edges();
        for (level, curves) in curves {
            let points = curves.iter().flatten().map(|point| (*point, self.to_px(*point)));
            let inside = points.filter(|(_, [x, y])| {
                (left + ROOM..right - ROOM).contains(x) && (top + ROOM..bottom - ROOM).contains(y)
            });
            let apart = |[x, y]: Point| {
                let distances = placed.iter().map(|[a, b]| hypot(x - a, y - b));
                // A distance of half the map's width is far enough. Among places that are far
                // enough, a higher one is easier to read.
                distances.fold(0.5 * (right - left), f64::min) - 0.05 * y
            };
            let best = inside.max_by(|(_, a), (_, b)| apart(*a).total_cmp(&apart(*b)));
            if let Some((point, at)) = best {
                placed.push(at);
                let words = fixed(*level, scale.places);
                self.chart.add(Note::words(&words, point, [0.0; 2], colours::TEXT, Align::Centre));
            }
        }
    }

    /// Converts a state (m) to a position in the picture (px).
    #[must_use]
    pub fn to_px(&self, at: Point) -> Point {
        self.chart.place(self.frame, at)
    }

    /// Converts a position in the picture (px) to a state (m). Returns `None` outside the axes.
    #[must_use]
    pub fn at_px(&self, px: Point) -> Option<Point> {
        let along = |axis: &Axis, share: f64| axis.ends[0] + share * (axis.ends[1] - axis.ends[0]);
        let Frame { left, top, width, height } = self.frame;
        let share = [(px[0] - left) / width, 1.0 - (px[1] - top) / height];
        self.frame
            .holds(px)
            .then(|| [along(&self.chart.x, share[0]), along(&self.chart.y, share[1])])
    }

    /// A picture with the same size and axes and only these layers, to overlay on the map.
    #[must_use]
    pub fn over(&self, layers: Vec<Layer>) -> Drawing {
        let mut drawing = Drawing::new("", "", self.drawing.size);
        let chart = Chart { layers, ..self.chart.clone() };
        chart.draw_layers(&mut drawing, self.frame);
        drawing
    }

    /// The layers of the evader at the origin and of the pursuer at (x, y) with the heading `psi`
    /// (rad).
    #[must_use]
    pub fn vehicles(at: Point, psi: f64) -> Vec<Layer> {
        let vehicle = |at, angle, colour| {
            [(24.0, LIGHT), (17.0, colour)]
                .map(|(length, colour)| Note::sign(Sign::Vehicle(angle, length), at, colour).into())
        };
        let evader = vehicle([0.0; 2], 0.0, colours::HUMAN);
        evader.into_iter().chain(vehicle(at, psi, colours::ROBOT)).collect()
    }
}

/// Area inside a closed curve. It is positive if the curve runs counter-clockwise.
fn area(curve: &[Point]) -> f64 {
    let next = curve.iter().cycle().skip(1);
    curve.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
}
