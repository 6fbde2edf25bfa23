//! The source of a replay's predictions, as named in its link: a method learned from the participant's
//! earlier trials, a baseline without learning, or a model of an analysis.

use super::{Learned, USUAL_STEPS};
use crate::bounds::{ActionChoice, BoundsSettings, Rollout};
use crate::features::{FeatureSet, HISTORY_SET};
use crate::invalid::Invalid;
use crate::predict::tree::{QuestionsFile, TreeFields, TreeFile};
use crate::predict::{ModelFile, Predictor, PredictorFile};
use crate::scene::SceneParameters;
use crate::shfrs::ShfrsSettings;
use crate::shfrs::baselines::{EmpiricalFamily, Fitted};
use crate::shfrs::window::Trajectory;

/// A source of predictions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A method that needs no analysis.
    Way(Way),
    /// A model of an analysis.
    Model {
        /// The id of the analysis, without slashes.
        analysis: String,
        /// The model's file in the analysis.
        file: String,
    },
}

/// A prediction method that needs no analysis. The baselines are named as in `sidestep shfrs`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// A logistic regression on B_hrd, trained on the participant's earlier trials.
    #[default]
    Earlier,
    /// Like [`Self::Earlier`], but the regression also uses the robot's position in the human's
    /// frame and the human's recent turns.
    History,
    /// Like [`Self::Earlier`], but the human takes only the likeliest input at each step.
    LearnedDisturbance,
    /// Hulls of the futures that followed the same input in the participant's earlier trials.
    Empirical,
    /// Normal distributions of the participant's deviations, in earlier trials, from a path with
    /// constant input.
    Gaussian,
    /// Every input is equally likely.
    Constant,
    /// The human drives straight on.
    ConstantVelocity,
    /// The human holds the input of the last step.
    HoldTheInput,
    /// Any input at any time.
    WorstCase,
}

/// Caption of a predictor opened from a file.
pub const FROM_FILE: &str = "A predictor from a file";

/// Turns by less than this angle (rad) are rounding errors.
const LEAST_TURN: f64 = 1e-9;

impl Way {
    /// All methods, the default first.
    pub const ALL: [Self; 9] = [
        Self::Earlier,
        Self::History,
        Self::LearnedDisturbance,
        Self::Empirical,
        Self::Gaussian,
        Self::Constant,
        Self::ConstantVelocity,
        Self::HoldTheInput,
        Self::WorstCase,
    ];

    /// Its name in links.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Earlier => "earlier",
            Self::History => "history",
            Self::LearnedDisturbance => "learned-disturbance",
            Self::Empirical => "empirical",
            Self::Gaussian => "gaussian",
            Self::Constant => "constant",
            Self::ConstantVelocity => "constant-velocity",
            Self::HoldTheInput => "hold-the-input",
            Self::WorstCase => "worst-case",
        }
    }

    /// Its label in lists.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Earlier => "Trained on earlier trials",
            Self::History => "Trained on earlier trials, with history",
            Self::LearnedDisturbance => "Learned disturbance",
            Self::Empirical => "Empirical, held input",
            Self::Gaussian => "Gaussian, held input",
            Self::Constant => "Constant: 1/3 each",
            Self::ConstantVelocity => "Constant velocity",
            Self::HoldTheInput => "Hold the input",
            Self::WorstCase => "Worst case",
        }
    }

    /// A sentence that describes its prediction.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Earlier => "Logistic regression on B_hrd.",
            Self::History => {
                "Logistic regression on B_hrd, the robot’s place as the human sees it, and the \
                 human’s turns so far."
            }
            Self::LearnedDisturbance => {
                "The human does what the model of the earlier trials thinks likeliest, give or take ε."
            }
            Self::Empirical => "Hulls of the futures recorded after the same input.",
            Self::Gaussian => "Ellipses of recorded futures about holding the input.",
            Self::Constant => "Every input is equally likely, whatever the scene.",
            Self::ConstantVelocity => "The human drives straight on, give or take ε.",
            Self::HoldTheInput => "The human holds the input of the last step, give or take ε.",
            Self::WorstCase => "Every input at every time: one set, which nobody can leave.",
        }
    }

    /// What it needs from the participant's earlier trials.
    #[must_use]
    pub fn needs(self) -> Needs {
        match self {
            Self::Earlier | Self::LearnedDisturbance => Needs::Model(USUAL_SET),
            Self::History => Needs::Model(HISTORY_SET),
            Self::Empirical => Needs::Trials(EmpiricalFamily::Empirical),
            Self::Gaussian => Needs::Trials(EmpiricalFamily::Gaussian),
            Self::Constant | Self::ConstantVelocity | Self::HoldTheInput | Self::WorstCase => {
                Needs::Nothing
            }
        }
    }

    /// The function and settings of this method. `trained` is the model, if the method needs one.
    ///
    /// # Errors
    /// [`Invalid`] if the method needs a model that is missing, or if it needs the trials
    /// themselves; see [`fitted`].
    pub fn learned(self, trained: Option<Predictor>) -> Result<Learned, Invalid> {
        let trained =
            trained.ok_or_else(|| Invalid::new("predictor", "a model of earlier trials", "none"));
        match self {
            Self::Earlier | Self::History => Learned::usual(trained?),
            Self::LearnedDisturbance => Learned::of_k(trained?, 1, None),
            Self::Constant => Learned::usual(always([1.0 / 3.0; 3])?),
            Self::ConstantVelocity => Learned::of_k(always([0.0, 1.0, 0.0])?, 1, None),
            Self::HoldTheInput => Learned::of_k(held()?, 1, None),
            Self::WorstCase => Learned::of_k(always([1.0 / 3.0; 3])?, 3, Some(vec![1.0])),
            Self::Empirical | Self::Gaussian => {
                Err(Invalid::new("predictor", "one with a function", self.name()))
            }
        }
    }
}

/// What a method needs from the participant's earlier trials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// A model trained on these trials with the feature set of this name.
    Model(&'static str),
    /// The trials themselves, for the sets of this family.
    Trials(EmpiricalFamily),
}

/// Learns a family's sets from the participant's earlier trials.
///
/// # Errors
/// [`Invalid`] if the trials have too few windows.
pub fn fitted(
    family: EmpiricalFamily,
    parameters: &SceneParameters,
    earlier: &[Trajectory],
) -> Result<Fitted, Invalid> {
    Fitted::learn(family, parameters, earlier, USUAL_STEPS)
}

/// Default feature set of models trained on earlier trials.
const USUAL_SET: &str = "hrd";

/// The features in the set with this name, for models trained on earlier trials.
///
/// # Errors
/// [`Invalid`] for any other name.
pub fn features_of(set: &str) -> Result<FeatureSet, Invalid> {
    match set {
        USUAL_SET => FeatureSet::subset(set),
        HISTORY_SET => FeatureSet::with_history(),
        other => Err(Invalid::new("features", format!("{USUAL_SET} or {HISTORY_SET}"), other)),
    }
}

impl Learned {
    /// A function that predicts with the paper's settings.
    ///
    /// # Errors
    /// The errors of [`ShfrsSettings::paper`].
    pub fn usual(predictor: Predictor) -> Result<Self, Invalid> {
        let settings = ShfrsSettings::paper(predictor.classes().len())?;
        Ok(Self { predictor, settings })
    }

    /// Like [`Self::usual`], but with the `k` likeliest inputs at every step, and with these
    /// widenings, if given.
    fn of_k(predictor: Predictor, k: usize, epsilon: Option<Vec<f64>>) -> Result<Self, Invalid> {
        let mut learned = Self::usual(predictor)?;
        let usual = &learned.settings.bounds;
        let (actions, steps) = (learned.predictor.classes().len(), usual.steps());
        let epsilon = epsilon.unwrap_or_else(|| usual.epsilon().to_vec());
        let choice = ActionChoice::TopK(vec![k.min(actions); steps]);
        learned.settings.bounds = BoundsSettings::new(epsilon, choice, Rollout::Base, actions)?;
        Ok(learned)
    }
}

/// A predictor with constant probabilities of right, straight and left.
fn always(probabilities: [f64; 3]) -> Result<Predictor, Invalid> {
    Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], probabilities.to_vec())
}

/// A predictor that expects, with near certainty, the same input as in the previous step. It infers
/// the previous input from the last turn.
fn held() -> Result<Predictor, Invalid> {
    let questions = QuestionsFile {
        feature: vec![0; 5],
        threshold: vec![-LEAST_TURN, 0.0, LEAST_TURN, 0.0, 0.0],
        left: vec![1, 0, 3, 0, 0],
        right: vec![2, 0, 4, 0, 0],
    };
    // A tree adds one to each count, so near certainty needs large counts.
    const MANY: u32 = 1_000_000;
    let counts = [[1, 1, 1], [1, 0, 0], [0, 1, 1], [0, 1, 0], [0, 0, 1]];
    let counts = counts.map(|counts| counts.map(|count| MANY * count).to_vec());
    let tree = TreeFile { questions, counts: counts.to_vec() };
    Predictor::try_from(PredictorFile {
        experiment: None,
        features: vec!["turned_1".to_owned()],
        classes: vec![-1, 0, 1],
        actions: None,
        model: ModelFile::Tree(TreeFields { tree }),
    })
}

impl Default for Source {
    fn default() -> Self {
        Self::Way(Way::default())
    }
}

impl Source {
    /// The query parameters that [`Self::of_query`] accepts.
    pub const NAMES: [&str; 4] = ["predictor", "analysis", "file", "beside"];

    /// Parses a source: the name of a method, or analysis and file separated by a slash.
    ///
    /// # Errors
    /// [`Invalid`] naming `field` for any other text.
    pub fn of(field: &str, text: &str) -> Result<Self, Invalid> {
        if let Some((analysis, file)) = text.split_once('/') {
            return Ok(Self::Model { analysis: analysis.to_owned(), file: file.to_owned() });
        }
        let way = Way::ALL.into_iter().find(|way| way.name() == text);
        way.map(Self::Way).ok_or_else(|| {
            let names = Way::ALL.map(Way::name).join(", ");
            Invalid::new(field, format!("{names}, or analysis/file of a model"), text)
        })
    }

    /// Its name, as [`Self::of`] parses it.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Way(way) => way.name().to_owned(),
            Self::Model { analysis, file } => format!("{analysis}/{file}"),
        }
    }

    /// Its caption in a picture: a method's label, or the model's file.
    #[must_use]
    pub fn caption(&self) -> String {
        match self {
            Self::Way(way) => way.label().to_owned(),
            Self::Model { file, .. } => file.clone(),
        }
    }

    /// The sources in a link's query, namely `predictor=…` or `analysis=…&file=…` for the pane, and
    /// `beside=…` for the pane beside it, if any.
    ///
    /// # Errors
    /// [`Invalid`] with the name of an invalid parameter.
    pub fn of_query<'a>(
        query: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<(Self, Option<Self>), Invalid> {
        let (mut source, mut model, mut beside) = (Self::default(), [None; 2], None);
        for (name, value) in query {
            match name {
                "predictor" => source = Self::of(name, value)?,
                "analysis" => model[0] = Some(value),
                "file" => model[1] = Some(value),
                "beside" => beside = Some(Self::of(name, value)?),
                _ => {}
            }
        }
        if model != [None; 2] {
            let [analysis, file] = model.map(|part| part.unwrap_or_default().to_owned());
            source = Self::Model { analysis, file };
        }
        Ok((source, beside))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, SeededRng};
    use crate::safety::SafetyLevels;
    use crate::scene::JointState;
    use crate::shfrs::baselines::{constant_velocity, hold_the_input, worst_case};
    use crate::shfrs::family::Family;
    use crate::shfrs::window::Window;
    use crate::shfrs::{PredictedHuman, predict};
    use crate::vehicle::{Pose, TurnInput};
    use core::ops::ControlFlow;

    #[test]
    fn names_are_read_as_they_are_written() {
        for way in Way::ALL {
            assert_eq!(Source::of("predictor", way.name()).unwrap(), Source::Way(way));
            assert!(!way.name().contains('/') && way.meaning().ends_with('.'));
        }
        let model = Source::of("beside", "a1/models/lr-1-hrd-1.json").unwrap();
        assert_eq!(model.name(), "a1/models/lr-1-hrd-1.json");
        let of = |query: &str| {
            Source::of_query(query.split('&').filter_map(|part| part.split_once('=')))
        };
        assert_eq!(of("t=1").unwrap(), (Source::default(), None));
        let found = of("analysis=a1&file=models/lr-1-hrd-1.json&beside=worst-case").unwrap();
        assert_eq!(found, (model, Some(Source::Way(Way::WorstCase))));
        let refused = of("predictor=best").unwrap_err();
        assert_eq!((refused.field.as_str(), refused.found.as_str()), ("predictor", "best"));
        assert!(refused.expected.contains("hold-the-input, worst-case, or analysis/file"));
        assert_eq!(of("beside=").unwrap_err().field, "beside");
    }

    /// Compares the areas of the sets with the areas of the families in `sidestep shfrs`. These
    /// families need no predictor.
    #[test]
    fn baselines_are_those_of_the_comparison() {
        let parameters = SceneParameters::default();
        let progress = &mut |_| ControlFlow::Continue(());
        let safety = SafetyLevels::solve(&parameters, progress).unwrap();
        let mut families: [(Way, Box<dyn Family>); 3] = [
            (Way::ConstantVelocity, Box::new(constant_velocity(&parameters))),
            (Way::HoldTheInput, Box::new(hold_the_input(&parameters))),
            (Way::WorstCase, Box::new(worst_case(&parameters))),
        ];
        let mut rng = SeededRng::new(7);
        for _ in 0..20 {
            let mut pose =
                || Pose::new(rng.uniform(-9., 9.), rng.uniform(-9., 9.), rng.uniform(-PI, PI));
            let mut states = vec![JointState { human: pose(), robot: pose() }];
            let inputs: Vec<TurnInput> = (0..14).map(|_| TurnInput::ALL[rng.below(3)]).collect();
            for &input in &inputs {
                states.push(states[states.len() - 1].advance(
                    &parameters,
                    input,
                    0.0,
                    parameters.step_s,
                ));
            }
            let rates = inputs.iter().map(|&input| parameters.human.turn_rate(input)).collect();
            let trajectory = Trajectory::new(states.clone(), rates).unwrap();
            let window = Window::new(&trajectory, 4, 10).unwrap();
            for (way, family) in &mut families {
                let Learned { predictor, settings } = way.learned(None).unwrap();
                let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
                let shfrs = predict(&states[..=4], &parameters, &human, &settings).unwrap();
                for set in &shfrs.sets {
                    let area = family.area_m2(&window, set.epsilon).unwrap();
                    let apart = (set.area_m2 - area).abs();
                    assert!(apart < 0.01, "{way:?} {}: {} {area}", set.epsilon, set.area_m2);
                }
            }
        }
    }

    #[test]
    fn a_way_that_needs_a_model_says_so() {
        for way in Way::ALL {
            assert_eq!(way.learned(None).is_err(), way.needs() != Needs::Nothing, "{way:?}");
            if let Needs::Model(set) = way.needs() {
                let features = features_of(set).unwrap();
                let model = Predictor::constant(features, vec![0, 1], vec![0.5; 2]).unwrap();
                assert_eq!(way.learned(Some(model.clone())).unwrap().predictor, model);
            }
        }
        assert_eq!(features_of("best").unwrap_err().field, "features");
    }
}
