//! Runs a comparison: plans the fits ([`Plan`]), executes them on all threads and assembles the
//! results.

use super::cell::{Baseline, Cell, Experiment};
use super::fit::fit;
use super::importance::{Importance, importance};
use super::models::ModelName;
use super::plan::{DataError, Fit, ParticipantData, Plan, Purpose, key, order, somebody_left};
use super::rollout::{Horizon, Simple, rollouts, together};
use super::settings::Settings;
use super::tables::{Comparison, mean};
use crate::bounds::Motion;
use crate::invalid::Invalid;
use crate::parallel::parallel_map;
use crate::predict::Predictor;
use crate::recording::Exclusion;
use crate::safety::SafetyLevels;
use crate::scene::SceneParameters;
use crate::shfrs::PredictedHuman;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use serde::Serialize;

/// All results of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Results {
    /// A cell for each model, experiment, feature set and participant.
    pub comparison: Comparison,
    /// An entry for each participant and experiment.
    pub baselines: Vec<Baseline>,
    /// Roll-outs of every model, and of simple drivers.
    pub rollouts: Vec<RolloutsOf>,
    /// Leakage on the first feature set. Empty unless it is requested.
    pub leakage: Vec<Leakage>,
    /// Cells of models trained on the first tasks only.
    pub few_tasks: Vec<FewTasks>,
    /// Cells of models trained on other people.
    pub unseen: Vec<Cell>,
    /// Loss of accuracy when each feature is permuted.
    pub importance: Vec<Importance>,
    /// The excluded participants.
    pub exclusions: Vec<Exclusion>,
}

/// The roll-outs of one driver.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RolloutsOf {
    /// The driver's name: [`ModelName::word`] or [`Simple::word`].
    pub driver: String,
    /// The name of the driver's feature set; empty for a simple driver.
    pub features: String,
    /// The results for each number of steps ahead, over all participants' test tasks.
    pub horizons: Vec<Horizon>,
}

/// A cell of a model trained on the first tasks only.
#[derive(Clone, Debug, PartialEq)]
pub struct FewTasks {
    /// The number of first tasks on which the model was trained.
    pub tasks: usize,
    /// The cell, with the same test tasks as in the comparison.
    pub cell: Cell,
}

/// The inflated accuracy of a split by time step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leakage {
    /// The model.
    pub model: ModelName,
    /// The experiment.
    pub experiment: Experiment,
    /// Mean over participants of the test accuracy when whole trials are held out (per cent).
    pub grouped: f64,
    /// Mean over participants of the test accuracy when single steps are held out (per cent).
    pub leaking: f64,
}

/// Progress of the fits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of finished fits.
    pub done: usize,
    /// Total number of fits. Some fits take much longer than others.
    pub of: usize,
}

/// A cache of cells. The key covers everything that the cells depend on.
pub trait Cache: Sync {
    /// Returns the cells under this key, if they are stored.
    fn get(&self, key: &str) -> Option<Vec<Cell>>;

    /// Stores cells, if possible.
    fn put(&self, key: &str, cells: &[Cell]);
}

/// The reason why an analysis failed.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum AnalysisError {
    /// The error of the first participant, if all participants' data are unusable.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Something else is wrong with the data or the settings.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// `progress` cancelled the analysis.
    #[error("stopped")]
    Stopped,
}

/// Runs the comparison. Participants are sorted by name (numbers by value), so the results do not
/// depend on their order.
///
/// # Errors
/// [`AnalysisError`] if no participant is left, or if `progress` cancels.
pub fn run(
    participants: &[ParticipantData],
    scene: &SceneParameters,
    safety: &SafetyLevels,
    settings: &Settings,
    cache: Option<&dyn Cache>,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Results, AnalysisError> {
    let plan = Plan::new(participants, settings);
    somebody_left(plan.participants.len(), &plan.exclusions)?;
    let found = execute(&plan, settings, cache, progress)?;
    Ok(assemble(&plan, found, scene, safety, settings)?)
}

/// The cells of a fit, or the reason why it failed.
type Fitted = Result<Vec<Cell>, Invalid>;

/// Executes every fit of the plan. The results are in the order of the fits.
fn execute(
    plan: &Plan<'_>,
    settings: &Settings,
    cache: Option<&dyn Cache>,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Vec<Fitted>, AnalysisError> {
    let done = AtomicUsize::new(0);
    let stopped = AtomicBool::new(false);
    parallel_map(&plan.fits, |fit| {
        // Without this check, all fits that still wait for a thread would run before the analysis
        // stops.
        if stopped.load(Ordering::Relaxed) {
            return Err(AnalysisError::Stopped);
        }
        let cells = fitted(plan, fit, settings, cache);
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        match progress(Progress { done, of: plan.fits.len() }) {
            ControlFlow::Continue(()) => Ok(cells),
            ControlFlow::Break(()) => {
                stopped.store(true, Ordering::Relaxed);
                Err(AnalysisError::Stopped)
            }
        }
    })
}

/// The cells of one fit. They are taken from the cache if it contains them.
fn fitted(
    plan: &Plan<'_>,
    planned: &Fit<'_>,
    settings: &Settings,
    cache: Option<&dyn Cache>,
) -> Fitted {
    let Fit { participant, set, model, .. } = *planned;
    let (data, split) = plan.rows(planned);
    let data = data.select(&set.features)?;
    let key = key(model, &data, &split, &settings.grids);
    if let Some(mut cells) = cache.and_then(|cache| cache.get(&key)) {
        // The key does not cover the participant's index and the set's name, so set them here.
        for cell in &mut cells {
            cell.participant = participant;
            cell.features.clone_from(&set.name);
        }
        return Ok(cells);
    }
    let cells = fit(model, &data, &split, &settings.grids, &set.name, participant)?;
    if let Some(cache) = cache {
        cache.put(&key, &cells);
    }
    Ok(cells)
}

/// Assembles the results. If any fit of a participant failed, this participant is excluded from all
/// results, so that all means are over the same participants.
fn assemble(
    plan: &Plan<'_>,
    found: Vec<Fitted>,
    scene: &SceneParameters,
    safety: &SafetyLevels,
    settings: &Settings,
) -> Result<Results, Invalid> {
    let failed = failures(plan, &found);
    let mut exclusions = plan.exclusions.clone();
    let mut kept = Vec::new();
    // The index of each planned participant in the results; `None` if the participant is excluded.
    let mut places = Vec::new();
    for (planned, failed) in plan.participants.iter().zip(failed) {
        places.push(failed.is_none().then_some(kept.len()));
        match failed {
            None => kept.push(planned),
            Some(reason) => exclusions.push(planned.data.excluded(reason)),
        }
    }
    exclusions.sort_by(|a, b| order(&a.participant).cmp(&order(&b.participant)));
    somebody_left(kept.len(), &exclusions)?;
    let (mut cells, mut beyond, mut leaking) = (Vec::new(), Vec::new(), Vec::new());
    let (mut few, mut unseen) = (Vec::new(), Vec::new());
    for (fit, found) in plan.fits.iter().zip(found) {
        if fit.purpose == Purpose::Unseen {
            unseen.extend(
                found.into_iter().flatten().flat_map(|cell| by_person(plan, &cell, &places)),
            );
            continue;
        }
        let (Ok(found), Some(participant)) = (found, places[fit.participant]) else { continue };
        let found = found.into_iter().map(|cell| Cell { participant, ..cell });
        match fit.purpose {
            Purpose::Tables => cells.extend(found),
            Purpose::Rollouts => beyond.extend(found),
            Purpose::Leakage => leaking.extend(found),
            Purpose::Learning(tasks) => few.extend(found.map(|cell| FewTasks { tasks, cell })),
            Purpose::Unseen => {}
        }
    }
    with_choice(&mut cells, settings);
    let participants = kept.iter().map(|planned| planned.data.compared()).collect();
    let comparison = Comparison { participants, cells };
    let baselines = kept.iter().enumerate().flat_map(|(i, planned)| {
        let (data, split) = (&planned.data.data, &planned.split);
        Experiment::ALL.map(|experiment| Baseline::of(data, split, experiment, i))
    });
    let people: Vec<&ParticipantData> = kept.iter().map(|planned| planned.data).collect();
    Ok(Results {
        leakage: leakage(&comparison, leaking, settings),
        baselines: baselines.collect(),
        rollouts: all_rollouts(&people, &comparison, &beyond, scene, safety, settings)?,
        importance: match settings.paper_only {
            true => Vec::new(),
            false => importance(&people, &comparison)?,
        },
        few_tasks: few,
        unseen,
        exclusions,
        comparison,
    })
}

/// Splits the cell of a group into one cell per person. The cell's model was trained on other
/// people. The test rows of the cell are ordered by person.
fn by_person(plan: &Plan<'_>, cell: &Cell, places: &[Option<usize>]) -> Vec<Cell> {
    let groups = plan.everybody.as_ref().map_or(1, |everybody| everybody.groups().max(1));
    let mut begin = 0;
    let mut cells = Vec::new();
    for (i, planned) in plan.participants.iter().enumerate().skip(cell.participant).step_by(groups)
    {
        let rows = begin..begin + planned.split.test.len();
        begin = rows.end;
        if let Some(participant) = places[i] {
            cells.push(Cell { participant, test: cell.test.part(rows), ..cell.clone() });
        }
    }
    cells
}

/// For each participant, the first model that failed, with its error. `None` if no model failed.
fn failures(plan: &Plan<'_>, found: &[Fitted]) -> Vec<Option<String>> {
    let mut failed = vec![None; plan.participants.len()];
    let own = |(fit, _): &(&Fit<'_>, &Fitted)| fit.purpose != Purpose::Unseen;
    for (fit, found) in plan.fits.iter().zip(found).filter(own) {
        if let Err(error) = found {
            let (model, set) = (fit.model.word(), &fit.set.name);
            failed[fit.participant].get_or_insert_with(|| format!("{model} on {set}: {error}"));
        }
    }
    failed
}

/// For each pair of a radial and a linear SVM, adds the better one as [`ModelName::Svm`]. Then
/// sorts the cells.
fn with_choice(cells: &mut Vec<Cell>, settings: &Settings) {
    let place = |cell: &Cell| {
        let set = settings.sets.iter().position(|set| set.name == cell.features);
        (cell.experiment, set, cell.participant)
    };
    let mut chosen = Vec::new();
    for rbf in cells.iter().filter(|cell| cell.model == ModelName::SvmRbf) {
        let linear = cells
            .iter()
            .find(|cell| cell.model == ModelName::SvmLinear && place(cell) == place(rbf));
        let better = linear.filter(|linear| linear.cv_accuracy > rbf.cv_accuracy).unwrap_or(rbf);
        chosen.push(Cell { model: ModelName::Svm, ..better.clone() });
    }
    cells.extend(chosen);
    cells.sort_by_key(|cell| (cell.model, place(cell)));
}

/// For each model and experiment, the accuracy if single steps are held out, and the accuracy if
/// whole trials are held out.
fn leakage(comparison: &Comparison, mut leaking: Vec<Cell>, settings: &Settings) -> Vec<Leakage> {
    if leaking.is_empty() {
        return Vec::new();
    }
    with_choice(&mut leaking, settings);
    let leaking = Comparison { participants: comparison.participants.clone(), cells: leaking };
    let set = &settings.sets[0].name;
    let accuracy = |of: &Comparison, model, experiment| {
        mean(of.of(model, experiment, set).map(|cell| 100.0 * cell.test.accuracy()))
    };
    let both = |(model, experiment)| Leakage {
        model,
        experiment,
        grouped: accuracy(comparison, model, experiment),
        leaking: accuracy(&leaking, model, experiment),
    };
    let models = ModelName::PAPERS.into_iter();
    models.flat_map(|model| Experiment::ALL.map(|experiment| both((model, experiment)))).collect()
}

/// The feature sets for roll-outs of the paper's models.
const ROLLED_OUT: [&str; 4] = ["hrd", "d", "hrd_body", "d_body"];

/// Roll-outs of the paper's models in experiment I on the [`ROLLED_OUT`] sets, of the models beyond
/// the paper, and of simple drivers.
fn all_rollouts(
    people: &[&ParticipantData],
    comparison: &Comparison,
    beyond: &[Cell],
    scene: &SceneParameters,
    safety: &SafetyLevels,
    settings: &Settings,
) -> Result<Vec<RolloutsOf>, Invalid> {
    let motion = Motion::from(scene);
    let test = |i: usize| people[i].test_trajectories();
    let horizon = settings.horizon.min(scene.steps);
    let mut learned: Vec<Vec<&Cell>> = Vec::new();
    for model in ModelName::PAPERS {
        for set in ROLLED_OUT {
            learned.push(comparison.of(model, Experiment::TurnDirection, set).collect());
        }
    }
    for (set, model) in settings.beyond() {
        let own = |cell: &&Cell| {
            (cell.model, cell.experiment) == (model, Experiment::TurnDirection)
                && cell.features == set.name
        };
        learned.push(beyond.iter().filter(own).collect());
    }
    learned.retain(|cells| !cells.is_empty());
    let mut all = parallel_map(&learned, |cells| {
        let of_person = |cell: &&Cell| {
            let predictor = Predictor::try_from(cell.predictor.clone())?;
            let human = PredictedHuman::new(&predictor, safety, scene)?;
            rollouts(&human, test(cell.participant), &motion, horizon)
        };
        let parts: Vec<Vec<Horizon>> =
            cells.iter().map(of_person).collect::<Result<_, Invalid>>()?;
        let (driver, features) = (cells[0].model.word().to_owned(), cells[0].features.clone());
        Ok::<_, Invalid>(RolloutsOf { driver, features, horizons: together(&parts) })
    })?;
    for simple in [Simple::Held, Simple::Straight] {
        let parts = (0..people.len())
            .map(|i| rollouts(&simple, test(i), &motion, horizon))
            .collect::<Result<Vec<_>, Invalid>>()?;
        let (driver, features) = (simple.word().to_owned(), String::new());
        all.push(RolloutsOf { driver, features, horizons: together(&parts) });
    }
    Ok(all)
}
