//! Closed curves around a region of a lattice (marching squares).

/// A lattice of nodes in the plane, each inside a region or outside it.
pub(super) trait Lattice {
    /// Number of nodes along each index. The two index directions must form a right-handed system
    /// in the plane.
    fn size(&self) -> [usize; 2];
    /// Whether the second index is periodic.
    fn wraps(&self) -> bool;
    /// Whether a node belongs to the region.
    fn inside(&self, node: [usize; 2]) -> bool;
    /// Whether the region joins the two inside corners of a cell whose corners alternate between
    /// inside and outside. `node` is the cell's first corner.
    fn joins(&self, node: [usize; 2]) -> bool;
    /// The point at which the region ends between an inside node and an outside neighbour.
    fn crossing(&self, inside: [usize; 2], outside: [usize; 2]) -> [f64; 2];
}

/// The boundary of the region: closed curves without a repeated end point, with the region on their
/// left. Nodes at the lattice's own edge must be outside.
pub(super) fn closed_curves(lattice: &impl Lattice) -> Vec<Vec<[f64; 2]>> {
    let [rows, columns] = lattice.size();
    let inside: Vec<bool> =
        (0..rows * columns).map(|n| lattice.inside([n / columns, n % columns])).collect();
    let last_column = if lattice.wraps() { columns } else { columns - 1 };
    // `next` contains an entry for each edge: first all edges along the first index, then all edges
    // along the second index.
    const NONE: u32 = u32::MAX;
    let mut next = vec![NONE; 2 * rows * columns];
    let id = |i: usize, j: usize| i * columns + j % columns;
    for i in 0..rows - 1 {
        for j in 0..last_column {
            let corners = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            let within = corners.map(|corner| inside[corner]);
            if within == [true; 4] || within == [false; 4] {
                continue;
            }
            let across = rows * columns;
            let edges = [corners[0], across + corners[1], corners[3], across + corners[0]];
            let leaves: Vec<usize> =
                (0..4).filter(|e| within[*e] && !within[(e + 1) % 4]).collect();
            for edge in &leaves {
                // The edge at which the curve continues. This is the next crossed edge backwards
                // around the cell or, if two inside corners are joined, the next crossed edge
                // forwards.
                let joined = leaves.len() == 2 && lattice.joins([i, j]);
                let back = if joined {
                    (edge + 1) % 4
                } else {
                    let mut e = (edge + 3) % 4;
                    while within[e] {
                        e = (e + 3) % 4;
                    }
                    e
                };
                next[edges[*edge]] = edges[back] as u32;
            }
        }
    }
    let node = |n: usize| [n / columns, n % columns];
    let point = |edge: usize| {
        let from = edge % (rows * columns);
        let [i, j] = node(from);
        let to = if edge < rows * columns { [i + 1, j] } else { [i, (j + 1) % columns] };
        if inside[from] { lattice.crossing([i, j], to) } else { lattice.crossing(to, [i, j]) }
    };
    let mut curves = Vec::new();
    for start in 0..next.len() {
        let mut curve = Vec::new();
        let mut edge = start;
        while next[edge] != NONE {
            curve.push(point(edge));
            edge = core::mem::replace(&mut next[edge], NONE) as usize;
        }
        if curve.len() > 2 {
            curves.push(curve);
        }
    }
    curves
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hypot;

    /// The region where a function is ≤ 0, on a square lattice.
    struct Plane<F>(F);

    impl<F: Fn(f64, f64) -> f64> Plane<F> {
        fn at(&self, [i, j]: [usize; 2]) -> [f64; 2] {
            [i as f64 * 0.1 - 5.0, j as f64 * 0.1 - 5.0]
        }
        fn value(&self, node: [usize; 2]) -> f64 {
            let [x, y] = self.at(node);
            (self.0)(x, y)
        }
    }

    impl<F: Fn(f64, f64) -> f64> Lattice for Plane<F> {
        fn size(&self) -> [usize; 2] {
            [101, 101]
        }
        fn wraps(&self) -> bool {
            false
        }
        fn inside(&self, node: [usize; 2]) -> bool {
            self.value(node) <= 0.0
        }
        fn joins(&self, [i, j]: [usize; 2]) -> bool {
            let [x, y] = self.at([i, j]);
            (self.0)(x + 0.05, y + 0.05) <= 0.0
        }
        fn crossing(&self, inside: [usize; 2], outside: [usize; 2]) -> [f64; 2] {
            let (a, b) = (self.at(inside), self.at(outside));
            let (fa, fb) = (self.value(inside), self.value(outside));
            let t = fa / (fa - fb);
            [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
        }
    }

    fn area(curve: &[[f64; 2]]) -> f64 {
        let next = curve.iter().cycle().skip(1);
        curve.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
    }

    #[test]
    fn each_piece_is_a_curve_with_the_region_on_its_left() {
        let disc = |x: f64, y: f64, cx: f64| hypot(x - cx, y) - 1.0;
        let two = closed_curves(&Plane(|x, y| disc(x, y, -2.0).min(disc(x, y, 2.03))));
        assert_eq!(two.len(), 2);
        for curve in &two {
            assert!((area(curve) - core::f64::consts::PI).abs() < 0.01, "{}", area(curve));
        }
        let ring = closed_curves(&Plane(|x: f64, y: f64| (hypot(x, y) - 2.0).abs() - 0.5));
        let mut areas: Vec<f64> = ring.iter().map(|curve| area(curve)).collect();
        areas.sort_by(f64::total_cmp);
        assert_eq!(areas.len(), 2);
        assert!((areas[0] + 2.25 * core::f64::consts::PI).abs() < 0.02);
        assert!((areas[1] - 6.25 * core::f64::consts::PI).abs() < 0.02);
    }

    #[test]
    fn saddles_close_either_way() {
        for shift in [-0.013, 0.013] {
            let curves =
                closed_curves(&Plane(|x: f64, y: f64| (x * x + y * y - 4.0).max(shift - x * y)));
            assert_eq!(curves.len(), if shift > 0.0 { 2 } else { 1 }, "{shift}");
        }
    }
}
