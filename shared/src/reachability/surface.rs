//! The surface {V = c} over x, y and ψ, as triangles (marching tetrahedra).

use crate::math::TAU;

/// A function sampled on a grid over a rectangle of the plane and the full turn of headings.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    low: [f64; 2],
    high: [f64; 2],
    nodes: [usize; 3],
    /// Row-major over x, y, ψ.
    values: Vec<f32>,
}

/// Triangles over x, y, m, and ψ, rad. The heading is periodic: the surface ends at ψ = 0 and at ψ = 2π
/// with the same points, and is closed otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// (x, y, ψ).
    pub vertices: Vec<[f64; 3]>,
    /// Three vertices each, counter-clockwise seen from where the function is above the level.
    pub triangles: Vec<[u32; 3]>,
}

/// The corners of the six tetrahedra of a cell, as bits of x, y and ψ. All six have the diagonal from 000
/// to 111, and all cells are divided alike, so faces of neighbours are the same triangles.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// A crossing is improved until it misses the level by at most this share of the difference between its ends,
/// and at most so many times.
const MISS: f64 = 1e-4;
const STEPS: usize = 16;

impl Sampling {
    /// Samples `value` on `nodes` of x, y and ψ (at least three, three and two) between two corners of the
    /// plane, m; the last heading is one node before 2π.
    pub fn new(
        value: impl Fn([f64; 3]) -> f64,
        low: [f64; 2],
        high: [f64; 2],
        nodes: [usize; 3],
    ) -> Self {
        let nodes = [nodes[0].max(3), nodes[1].max(3), nodes[2].max(2)];
        let mut sampling = Self { low, high, nodes, values: Vec::new() };
        let [columns, rows, headings] = nodes;
        sampling.values.reserve(columns * rows * headings);
        for i in 0..columns {
            for j in 0..rows {
                for k in 0..headings {
                    sampling.values.push(value(sampling.point([i, j, k])) as f32);
                }
            }
        }
        sampling
    }

    fn point(&self, [i, j, k]: [usize; 3]) -> [f64; 3] {
        let along = |d: usize, n: usize| {
            let share = n as f64 / (self.nodes[d] - 1) as f64;
            self.low[d] + share * (self.high[d] - self.low[d])
        };
        [along(0, i), along(1, j), k as f64 * TAU / self.nodes[2] as f64]
    }

    /// The function at a node less the level. Nodes at the edge of the rectangle count as above it, so that
    /// a set that leaves the rectangle is closed there.
    fn excess(&self, [i, j, k]: [usize; 3], level: f64) -> f64 {
        let [columns, rows, headings] = self.nodes;
        if i == 0 || j == 0 || i + 1 == columns || j + 1 == rows {
            return f64::INFINITY;
        }
        f64::from(self.values[(i * rows + j) * headings + k % headings]) - level
    }

    /// The surface on which `value`, the sampled function, is `level`.
    pub fn surface(&self, value: impl Fn([f64; 3]) -> f64, level: f64) -> Surface {
        let [columns, rows, headings] = self.nodes;
        let mut surface = Surface::default();
        // The vertex on the edge from a node in one of seven directions.
        let mut known = vec![u32::MAX; 7 * columns * rows * (headings + 1)];
        for i in 0..columns - 1 {
            for j in 0..rows - 1 {
                for k in 0..headings {
                    let corner =
                        |bits: usize| [i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2)];
                    let excess: [f64; 8] =
                        core::array::from_fn(|bits| self.excess(corner(bits), level));
                    let inside = excess.map(|excess| excess <= 0.0);
                    if inside == [true; 8] || inside == [false; 8] {
                        continue;
                    }
                    for tetrahedron in TETRAHEDRA {
                        let (within, beyond): (Vec<usize>, Vec<usize>) =
                            tetrahedron.into_iter().partition(|corner| inside[*corner]);
                        let mut vertex = |a: usize, b: usize| {
                            let (from, to) = (a.min(b), a.max(b));
                            let [x, y, z] = corner(from);
                            let node = (x * rows + y) * (headings + 1) + z;
                            let place = &mut known[7 * node + (to ^ from) - 1];
                            if *place == u32::MAX {
                                *place = surface.vertices.len() as u32;
                                let ends =
                                    [a, b].map(|bits| (self.point(corner(bits)), excess[bits]));
                                surface.vertices.push(crossing(&value, level, ends));
                            }
                            *place
                        };
                        let rings: Vec<[u32; 3]> = match (&within[..], &beyond[..]) {
                            ([a], [b, c, d]) | ([b, c, d], [a]) => {
                                let other = if within.len() == 1 {
                                    [vertex(*a, *b), vertex(*a, *c), vertex(*a, *d)]
                                } else {
                                    [vertex(*b, *a), vertex(*c, *a), vertex(*d, *a)]
                                };
                                vec![other]
                            }
                            ([a, b], [c, d]) => {
                                let ring = [
                                    vertex(*a, *c),
                                    vertex(*a, *d),
                                    vertex(*b, *d),
                                    vertex(*b, *c),
                                ];
                                vec![[ring[0], ring[1], ring[2]], [ring[0], ring[2], ring[3]]]
                            }
                            _ => Vec::new(),
                        };
                        let middle = |corners: &[usize]| {
                            let points = corners.iter().map(|bits| self.point(corner(*bits)));
                            let sum = points.fold([0.0; 3], |sum, p| add(sum, p, 1.0));
                            sum.map(|c| c / corners.len().max(1) as f64)
                        };
                        let outwards = add(middle(&beyond), middle(&within), -1.0);
                        for [a, b, c] in rings {
                            let [p, q, r] = [a, b, c].map(|v| surface.vertices[v as usize]);
                            let normal = cross(add(q, p, -1.0), add(r, p, -1.0));
                            let is_outwards = dot(normal, outwards) >= 0.0;
                            surface.triangles.push(if is_outwards { [a, b, c] } else { [a, c, b] });
                        }
                    }
                }
            }
        }
        surface
    }
}

impl Surface {
    /// The volume that it encloses, m²·rad.
    #[must_use]
    pub fn volume(&self) -> f64 {
        // The flux of (x, 0, 0), which none passes through the ends at ψ = 0 and 2π.
        let flux = |triangle: &[u32; 3]| {
            let [p, q, r] = triangle.map(|v| self.vertices[v as usize]);
            let [normal_x, ..] = cross(add(q, p, -1.0), add(r, p, -1.0));
            0.5 * normal_x * (p[0] + q[0] + r[0]) / 3.0
        };
        self.triangles.iter().map(flux).sum()
    }
}

/// Where `value` is `level` between a node inside and a node outside, each with its excess over the level.
fn crossing(
    value: impl Fn([f64; 3]) -> f64,
    level: f64,
    [(a, low), (b, high)]: [([f64; 3], f64); 2],
) -> [f64; 3] {
    let (inside, mut low, outside, mut high) =
        if low <= high { (a, low, b, high) } else { (b, high, a, low) };
    if high.is_infinite() {
        return outside;
    }
    let (mut s, mut t) = (0.0, 1.0);
    let at = |share: f64| [0, 1, 2].map(|d| inside[d] + share * (outside[d] - inside[d]));
    let mut share = 0.5;
    // Regula falsi; the bracket stays, and a weight keeps one end from staying for ever (Illinois).
    let mut last = None;
    let miss = MISS * (high - low);
    for _ in 0..STEPS {
        share = if high > low { s - low * (t - s) / (high - low) } else { 0.5 * (s + t) };
        let excess = value(at(share)) - level;
        if excess.abs() <= miss {
            break;
        }
        let is_inside = excess <= 0.0;
        if is_inside {
            (s, low) = (share, excess);
        } else {
            (t, high) = (share, excess);
        }
        if last == Some(is_inside) {
            if is_inside { high *= 0.5 } else { low *= 0.5 }
        }
        last = Some(is_inside);
    }
    at(share)
}

fn add(a: [f64; 3], b: [f64; 3], times: f64) -> [f64; 3] {
    [0, 1, 2].map(|d| a[d] + times * b[d])
}

fn cross([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, hypot};
    use crate::reachability::{Accuracy, ExactValue, Options, PursuitGame, ValueFunction, solve};
    use crate::vehicle::VehicleModel;
    use core::ops::ControlFlow;
    use std::collections::HashMap;

    /// Every edge belongs to two triangles, which go along it in opposite directions, if ψ = 2π is ψ = 0.
    fn check_closed(surface: &Surface) {
        let bits = |v: u32| {
            let [x, y, psi] = surface.vertices[v as usize];
            let psi = if (psi - TAU).abs() < 1e-12 { 0.0 } else { psi };
            [x, y, psi].map(f64::to_bits)
        };
        let mut edges: HashMap<_, i32> = HashMap::new();
        for &[a, b, c] in &surface.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let (from, to) = (bits(from), bits(to));
                // A triangle without an area may have two vertices at one place.
                if from == to {
                    continue;
                }
                *edges.entry((from.min(to), from.max(to))).or_default() +=
                    if from < to { 1 } else { -1 };
            }
        }
        assert!(edges.len() > 100);
        let open = edges.values().filter(|sum| **sum != 0).count();
        assert_eq!(open, 0, "of {} edges", edges.len());
    }

    #[test]
    fn without_time_the_set_is_the_disc_at_every_heading() {
        let margin = |[x, y, _]: [f64; 3]| hypot(x, y) - 3.0;
        let grid = Sampling::new(margin, [-4.0; 2], [4.0; 2], [40, 40, 12]);
        let surface = grid.surface(margin, 0.0);
        check_closed(&surface);
        assert!(surface.vertices.iter().all(|[x, y, _]| (hypot(*x, *y) - 3.0).abs() < 1e-4));
        let expected = TAU * 9.0 * PI;
        assert!((surface.volume() - expected).abs() < 0.005 * expected, "{}", surface.volume());
    }

    #[test]
    fn vertices_are_on_the_level() {
        let exact = ExactValue::new(2.0, 0.5, 3.0).unwrap();
        let value = |state| exact.value(state);
        let grid = Sampling::new(value, [-8.0, -12.0], [15.0, 12.0], [40, 40, 36]);
        for level in [-1.0, 0.0, 0.8] {
            let surface = grid.surface(value, level);
            check_closed(&surface);
            let missed = surface.vertices.iter().map(|state| (value(*state) - level).abs());
            let worst = missed.fold(0.0, f64::max);
            assert!(worst < 0.01, "{worst}");
        }
    }

    #[test]
    fn the_volume_is_that_of_the_solver() {
        let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
        let game =
            PursuitGame { evader: vehicle(2.0, 0.5), pursuer: vehicle(1.6, 0.4), radius_m: 3.0 };
        let options = Options { accuracy: Accuracy::Draft, ..Options::default() };
        let solved = solve(game, &options, &mut |_| ControlFlow::Continue(())).unwrap();
        let ValueFunction::Sampled(samples) = &solved.function else { panic!("it is sampled") };
        let value = |state| solved.function.value(state);
        let grid = Sampling::new(value, [-10.0, -12.0], [16.0, 12.0], [72, 72, 72]);
        let volume = grid.surface(value, 0.0).volume();
        let expected = samples.volume();
        assert!((volume - expected).abs() < 0.02 * expected, "{volume} {expected}");
    }

    #[test]
    fn a_set_that_leaves_the_rectangle_is_closed_there() {
        let everywhere = |[x, _, _]: [f64; 3]| x - 100.0;
        let grid = Sampling::new(everywhere, [0.0; 2], [4.0, 2.0], [9, 9, 4]);
        let surface = grid.surface(everywhere, 0.0);
        check_closed(&surface);
        assert!(surface.volume() > 0.0);
        let nowhere = grid.surface(everywhere, -200.0);
        assert_eq!(nowhere, Surface::default());
    }
}
