//! The outer boundary of curves that cross each other.
//!
//! All points are first rounded to a fine grid, and crossings and touching
//! points are made vertices of both curves. Then one walks round the outside.

use crate::math::{TAU, atan2};
use nalgebra::Complex;
use std::collections::{BTreeMap, BTreeSet};

type Point = Complex<f64>;

/// A point of the grid.
type Node = [i64; 2];

/// An edge between two nodes, the smaller one first.
type Edge = (Node, Node);

/// Spacing of the grid, s of travel: far below any accuracy asked for, far above
/// rounding errors.
const GRID_S: f64 = 1e-10;

/// A vertex closer than this to an edge, in grid spacings, lies on it.
const ON_EDGE: f64 = 0.75;

/// Rounding a crossing to the grid moves the edges a little, which can make new
/// crossings; so often are they looked for at most.
const MOST_ROUNDS: usize = 8;

/// The boundary of the unbounded region left by the curves, counter-clockwise,
/// without the first point repeated: whatever the curves enclose is filled. The
/// curves must hang together through shared points or crossings.
pub(super) fn outline(curves: &[Vec<Point>]) -> Vec<Point> {
    let mut edges = BTreeSet::new();
    for pair in curves.iter().flat_map(|curve| curve.windows(2)) {
        edges.extend(edge(node(pair[0]), node(pair[1])));
    }
    for _ in 0..MOST_ROUNDS {
        let list: Vec<Edge> = edges.iter().copied().collect();
        let cuts = cuts(&list);
        if cuts.iter().all(Vec::is_empty) {
            break;
        }
        edges = split(&list, cuts);
    }
    if edges.is_empty() {
        // A single point, if anything.
        return curves.iter().flatten().take(1).copied().collect();
    }
    let boundary = Graph::new(&edges).walk();
    boundary.into_iter().map(|[x, y]| Point::new(x as f64 * GRID_S, y as f64 * GRID_S)).collect()
}

fn node(point: Point) -> Node {
    [point.re, point.im].map(|coordinate| (coordinate / GRID_S).round() as i64)
}

fn edge(a: Node, b: Node) -> Option<Edge> {
    (a != b).then(|| (a.min(b), a.max(b)))
}

/// b − a as numbers, in grid spacings.
fn difference(b: Node, a: Node) -> Point {
    Point::new((b[0] - a[0]) as f64, (b[1] - a[1]) as f64)
}

fn cross(a: Point, b: Point) -> f64 {
    a.re * b.im - a.im * b.re
}

/// For each edge the nodes inside it at which others cross or touch it. The
/// edges are in order, so by their smallest x first.
fn cuts(edges: &[Edge]) -> Vec<Vec<Node>> {
    let mut cuts = vec![Vec::new(); edges.len()];
    for (i, &e) in edges.iter().enumerate() {
        let (low, high) = (e.0[1].min(e.1[1]), e.0[1].max(e.1[1]));
        for (j, &f) in edges.iter().enumerate().skip(i + 1) {
            if f.0[0] > e.1[0] + 1 {
                break;
            }
            if f.0[1].min(f.1[1]) > high + 1 || f.0[1].max(f.1[1]) < low - 1 {
                continue;
            }
            let touching = |e: Edge, f: Edge| [f.0, f.1].into_iter().filter(move |&n| on(n, e));
            let before = (cuts[i].len(), cuts[j].len());
            cuts[i].extend(touching(e, f));
            cuts[j].extend(touching(f, e));
            if before == (cuts[i].len(), cuts[j].len())
                && let Some(node) = crossing(e, f)
            {
                cuts[i].extend((node != e.0 && node != e.1).then_some(node));
                cuts[j].extend((node != f.0 && node != f.1).then_some(node));
            }
        }
    }
    cuts
}

/// Does a node lie on an edge, but not at its ends?
fn on(node: Node, (a, b): Edge) -> bool {
    if node == a || node == b {
        return false;
    }
    let (along, to) = (difference(b, a), difference(node, a));
    let length2 = along.norm_sqr();
    let share = (along.re * to.re + along.im * to.im) / length2;
    let off = cross(along, to);
    share > 0.0 && share < 1.0 && off * off < ON_EDGE * ON_EDGE * length2
}

/// The node nearest to where two edges cross, if they do.
fn crossing(e: Edge, f: Edge) -> Option<Node> {
    let (d, g) = (difference(e.1, e.0), difference(f.1, f.0));
    let determinant = cross(d, g);
    let offset = difference(f.0, e.0);
    let (s, t) = (cross(offset, g) / determinant, cross(offset, d) / determinant);
    // Parallel edges give infinities or NaN here, and no crossing.
    let inside = |share: f64| share > 0.0 && share < 1.0;
    (inside(s) && inside(t))
        .then(|| [e.0[0] + (d.re * s).round() as i64, e.0[1] + (d.im * s).round() as i64])
}

/// The edges cut at these nodes.
fn split(edges: &[Edge], cuts: Vec<Vec<Node>>) -> BTreeSet<Edge> {
    let mut pieces = BTreeSet::new();
    for (&(a, b), mut nodes) in edges.iter().zip(cuts) {
        let along = difference(b, a);
        let share = |node: &Node| {
            let to = difference(*node, a);
            along.re * to.re + along.im * to.im
        };
        nodes.sort_by(|m, n| share(m).total_cmp(&share(n)));
        nodes.push(b);
        let mut last = a;
        for node in nodes {
            pieces.extend(edge(last, node));
            last = node;
        }
    }
    pieces
}

/// The crossing-free drawing: points, and the neighbours of each in
/// counter-clockwise order of direction.
struct Graph {
    points: Vec<Node>,
    neighbours: Vec<Vec<usize>>,
}

impl Graph {
    fn new(edges: &BTreeSet<Edge>) -> Self {
        let mut names: BTreeMap<Node, usize> = BTreeMap::new();
        let mut graph = Self { points: Vec::new(), neighbours: Vec::new() };
        for &(a, b) in edges {
            let [a, b] = [a, b].map(|node| {
                *names.entry(node).or_insert_with(|| {
                    graph.points.push(node);
                    graph.neighbours.push(Vec::new());
                    graph.points.len() - 1
                })
            });
            graph.neighbours[a].push(b);
            graph.neighbours[b].push(a);
        }
        for i in 0..graph.points.len() {
            let mut around = core::mem::take(&mut graph.neighbours[i]);
            around.sort_by(|&a, &b| graph.direction(i, a).total_cmp(&graph.direction(i, b)));
            graph.neighbours[i] = around;
        }
        graph
    }

    /// Direction, rad, from one point to another, in (−π, π].
    fn direction(&self, from: usize, to: usize) -> f64 {
        let edge = difference(self.points[to], self.points[from]);
        atan2(edge.im, edge.re)
    }

    /// Once round the unbounded region, keeping it on the right hand.
    fn walk(&self) -> Vec<Node> {
        let lowest = (0..self.points.len()).reduce(|a, b| {
            let ([px, py], [qx, qy]) = (self.points[a], self.points[b]);
            if (qy, qx) < (py, px) { b } else { a }
        });
        let Some(start) = lowest else {
            return Vec::new();
        };
        // At the lowest point every edge leads upward: the first one counter-clockwise.
        let upward = |to: &usize| {
            let direction = self.direction(start, *to);
            if direction < -1e-9 { direction + TAU } else { direction }
        };
        let first = self.neighbours[start]
            .iter()
            .copied()
            .reduce(|a, b| if upward(&b) < upward(&a) { b } else { a });
        let Some(first) = first else {
            return vec![self.points[start]];
        };
        let mut boundary = vec![self.points[start]];
        let (mut from, mut at) = (start, first);
        // Each directed edge has one successor and one predecessor, so the walk
        // comes back to where it began.
        loop {
            let around = &self.neighbours[at];
            let back = around.iter().position(|&n| n == from).unwrap_or(0);
            let next = around[(back + 1) % around.len()];
            if at == start && next == first {
                return boundary;
            }
            boundary.push(self.points[at]);
            (from, at) = (at, next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::polygon::signed_area;
    use super::*;

    fn check(curve: &[[f64; 2]], area: f64, vertices: usize) {
        let points: Vec<_> = curve.iter().map(|p| Point::new(p[0], p[1])).collect();
        let boundary: Vec<_> = outline(&[points]).iter().map(|p| [p.re, p.im]).collect();
        assert!((signed_area(&boundary) - area).abs() < 1e-12, "{boundary:?}");
        assert_eq!(boundary.len(), vertices, "{boundary:?}");
    }

    #[test]
    fn a_simple_polygon_stays() {
        check(&[[0., 0.], [2., 0.], [2., 1.], [0., 1.], [0., 0.]], 2.0, 4);
        check(&[[0., 0.], [0., 1.], [2., 1.], [2., 0.], [0., 0.]], 2.0, 4);
    }

    #[test]
    fn an_eight_is_filled() {
        check(&[[0., 0.], [2., 2.], [2., 0.], [0., 2.], [0., 0.]], 2.0, 6);
    }

    #[test]
    fn a_spike_is_walked_there_and_back() {
        check(&[[0., 0.], [1., 1.], [3., 2.]], 0.0, 4);
        check(&[[1., 1.]], 0.0, 1);
        check(&[], 0.0, 0);
    }

    #[test]
    fn a_star_loses_its_inner_edges() {
        // Twice round: the pentagon in the middle is enclosed twice.
        let star = [[0., 3.], [2., -3.], [-3., 1.], [3., 1.], [-2., -3.], [0., 3.]];
        let points: Vec<_> = star.iter().map(|p| Point::new(p[0], p[1])).collect();
        assert_eq!(outline(&[points]).len(), 10);
    }
}
