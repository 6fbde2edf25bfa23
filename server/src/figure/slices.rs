//! {V = c} at fixed relative headings: small multiples in the evader's frame.

use super::canvas::{
    Align, Canvas, DrawError, GRID, HUMAN, LINE, MUTED, REGIONS, ROBOT, TEXT, number, page, ticks,
};
use super::caption;
use plotters::prelude::{Color, RGBColor};
use sidestep::math::{PI, TAU, sin_cos};
use sidestep::reachability::{CurveSettings, ValueFunction};

const MARGIN: f64 = 28.0;
const HEADER: f64 = 118.0;
/// Around the square that is plotted in: left, right, above, below.
const ROOM: [f64; 4] = [50.0, 16.0, 34.0, 48.0];

type Curves = Vec<Vec<[f64; 2]>>;

/// The SVG of {V = c} for each of `levels` (m, above −R) at each of the headings
/// `psi_deg`.
///
/// # Errors
/// [`DrawError`] if plotters cannot draw it.
pub fn slices(
    function: &ValueFunction,
    psi_deg: &[f64],
    levels: &[f64],
) -> Result<String, DrawError> {
    let curves: Vec<Vec<Curves>> = psi_deg
        .iter()
        .map(|psi| {
            let curves = |level: &f64| {
                function.level_curves(psi * PI / 180.0, *level, CurveSettings::default())
            };
            levels.iter().map(curves).collect()
        })
        .collect();
    let window = Window::around(&curves, function.game().radius_m);
    let (columns, side) = match psi_deg.len() {
        1 => (1, 560.0),
        2 | 4 => (2, 420.0),
        3 | 5 | 6 | 9 => (3, 330.0),
        _ => (4, 270.0),
    };
    let rows = psi_deg.len().div_ceil(columns);
    let cell = [side + ROOM[0] + ROOM[1], side * window.aspect() + ROOM[2] + ROOM[3]];
    let levels = Levels(levels);
    let legend = Legend::new(&levels);
    let width = (columns as f64 * cell[0]).max(legend.width()).max(760.0) + 2.0 * MARGIN;
    let height = HEADER + rows as f64 * cell[1] + MARGIN;
    page("Level sets of the value function", [width, height], |canvas| {
        canvas.bold(levels.title(), [MARGIN, 36.0], 21.0, TEXT, Align::Left)?;
        canvas.text(&caption(function), [MARGIN, 64.0], 12.0, MUTED, Align::Left)?;
        legend.draw(canvas, [MARGIN, 94.0])?;
        let left = 0.5 * (width - columns as f64 * cell[0]);
        for (i, (psi, curves)) in psi_deg.iter().zip(&curves).enumerate() {
            let (row, column) = (i / columns, i % columns);
            let corner =
                [left + column as f64 * cell[0] + ROOM[0], HEADER + row as f64 * cell[1] + ROOM[2]];
            let panel = Panel { canvas, levels: &levels, window: &window, corner, side };
            panel.draw(*psi, curves, function.game().radius_m)?;
        }
        Ok(())
    })
}

/// The levels and how each is drawn.
struct Levels<'a>(&'a [f64]);

impl Levels<'_> {
    /// The lowest level that is not negative has the first colour.
    fn color(&self, level: usize) -> RGBColor {
        let negative = self.0.iter().filter(|level| **level < 0.0).count();
        let all = REGIONS.len();
        REGIONS[(level + all * self.0.len() - negative) % all]
    }

    /// {V ≤ 0} is filled: from there a collision can be forced.
    fn is_filled(&self, level: usize) -> bool {
        self.0[level] == 0.0
    }

    fn title(&self) -> &'static str {
        if self.0.contains(&0.0) {
            "Where the pursuer can force a collision"
        } else {
            "Level sets of the value function"
        }
    }
}

/// What part of the plane all panels show.
struct Window {
    x: [f64; 2],
    y: [f64; 2],
}

impl Window {
    fn around(curves: &[Vec<Curves>], radius_m: f64) -> Self {
        let (mut x, mut y) = ([-radius_m, radius_m], [-radius_m, radius_m]);
        for [px, py] in curves.iter().flatten().flatten().flatten() {
            x = [x[0].min(*px), x[1].max(*px)];
            y = [y[0].min(*py), y[1].max(*py)];
        }
        let room = 0.06 * (x[1] - x[0]).max(y[1] - y[0]);
        let mut window = Self { x: [x[0] - room, x[1] + room], y: [y[0] - room, y[1] + room] };
        // No slits: one metre is as long along both axes.
        let (wide, high) = (window.x[1] - window.x[0], window.y[1] - window.y[0]);
        let widen = |[low, high]: [f64; 2], by: f64| [low - 0.5 * by, high + 0.5 * by];
        window.x = widen(window.x, (high / 1.4 - wide).max(0.0));
        window.y = widen(window.y, (0.55 * wide - high).max(0.0));
        window
    }

    fn aspect(&self) -> f64 {
        (self.y[1] - self.y[0]) / (self.x[1] - self.x[0])
    }
}

/// One heading.
struct Panel<'a, 'b> {
    canvas: &'a Canvas<'b>,
    levels: &'a Levels<'a>,
    window: &'a Window,
    corner: [f64; 2],
    side: f64,
}

impl Panel<'_, '_> {
    fn pixels_per_m(&self) -> f64 {
        self.side / (self.window.x[1] - self.window.x[0])
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let scale = self.pixels_per_m();
        [
            self.corner[0] + (x - self.window.x[0]) * scale,
            self.corner[1] + (self.window.y[1] - y) * scale,
        ]
    }

    fn draw(&self, psi_deg: f64, curves: &[Curves], radius_m: f64) -> Result<(), DrawError> {
        let canvas = self.canvas;
        self.axes()?;
        let psi = psi_deg * PI / 180.0;
        let disc: Vec<_> = (0..180)
            .map(|i| {
                let (sin, cos) = sin_cos(f64::from(i) * TAU / 180.0);
                self.place([radius_m * cos, radius_m * sin])
            })
            .collect();
        // The largest set first: each lies within the next level's.
        for (level, curves) in curves.iter().enumerate().rev() {
            for curve in curves {
                let curve: Vec<_> = curve.iter().map(|p| self.place(*p)).collect();
                if self.levels.is_filled(level) {
                    canvas.fill(&curve, self.levels.color(level).mix(0.13))?;
                }
                canvas.outline(&curve, self.levels.color(level).mix(1.0), 2.0)?;
            }
        }
        canvas.fill(&disc, MUTED.mix(0.14))?;
        canvas.dashes(&disc, MUTED.mix(1.0), 1.2, 4.0)?;
        canvas.vehicle(self.place([0.0, 0.0]), 0.0, 17.0, HUMAN)?;
        let right = self.corner[0] + self.side;
        let heading = [right - 24.0, self.corner[1] + 24.0];
        canvas.arrow(heading, psi, 28.0, ROBOT)?;
        let title = format!("ψ = {}°", number(psi_deg));
        canvas.bold(&title, [self.corner[0], self.corner[1] - 14.0], 14.0, TEXT, Align::Left)
    }

    fn axes(&self) -> Result<(), DrawError> {
        let canvas = self.canvas;
        let Window { x: [x0, x1], y: [y0, y1] } = *self.window;
        let shade = |at: f64| if at == 0.0 { LINE } else { GRID };
        let most = (self.side / 46.0) as usize;
        for x in ticks(x0, x1, most) {
            canvas.stroke(&[[x, y0], [x, y1]].map(|p| self.place(p)), shade(x).mix(1.0), 1.0)?;
            let [px, py] = self.place([x, y0]);
            canvas.text(&number(x), [px, py + 13.0], 11.0, MUTED, Align::Centre)?;
        }
        for y in ticks(y0, y1, (most as f64 * self.window.aspect()).ceil() as usize) {
            canvas.stroke(&[[x0, y], [x1, y]].map(|p| self.place(p)), shade(y).mix(1.0), 1.0)?;
            let [px, py] = self.place([x0, y]);
            canvas.text(&number(y), [px - 7.0, py], 11.0, MUTED, Align::Right)?;
        }
        let frame = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|p| self.place(p));
        canvas.outline(&frame, LINE.mix(1.0), 1.0)?;
        let below = [0.5 * (frame[0][0] + frame[1][0]), frame[0][1] + 32.0];
        canvas.text("x ahead (m)", below, 11.0, MUTED, Align::Centre)?;
        let above = [frame[1][0], frame[3][1] - 14.0];
        canvas.text("y to the left (m)", above, 11.0, MUTED, Align::Right)
    }
}

/// What the lines and signs mean.
struct Legend<'a> {
    levels: &'a Levels<'a>,
    items: Vec<(Sign, String)>,
}

#[derive(Clone, Copy)]
enum Sign {
    Level(usize),
    Disc,
    Evader,
    Pursuer,
}

impl<'a> Legend<'a> {
    fn new(levels: &'a Levels<'a>) -> Self {
        let mut items: Vec<_> = levels
            .0
            .iter()
            .enumerate()
            .map(|(i, level)| (Sign::Level(i), format!("V = {} m", number(*level))))
            .collect();
        items.push((Sign::Disc, "danger disc".to_owned()));
        items.push((Sign::Evader, "evader".to_owned()));
        items.push((Sign::Pursuer, "pursuer’s heading".to_owned()));
        Self { levels, items }
    }

    fn advance(text: &str) -> f64 {
        // About the mean width of a letter.
        34.0 + 7.1 * text.chars().count() as f64 + 22.0
    }

    fn width(&self) -> f64 {
        self.items.iter().map(|(_, text)| Self::advance(text)).sum()
    }

    fn draw(&self, canvas: &Canvas<'_>, [mut x, y]: [f64; 2]) -> Result<(), DrawError> {
        for (sign, text) in &self.items {
            match *sign {
                Sign::Level(level) => {
                    let box_ =
                        [[x, y - 6.0], [x + 26.0, y - 6.0], [x + 26.0, y + 6.0], [x, y + 6.0]];
                    let color = self.levels.color(level);
                    if self.levels.is_filled(level) {
                        canvas.fill(&box_, color.mix(0.13))?;
                        canvas.outline(&box_, color.mix(1.0), 2.0)?;
                    } else {
                        canvas.stroke(&[[x, y], [x + 26.0, y]], color.mix(1.0), 2.5)?;
                    }
                }
                Sign::Disc => {
                    canvas.disc([x + 13.0, y], 8.0, MUTED.mix(0.14))?;
                    let edge: Vec<_> = (0..40)
                        .map(|i| {
                            let (sin, cos) = sin_cos(f64::from(i) * TAU / 40.0);
                            [x + 13.0 + 8.0 * cos, y + 8.0 * sin]
                        })
                        .collect();
                    canvas.dashes(&edge, MUTED.mix(1.0), 1.2, 3.1)?;
                }
                Sign::Evader => canvas.vehicle([x + 12.0, y], 0.0, 17.0, HUMAN)?,
                Sign::Pursuer => canvas.arrow([x + 13.0, y], 0.0, 26.0, ROBOT)?,
            }
            canvas.text(text, [x + 34.0, y], 12.5, TEXT, Align::Left)?;
            x += Self::advance(text);
        }
        Ok(())
    }
}
