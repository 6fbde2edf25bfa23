//! The actions that a model distinguishes, and the shortest interval that holds a probability.

use crate::invalid::Invalid;
use crate::stats::rank::TIE;

/// The turn rates to which a model assigns probabilities.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ActionSpace<'a> {
    /// Turn rates (rad/s), in any order. Each has a probability.
    Levels(&'a [f64]),
    /// A range of turn rates, divided into bins by these edges (rad/s, ascending). Each bin has a
    /// probability, which is spread evenly over the bin. A bin between two equal edges is a single turn
    /// rate: straight driving, or an end of the range.
    Bins(&'a [f64]),
}

impl<'a> ActionSpace<'a> {
    /// Number of probabilities: one for each level or bin.
    #[must_use]
    pub fn len(self) -> usize {
        match self {
            Self::Levels(levels) => levels.len(),
            Self::Bins(edges) => edges.len().saturating_sub(1),
        }
    }

    /// Whether there is no level or bin.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The levels, or the edges of the bins (rad/s).
    #[must_use]
    pub fn rates(self) -> &'a [f64] {
        let (Self::Levels(rates) | Self::Bins(rates)) = self;
        rates
    }

    /// Checks that there is a level or bin, that turn rates are finite, and that edges ascend.
    ///
    /// # Errors
    /// [`Invalid`] with the field `actions`, also for edges.
    pub fn check(self) -> Result<(), Invalid> {
        if self.is_empty() {
            let expected = match self {
                Self::Levels(_) => "at least one action",
                Self::Bins(_) => "at least two edges of bins",
            };
            let found = if self.rates().is_empty() { "none" } else { "one" };
            return Err(Invalid::new("actions", expected, found));
        }
        for (i, &rate) in self.rates().iter().enumerate() {
            if !rate.is_finite() {
                return Err(Invalid::new(format!("actions[{i}]"), "a finite number", rate));
            }
        }
        if let Self::Bins(edges) = self
            && let Some(i) = edges.windows(2).position(|pair| pair[0] > pair[1])
        {
            let expected = format!("{} rad/s or more: edges ascend", edges[i]);
            return Err(Invalid::new(format!("actions[{}]", i + 1), expected, edges[i + 1]));
        }
        Ok(())
    }

    /// A level, or the middle of a bin (rad/s).
    ///
    /// # Panics
    /// If `place` ≥ [`Self::len`].
    #[must_use]
    pub fn middle(self, place: usize) -> f64 {
        match self {
            Self::Levels(levels) => levels[place],
            Self::Bins(edges) => 0.5 * (edges[place] + edges[place + 1]),
        }
    }

    /// The level that differs from `rate` by at most `tolerance` (rad/s), or the narrowest bin that
    /// contains `rate` up to `tolerance`.
    #[must_use]
    pub fn find(self, rate: f64, tolerance: f64) -> Option<usize> {
        match self {
            Self::Levels(levels) => levels.iter().position(|it| (it - rate).abs() <= tolerance),
            Self::Bins(edges) => {
                let width = |bin: &usize| edges[bin + 1] - edges[*bin];
                let contains = |bin: &usize| {
                    (edges[*bin] - tolerance..=edges[bin + 1] + tolerance).contains(&rate)
                };
                let bins = (0..self.len()).filter(contains);
                bins.min_by(|a, b| width(a).total_cmp(&width(b)))
            }
        }
    }
}

/// Finds shortest intervals and reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct ShortestInterval {
    /// Bins in ascending order: their edges (one more) and probabilities.
    edges: Vec<f64>,
    masses: Vec<f64>,
    order: Vec<usize>,
}

/// Turn rates, or lengths of intervals, that differ by at most this (rad/s) count as equal.
const SAME_RADPS: f64 = 1e-9;

/// The best interval so far, or the smallest one around several that are equally good.
#[derive(Clone, Copy, Debug)]
struct Found {
    lo: f64,
    hi: f64,
    /// The length and the probability of each of them.
    length: f64,
    mass: f64,
}

impl Found {
    fn consider(&mut self, of: &ShortestInterval, lo: f64, hi: f64) {
        let length = hi - lo;
        if length > self.length + SAME_RADPS {
            return;
        }
        let mass = of.mass(lo, hi);
        let is_shorter = length < self.length - SAME_RADPS;
        if is_shorter || mass > self.mass + SAME_MASS {
            *self = Self { lo, hi, length, mass };
        } else if mass >= self.mass - SAME_MASS {
            (self.lo, self.hi) = (self.lo.min(lo), self.hi.max(hi));
        }
    }
}

/// Probabilities that differ by at most this count as equal. It is above [`TIE`], by which an interval may
/// miss the requested probability.
const SAME_MASS: f64 = 4.0 * TIE;

impl ShortestInterval {
    /// The shortest closed interval with a probability of at least `q`, in (0, 1], up to [`TIE`]. Of several
    /// equally short ones, it is the most probable one, and of several equally probable ones, the smallest
    /// interval around them. So a distribution that is symmetric about 0 has a symmetric interval.
    ///
    /// Along a family of intervals with the probability q, the length is linear until an end passes an edge.
    /// So among the shortest intervals, one begins or ends at an edge.
    pub(super) fn find(&mut self, space: ActionSpace<'_>, p: &[f64], q: f64) -> (f64, f64) {
        let Found { lo, hi, .. } = self.shortest(space, p, q);
        (lo, hi)
    }

    fn shortest(&mut self, space: ActionSpace<'_>, p: &[f64], q: f64) -> Found {
        self.sort(space, p);
        let total: f64 = self.masses.iter().sum();
        let q = q.min(total) - TIE;
        let mut best = Found { lo: 0.0, hi: 0.0, length: f64::INFINITY, mass: 0.0 };
        let n = self.masses.len();
        for place in 0..n {
            // Upward from the beginning of a bin, and downward from its end.
            for up in [true, false] {
                let (mut bin, mut missing) = (place, q - self.masses[place]);
                while missing > 0.0 && (if up { bin + 1 < n } else { bin > 0 }) {
                    bin = if up { bin + 1 } else { bin - 1 };
                    missing -= self.masses[bin];
                }
                if missing > 0.0 {
                    continue;
                }
                let mass = self.masses[bin];
                let share = if mass > 0.0 { (1.0 + missing / mass).clamp(0.0, 1.0) } else { 0.0 };
                let part = share * (self.edges[bin + 1] - self.edges[bin]);
                let (lo, hi) = match up {
                    true => (self.edges[place], self.edges[bin] + part),
                    false => (self.edges[bin + 1] - part, self.edges[place + 1]),
                };
                best.consider(self, lo, hi);
            }
        }
        best
    }

    /// The probability of a closed interval.
    fn mass(&self, lo: f64, hi: f64) -> f64 {
        let of = |(pair, mass): (&[f64], &f64)| {
            let width = pair[1] - pair[0];
            let both = hi.min(pair[1]) - lo.max(pair[0]);
            match width > 0.0 {
                true => mass * (both / width).clamp(0.0, 1.0),
                false if both >= -SAME_RADPS => *mass,
                false => 0.0,
            }
        };
        self.edges.windows(2).zip(&self.masses).map(of).sum()
    }

    /// Writes the distribution as bins. Levels become bins without width, with empty bins between them.
    fn sort(&mut self, space: ActionSpace<'_>, p: &[f64]) {
        let Self { edges, masses, order } = self;
        edges.clear();
        masses.clear();
        match space {
            ActionSpace::Bins(given) => {
                edges.extend_from_slice(given);
                masses.extend_from_slice(p);
            }
            ActionSpace::Levels(levels) => {
                // There are a few levels, so inserting them one by one needs the least code.
                order.clear();
                for (i, level) in levels.iter().enumerate() {
                    let place = order.iter().take_while(|&&it| levels[it] <= *level).count();
                    order.insert(place, i);
                }
                for (place, &level) in order.iter().enumerate() {
                    if place > 0 {
                        masses.push(0.0);
                    }
                    edges.extend([levels[level]; 2]);
                    masses.push(p[level]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    fn find(space: ActionSpace<'_>, p: &[f64], q: f64) -> (f64, f64) {
        ShortestInterval::default().find(space, p, q)
    }

    #[test]
    fn levels() {
        let three = ActionSpace::Levels(&[0.5, -0.5, 0.0]); // in any order
        let p = [0.3, 0.1, 0.6];
        assert_eq!(find(three, &p, 0.6), (0.0, 0.0));
        // From -0.5 to 0 is as short, but less likely.
        assert_eq!(find(three, &p, 0.7), (0.0, 0.5));
        assert_eq!(find(three, &p, 0.9), (0.0, 0.5));
        assert_eq!(find(three, &p, 0.91), (-0.5, 0.5));
        assert_eq!(find(three, &p, 1.0), (-0.5, 0.5));
        // Right and left are equally likely, so both count.
        assert_eq!(find(three, &[0.3, 0.3, 0.4], 0.6), (-0.5, 0.5));
        assert_eq!(find(three, &[0.0, 0.0, 1.0], 1.0), (0.0, 0.0));
        // Thirds that a file rounded in different directions.
        let thirds = [1.0 / 3.0, 0.333_333_333_333_333_2, 0.333_333_333_333_333_4];
        assert_eq!(find(three, &thirds, 1.0 / 3.0), (-0.5, 0.5));
    }

    #[test]
    fn bins() {
        let uniform = ActionSpace::Bins(&[-0.5, 0.5]);
        assert_eq!(find(uniform, &[1.0], 1.0), (-0.5, 0.5));
        // All intervals of half the range are equally short.
        assert_eq!(find(uniform, &[1.0], 0.5), (-0.5, 0.5));
        // A peak with slopes: the interval takes equal parts of both slopes.
        let peak = ActionSpace::Bins(&[-0.5, -0.1, 0.1, 0.5]);
        let (lo, hi) = find(peak, &[0.2, 0.6, 0.2], 0.6);
        assert!((lo + 0.1).abs() < 1e-9 && (hi - 0.1).abs() < 1e-9, "{lo} {hi}");
        let (lo, hi) = find(peak, &[0.2, 0.6, 0.2], 0.7);
        assert!((lo + 0.3).abs() < 1e-8 && (hi - 0.3).abs() < 1e-8, "{lo} {hi}");
        // Point masses at the ends and at 0, as of a human with three keys and some noise.
        let edges = [-0.5, -0.5, 0.0, 0.0, 0.5, 0.5];
        let masses = [0.1, 0.05, 0.6, 0.05, 0.2];
        assert_eq!(find(ActionSpace::Bins(&edges), &masses, 0.6), (0.0, 0.0));
        assert_eq!(find(ActionSpace::Bins(&edges), &masses, 0.8), (0.0, 0.5));
    }

    /// Compares with every interval between the points of a fine grid.
    #[test]
    fn no_interval_is_shorter() {
        let mut rng = SeededRng::new(12);
        for case in 0..400 {
            let bins = 1 + rng.below(6);
            let mut edges: Vec<f64> =
                (0..=bins).map(|_| f64::from(rng.below(21) as u32) / 20.0 - 0.5).collect();
            edges.sort_unstable_by(f64::total_cmp);
            let mut p: Vec<f64> =
                (0..bins).map(|_| if rng.below(4) == 0 { 0.0 } else { rng.unit() }).collect();
            p[rng.below(bins)] += 0.1;
            let total: f64 = p.iter().sum();
            p.iter_mut().for_each(|p| *p /= total);
            let q = rng.uniform(0.05, 1.0);
            let space = ActionSpace::Bins(&edges);
            let Found { lo, hi, length, .. } = ShortestInterval::default().shortest(space, &p, q);
            let within = |from: f64, to: f64| -> f64 {
                let of = |bin: usize| {
                    let (a, b) = (edges[bin], edges[bin + 1]);
                    if a == b {
                        return if (from..=to).contains(&a) { p[bin] } else { 0.0 };
                    }
                    p[bin] * ((to.min(b) - from.max(a)) / (b - a)).max(0.0)
                };
                (0..bins).map(of).sum()
            };
            assert!(within(lo - 1e-9, hi + 1e-9) >= q - 1e-6, "case {case}: {lo} {hi} {q}");
            let grid = || (0..=200).map(|i| f64::from(i) / 200.0 - 0.5);
            for from in grid() {
                for to in grid().filter(|&to| to >= from && to - from < length - 1e-6) {
                    assert!(within(from, to) < q + 1e-6, "case {case}: {from} {to}");
                }
            }
            // The result is one of the shortest intervals, or begins and ends like one of them.
            assert!(within(lo - 1e-9, lo + length + 1e-9) >= q - 1e-6, "case {case}: {lo} {hi}");
            assert!(within(hi - length - 1e-9, hi + 1e-9) >= q - 1e-6, "case {case}: {lo} {hi}");
        }
    }

    #[test]
    fn spaces_are_checked() {
        let field = |space: ActionSpace<'_>| space.check().unwrap_err().field;
        assert_eq!(field(ActionSpace::Levels(&[])), "actions");
        assert_eq!(field(ActionSpace::Levels(&[0.0, f64::NAN])), "actions[1]");
        assert_eq!(field(ActionSpace::Bins(&[])), "actions");
        assert_eq!(field(ActionSpace::Bins(&[0.0])), "actions");
        assert_eq!(field(ActionSpace::Bins(&[0.0, 0.1, 0.05])), "actions[2]");
        assert!(ActionSpace::Bins(&[0.0, 0.0]).check().is_ok());
        let bins = ActionSpace::Bins(&[-0.5, 0.0, 0.0, 0.5]);
        assert_eq!((bins.len(), bins.middle(0), bins.find(0.0, 0.0)), (3, -0.25, Some(1)));
        assert_eq!((bins.find(0.2, 0.0), bins.find(0.6, 0.0)), (Some(2), None));
    }
}
