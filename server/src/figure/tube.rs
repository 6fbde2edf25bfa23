//! {V = 0} as a surface over the plane, relative heading upwards.

use super::canvas::{
    Align, Canvas, DrawError, GRID, HUMAN, LINE, MUTED, TEXT, number, page, ticks,
};
use super::caption;
use plotters::prelude::{Color, RGBAColor, RGBColor};
use sidestep::math::{PI, TAU, atan2, hypot, sin_cos, wrap_angle};
use sidestep::reachability::{CurveSettings, ValueFunction};

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 960.0;
/// Bearings of a full turn, and headings.
const AROUND: usize = 240;
const UP: usize = 120;
/// Headings at which the surface carries a line, every that many.
const RING: usize = UP / 8;
/// Lines on the surface.
const EDGE: RGBColor = RGBColor(0x7d, 0x1f, 0x1c);
/// Where the camera is: azimuth and elevation, rad.
const CAMERA: [f64; 2] = [-0.92, 0.46];

/// The SVG of the surface {V = 0}: along each bearing the outermost point where V ≤ 0.
///
/// # Errors
/// [`DrawError`] if plotters cannot draw it.
pub fn tube(function: &ValueFunction) -> Result<String, DrawError> {
    let surface = Surface::new(function);
    let view = View::new(&surface);
    page("The set V ≤ 0", [WIDTH, HEIGHT], |canvas| {
        let title = "States from which the pursuer can force a collision";
        canvas.bold(title, [32.0, 40.0], 21.0, TEXT, Align::Left)?;
        canvas.text(&caption(function), [32.0, 68.0], 12.0, MUTED, Align::Left)?;
        view.walls(canvas)?;
        surface.draw(canvas, &view)?;
        view.scales(canvas)
    })
}

/// Nodes of the surface by heading and bearing. The bearings of a heading lie closer
/// together towards its outermost point, and one of them is there: the surface has an
/// edge along these points, which would be ragged otherwise.
struct Surface<'a> {
    function: &'a ValueFunction,
    /// (UP + 1) × AROUND.
    nodes: Vec<[f64; 3]>,
}

impl<'a> Surface<'a> {
    fn new(function: &'a ValueFunction) -> Self {
        let radius_m = function.game().radius_m;
        let psi = |i: usize| i as f64 * TAU / UP as f64;
        let tips: Vec<_> = (0..=UP).map(|i| tip(function, psi(i))).collect();
        let mut nodes = Vec::with_capacity((UP + 1) * AROUND);
        for (i, bearing) in followed(&tips).into_iter().enumerate() {
            let outer = tips[i].map_or(radius_m, |[_, range]| range) * 1.005;
            for j in 0..AROUND {
                let t = 2.0 * j as f64 / AROUND as f64 - 1.0;
                let (sin, cos) = sin_cos(bearing + PI * t * (0.25 + 0.75 * t.abs()));
                let inside = |r: f64| function.value([r * cos, r * sin, psi(i)]) <= 0.0;
                let r = outermost(inside, radius_m, outer);
                nodes.push([r * cos, r * sin, psi(i)]);
            }
        }
        Self { function, nodes }
    }

    /// (x, y, ψ) of a node; bearings close on themselves.
    fn node(&self, i: usize, j: usize) -> [f64; 3] {
        self.nodes[i * AROUND + j % AROUND]
    }

    fn draw(&self, canvas: &Canvas<'_>, view: &View) -> Result<(), DrawError> {
        let mut tiles = Vec::new();
        for i in 0..UP {
            for j in 0..AROUND {
                let corners =
                    [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)].map(|(i, j)| self.node(i, j));
                let flat = corners.map(|p| view.place(p));
                // Counter-clockwise seen from outside; downwards on the page.
                if area(&flat) >= 0.0 {
                    continue;
                }
                let middle = [0, 1, 2].map(|d| corners.iter().map(|c| 0.25 * c[d]).sum::<f64>());
                tiles.push((view.depth(middle), i, flat, view.shade(self.normal(middle))));
            }
        }
        tiles.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, i, flat, color) in &tiles {
            canvas.fill(&grown(flat), *color)?;
            // On both sides, since the later one covers half of the line.
            if *i > 0 && i.is_multiple_of(RING) {
                canvas.stroke(&flat[..2], EDGE.mix(1.0), 1.0)?;
            }
            if (i + 1).is_multiple_of(RING) {
                canvas.stroke(&flat[2..], EDGE.mix(1.0), 1.0)?;
            }
        }
        let lid: Vec<_> = (0..AROUND).map(|j| view.place(self.node(UP, j))).collect();
        canvas.fill(&lid, view.shade([0.0, 0.0, 1.0]))?;
        canvas.outline(&lid, EDGE.mix(1.0), 1.0)
    }

    fn normal(&self, middle: [f64; 3]) -> [f64; 3] {
        self.function.state(middle).gradient
    }
}

/// Bearing and range of the outermost point of {V ≤ 0}; none if it is but the disc.
fn tip(function: &ValueFunction, psi: f64) -> Option<[f64; 2]> {
    let settings = CurveSettings { flatness_m: 0.002, ..CurveSettings::default() };
    let curves = function.level_curves(psi, 0.0, settings);
    let ranges = curves.iter().flatten().map(|[x, y]| [atan2(*y, *x), hypot(*x, *y)]);
    let tip = ranges.max_by(|a, b| a[1].total_cmp(&b[1]))?;
    (tip[1] > 1.03 * function.game().radius_m).then_some(tip)
}

/// The bearings of the tips from the middle heading both ways; where they jump, about
/// there: a twist from one heading to the next would look worse than a ragged edge.
fn followed(tips: &[Option<[f64; 2]>]) -> Vec<f64> {
    const MOST: f64 = 0.2;
    const NEAR: f64 = 0.06;
    const SMOOTH: usize = UP / 20;
    let middle = tips.len() / 2;
    let mut bearings = vec![tips[middle].map_or(0.0, |tip| tip[0]); tips.len()];
    let follow = |from: f64, i: usize| match tips[i] {
        Some([to, _]) => from + wrap_angle(to - from).clamp(-MOST, MOST),
        None => from,
    };
    for i in middle + 1..tips.len() {
        bearings[i] = follow(bearings[i - 1], i);
    }
    for i in (0..middle).rev() {
        bearings[i] = follow(bearings[i + 1], i);
    }
    for _ in 0..2 {
        bearings = (0..bearings.len())
            .map(|i| {
                let reach = SMOOTH.min(i).min(bearings.len() - 1 - i);
                let window = &bearings[i - reach..=i + reach];
                window.iter().sum::<f64>() / window.len() as f64
            })
            .collect();
    }
    let bearing = |(i, about): (usize, f64)| match tips[i] {
        Some([tip, _]) if wrap_angle(tip - about).abs() < NEAR => about + wrap_angle(tip - about),
        _ => about,
    };
    bearings.into_iter().enumerate().map(bearing).collect()
}

/// The largest range that is inside, between `inner` (which is) and `outer`.
fn outermost(inside: impl Fn(f64) -> bool, inner: f64, outer: f64) -> f64 {
    const STEPS: u32 = 60;
    let at = |step: u32| outer + (inner - outer) * f64::from(step) / f64::from(STEPS);
    let Some(step) = (0..STEPS).find(|step| inside(at(*step))) else {
        return bisected(inside, inner, at(STEPS - 1));
    };
    if step == 0 { outer } else { bisected(inside, at(step), at(step - 1)) }
}

fn bisected(inside: impl Fn(f64) -> bool, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if inside(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

fn area(points: &[[f64; 2]; 4]) -> f64 {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// A little larger, so that no background shows between neighbours.
fn grown(points: &[[f64; 2]; 4]) -> [[f64; 2]; 4] {
    let middle = [0, 1].map(|d| points.iter().map(|p| 0.25 * p[d]).sum::<f64>());
    points.map(|p| {
        let (dx, dy) = (p[0] - middle[0], p[1] - middle[1]);
        let by = 0.3 / dx.hypot(dy).max(0.3);
        [p[0] + by * dx, p[1] + by * dy]
    })
}

/// From (x, y, ψ) to the page, without perspective.
struct View {
    x: [f64; 2],
    y: [f64; 2],
    /// Pixels a metre, and metres that a radian is drawn as.
    scale: f64,
    per_radian: f64,
    middle: [f64; 2],
    right: [f64; 3],
    up: [f64; 3],
    towards: [f64; 3],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

impl View {
    fn new(surface: &Surface<'_>) -> Self {
        let (mut x, mut y) = ([0.0_f64; 2], [0.0_f64; 2]);
        for i in 0..=UP {
            for j in 0..AROUND {
                let [px, py, _] = surface.node(i, j);
                x = [x[0].min(px), x[1].max(px)];
                y = [y[0].min(py), y[1].max(py)];
            }
        }
        let room = 0.08 * (x[1] - x[0]).max(y[1] - y[0]);
        let (x, y) = ([x[0] - room, x[1] + room], [y[0] - room, y[1] + room]);
        let ((sa, ca), (se, ce)) = (sin_cos(CAMERA[0]), sin_cos(CAMERA[1]));
        let per_radian = 1.1 * (x[1] - x[0]).max(y[1] - y[0]) / TAU;
        let mut view = Self {
            x,
            y,
            scale: 1.0,
            per_radian,
            middle: [0.0; 2],
            right: [-sa, ca, 0.0],
            up: [-ca * se, -sa * se, ce],
            towards: [ca * ce, sa * ce, se],
        };
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for corner in 0..8_usize {
            let pick = |d: usize, ends: [f64; 2]| ends[corner >> d & 1];
            let flat = view.place([pick(0, x), pick(1, y), pick(2, [0.0, TAU])]);
            for d in 0..2 {
                ends[d] = [ends[d][0].min(flat[d]), ends[d][1].max(flat[d])];
            }
        }
        let (wide, high) = (ends[0][1] - ends[0][0], ends[1][1] - ends[1][0]);
        view.scale = ((WIDTH - 170.0) / wide).min((HEIGHT - 210.0) / high);
        let centre = [WIDTH / 2.0 + 14.0, 90.0 + (HEIGHT - 150.0) / 2.0];
        view.middle = [0, 1].map(|d| centre[d] - view.scale * 0.5 * (ends[d][0] + ends[d][1]));
        view
    }

    fn metres(&self, [x, y, psi]: [f64; 3]) -> [f64; 3] {
        [x, y, psi * self.per_radian]
    }

    fn place(&self, state: [f64; 3]) -> [f64; 2] {
        let p = self.metres(state);
        [
            self.middle[0] + self.scale * dot(p, self.right),
            self.middle[1] - self.scale * dot(p, self.up),
        ]
    }

    fn depth(&self, state: [f64; 3]) -> f64 {
        dot(self.metres(state), self.towards)
    }

    /// The robot's red in the light from above the camera's left shoulder.
    fn shade(&self, [gx, gy, g_psi]: [f64; 3]) -> RGBAColor {
        let normal = [gx, gy, g_psi / self.per_radian];
        let unit = |v: [f64; 3]| {
            let length = dot(v, v).sqrt().max(1e-12);
            v.map(|c| c / length)
        };
        let light =
            unit([0, 1, 2].map(|d| self.towards[d] + 0.55 * self.up[d] - 0.75 * self.right[d]));
        let lit = dot(unit(normal), light).max(0.0);
        let stops = [[0x7d, 0x1f, 0x1c], [0xe0, 0x45, 0x3a], [0xf7, 0xb3, 0xa6]];
        let t = 2.0 * (0.16 + 0.84 * lit).min(1.0);
        let (from, share) = if t < 1.0 { (0, t) } else { (1, t - 1.0) };
        let mix = |c: usize| {
            let (a, b) = (f64::from(stops[from][c]), f64::from(stops[from + 1][c]));
            (a + share * (b - a)).round() as u8
        };
        RGBColor(mix(0), mix(1), mix(2)).mix(1.0)
    }

    /// Floor and back walls.
    fn walls(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        let line = |a, b, color: RGBColor| {
            canvas.stroke(&[self.place(a), self.place(b)], color.mix(1.0), 1.0)
        };
        for x in ticks(x0, x1, 8) {
            line([x, y0, 0.0], [x, y1, 0.0], GRID)?;
            line([x, y1, 0.0], [x, y1, TAU], GRID)?;
        }
        for y in ticks(y0, y1, 8) {
            line([x0, y, 0.0], [x1, y, 0.0], GRID)?;
            line([x0, y, 0.0], [x0, y, TAU], GRID)?;
        }
        for eighth in 0..=8 {
            let psi = f64::from(eighth) * TAU / 8.0;
            let color = if eighth == 0 || eighth == 8 { LINE } else { GRID };
            line([x0, y0, psi], [x0, y1, psi], color)?;
            line([x0, y1, psi], [x1, y1, psi], color)?;
        }
        for (x, y) in [(x0, y0), (x0, y1), (x1, y1)] {
            line([x, y, 0.0], [x, y, TAU], LINE)?;
        }
        line([x0, y0, 0.0], [x1, y0, 0.0], LINE)?;
        line([x1, y0, 0.0], [x1, y1, 0.0], LINE)?;
        // Which way the evader heads.
        let tip = 0.5 * (x1 - x0) / 9.0;
        let at = x1 - 2.2 * tip;
        let shape = [[0.9, 0.0], [-0.6, 0.55], [-0.3, 0.0], [-0.6, -0.55]];
        let shape: Vec<_> =
            shape.iter().map(|[a, b]| self.place([at + tip * a, tip * b, 0.0])).collect();
        canvas.fill(&shape, HUMAN.mix(1.0))?;
        let [x, y] = self.place([at - 0.8 * tip, 0.0, 0.0]);
        canvas.text("evader’s heading", [x - 6.0, y - 1.0], 11.0, HUMAN, Align::Right)
    }

    /// Numbers and names of the axes.
    fn scales(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        let label = |text: &str, state, [dx, dy]: [f64; 2], size, align| {
            let [x, y] = self.place(state);
            canvas.text(text, [x + dx, y + dy], size, MUTED, align)
        };
        for x in ticks(x0, x1, 8) {
            label(&number(x), [x, y0, 0.0], [-4.0, 14.0], 11.0, Align::Right)?;
        }
        for y in ticks(y0, y1, 8) {
            label(&number(y), [x1, y, 0.0], [6.0, 13.0], 11.0, Align::Left)?;
        }
        for eighth in 0..=8 {
            let psi = f64::from(eighth) * TAU / 8.0;
            let text = format!("{}°", number(psi * 180.0 / PI));
            label(&text, [x0, y0, psi], [-9.0, 0.0], 11.0, Align::Right)?;
        }
        let (x, y) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
        label("x ahead (m)", [x, y0, 0.0], [-34.0, 38.0], 12.0, Align::Right)?;
        label("y to the left (m)", [x1, y, 0.0], [34.0, 36.0], 12.0, Align::Left)?;
        label("ψ, relative heading", [x0, y0, TAU], [8.0, -24.0], 12.0, Align::Right)
    }
}
