//! The probabilities that a trajectory stays inside each of the nested sets, estimated from
//! recorded trajectories.
//!
//! Region j is F_j without F_{j−1}. A trajectory is inside F_j if it is inside at every step, and in
//! region j if F_j is the smallest set that contains it.

use super::widened::tube_area_m2;
use super::window::{Trajectory, Window, WindowChoice};
use super::window_sets::{Prediction, same_steps};
use crate::bounds::{ActionModel, BoundsSettings, InputBounds};
use crate::invalid::Invalid;
use crate::parallel::parallel_map;
use crate::reach::{ReachableSet, Tolerance};
use crate::stats::{Estimate, Tally, open_probability, share};
use crate::vehicle::Pose;
use serde::{Deserialize, Serialize};

/// The probabilities of nested sets and of their regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Probabilities {
    /// p_F: the probability that a trajectory is inside each set, from the smallest to the largest.
    /// The last one is 1 by construction.
    pub inside: Vec<Estimate>,
    /// p_S: the probability of each region. These probabilities sum to 1.
    pub region: Vec<Estimate>,
    /// Number of windows.
    pub windows: usize,
    /// Number of trajectories with at least one window.
    pub trajectories: usize,
    /// Confidence of the intervals.
    pub confidence: f64,
}

/// Estimates the probabilities. `first[i]` has an entry for each window of trajectory i: the index,
/// from 0, of the smallest of the `sets` sets that contains the window. [`share`] computes the
/// intervals. It assumes that trajectories are independent, but not that windows are independent.
///
/// # Errors
/// [`Invalid`] if there are no sets or no windows, an index is too large, or `confidence` is not in
/// (0, 1).
pub fn probabilities(
    first: &[Vec<usize>],
    sets: usize,
    confidence: f64,
) -> Result<Probabilities, Invalid> {
    open_probability("confidence", confidence)?;
    if sets == 0 {
        return Err(Invalid::new("sets", "at least one", sets));
    }
    let windows: usize = first.iter().map(Vec::len).sum();
    if windows == 0 {
        return Err(Invalid::new("windows", "at least one", "none"));
    }
    for (i, places) in first.iter().enumerate() {
        if let Some(j) = places.iter().position(|&place| place >= sets) {
            let expected = format!("a place from 0 to {}", sets - 1);
            return Err(Invalid::new(format!("first[{i}][{j}]"), expected, places[j]));
        }
    }
    let share_of = |holds: &dyn Fn(usize) -> bool| {
        let tally = |places: &Vec<usize>| Tally {
            hits: places.iter().filter(|&&place| holds(place)).count(),
            of: places.len(),
        };
        share(&first.iter().map(tally).collect::<Vec<_>>(), confidence)
    };
    let mut inside =
        (0..sets - 1).map(|set| share_of(&|place| place <= set)).collect::<Result<Vec<_>, _>>()?;
    inside.push(Estimate::exactly(1.0));
    let region = if sets == 1 {
        vec![Estimate::exactly(1.0)]
    } else {
        (0..sets).map(|set| share_of(&|place| place == set)).collect::<Result<_, _>>()?
    };
    let trajectories = first.iter().filter(|places| !places.is_empty()).count();
    Ok(Probabilities { inside, region, windows, trajectories, confidence })
}

/// Nested sets with their probabilities on recorded trajectories, and the settings that determine
/// the sets and the probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Regions {
    /// The widening ε of each set's bounds (rad/s).
    pub epsilon: Vec<f64>,
    /// The choice of actions, in words.
    pub actions: String,
    /// `paper` or `base` roll-outs.
    pub rollout: String,
    /// Steps ahead, T.
    pub steps: usize,
    /// The choice of windows, [`WindowChoice::word`].
    pub window_choice: String,
    /// Largest distance from the set (m) at which a recorded position counted as inside.
    pub tolerance_m: f64,
    /// Largest heading difference from the set (rad) at which a recorded heading counted as inside.
    pub tolerance_rad: f64,
    /// The probabilities with trajectories as independent observations. They hold for new tasks of
    /// the same people.
    pub probabilities: Probabilities,
    /// The probabilities with people as independent observations. They hold for new people, and
    /// their `trajectories` field counts people. `None` if the drivers are unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_people: Option<Probabilities>,
    /// Mean area of each set's tube over the windows (m²).
    pub mean_area_m2: Vec<f64>,
    /// Each mean area as a share of the worst-case area. The last set has the worst-case area,
    /// because it admits every turn rate.
    pub share_of_worst_case: Vec<f64>,
}

/// Runs Algorithm 1 at the start of every chosen window of `trajectories` and counts the windows
/// whose recorded future is inside each set.
///
/// # Errors
/// [`Invalid`] if the last ε does not admit every turn rate, there is no window, `confidence`
/// is not in (0, 1), or the prediction fails.
pub fn regions(
    trajectories: &[Trajectory],
    choice: WindowChoice,
    prediction: Prediction<'_, impl ActionModel + Sync>,
    settings: &BoundsSettings,
    confidence: f64,
) -> Result<Regions, Invalid> {
    let count = counted(trajectories, choice, prediction, settings)?;
    count.regions(choice, prediction.tolerance, settings, confidence)
}

/// Like [`regions`], but also sets [`Regions::by_people`]. `person[i]` is the index, from 0, of the
/// person who drove trajectory i.
///
/// # Errors
/// The errors of [`regions`].
///
/// # Panics
/// If `person` is shorter than `trajectories`.
pub fn regions_of_people(
    trajectories: &[Trajectory],
    person: &[usize],
    choice: WindowChoice,
    prediction: Prediction<'_, impl ActionModel + Sync>,
    settings: &BoundsSettings,
    confidence: f64,
) -> Result<Regions, Invalid> {
    let count = counted(trajectories, choice, prediction, settings)?;
    let by_trajectory = count.regions(choice, prediction.tolerance, settings, confidence)?;
    let mut by_people = Count::new(person.iter().max().map_or(0, |last| last + 1));
    for (trajectory, windows) in count.0.into_iter().enumerate() {
        by_people.0[person[trajectory]].extend(windows);
    }
    let by_people = by_people.regions(choice, prediction.tolerance, settings, confidence)?;
    Ok(Regions { by_people: Some(by_people.probabilities), ..by_trajectory })
}

fn counted(
    trajectories: &[Trajectory],
    choice: WindowChoice,
    prediction: Prediction<'_, impl ActionModel + Sync>,
    settings: &BoundsSettings,
) -> Result<Count, Invalid> {
    admits_everything(&prediction, settings)?;
    let windows = choice.windows(trajectories, settings.steps());
    Ok(Count(parallel_map(&windows, |windows| judge(windows, &prediction, settings))?))
}

/// Checks that the last set contains every trajectory.
///
/// # Errors
/// [`Invalid`] that names the last ε.
pub fn admits_everything(
    prediction: &Prediction<'_, impl ActionModel>,
    settings: &BoundsSettings,
) -> Result<(), Invalid> {
    let last = settings.epsilon().len() - 1;
    let (full, epsilon) = (prediction.full_range(), settings.epsilon()[last]);
    if epsilon >= full {
        return Ok(());
    }
    let expected = format!("at least {full} rad/s, so that the last set contains everything");
    Err(Invalid::new(format!("epsilon[{last}]"), expected, epsilon))
}

/// An incremental version of [`regions`], for programs that show progress. It stores the results
/// for each window of each trajectory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Count(Vec<Vec<Judged>>);

impl Count {
    /// An empty count for this many trajectories.
    #[must_use]
    pub fn new(trajectories: usize) -> Self {
        Self(vec![Vec::new(); trajectories])
    }

    /// Sets the results for the windows of trajectory `place`, and replaces any earlier results.
    ///
    /// # Panics
    /// If `place` is out of range.
    pub fn put(&mut self, place: usize, judged: Vec<Judged>) {
        self.0[place] = judged;
    }

    /// The regions from all results so far. They are bit-identical whatever the order of the `put` calls.
    ///
    /// # Errors
    /// [`Invalid`] if nothing was counted, or `confidence` is not in (0, 1).
    pub fn regions(
        &self,
        choice: WindowChoice,
        tolerance: Tolerance,
        settings: &BoundsSettings,
        confidence: f64,
    ) -> Result<Regions, Invalid> {
        let first = |windows: &Vec<Judged>| windows.iter().map(|window| window.first).collect();
        let first: Vec<Vec<usize>> = self.0.iter().map(first).collect();
        let sets = settings.epsilon().len();
        let probabilities = probabilities(&first, sets, confidence)?;
        let mut mean_area_m2 = vec![0.0; sets];
        for window in self.0.iter().flatten() {
            for (mean, area) in mean_area_m2.iter_mut().zip(&window.area_m2) {
                *mean += area / probabilities.windows as f64;
            }
        }
        let worst_case_m2 = mean_area_m2[sets - 1];
        Ok(Regions {
            share_of_worst_case: mean_area_m2.iter().map(|area| area / worst_case_m2).collect(),
            epsilon: settings.epsilon().to_vec(),
            actions: settings.choice().to_string(),
            rollout: settings.rollout().word().to_owned(),
            steps: settings.steps(),
            window_choice: choice.word().to_owned(),
            tolerance_m: tolerance.position_m,
            tolerance_rad: tolerance.heading_rad,
            probabilities,
            by_people: None,
            mean_area_m2,
        })
    }
}

/// The result for one window.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// The index, from 0, of the smallest set that contains the window's trajectory.
    pub(super) first: usize,
    /// Area of each set's tube (m²).
    pub(super) area_m2: Vec<f64>,
}

/// Runs Algorithm 1 at the start of each window. For windows that are evaluated repeatedly,
/// [`Memory`](super::cache::Memory) gives the same results from a cache.
///
/// # Errors
/// [`Invalid`] if the prediction fails.
pub fn judge(
    windows: &[Window<'_>],
    prediction: &Prediction<'_, impl ActionModel>,
    settings: &BoundsSettings,
) -> Result<Vec<Judged>, Invalid> {
    let judge = |window: &Window<'_>| {
        let sets = prediction.bounds(window.history(), settings)?.sets;
        let area = |bounds| tube_area_m2(bounds, prediction.parameters);
        let area_m2 = sets.iter().map(area).collect::<Result<_, _>>()?;
        let first = first_inside(sets.len(), |j| holds(&sets[j], window, prediction))?;
        Ok(Judged { first, area_m2 })
    };
    windows.iter().map(judge).collect()
}

/// The index of the smallest of `sets` nested sets that contains a trajectory. `holds(j)` tests set
/// j. The last set contains every trajectory and is not tested.
pub(super) fn first_inside(
    sets: usize,
    mut holds: impl FnMut(usize) -> Result<bool, Invalid>,
) -> Result<usize, Invalid> {
    for j in 0..sets - 1 {
        if holds(j)? {
            return Ok(j);
        }
    }
    Ok(sets - 1)
}

/// Whether a window's trajectory is inside the reachable set under `bounds` at every step.
///
/// # Errors
/// [`Invalid`] if the window and `bounds` differ in their number of steps, or a parameter is
/// invalid.
pub(super) fn holds(
    bounds: &InputBounds,
    window: &Window<'_>,
    prediction: &Prediction<'_, impl ActionModel>,
) -> Result<bool, Invalid> {
    same_steps(window, bounds.steps())?;
    let parameters = prediction.parameters;
    let set = ReachableSet::new(
        window.now().human,
        bounds,
        parameters.human.speed_mps,
        parameters.step_s,
    )?;
    let states: Vec<Pose> = window.future().iter().map(|state| state.human).collect();
    Ok(set.contains_trajectory(&states, Some(window.turn_rates()), prediction.tolerance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::ActionChoice;
    use crate::bounds::Rollout;
    use crate::math::SeededRng;
    use crate::scene::SceneParameters;
    use crate::shfrs::testing::{Always, drive};
    use crate::stats::clopper_pearson;

    /// Simulates studies of 8 people with 50 tasks each. For four fifths of the people, a task
    /// stays inside with probability 0.97. For the other people, the probability is 0.3. So for new
    /// people, the probability is 0.8 · 0.97 + 0.2 · 0.3 = 0.836. The interval with people as
    /// observations covers this probability as often as stated. The interval with tasks as
    /// observations, as if the tasks were from 400 people, misses it more often than not.
    #[test]
    fn intervals_for_new_people_need_people_as_observations() {
        let mut rng = SeededRng::new(12);
        let (people, tasks, studies, confidence) = (8, 50, 2000_u32, 0.95);
        let truth = 0.8 * 0.97 + 0.2 * 0.3;
        let mut holds = [0_u32; 2];
        for _ in 0..studies {
            let mut by_person = Vec::new();
            let mut by_task = Vec::new();
            for _ in 0..people {
                let p = if rng.unit() < 0.2 { 0.3 } else { 0.97 };
                let hits: Vec<usize> = (0..tasks).map(|_| usize::from(rng.unit() < p)).collect();
                by_person.push(Tally { hits: hits.iter().sum(), of: tasks });
                by_task.extend(hits.into_iter().map(|hits| Tally { hits, of: 1 }));
            }
            for (holds, tallies) in holds.iter_mut().zip([by_person, by_task]) {
                let found = share(&tallies, confidence).unwrap();
                *holds += u32::from((found.low..=found.high).contains(&truth));
            }
        }
        let share = holds.map(|holds| f64::from(holds) / f64::from(studies));
        let error = (confidence * (1.0 - confidence) / f64::from(studies)).sqrt();
        assert!(share[0] >= confidence - 3.0 * error, "{share:?}");
        assert!(share[1] < 0.5, "tasks as people: {share:?}");
    }

    #[test]
    fn regions_are_differences_and_sum_to_one() {
        let mut rng = SeededRng::new(1);
        for _ in 0..200 {
            let sets = 1 + rng.below(7);
            let first: Vec<Vec<usize>> = (0..1 + rng.below(60))
                .map(|i| {
                    (0..usize::from(i == 0) + rng.below(40)).map(|_| rng.below(sets)).collect()
                })
                .collect();
            let found = probabilities(&first, sets, 0.95).unwrap();
            let sum: f64 = found.region.iter().map(|p| p.value).sum();
            assert!((sum - 1.0).abs() <= 1e-12);
            assert_eq!(found.inside[sets - 1], Estimate::exactly(1.0));
            let mut below = 0.0;
            for (inside, region) in found.inside.iter().zip(&found.region) {
                assert!((inside.value - below - region.value).abs() <= 1e-12);
                assert!(inside.low <= inside.value && inside.value <= inside.high);
                below = inside.value;
            }
        }
    }

    #[test]
    fn single_windows_have_the_exact_interval() {
        let first: Vec<Vec<usize>> = (0..20).map(|i| vec![usize::from(i >= 15)]).collect();
        let found = probabilities(&first, 2, 0.95).unwrap();
        assert_eq!((found.windows, found.trajectories), (20, 20));
        let p = found.inside[0];
        assert_eq!((p.value, (p.low, p.high)), (0.75, clopper_pearson(15.0, 20.0, 0.95)));
    }

    #[test]
    fn windows_fall_into_the_region_of_their_drive() {
        let drives =
            [drive(&[0.5; 3]), drive(&[0.5, 0.5, 0.0]), drive(&[-0.5; 3]), drive(&[0.5; 3])];
        let parameters = SceneParameters::default();
        let model = Always([0.1, 0.2, 0.7]);
        let prediction = Prediction::new(&parameters, &model);
        let choice = ActionChoice::TopK(vec![1; 3]);
        let settings = prediction.settings(vec![0.0, 0.5, 1.0], &choice, Rollout::Paper).unwrap();
        let of = |windows| regions(&drives, windows, prediction, &settings, 0.9).unwrap();
        let found = of(WindowChoice::AvoidanceOnset);
        let values: Vec<f64> = found.probabilities.region.iter().map(|p| p.value).collect();
        assert_eq!(values, [0.5, 0.25, 0.25]);
        assert_eq!((found.rollout.as_str(), found.actions.as_str()), ("paper", "k = 1 1 1"));
        assert_eq!((found.steps, found.window_choice.as_str()), (3, "avoidance_onset"));
        assert!(found.mean_area_m2.is_sorted() && found.mean_area_m2[0].abs() < 1e-6);
        assert!((found.mean_area_m2[2] - 4.0 / 6.0 * 0.6 * 0.6 * 0.6).abs() < 1e-9);
        // Two people with two drives each give the same shares and wider intervals.
        let onset = WindowChoice::AvoidanceOnset;
        let both =
            regions_of_people(&drives, &[0, 1, 1, 0], onset, prediction, &settings, 0.9).unwrap();
        assert_eq!(Regions { by_people: None, ..both.clone() }, found);
        let by_people = both.by_people.unwrap();
        assert_eq!((by_people.windows, by_people.trajectories), (4, 2));
        for (person, drive) in by_people.inside.iter().zip(&found.probabilities.inside) {
            assert!(
                person.value == drive.value && person.low <= drive.low && person.high >= drive.high
            );
        }
        assert!(by_people.inside[0].low < found.probabilities.inside[0].low);
        assert_eq!(found.share_of_worst_case[2], 1.0);
        // The area of the last set is the worst-case area to which other results refer.
        let worst = crate::shfrs::baselines::worst_case_area_m2(&parameters, 3).unwrap();
        assert!((found.mean_area_m2[2] - worst).abs() < 1e-12);
        let settings = prediction
            .settings(vec![0.0, 1.0], &ActionChoice::TopK(vec![1; 2]), Rollout::Base)
            .unwrap();
        let many = regions(&drives, WindowChoice::EveryStep, prediction, &settings, 0.9).unwrap();
        assert_eq!((many.probabilities.windows, many.probabilities.trajectories), (8, 4));
        assert_eq!(many.probabilities.inside[0].value, 5.0 / 8.0);
    }

    /// A count filled trajectory by trajectory, in any order, is bit-identical to [`regions`].
    #[test]
    fn a_count_ends_where_all_at_once_ends() {
        let mut rng = SeededRng::new(9);
        let mut rates = || (0..12).map(|_| [-0.5, 0.0, 0.0, 0.5][rng.below(4)]).collect::<Vec<_>>();
        let drives: Vec<Trajectory> = (0..9).map(|_| drive(&rates())).collect();
        let (parameters, model) = (SceneParameters::default(), Always([0.1, 0.5, 0.4]));
        let prediction = Prediction::new(&parameters, &model);
        let choice = ActionChoice::TopK(vec![2, 1, 1, 1]);
        let settings = prediction.settings(vec![0.0, 0.3, 1.0], &choice, Rollout::Base).unwrap();
        let every = WindowChoice::EveryStep;
        let windows = every.windows(&drives, 4);
        let mut count = Count::new(drives.len());
        let so_far = |count: &Count| count.regions(every, prediction.tolerance, &settings, 0.95);
        assert_eq!(so_far(&count).unwrap_err().field, "windows");
        for (counted, place) in [4, 8, 0, 1, 7, 2, 3, 6, 5].into_iter().enumerate() {
            count.put(place, judge(&windows[place], &prediction, &settings).unwrap());
            let trajectories = so_far(&count).unwrap().probabilities.trajectories;
            assert_eq!(trajectories, counted + 1);
        }
        let at_once = regions(&drives, every, prediction, &settings, 0.95).unwrap();
        assert_eq!(so_far(&count).unwrap(), at_once);
    }

    #[test]
    fn complaints_name_the_field() {
        let field = |first: &[Vec<usize>], sets, confidence| {
            probabilities(first, sets, confidence).unwrap_err().field
        };
        assert_eq!(field(&[vec![0]], 2, f64::NAN), "confidence");
        assert_eq!(field(&[vec![0]], 0, 0.9), "sets");
        assert_eq!(field(&[vec![]], 2, 0.9), "windows");
        assert_eq!(field(&[vec![0], vec![1, 2]], 2, 0.9), "first[1][1]");
        let (parameters, model) = (SceneParameters::default(), Always([0.1, 0.2, 0.7]));
        let prediction = Prediction::new(&parameters, &model);
        let choice = ActionChoice::TopK(vec![1]);
        let narrow = prediction.settings(vec![0.0, 0.9], &choice, Rollout::Base).unwrap();
        let every = WindowChoice::EveryStep;
        let complaint = regions(&[drive(&[0.0])], every, prediction, &narrow, 0.9).unwrap_err();
        assert_eq!(complaint.field, "epsilon[1]");
        let wide = prediction.settings(vec![0.0, 1.0], &choice, Rollout::Base).unwrap();
        assert_eq!(regions(&[], every, prediction, &wide, 0.9).unwrap_err().field, "windows");
    }
}
