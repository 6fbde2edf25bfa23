//! Level sets {V = c} at fixed relative headings, as small multiples in the evader's frame.

use crate::chart::{
    Area, Axis, Chart, Colour, Drawing, Frame, LegendItem, MARGIN, Note, Pen, Sign, colours, disc,
    headed, number,
};
use crate::math::PI;
use crate::picture::Window;
use crate::reachability::{CurveSettings, ValueFunction};

/// Space left and right of a panel (px).
const ROOM: [f64; 2] = [44.0, 16.0];

type Curves = Vec<Vec<[f64; 2]>>;

/// Draws {V = c} for each of `levels` (m, above −R) at each of the headings `psi_deg`.
#[must_use]
pub fn slices(function: &ValueFunction, psi_deg: &[f64], levels: &[f64]) -> Drawing {
    let curves: Vec<Vec<Curves>> = psi_deg
        .iter()
        .map(|psi| {
            // A level that no state attains has no curves.
            let curves = |level: &f64| {
                let settings = CurveSettings::default();
                function.level_curves(psi * PI / 180.0, *level, settings).unwrap_or_default()
            };
            levels.iter().map(curves).collect()
        })
        .collect();
    let radius_m = function.game().radius_m;
    let window = window_of(&curves, radius_m);
    let (columns, side) = match psi_deg.len() {
        1 => (1, 560.0),
        2 | 4 => (2, 420.0),
        3 | 5 | 6 | 9 => (3, 330.0),
        _ => (4, 270.0),
    };
    let [wide, high] = sides(&window);
    let height = side * high / wide;
    let panels: Vec<Chart> = psi_deg
        .iter()
        .zip(&curves)
        .map(|(psi, curves)| panel(*psi, curves, levels, radius_m, &window, side))
        .collect();
    let [above, below] = panels.first().map_or([0.0; 2], Chart::room);
    let cell = [ROOM[0] + side + ROOM[1], above + height + below + 12.0];
    let width = (columns as f64 * cell[0]).max(700.0);

    let title = if levels.contains(&0.0) {
        "Where the pursuer can force a collision"
    } else {
        "Level sets of the value function"
    };
    let mut drawing = headed(title, &[&caption(function)], width);
    let legend = drawing.legend(&legend(levels), [MARGIN, drawing.size[1] + 8.0], width);
    let top = drawing.size[1] + legend + 14.0;
    for (i, chart) in panels.iter().enumerate() {
        let left = MARGIN + (i % columns) as f64 * cell[0] + ROOM[0];
        let top = top + (i / columns) as f64 * cell[1] + above;
        chart.draw(&mut drawing, Frame { left, top, width: side, height });
    }
    drawing.size[1] = top + psi_deg.len().div_ceil(columns) as f64 * cell[1] + 8.0;
    drawing
}

/// Colour of a level. The lowest non-negative level has the first colour.
fn colour(level: usize, levels: &[f64]) -> Colour {
    let negative = levels.iter().filter(|level| **level < 0.0).count();
    let all = colours::REGIONS.len();
    colours::REGIONS[(level + all * levels.len() - negative) % all]
}

/// Only {V ≤ 0} is filled, because the pursuer can force a collision from there.
fn fill(level: usize, levels: &[f64]) -> Option<colours::Ink> {
    (levels[level] == 0.0).then(|| colour(level, levels).at(0.13))
}

/// The pen for the edge of the danger disc.
fn dashed() -> Pen {
    Pen::new(colours::MUTED, 1.2).dashed(4.0, 4.0)
}

/// The part of the plane that all panels show. Its aspect ratio is limited, because both axes have
/// the same scale.
fn window_of(curves: &[Vec<Curves>], radius_m: f64) -> Window {
    let mut window = Window::square(radius_m);
    for point in curves.iter().flatten().flatten().flatten() {
        window = window.including(*point, 0.0);
    }
    let [wide, high] = sides(&window);
    let room = 0.06 * wide.max(high);
    let widened = |by: [f64; 2], window: Window| Window {
        low: [0, 1].map(|d| window.low[d] - 0.5 * by[d]),
        high: [0, 1].map(|d| window.high[d] + 0.5 * by[d]),
    };
    let window = widened([2.0 * room; 2], window);
    let [wide, high] = sides(&window);
    widened([(high / 1.4 - wide).max(0.0), (0.55 * wide - high).max(0.0)], window)
}

/// Width and height (m).
fn sides(window: &Window) -> [f64; 2] {
    [0, 1].map(|d| window.high[d] - window.low[d])
}

/// The panel of one heading.
fn panel(
    psi_deg: f64,
    curves: &[Curves],
    levels: &[f64],
    radius_m: f64,
    window: &Window,
    side: f64,
) -> Chart {
    let most = side / 46.0;
    let [wide, high] = sides(window);
    let along = |d: usize| [window.low[d], window.high[d]];
    let x = Axis::linear("x ahead", "m", along(0), most as usize);
    let most = (most * high / wide).ceil();
    let y = Axis::linear("y to the left", "m", along(1), most as usize);
    let mut chart = Chart::new(&format!("ψ = {}°", number(psi_deg)), "", x, y);
    // Draws the largest set first, because each set is a subset of the next level's set.
    for (level, curves) in curves.iter().enumerate().rev() {
        for points in curves {
            let edge = Some(Pen::new(colour(level, levels), 2.0));
            let (name, points) = (String::new(), points.clone());
            chart.add(Area { name, points, fill: fill(level, levels), edge });
        }
    }
    let (fill, edge) = (Some(colours::MUTED.at(0.14)), Some(dashed()));
    chart.add(Area { name: String::new(), points: disc([0.0, 0.0], radius_m), fill, edge });
    chart.add(Note::sign(Sign::Vehicle(0.0, 17.0), [0.0, 0.0], colours::HUMAN));
    let heading = Sign::Arrow(psi_deg * PI / 180.0, 28.0);
    let corner = Note::sign(heading, window.high, colours::ROBOT);
    chart.add(Note { offset: [-24.0, 24.0], ..corner });
    chart
}

fn legend(levels: &[f64]) -> Vec<LegendItem> {
    let level = |(i, level): (usize, &f64)| {
        let edge = Some(Pen::new(colour(i, levels), 2.0));
        LegendItem::area(&format!("V = {} m", number(*level)), fill(i, levels), edge)
    };
    let mut items: Vec<_> = levels.iter().enumerate().map(level).collect();
    items.push(LegendItem::disc("danger disc", Some(colours::MUTED.at(0.14)), dashed()));
    items.push(LegendItem::sign("evader", &Sign::Vehicle(0.0, 17.0), colours::HUMAN));
    items.push(LegendItem::sign("pursuer’s heading", &Sign::Arrow(0.0, 26.0), colours::ROBOT));
    items
}

/// One line that describes the function.
#[must_use]
pub fn caption(function: &ValueFunction) -> String {
    let game = function.game();
    let (how, horizon) = match function {
        ValueFunction::Exact(_) => ("closed form", f64::INFINITY),
        ValueFunction::Sampled(samples) => ("solved on a grid", samples.horizon_s()),
    };
    let horizon = if horizon.is_finite() { format!("{horizon} s") } else { "∞".to_owned() };
    format!(
        "evader {} m/s, {} rad/s  ·  pursuer {} m/s, {} rad/s  ·  radius {} m  ·  horizon {horizon}  ·  {how}",
        game.evader.speed_mps,
        game.evader.turn_rate_radps,
        game.pursuer.speed_mps,
        game.pursuer.turn_rate_radps,
        game.radius_m,
    )
}
