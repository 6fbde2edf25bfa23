//! Fast computation of the distances of millions of positions from a polygon with thousands of
//! edges.

use core::cell::RefCell;
use sidestep::math::hypot;
use sidestep::reach::polygon::{bounding_box, signed_distance};

type Edge = [[f64; 2]; 2];

/// A polygon with a grid that accelerates [`signed_distance`]. The results are bit-identical. The
/// row of a position limits which edges contribute to its winding number, and its cell limits which
/// edges can be nearest.
pub(crate) struct Region {
    polygon: Vec<[f64; 2]>,
    /// Allowed distance of a position outside the polygon (m).
    allowed_m: f64,
    corner: [f64; 2],
    side_m: f64,
    /// The edges that pass through each row of cells.
    rows: Vec<Vec<Edge>>,
    cells: RefCell<Vec<Option<Cell>>>,
}

struct Cell {
    /// Margin of the cell's centre (m).
    margin_m: f64,
    /// All edges that are nearest to some position in the cell, and possibly other edges.
    near: Vec<Edge>,
}

/// Number of cells along a region's longer side.
const CELLS: usize = 48;

impl Region {
    pub(crate) fn new(polygon: Vec<[f64; 2]>, allowed_m: f64) -> Self {
        let [x0, y0, x1, y1] = bounding_box(&polygon).expect("a vertex");
        let (corner, side_m) = ([x0, y0], ((x1 - x0).max(y1 - y0) / CELLS as f64).max(1e-9));
        let mut rows = vec![Vec::new(); CELLS];
        let row = |y: f64| (y - y0) / side_m;
        for [a, b] in edges(&polygon) {
            // One extra row on either side allows for rounding errors.
            let first = (row(a[1].min(b[1])) - 1.0).max(0.0) as usize;
            let last = (row(a[1].max(b[1])) + 1.0) as usize;
            rows[first.min(CELLS - 1)..=last.min(CELLS - 1)]
                .iter_mut()
                .for_each(|row| row.push([a, b]));
        }
        let cells = RefCell::new((0..CELLS * CELLS).map(|_| None).collect());
        Self { polygon, allowed_m, corner, side_m, rows, cells }
    }

    /// How far inside a position is, plus the allowance (m). If this exceeds `least`, the result
    /// can be any number above `least`.
    pub(crate) fn margin(&self, position: [f64; 2], least: f64) -> f64 {
        let place = [0, 1].map(|i| ((position[i] - self.corner[i]) / self.side_m).floor());
        if !place.iter().all(|place| (0.0..CELLS as f64).contains(place)) {
            return self.allowed_m - signed_distance(&self.polygon, position);
        }
        let middle = [0, 1].map(|i| self.corner[i] + (place[i] + 0.5) * self.side_m);
        let [column, row] = place.map(|place| place as usize);
        let mut cells = self.cells.borrow_mut();
        let cell = cells[row * CELLS + column].get_or_insert_with(|| self.cell(middle));
        let at_least = cell.margin_m - hypot(position[0] - middle[0], position[1] - middle[1]);
        if at_least > least {
            return at_least;
        }
        let winding: i32 = self.rows[row].iter().map(|edge| winding(edge, position)).sum();
        let nearest = cell.near.iter().map(|edge| distance(edge, position));
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        self.allowed_m - if winding == 0 { nearest } else { -nearest }
    }

    fn cell(&self, middle: [f64; 2]) -> Cell {
        let signed_m = signed_distance(&self.polygon, middle);
        // The edge nearest to a position in the cell can be farther from the centre than the
        // centre's nearest edge, but by at most the cell's diagonal (√2 sides).
        let within_m = signed_m.abs() + 1.5 * self.side_m;
        let near = edges(&self.polygon).filter(|edge| distance(edge, middle) <= within_m);
        Cell { margin_m: self.allowed_m - signed_m, near: near.collect() }
    }
}

fn edges(polygon: &[[f64; 2]]) -> impl Iterator<Item = Edge> + '_ {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| [*a, *b])
}

/// Contribution of an edge to the winding number around a position.
fn winding([[ax, ay], [bx, by]]: &Edge, [x, y]: [f64; 2]) -> i32 {
    let left = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
    i32::from(*ay <= y && y < *by && left > 0.0) - i32::from(*by <= y && y < *ay && left < 0.0)
}

/// Distance of a position from an edge (m).
fn distance([[ax, ay], [bx, by]]: &Edge, [x, y]: [f64; 2]) -> f64 {
    let (dx, dy, px, py) = (bx - ax, by - ay, x - ax, y - ay);
    let length2 = dx * dx + dy * dy;
    let along = if length2 > 0.0 { ((px * dx + py * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
    hypot(px - along * dx, py - along * dy)
}

#[cfg(test)]
mod tests {
    use super::super::classes::CLASSES;
    use super::super::origin;
    use super::*;
    use sidestep::math::SeededRng;
    use sidestep::reach::{PolygonSettings, ReachableSet};

    #[test]
    fn the_grid_changes_no_bit() {
        let mut rng = SeededRng::new(5);
        for class in CLASSES.iter().cycle().take(24) {
            let set =
                ReachableSet::new(origin(), &class.bounds(&mut rng), class.speed_mps, class.step_s);
            let set = set.unwrap();
            let polygon = if rng.below(2) == 0 {
                set.tube_polygon(PolygonSettings::default())
            } else {
                set.step_polygon(set.steps(), PolygonSettings::default())
            };
            let [x0, y0, x1, y1] = bounding_box(&polygon).unwrap();
            let region = Region::new(polygon.clone(), 0.01);
            for place in 0..1000 {
                // Positions are anywhere, also outside the bounding box, or at or near the
                // boundary.
                let corner = polygon[rng.below(polygon.len())];
                let position = match place % 3 {
                    0 => [rng.uniform(x0 - 0.1, x1 + 0.1), rng.uniform(y0 - 0.1, y1 + 0.1)],
                    1 => corner.map(|at| at + rng.uniform(-1e-3, 1e-3)),
                    _ => corner,
                };
                let expected = 0.01 - signed_distance(&polygon, position);
                let found = region.margin(position, f64::INFINITY);
                assert_eq!(found.to_bits(), expected.to_bits(), "{position:?}: {found} {expected}");
                assert!(region.margin(position, 0.0) > 0.0 || expected <= 0.0);
            }
        }
    }
}
