//! The sublevel set {V ≤ c} as triangles with normals.

use crate::math::TAU;
use crate::picture::Window;
use crate::reachability::{Sampling, Surface, ValueFunction};

/// Triangles with normals, in the layout that GPUs expect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Six numbers per vertex: x and y (m), ψ (rad), and the outward unit normal in the drawing,
    /// where ψ is scaled to metres.
    pub vertices: Vec<f32>,
    /// Three vertices per triangle, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
}

/// V over a window, sampled on nodes. The solid of any level can be extracted from the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Tubes {
    window: Window,
    sampling: Sampling,
}

/// Number of nodes along x, y and ψ.
const NODES: [usize; 3] = [64, 60, 61];

impl Tubes {
    /// Samples a value function over a window.
    #[must_use]
    pub fn new(function: &ValueFunction, window: Window) -> Self {
        let sampling = Sampling::new(|state| function.value(state), window.low, window.high, NODES);
        Self { window, sampling }
    }

    /// The mesh of {V ≤ `level_m`}; `function` must be the sampled function.
    #[must_use]
    pub fn mesh(&self, function: &ValueFunction, level_m: f64) -> Mesh {
        let value = |state| function.value(state);
        let gradient = |state| function.state(state).gradient;
        Mesh::new(&self.sampling.surface(value, gradient, level_m), self.window)
    }
}

/// Cosine of 25°. If the angle between the normals of two triangles is larger, their edge is sharp.
const BENT: f64 = 0.906;

impl Mesh {
    /// The mesh of a surface over `window`. Triangles that meet at a small angle share the mean of
    /// their normals, so that they look smooth. A ridge has a separate vertex for each side.
    #[must_use]
    pub fn new(surface: &Surface, window: Window) -> Self {
        let per_radian = height_m(window) / TAU;
        let unit = |[x, y, psi]: [f64; 3]| {
            let normal = [x, y, psi / per_radian];
            let length = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
            normal.map(|part| part / length)
        };
        // For each vertex of the surface, its smooth sides. Each side has the normal of its first
        // triangle and the index of its vertex in the mesh.
        let mut sides: Vec<Vec<([f64; 3], usize)>> = vec![Vec::new(); surface.vertices.len()];
        let mut corners: Vec<([f64; 3], [f64; 3])> = Vec::new();
        let mut indices = Vec::with_capacity(3 * surface.triangles.len());
        for (triangle, normal) in surface.triangles.iter().zip(&surface.normals) {
            let normal = unit(*normal);
            for &vertex in triangle {
                let known = &mut sides[vertex as usize];
                let side = known.iter().find(|(first, _)| dot(*first, normal) >= BENT);
                let number = side.map_or(corners.len(), |(_, number)| *number);
                if number == corners.len() {
                    known.push((normal, number));
                    corners.push((surface.vertices[vertex as usize], [0.0; 3]));
                }
                let sum = &mut corners[number].1;
                *sum = [0, 1, 2].map(|d| sum[d] + normal[d]);
                indices.push(number as u32);
            }
        }
        let numbers = corners.into_iter().flat_map(|([x, y, psi], sum)| {
            let length = dot(sum, sum).sqrt().max(f64::MIN_POSITIVE);
            let [a, b, c] = sum.map(|part| part / length);
            [x, y, psi, a, b, c].map(|number| number as f32)
        });
        Self { vertices: numbers.collect(), indices }
    }

    /// (x, y, ψ) and normal of a vertex.
    pub(super) fn vertex(&self, number: u32) -> ([f64; 3], [f64; 3]) {
        let first = 6 * number as usize;
        let part = |d: usize| f64::from(self.vertices[first + d]);
        ([part(0), part(1), part(2)], [part(3), part(4), part(5)])
    }
}

/// Height of the whole range of ψ (2π) in the drawing, in metres at the scale of x and y.
pub(super) fn height_m(window: Window) -> f64 {
    let sides = [0, 1].map(|d| window.high[d] - window.low[d]);
    0.8 * sides[0].max(sides[1])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{TAU, hypot};

    #[test]
    fn normals_point_outwards_and_ridges_have_one_for_each_side() {
        let margin = |[x, y, _]: [f64; 3]| hypot(x, y) - 3.0;
        let window = Window::square(4.0);
        let grid = Sampling::new(margin, window.low, window.high, [24, 24, 6]);
        let radial = |[x, y, _]: [f64; 3]| [x / hypot(x, y), y / hypot(x, y), 0.0];
        let surface = grid.surface(margin, radial, 0.0);
        let mesh = Mesh::new(&surface, window);
        assert_eq!(mesh.indices.len(), 3 * surface.triangles.len());
        let (mut walls, mut lids) = (0, 0);
        for vertex in mesh.vertices.chunks_exact(6) {
            let [x, y, psi, a, b, c] = vertex.try_into().unwrap();
            if c.abs() > 0.5 {
                assert!((psi == 0.0 && c == -1.0) || (f64::from(psi) > 0.999 * TAU && c == 1.0));
                lids += 1;
            } else {
                assert!(x * a + y * b > 2.98, "{vertex:?}");
                walls += 1;
            }
        }
        // A point on a rim has two vertices: one counts as wall, the other as lid.
        assert!(walls + lids > surface.vertices.len() + 60, "{walls} {lids}");
    }
}
