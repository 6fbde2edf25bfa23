//! Draws predicted regions in the colours of the paper: the tube above, and the sets at single steps
//! below.

use super::label_position::label_position;
use super::{MARGIN, Window, headed};
use sidestep::bounds::{InputBounds, Motion};
use sidestep::chart::{
    Align, Area, Axis, Chart, Drawing, Frame, LegendItem, Mark, Note, Pen, Series, Sign, colours,
    disc, fixed, number,
};
use sidestep::invalid::Invalid;
use sidestep::math::{PI, atan2, hypot, wrap_angle};
use sidestep::reach::polygon::signed_area;
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::scene::JointState;
use sidestep::vehicle::Pose;
use sidestep::vehicle::dubins::relative_state;

/// Width of a frame, and the margins to its left and right (px).
const SIDE: f64 = 300.0;
const ROOM: [f64; 2] = [46.0, 104.0];
/// Height of the frame of a single step, and the gap between two frames (px).
const STEP: f64 = 36.0;
const BETWEEN: f64 = 5.0;
/// Space above the single steps for their title (px).
const HEADING: f64 = 30.0;
/// Space around a numeral (px).
const NUMERAL_ROOM: f64 = 7.4;

/// The panel of one prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionsPanel {
    title: String,
    /// The settings of the prediction; can be empty.
    settings: String,
    /// The vehicles now, in the world frame. The picture is rotated so that the human's heading is
    /// upwards.
    now: JointState,
    /// Radius of the robot's disc, which the human must not enter (m).
    danger_radius_m: f64,
    /// The times of the steps shown (s).
    times_s: Vec<f64>,
    /// The nested sets, from the smallest to the largest.
    sets: Vec<DrawnSet>,
    /// The area of all positions that the human can reach within the prediction horizon (m²).
    worst_case_m2: f64,
}

/// A set as polygons in the world frame (m).
#[derive(Clone, Debug, PartialEq)]
struct DrawnSet {
    /// All positions within the prediction horizon.
    tube: Vec<[f64; 2]>,
    /// The positions at each of the steps shown.
    steps: Vec<Vec<[f64; 2]>>,
}

/// Up to this number of steps, every step is shown.
const EACH: usize = 12;

/// The steps that are shown. If there are many steps, only the last step and every n-th step before it
/// are shown.
fn shown_steps(steps: usize) -> Vec<usize> {
    let every = steps.div_ceil(EACH).max(1);
    (1..=steps).filter(|step| (steps - step).is_multiple_of(every)).collect()
}

impl RegionsPanel {
    /// A panel with the sets that are reachable from the present state under each of `sets`. `title`
    /// and `settings` briefly describe the prediction and its method. `motion` describes how the human
    /// moves.
    ///
    /// # Errors
    /// [`Invalid`] if the present state is not finite or the motion is impossible.
    pub fn new(
        [title, settings]: [String; 2],
        now: JointState,
        sets: &[InputBounds],
        motion: &Motion,
        danger_radius_m: f64,
    ) -> Result<Self, Invalid> {
        let polygons = PolygonSettings::default();
        let all_steps = sets.first().map_or(0, InputBounds::steps);
        let steps = shown_steps(all_steps);
        let reachable = |bounds: &InputBounds| {
            ReachableSet::new(now.human, bounds, motion.human_speed_mps, motion.step_s)
        };
        let (low, high) = motion.human_turn_rate;
        let every_turn =
            InputBounds::new(vec![low; all_steps], vec![high; all_steps], motion.human_turn_rate)?;
        let worst_case_m2 = signed_area(&reachable(&every_turn)?.tube_polygon(polygons));
        let drawn = |bounds: &InputBounds| {
            let set = reachable(bounds)?;
            Ok(DrawnSet {
                tube: set.tube_polygon(polygons),
                steps: steps.iter().map(|&step| set.step_polygon(step, polygons)).collect(),
            })
        };
        let sets = sets.iter().map(drawn).collect::<Result<_, Invalid>>()?;
        let times_s = steps.iter().map(|&step| step as f64 * motion.step_s).collect();
        Ok(Self { title, settings, now, danger_radius_m, times_s, sets, worst_case_m2 })
    }
}

impl RegionsPanel {
    /// The areas of the sets, and their ratios to the worst case.
    fn areas(&self) -> String {
        let areas = || self.sets.iter().map(|set| signed_area(&set.tube));
        let listed = |each: Vec<String>| each.join(", ");
        format!(
            "areas {} m²: {} % of the worst case",
            listed(areas().map(|area| format!("{area:.2}")).collect()),
            listed(
                areas().map(|area| format!("{:.0}", 100.0 * area / self.worst_case_m2)).collect()
            )
        )
    }
}

/// Draws `panels` side by side. Region j is the part of set j outside set j − 1. Colours range from
/// red for the innermost region to purple for the outermost region. `regions` has the name of each
/// region in the legend, such as its ε or its probability. `note` describes the data.
#[must_use]
pub fn regions(heading: &str, note: &str, panels: &[RegionsPanel], regions: &[String]) -> Drawing {
    let window = window_of(panels);
    let height = SIDE * window.high() / window.wide();
    let bearing = farthest_bearing(panels);
    let cell = ROOM[0] + SIDE + ROOM[1];
    let width = (panels.len() as f64 * cell).max(460.0);

    let mut drawing = headed(heading, &[note], width);
    let top = drawing.size[1] + 94.0;
    let mut bottom = top;
    for (i, panel) in panels.iter().enumerate() {
        let left = MARGIN + ROOM[0] + i as f64 * cell;
        let frame = Frame { left, top, width: SIDE, height };
        let [title, settings, areas] = [top - 78.0, top - 58.0, top - 40.0];
        drawing.bold(&panel.title, [left, title], 13.5, colours::TEXT, Align::Left);
        drawing.text(&panel.settings, [left, settings], 11.5, colours::MUTED, Align::Left);
        let text = panel.areas();
        drawing.text(&text, [left, areas], 11.5, colours::MUTED, Align::Left);
        let chart = tube(panel, &window, frame);
        chart.draw(&mut drawing, frame);
        let below = top + height + chart.room()[1] + HEADING;
        let heading = "single steps: range upwards, each with a scale of its own";
        drawing.text(heading, [left, below - 12.0], 11.5, colours::MUTED, Align::Left);
        bottom = draw_steps(&mut drawing, panel, bearing, [left, below]);
    }
    let items: Vec<LegendItem> = (regions.iter().enumerate())
        .map(|(j, name)| LegendItem::region(name, j + 1, colours::region(j, regions.len())))
        .collect();
    let at = [MARGIN + ROOM[0], bottom + 24.0];
    let legend = drawing.legend(&items, at, drawing.size[0] - 2.0 * MARGIN - ROOM[0]);
    drawing.size[1] = at[1] + legend + 10.0;
    drawing
}

/// Converts a point from the world frame to the human's frame, [right, ahead] (m).
fn seen(start: Pose, [x, y]: [f64; 2]) -> [f64; 2] {
    let [ahead, left, _] = relative_state(start, Pose::new(x, y, 0.0));
    [-left, ahead]
}

fn all_seen(start: Pose, polygon: &[[f64; 2]]) -> Vec<[f64; 2]> {
    polygon.iter().map(|&point| seen(start, point)).collect()
}

/// The part of the plane that all panels show. It extends equally far to the human's left and right.
fn window_of(panels: &[RegionsPanel]) -> Window {
    let tubes = panels.iter().flat_map(|panel| panel.sets.iter().map(move |set| (panel, set)));
    let points = tubes.flat_map(|(panel, set)| all_seen(panel.now.human, &set.tube));
    let Window { x, y } = Window::around(points.chain([[0.0, 0.0]]));
    let reach = (1.1 * x[1].max(-x[0])).max(0.45 * (y[1] - y[0])).max(0.1);
    let room = 0.06 * (y[1] - y[0]).max(reach);
    Window { x: [-reach, reach], y: [y[0] - room, y[1] + room] }
}

/// A chart of all positions within the prediction horizon, in the human's frame.
fn tube(panel: &RegionsPanel, window: &Window, frame: Frame) -> Chart {
    let x = Axis::linear("to the right", "m", window.x, 7);
    let y = Axis::linear("ahead", "m", window.y, 7);
    let mut chart = Chart::new("", "", x, y);
    let tubes = panel.sets.iter().map(|set| all_seen(panel.now.human, &set.tube));
    let tubes: Vec<Vec<[f64; 2]>> = tubes.collect();
    add_sets(&mut chart, &tubes, Pen::new(colours::SURFACE.at(0.75), 0.8));
    add_danger_zone(&mut chart, panel);
    // Number each region that has enough space for a numeral.
    let placed = tubes
        .iter()
        .map(|tube| tube.iter().map(|point| chart.place(frame, *point)).collect::<Vec<_>>());
    let placed: Vec<_> = placed.collect();
    for (j, tube) in placed.iter().enumerate() {
        let within = if j == 0 { &[][..] } else { &placed[j - 1] };
        if let Some([right, down]) = label_position(tube, within, NUMERAL_ROOM) {
            let at = [
                window.x[0] + window.wide() * (right - frame.left) / frame.width,
                window.y[1] - window.high() * (down - frame.top) / frame.height,
            ];
            chart.add(Note::sign(Sign::Numeral(j + 1), at, colours::TEXT));
        }
    }
    add_human(&mut chart);
    chart
}

/// Draws the largest set first, because it contains the others. `edge` separates the regions for
/// readers who cannot distinguish the colours. A set that allows only one path is drawn as a line
/// in the set's colour.
fn add_sets(chart: &mut Chart, sets: &[Vec<[f64; 2]>], edge: Pen) {
    for (j, points) in sets.iter().enumerate().rev() {
        let colour = colours::region(j, sets.len());
        let is_path = points.len() < 3 || signed_area(points).abs() < 1e-6;
        let edge = if is_path { Pen::new(colour, 2.0) } else { edge };
        let fill = Some(colour.into());
        let (name, points) = (String::new(), points.clone());
        chart.add(Area { name, points, fill, edge: Some(edge) });
    }
}

fn add_human(chart: &mut Chart) {
    let mut human = Series::line("", [[0.0, 0.0]], colours::HUMAN, 1.0).marked(Mark::Circle);
    human.points[0].radius = 4.0;
    chart.add(human.without_line());
}

/// Draws the robot and its danger zone, where they are visible.
fn add_danger_zone(chart: &mut Chart, panel: &RegionsPanel) {
    let JointState { human, robot } = panel.now;
    let at = seen(human, robot.position());
    // The edge must be visible on every region, including the red one.
    let edge = Some(Pen::new(colours::ROBOT, 1.6).halo(1.0));
    let points = disc(at, panel.danger_radius_m);
    chart.add(Area { name: String::new(), points, fill: None, edge });
    let heading = robot.psi - human.psi + 0.5 * PI;
    chart.add(Note::sign(Sign::Vehicle(heading, 15.0), at, colours::ROBOT));
}

/// The largest absolute bearing of any set at a single step, with a margin (degrees).
fn farthest_bearing(panels: &[RegionsPanel]) -> f64 {
    let bearing = |panel: &RegionsPanel| {
        let polygons = panel.sets.iter().flat_map(|set| &set.steps);
        let unrolled = polygons.flat_map(|polygon| unrolled(panel.now.human, polygon));
        unrolled.map(|[bearing, _]| bearing.abs()).fold(0.0, f64::max)
    };
    1.06 * panels.iter().map(bearing).fold(1.0, f64::max)
}

/// Draws the sets at single steps, from the last step to the first, and returns their bottom edge
/// (px). In the plane these sets are slivers thinner than a line, so they are drawn in polar
/// coordinates. The horizontal axis is the bearing to the right, up to `bearing`, and the vertical
/// axis is the range. Each step has its own scale.
fn draw_steps(
    drawing: &mut Drawing,
    panel: &RegionsPanel,
    bearing: f64,
    [left, mut top]: [f64; 2],
) -> f64 {
    for (i, time) in panel.times_s.iter().enumerate().rev() {
        let steps = panel.sets.iter().map(|set| unrolled(panel.now.human, &set.steps[i]));
        let sets: Vec<Vec<[f64; 2]>> = steps.collect();
        let ranges = || sets.iter().flatten().map(|[_, range]| *range);
        let (low, high) = (ranges().fold(f64::INFINITY, f64::min), ranges().fold(0.0, f64::max));
        let room = 0.12 * (high - low);
        let mut x = Axis::linear("bearing to the right", "°", [-bearing, bearing], 7);
        let y = Axis::ticked("", "", [low - room, high + room], Vec::new());
        let first = i == 0;
        if !first {
            x.name = String::new();
            x.unit = String::new();
            x.labels.iter_mut().for_each(|(_, label)| label.clear());
        }
        let mut chart = Chart::new("", "", x, y);
        add_sets(&mut chart, &sets, Pen::new(colours::SURFACE.at(0.75), 0.6));
        chart.draw(drawing, Frame { left, top, width: SIDE, height: STEP });
        let right = left + SIDE + 8.0;
        let time = format!("after {} s", number(*time));
        drawing.text(&time, [right, top + 0.5 * STEP - 7.0], 11.0, colours::TEXT, Align::Left);
        // Use enough decimal places to distinguish both ends.
        let places = (1..5).find(|places| fixed(low, *places) != fixed(high, *places)).unwrap_or(4);
        let ranges = format!("{}–{} m", fixed(low, places + 1), fixed(high, places + 1));
        drawing.text(&ranges, [right, top + 0.5 * STEP + 7.0], 11.0, colours::MUTED, Align::Left);
        top += STEP + if first { chart.room()[1] } else { BETWEEN };
    }
    top
}

/// Bearing to the right (degrees) and range (m) from the start. Bearings continue beyond ±180°.
fn unrolled(start: Pose, polygon: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut bearing = 0.0;
    let mut unroll = |point: &[f64; 2]| {
        let [right, ahead] = seen(start, *point);
        bearing += wrap_angle(atan2(right, ahead) - bearing);
        [bearing * 180.0 / PI, hypot(right, ahead)]
    };
    polygon.iter().map(&mut unroll).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::png;
    use sidestep::scene::SceneParameters;

    /// The left panel of the paper's Figure 3, for a human who is certain to turn right.
    fn panel(human: Pose) -> RegionsPanel {
        let bounds = [0.0, 0.15, 0.25, 0.4, 1.0].map(|epsilon: f64| {
            let hi = |i: usize| (if i < 2 { 0.0 } else { -0.5 } + epsilon).min(0.5);
            let hi = (0..10).map(hi).collect();
            InputBounds::new(vec![-0.5; 10], hi, (-0.5, 0.5)).unwrap()
        });
        let title = ["left", "ε = 0, 0.15, 0.25, 0.4, 1 rad/s"].map(str::to_owned);
        let now = JointState { human, robot: Pose::new(2.0, 5.0, -1.5) };
        let motion = Motion::from(&SceneParameters::default());
        RegionsPanel::new(title, now, &bounds, &motion, 3.0).unwrap()
    }

    fn names() -> Vec<String> {
        (1..=5).map(|j| format!("p = 0.{j}")).collect()
    }

    #[test]
    fn every_region_is_drawn_in_both_views_of_each_panel() {
        let panels = [panel(Pose::new(0.0, 0.0, 0.5 * PI)), panel(Pose::new(3.0, 1.0, 2.0))];
        let drawing = regions("Regions", "a made-up human", &panels, &names());
        // Each colour occurs in two panels, with a tube and ten steps each, and in one legend sign.
        let fill = |j: usize| Some(colours::REGIONS[j].into());
        for j in 0..5 {
            let with_fill = drawing.shapes.iter().filter(|shape| shape.fill == fill(j));
            assert_eq!(with_fill.count(), 2 * 11 + 1, "{j}");
        }
        // Sets are drawn from large to small, so purple is below red.
        let first = |j| drawing.shapes.iter().position(|shape| shape.fill == fill(j));
        assert!(first(4) < first(0));
        let svg = drawing.svg();
        for text in
            ["Regions", "a made-up human", "p = 0.3", "after 0.2 s", "after 2 s", "areas 1.22, "]
        {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(png(&drawing).unwrap().starts_with(b"\x89PNG"));
    }

    /// The picture of a prediction does not depend on the pose of the human.
    #[test]
    fn the_picture_turns_with_the_human() {
        let point = seen(Pose::new(1.0, 2.0, 0.5 * PI), [1.5, 4.0]);
        assert!((point[0] - 0.5).abs() < 1e-12 && (point[1] - 2.0).abs() < 1e-12);
        let point = seen(Pose::new(1.0, 2.0, 0.0), [3.0, 1.5]);
        assert!((point[0] - 0.5).abs() < 1e-12 && (point[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_last_step_is_shown() {
        assert_eq!(shown_steps(10), (1..=10).collect::<Vec<_>>());
        assert_eq!(shown_steps(3), [1, 2, 3]);
        assert_eq!(shown_steps(25), [1, 4, 7, 10, 13, 16, 19, 22, 25]);
        assert!(shown_steps(0).is_empty());
    }

    #[test]
    fn bearings_go_on_behind_the_human() {
        let start = Pose::new(0.0, 0.0, 0.5 * PI);
        let around = unrolled(start, &[[0.0, 2.0], [1.0, 0.0], [0.1, -1.0], [-0.1, -1.0]]);
        let bearings: Vec<f64> = around.iter().map(|[bearing, _]| bearing.round()).collect();
        assert_eq!(bearings, [0.0, 90.0, 174.0, 186.0]);
        assert!((around[0][1] - 2.0).abs() < 1e-12);
    }
}
