//! Closed curves of arcs, and the union of their rotations about the origin or of their translations.
//!
//! A rotation or a translation maps arcs to arcs, so these curves stay exact after any number of sweeps.
//!
//! Take a closed curve whose winding number is at least 0 around each position. Along a circle about
//! the origin, in the direction of increasing angle, the winding number rises where the curve crosses
//! the circle outward and falls where the curve crosses it inward. Rotate all outward crossings by −α
//! and all inward crossings by +α. Then the winding number at each angle is at least the old winding
//! number at *any* angle up to α away, and it is 0 if the old winding number was 0 at all these angles.
//! So the curve is divided into [`Chain`]s at the extremes of the distance from the origin. Chains that
//! recede from the origin are rotated to the right and the others to the left, and arcs about the
//! origin connect them. The new curve winds at least once around each position of the union, and around
//! no other position.
//!
//! If two neighbouring chains overlap after the rotation, both are removed up to their crossing. The
//! area that they enclosed then counts once instead of twice.
//!
//! The same holds along a line instead of a circle. So [`Curve::stretch`] translates the two sides of a curve
//! in opposite directions, and straight edges connect them.

use super::super::paths::unit;
use super::Point;
use super::edges::{Corner, Edge, NOTHING, arc, cross, crossings};
use crate::math::{PI, TAU, atan2};

/// Chains less than this angle apart (rad) count as coincident.
const LEAST_APART: f64 = 1e-9;

/// Chains are cut only after rotations by at most this angle (rad), because an overlap of about half a
/// turn cannot be distinguished from no overlap.
const WIDEST_CUT: f64 = 1.2;

/// Squared relative distance up to which two points count as one.
const SAME: f64 = 1e-14;

/// Maximum number of iterations that narrow the bracket of a crossing.
const MOST_ROUNDS: usize = 60;

/// A part of a curve along which the distance from the origin is monotonic.
#[derive(Clone, Copy, Debug)]
struct Chain {
    /// The first edge, and the point on it at which the chain begins.
    first: usize,
    start: Point,
    /// The last edge, and the point on it at which the chain ends.
    last: usize,
    end: Point,
    /// Whether the start and the end of the chain were cut off.
    cut: [bool; 2],
    gone: bool,
}

/// A local extremum of the distance from the origin, between two chains.
#[derive(Clone, Copy, Debug)]
struct Extreme {
    point: Point,
    /// Whether it is a maximum.
    far: bool,
    /// Whether an arc connects the chains. Otherwise the chains meet or have been removed.
    connects: bool,
    /// The beginning and the end of the arc. Each is set only if the arc was cut off there.
    from: Option<Point>,
    to: Option<Point>,
}

/// A curve, and buffers for the next one.
#[derive(Clone, Debug, Default)]
pub(super) struct Curve {
    pub(super) corners: Vec<Corner>,
    /// Corners between which the distance from the origin is monotonic, each with its squared distance. In
    /// a stretch, heights replace squared distances.
    radial: Vec<(Corner, f64)>,
    extremes: Vec<Extreme>,
    chains: Vec<Chain>,
    /// Number of pairs of edges that the last sweep compared.
    pub(super) compared: usize,
}

impl Curve {
    /// Replaces the curve by a curve around the union of all its rotations about the origin by at most
    /// `angle` to either side. Returns the number of extremes of the distance from the origin that the
    /// old curve had, or 0 if the result is a full circle.
    pub(super) fn sweep(&mut self, angle: f64) -> usize {
        self.divide();
        self.find_extremes();
        self.corners.clear();
        self.compared = 0;
        if self.radial.len() == 1 && angle < PI {
            let point = self.radial[0].0.point;
            arc(point * unit(-angle), point * unit(angle), 2.0 * angle, true, &mut self.corners);
            arc(point * unit(angle), point * unit(-angle), 2.0 * angle, false, &mut self.corners);
            if self.corners.is_empty() {
                self.corners.push(Corner { point, edge: Edge::Line });
            }
            return 2;
        }
        if angle >= PI || self.extremes.is_empty() {
            self.surround();
            return 0;
        }
        if angle <= WIDEST_CUT {
            for k in 0..self.extremes.len() {
                self.cut(k, angle);
            }
        }
        self.write(angle);
        self.extremes.len()
    }

    /// Replaces the curve by the circle through its farthest corner.
    fn surround(&mut self) {
        let Some(&(farthest, _)) = self.radial.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
            return;
        };
        let point = farthest.point;
        arc(point, point, TAU, true, &mut self.corners);
        if self.corners.is_empty() {
            self.corners.push(Corner { point, edge: Edge::Line });
        }
    }

    /// Replaces the curve by a curve around the union of all its translations by `half` times a number
    /// from −1 to 1.
    pub(super) fn stretch(&mut self, half: Point) {
        if let [Corner { point, .. }] = self.corners[..] {
            let corner = |point| Corner { point, edge: Edge::Line };
            self.corners.clear();
            self.corners.extend([corner(point - half), corner(point + half)]);
            return;
        }
        self.divide_across(half);
        let Self { corners, radial, .. } = self;
        corners.clear();
        let n = radial.len();
        // Among corners at the same height, the one farther along counts as higher. So the rule also holds
        // for a curve that runs along `half`.
        let place = |i: usize| {
            let (corner, height) = radial[i % n];
            (height, (corner.point * half.conj()).re)
        };
        let mut rose = place(0) > place(n - 1);
        for (i, (corner, _)) in radial.iter().enumerate() {
            let rises = place(i + 1) > place(i);
            let shift = |rises: bool| if rises { half } else { -half };
            if rises != rose {
                corners.push(Corner { point: corner.point + shift(rose), edge: Edge::Line });
            }
            corners.push(corner.moved(shift(rises)));
            rose = rises;
        }
    }

    /// Divides the edges where they are parallel to `half`. Each corner then has its height above the line
    /// along `half`, times the length of `half`.
    fn divide_across(&mut self, half: Point) {
        let Self { corners, radial, .. } = self;
        radial.clear();
        let n = corners.len();
        let mut push = |corner: Corner| radial.push((corner, cross(half, corner.point)));
        let up = half * Point::new(0.0, 1.0 / half.norm_sqr().sqrt());
        for (i, &corner) in corners.iter().enumerate() {
            push(corner);
            let Edge::Arc { centre, left } = corner.edge else { continue };
            let (from, to) = (corner.point - centre, corners[(i + 1) % n].point - centre);
            // An arc covers at most a quarter of a circle, so it has at most one such point.
            let out = up * from.norm_sqr().sqrt();
            let sign = if left { 1.0 } else { -1.0 };
            for out in [out, -out] {
                let is_inside = sign * cross(from, out) > 0.0
                    && sign * cross(out, to) > 0.0
                    && (out * (from + to).conj()).re > 0.0;
                if is_inside {
                    push(Corner { point: centre + out, ..corner });
                }
            }
        }
    }

    /// Makes the curve begin and end at the origin, which it encloses.
    pub(super) fn begin_at_origin(&mut self) {
        let Some(&Corner { point: first, .. }) = self.corners.first() else { return };
        if first.norm_sqr() < NOTHING {
            return;
        }
        self.corners.insert(0, Corner { point: Point::new(0.0, 0.0), edge: Edge::Line });
        self.corners.push(Corner { point: first, edge: Edge::Line });
    }

    /// Makes a polygon begin at its point nearest to the origin, which it encloses. The line from the
    /// origin to that point is inside the polygon and stays inside when it is swept.
    pub(super) fn begin_nearest(&mut self) {
        let Self { corners, .. } = self;
        let n = corners.len();
        let foot = |i: usize| {
            let (from, to) = (corners[i].point, corners[(i + 1) % n].point);
            let along = to - from;
            let length2 = along.norm_sqr();
            let share = -(from * along.conj()).re / length2;
            from + along * if length2 > 0.0 { share.clamp(0.0, 1.0) } else { 0.0 }
        };
        let nearest = (0..n).min_by(|&i, &j| foot(i).norm_sqr().total_cmp(&foot(j).norm_sqr()));
        let Some(i) = nearest else { return };
        let point = foot(i);
        corners.rotate_left((i + 1) % n);
        corners.insert(0, Corner { point, edge: Edge::Line });
    }

    /// Divides the edges at the extremes of the distance from the origin.
    fn divide(&mut self) {
        let Self { corners, radial, .. } = self;
        radial.clear();
        let n = corners.len();
        for (i, &corner) in corners.iter().enumerate() {
            let (a, b) = (corner.point, corners[(i + 1) % n].point);
            if (b - a).norm_sqr() < NOTHING && n > 1 {
                continue;
            }
            radial.push((corner, a.norm_sqr()));
            match corner.edge {
                Edge::Line => {
                    let along = b - a;
                    let share = -(a * along.conj()).re / along.norm_sqr();
                    if share > 0.0 && share < 1.0 {
                        let point = a + along * share;
                        radial.push((Corner { point, ..corner }, point.norm_sqr()));
                    }
                }
                Edge::Arc { centre, left } => {
                    let size = (centre.norm_sqr(), (a - centre).norm_sqr());
                    let out = centre * (size.1 / size.0).sqrt();
                    let sign = if left { 1.0 } else { -1.0 };
                    for out in [out, -out] {
                        let is_inside = sign * cross(a - centre, out) > 0.0
                            && sign * cross(out, b - centre) > 0.0
                            && (a - centre + b - centre).norm_sqr() > 0.0
                            && (out * (a - centre + b - centre).conj()).re > 0.0;
                        if is_inside && size.0 > NOTHING {
                            let point = centre + out;
                            radial.push((Corner { point, ..corner }, point.norm_sqr()));
                        }
                    }
                }
            }
        }
        if radial.is_empty() {
            radial.extend(corners.first().map(|&corner| (corner, corner.point.norm_sqr())));
        }
    }

    /// Finds the extremes, and the chain that follows each of them.
    fn find_extremes(&mut self) {
        let Self { radial, extremes, chains, .. } = self;
        extremes.clear();
        chains.clear();
        let n = radial.len();
        let recedes = |i: usize| radial[(i + 1) % n].1 >= radial[i % n].1;
        for (place, (corner, _)) in radial.iter().enumerate() {
            let came = recedes(place + n - 1);
            if came != recedes(place) {
                let point = corner.point;
                extremes.push(Extreme { point, far: came, connects: true, from: None, to: None });
                let cut = [false; 2];
                chains.push(Chain {
                    first: place,
                    start: point,
                    last: 0,
                    end: point,
                    cut,
                    gone: false,
                });
            }
        }
        let count = chains.len();
        for k in 0..count {
            let next = chains[(k + 1) % count];
            let (first, last) = (chains[k].first, next.first + n - 1);
            chains[k].last = if last - first >= n { last - n } else { last };
            chains[k].end = next.start;
        }
    }

    /// An edge and its ends.
    fn edge(&self, i: usize) -> (Edge, Point, Point) {
        let n = self.radial.len();
        let corner = self.radial[i % n].0;
        (corner.edge, corner.point, self.radial[(i + 1) % n].0.point)
    }

    /// The point of an edge at this squared distance from the origin.
    fn at(&self, i: usize, distance2: f64) -> Point {
        let (edge, a, b) = self.edge(i);
        match edge {
            Edge::Line => {
                let along = b - a;
                let length2 = along.norm_sqr();
                let foot = -(a * along.conj()).re / length2;
                let height2 = (a + along * foot).norm_sqr();
                let off = ((distance2 - height2) / length2).max(0.0).sqrt();
                let share = if b.norm_sqr() >= a.norm_sqr() { foot + off } else { foot - off };
                a + along * share.clamp(0.0, 1.0)
            }
            Edge::Arc { centre, .. } => {
                let centre2 = centre.norm_sqr();
                if centre2 < NOTHING {
                    return a;
                }
                let along = 0.5 * (distance2 + centre2 - (a - centre).norm_sqr()) / centre2;
                let off = (distance2 / centre2 - along * along).max(0.0).sqrt();
                centre * Point::new(along, if cross(centre, a + b) < 0.0 { -off } else { off })
            }
        }
    }

    /// Cuts off the overlap of the chains before and after extreme `k`. The overlap ends at a crossing of
    /// the chains, or at the other end of one of them. In the second case this chain is removed, and the
    /// arc at that end leads to the other chain directly. Nothing changes if the chains do not overlap,
    /// or if that arc is already cut off.
    fn cut(&mut self, k: usize, angle: f64) {
        let count = self.chains.len();
        let (before, after) = ((k + count - 1) % count, k);
        let (a, b) = (self.chains[before], self.chains[after]);
        let extreme = self.extremes[k];
        if a.gone || b.gone || count < 4 || !extreme.connects || a.cut[1] || b.cut[0] {
            return;
        }
        if extreme.from.is_some() || extreme.to.is_some() {
            return;
        }
        let far = extreme.far;
        let wide = unit(-2.0 * angle);
        // e^{iδ} times the squared distance, where δ is the angle by which the chain that is rotated
        // to the left lies to the right of the other chain.
        let apart = |a: Point, b: Point| if far { a * b.conj() } else { b * a.conj() };
        let sides = if far { [unit(-angle), unit(angle)] } else { [unit(angle), unit(-angle)] };
        let mut distance2 = extreme.point.norm_sqr();
        if distance2 < NOTHING {
            return;
        }
        let (mut i, mut j) = (a.last, b.first);
        loop {
            self.compared += 1;
            let begin = |i: usize| self.radial[i % self.radial.len()].1;
            let (a_ends, b_ends) = (i == a.first, j == b.last);
            let to_a = if a_ends { a.start.norm_sqr() } else { begin(i) };
            let to_b = if b_ends { b.end.norm_sqr() } else { begin(j + 1) };
            let next = if far { to_a.max(to_b) } else { to_a.min(to_b) };
            let (a_over, b_over) = (to_a == next && a_ends, to_b == next && b_ends);
            // The exact ends are used, because computed ends would be inaccurate where an edge just
            // touches the circle at this distance. The angle of the arc from such an end to the other
            // chain could then be slightly negative and be mistaken for a whole turn.
            let p = if a_over { a.start } else { self.at(i, next) };
            let q = if b_over { b.end } else { self.at(j, next) };
            let between = apart(p, q);
            // The chains must not meet before this distance. Beyond a meeting point, or where the
            // chains coincide, the region between them belongs to the set and grows. It is not a
            // notch, which would shrink.
            let middle = 0.5 * (distance2 + next);
            let meanwhile = apart(self.at(i, middle), self.at(j, middle));
            if between.im <= 0.0
                || meanwhile.im <= LEAST_APART * middle
                || self.meet_within([i, j], [distance2, next], extreme.point)
            {
                return;
            }
            if (between * wide).im >= 0.0 {
                let (p, q) = self.meet([i, j], [distance2, next], |p, q| (apart(p, q) * wide).im);
                if (p * sides[0] - q * sides[1]).norm_sqr() > SAME * p.norm_sqr() {
                    return;
                }
                (self.chains[before].last, self.chains[before].end) = (i, p);
                (self.chains[after].first, self.chains[after].start) = (j, q);
                self.chains[before].cut[1] = true;
                self.chains[after].cut[0] = true;
                self.extremes[k].connects = false;
                return;
            }
            if a_over && (b_over || a.cut[0]) || b_over && b.cut[1] {
                return;
            }
            if a_over {
                let end = &mut self.extremes[before];
                if end.connects && end.to.is_none() && end.from.is_none() {
                    end.to = Some(q * sides[1]);
                    self.chains[before].gone = true;
                    (self.chains[after].first, self.chains[after].start) = (j, q);
                    self.chains[after].cut[0] = true;
                    self.extremes[k].connects = false;
                }
                return;
            }
            if b_over {
                let end = &mut self.extremes[(k + 1) % count];
                if end.connects && end.to.is_none() && end.from.is_none() {
                    end.from = Some(p * sides[0]);
                    self.chains[after].gone = true;
                    (self.chains[before].last, self.chains[before].end) = (i, p);
                    self.chains[before].cut[1] = true;
                    self.extremes[k].connects = false;
                }
                return;
            }
            if to_a == next {
                i -= 1;
            }
            if to_b == next {
                j += 1;
            }
            distance2 = next;
        }
    }

    /// Whether two edges meet between two squared distances, at a point other than `known`.
    fn meet_within(&self, [i, j]: [usize; 2], range: [f64; 2], known: Point) -> bool {
        let slack = LEAST_APART * range[0].max(range[1]);
        let (low, high) = (range[0].min(range[1]) - slack, range[0].max(range[1]) + slack);
        let (e, f) = (self.edge(i), self.edge(j));
        crossings((e.0, e.1, e.2), (f.0, f.1, f.2)).into_iter().flatten().any(|point| {
            let distance2 = point.norm_sqr();
            let is_on = |edge: usize| {
                (self.at(edge, distance2) - point).norm_sqr() < LEAST_APART * distance2
            };
            (low..=high).contains(&distance2)
                && (point - known).norm_sqr() > SAME * distance2
                && is_on(i)
                && is_on(j)
        })
    }

    /// Finds the squared distance at which the `overlap` of two edges is 0, between two squared
    /// distances at which it has different signs. Returns the points of both edges there.
    fn meet(
        &self,
        [i, j]: [usize; 2],
        [mut low, mut high]: [f64; 2],
        overlap: impl Fn(Point, Point) -> f64,
    ) -> (Point, Point) {
        let value = |distance2: f64| overlap(self.at(i, distance2), self.at(j, distance2));
        let (mut at_low, mut at_high) = (value(low), value(high));
        let mut best = high;
        for _ in 0..MOST_ROUNDS {
            let middle = if at_low == at_high {
                0.5 * (low + high)
            } else {
                high - at_high * (high - low) / (at_high - at_low)
            };
            // Illinois algorithm: the value at the retained end of the bracket is halved.
            let found = value(middle);
            best = middle;
            if found.abs() < 1e-15 * middle || (high - low).abs() < 1e-14 * middle {
                break;
            }
            if (found > 0.0) == (at_high > 0.0) {
                (high, at_high) = (middle, found);
                at_low *= 0.5;
            } else {
                (low, at_low) = (high, at_high);
                (high, at_high) = (middle, found);
            }
        }
        (self.at(i, best), self.at(j, best))
    }

    /// Writes the curve from the remaining chains and arcs.
    fn write(&mut self, angle: f64) {
        let Self { corners, radial, extremes, chains, .. } = self;
        let n = radial.len();
        let (right, left) = (unit(-angle), unit(angle));
        for (extreme, chain) in extremes.iter().zip(chains.iter()) {
            let Extreme { point, far, connects, from, to } = *extreme;
            let (before, after) = if far { (right, left) } else { (left, right) };
            if connects {
                let (first, last) = (from.unwrap_or(point * before), to.unwrap_or(point * after));
                let width = if from.is_none() && to.is_none() {
                    2.0 * angle
                } else {
                    let between = if far { last * first.conj() } else { first * last.conj() };
                    let width = atan2(between.im, between.re);
                    if width < -1e-9 { width + TAU } else { width.max(0.0) }
                };
                arc(first, last, width, far, corners);
            }
            if chain.gone {
                continue;
            }
            let begin = Corner { point: chain.start, ..radial[chain.first % n].0 };
            corners.push(begin.rotated(after));
            let further = chain.first + 1..=chain.last;
            corners.extend(further.map(|i| radial[i % n].0.rotated(after)));
        }
    }
}
