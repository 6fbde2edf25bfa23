//! The explorer's predictor, and the tasks on which it was not trained.

use super::Msg;
use crate::evaluation::Training;
use crate::form::FieldValue;
use crate::pages::models::{Named, Offered, described, group, groups, option};
use crate::pages::moment::select;
use crate::pages::parts::alert;
use crate::runtime::{Address, Answer, Commands, Request, read};
use crate::view::{self, el};
use sidestep::api::{Drives, PredictorSource, TrainedPredictor, routes};
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::shfrs::tuning::{Parts, Split};

type Node = view::Node<Msg>;

/// The choice of a predictor.
pub(super) struct Choice {
    chosen: Chosen,
    /// Features of the predictor that this page trains, by their name in [`FEATURES`].
    features: &'static str,
    /// Facts about the predictor, once it is loaded.
    known: Option<Known>,
    /// Other models to choose from.
    pub(super) offered: Offered,
    /// The reason why there is no predictor.
    refused: Option<String>,
}

/// A predictor.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Chosen {
    /// Trained in the evaluator, on the tasks that the command line would use for training.
    Here,
    /// Trained by the server on all trials before the current one.
    Earlier,
    /// A constant predictor: every input is equally likely.
    Constant,
    /// A model of an analysis.
    Named(Named),
}

/// Facts about a predictor.
#[derive(Default)]
struct Known {
    /// The number of trials that trained it.
    trials: usize,
    /// The ids of the trials that trained the predictor.
    trained_on: Vec<String>,
    /// The reason why the predictor uses only the frequencies of the inputs, if it does.
    fallback: Option<String>,
    /// The analysis that trained the predictor, if any.
    source: Option<PredictorSource>,
}

/// Where to get a predictor from.
pub(super) enum Ask {
    /// From the server.
    Server(Request<Msg>),
    /// From the evaluator, which must train it.
    Evaluator(Training),
    /// From nowhere: the predictor is already known, or there is an error.
    Nobody(Result<PredictorFile, Invalid>),
}

/// The feature sets to choose from, each with its name in links, its features and its label. The
/// first one is the default of the command line.
const FEATURES: [(&str, &[&str], &str); 9] = [
    ("usual", &["hrd", "robot_ahead", "robot_left"], "B, V_HR, V_RH, distance, robot ahead, left"),
    ("hrd", &["hrd"], "B_hrd: B, V_HR, V_RH, distance"),
    ("hr", &["hr"], "B_hr: B, V_HR, V_RH"),
    ("hd", &["hd"], "B_hd: B, V_HR, distance"),
    ("rd", &["rd"], "B_rd: B, V_RH, distance"),
    ("h", &["h"], "B_h: B, V_HR"),
    ("r", &["r"], "B_r: B, V_RH"),
    ("d", &["d"], "B_d: B, distance"),
    ("b", &[""], "B: relative position and heading"),
];

/// Splits this number of tasks as the command line does. The first part is for training.
fn parts(tasks: usize) -> Parts {
    Split::USUAL.parts(tasks).unwrap_or_default()
}

impl Choice {
    /// The link parameters that [`Self::of`] reads.
    pub(super) const NAMES: [&str; 4] = ["predictor", "features", "analysis", "file"];

    /// Link value for the predictor that this page trains.
    pub(super) const HERE: &str = "here";

    /// The split of the tasks for the predictor that this page trains.
    pub(super) fn set_aside(drives: &Drives) -> Parts {
        parts(drives.tasks.len())
    }

    /// The choice that the page's address describes. Without a choice in the address, it is the
    /// command line's default. Also returns an error message if the address has an unknown value.
    pub(super) fn of(address: &Address) -> (Self, Option<String>) {
        let mut misread = None;
        let chosen = match (Named::of(address), address.parameter("predictor")) {
            (Some(named), _) => Chosen::Named(named),
            (None, Some("earlier")) => Chosen::Earlier,
            (None, Some("constant")) => Chosen::Constant,
            (None, None | Some("here")) => Chosen::Here,
            (None, Some(other)) => {
                misread = Some(format!(
                    "The explorer has no predictor {other}: expected here, earlier, constant, or analysis= and \
                     file= of a model. The predictor below is trained here."
                ));
                Chosen::Here
            }
        };
        let mut choice = Self {
            chosen,
            features: FEATURES[0].0,
            known: None,
            offered: Offered::Asked,
            refused: None,
        };
        if let Some(features) = address.parameter("features")
            && !choice.set_features(features)
        {
            let names = FEATURES.map(|(name, ..)| name).join(", ");
            misread.get_or_insert_with(|| {
                format!(
                    "The explorer has no feature set {features}: expected one of {names}. The predictor below \
                     uses the first one."
                )
            });
        }
        (choice, misread)
    }

    /// Whether there is no predictor, and none is being loaded.
    pub(super) fn is_refused(&self) -> bool {
        self.refused.is_some()
    }

    /// Command-line flags that select the chosen predictor. Returns `None` if the command line
    /// cannot train it.
    pub(super) fn flags(&self) -> Option<String> {
        let (usual, ..) = FEATURES[0];
        let set = FEATURES.iter().find(|(name, ..)| *name == self.features);
        match (&self.chosen, set) {
            (Chosen::Here, Some((name, ..))) if *name == usual => Some(String::new()),
            (Chosen::Here, Some((_, names, _))) => {
                let names = names.join(",");
                Some(if names.is_empty() {
                    " --features ''".into()
                } else {
                    format!(" --features {names}")
                })
            }
            _ => None,
        }
    }

    /// Requests the list of models to choose from.
    pub(super) fn begin(&self, drives: &Drives) -> Commands<Msg> {
        vec![Offered::ask(&drives.study, Msg::Analyses)]
    }

    pub(super) fn analyses(&mut self, answer: Answer, number: i64) -> Commands<Msg> {
        self.offered.analyses(answer, number, Msg::Models)
    }

    /// Chooses another predictor.
    pub(super) fn choose(&mut self, value: &FieldValue) {
        self.chosen = match value.text() {
            "earlier" => Chosen::Earlier,
            "constant" => Chosen::Constant,
            text => Named::of_value(text).map_or(Chosen::Here, Chosen::Named),
        };
    }

    /// Sets the features of the predictor that this page trains. Returns whether this feature set
    /// exists.
    pub(super) fn set_features(&mut self, name: &str) -> bool {
        let known = FEATURES.iter().find(|(known, ..)| *known == name);
        if let Some((known, ..)) = known {
            self.features = known;
        }
        known.is_some()
    }

    /// Whether the predictor depends on the current task.
    pub(super) fn depends_on_task(&self) -> bool {
        self.chosen == Chosen::Earlier
    }

    /// The choice as part of a query. Empty for the default.
    pub(super) fn query(&self) -> String {
        match &self.chosen {
            Chosen::Here if self.features == FEATURES[0].0 => String::new(),
            Chosen::Here => format!("features={}", self.features),
            Chosen::Earlier => "predictor=earlier".to_owned(),
            Chosen::Constant => "predictor=constant".to_owned(),
            Chosen::Named(named) => named.query(),
        }
    }

    /// The predictor as part of a query if it is a model of an analysis. Otherwise empty.
    pub(super) fn named(&self) -> String {
        match &self.chosen {
            Chosen::Named(named) => named.query(),
            _ => String::new(),
        }
    }

    /// Determines where to get the predictor from, for a trial of a participant with this number of
    /// tasks. The evaluator's report will repeat `number`.
    pub(super) fn ask(&mut self, trial_id: &str, tasks: usize, number: u32) -> Ask {
        (self.known, self.refused) = (None, None);
        let route = routes::admin_predictor(trial_id);
        let request = |url: String| Ask::Server(Request::get("predictor", url, Msg::Predictor));
        match &self.chosen {
            Chosen::Here => {
                let features = Vec::from(self.feature_set());
                Ask::Evaluator(Training { number, features, tasks: parts(tasks).training })
            }
            Chosen::Earlier => request(route),
            Chosen::Named(named) => request(format!("{route}?{}", named.query())),
            Chosen::Constant => {
                self.known = Some(Known::default());
                Ask::Nobody(equally_likely())
            }
        }
    }

    fn feature_set(&self) -> FeatureSet {
        let names = FEATURES.iter().find(|(name, ..)| *name == self.features);
        let names = names.map_or(FEATURES[0].1, |(_, names, _)| names);
        let names = names.iter().flat_map(|word| match FeatureSet::subset(word) {
            Ok(set) => Vec::from(set),
            Err(_) => vec![(*word).to_owned()],
        });
        FeatureSet::of(&names.collect::<Vec<String>>()).unwrap_or_else(|_| FeatureSet::none())
    }

    /// Processes the server's answer. Returns the predictor, if the server has sent one.
    pub(super) fn arrived(&mut self, answer: Answer) -> Option<PredictorFile> {
        match read::<TrainedPredictor>(answer) {
            Ok(TrainedPredictor { predictor, trials, fallback, trained_on, source }) => {
                self.known = Some(Known { trials, trained_on, fallback, source });
                Some(predictor)
            }
            Err(failure) => {
                self.refuse(&failure.sentence);
                None
            }
        }
    }

    /// Records that the predictor trained by this page is ready.
    pub(super) fn trained(&mut self, fallback: Option<String>) {
        self.known = Some(Known { fallback, ..Known::default() });
    }

    /// Records why there is no predictor.
    pub(super) fn refuse(&mut self, why: &str) {
        self.known = None;
        self.refused = Some(format!("No predicted sets. {why}"));
    }

    /// Splits the tasks as the command line does, but leaves out the tasks on which the predictor
    /// was trained. Such tasks must not be used to calibrate or test it.
    pub(super) fn parts(&self, drives: &Drives) -> Parts {
        let unseen = self.unseen(drives);
        let mut parts = parts(drives.tasks.len());
        for part in [&mut parts.calibration, &mut parts.test] {
            part.retain(|place| unseen.contains(place));
        }
        parts
    }

    /// Indices of the tasks on which the predictor was not trained.
    pub(super) fn unseen(&self, drives: &Drives) -> Vec<usize> {
        let tasks = &drives.tasks;
        if self.chosen == Chosen::Here {
            // The command line counts these tasks, in this order.
            let Parts { calibration, test, .. } = parts(tasks.len());
            return [calibration, test].concat();
        }
        let trained_on = self.known.as_ref().map_or(&[][..], |known| &known.trained_on);
        let is_unseen = |&place: &usize| !trained_on.contains(&tasks[place].trial_id);
        (0..tasks.len()).filter(is_unseen).collect()
    }
}

/// A predictor that gives every input the same probability.
fn equally_likely() -> Result<PredictorFile, Invalid> {
    let features = FeatureSet::of(&["distance"])?;
    let predictor = Predictor::constant(features, vec![-1, 0, 1], vec![1.0 / 3.0; 3])?;
    Ok(PredictorFile::from(&predictor))
}

/// The control that chooses the predictor, and facts about the predictor.
pub(super) fn section(choice: &Choice, drives: &Drives) -> Node {
    let id = "choose-predictor";
    let is_waiting = choice.known.is_none() && choice.refused.is_none();
    let words = match &choice.known {
        Some(known) => Some(about(choice, known, drives)),
        None => is_waiting.then(|| el("p").attr("role", "status").text("Loading…")),
    };
    let features = (choice.chosen == Chosen::Here).then(|| {
        let options = FEATURES.iter().map(|(name, _, words)| ((*name).into(), (*words).into()));
        select("features", "Features", options.collect(), choice.features, Msg::Features)
    });
    el("section")
        .child(el("h2").child(el("label").attr("for", id).text("Predictor")))
        .child(list(choice, drives).attr("id", id))
        .children(features)
        .children(words.map(|words| words.class("quiet").test_id("predictor")))
        .children(choice.refused.as_deref().map(|why| alert("refused", why)))
        .children(choice.offered.hint(&drives.study))
}

fn list(choice: &Choice, drives: &Drives) -> Node {
    let entry = |value: &str, chosen: &Chosen, words: &str| {
        option(value.to_owned(), choice.chosen == *chosen, words.to_owned())
    };
    let named = match &choice.chosen {
        Chosen::Named(named) => Some(named),
        _ => None,
    };
    let source = choice.known.as_ref().and_then(|known| known.source.as_ref());
    el("select")
        .attr("name", "predictor")
        .test_id("choose-predictor")
        .on_input(Msg::Choose)
        .child(group("Of this participant".to_owned()).children([
            entry(Choice::HERE, &Chosen::Here, "Trained on some tasks, judged on the others"),
            entry("earlier", &Chosen::Earlier, "Trained on the trials before this one"),
            entry("constant", &Chosen::Constant, "Constant: 1/3 each"),
        ]))
        .children(groups(&choice.offered, named, source, drives.number))
}

/// Describes the predictor.
fn about(choice: &Choice, known: &Known, drives: &Drives) -> Node {
    if let Some(source) = &known.source {
        return described(source);
    }
    let n = drives.tasks.len();
    let words = match (&choice.chosen, &known.fallback) {
        (Chosen::Constant, _) => "Every input is equally likely, whatever the scene.".to_owned(),
        (_, Some(why)) => format!("Frequencies of the inputs: {why}"),
        (Chosen::Earlier, None) => format!(
            "Logistic regression on B_hrd, trained on the {} trials before this task",
            known.trials
        ),
        _ => format!(
            "Logistic regression, trained on {} of the {n} tasks: drawn with seed 0, as by \
             sidestep shfrs",
            parts(n).training.len()
        ),
    };
    el("p").text(words)
}
