//! `sidestep bounds`.

use super::CommandError;
use super::json_file::{Document, JsonArgs};
use super::solving::{Interrupt, solved_silently};
use serde::{Deserialize, Serialize};
use sidestep::bounds::{
    ActionChoice, ActionModel, Algorithm1, BoundsSettings, InputBounds, Motion, PredictedBounds,
    Rollout,
};
use sidestep::invalid::{Invalid, positive};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::reachability::{Options, ValueFunction};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, JointState, SceneParameters};
use sidestep::shfrs::PredictedHuman;
use sidestep::vehicle::{Pose, VehicleModel};
use std::path::PathBuf;

/// Bounds on the human's turn rate for the coming steps (Algorithm 1).
///
/// The input, in m, s and rad, headings counter-clockwise from +x:
/// {"human": [x, y, psi], "robot": [x, y, psi], "predictor": {…, as in predictor.json, which
/// docs/predictor.md describes; or left out for --predictor},
/// "epsilon": [rad/s, one a set, ascending], "k": [one a step] or "tau": 0.1 with
/// "steps": T, "rollout": "paper" or "base", "speed": 2, "dt": 0.2,
/// "turn_rate": [-0.5, 0.5]}. The robot drives straight on. May be left out:
/// "robot_speed" (as the human's), "robot_turn_rate" (the human's highest) and
/// "danger_radius" (3), which only features of the game depend on (v_h, v_r, dv_…, closest_…);
/// and "history": [{"human": [x, y, psi], "robot": […]}, …], the states of the steps before, for
/// features of the past (turned_…), which are 0 without it.
///
/// The predictor's classes are -1 (lowest turn rate), 0 (straight) and 1 (highest), unless
/// it has "actions": [rad/s, one a class, ascending].
///
/// The answer: {"lo": […], "hi": […], F lists of T rates, rad/s, "raw": [T × [lo, hi]] before
/// widening, "human_low": [T + 1 × [x, y, psi]], "human_high": […]}, the human's states along
/// both roll-outs, from the present on.
#[derive(Clone, Debug, clap::Args)]
pub struct BoundsArgs {
    #[command(flatten)]
    files: JsonArgs,
    #[command(flatten)]
    predictor: PredictorArgs,
}

/// A predictor that is not in the document.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct PredictorArgs {
    /// The predictor, where documents leave "predictor" out: a predictor.json, such as a model of
    /// `sidestep analyze`.
    #[arg(long = "predictor", value_name = "FILE.json")]
    file: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Input {
    human: Pose,
    robot: Pose,
    predictor: Option<PredictorFile>,
    epsilon: Vec<f64>,
    k: Option<Vec<usize>>,
    tau: Option<f64>,
    steps: Option<usize>,
    rollout: RolloutWord,
    speed: f64,
    dt: f64,
    turn_rate: (f64, f64),
    robot_speed: Option<f64>,
    robot_turn_rate: Option<f64>,
    danger_radius: Option<f64>,
    #[serde(default)]
    history: Vec<JointState>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RolloutWord {
    Paper,
    Base,
}

#[derive(Serialize)]
struct Answer<'a> {
    lo: Vec<&'a [f64]>,
    hi: Vec<&'a [f64]>,
    raw: &'a [(f64, f64)],
    human_low: Vec<Pose>,
    human_high: Vec<Pose>,
}

/// Highest speed, m/s, and longest step, s.
const MOST_SPEED_OR_STEP: f64 = 1e4;

/// Farthest coordinate, m, and largest heading, rad.
const MOST_COORDINATE: f64 = 1e6;

/// Most steps ahead.
const MOST_STEPS: usize = 3000;

/// Reads, runs Algorithm 1 and answers.
///
/// # Errors
/// [`CommandError`] for a document that is wrong, naming the field (input), or an answer
/// that cannot be written (failure).
pub async fn run(args: BoundsArgs) -> Result<(), CommandError> {
    let document = args.files.document();
    let given = args.predictor.read([document])?;
    let input: Input = args.files.read()?;
    let predictor = Given::of(document, &input, given.as_ref())?;
    let found = predicted(document, &input, &predictor).await?;
    args.files.answer(&Answer::from(&found))
}

/// A predictor, and whence: complaints about it name that.
#[derive(Clone)]
pub(super) struct Given<'a> {
    predictor: Predictor,
    document: Document<'a>,
    /// The field of the document that holds it; nothing where the document is it.
    field: Option<&'static str>,
}

impl PredictorArgs {
    /// Whether there is one.
    pub(super) fn is_given(&self) -> bool {
        self.file.is_some()
    }

    /// Reads it, if there is one, for these documents.
    ///
    /// # Errors
    /// [`CommandError`] (input) for a file that is no predictor of turns, or stdin where a
    /// document comes from there.
    pub(super) fn read<'a>(
        &'a self,
        documents: impl IntoIterator<Item = Document<'a>>,
    ) -> Result<Option<Given<'a>>, CommandError> {
        let Some(document) = self.file.as_deref().map(Document) else { return Ok(None) };
        if document.is_stdin() && documents.into_iter().any(Document::is_stdin) {
            let message = "--predictor: expected a file beside --input -, found - again";
            return Err(CommandError::Input(message.to_owned()));
        }
        let file: PredictorFile = document.read()?;
        let predictor = file.of_turns().map_err(|invalid| document.complain(&invalid))?;
        Ok(Some(Given { predictor, document, field: None }))
    }
}

impl<'a> Given<'a> {
    /// The document's own predictor, or the one beside it: there must be exactly one.
    fn of(
        document: Document<'a>,
        input: &Input,
        beside: Option<&Given<'a>>,
    ) -> Result<Self, CommandError> {
        let one = "a predictor here or in --predictor FILE.json";
        let complain = |found| document.complain(&Invalid::new(FIELD, one, found));
        match (&input.predictor, beside) {
            (Some(_), Some(_)) => Err(complain("both")),
            (None, None) => Err(complain("neither")),
            (None, Some(given)) => Ok(given.clone()),
            (Some(file), None) => {
                let predictor = (file.clone().of_turns())
                    .map_err(|invalid| document.complain(&invalid.within(FIELD)))?;
                Ok(Self { predictor, document, field: Some(FIELD) })
            }
        }
    }

    fn complain(&self, invalid: Invalid) -> CommandError {
        let invalid = match self.field {
            Some(field) => invalid.within(field),
            None => invalid,
        };
        self.document.complain(&invalid)
    }
}

/// Where a document has its predictor.
const FIELD: &str = "predictor";

/// Bounds that were predicted, with what they are about.
pub(super) struct Prediction {
    pub(super) now: JointState,
    pub(super) motion: Motion,
    pub(super) danger_radius_m: f64,
    pub(super) bounds: PredictedBounds,
}

/// Reads a document of this command and runs Algorithm 1 on it, with its predictor or the one
/// that is given beside it.
///
/// # Errors
/// [`CommandError`] naming the file and the field that is wrong.
pub(super) async fn prediction(
    document: Document<'_>,
    beside: Option<&Given<'_>>,
) -> Result<Prediction, CommandError> {
    let input: Input = document.read()?;
    let predictor = Given::of(document, &input, beside)?;
    let bounds = predicted(document, &input, &predictor).await?;
    let complain = |invalid: Invalid| document.complain(&invalid);
    let radius_m = input.danger_radius.unwrap_or(DANGER_RADIUS_M);
    Ok(Prediction {
        now: JointState { human: input.human, robot: input.robot },
        motion: motion(&input).map_err(complain)?,
        danger_radius_m: positive("danger_radius", radius_m).map_err(complain)?,
        bounds,
    })
}

const DANGER_RADIUS_M: f64 = 3.0;

async fn predicted(
    document: Document<'_>,
    input: &Input,
    given: &Given<'_>,
) -> Result<PredictedBounds, CommandError> {
    let complain = |invalid: Invalid| document.complain(&invalid);
    let predictor = &given.predictor;
    let problem = Problem::new(input, predictor).map_err(complain)?;
    let scene = match predictor.features().of_game() {
        Some(feature) => problem.scene(input, feature.name).map_err(complain)?,
        // Nothing looks at its game.
        None => SceneParameters::default(),
    };
    let safety = safety_levels(&scene, &Interrupt::listen()).await?;
    problem.bounds(predictor, &safety).map_err(|invalid| given.complain(invalid))
}

/// What is left once the input is checked.
struct Problem {
    history: Vec<JointState>,
    motion: Motion,
    robot_turn_rate: f64,
    settings: BoundsSettings,
}

impl Problem {
    fn new(input: &Input, predictor: &Predictor) -> Result<Self, Invalid> {
        let now = JointState { human: input.human, robot: input.robot };
        now.check()?;
        for (name, pose) in [("human", now.human), ("robot", now.robot)] {
            let coordinates: [f64; 3] = pose.into();
            if let Some(i) = coordinates.iter().position(|c| c.abs() > MOST_COORDINATE) {
                let expected = format!("a number from -{MOST_COORDINATE} to {MOST_COORDINATE}");
                return Err(Invalid::new(format!("{name}[{i}]"), expected, coordinates[i]));
            }
        }
        for (i, state) in input.history.iter().enumerate() {
            state.check().map_err(|invalid| invalid.within(&format!("history[{i}]")))?;
        }
        let history = input.history.iter().copied().chain([now]).collect();
        let motion = motion(input)?;
        let robot_turn_rate = motion.robot_turn_rate.1;
        let rollout = match input.rollout {
            RolloutWord::Paper => Rollout::Paper,
            RolloutWord::Base => Rollout::Base,
        };
        let actions = predictor.classes().len();
        let settings =
            BoundsSettings::new(input.epsilon.clone(), choice(input)?, rollout, actions)?;
        Ok(Self { history, motion, robot_turn_rate, settings })
    }

    /// The scene whose safety levels the feature `name` needs.
    fn scene(&self, input: &Input, name: &str) -> Result<SceneParameters, Invalid> {
        let (least, most) = input.turn_rate;
        if least != -most {
            let expected = format!("the same to both sides, for the feature {name}");
            return Err(Invalid::new("turn_rate", expected, format!("[{least}, {most}]")));
        }
        positive("robot_turn_rate", self.robot_turn_rate)?;
        let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
        Ok(SceneParameters {
            human: vehicle(self.motion.human_speed_mps, positive("turn_rate", most)?),
            robot: vehicle(self.motion.robot_speed_mps, self.robot_turn_rate),
            danger_radius_m: positive(
                "danger_radius",
                input.danger_radius.unwrap_or(DANGER_RADIUS_M),
            )?,
            step_s: self.motion.step_s,
            ..SceneParameters::default()
        })
    }

    /// Runs Algorithm 1. What it complains of is the predictor's.
    fn bounds(
        &self,
        predictor: &Predictor,
        safety: &SafetyLevels,
    ) -> Result<PredictedBounds, Invalid> {
        let human = PredictedHuman::within(predictor, safety, self.motion.human_turn_rate)?;
        let (least, most) = self.motion.human_turn_rate;
        if predictor.actions().is_none()
            && let Some(a) = human.actions().iter().position(|rate| !(least..=most).contains(rate))
        {
            let expected = format!("classes whose turn rates are from {least} to {most} rad/s");
            let found = format!("{} rad/s", human.actions()[a]);
            return Err(Invalid::new(format!("classes[{a}]"), expected, found));
        }
        let robot_drives_straight = |_: &[JointState]| 0.0;
        Algorithm1::default()
            .run(&self.history, &self.motion, &human, robot_drives_straight, &self.settings)
            .cloned()
    }
}

fn motion(input: &Input) -> Result<Motion, Invalid> {
    let robot_turn_rate = input.robot_turn_rate.unwrap_or(input.turn_rate.1.abs());
    let motion = Motion {
        human_speed_mps: input.speed,
        human_turn_rate: input.turn_rate,
        robot_speed_mps: input.robot_speed.unwrap_or(input.speed),
        robot_turn_rate: (-robot_turn_rate, robot_turn_rate),
        step_s: input.dt,
    };
    motion.check().map_err(named)?;
    for (name, value) in [
        ("speed", motion.human_speed_mps),
        ("robot_speed", motion.robot_speed_mps),
        ("dt", motion.step_s),
    ] {
        if value > MOST_SPEED_OR_STEP {
            let expected = format!("at most {MOST_SPEED_OR_STEP}");
            return Err(Invalid::new(name, expected, value));
        }
    }
    Ok(motion)
}

/// The library's names as those of the document.
pub(super) fn named(invalid: Invalid) -> Invalid {
    let field = match invalid.field.as_str() {
        "human_speed_mps" | "speed_mps" => "speed",
        "start.x" | "start.y" | "start.psi" => "human",
        "human_turn_rate" => "turn_rate",
        "robot_speed_mps" => "robot_speed",
        "step_s" => "dt",
        other => other,
    };
    Invalid { field: field.to_owned(), ..invalid }
}

fn choice(input: &Input) -> Result<ActionChoice, Invalid> {
    let steps = input.k.as_ref().map(Vec::len).or(input.steps);
    if let Some(steps) = steps.filter(|steps| *steps > MOST_STEPS) {
        let field = if input.k.is_some() { "k" } else { "steps" };
        return Err(Invalid::new(field, format!("at most {MOST_STEPS} steps"), steps));
    }
    match (&input.k, input.tau) {
        (Some(k), None) => {
            if let Some(steps) = input.steps.filter(|&steps| steps != k.len()) {
                let expected = format!("{}, the length of k, or nothing", k.len());
                return Err(Invalid::new("steps", expected, steps));
            }
            Ok(ActionChoice::TopK(k.clone()))
        }
        (None, Some(tau)) => {
            let missing = || Invalid::new("steps", "a whole number ≥ 1, beside tau", "nothing");
            Ok(ActionChoice::Adaptive { tau, steps: input.steps.ok_or_else(missing)? })
        }
        (Some(_), Some(_)) => Err(Invalid::new("tau", "nothing beside k", "both")),
        (None, None) => Err(Invalid::new("k", "k, or tau with steps", "neither")),
    }
}

/// Both value functions; only those of unequal vehicles take their time. Says which did not
/// converge.
pub(super) async fn safety_levels(
    parameters: &SceneParameters,
    interrupt: &Interrupt,
) -> Result<SafetyLevels, CommandError> {
    let [game_h, game_r] = Evader::ALL.map(|evader| parameters.game(evader));
    let mut functions = Vec::with_capacity(2);
    for game in [game_h, game_r] {
        functions.push(match (game.exact(), functions.first()) {
            (Ok(exact), _) => ValueFunction::Exact(exact),
            (Err(_), Some(human)) if game_r == game_h => ValueFunction::clone(human),
            (Err(_), _) => solved_silently(game, Options::default(), interrupt).await?.0.function,
        });
    }
    let robot = functions.remove(1);
    let safety = SafetyLevels { human: functions.remove(0), robot };
    for complaint in safety.complaints() {
        eprintln!("sidestep: {complaint}");
    }
    Ok(safety)
}

impl<'a> From<&'a PredictedBounds> for Answer<'a> {
    fn from(found: &'a PredictedBounds) -> Self {
        let human = |states: &[JointState]| states.iter().map(|state| state.human).collect();
        Self {
            lo: found.sets.iter().map(InputBounds::lo).collect(),
            hi: found.sets.iter().map(InputBounds::hi).collect(),
            raw: &found.raw,
            human_low: human(&found.low),
            human_high: human(&found.high),
        }
    }
}
