//! The outer boundary of a set of curves that cross each other.
//!
//! First, all points are rounded to a fine grid, and every crossing or touching point becomes a
//! vertex of both curves. Then a walk along the edges follows the outside.

use super::budget::Budget;
use core::cmp::Ordering;
use nalgebra::Complex;

type Point = Complex<f64>;

/// A point of the grid.
type Node = [i64; 2];

/// An undirected edge between two nodes; the smaller node comes first.
type Edge = (Node, Node);

/// Spacing of the grid (s of travel). It is far below any requested accuracy and far above rounding
/// errors.
const GRID_S: f64 = 1e-10;

/// Parts of zero width are drawn with twice this width (s of travel), and a rear is kept this far
/// behind its front where they touch. So polygons do not touch themselves. This width is a fraction of
/// the tolerance, but at least a few grid spacings.
pub(super) fn thickness(tolerance: f64) -> f64 {
    (0.001 * tolerance).max(16.0 * GRID_S)
}

/// A vertex closer to an edge than this (in grid spacings) counts as on the edge.
const ON_EDGE: f64 = 0.75;

/// Minimum height of the horizontal strips in which crossings are searched (in grid spacings).
const LEAST_STRIP: i64 = 1 << 10;

/// Cost of sorting, in units of a [`Budget`] per entry.
const SORTING: usize = 12;

/// Maximum number of search rounds. Rounding a crossing to the grid moves the edges slightly, which
/// can create new crossings.
const MOST_ROUNDS: usize = 8;

/// Computes outlines and reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Outliner {
    /// Sorted, without duplicates.
    edges: Vec<Edge>,
    /// Indices of edges to cut, and the nodes at which to cut them.
    cuts: Vec<(usize, Node)>,
    /// The edges in each strip, strip after strip. An entry has the index of the edge and its first
    /// strip.
    in_strips: Vec<(usize, usize)>,
    /// Index in `in_strips` at which the edges of each strip begin.
    begins: Vec<usize>,
    /// Every edge in both directions, sorted by the first node and then counter-clockwise by
    /// direction.
    darts: Vec<Dart>,
    /// Whether the last walk has visited a node, stored at the index of the first dart from the node.
    passed: Vec<bool>,
    touches: bool,
}

/// A directed edge (half-edge) from the first node to the second.
type Dart = (Node, Node);

impl Outliner {
    /// Begins a new drawing.
    pub(super) fn clear(&mut self) {
        self.edges.clear();
        self.touches = false;
    }

    /// Whether the last outline touches itself, at a point or along a line that it follows in both
    /// directions.
    pub(super) fn touches_itself(&self) -> bool {
        self.touches
    }

    /// Adds a curve to the drawing.
    pub(super) fn add(&mut self, curve: &[Point]) {
        self.edges.extend(curve.windows(2).filter_map(|pair| edge(node(pair[0]), node(pair[1]))));
    }

    /// Adds a curve and the edge from its last point to its first.
    pub(super) fn add_closed(&mut self, curve: &[Point]) {
        self.add(curve);
        if let [first, .., last] = *curve {
            self.edges.extend(edge(node(last), node(first)));
        }
    }

    /// Replaces `boundary` by the boundary of the unbounded region outside the curves
    /// (counter-clockwise, first point not repeated). Everything that the curves enclose is thus
    /// filled. The curves must be connected through shared points or crossings. If the curves have no
    /// length, or if the budget is spent, `boundary` stays unchanged.
    pub(super) fn outline(&mut self, boundary: &mut Vec<Point>, budget: &Budget<'_>) {
        budget.spend(SORTING * self.edges.len());
        if budget.is_spent() {
            return;
        }
        self.edges.sort_unstable();
        self.edges.dedup();
        for _ in 0..MOST_ROUNDS {
            self.find_cuts(budget);
            if budget.is_spent() {
                return;
            }
            if self.cuts.is_empty() {
                break;
            }
            budget.spend(SORTING * (self.edges.len() + self.cuts.len()));
            self.cut();
        }
        if self.edges.is_empty() {
            return;
        }
        budget.spend(2 * SORTING * self.edges.len());
        if budget.is_spent() {
            return;
        }
        self.darts.clear();
        self.darts.extend(self.edges.iter().flat_map(|&(a, b)| [(a, b), (b, a)]));
        self.darts.sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| around(*a, *b)));
        boundary.clear();
        self.walk(boundary);
    }

    /// Replaces a closed boundary by its outline, which is counter-clockwise and has no crossings.
    pub(super) fn tidy(&mut self, boundary: &mut Vec<Point>, budget: &Budget<'_>) {
        self.clear();
        self.add_closed(boundary);
        boundary.truncate(1);
        self.outline(boundary, budget);
    }

    /// Records, for each edge, the nodes between its ends at which other edges cross or touch it.
    ///
    /// The plane is divided into horizontal strips, about as high as an average edge. Only edges in the
    /// same strip are compared, in order of their smallest x.
    fn find_cuts(&mut self, budget: &Budget<'_>) {
        self.cuts.clear();
        let n = self.edges.len().max(1) as i64;
        let heights = |(a, b): &Edge| [a[1].min(b[1]), a[1].max(b[1])];
        let (mut rise, mut bottom, mut top) = (0, i64::MAX, i64::MIN);
        for [low, high] in self.edges.iter().map(heights) {
            (rise, bottom, top) = (rise + high - low, bottom.min(low), top.max(high));
        }
        // This limits the number of strips to a few per edge, even if the curves are not connected.
        let height = (2 * rise / n).max(top.saturating_sub(bottom) / (4 * n)).max(LEAST_STRIP);
        let lowest = bottom.saturating_sub(1).div_euclid(height);
        // One grid spacing is added on both sides, for edges that touch.
        let strips = |edge: &Edge| {
            let strip = |y: i64| (y.div_euclid(height) - lowest) as usize;
            let [low, high] = heights(edge);
            (strip(low - 1), strip(high + 1))
        };
        // Counting sort. First, entry i + 2 holds the number of edges in strip i. After summing, entry
        // i + 1 holds the beginning of strip i. After the edges are filled in, entry i holds the
        // beginning of strip i.
        self.begins.clear();
        for edge in &self.edges {
            let (first, last) = strips(edge);
            budget.spend(SORTING * (last - first + 1));
            if budget.is_spent() {
                return;
            }
            self.begins.resize(self.begins.len().max(last + 3), 0);
            self.begins[first + 2..=last + 2].iter_mut().for_each(|count| *count += 1);
        }
        let mut before = 0;
        for begin in &mut self.begins {
            before += *begin;
            *begin = before;
        }
        self.in_strips.clear();
        self.in_strips.resize(before, (0, 0));
        for (i, edge) in self.edges.iter().enumerate() {
            let (first, last) = strips(edge);
            for next in &mut self.begins[first + 1..=last + 1] {
                self.in_strips[*next] = (i, first);
                *next += 1;
            }
        }
        for (number, ends) in self.begins.windows(2).enumerate() {
            let strip = &self.in_strips[ends[0]..ends[1]];
            for (place, &(i, first)) in strip.iter().enumerate() {
                let e = self.edges[i];
                let mut compared = 0;
                for &(j, other) in &strip[place + 1..] {
                    let f = self.edges[j];
                    if f.0[0] > e.1[0] + 1 {
                        break;
                    }
                    compared += 1;
                    // Two edges that share several strips are compared only in the first shared strip.
                    if number == first.max(other) {
                        compare((i, e), (j, f), &mut self.cuts);
                    }
                }
                budget.spend(compared);
                if budget.is_spent() {
                    return;
                }
            }
        }
    }

    /// Cuts the edges at the recorded nodes.
    fn cut(&mut self) {
        let edges = &self.edges;
        let share = |&(i, node): &(usize, Node)| {
            let (a, b) = edges[i];
            let (along, to) = (difference(b, a), difference(node, a));
            along.re * to.re + along.im * to.im
        };
        self.cuts
            .sort_unstable_by(|m, n| m.0.cmp(&n.0).then_with(|| share(m).total_cmp(&share(n))));
        for cuts in self.cuts.chunk_by(|m, n| m.0 == n.0) {
            let (mut last, end) = self.edges[cuts[0].0];
            for &(_, node) in cuts {
                self.edges.extend(edge(last, node));
                last = node;
            }
            // An edge without length is removed below.
            self.edges[cuts[0].0] = edge(last, end).unwrap_or((end, end));
        }
        self.edges.retain(|(a, b)| a != b);
        self.edges.sort_unstable();
        self.edges.dedup();
    }

    /// Walks once around the unbounded region, keeping it on the right.
    fn walk(&mut self, boundary: &mut Vec<Point>) {
        // The walk starts at the leftmost node (the lowest of several). All edges of this node lead to
        // the right or straight up. The walk begins with the first of them in counter-clockwise order.
        let Self { darts, passed, touches, .. } = self;
        let leaving = |node: Node| {
            let first = darts.partition_point(|dart| dart.0 < node);
            let count = darts[first..].partition_point(|dart| dart.0 == node);
            (first, &darts[first..first + count])
        };
        passed.clear();
        passed.resize(darts.len(), false);
        *touches = false;
        let start = darts[0];
        let mut dart = start;
        // Each dart has exactly one successor and one predecessor, so the walk returns to its start.
        loop {
            boundary.push(Point::new(dart.0[0] as f64 * GRID_S, dart.0[1] as f64 * GRID_S));
            let (node, leaving) = leaving(dart.1);
            *touches |= leaving.len() == 1 || core::mem::replace(&mut passed[node], true);
            let back = leaving.iter().position(|other| other.1 == dart.0).unwrap_or(0);
            dart = leaving[(back + 1) % leaving.len()];
            if dart == start {
                return;
            }
        }
    }
}

/// Appends the nodes at which two edges cross or touch between the ends of at least one of them.
fn compare((i, e): (usize, Edge), (j, f): (usize, Edge), cuts: &mut Vec<(usize, Node)>) {
    let range = |(a, b): Edge| (a[1].min(b[1]), a[1].max(b[1]));
    let ((low, high), (bottom, top)) = (range(e), range(f));
    if bottom > high + 1 || top < low - 1 {
        return;
    }
    if apart(e, f) || apart(f, e) {
        return;
    }
    let before = cuts.len();
    let touching = |e: Edge, f: Edge| [f.0, f.1].into_iter().filter(move |&n| on(n, e));
    cuts.extend(touching(e, f).map(|node| (i, node)));
    cuts.extend(touching(f, e).map(|node| (j, node)));
    if before == cuts.len()
        && let Some(node) = crossing(e, f)
    {
        let inside = |e: Edge| node != e.0 && node != e.1;
        cuts.extend(inside(e).then_some((i, node)));
        cuts.extend(inside(f).then_some((j, node)));
    }
}

/// Whether the edge `other` lies clearly on one side of the line through `e`. This is true of most
/// pairs.
fn apart(e: Edge, other: Edge) -> bool {
    let along = difference(e.1, e.0);
    let [a, b] = [other.0, other.1].map(|node| cross(along, difference(node, e.0)));
    let clear = 4.0 * ON_EDGE * ON_EDGE * along.norm_sqr();
    (a > 0.0) == (b > 0.0) && a * a > clear && b * b > clear
}

/// Compares two darts from the same node by their directions in (−π, π].
fn around(a: Dart, b: Dart) -> Ordering {
    let direction = |(from, to): Dart| [to[0] - from[0], to[1] - from[1]];
    let ([ax, ay], [bx, by]) = (direction(a), direction(b));
    // Directions in (−π, 0) come before those in [0, π].
    (ay >= 0, ay == 0 && ax < 0).cmp(&(by >= 0, by == 0 && bx < 0)).then_with(|| {
        let cross = i128::from(ax) * i128::from(by) - i128::from(ay) * i128::from(bx);
        0.cmp(&cross)
    })
}

fn node(point: Point) -> Node {
    [point.re, point.im].map(|coordinate| (coordinate / GRID_S).round() as i64)
}

fn edge(a: Node, b: Node) -> Option<Edge> {
    (a != b).then(|| (a.min(b), a.max(b)))
}

/// b − a as floating-point numbers, in grid spacings.
fn difference(b: Node, a: Node) -> Point {
    Point::new((b[0] - a[0]) as f64, (b[1] - a[1]) as f64)
}

fn cross(a: Point, b: Point) -> f64 {
    a.re * b.im - a.im * b.re
}

/// Whether a node is on an edge but not at one of its ends.
fn on(node: Node, (a, b): Edge) -> bool {
    if node == a || node == b {
        return false;
    }
    let (along, to) = (difference(b, a), difference(node, a));
    let length2 = along.norm_sqr();
    let share = along.re * to.re + along.im * to.im;
    let off = cross(along, to);
    share > 0.0 && share < length2 && off * off < ON_EDGE * ON_EDGE * length2
}

/// The node nearest to the crossing of two edges, if they cross.
fn crossing(e: Edge, f: Edge) -> Option<Node> {
    let (d, g) = (difference(e.1, e.0), difference(f.1, f.0));
    let determinant = cross(d, g);
    let offset = difference(f.0, e.0);
    let (s, t) = (cross(offset, g) / determinant, cross(offset, d) / determinant);
    // For parallel edges, these are infinite or NaN, so there is no crossing.
    let inside = |share: f64| share > 0.0 && share < 1.0;
    (inside(s) && inside(t))
        .then(|| [e.0[0] + (d.re * s).round() as i64, e.0[1] + (d.im * s).round() as i64])
}

#[cfg(test)]
mod tests {
    use super::super::polygon::signed_area;
    use super::*;

    fn outline(curve: &[Point]) -> Vec<Point> {
        let (mut outliner, mut boundary) = (Outliner::default(), curve.to_vec());
        let budget = Budget::new(1 << 20);
        boundary.truncate(1);
        outliner.add(curve);
        outliner.outline(&mut boundary, &budget);
        boundary
    }

    fn check(curve: &[[f64; 2]], area: f64, vertices: usize) {
        let points: Vec<_> = curve.iter().map(|p| Point::new(p[0], p[1])).collect();
        let boundary: Vec<_> = outline(&points).iter().map(|p| [p.re, p.im]).collect();
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
        // The curve winds twice around the pentagon in the middle.
        let star = [[0., 3.], [2., -3.], [-3., 1.], [3., 1.], [-2., -3.], [0., 3.]];
        let points: Vec<_> = star.iter().map(|p| Point::new(p[0], p[1])).collect();
        assert_eq!(outline(&points).len(), 10);
    }
}
