//! The clearance of a plan from the positions that the human can reach.

use super::branch_and_bound::{Search, Setting};
use super::interval::{Clearance, ClearanceSettings, Clearances};
use super::plan::{Footprint, Plan};
use crate::bounds::InputBounds;
use crate::invalid::{Invalid, positive};
use crate::math::PI;
use crate::plausibility::Departure;
use crate::vehicle::{Pose, SpeedRange};

/// The nested sets of a prediction. They contain the human's positions as long as the human drives at
/// these speeds and within these bounds. ([`OnlinePredictor`](super::OnlinePredictor) checks this for
/// the last step. Callers that build a `HumanFuture` themselves should call
/// [`departure_at`](crate::plausibility::departure_at).)
#[derive(Clone, Copy, Debug)]
pub struct HumanFuture<'a> {
    /// The human's present pose (world frame).
    pub start: Pose,
    /// The bounds of each set F_1 ⊆ F_2 ⊆ …: at least one set, all with the same number of steps.
    pub sets: &'a [InputBounds],
    /// The human's speeds (m/s): a constant speed, or a range from which the human chooses at any time.
    pub speed: SpeedRange,
    /// Duration of a step (s).
    pub step_s: f64,
}

impl HumanFuture<'_> {
    fn check(&self, plan: &Plan) -> Result<(), Invalid> {
        self.start.check().map_err(|invalid| invalid.within("start"))?;
        self.speed.check()?;
        positive("speed_mps", self.speed.hi_mps())?;
        positive("step_s", self.step_s)?;
        let Some(first) = self.sets.first() else {
            return Err(Invalid::new("sets", "at least one", "none"));
        };
        if (plan.step_s() - self.step_s).abs() > 1e-9 * self.step_s {
            let expected = format!("steps of {} s, as predicted", self.step_s);
            return Err(Invalid::new("plan.step_s", expected, plan.step_s()));
        }
        if plan.steps() != first.steps() {
            let expected = format!("{} steps, as predicted", first.steps());
            return Err(Invalid::new("plan", expected, format!("{} steps", plan.steps())));
        }
        for (j, set) in self.sets.iter().enumerate() {
            self.check_set(j, set).map_err(|invalid| invalid.within(&format!("sets[{j}]")))?;
        }
        Ok(())
    }

    /// Checks that set `j` contains the previous set and that its bounds allow at most half a turn in
    /// each step.
    fn check_set(&self, j: usize, set: &InputBounds) -> Result<(), Invalid> {
        let smaller = &self.sets[j.saturating_sub(1)];
        if set.steps() != smaller.steps() {
            let expected = format!("{} steps, as in the first set", smaller.steps());
            return Err(Invalid::new("", expected, format!("{} steps", set.steps())));
        }
        for i in 0..set.steps() {
            for (name, rate, before, sign) in [
                ("lo", set.lo()[i], smaller.lo()[i], -1.0),
                ("hi", set.hi()[i], smaller.hi()[i], 1.0),
            ] {
                if rate.abs() * self.step_s > PI {
                    let expected = format!("at most half a turn in a step of {} s", self.step_s);
                    let found = format!("{rate} rad/s");
                    return Err(Invalid::new(format!("{name}[{i}]"), expected, found));
                }
                if sign * (rate - before) < 0.0 {
                    let expected = format!("bounds around the previous set's, {before} rad/s");
                    return Err(Invalid::new(format!("{name}[{i}]"), expected, rate));
                }
            }
        }
        Ok(())
    }
}

/// Computes the clearances of plans, one after the other, and reuses its buffers. After the first
/// plan, plans that do not have more sets, more steps or larger turns cause no allocation.
///
/// # Method
/// A separating line between robot and human proves that they do not touch. For each direction, dynamic
/// programming over the heading gives an upper bound on how far the human can get. It replaces the
/// cosine, times the best speed, by a line above it in each time interval (`upper_bound`). The bound is valid for every choice
/// of directions and lines. While the proven distance is too far below the distance to the nearest
/// drive found, branch and bound halves the drives (by their heading at some instant) or the time
/// interval, and searches both halves (`branch_and_bound`). The method also works for non-convex sets
/// and at any turn rate.
///
/// # Example
/// ```
/// use sidestep::bounds::InputBounds;
/// use sidestep::clearance::{ClearanceFinder, Footprint, HumanFuture, Plan, PlanLimits};
/// use sidestep::vehicle::Pose;
///
/// // A human at 2 m/s, straight on or anywhere within ±0.5 rad/s, for five steps of 0.2 s.
/// let straight = InputBounds::new(vec![0.0; 5], vec![0.0; 5], (-0.5, 0.5))?;
/// let all = InputBounds::new(vec![-0.5; 5], vec![0.5; 5], (-0.5, 0.5))?;
/// let start = Pose::new(0.0, 0.0, 0.0);
/// let sets = [straight, all];
/// let future = HumanFuture { start, sets: &sets, speed: 2.0.into(), step_s: 0.2 };
/// // A robot that stands 3 m ahead, with a radius of 0.4 m.
/// let limits = PlanLimits::new(1.0, 1.0);
/// let plan = Plan::of_positions(&[[3.0, 0.0]; 6], 0.2, limits)?;
/// let mut finder = ClearanceFinder::default();
/// let found = finder.find(&future, &plan, &Footprint::disc(0.4)?)?;
/// // After 1 s the human is 2 m nearer.
/// let clearance = found.of(1);
/// assert!(clearance.at_least_m <= 0.6 && 0.6 <= clearance.at_most_m + 1e-9);
/// assert!(clearance.at_most_m - clearance.at_least_m <= 0.02);
/// # Ok::<(), sidestep::invalid::Invalid>(())
/// ```
#[derive(Clone, Debug)]
pub struct ClearanceFinder {
    settings: ClearanceSettings,
    search: Search,
    found: Clearances,
}

impl ClearanceFinder {
    /// A finder with these settings.
    #[must_use]
    pub fn new(settings: ClearanceSettings) -> Self {
        Self { settings, search: Search::default(), found: Clearances::default() }
    }

    /// The clearances of the last plan.
    #[must_use]
    pub fn clearances(&self) -> &Clearances {
        &self.found
    }

    /// Computes the clearance of `plan` from each set of `future` in each step. Both begin at the same
    /// instant.
    ///
    /// # Errors
    /// [`Invalid`] if the steps of the plan and the sets differ, the sets are not nested, the bounds
    /// of a set allow more than half a turn in a step, or a number is not finite.
    pub fn find(
        &mut self,
        future: &HumanFuture<'_>,
        plan: &Plan,
        footprint: &Footprint,
    ) -> Result<&Clearances, Invalid> {
        future.check(plan)?;
        let (settings, steps) = (self.settings, plan.steps());
        (self.found.steps, self.found.unproved) = (steps, None);
        self.found.all.clear();
        self.found.all.resize(future.sets.len() * steps, Clearance::NONE);
        let (mut left, mut undecided) = (settings.most_work, future.sets.len() * steps);
        // The largest set comes first, because its lower bounds also hold for the sets inside it.
        for (j, set) in future.sets.iter().enumerate().rev() {
            let (start, speed_mps, step_s) = (future.start, future.speed.hi_mps(), future.step_s);
            let slow = future.speed.lo_mps() / speed_mps;
            let setting = Setting { start, speed_mps, slow, step_s, plan, footprint, settings };
            self.search.begin(set, &setting);
            for step in 0..steps {
                let larger = self.found.all.get((j + 1) * steps + step).copied();
                let at_least = larger.map_or(f64::NEG_INFINITY, |larger| larger.at_least_m);
                let (clearance, work) =
                    self.search.step(&setting, step, at_least, left / undecided);
                self.found.all[j * steps + step] = clearance;
                left = left.saturating_sub(work);
                undecided -= 1;
            }
        }
        // A drive of a smaller set is also a drive of the larger sets.
        for i in steps..self.found.all.len() {
            let smaller = self.found.all[i - steps].at_most_m;
            let all = &mut self.found.all[i];
            all.at_most_m = all.at_most_m.min(smaller);
        }
        Ok(&self.found)
    }

    /// Like [`Self::find`] if `departed` is `None`. Otherwise the human did not drive like the vehicle
    /// in the last step. In that case, every clearance is −∞, and [`Clearances::unproved`] returns the
    /// reason.
    ///
    /// # Errors
    /// The errors of [`Self::find`].
    pub fn find_unless(
        &mut self,
        departed: Option<Departure>,
        future: &HumanFuture<'_>,
        plan: &Plan,
        footprint: &Footprint,
    ) -> Result<&Clearances, Invalid> {
        let Some(why) = departed else { return self.find(future, plan, footprint) };
        future.check(plan)?;
        self.found.steps = plan.steps();
        self.found.all.resize(future.sets.len() * plan.steps(), Clearance::NONE);
        self.found.prove_nothing(why);
        Ok(&self.found)
    }
}

impl Default for ClearanceFinder {
    fn default() -> Self {
        Self::new(ClearanceSettings::default())
    }
}
