//! Predicted regions in the colours of the paper: the tube above, the sets at steps below.

use super::canvas::{
    Align, Canvas, DrawError, GRID, HUMAN, LINE, MUTED, REGIONS, ROBOT, SURFACE, TEXT, number,
    page, ticks,
};
use super::label_position::roomiest;
use plotters::prelude::{Color, RGBColor};
use sidestep::bounds::{InputBounds, Motion};
use sidestep::invalid::Invalid;
use sidestep::math::{PI, TAU, sin_cos};
use sidestep::reach::polygon::signed_area;
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::scene::JointState;
use sidestep::vehicle::Pose;
use sidestep::vehicle::dubins::relative_state;

const MARGIN: f64 = 28.0;
const HEADER: f64 = 84.0;
/// Of the legend: what is above its first row, and a row.
const LEGEND: f64 = 34.0;
const ROW: f64 = 24.0;
/// Least width between the margins, for the heading.
const NARROWEST: f64 = 460.0;
/// About the mean width of a letter of 12 pixels.
const LETTER: f64 = 6.4;
/// Width of what is plotted in, and the room around it: left, right, above, below.
const SIDE: f64 = 300.0;
const ROOM: [f64; 4] = [38.0, 12.0, 66.0, 34.0];

/// One prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionsPanel {
    /// What is predicted how, in a few words.
    pub title: String,
    /// The human now, world frame. The picture is turned so that the human heads upwards.
    pub start: Pose,
    /// The nested sets, from the smallest to the largest.
    pub sets: Vec<DrawnSet>,
    /// The robot now, if it is to be seen.
    pub robot: Option<DangerZone>,
}

/// A set as polygons in the world frame, m.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnSet {
    /// Every position within the steps ahead.
    pub tube: Vec<[f64; 2]>,
    /// The positions at each of the steps that are shown, as many as there are times.
    pub steps: Vec<Vec<[f64; 2]>>,
}

/// The robot and the disc about it that the human must not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DangerZone {
    /// The robot's pose, world frame.
    pub robot: Pose,
    /// R_c, m.
    pub radius_m: f64,
}

/// Which of `steps` steps are shown: every second one, or all of a few.
#[must_use]
pub fn shown_steps(steps: usize) -> Vec<usize> {
    let every = if steps < 4 { 1 } else { steps.div_ceil(10).next_multiple_of(2) };
    (1..=steps).filter(|step| step % every == 0).collect()
}

impl RegionsPanel {
    /// The sets reachable from now under each of `sets`, drawn at the steps `shown`;
    /// `motion` says how the human moves, `danger_radius_m` what the robot's disc is.
    ///
    /// # Errors
    /// [`Invalid`] if the present state is not finite or the motion makes no sense.
    pub fn new(
        title: String,
        now: JointState,
        sets: &[InputBounds],
        motion: &Motion,
        danger_radius_m: f64,
        shown: &[usize],
    ) -> Result<Self, Invalid> {
        let polygons = PolygonSettings::default();
        let drawn = |bounds: &InputBounds| {
            let set = ReachableSet::new(now.human, bounds, motion.human_speed_mps, motion.step_s)?;
            Ok(DrawnSet {
                tube: set.tube_polygon(polygons),
                steps: shown.iter().map(|&step| set.step_polygon(step, polygons)).collect(),
            })
        };
        Ok(Self {
            title,
            start: now.human,
            sets: sets.iter().map(drawn).collect::<Result<_, Invalid>>()?,
            robot: Some(DangerZone { robot: now.robot, radius_m: danger_radius_m }),
        })
    }
}

/// The SVG of `panels`, side by side: region j is what set j adds to set j − 1, from red
/// inside to purple outside. `times_s` are those of the shown steps, `regions` names each
/// region in the legend, such as its probability; `note` says what the data are.
///
/// # Errors
/// [`DrawError`] if there is no panel, a panel has not as many sets as there are names or a
/// set not as many steps as there are times, or plotters cannot draw it.
pub fn regions(
    heading: &str,
    note: &str,
    panels: &[RegionsPanel],
    times_s: &[f64],
    regions: &[String],
) -> Result<String, DrawError> {
    check(panels, times_s, regions)?;
    let window = Window::around(panels);
    let high = SIDE * window.high() / window.wide();
    let cell = [ROOM[0] + SIDE + ROOM[1], 2.0 * (high + ROOM[3]) + ROOM[2] + 30.0];
    let inner = (panels.len() as f64 * cell[0]).max(NARROWEST).max(LETTER * letters(note));
    let legend = Legend::new(regions, inner - ROOM[0]);
    let size = [inner + 2.0 * MARGIN, HEADER + cell[1] + legend.height()];
    page(heading, size, |canvas| {
        canvas.bold(heading, [MARGIN, 34.0], 20.0, TEXT, Align::Left)?;
        canvas.text(note, [MARGIN, 58.0], 12.0, MUTED, Align::Left)?;
        let left = MARGIN + ROOM[0];
        for (i, panel) in panels.iter().enumerate() {
            let left = left + i as f64 * cell[0];
            let above = Plot { canvas, panel, window: &window, corner: [left, HEADER + ROOM[2]] };
            above.titles()?;
            above.tube()?;
            let top = HEADER + ROOM[2] + high + ROOM[3] + 30.0;
            let below = Plot { corner: [left, top], ..above };
            below.steps(times_s)?;
        }
        legend.draw(canvas, [left, HEADER + cell[1] + LEGEND])
    })
}

fn check(panels: &[RegionsPanel], times_s: &[f64], regions: &[String]) -> Result<(), DrawError> {
    if panels.is_empty() {
        return Err(DrawError("there is no panel".to_owned()));
    }
    for (i, panel) in panels.iter().enumerate() {
        if panel.sets.len() != regions.len() {
            let (found, expected) = (panel.sets.len(), regions.len());
            return Err(DrawError(format!("panel {i} has {found} sets for {expected} regions")));
        }
        if let Some(set) = panel.sets.iter().find(|set| set.steps.len() != times_s.len()) {
            let (found, expected) = (set.steps.len(), times_s.len());
            return Err(DrawError(format!("panel {i} has {found} steps for {expected} times")));
        }
    }
    Ok(())
}

/// The colour of region `j`, from 0, of `count`: red inside, purple outside.
fn color(j: usize, count: usize) -> RGBColor {
    match count {
        0..=5 => REGIONS[j],
        // More regions than colours: blends of neighbours.
        _ => {
            let at = (REGIONS.len() - 1) as f64 * j as f64 / (count - 1) as f64;
            let from = (at as usize).min(REGIONS.len() - 2);
            let share = at - from as f64;
            let (a, b) = (REGIONS[from], REGIONS[from + 1]);
            let mix = |a: u8, b: u8| (f64::from(a) * (1.0 - share) + f64::from(b) * share) as u8;
            RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
        }
    }
}

/// From the world to the human's point of view: to the right and ahead, m.
fn seen(start: Pose, [x, y]: [f64; 2]) -> [f64; 2] {
    let [ahead, left, _] = relative_state(start, Pose::new(x, y, 0.0));
    [-left, ahead]
}

/// What part of the plane all panels show.
struct Window {
    x: [f64; 2],
    y: [f64; 2],
}

impl Window {
    fn around(panels: &[RegionsPanel]) -> Self {
        let (mut x, mut y) = ([0.0_f64; 2], [0.0_f64; 2]);
        for panel in panels {
            for &point in panel.sets.iter().flat_map(|set| &set.tube) {
                let [px, py] = seen(panel.start, point);
                x = [x[0].min(px), x[1].max(px)];
                y = [y[0].min(py), y[1].max(py)];
            }
        }
        // The same on either side, with room for the times beside the steps.
        let reach = (1.3 * x[1].max(-x[0])).max(0.45 * (y[1] - y[0])).max(0.1);
        let room = 0.06 * (y[1] - y[0]).max(reach);
        Self { x: [-reach, reach], y: [y[0] - room, y[1] + room] }
    }

    fn wide(&self) -> f64 {
        self.x[1] - self.x[0]
    }

    fn high(&self) -> f64 {
        self.y[1] - self.y[0]
    }
}

/// A place for one view of a panel.
#[derive(Clone, Copy)]
struct Plot<'a, 'b> {
    canvas: &'a Canvas<'b>,
    panel: &'a RegionsPanel,
    window: &'a Window,
    /// Top left.
    corner: [f64; 2],
}

impl Plot<'_, '_> {
    fn pixels_per_m(&self) -> f64 {
        SIDE / self.window.wide()
    }

    /// A point as the human sees it.
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let scale = self.pixels_per_m();
        [
            self.corner[0] + scale * (x - self.window.x[0]),
            self.corner[1] + scale * (self.window.y[1] - y),
        ]
    }

    fn placed(&self, polygon: &[[f64; 2]]) -> Vec<[f64; 2]> {
        polygon.iter().map(|&point| self.place(seen(self.panel.start, point))).collect()
    }

    fn titles(&self) -> Result<(), DrawError> {
        let [x, y] = [self.corner[0], self.corner[1] - ROOM[2]];
        self.canvas.bold(&self.panel.title, [x, y + 12.0], 13.5, TEXT, Align::Left)?;
        let areas = self.panel.sets.iter().map(|set| format!("{:.2}", signed_area(&set.tube)));
        let areas = format!("tubes of {} m²", areas.collect::<Vec<_>>().join(" / "));
        self.canvas.text(&areas, [x, y + 32.0], 11.5, MUTED, Align::Left)
    }

    /// The largest set first: the others lie within.
    fn tube(&self) -> Result<(), DrawError> {
        self.axes()?;
        let count = self.panel.sets.len();
        for (j, set) in self.panel.sets.iter().enumerate().rev() {
            let polygon = self.placed(&set.tube);
            if polygon.len() > 2 {
                self.canvas.fill(&polygon, color(j, count).mix(1.0))?;
            }
            // Parts the regions for those who do not tell the colours apart.
            self.canvas.outline(&polygon, SURFACE.mix(0.75), 0.8)?;
            if polygon.len() > 1 && signed_area(&set.tube).abs() < 1e-6 {
                // No choice: the set is but a path.
                self.canvas.stroke(&polygon, color(j, count).mix(1.0), 2.0)?;
            }
        }
        self.danger_zone()?;
        self.numerals()?;
        self.human()
    }

    /// A number in each region that has room for it.
    fn numerals(&self) -> Result<(), DrawError> {
        let tubes: Vec<_> = self.panel.sets.iter().map(|set| self.placed(&set.tube)).collect();
        for (j, tube) in tubes.iter().enumerate() {
            let within = if j == 0 { &[][..] } else { &tubes[j - 1] };
            if let Some(at) = roomiest(tube, within, NUMERAL + 1.0) {
                numeral(self.canvas, j, at)?;
            }
        }
        Ok(())
    }

    fn steps(&self, times_s: &[f64]) -> Result<(), DrawError> {
        self.axes()?;
        let count = self.panel.sets.len();
        for (i, time) in times_s.iter().enumerate() {
            for (j, set) in self.panel.sets.iter().enumerate().rev() {
                let polygon = self.placed(&set.steps[i]);
                // Early sets are thinner than a line.
                self.canvas.outline(&polygon, color(j, count).mix(1.0), 0.7)?;
                if polygon.len() > 2 {
                    self.canvas.fill(&polygon, color(j, count).mix(1.0))?;
                }
            }
            let widest = self.panel.sets.last().map(|set| self.placed(&set.steps[i]));
            let right = widest.iter().flatten().copied().max_by(|a, b| a[0].total_cmp(&b[0]));
            if let Some([x, y]) = right {
                let text = format!("{} s", number(*time));
                self.canvas.text(&text, [x + 6.0, y], 10.5, MUTED, Align::Left)?;
            }
        }
        self.danger_zone()?;
        self.human()
    }

    fn human(&self) -> Result<(), DrawError> {
        let at = self.place([0.0, 0.0]);
        self.canvas.disc(at, 4.6, SURFACE.mix(1.0))?;
        self.canvas.disc(at, 3.4, HUMAN.mix(1.0))
    }

    /// As much of the robot and its danger zone as is in sight.
    fn danger_zone(&self) -> Result<(), DrawError> {
        let Some(DangerZone { robot, radius_m }) = self.panel.robot else {
            return Ok(());
        };
        let [x, y] = seen(self.panel.start, robot.position());
        let point = |i: u32| {
            let (sin, cos) = sin_cos(f64::from(i) * TAU / 360.0);
            [x + radius_m * cos, y + radius_m * sin]
        };
        let Window { x: [x0, x1], y: [y0, y1] } = *self.window;
        let inside = |[x, y]: [f64; 2]| x0 < x && x < x1 && y0 < y && y < y1;
        // Pieces of the circle between where it leaves the window and comes back.
        let circle: Vec<[f64; 2]> = (0..=360).map(point).collect();
        for piece in circle.split(|&point| !inside(point)).filter(|piece| piece.len() > 1) {
            let piece: Vec<[f64; 2]> = piece.iter().map(|&point| self.place(point)).collect();
            // White beside it: it is seen on every region, the red one too.
            self.canvas.stroke(&piece, SURFACE.mix(0.8), 3.6)?;
            self.canvas.stroke(&piece, ROBOT.mix(1.0), 1.6)?;
        }
        if inside([x, y]) {
            let heading = robot.psi - self.panel.start.psi + 0.5 * PI;
            self.canvas.vehicle(self.place([x, y]), heading, 15.0, ROBOT)?;
        }
        Ok(())
    }

    fn axes(&self) -> Result<(), DrawError> {
        let Window { x: [x0, x1], y: [y0, y1] } = *self.window;
        let shade = |at: f64| if at == 0.0 { LINE } else { GRID };
        for x in ticks(x0, x1, 7) {
            let ends = [[x, y0], [x, y1]].map(|p| self.place(p));
            self.canvas.stroke(&ends, shade(x).mix(1.0), 1.0)?;
            let [px, py] = ends[0];
            self.canvas.text(&number(x), [px, py + 12.0], 10.5, MUTED, Align::Centre)?;
        }
        for y in ticks(y0, y1, 7) {
            let ends = [[x0, y], [x1, y]].map(|p| self.place(p));
            self.canvas.stroke(&ends, shade(y).mix(1.0), 1.0)?;
            let [px, py] = ends[0];
            self.canvas.text(&number(y), [px - 6.0, py], 10.5, MUTED, Align::Right)?;
        }
        let frame = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|p| self.place(p));
        self.canvas.outline(&frame, LINE.mix(1.0), 1.0)?;
        let [right, bottom] = self.place([x1, y0]);
        self.canvas.text("to the right (m)", [right, bottom + 27.0], 10.5, MUTED, Align::Right)?;
        let [left, top] = self.place([x0, y1]);
        self.canvas.text("ahead (m)", [left, top - 9.0], 10.5, MUTED, Align::Left)
    }
}

fn letters(text: &str) -> f64 {
    text.chars().count() as f64
}

/// The number of region `j`, from 0, on its colour: who does not tell colours apart reads it.
fn numeral(canvas: &Canvas<'_>, j: usize, at: [f64; 2]) -> Result<(), DrawError> {
    canvas.disc(at, NUMERAL, SURFACE.mix(0.92))?;
    canvas.bold(&(j + 1).to_string(), at, 9.5, TEXT, Align::Centre)
}

/// Radius of the disc below a number.
const NUMERAL: f64 = 6.4;

/// The names of the regions, in as few rows of equal columns as they fit in.
struct Legend<'a> {
    regions: &'a [String],
    columns: usize,
    column: f64,
}

impl<'a> Legend<'a> {
    fn new(regions: &'a [String], width: f64) -> Self {
        let longest = regions.iter().map(|text| letters(text)).fold(0.0, f64::max);
        let column = 28.0 + LETTER * longest + 22.0;
        let most = ((width / column) as usize).max(1);
        let rows = regions.len().div_ceil(most).max(1);
        Self { regions, columns: regions.len().div_ceil(rows).max(1), column }
    }

    fn height(&self) -> f64 {
        LEGEND + ROW * self.regions.len().div_ceil(self.columns) as f64
    }

    fn draw(&self, canvas: &Canvas<'_>, [left, top]: [f64; 2]) -> Result<(), DrawError> {
        for (j, text) in self.regions.iter().enumerate() {
            let x = left + self.column * (j % self.columns) as f64;
            let y = top + ROW * (j / self.columns) as f64;
            let [right, up, down] = [x + 20.0, y - 9.0, y + 9.0];
            let sign = [[x, up], [right, up], [right, down], [x, down]];
            canvas.fill(&sign, color(j, self.regions.len()).mix(1.0))?;
            numeral(canvas, j, [x + 10.0, y])?;
            canvas.text(text, [x + 28.0, y], 12.0, TEXT, Align::Left)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::png;
    use sidestep::bounds::InputBounds;
    use sidestep::reach::{PolygonSettings, ReachableSet};

    const TIMES_S: [f64; 5] = [0.4, 0.8, 1.2, 1.6, 2.0];

    /// The left of the paper's Figure 3 for a human who is sure to turn right.
    fn panel(start: Pose) -> RegionsPanel {
        let set = |epsilon: f64| {
            let hi = |i: usize| (if i < 2 { 0.0 } else { -0.5 } + epsilon).min(0.5);
            let hi = (0..10).map(hi).collect();
            let bounds = InputBounds::new(vec![-0.5; 10], hi, (-0.5, 0.5)).unwrap();
            let set = ReachableSet::new(start, &bounds, 2.0, 0.2).unwrap();
            let settings = PolygonSettings::default();
            DrawnSet {
                tube: set.tube_polygon(settings),
                steps: (1..=5).map(|i| set.step_polygon(2 * i, settings)).collect(),
            }
        };
        RegionsPanel {
            title: "ε = 0, 0.15, 0.25, 0.4, 1".to_owned(),
            start,
            sets: [0.0, 0.15, 0.25, 0.4, 1.0].map(set).into(),
            robot: Some(DangerZone { robot: Pose::new(2.0, 5.0, -1.5), radius_m: 3.0 }),
        }
    }

    fn names() -> Vec<String> {
        (1..=5).map(|j| format!("p = 0.{j}")).collect()
    }

    #[test]
    fn every_region_is_drawn_in_both_views_of_each_panel() {
        let panels = [panel(Pose::new(0.0, 0.0, 0.5 * PI)), panel(Pose::new(3.0, 1.0, 2.0))];
        let svg = regions("Regions", "a made-up human", &panels, &TIMES_S, &names()).unwrap();
        // Two panels with five tubes and twenty-five steps each, and the robot; five signs.
        let fills = |color: &str| svg.matches(&format!("fill=\"{color}\"")).count();
        for color in ["#E2504A", "#E6BD3C", "#46A063", "#4477D3", "#9367CF"] {
            assert!(fills(color) > 2 * 6, "{color}: {}", fills(color));
        }
        // From large to small: purple lies below red.
        assert!(svg.find("#9367CF") < svg.find("#E2504A"));
        for text in ["Regions", "a made-up human", "p = 0.3", "0.4 s", "2 s", "1.22 / "] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(png(&svg).unwrap().starts_with(b"\x89PNG"));
    }

    /// Wherever the human is, the picture of the same prediction is the same.
    #[test]
    fn the_picture_turns_with_the_human() {
        let point = seen(Pose::new(1.0, 2.0, 0.5 * PI), [1.5, 4.0]);
        assert!((point[0] - 0.5).abs() < 1e-12 && (point[1] - 2.0).abs() < 1e-12);
        let point = seen(Pose::new(1.0, 2.0, 0.0), [3.0, 1.5]);
        assert!((point[0] - 0.5).abs() < 1e-12 && (point[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        let panel = panel(Pose::new(0.0, 0.0, 0.0));
        let refusal = |panels: &[RegionsPanel], times: &[f64], names: &[String]| {
            regions("", "", panels, times, names).unwrap_err().to_string()
        };
        assert!(refusal(&[], &TIMES_S, &names()).contains("no panel"));
        assert!(
            refusal(core::slice::from_ref(&panel), &TIMES_S[1..], &names())
                .contains("5 steps for 4")
        );
        assert!(refusal(&[panel], &TIMES_S, &names()[1..]).contains("5 sets for 4"));
    }

    #[test]
    fn more_regions_than_colours_are_blends() {
        assert_eq!(color(0, 9), REGIONS[0]);
        assert_eq!(color(8, 9), REGIONS[4]);
        assert_eq!(color(4, 9), REGIONS[2]);
    }
}
