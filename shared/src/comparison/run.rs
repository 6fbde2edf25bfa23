//! The whole comparison.

use super::baseline::Baseline;
use super::cell::{BODY_FRAME_SETS, Cell, Experiment, ModelName, NamedSet};
use super::fit::{Family, Grids, fit};
use super::rollout::{Horizon, Simple, rollouts, together};
use super::split::{LEAST_TASKS, Split};
use super::tables::{Comparison, Participant, mean};
use crate::bounds::Motion;
use crate::dataset::Dataset;
use crate::invalid::Invalid;
use crate::parallel_map::parallel_map;
use crate::predict::Predictor;
use crate::safety::SafetyLevels;
use crate::scene::SceneParameters;
use crate::shfrs::PredictedHuman;
use crate::shfrs::window::Trajectory;
use crate::vehicle::TurnInput;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// One person's tasks, in the order of their numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    /// As the data call them.
    pub name: String,
    /// The number of each task.
    pub numbers: Vec<u64>,
    /// The rows of the tasks, with every feature that is compared.
    pub data: Dataset,
    /// The tasks as they were driven.
    pub trajectories: Vec<Trajectory>,
}

/// What is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Feature sets: the paper's seven among them.
    pub sets: Vec<NamedSet>,
    /// Hyper-parameters to try.
    pub grids: Grids,
    /// Whether a split by time step is tried too, to show what leaks.
    pub leakage: bool,
    /// Steps of roll-outs, at least 1.
    pub horizon: usize,
    /// The set of models with a memory.
    pub history: NamedSet,
}

/// The sets on which the paper's models are rolled out.
const ROLLED_OUT: [&str; 4] = ["hrd", "d", "hrd_body", "d_body"];

impl Settings {
    /// The paper's sets, two of them with the body frame, the protocol's grids, T = 10.
    ///
    /// # Errors
    /// Never: the names are those of the table.
    pub fn new() -> Result<Self, Invalid> {
        let mut sets = NamedSet::papers()?;
        sets.extend(NamedSet::with_body_frame()?);
        let history = NamedSet::with_history()?;
        Ok(Self { sets, grids: Grids::default(), leakage: false, horizon: 10, history })
    }

    /// Models beyond the paper: with a memory, or boosted, or both.
    fn beyond(&self) -> impl Iterator<Item = (&NamedSet, Family)> {
        let body = self.sets.iter().find(|set| set.name == BODY_FRAME_SETS[0].0);
        let with_memory = [Family::Logistic, Family::Boosted].map(|family| (&self.history, family));
        body.map(|set| (set, Family::Boosted)).into_iter().chain(with_memory)
    }
}

/// Somebody whose data cannot be learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exclusion {
    /// As the data call them.
    pub participant: String,
    /// Why.
    pub reason: String,
}

/// Who drives in roll-outs, and how that went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RolloutsOf {
    /// A model's word or a simple driver's.
    pub driver: String,
    /// The name of its feature set; empty for a simple driver.
    pub features: String,
    /// By number of steps ahead, over all people's test tasks.
    pub horizons: Vec<Horizon>,
}

/// What a split by time step claims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leakage {
    /// What predicts.
    pub model: ModelName,
    /// What is predicted.
    pub experiment: Experiment,
    /// Mean over people of the test accuracy when whole trials are held back, in per cent.
    pub grouped: f64,
    /// When single steps are held back.
    pub leaking: f64,
}

/// All that is found.
#[derive(Clone, Debug, PartialEq)]
pub struct Results {
    /// A cell for each model, experiment, feature set and person.
    pub comparison: Comparison,
    /// An entry for each experiment and person.
    pub baselines: Vec<Baseline>,
    /// Of every model on every feature set, and of simple drivers.
    pub rollouts: Vec<RolloutsOf>,
    /// On the first feature set; empty unless it was asked for.
    pub leakage: Vec<Leakage>,
    /// Who was left out.
    pub exclusions: Vec<Exclusion>,
}

impl Exclusion {
    fn new(person: &Person, reason: String) -> Self {
        Self { participant: person.name.clone(), reason }
    }
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Pieces of work that are done.
    pub done: usize,
    /// All of them. They take about equally long.
    pub of: usize,
}

/// Where results are kept by what they were computed from.
pub trait Cache: Sync {
    /// What was kept under this key.
    fn get(&self, key: &str) -> Option<Vec<Cell>>;

    /// Keeps it, if that is possible.
    fn put(&self, key: &str, cells: &[Cell]);
}

/// Why there are no results.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum RunError {
    /// Something in the data or settings.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// It was broken off.
    #[error("stopped")]
    Stopped,
}

/// Results depend on what this names too: to be changed with anything that changes them.
const METHOD: &str = "sidestep-comparison/3";

/// Compares. People are taken in the order of their names (numbers by size), and the same
/// results come out whatever the order they are given in.
///
/// # Errors
/// [`RunError`] if nobody is left to compare, or `progress` breaks it off.
pub fn run(
    people: &[Person],
    scene: &SceneParameters,
    safety: &SafetyLevels,
    settings: &Settings,
    cache: Option<&dyn Cache>,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Results, RunError> {
    let (people, mut exclusions) = included(people);
    let people = somebody(people, &exclusions)?;
    let mut units = Vec::new();
    for (participant, person) in people.iter().enumerate() {
        let mut add = |role, set, family| {
            let split = match role {
                Role::Leaking => Split::leaking(&person.data),
                _ => Split::grouped(&person.data),
            };
            units.push(Unit { participant, person, set, family, split, role });
        };
        for set in &settings.sets {
            Family::PAPERS.into_iter().for_each(|family| add(Role::Compared, set, family));
        }
        for (set, family) in settings.beyond() {
            add(Role::Beyond, set, family);
        }
        for family in Family::PAPERS.into_iter().filter(|_| settings.leakage) {
            add(Role::Leaking, &settings.sets[0], family);
        }
    }
    let done = AtomicUsize::new(0);
    let stopped = AtomicBool::new(false);
    let work = |unit: &Unit<'_>| -> Result<Result<Vec<Cell>, Invalid>, RunError> {
        // What waits for a thread would else be computed first.
        if stopped.load(Ordering::Relaxed) {
            return Err(RunError::Stopped);
        }
        let cells = unit.cells(&settings.grids, cache);
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        match progress(Progress { done, of: units.len() }) {
            ControlFlow::Continue(()) => Ok(cells),
            ControlFlow::Break(()) => {
                stopped.store(true, Ordering::Relaxed);
                Err(RunError::Stopped)
            }
        }
    };
    let found = parallel_map(&units, work)?;
    let failed = failures(&units, &found, people.len());
    let mut kept = Vec::new();
    for (person, failed) in people.iter().zip(&failed) {
        match failed {
            None => kept.push(*person),
            Some(reason) => exclusions.push(Exclusion::new(person, reason.clone())),
        }
    }
    exclusions.sort_by(|a, b| order(&a.participant).cmp(&order(&b.participant)));
    let people = somebody(kept, &exclusions)?;
    let (mut cells, mut beyond, mut leaking) = (Vec::new(), Vec::new(), Vec::new());
    for (unit, found) in units.iter().zip(found) {
        let (Ok(mut found), None) = (found, &failed[unit.participant]) else { continue };
        let before = failed[..unit.participant].iter().flatten().count();
        found.iter_mut().for_each(|cell| cell.participant -= before);
        match unit.role {
            Role::Compared => cells.extend(found),
            Role::Beyond => beyond.extend(found),
            Role::Leaking => leaking.extend(found),
        }
    }
    with_choice(&mut cells, settings);
    let comparison =
        Comparison { participants: people.iter().map(|p| participant(p)).collect(), cells };
    let leakage = compared(&comparison, leaking, settings);
    let baselines = people.iter().enumerate().flat_map(|(i, person)| {
        let split = Split::grouped(&person.data);
        Experiment::ALL.map(|experiment| Baseline::of(&person.data, &split, experiment, i))
    });
    let baselines = baselines.collect();
    let rollouts = all_rollouts(&people, &comparison, &beyond, scene, safety, settings)?;
    Ok(Results { comparison, baselines, rollouts, leakage, exclusions })
}

fn participant(person: &Person) -> Participant {
    let tasks = person.trajectories.len();
    Participant {
        name: person.name.clone(),
        test_trials: person.numbers[super::split::first_test_task(tasks)..].to_vec(),
        steps: person.trajectories.first().map_or(0, Trajectory::steps),
    }
}

/// The place of a name: numbers by size, then other names.
fn order(name: &str) -> (bool, Option<u64>, &str) {
    let number = name.parse().ok();
    (number.is_none(), number, name)
}

/// People in order, and those who cannot be learned from.
fn included(people: &[Person]) -> (Vec<&Person>, Vec<Exclusion>) {
    let mut ordered: Vec<&Person> = people.iter().collect();
    ordered.sort_by(|a, b| order(&a.name).cmp(&order(&b.name)));
    let mut exclusions = Vec::new();
    ordered.retain(|person| {
        let reason = reason_against(person);
        let kept = reason.is_none();
        exclusions.extend(reason.map(|reason| Exclusion::new(person, reason)));
        kept
    });
    (ordered, exclusions)
}

/// These people.
///
/// # Errors
/// [`Invalid`] with everybody's reason if there are none.
fn somebody<'a>(
    people: Vec<&'a Person>,
    exclusions: &[Exclusion],
) -> Result<Vec<&'a Person>, Invalid> {
    if !people.is_empty() {
        return Ok(people);
    }
    let reasons: Vec<String> =
        exclusions.iter().map(|e| format!("{}: {}", e.participant, e.reason)).collect();
    let found = if reasons.is_empty() { "nobody".to_owned() } else { reasons.join("; ") };
    Err(Invalid::new("participants", "somebody whose data can be learned from", found))
}

/// Of each person the first model that could not be fitted, and why. Without it they are left
/// out whole, so that all means are over the same people.
fn failures(
    units: &[Unit<'_>],
    found: &[Result<Vec<Cell>, Invalid>],
    people: usize,
) -> Vec<Option<String>> {
    let mut failed = vec![None; people];
    for (unit, found) in units.iter().zip(found) {
        if let Err(error) = found {
            let (model, set) = (unit.family.model().word(), &unit.set.name);
            failed[unit.participant].get_or_insert_with(|| format!("{model} on {set}: {error}"));
        }
    }
    failed
}

fn reason_against(person: &Person) -> Option<String> {
    let tasks = person.trajectories.len();
    if tasks < LEAST_TASKS {
        return Some(format!("{tasks} tasks, at least {LEAST_TASKS} are needed"));
    }
    let split = Split::grouped(&person.data);
    let inputs = || split.training.iter().map(|&row| person.data.labels[row]);
    let first = inputs().next()?;
    if inputs().all(|input| input == first) {
        return Some(format!("one kind of input only in the training tasks ({})", first.word()));
    }
    let always = inputs().all(|input| input != TurnInput::Straight);
    always.then(|| "a turn in every step of the training tasks".to_owned())
}

/// One piece of work.
struct Unit<'a> {
    participant: usize,
    person: &'a Person,
    set: &'a NamedSet,
    family: Family,
    split: Split,
    role: Role,
}

/// What a piece of work is for.
#[derive(Clone, Copy)]
enum Role {
    /// The tables.
    Compared,
    /// Roll-outs only.
    Beyond,
    /// Showing what leaks.
    Leaking,
}

impl Unit<'_> {
    fn cells(&self, grids: &Grids, cache: Option<&dyn Cache>) -> Result<Vec<Cell>, Invalid> {
        let data = self.person.data.select(&self.set.features)?;
        let key = self.key(&data, grids);
        if let Some(mut cells) = cache.and_then(|cache| cache.get(&key)) {
            // Names and places are no part of what was computed.
            for cell in &mut cells {
                cell.participant = self.participant;
                cell.features.clone_from(&self.set.name);
            }
            return Ok(cells);
        }
        let cells = fit(self.family, &data, &self.split, grids, &self.set.name, self.participant)?;
        if let Some(cache) = cache {
            cache.put(&key, &cells);
        }
        Ok(cells)
    }

    /// All that the cells depend on.
    fn key(&self, data: &Dataset, grids: &Grids) -> String {
        let mut hash = Sha256::new();
        hash.update(METHOD);
        hash.update(self.family.grid(grids));
        for name in Vec::<String>::from(data.features.clone()) {
            hash.update(name);
            hash.update([0]);
        }
        data.values.iter().for_each(|value| hash.update(value.to_bits().to_le_bytes()));
        data.labels.iter().for_each(|label| hash.update(label.sign().to_le_bytes()));
        for rows in [&self.split.training, &self.split.folds, &self.split.test] {
            hash.update((rows.len() as u64).to_le_bytes());
            rows.iter().for_each(|&row| hash.update((row as u64).to_le_bytes()));
        }
        hex::encode(hash.finalize())
    }
}

/// Adds the better of both machines, and puts the cells in order.
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

fn compared(comparison: &Comparison, mut leaking: Vec<Cell>, settings: &Settings) -> Vec<Leakage> {
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

/// Of the models in experiment I on [`ROLLED_OUT`] sets, of those beyond the paper, and of simple
/// drivers.
fn all_rollouts(
    people: &[&Person],
    comparison: &Comparison,
    beyond: &[Cell],
    scene: &SceneParameters,
    safety: &SafetyLevels,
    settings: &Settings,
) -> Result<Vec<RolloutsOf>, Invalid> {
    let motion = Motion::from(scene);
    let test = |i: usize| {
        let all = &people[i].trajectories;
        &all[super::split::first_test_task(all.len())..]
    };
    let mut learned: Vec<Vec<&Cell>> = Vec::new();
    for model in ModelName::PAPERS {
        for set in ROLLED_OUT {
            learned.push(comparison.of(model, Experiment::TurnDirection, set).collect());
        }
    }
    for (set, family) in settings.beyond() {
        let own = |cell: &&Cell| {
            (cell.model, cell.experiment) == (family.model(), Experiment::TurnDirection)
                && cell.features == set.name
        };
        learned.push(beyond.iter().filter(own).collect());
    }
    learned.retain(|cells| !cells.is_empty());
    let mut all = parallel_map(&learned, |cells| {
        let of_person = |cell: &&Cell| {
            let predictor = Predictor::try_from(cell.predictor.clone())?;
            let human = PredictedHuman::new(&predictor, safety, scene)?;
            rollouts(&human, test(cell.participant), &motion, settings.horizon)
        };
        let parts: Vec<Vec<Horizon>> =
            cells.iter().map(of_person).collect::<Result<_, Invalid>>()?;
        let (driver, features) = (cells[0].model.word().to_owned(), cells[0].features.clone());
        Ok::<_, Invalid>(RolloutsOf { driver, features, horizons: together(&parts) })
    })?;
    for simple in [Simple::Held, Simple::Straight] {
        let parts = (0..people.len())
            .map(|i| rollouts(&simple, test(i), &motion, settings.horizon))
            .collect::<Result<Vec<_>, Invalid>>()?;
        let (driver, features) = (simple.word().to_owned(), String::new());
        all.push(RolloutsOf { driver, features, horizons: together(&parts) });
    }
    Ok(all)
}
