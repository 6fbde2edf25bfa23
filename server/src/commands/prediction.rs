//! Reads the documents of `sidestep bounds` and runs Algorithm 1 on them, for all commands that
//! predict.

use super::CommandError;
use super::degrees::Degrees;
use super::json_file::Document;
use super::solving::{Interrupt, safety_levels};
use serde::Deserialize;
use sidestep::bounds::{
    ActionChoice, ActionModel, Algorithm1, BoundsSettings, Motion, PredictedBounds, Rollout,
};
use sidestep::invalid::{Invalid, positive};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::PredictedHuman;
use sidestep::vehicle::{Pose, VehicleModel};
use std::path::PathBuf;

/// The predictor for documents without one.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct PredictorArgs {
    /// Predictor for documents without "predictor": a predictor.json, such as a model of `sidestep analyze`.
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
    q: Option<Vec<f64>>,
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

impl Input {
    /// Warns of headings that might be in degrees.
    fn warn_of_degrees(&self, document: Document<'_>) {
        let mut degrees = Degrees::of(document.name());
        for (name, pose) in [("human", self.human), ("robot", self.robot)] {
            degrees.look(pose.psi, || format!("{name}[2]"));
        }
        for (i, state) in self.history.iter().enumerate() {
            for (name, pose) in [("human", state.human), ("robot", state.robot)] {
                degrees.look(pose.psi, || format!("history[{i}].{name}[2]"));
            }
        }
        degrees.warn();
    }
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RolloutWord {
    Paper,
    Base,
}

/// Upper bound on speeds (m/s) and on the step length (s).
const MOST_SPEED_OR_STEP: f64 = 1e4;

/// Upper bound on the prediction horizon (steps).
const MOST_STEPS: usize = 3000;

/// A predictor, with the document from which it was read. Errors name this document.
#[derive(Clone)]
pub(super) struct PredictorSource<'a> {
    predictor: Predictor,
    document: Document<'a>,
    /// The field of the document that contains the predictor. `None` if the document itself is the
    /// predictor.
    field: Option<&'static str>,
}

impl PredictorArgs {
    /// Whether --predictor was given.
    pub(super) fn is_given(&self) -> bool {
        self.file.is_some()
    }

    /// Reads the predictor if --predictor was given. `documents` are the other documents that the
    /// command reads.
    ///
    /// # Errors
    /// [`CommandError`] (input) if the file is not a predictor of turns, or if both the file and
    /// one of the documents would be read from stdin.
    pub(super) fn read<'a>(
        &'a self,
        documents: impl IntoIterator<Item = Document<'a>>,
    ) -> Result<Option<PredictorSource<'a>>, CommandError> {
        let Some(document) = self.file.as_deref().map(Document) else { return Ok(None) };
        if document.is_stdin() && documents.into_iter().any(Document::is_stdin) {
            let message = "--predictor and --input cannot both read stdin (-)";
            return Err(CommandError::Input(message.to_owned()));
        }
        let file: PredictorFile = document.read()?;
        let predictor = file.of_turns().map_err(|invalid| document.complain(&invalid))?;
        Ok(Some(PredictorSource { predictor, document, field: None }))
    }
}

impl<'a> PredictorSource<'a> {
    /// The predictor.
    pub(super) fn predictor(&self) -> &Predictor {
        &self.predictor
    }

    /// The document's own predictor or the separate predictor `beside`. Exactly one of them must be
    /// given.
    fn of(
        document: Document<'a>,
        input: &Input,
        beside: Option<&PredictorSource<'a>>,
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

/// The field of a document that contains its predictor.
const FIELD: &str = "predictor";

/// The result of Algorithm 1, with the present state and the parameters of the prediction.
pub(super) struct Prediction {
    pub(super) now: JointState,
    pub(super) motion: Motion,
    pub(super) danger_radius_m: f64,
    /// The amount by which each set widens the bounds (rad/s).
    pub(super) epsilon: Vec<f64>,
    pub(super) bounds: PredictedBounds,
}

impl Prediction {
    /// Reads a document of `sidestep bounds`, and runs Algorithm 1 with its predictor or with `beside`.
    ///
    /// # Errors
    /// [`CommandError`] naming the file and the invalid field.
    pub(super) async fn of(
        document: Document<'_>,
        beside: Option<&PredictorSource<'_>>,
    ) -> Result<Self, CommandError> {
        let complain = |invalid: Invalid| document.complain(&invalid);
        let input: Input = document.read()?;
        let source = PredictorSource::of(document, &input, beside)?;
        let predictor = &source.predictor;
        let problem = Problem::new(&input, predictor).map_err(complain)?;
        let scene = match predictor.features().of_game() {
            Some(feature) => problem.scene(feature.name).map_err(complain)?,
            // No feature depends on the game.
            None => SceneParameters::default(),
        };
        let safety = safety_levels(&scene, &Interrupt::listen()).await?;
        let bounds = problem.bounds(predictor, &safety).map_err(|e| source.complain(e))?;
        input.warn_of_degrees(document);
        Ok(Self {
            now: JointState { human: input.human, robot: input.robot },
            motion: problem.motion,
            danger_radius_m: problem.danger_radius_m,
            epsilon: input.epsilon,
            bounds,
        })
    }
}

/// The checked input.
struct Problem {
    history: Vec<JointState>,
    motion: Motion,
    danger_radius_m: f64,
    settings: BoundsSettings,
}

impl Problem {
    fn new(input: &Input, predictor: &Predictor) -> Result<Self, Invalid> {
        let now = JointState { human: input.human, robot: input.robot };
        for (name, pose) in [("human", now.human), ("robot", now.robot)] {
            for (i, coordinate) in <[f64; 3]>::from(pose).into_iter().enumerate() {
                Pose::checked(&format!("{name}[{i}]"), coordinate)?;
            }
        }
        for (i, state) in input.history.iter().enumerate() {
            state.check().map_err(|invalid| invalid.within(&format!("history[{i}]")))?;
        }
        let history = input.history.iter().copied().chain([now]).collect();
        let motion = motion(input)?;
        let usual = SceneParameters::default().danger_radius_m;
        let danger_radius_m = positive("danger_radius", input.danger_radius.unwrap_or(usual))?;
        let rollout = match input.rollout {
            RolloutWord::Paper => Rollout::Paper,
            RolloutWord::Base => Rollout::Base,
        };
        let actions = predictor.classes().len();
        let settings =
            BoundsSettings::new(input.epsilon.clone(), choice(input)?, rollout, actions)?;
        Ok(Self { history, motion, danger_radius_m, settings })
    }

    /// The scene whose safety levels `feature` needs.
    fn scene(&self, feature: &str) -> Result<SceneParameters, Invalid> {
        let Motion { human_speed_mps, robot_speed_mps, step_s, .. } = self.motion;
        let (least, most) = self.motion.human_turn_rate;
        if least != -most {
            let expected = format!("the same to both sides, for the feature {feature}");
            return Err(Invalid::new("turn_rate", expected, format!("[{least}, {most}]")));
        }
        let robot_turn_rate = positive("robot_turn_rate", self.motion.robot_turn_rate.1)?;
        let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
        Ok(SceneParameters {
            human: vehicle(human_speed_mps, positive("turn_rate", most)?),
            robot: vehicle(robot_speed_mps, robot_turn_rate),
            danger_radius_m: self.danger_radius_m,
            step_s,
            ..SceneParameters::default()
        })
    }

    /// Runs Algorithm 1. Errors name fields of the predictor.
    fn bounds(
        &self,
        predictor: &Predictor,
        safety: &SafetyLevels,
    ) -> Result<PredictedBounds, Invalid> {
        let human = PredictedHuman::within(predictor, safety, self.motion.human_turn_rate)?;
        let (least, most) = self.motion.human_turn_rate;
        if predictor.actions().is_none()
            && let Some(a) =
                human.actions().rates().iter().position(|rate| !(least..=most).contains(rate))
        {
            let expected = format!("classes whose turn rates are from {least} to {most} rad/s");
            let found = format!("{} rad/s", human.actions().rates()[a]);
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

/// In an error, replaces the library's name of a field by the field's name in the document.
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
    let lists = [("k", input.k.as_ref().map(Vec::len)), ("q", input.q.as_ref().map(Vec::len))];
    let listed = lists.into_iter().find_map(|(name, length)| Some((name, length?)));
    let steps = listed.map(|(_, length)| length).or(input.steps);
    if let Some(steps) = steps.filter(|steps| *steps > MOST_STEPS) {
        let field = listed.map_or("steps", |(name, _)| name);
        return Err(Invalid::new(field, format!("at most {MOST_STEPS} steps"), steps));
    }
    if let (Some((name, length)), Some(steps)) = (listed, input.steps)
        && steps != length
    {
        let expected = format!("{length}, the length of {name}, or nothing");
        return Err(Invalid::new("steps", expected, steps));
    }
    if steps.is_none() && input.tau.is_some() {
        return Err(Invalid::new("steps", "a whole number ≥ 1, beside tau", "nothing"));
    }
    let steps = steps.unwrap_or(1);
    ActionChoice::of_file(steps, input.k.as_deref(), input.tau, input.q.as_deref())
}
