//! What an evaluator does beside a page: it trains a predictor on one participant's tasks, and counts how
//! often predicted sets hold their future. It works piece by piece, so that it hears of the next question
//! between two pieces, and the newest question is the only one that it works on.

use crate::json;
use serde::{Deserialize, Serialize};
use sidestep::api::{Drive, Drives};
use sidestep::bounds::BoundsSettings;
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::math::SeededRng;
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::reachability::ValueFunction;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::prediction::Prediction;
use sidestep::shfrs::probability::{Count, Regions, admits_everything};
use sidestep::shfrs::window::{Trajectory, WindowChoice};
use sidestep::training::{self, Driven, Trained};

/// What an evaluator can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The participant's tasks, [`Drives`] as JSON.
    Drives,
    /// The bytes of the value function V_HR.
    Human,
    /// The bytes of the value function V_RH, after V_HR; without them V_HR serves both vehicles.
    Robot,
    /// A predictor, as in a predictor.json.
    Predictor,
    /// A [`Training`] as JSON.
    Training,
    /// A [`Question`] as JSON.
    Question,
}

impl Part {
    /// All of them; their places stand for them between page and evaluator.
    pub const ALL: [Self; 6] =
        [Self::Drives, Self::Human, Self::Robot, Self::Predictor, Self::Training, Self::Question];
}

/// The request for a predictor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Training {
    /// Its report has this number.
    pub number: u32,
    /// Names of features.
    pub features: Vec<String>,
    /// The places of the tasks to learn from.
    pub tasks: Vec<usize>,
}

/// The question how often sets hold the future.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// Its reports have this number.
    pub number: u32,
    /// How sets are predicted.
    pub settings: ShfrsFile,
    /// The places of the tasks to count.
    pub tasks: Vec<usize>,
}

/// What an evaluator has to say.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The number of what it answers.
    pub number: u32,
    /// The share of the work that is done; 1 in the last report.
    pub done: f64,
    /// Why there is no answer, if there is none.
    #[serde(default)]
    pub trouble: Option<String>,
    /// The predictor that was asked for.
    #[serde(default)]
    pub predictor: Option<PredictorFile>,
    /// Why it has only the frequencies of the inputs, if so.
    #[serde(default)]
    pub fallback: Option<String>,
    /// What was counted so far.
    #[serde(default)]
    pub regions: Option<Regions>,
}

/// Confidence of all intervals, as the command line has it.
pub const CONFIDENCE: f64 = 0.95;

/// Windows from every step, as replays show them.
const WINDOWS: WindowChoice = WindowChoice::EveryStep;

/// What an evaluator knows and works on.
#[derive(Default)]
pub struct Evaluation {
    tasks: Option<Tasks>,
    safety: Option<SafetyLevels>,
    predictor: Option<Predictor>,
    counting: Option<Counting>,
    /// What is still to be reported.
    report: Option<Report>,
}

/// The participant's tasks.
struct Tasks {
    parameters: SceneParameters,
    driven: Vec<Driven>,
    trajectories: Vec<Trajectory>,
}

/// A question that is being answered.
struct Counting {
    number: u32,
    settings: BoundsSettings,
    /// The tasks to count, in the order of the question.
    trajectories: Vec<Trajectory>,
    /// The order in which they are counted: at random, so that the first estimates are fair.
    order: Vec<usize>,
    /// How many of them have been counted.
    done: usize,
    count: Count,
    /// Whether the page knows all that was counted.
    is_told: bool,
}

impl Evaluation {
    /// Hears what the page says.
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
            Part::Training => return self.train(content),
            Part::Question => return self.ask(content),
        };
        if let Err(invalid) = taken {
            self.fail(0, &invalid);
        }
    }

    /// Does a piece of the work. Returns whether there is more.
    pub fn work(&mut self) -> bool {
        let Some(counting) = &mut self.counting else { return false };
        let known = self.tasks.as_ref().zip(self.predictor.as_ref()).zip(self.safety.as_ref());
        let more = match known {
            Some(((tasks, predictor), safety)) => {
                let human = PredictedHuman::new(predictor, safety, &tasks.parameters);
                human.and_then(|human| counting.go_on(&Prediction::new(&tasks.parameters, &human)))
            }
            None => Err(unknown()),
        };
        let number = counting.number;
        more.unwrap_or_else(|invalid| {
            self.fail(number, &invalid);
            false
        })
    }

    /// What is new since the last report, as JSON.
    pub fn report(&mut self) -> Option<String> {
        let report = self.report.take().or_else(|| self.counted());
        report.map(|report| json::write(&report))
    }

    /// What was counted so far, if that is new.
    fn counted(&mut self) -> Option<Report> {
        let counting = self.counting.as_mut().filter(|counting| !counting.is_told)?;
        let (tasks, safety) = self.tasks.as_ref().zip(self.safety.as_ref())?;
        let human =
            PredictedHuman::new(self.predictor.as_ref()?, safety, &tasks.parameters).ok()?;
        let prediction = Prediction::new(&tasks.parameters, &human);
        counting.is_told = true;
        let report =
            Report { number: counting.number, done: counting.share(), ..Report::default() };
        let regions = counting.count.regions(WINDOWS, &prediction, &counting.settings, CONFIDENCE);
        Some(match regions {
            Ok(regions) => Report { regions: Some(regions), ..report },
            // The first tasks may be too short for a window.
            Err(_) if report.done < 1.0 => report,
            Err(invalid) => Report { trouble: Some(invalid.to_string()), ..report },
        })
    }

    fn fail(&mut self, number: u32, why: &Invalid) {
        self.counting = None;
        let trouble = Some(why.to_string());
        self.report = Some(Report { number, done: 1.0, trouble, ..Report::default() });
    }

    fn take_drives(&mut self, content: &[u8]) -> Result<(), Invalid> {
        let Drives { parameters, tasks, .. } = json::read(content).ok_or_else(unknown)?;
        let driven = tasks.iter().map(|drive| (drive.inputs(), drive.states())).collect();
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
        training::train(&features, Some(safety), &driven.collect::<Vec<_>>())
    }

    /// Works on this question instead of any other.
    fn ask(&mut self, content: &[u8]) {
        self.counting = None;
        let Some(question) = json::read::<Question>(content) else { return };
        let number = question.number;
        match self.begin(question) {
            Ok(counting) => self.counting = Some(counting),
            Err(invalid) => self.fail(number, &invalid),
        }
    }

    fn begin(&self, question: Question) -> Result<Counting, Invalid> {
        let known = self.tasks.as_ref().zip(self.predictor.as_ref()).zip(self.safety.as_ref());
        let ((tasks, predictor), safety) = known.ok_or_else(unknown)?;
        let settings = question.settings.settings(predictor.classes().len())?;
        let human = PredictedHuman::new(predictor, safety, &tasks.parameters)?;
        admits_everything(&Prediction::new(&tasks.parameters, &human), &settings)?;
        let places = question.tasks.iter();
        let trajectories: Vec<Trajectory> =
            places.filter_map(|&place| tasks.trajectories.get(place).cloned()).collect();
        let longest = trajectories.iter().map(Trajectory::steps).max().unwrap_or(0);
        if settings.steps() > longest {
            let expected = format!("at most {longest}, the steps of the longest task counted");
            return Err(Invalid::new("steps", expected, settings.steps()));
        }
        let n = trajectories.len();
        let order = SeededRng::new(0).permutation(n);
        let (count, number) = (Count::new(n), question.number);
        let is_told = true;
        Ok(Counting { number, settings, trajectories, order, done: 0, count, is_told })
    }
}

impl Counting {
    /// Counts one more task. Returns whether there are more.
    fn go_on(&mut self, prediction: &Prediction<'_, PredictedHuman<'_>>) -> Result<bool, Invalid> {
        let Some(&place) = self.order.get(self.done) else { return Ok(false) };
        let one = &self.trajectories[place..=place];
        let windows = WINDOWS.windows(one, self.settings.steps()).concat();
        self.count.judge(place, &windows, prediction, &self.settings)?;
        (self.done, self.is_told) = (self.done + 1, false);
        Ok(self.done < self.order.len())
    }

    /// The share of the tasks that are counted.
    fn share(&self) -> f64 {
        self.done as f64 / self.order.len().max(1) as f64
    }
}

/// The page has not said enough, which is a defect of this program.
fn unknown() -> Invalid {
    Invalid::new("evaluator", "tasks, safety levels and a predictor", "less")
}
