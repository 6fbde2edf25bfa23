//! Optimal play as pictures: in the evader's frame, and in the world.

use super::map::Map;
use super::play::Play;
use super::scale::LIGHT;
use crate::chart::{
    Area, Axis, Chart, Colour, Drawing, Frame, Layer, Mark, Note, Pen, Point, Series, Sign,
    colours, disc,
};
use crate::picture::Window;
use crate::vehicle::Pose;

/// Space left and right of the axes (px).
const LEFT: f64 = 40.0;
const RIGHT: f64 = 8.0;
/// Approximate maximum number of points of a path.
const POINTS: usize = 400;

impl Play {
    /// The pursuer's path in the evader's frame, for [`Map::over`]. It is a strong line until the
    /// vehicles are closest, and a faint line afterwards.
    #[must_use]
    pub fn relative_path(&self) -> Vec<Layer> {
        let points: Vec<Point> = self.relative.iter().map(|[x, y, _]| [*x, *y]).collect();
        let line = |points: Vec<Point>, pen: Pen| Layer::from(Series::drawn("", points, pen));
        let before = thinned(&points[..=self.closest]);
        let after = thinned(&points[self.closest..]);
        let [x, y, psi] = self.relative[self.closest];
        let mut layers = vec![
            line(after, Pen::new(LIGHT.at(0.7), 1.4).dashed(2.0, 3.0)),
            line(before.clone(), Pen::new(LIGHT, 5.0)),
            line(before, Pen::new(colours::ROBOT, 2.6)),
        ];
        let vehicle = [(21.0, LIGHT), (14.0, colours::ROBOT)];
        layers.extend(vehicle.map(|(length, colour)| {
            Layer::from(Note::sign(Sign::Vehicle(psi, length), [x, y], colour))
        }));
        layers
    }

    /// Both paths in the world, in a picture of this width (px). It shows the vehicles at the start
    /// and at their closest approach, and the danger disc at the closest approach.
    #[must_use]
    pub fn world(&self, radius_m: f64, width: f64) -> Drawing {
        let paths = [(&self.evader, colours::HUMAN), (&self.pursuer, colours::ROBOT)];
        let closest = self.evader[self.closest].position();
        let mut window = Window { low: closest, high: closest }.including(closest, radius_m);
        for pose in self.evader.iter().chain(&self.pursuer) {
            window = window.including(pose.position(), 0.0);
        }
        let [wide, high] = [0, 1].map(|d| window.high[d] - window.low[d]);
        let room = 0.08 * wide.max(high);
        // Both axes have the same scale, so the window is enlarged to limit the aspect ratio.
        let [more_x, more_y] =
            [(high - wide).max(0.0), (0.5 * wide - high).max(0.0)].map(|more| 0.5 * more + room);
        let x = [window.low[0] - more_x, window.high[0] + more_x];
        let y = [window.low[1] - more_y, window.high[1] + more_y];
        let across = width - LEFT - RIGHT;
        let up = across * (y[1] - y[0]) / (x[1] - x[0]);
        let axis = |name: &str, ends, px: f64| {
            Axis::linear(name, "m", ends, (px / 56.0).max(2.0) as usize)
        };
        let mut chart = Chart::new("", "", axis("x", x, across), axis("y", y, up));
        let pen = Pen::new(colours::ROBOT, 1.0).dashed(4.0, 4.0);
        let (points, fill) = (disc(closest, radius_m), Some(colours::ROBOT.at(0.07)));
        chart.add(Area { name: String::new(), points, fill, edge: Some(pen) });
        let ends = [self.evader[self.closest], self.pursuer[self.closest]].map(|p| p.position());
        chart.add(Series::drawn("", ends, Pen::new(colours::TEXT, 1.0).dashed(2.0, 3.0)));
        for (path, colour) in paths {
            self.path(&mut chart, path, colour);
        }
        let [above, below] = chart.room();
        let frame = Frame { left: LEFT, top: above + 4.0, width: across, height: up };
        let mut drawing =
            Drawing::new("Both paths in the world", "", [width, above + 8.0 + up + below]);
        chart.draw(&mut drawing, frame);
        drawing
    }

    fn path(&self, chart: &mut Chart, path: &[Pose], colour: Colour) {
        let points: Vec<Point> = path.iter().map(Pose::position).collect();
        let (before, after) = (&points[..=self.closest], &points[self.closest..]);
        let faint = Pen::new(colour.at(0.5), 1.4).dashed(2.0, 3.0);
        chart.add(Series::drawn("", thinned(after), faint));
        chart.add(Series::line("", thinned(before), colour, 2.4));
        // A mark at every second makes the two paths comparable.
        let each = ((1.0 / self.step_s).round() as usize).max(1);
        let seconds = before.iter().copied().step_by(each);
        chart.add(Series::line("", seconds, colour, 1.0).marked(Mark::Circle).without_line());
        for pose in [path[0], path[self.closest]] {
            chart.add(Note::sign(Sign::Vehicle(pose.psi, 20.0), pose.position(), colour));
        }
    }
}

impl Map {
    /// The map with layers on top, such as the pursuer's path, for a file.
    #[must_use]
    pub fn with(&self, layers: Vec<Layer>) -> Drawing {
        let mut drawing = self.drawing.clone();
        drawing.place(&self.over(layers), [0.0; 2]);
        drawing
    }
}

/// Thins points to about [`POINTS`], keeping both ends.
fn thinned(points: &[Point]) -> Vec<Point> {
    let each = points.len().div_ceil(POINTS).max(1);
    let mut thin: Vec<Point> = points.iter().copied().step_by(each).collect();
    if thin.last() != points.last() {
        thin.extend(points.last());
    }
    thin
}
