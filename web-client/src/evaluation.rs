//! The work of an evaluator, which runs in a worker. It trains a predictor on one participant's
//! tasks, counts how often predicted sets contain the future, compares their areas with those of
//! simpler predictions, and tunes settings. It works in pieces, so that it can receive the next
//! question between two pieces, and it works only on the newest question.

pub mod counting;
pub mod areas;
pub mod tuning;

use crate::json;
use areas::{Comparing, Known};
use counting::Counting;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sidestep::api::{Drive, Drives};
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::learn::participant::{self, Driven, Trained};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::reachability::ValueFunction;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::cache::Memory;
use sidestep::shfrs::pareto::Pareto;
use sidestep::shfrs::probability::Regions;
use sidestep::shfrs::window::Trajectory;
use sidestep::shfrs::window_sets::Prediction;
use tuning::{Found, Tuning};

/// Messages to an evaluator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The participant's tasks: [`Drives`] as JSON.
    Drives,
    /// The bytes of the value function V_HR.
    Human,
    /// The bytes of the value function V_RH, sent after V_HR. If it is not sent, V_HR is used for
    /// both vehicles.
    Robot,
    /// A predictor, in the format of a predictor.json.
    Predictor,
    /// A [`Training`] as JSON.
    Training,
    /// A [`Question`](counting::Question) as JSON.
    Question,
    /// An [`AreaQuestion`](areas::AreaQuestion) as JSON.
    AreaQuestion,
    /// An [`Aim`](tuning::Aim) as JSON.
    Aim,
    /// Stops the current work. The content is ignored.
    Stop,
}

impl Part {
    /// All parts. Messages between page and evaluator contain the index of a part in this list.
    pub const ALL: [Self; 9] = [
        Self::Drives,
        Self::Human,
        Self::Robot,
        Self::Predictor,
        Self::Training,
        Self::Question,
        Self::AreaQuestion,
        Self::Aim,
        Self::Stop,
    ];
}

/// A request to train a predictor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Training {
    /// Number of this request. Its report repeats the number.
    pub number: u32,
    /// Names of features.
    pub features: Vec<String>,
    /// Indices of the training tasks.
    pub tasks: Vec<usize>,
}

/// A report of an evaluator.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The number of the question that this report answers.
    pub number: u32,
    /// Progress; 1 in the last report.
    pub done: f64,
    /// The reason for the failure, if the work failed.
    #[serde(default)]
    pub trouble: Option<String>,
    /// The trained predictor.
    #[serde(default)]
    pub predictor: Option<PredictorFile>,
    /// The reason why the predictor uses only the frequencies of the inputs, if it does.
    #[serde(default)]
    pub fallback: Option<String>,
    /// Counts so far.
    #[serde(default)]
    pub regions: Option<Regions>,
    /// The coverages and areas so far.
    #[serde(default)]
    pub pareto: Option<Pareto>,
    /// The tuned settings.
    #[serde(default)]
    pub found: Option<Found>,
}

/// Confidence level of all intervals, as in the `sidestep` command.
pub const CONFIDENCE: f64 = 0.95;

/// State of an evaluator.
#[derive(Default)]
pub struct Evaluation {
    tasks: Option<Tasks>,
    safety: Option<SafetyLevels>,
    predictor: Option<Predictor>,
    /// Caches of the tasks' windows under this predictor (`memory`) and of the results for the
    /// baselines (`known`).
    memory: Memory,
    known: Known,
    work: Option<Work>,
    /// The next report, not yet sent.
    report: Option<Report>,
}

/// The current work.
enum Work {
    Counting(Counting),
    Comparing(Comparing),
    Tuning(Tuning),
}

impl Work {
    /// The number that the reports of this work repeat.
    fn number(&self) -> u32 {
        match self {
            Self::Counting(it) => it.number,
            Self::Comparing(it) => it.number,
            Self::Tuning(it) => it.number,
        }
    }
}

/// A question with a number. Its reports repeat the number.
trait Asked {
    fn number(&self) -> u32;
}

/// A prediction that uses a trained predictor.
type Predicted<'a> = Prediction<'a, PredictedHuman<'a>>;

/// The participant's tasks.
struct Tasks {
    parameters: SceneParameters,
    driven: Vec<Driven>,
    trajectories: Vec<Trajectory>,
}

impl Evaluation {
    /// Handles a message from the page.
    pub fn hear(&mut self, part: Part, content: &[u8]) {
        let taken = match part {
            Part::Drives => self.take_drives(content),
            Part::Human => ValueFunction::decode(content).map(|human| {
                self.safety = Some(SafetyLevels { robot: human.clone(), human });
            }),
            Part::Robot => ValueFunction::decode(content).map(|robot| {
                self.safety.iter_mut().for_each(|safety| safety.robot = robot.clone());
            }),
            Part::Predictor => self.take_predictor(content),
            Part::Training => {
                self.train(content);
                Ok(())
            }
            Part::Question => return self.begin(content, Counting::begin),
            Part::AreaQuestion => return self.begin(content, Comparing::begin),
            Part::Aim => return self.begin(content, Tuning::begin),
            Part::Stop => return self.work = None,
        };
        // The caches are no longer valid.
        (self.memory, self.known) = (Memory::default(), Known::default());
        if let Err(invalid) = taken {
            self.fail(0, &invalid);
        }
    }

    /// Replaces the current work.
    fn begin<T: DeserializeOwned + Asked>(
        &mut self,
        content: &[u8],
        begin: fn(T, &[Trajectory], &Predicted<'_>) -> Result<Work, Invalid>,
    ) {
        self.work = None;
        let Some(asked) = json::read::<T>(content) else { return };
        let number = asked.number();
        let begun = known(&self.tasks, &self.predictor, &self.safety).and_then(|(tasks, human)| {
            begin(asked, &tasks.trajectories, &Prediction::new(&tasks.parameters, &human))
        });
        match begun {
            Ok(work) => self.work = Some(work),
            Err(invalid) => self.fail(number, &invalid),
        }
    }

    /// Does a piece of the work. Returns whether there is more. A long piece passes reports to
    /// `progress`, as JSON.
    pub fn work(&mut self, progress: &mut dyn FnMut(String)) -> bool {
        let Some(work) = &mut self.work else { return false };
        let number = work.number();
        let more = known(&self.tasks, &self.predictor, &self.safety).and_then(|(tasks, human)| {
            let (trajectories, prediction) =
                (&tasks.trajectories, &Prediction::new(&tasks.parameters, &human));
            match work {
                Work::Counting(it) => it.go_on(trajectories, prediction, &mut self.memory),
                Work::Comparing(it) => it.go_on(prediction, &mut self.known),
                Work::Tuning(it) => {
                    it.go_on(prediction, &mut |report| progress(json::write(&report)))
                }
            }
        });
        more.unwrap_or_else(|invalid| {
            self.fail(number, &invalid);
            false
        })
    }

    /// Returns the next report as JSON if there are new results since the last report.
    pub fn report(&mut self) -> Option<String> {
        let report = self.report.take().or_else(|| match &mut self.work {
            Some(Work::Counting(it)) => it.report(),
            Some(Work::Comparing(it)) => it.report(),
            Some(Work::Tuning(it)) => it.report(),
            None => None,
        });
        report.map(|report| json::write(&report))
    }

    fn take_drives(&mut self, content: &[u8]) -> Result<(), Invalid> {
        let Drives { parameters, tasks, .. } = json::read(content).ok_or_else(unknown)?;
        let driven = tasks.iter().map(|drive| (drive.inputs.0.clone(), drive.states())).collect();
        let trajectory = |drive: &Drive| drive.trajectory(&parameters);
        let trajectories = tasks.iter().map(trajectory).collect::<Result<_, _>>()?;
        self.tasks = Some(Tasks { parameters, driven, trajectories });
        Ok(())
    }

    fn take_predictor(&mut self, content: &[u8]) -> Result<(), Invalid> {
        let file: PredictorFile = json::read(content).ok_or_else(unknown)?;
        self.predictor = Some(Predictor::try_from(file)?);
        Ok(())
    }

    fn train(&mut self, content: &[u8]) {
        let Some(Training { number, features, tasks }) = json::read(content) else { return };
        let trained = self.trained(&features, &tasks);
        match trained {
            Ok(Trained { predictor, fallback }) => {
                let file = Some(PredictorFile::from(&predictor));
                self.predictor = Some(predictor);
                let report = Report { number, done: 1.0, fallback, ..Report::default() };
                self.report = Some(Report { predictor: file, ..report });
            }
            Err(invalid) => self.fail(number, &invalid),
        }
    }

    fn trained(&self, features: &[String], places: &[usize]) -> Result<Trained, Invalid> {
        let known = self.tasks.as_ref().zip(self.safety.as_ref());
        let (tasks, safety) = known.ok_or_else(unknown)?;
        let features = FeatureSet::of(features)?;
        let driven = places.iter().filter_map(|&place| tasks.driven.get(place).cloned());
        participant::train(&features, Some(safety), &driven.collect::<Vec<_>>())
    }

    fn fail(&mut self, number: u32, why: &Invalid) {
        self.work = None;
        let trouble = Some(why.to_string());
        self.report = Some(Report { number, done: 1.0, trouble, ..Report::default() });
    }
}

/// Returns the tasks and the human as described by the predictor.
fn known<'a>(
    tasks: &'a Option<Tasks>,
    predictor: &'a Option<Predictor>,
    safety: &'a Option<SafetyLevels>,
) -> Result<(&'a Tasks, PredictedHuman<'a>), Invalid> {
    match (tasks, predictor, safety) {
        (Some(tasks), Some(predictor), Some(safety)) => {
            Ok((tasks, PredictedHuman::new(predictor, safety, &tasks.parameters)?))
        }
        _ => Err(unknown()),
    }
}

/// The error for missing data from the page, which is a bug of this program.
fn unknown() -> Invalid {
    Invalid::new("evaluator", "tasks, safety levels and a predictor", "less")
}
