//! The sublevel set {V ≤ c} as a solid in orthographic projection from any side. The axis of ψ is
//! vertical.

use super::mesh::{Mesh, height_m};
use super::slices::caption;
use crate::chart::{self, Align, Axis, Colour, Drawing, Pen, colours, headed, number, width_of};
use crate::math::{PI, TAU, sin_cos};
use crate::picture::Window;
use crate::reachability::ValueFunction;

/// The box around a solid, and the direction from which it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    window: Window,
    /// Height of one radian of ψ in the drawing, in metres at the scale of x and y.
    per_radian: f64,
    /// Width and height of the picture (px).
    size: [f64; 2],
    /// Pixels per metre.
    scale: f64,
    right: [f64; 3],
    up: [f64; 3],
    towards: [f64; 3],
}

impl Orbit {
    /// A box over `window`, seen from the azimuth and elevation `turned_deg`, in a picture of this
    /// size (px). The box is `zoom` times the size that fits from every side.
    #[must_use]
    pub fn new(window: Window, turned_deg: [i16; 2], zoom: f64, size: [f64; 2]) -> Self {
        let sides = [0, 1].map(|d| window.high[d] - window.low[d]);
        let per_radian = height_m(window) / TAU;
        let half = 0.5
            * (sides[0] * sides[0] + sides[1] * sides[1] + height_m(window) * height_m(window))
                .sqrt();
        let (sa, ca) = sin_cos(f64::from(turned_deg[0]) * PI / 180.0);
        let (se, ce) = sin_cos(f64::from(turned_deg[1]) * PI / 180.0);
        let scale = zoom * (0.5 * size[0].min(size[1]) - MARGIN) / half;
        Self {
            window,
            per_radian,
            size,
            scale,
            right: [-sa, ca, 0.0],
            up: [-ca * se, -sa * se, ce],
            towards: [ca * ce, sa * ce, se],
        }
    }

    /// Position in the drawing relative to the box's centre, in metres at the scale of x and y.
    fn metres(&self, [x, y, psi]: [f64; 3]) -> [f64; 3] {
        let middle = [0, 1].map(|d| 0.5 * (self.window.low[d] + self.window.high[d]));
        [x - middle[0], y - middle[1], (psi - PI) * self.per_radian]
    }

    /// Projects a state into the picture (px).
    #[must_use]
    pub fn place(&self, state: [f64; 3]) -> [f64; 2] {
        let at = self.metres(state);
        [
            0.5 * self.size[0] + self.scale * dot(at, self.right),
            0.5 * self.size[1] - self.scale * dot(at, self.up),
        ]
    }

    /// Matrix from (x, y, ψ, 1) to clip coordinates, in column-major order.
    #[must_use]
    pub fn matrix(&self) -> [f32; 16] {
        let origin = self.metres([0.0; 3]);
        let across = self.towards.map(|part| -part / DEEP);
        let rows = [
            (self.right, 2.0 * self.scale / self.size[0]),
            (self.up, 2.0 * self.scale / self.size[1]),
            (across, self.scale / self.size[0].max(self.size[1])),
        ];
        let mut matrix = [0.0; 16];
        for (row, (direction, scale)) in rows.into_iter().enumerate() {
            for (column, part) in direction.into_iter().enumerate() {
                let stretch = if column == 2 { self.per_radian } else { 1.0 };
                matrix[4 * column + row] = (scale * part * stretch) as f32;
            }
            matrix[12 + row] = (scale * dot(origin, direction)) as f32;
        }
        matrix[15] = 1.0;
        matrix
    }

    /// Unit vector towards the light: above the viewer's left shoulder.
    #[must_use]
    pub fn light(&self) -> [f32; 3] {
        let from = [0, 1, 2].map(|d| self.towards[d] + 0.55 * self.up[d] - 0.75 * self.right[d]);
        let length = dot(from, from).sqrt();
        from.map(|part| (part / length) as f32)
    }

    /// The walls of the box behind the solid, with axes.
    #[must_use]
    pub fn walls(&self, title: &str) -> Drawing {
        let mut drawing = Drawing::new(title, "", self.size);
        let ends = [0, 1].map(|d| [self.window.low[d], self.window.high[d]]);
        // The walls are at the far end of each axis, behind the solid.
        let far = |d: usize| usize::from(self.towards[d] < 0.0);
        let [back_x, back_y] = [0, 1].map(|d| ends[d][far(d)]);
        let [front_x, front_y] = [0, 1].map(|d| ends[d][1 - far(d)]);
        let floor = if self.towards[2] >= 0.0 { 0.0 } else { TAU };
        let pen = |colour: Colour| Pen::new(colour, 1.0);
        let mut line = |a, b, colour| {
            drawing.line([self.place(a), self.place(b)], pen(colour));
        };
        let [x, y] = ends;
        for at in ticks(x) {
            line([at, y[0], floor], [at, y[1], floor], colours::GRID);
            line([at, back_y, 0.0], [at, back_y, TAU], colours::GRID);
        }
        for at in ticks(y) {
            line([x[0], at, floor], [x[1], at, floor], colours::GRID);
            line([back_x, at, 0.0], [back_x, at, TAU], colours::GRID);
        }
        for quarter in 0..=4 {
            let psi = f64::from(quarter) * PI / 2.0;
            line([back_x, y[0], psi], [back_x, y[1], psi], colours::GRID);
            line([x[0], back_y, psi], [x[1], back_y, psi], colours::GRID);
        }
        for (a, b) in [(back_x, back_y), (front_x, back_y), (back_x, front_y)] {
            line([a, b, 0.0], [a, b, TAU], colours::LINE);
        }
        for psi in [0.0, TAU] {
            line([back_x, y[0], psi], [back_x, y[1], psi], colours::LINE);
            line([x[0], back_y, psi], [x[1], back_y, psi], colours::LINE);
        }
        line([front_x, y[0], floor], [front_x, y[1], floor], colours::LINE);
        line([x[0], front_y, floor], [x[1], front_y, floor], colours::LINE);
        self.numbers(&mut drawing, [front_x, front_y], [back_x, back_y], floor);
        drawing
    }

    /// The solid in its box, for a file, drawn from back to front.
    #[must_use]
    pub fn drawing(&self, mesh: &Mesh, title: &str) -> Drawing {
        let mut drawing = self.walls(title);
        let light = self.light().map(f64::from);
        let mut tiles = Vec::with_capacity(mesh.indices.len() / 3);
        for triangle in mesh.indices.chunks_exact(3) {
            let corners = [0, 1, 2].map(|n| mesh.vertex(triangle[n]));
            let flat = corners.map(|(state, _)| self.place(state));
            // A triangle that appears clockwise faces away. The cross product of its edges is
            // positive, because y points downwards.
            let [[ax, ay], [bx, by], [cx, cy]] = flat;
            if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) >= 0.0 {
                continue;
            }
            let depth: f64 =
                corners.iter().map(|(at, _)| dot(self.metres(*at), self.towards) / 3.0).sum();
            let normal =
                [0, 1, 2].map(|d| corners.iter().map(|(_, normal)| normal[d]).sum::<f64>());
            let length = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
            tiles.push((depth, Tile::Face(flat, shade(dot(normal, light) / length))));
            if let Some(ends) = ring(corners.map(|(state, _)| state)) {
                // The ring is drawn over its own triangle and the neighbouring triangles.
                let nearer = 0.01 * self.size[0].min(self.size[1]) / self.scale;
                tiles.push((depth + nearer, Tile::Ring(ends.map(|state| self.place(state)))));
            }
        }
        tiles.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, tile) in tiles {
            match tile {
                // An edge of the same colour closes gaps between neighbouring triangles.
                Tile::Face(flat, colour) => {
                    drawing.polygon(flat, Some(colour.into()), Some(Pen::new(colour, 0.6)));
                }
                Tile::Ring(ends) => drawing.line(ends, Pen::new(TONES[0], 1.0)),
            }
        }
        drawing
    }

    /// The numbers and names of the axes, along the front edges. Names are placed first; a number that would
    /// overlap another label is omitted, for example where an axis is seen end-on.
    fn numbers(
        &self,
        drawing: &mut Drawing,
        [front_x, front_y]: [f64; 2],
        [back_x, back_y]: [f64; 2],
        floor: f64,
    ) {
        let centre = self.place([0.5 * (front_x + back_x), 0.5 * (front_y + back_y), floor]);
        let [x, y] = [0, 1].map(|d| [self.window.low[d], self.window.high[d]]);
        // ψ is labelled at the leftmost vertical edge.
        let edges = [(front_x, back_y), (back_x, front_y)];
        let left = if self.place([edges[0].0, edges[0].1, 0.0])[0]
            <= self.place([edges[1].0, edges[1].1, 0.0])[0]
        {
            edges[0]
        } else {
            edges[1]
        };
        let upright = |psi: f64| self.place([left.0, left.1, psi]);
        let edge_x = [x[0], x[1]].map(|at| self.place([at, front_y, floor]));
        let edge_y = [y[0], y[1]].map(|at| self.place([front_x, at, floor]));
        let [beside_x, beside_y] = [edge_x, edge_y].map(|edge| outwards(edge, centre, floor));
        let mut labels = Labels(Vec::new());
        let from = upright(1.75 * PI);
        labels.add(drawing, "ψ", [from[0] - 36.0, from[1]], 12.0, Align::Right);
        for (words, edge, beside) in
            [("x ahead (m)", edge_x, beside_x), ("y to the left (m)", edge_y, beside_y)]
        {
            // The name is placed outside the numbers for any direction of the edge, but within the
            // picture.
            let half = [0.5 * width_of(words, 11.5, false), 8.0];
            let away = 30.0 + beside[0].abs() * half[0];
            let at = [0, 1].map(|d| {
                let at = 0.5 * (edge[0][d] + edge[1][d]) + away * beside[d];
                at.clamp(half[d], (self.size[d] - half[d]).max(half[d]))
            });
            labels.add(drawing, words, at, 11.5, Align::Centre);
        }
        for quarter in 0..=4 {
            let [px, py] = upright(f64::from(quarter) * PI / 2.0);
            let words = format!("{}°", 90 * quarter);
            labels.add(drawing, &words, [px - 7.0, py], 10.5, Align::Right);
        }
        let places_x = ticks(x).into_iter().map(|at| (at, [at, front_y, floor], beside_x));
        let places_y = ticks(y).into_iter().map(|at| (at, [front_x, at, floor], beside_y));
        for (at, state, beside) in places_x.chain(places_y) {
            let on = self.place(state);
            let at_px = [0, 1].map(|d| on[d] + 14.0 * beside[d]);
            labels.add(drawing, &number(at), at_px, 10.5, Align::Centre);
        }
    }
}

/// Unit vector perpendicular to an edge of the floor, pointing away from the floor's centre. If the
/// edge is seen end-on, it points straight away from the centre. If the floor is seen edge-on, it
/// points away from the box.
fn outwards([a, b]: [[f64; 2]; 2], centre: [f64; 2], floor: f64) -> [f64; 2] {
    let [along, from] =
        [[0, 1].map(|d| b[d] - a[d]), [0, 1].map(|d| 0.5 * (a[d] + b[d]) - centre[d])];
    let length = |v: [f64; 2]| (v[0] * v[0] + v[1] * v[1]).sqrt();
    let outside = [0.0, if floor > 0.0 { -1.0 } else { 1.0 }];
    if length(along) < END_ON {
        let away = length(from);
        return if away < END_ON { outside } else { from.map(|part| part / away) };
    }
    let across = [-along[1], along[0]].map(|part| part / length(along));
    let side = across[0] * from[0] + across[1] * from[1];
    let side = if side.abs() < 1.0 { across[1] * outside[1] } else { side };
    across.map(|part| part * side.signum())
}

/// An edge shorter than this counts as seen end-on (px).
const END_ON: f64 = 8.0;

/// The placed labels: left, top, right and bottom of each (px).
struct Labels(Vec<[f64; 4]>);

impl Labels {
    /// Writes a label unless it would overlap one that is already placed.
    fn add(&mut self, drawing: &mut Drawing, words: &str, at: [f64; 2], size: f64, align: Align) {
        let width = width_of(words, size, false);
        let left = if matches!(align, Align::Right) { at[0] - width } else { at[0] - 0.5 * width };
        let this = [left - 2.0, at[1] - 0.6 * size, left + width + 2.0, at[1] + 0.6 * size];
        let lies_on = |other: &[f64; 4]| {
            this[0] < other[2] && other[0] < this[2] && this[1] < other[3] && other[1] < this[3]
        };
        if !self.0.iter().any(lies_on) {
            self.0.push(this);
            drawing.text(words, at, size, colours::MUTED, align);
        }
    }
}

/// Tones of the robot's red: in shadow, unchanged, and in bright light.
pub const TONES: [Colour; 3] = [
    Colour::rgb([0x7d, 0x1f, 0x1c]),
    Colour::rgb(colours::ROBOT.light),
    Colour::rgb([0xf7, 0xb3, 0xa6]),
];

/// A triangle or a ring segment of a solid.
enum Tile {
    Face([[f64; 2]; 3], Colour),
    Ring([[f64; 2]; 2]),
}

/// The intersection of a triangle with a plane at a multiple of 45°, if any.
fn ring(corners: [[f64; 3]; 3]) -> Option<[[f64; 3]; 2]> {
    let lowest = corners.iter().map(|[.., psi]| *psi).fold(f64::INFINITY, f64::min);
    let psi = (lowest / RING).floor() * RING + RING;
    let ends = [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(a, b)| {
        let (from, to) = (corners[a], corners[b]);
        let share = (psi - from[2]) / (to[2] - from[2]);
        let is_cut = (from[2] < psi) != (to[2] < psi);
        is_cut.then(|| [0, 1, 2].map(|d| from[d] + share * (to[d] - from[d])))
    });
    let ends: Vec<[f64; 3]> = ends.collect();
    ends.try_into().ok()
}

/// The tone of a surface for the cosine between its normal and the light.
fn shade(lit: f64) -> Colour {
    let [shadow, middle, bright] = TONES;
    let lit = (0.16 + 0.84 * lit.max(0.0)).min(1.0);
    // There are only a few tones, so that neighbouring triangles often share one.
    let share = 2.0 * (lit * 48.0).round() / 48.0;
    if share < 1.0 { shadow.towards(middle, share) } else { middle.towards(bright, share - 1.0) }
}

/// A figure of {V ≤ `level_m`} with a description of the game, for a file. `mesh` must belong to
/// this function and level.
#[must_use]
pub fn tube(function: &ValueFunction, level_m: f64, mesh: &Mesh, orbit: &Orbit) -> Drawing {
    let title = match level_m {
        0.0 => "States from which the pursuer can force a collision".to_owned(),
        level => format!("States with V ≤ {} m", number(level)),
    };
    let solid = orbit.drawing(mesh, &title);
    let [width, height] = solid.size;
    let mut drawing = headed(&title, &[&caption(function)], width - 2.0 * chart::MARGIN);
    let top = drawing.size[1];
    drawing.place(&solid, [0.5 * (drawing.size[0] - width), top]);
    drawing.size[1] = top + height;
    drawing
}

/// Spacing of the rings on a solid (rad).
pub const RING: f64 = PI / 4.0;

/// Margin around the box (px).
const MARGIN: f64 = 16.0;
/// Depth range of the clip space, relative to its width.
const DEEP: f64 = 2.0;

/// Round numbers along an axis.
fn ticks(ends: [f64; 2]) -> Vec<f64> {
    Axis::linear("", "", ends, 6).labels.into_iter().map(|(value, _)| value).collect()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::Form;

    fn orbit(turned_deg: [i16; 2]) -> Orbit {
        let window = Window { low: [-6.0, -9.0], high: [14.0, 9.0] };
        Orbit::new(window, turned_deg, 1.0, [640.0, 480.0])
    }

    /// The GPU's matrix and the drawn walls place states at the same pixels.
    #[test]
    fn the_matrix_places_states_as_the_walls_do() {
        for turned in [[0, 0], [-52, 26], [170, -40], [33, 90]] {
            let orbit = orbit(turned);
            let matrix = orbit.matrix().map(f64::from);
            for state in [[0.0, 0.0, 0.0], [14.0, -9.0, TAU], [3.0, 4.0, 1.0]] {
                let clip = [0, 1, 2].map(|row| {
                    let part = |column: usize| matrix[4 * column + row];
                    part(0) * state[0] + part(1) * state[1] + part(2) * state[2] + part(3)
                });
                let px = [320.0 * (1.0 + clip[0]), 240.0 * (1.0 - clip[1])];
                let expected = orbit.place(state);
                assert!((px[0] - expected[0]).abs() < 1e-3 && (px[1] - expected[1]).abs() < 1e-3);
                assert!(clip[2].abs() < 1.0, "{clip:?}");
            }
        }
    }

    /// The labels on the walls: the words, and left, top, right and bottom (px).
    fn labels(turned_deg: [i16; 2]) -> Vec<(String, [f64; 4])> {
        let walls = orbit(turned_deg).walls("");
        let texts = walls.shapes.into_iter().filter_map(|shape| match shape.form {
            Form::Text(text) => Some(text),
            _ => None,
        });
        let boxed = texts.map(|text| {
            let width = width_of(&text.text, text.size, text.bold);
            let left = match text.align {
                Align::Left => text.at[0],
                Align::Centre => text.at[0] - 0.5 * width,
                Align::Right => text.at[0] - width,
            };
            let [top, bottom] = [-0.5, 0.5].map(|half| text.at[1] + half * text.size);
            (text.text, [left, top, left + width, bottom])
        });
        boxed.collect()
    }

    #[test]
    fn no_label_lies_on_another_from_any_side() {
        for around in (-180..180).step_by(15) {
            for above in [-90, -45, -10, 0, 5, 20, 60, 90] {
                let labels = labels([around, above]);
                let names = ["x ahead (m)", "y to the left (m)", "ψ"];
                let named = names.map(|name| labels.iter().any(|(words, _)| words == name));
                assert!(named[2] && (named[0] || named[1]), "{around}, {above}: {labels:?}");
                for (n, (a, at)) in labels.iter().enumerate() {
                    for (b, other) in &labels[..n] {
                        let apart = at[0] >= other[2]
                            || other[0] >= at[2]
                            || at[1] >= other[3]
                            || other[1] >= at[3];
                        assert!(apart, "{around}, {above}: {a} on {b}");
                    }
                }
            }
        }
        // Where both axes are clearly visible, no label is omitted.
        let numbers = 5 + ticks([-6.0, 14.0]).len() + ticks([-9.0, 9.0]).len();
        assert_eq!(labels([-52, 26]).len(), 3 + numbers);
    }

    #[test]
    fn the_box_fits_from_every_side() {
        for turned in [[0, 0], [-52, 26], [45, 35], [90, 90], [-135, -60]] {
            let orbit = orbit(turned);
            for corner in 0..8 {
                let x = if corner & 1 == 0 { -6.0 } else { 14.0 };
                let y = if corner & 2 == 0 { -9.0 } else { 9.0 };
                let psi = if corner & 4 == 0 { 0.0 } else { TAU };
                let [px, py] = orbit.place([x, y, psi]);
                assert!((0.0..=640.0).contains(&px) && (0.0..=480.0).contains(&py));
            }
        }
    }
}
