//! {V = 0} as a surface over the plane, relative heading upwards.

use super::{MARGIN, Window, caption, headed};
use sidestep::chart::{Align, Axis, Colour, Drawing, Pen, Point, colours, number};
use sidestep::math::{PI, TAU, atan2, hypot, sin_cos};
use sidestep::reachability::{CurveSettings, ValueFunction};

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 960.0;
/// Nodes around each level curve, and headings.
const AROUND: usize = 240;
const UP: usize = 120;
/// Headings at which the surface carries a line, every that many.
const RING: usize = UP / 8;
/// The robot's red in shadow and in bright light, and the lines on the surface.
const SHADOW: Colour = Colour::rgb([0x7d, 0x1f, 0x1c]);
const BRIGHT: Colour = Colour::rgb([0xf7, 0xb3, 0xa6]);
const EDGE: Colour = SHADOW;
/// Where the camera is: azimuth and elevation, rad.
const CAMERA: [f64; 2] = [-0.92, 0.46];

/// The surface {V = 0}: the outermost level curve of each heading.
#[must_use]
pub fn tube(function: &ValueFunction) -> Drawing {
    let surface = Surface::new(function);
    let view = View::new(&surface);
    let title = "States from which the pursuer can force a collision";
    let mut drawing = headed(title, &[&caption(function)], WIDTH - 2.0 * MARGIN);
    drawing.size[1] = HEIGHT;
    view.walls(&mut drawing);
    surface.draw(&mut drawing, &view);
    view.scales(&mut drawing);
    drawing
}

/// Nodes of the surface by heading and along the level curve of each. A curve begins at its
/// outermost point, where the surface has an edge, and its nodes are equally far apart: neighbours
/// on two curves then belong together, wherever the curves bulge.
struct Surface {
    /// (UP + 1) × AROUND.
    nodes: Vec<[f64; 3]>,
}

impl Surface {
    fn new(function: &ValueFunction) -> Self {
        let radius_m = function.game().radius_m;
        let settings = CurveSettings { flatness_m: 0.002, ..CurveSettings::default() };
        let psi = |i: usize| i as f64 * TAU / UP as f64;
        let curve = |i: usize| {
            let curves = function.level_curves(psi(i), 0.0, settings);
            let reach =
                |curve: &Vec<Point>| curve.iter().map(|p| hypot(p[0], p[1])).fold(0.0, f64::max);
            curves.into_iter().max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or_default()
        };
        let curves: Vec<Vec<Point>> = (0..=UP).map(curve).collect();
        let bearings = followed(&curves, radius_m);
        let mut nodes = Vec::with_capacity((UP + 1) * AROUND);
        for (i, (curve, bearing)) in curves.iter().zip(bearings).enumerate() {
            let around = evenly(curve, bearing, radius_m);
            nodes.extend(around.into_iter().map(|[x, y]| [x, y, psi(i)]));
        }
        Self { nodes }
    }

    /// (x, y, ψ) of a node; curves close on themselves.
    fn node(&self, i: usize, j: usize) -> [f64; 3] {
        self.nodes[i * AROUND + j % AROUND]
    }

    fn draw(&self, drawing: &mut Drawing, view: &View) {
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
                tiles.push((view.depth(middle), i, flat, view.shade(view.normal(&corners))));
            }
        }
        tiles.sort_by(|a, b| a.0.total_cmp(&b.0));
        let edge = Pen::new(EDGE, 1.0);
        for (_, i, flat, colour) in &tiles {
            // An edge of the same colour, so that no ground shows between neighbours.
            let seam = Pen::new(*colour, 0.7);
            drawing.polygon(*flat, Some((*colour).into()), Some(seam));
            // On both sides, since the later one covers half of the line.
            if *i > 0 && i.is_multiple_of(RING) {
                drawing.line(&flat[..2], edge);
            }
            if (i + 1).is_multiple_of(RING) {
                drawing.line(&flat[2..], edge);
            }
        }
        let lid: Vec<_> = (0..AROUND).map(|j| view.place(self.node(UP, j))).collect();
        drawing.polygon(lid, Some(view.shade([0.0, 0.0, 1.0]).into()), Some(edge));
    }
}

/// The bearing at which each curve begins: of its outermost point, or, where the curve is hardly
/// more than the danger disc, that of the nearest heading at which it is more.
fn followed(curves: &[Vec<Point>], radius_m: f64) -> Vec<f64> {
    let tip = |curve: &Vec<Point>| {
        let ranges = curve.iter().map(|[x, y]| [atan2(*y, *x), hypot(*x, *y)]);
        let tip = ranges.max_by(|a, b| a[1].total_cmp(&b[1]))?;
        (tip[1] > 1.03 * radius_m).then_some(tip[0])
    };
    let tips: Vec<Option<f64>> = curves.iter().map(tip).collect();
    let nearest = |i: usize| {
        let known = tips.iter().enumerate().filter_map(|(k, tip)| Some((k.abs_diff(i), (*tip)?)));
        known.min_by_key(|(steps, _)| *steps).map_or(0.0, |(_, bearing)| bearing)
    };
    (0..tips.len()).map(nearest).collect()
}

/// Nodes on a closed curve, equally far apart, from where it meets that bearing on; of the danger
/// disc if there is no curve.
fn evenly(curve: &[Point], bearing: f64, radius_m: f64) -> Vec<Point> {
    let disc;
    let curve = if curve.len() < 3 {
        disc = sidestep::chart::disc([0.0, 0.0], radius_m);
        &disc
    } else {
        curve
    };
    let (sin, cos) = sin_cos(bearing);
    let along = |p: &Point| (p[0] * cos + p[1] * sin) / hypot(p[0], p[1]).max(1e-9);
    let start = (0..curve.len()).max_by(|a, b| along(&curve[*a]).total_cmp(&along(&curve[*b])));
    let mut points: Vec<Point> = curve.to_vec();
    points.rotate_left(start.unwrap_or(0));
    points.push(points[0]);
    let lengths: Vec<f64> =
        points.windows(2).map(|p| hypot(p[1][0] - p[0][0], p[1][1] - p[0][1])).collect();
    let total: f64 = lengths.iter().sum();
    let (mut piece, mut before) = (0, 0.0);
    let node = |j: usize| {
        let at = total * j as f64 / AROUND as f64;
        while piece + 1 < lengths.len() && before + lengths[piece] < at {
            before += lengths[piece];
            piece += 1;
        }
        let share = ((at - before) / lengths[piece].max(1e-12)).clamp(0.0, 1.0);
        [0, 1].map(|d| points[piece][d] + share * (points[piece + 1][d] - points[piece][d]))
    };
    (0..AROUND).map(node).collect()
}

fn area(points: &[[f64; 2]; 4]) -> f64 {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
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
    fn new(surface: &Surface) -> Self {
        let nodes = surface.nodes.iter().map(|[x, y, _]| [*x, *y]);
        let Window { x, y } = Window::around(nodes.chain([[0.0, 0.0]]));
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
        let page = Window::around((0..8_usize).map(|corner| {
            let pick = |d: usize, ends: [f64; 2]| ends[corner >> d & 1];
            view.place([pick(0, x), pick(1, y), pick(2, [0.0, TAU])])
        }));
        view.scale = ((WIDTH - 170.0) / page.wide()).min((HEIGHT - 210.0) / page.high());
        let centre = [WIDTH / 2.0 + 14.0, 90.0 + (HEIGHT - 150.0) / 2.0];
        let ends = [page.x, page.y];
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

    /// Of a tile, outwards, in metres as drawn.
    fn normal(&self, corners: &[[f64; 3]; 4]) -> [f64; 3] {
        let [a, b, c, d] = corners.map(|corner| self.metres(corner));
        let from_to = |from: [f64; 3], to: [f64; 3]| [0, 1, 2].map(|i| to[i] - from[i]);
        let ([ux, uy, uz], [vx, vy, vz]) = (from_to(a, c), from_to(b, d));
        [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx]
    }

    /// The robot's red in the light from above the camera's left shoulder.
    fn shade(&self, normal: [f64; 3]) -> Colour {
        let unit = |v: [f64; 3]| {
            let length = dot(v, v).sqrt().max(1e-12);
            v.map(|c| c / length)
        };
        let light =
            unit([0, 1, 2].map(|d| self.towards[d] + 0.55 * self.up[d] - 0.75 * self.right[d]));
        let lit = dot(unit(normal), light).max(0.0);
        // Few tones, so that neighbours often share one.
        let t = 2.0 * ((0.16 + 0.84 * lit).min(1.0) * 64.0).round() / 64.0;
        if t < 1.0 {
            SHADOW.towards(colours::ROBOT, t)
        } else {
            colours::ROBOT.towards(BRIGHT, t - 1.0)
        }
    }

    /// Floor and back walls.
    fn walls(&self, drawing: &mut Drawing) {
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        let mut line = |a, b, colour: Colour| {
            drawing.line([self.place(a), self.place(b)], Pen::new(colour, 1.0));
        };
        for x in ticks(self.x) {
            line([x, y0, 0.0], [x, y1, 0.0], colours::GRID);
            line([x, y1, 0.0], [x, y1, TAU], colours::GRID);
        }
        for y in ticks(self.y) {
            line([x0, y, 0.0], [x1, y, 0.0], colours::GRID);
            line([x0, y, 0.0], [x0, y, TAU], colours::GRID);
        }
        for eighth in 0..=8 {
            let psi = f64::from(eighth) * TAU / 8.0;
            let colour = if eighth % 8 == 0 { colours::LINE } else { colours::GRID };
            line([x0, y0, psi], [x0, y1, psi], colour);
            line([x0, y1, psi], [x1, y1, psi], colour);
        }
        for (x, y) in [(x0, y0), (x0, y1), (x1, y1)] {
            line([x, y, 0.0], [x, y, TAU], colours::LINE);
        }
        line([x0, y0, 0.0], [x1, y0, 0.0], colours::LINE);
        line([x1, y0, 0.0], [x1, y1, 0.0], colours::LINE);
        // Which way the evader heads.
        let tip = 0.5 * (x1 - x0) / 9.0;
        let at = x1 - 2.2 * tip;
        let shape = [[0.9, 0.0], [-0.6, 0.55], [-0.3, 0.0], [-0.6, -0.55]];
        let shape = shape.map(|[a, b]| self.place([at + tip * a, tip * b, 0.0]));
        drawing.polygon(shape, Some(colours::HUMAN.into()), None);
        let [x, y] = self.place([at - 0.8 * tip, 0.0, 0.0]);
        drawing.text("evader’s heading", [x - 6.0, y - 1.0], 11.0, colours::HUMAN, Align::Right);
    }

    /// Numbers and names of the axes.
    fn scales(&self, drawing: &mut Drawing) {
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        let mut label = |text: &str, state, [dx, dy]: [f64; 2], size, align| {
            let [x, y] = self.place(state);
            drawing.text(text, [x + dx, y + dy], size, colours::MUTED, align);
        };
        for x in ticks(self.x) {
            label(&number(x), [x, y0, 0.0], [-4.0, 14.0], 11.0, Align::Right);
        }
        for y in ticks(self.y) {
            label(&number(y), [x1, y, 0.0], [6.0, 13.0], 11.0, Align::Left);
        }
        for eighth in 0..=8 {
            let psi = f64::from(eighth) * TAU / 8.0;
            let text = format!("{}°", number(psi * 180.0 / PI));
            label(&text, [x0, y0, psi], [-9.0, 0.0], 11.0, Align::Right);
        }
        let (x, y) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
        label("x ahead (m)", [x, y0, 0.0], [-34.0, 38.0], 12.0, Align::Right);
        label("y to the left (m)", [x1, y, 0.0], [34.0, 36.0], 12.0, Align::Left);
        label("ψ, relative heading", [x0, y0, TAU], [8.0, -24.0], 12.0, Align::Right);
    }
}

/// Round numbers along an axis.
fn ticks(ends: [f64; 2]) -> Vec<f64> {
    Axis::linear("", "", ends, 8).labels.into_iter().map(|(value, _)| value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::reachability::ExactValue;

    /// Streaks once ran over the surface where the outermost point of a heading was far from that
    /// of the next one.
    #[test]
    fn neighbouring_curves_belong_together() {
        let function = ValueFunction::Exact(ExactValue::new(2.0, 0.5, 3.0).unwrap());
        let surface = Surface::new(&function);
        for i in 0..UP {
            for j in 0..AROUND {
                let ([ax, ay, _], [bx, by, _]) = (surface.node(i, j), surface.node(i + 1, j));
                assert!(hypot(bx - ax, by - ay) < 1.0, "{i} {j}");
            }
        }
    }

    #[test]
    fn nodes_are_equally_far_apart() {
        let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let around = evenly(&square, 0.75 * PI, 1.0);
        assert_eq!((around.len(), around[0]), (AROUND, [-1.0, 1.0]));
        for (a, b) in around.iter().zip(around.iter().skip(1)) {
            assert!((hypot(b[0] - a[0], b[1] - a[1]) - 8.0 / AROUND as f64).abs() < 1e-12);
        }
        assert!(evenly(&[], 1.0, 3.0).iter().all(|[x, y]| (hypot(*x, *y) - 3.0).abs() < 2e-3));
    }
}
