//! Clearances, and the accuracy to which they are computed.

use crate::invalid::Invalid;
use crate::plausibility::Departure;

/// Bounds on the smallest distance between the footprint and the human in one step of a plan: the
/// minimum, over all instants of the step, of the distance from the human's position at that instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Lower bound (m): no drive in the set comes nearer. If it is negative, the human might touch the
    /// robot; its magnitude is not the depth of the overlap.
    pub at_least_m: f64,
    /// Upper bound (m): some drive in the set comes this near. If it is ≤ 0, a drive touches the robot.
    pub at_most_m: f64,
}

impl Clearance {
    /// The element-wise minimum of two clearances.
    fn and(self, other: Self) -> Self {
        Self {
            at_least_m: self.at_least_m.min(other.at_least_m),
            at_most_m: self.at_most_m.min(other.at_most_m),
        }
    }

    pub(super) const NONE: Self = Self { at_least_m: f64::INFINITY, at_most_m: f64::INFINITY };

    /// Nothing is known.
    const UNPROVED: Self = Self { at_least_m: f64::NEG_INFINITY, at_most_m: f64::NEG_INFINITY };
}

/// The clearance of a plan from each set, in each step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clearances {
    pub(super) steps: usize,
    /// All steps of the first set, then all steps of the second, and so on.
    pub(super) all: Vec<Clearance>,
    pub(super) unproved: Option<Departure>,
}

impl Clearances {
    /// The number of sets.
    #[must_use]
    pub fn sets(&self) -> usize {
        self.all.len().checked_div(self.steps).unwrap_or(0)
    }

    /// The number of steps, T.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The clearance from set `set` in each step; set 0 is the smallest. Larger sets have smaller
    /// clearances.
    ///
    /// # Panics
    /// If `set` is not less than the number of sets.
    #[must_use]
    pub fn by_step(&self, set: usize) -> &[Clearance] {
        &self.all[set * self.steps..(set + 1) * self.steps]
    }

    /// The clearance from set `set` over all steps.
    ///
    /// # Panics
    /// If `set` is not less than the number of sets.
    #[must_use]
    pub fn of(&self, set: usize) -> Clearance {
        self.by_step(set).iter().fold(Clearance::NONE, |all, step| all.and(*step))
    }

    /// The reason why every clearance is −∞: the vehicle model cannot have driven the human's last
    /// step, so the sets do not bound the human's next steps. `None` if the clearances hold.
    #[must_use]
    pub fn unproved(&self) -> Option<Departure> {
        self.unproved
    }

    /// Sets every clearance to −∞ and stores the reason `why`.
    pub(super) fn prove_nothing(&mut self, why: Departure) {
        self.all.fill(Clearance::UNPROVED);
        self.unproved = Some(why);
    }

    /// The index of the largest set from which the plan stays more than `margin_m` ≥ 0 (m) away in all
    /// steps. The plan then also stays clear of all smaller sets. `None` if there is no such set.
    #[must_use]
    pub fn largest_clear(&self, margin_m: f64) -> Option<usize> {
        (0..self.sets()).rev().find(|&set| self.of(set).at_least_m > margin_m)
    }
}

/// Accuracy of clearances, and limits on the work.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClearanceSettings {
    /// Largest gap (m) between [`Clearance::at_most_m`] and [`Clearance::at_least_m`], where a
    /// negative `at_least_m` counts as 0. The gap can be larger if one of the limits below ends the
    /// search, as at long horizons and large turns.
    pub accuracy_m: f64,
    /// Clearances of at least this (m) need not be accurate.
    pub enough_m: f64,
    /// For each set and step, branch and bound divides the drives and the time into at most this many
    /// parts. A search that reaches this limit underestimates the clearance.
    pub most_parts: usize,
    /// Limit on the work for all sets and steps together. It bounds the computing time even for long
    /// horizons and fast turns. A unit of work is one time interval evaluated for one direction. Each
    /// step of each set gets an equal share of the remaining work, and at least one part.
    pub most_work: usize,
}

/// The default limit on the work for a plan.
const MOST_WORK: usize = 500_000;

impl ClearanceSettings {
    /// An accuracy of `accuracy_m` (m) up to a clearance of 2 m, with at most 400 parts and 500,000
    /// units of work.
    ///
    /// # Errors
    /// [`Invalid`] if the accuracy is not from 10⁻⁴ to 10 m.
    pub fn new(accuracy_m: f64) -> Result<Self, Invalid> {
        if !(1e-4..=10.0).contains(&accuracy_m) {
            return Err(Invalid::new("accuracy_m", "10⁻⁴ to 10 m", accuracy_m));
        }
        Ok(Self { accuracy_m, ..Self::default() })
    }

    /// Replaces [`Self::enough_m`] (m). With +∞, every clearance is accurate.
    ///
    /// # Errors
    /// [`Invalid`] if it is not > 0.
    pub fn with_enough(self, enough_m: f64) -> Result<Self, Invalid> {
        if enough_m > 0.0 {
            return Ok(Self { enough_m, ..self });
        }
        Err(Invalid::new("enough_m", "a number > 0", enough_m))
    }

    /// Replaces [`Self::most_parts`].
    ///
    /// # Errors
    /// [`Invalid`] if it is not from 1 to 10⁶.
    pub fn with_most_parts(self, most_parts: usize) -> Result<Self, Invalid> {
        if (1..=1_000_000).contains(&most_parts) {
            return Ok(Self { most_parts, ..self });
        }
        Err(Invalid::new("most_parts", "a whole number from 1 to 1000000", most_parts))
    }

    /// Replaces [`Self::most_work`].
    #[must_use]
    pub fn with_most_work(self, most_work: usize) -> Self {
        Self { most_work, ..self }
    }
}

impl ClearanceSettings {
    /// The lower bound (m) at which the search can stop, given the upper bound `at_most_m`.
    pub(super) fn goal(&self, at_most_m: f64) -> f64 {
        self.enough_m.min(at_most_m - self.accuracy_m)
    }
}

impl Default for ClearanceSettings {
    /// An accuracy of 2 cm up to a clearance of 2 m, with at most 400 parts and 500,000 units of work.
    fn default() -> Self {
        Self { accuracy_m: 0.02, enough_m: 2.0, most_parts: 400, most_work: MOST_WORK }
    }
}
