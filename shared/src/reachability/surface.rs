//! The solid {V ≤ c} over x, y and ψ as a triangle mesh (dual contouring: Ju, Losasso, Schaefer and
//! Warren, 2002).
//!
//! Each grid cell that the surface crosses has one vertex. It is the intersection of the surface's
//! tangent planes at the points where the surface crosses the cell's edges. A ridge therefore
//! becomes a line of vertices on the ridge, and not a staircase along the grid's edges.

#[cfg(test)]
mod tests;

use crate::math::TAU;

/// A function sampled on a grid over a rectangle of the plane and the full turn of headings.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    low: [f64; 2],
    high: [f64; 2],
    /// Number of nodes along each axis, including one additional node at each end. The additional
    /// nodes are outside the solid.
    nodes: [usize; 3],
    /// Row-major over x, y, ψ.
    values: Vec<f32>,
}

/// A closed triangle mesh over x and y (m) and ψ (rad) around a solid, with flat faces at the edges
/// of the rectangle, at ψ = 0 and at ψ = 2π.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The vertices (x, y, ψ).
    pub vertices: Vec<[f64; 3]>,
    /// The indices of each triangle's vertices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The outward normal of each triangle, not normalised: (∂/∂x, ∂/∂y, ∂/∂ψ) of a function that
    /// increases outwards.
    pub normals: Vec<[f64; 3]>,
}

/// A crossing is refined, in at most [`STEPS`] steps, until its value differs from the level by at
/// most this fraction of the difference between the values at the edge's ends.
const MISS: f64 = 1e-4;
const STEPS: usize = 24;
/// Regularization weight that pulls a vertex to the mean of its crossings. It determines the vertex
/// in the directions in which the planes leave it undetermined.
const PULL: f64 = 0.01;
/// Largest distance of a vertex outside its cell, in sides of the cell.
const BEYOND: f64 = 0.9;
/// Largest distance by which a vertex is moved onto the level, in sides of a cell.
const SETTLING: f64 = 0.3;

/// A crossing of a grid edge and the surface.
struct Crossing {
    /// The node at which the edge begins, and its axis.
    node: [usize; 3],
    axis: usize,
    /// Whether the edge begins inside the solid.
    leaves: bool,
    at: [f64; 3],
    normal: Normal,
}

/// The outward direction at a crossing.
enum Normal {
    /// The function's gradient.
    Gradient([f64; 3]),
    /// The direction of the edge, since the solid is cut off here.
    Face([f64; 3]),
    /// The function jumps here, so its gradient is meaningless.
    Unknown,
}

/// The tangent planes at the crossings of a cell's edges, in coordinates from 0 to 1 within the
/// cell.
#[derive(Clone, Default)]
struct Cell {
    place: [usize; 3],
    count: f64,
    sum: [f64; 3],
    /// Sums over the planes with normal n and crossing p: Σ n nᵀ and, in the next field,
    /// Σ n (n · p).
    square: [[f64; 3]; 3],
    right: [f64; 3],
    /// For each axis, the coordinate at which the solid is cut off, if any.
    face: [Option<f64>; 3],
    jumps: bool,
    /// The sum of the normals that are gradients of the function.
    lean: [f64; 3],
}

impl Sampling {
    /// Samples `value` on `nodes` nodes along x, y and ψ (at least two each). x and y are from
    /// `low` to `high` (m) and ψ is from 0 to 2π, ends included.
    pub fn new(
        value: impl Fn([f64; 3]) -> f64,
        low: [f64; 2],
        high: [f64; 2],
        nodes: [usize; 3],
    ) -> Self {
        let nodes = nodes.map(|count| count.max(2) + 2);
        let mut sampling = Self { low, high, nodes, values: Vec::new() };
        let [columns, rows, headings] = nodes;
        sampling.values.reserve(columns * rows * headings);
        for i in 0..columns {
            for j in 0..rows {
                for k in 0..headings {
                    // The outermost nodes are outside, which closes the solid.
                    let node = [i, j, k];
                    let is_outer = (0..3).any(|d| node[d] == 0 || node[d] + 1 == nodes[d]);
                    let at = if is_outer { f64::INFINITY } else { value(sampling.point(node)) };
                    sampling.values.push(at as f32);
                }
            }
        }
        sampling
    }

    /// Ends of the grid along an axis.
    fn ends(&self, axis: usize) -> [f64; 2] {
        if axis == 2 { [0.0, TAU] } else { [self.low[axis], self.high[axis]] }
    }

    /// Side lengths of a cell.
    fn sides(&self) -> [f64; 3] {
        [0, 1, 2].map(|d| {
            let [low, high] = self.ends(d);
            (high - low) / (self.nodes[d] - 3) as f64
        })
    }

    fn point(&self, node: [usize; 3]) -> [f64; 3] {
        [0, 1, 2].map(|d| {
            let [low, high] = self.ends(d);
            let share = (node[d] as f64 - 1.0) / (self.nodes[d] - 3) as f64;
            // The end is exact, without rounding error.
            if share == 1.0 { high } else { low + share * (high - low) }
        })
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.nodes[1] + j) * self.nodes[2] + k
    }

    /// The function at a node minus the level.
    fn excess(&self, node: [usize; 3], level: f64) -> f64 {
        f64::from(self.values[self.index(node)]) - level
    }

    /// The surface around the states where the sampled function `value` is at most `level`.
    /// `gradient` is the gradient of `value`.
    pub fn surface(
        &self,
        value: impl Fn([f64; 3]) -> f64,
        gradient: impl Fn([f64; 3]) -> [f64; 3],
        level: f64,
    ) -> Surface {
        let excess = |at| value(at) - level;
        let crossings = self.crossings(&excess, &gradient, level);
        // The crossed cells, and for each grid cell its index in this list.
        let mut cells: Vec<Cell> = Vec::new();
        let mut known = vec![u32::MAX; self.values.len()];
        let sides = self.sides();
        for crossing in &crossings {
            for place in crossing.cells() {
                let number = &mut known[self.index(place)];
                if *number == u32::MAX {
                    *number = cells.len() as u32;
                    cells.push(Cell { place, ..Cell::default() });
                }
                let corner = self.point(place);
                cells[*number as usize].add(crossing, corner, sides);
            }
        }
        let vertices: Vec<[f64; 3]> =
            cells.iter().map(|cell| cell.settled(self.point(cell.place), sides, &excess)).collect();
        let mut surface = Surface { vertices, ..Surface::default() };
        for crossing in &crossings {
            let mut ring = crossing.cells().map(|place| known[self.index(place)]);
            if !crossing.leaves {
                ring.reverse();
            }
            surface.fill(ring, &crossing.normal, &excess);
        }
        surface
    }

    /// All crossings of the grid's edges.
    fn crossings(
        &self,
        excess: &impl Fn([f64; 3]) -> f64,
        gradient: &impl Fn([f64; 3]) -> [f64; 3],
        level: f64,
    ) -> Vec<Crossing> {
        let [columns, rows, headings] = self.nodes;
        let mut crossings = Vec::new();
        for i in 0..columns {
            for j in 0..rows {
                for k in 0..headings {
                    let node = [i, j, k];
                    let here = self.excess(node, level);
                    for axis in 0..3 {
                        let mut next = node;
                        next[axis] += 1;
                        if next[axis] == self.nodes[axis] {
                            continue;
                        }
                        let there = self.excess(next, level);
                        let leaves = here <= 0.0;
                        if leaves == (there <= 0.0) {
                            continue;
                        }
                        let ends = [(self.point(node), here), (self.point(next), there)];
                        let [inside, outside] = if leaves { ends } else { [ends[1], ends[0]] };
                        let (at, normal) = if outside.1.is_infinite() {
                            let mut along = [0.0; 3];
                            along[axis] = if leaves { 1.0 } else { -1.0 };
                            (inside.0, Normal::Face(along))
                        } else {
                            match crossing(excess, inside, outside) {
                                (at, true) => (at, Normal::Gradient(gradient(at))),
                                (at, false) => (at, Normal::Unknown),
                            }
                        };
                        crossings.push(Crossing { node, axis, leaves, at, normal });
                    }
                }
            }
        }
        crossings
    }
}

impl Crossing {
    /// The four cells around the crossing's edge, counter-clockwise seen from the end of the edge.
    /// No edge between two of the outermost nodes is crossed, because these nodes are all outside.
    fn cells(&self) -> [[usize; 3]; 4] {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(back_u, back_v)| {
            let mut place = self.node;
            place[u] -= back_u;
            place[v] -= back_v;
            place
        })
    }
}

impl Cell {
    fn add(&mut self, crossing: &Crossing, corner: [f64; 3], sides: [f64; 3]) {
        let at = [0, 1, 2].map(|d| (crossing.at[d] - corner[d]) / sides[d]);
        self.count += 1.0;
        self.sum = add(self.sum, at, 1.0);
        let normal = match crossing.normal {
            Normal::Unknown => {
                self.jumps = true;
                return;
            }
            Normal::Face(normal) | Normal::Gradient(normal) => normal,
        };
        // The gradient in the cell's own coordinates.
        let normal = [0, 1, 2].map(|d| normal[d] * sides[d]);
        let length = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
        let normal = normal.map(|part| part / length);
        if let Normal::Face(_) = crossing.normal {
            self.face[crossing.axis] = Some(at[crossing.axis]);
        } else {
            self.lean = add(self.lean, normal, 1.0);
        }
        let along = dot(normal, at);
        for row in 0..3 {
            self.square[row] = add(self.square[row], normal, normal[row]);
            self.right[row] += normal[row] * along;
        }
    }

    /// The intersection of the planes within the cell: the regularized least-squares solution about
    /// the mean of the crossings.
    fn meeting(&self) -> [f64; 3] {
        let middle = self.sum.map(|part| part / self.count);
        let mut square = self.square;
        for (d, row) in square.iter_mut().enumerate() {
            row[d] += PULL * self.count;
        }
        let right = [0, 1, 2].map(|row| self.right[row] - dot(self.square[row], middle));
        // Cramer's rule: the rows of a symmetric matrix are its columns.
        let [a, b, c] = square;
        let determinant = dot(a, cross(b, c));
        let away = [
            dot(right, cross(b, c)) / determinant,
            dot(a, cross(right, c)) / determinant,
            dot(a, cross(b, right)) / determinant,
        ];
        self.within(add(middle, away, 1.0))
    }

    /// The nearest point that is in the cell and on the faces that cut off the solid. The cell is
    /// widened by [`BEYOND`], because a ridge can pass just outside its cells.
    fn within(&self, at: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|d| self.face[d].unwrap_or(at[d].clamp(-BEYOND, 1.0 + BEYOND)))
    }

    /// The vertex: the intersection of the planes, moved onto the level along the mean of their
    /// normals. On a ridge, this direction is between the normals of its two sides.
    fn settled(
        &self,
        corner: [f64; 3],
        sides: [f64; 3],
        excess: &impl Fn([f64; 3]) -> f64,
    ) -> [f64; 3] {
        let state = |at: [f64; 3]| [0, 1, 2].map(|d| corner[d] + at[d] * sides[d]);
        let at = self.meeting();
        let along = [0, 1, 2].map(|d| if self.face[d].is_some() { 0.0 } else { self.lean[d] });
        let length = dot(along, along).sqrt();
        if self.jumps || length < 1e-6 {
            return state(at);
        }
        let [inside, outside] = [-SETTLING, SETTLING].map(|far| {
            let end = state(add(at, along, far / length));
            (end, excess(end))
        });
        if inside.1 > 0.0 || outside.1 <= 0.0 {
            return state(at);
        }
        crossing(excess, inside, outside).0
    }
}

impl Surface {
    /// Adds two triangles between four vertices, split along the diagonal whose midpoint is nearer
    /// to the level.
    fn fill(&mut self, ring: [u32; 4], normal: &Normal, excess: &impl Fn([f64; 3]) -> f64) {
        let [a, b, c, d] = ring;
        let missed = |from: u32, to: u32| {
            let [from, to] = [from, to].map(|v| self.vertices[v as usize]);
            excess([0, 1, 2].map(|d| 0.5 * (from[d] + to[d]))).abs()
        };
        let is_flat = matches!(normal, Normal::Face(_));
        let two = if is_flat || missed(a, c) <= missed(b, d) {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, b, d], [b, c, d]]
        };
        for triangle in two {
            let normal = match normal {
                Normal::Gradient(normal) | Normal::Face(normal) => *normal,
                Normal::Unknown => {
                    let [p, q, r] = triangle.map(|v| self.vertices[v as usize]);
                    cross(add(q, p, -1.0), add(r, p, -1.0))
                }
            };
            self.triangles.push(triangle);
            self.normals.push(normal);
        }
    }

    /// The volume that the surface encloses (m²·rad).
    #[must_use]
    pub fn volume(&self) -> f64 {
        // By the divergence theorem, the volume is the flux of (x, 0, 0) through the surface.
        let flux = |triangle: &[u32; 3]| {
            let [p, q, r] = triangle.map(|v| self.vertices[v as usize]);
            let [normal_x, ..] = cross(add(q, p, -1.0), add(r, p, -1.0));
            0.5 * normal_x * (p[0] + q[0] + r[0]) / 3.0
        };
        self.triangles.iter().map(flux).sum()
    }
}

/// The zero of `excess` between a state inside and a state outside, each given with its excess.
/// Also returns whether `excess` is nearly 0 there. It is not if `excess` jumps between the two
/// states.
fn crossing(
    excess: impl Fn([f64; 3]) -> f64,
    (inside, mut low): ([f64; 3], f64),
    (outside, mut high): ([f64; 3], f64),
) -> ([f64; 3], bool) {
    let (mut s, mut t) = (0.0, 1.0);
    let at = |share: f64| [0, 1, 2].map(|d| inside[d] + share * (outside[d] - inside[d]));
    // Regula falsi, which keeps the zero bracketed. If the same end is kept twice, its value is
    // halved, so that it is not kept forever (Illinois method).
    let mut last = None;
    let miss = MISS * (high - low);
    for _ in 0..STEPS {
        let share = if high > low { s - low * (t - s) / (high - low) } else { 0.5 * (s + t) };
        let missed = excess(at(share));
        if missed.abs() <= miss {
            return (at(share), true);
        }
        let is_inside = missed <= 0.0;
        if is_inside {
            (s, low) = (share, missed);
        } else {
            (t, high) = (share, missed);
        }
        if last == Some(is_inside) {
            if is_inside { high *= 0.5 } else { low *= 0.5 }
        }
        last = Some(is_inside);
    }
    (at(0.5 * (s + t)), false)
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
