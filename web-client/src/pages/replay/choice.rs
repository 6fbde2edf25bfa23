//! The predictor of a pane in a replay, and the predictors to choose from.

use super::Msg;
use crate::form::FieldValue;
use crate::json;
use crate::pages::models::{Named, Offered, described, group, groups, option};
use crate::pages::parts::{alert, button, count};
use crate::runtime::{Answer, Command, Request, encoded, read};
use crate::view::{self, el};
use sidestep::api::{
    LearnedSets, PredictorSource, TrainedPredictor, TrialDetail, TrialUse, routes,
};
use sidestep::document::{from_value, is_too_deep};
use sidestep::invalid::Invalid;
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::shfrs::probability::Probabilities;
use sidestep::trial_view::source::{FROM_FILE, Needs, Source, Way};
use sidestep::trial_view::{Learned, Method};

type Node = view::Node<Msg>;

/// One of two pictures of the same instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pane {
    /// The picture that is always shown.
    First,
    /// The second picture, beside the first.
    Second,
}

impl Pane {
    /// The name of the request for the pane's predictor.
    pub(super) fn request(self) -> &'static str {
        match self {
            Self::First => "predictor",
            Self::Second => "predictor-beside",
        }
    }

    /// The name of the pane's evaluator.
    pub(super) fn evaluator(self) -> &'static str {
        match self {
            Self::First => "chances",
            Self::Second => "chances-beside",
        }
    }

    /// The id of an element in this pane.
    pub(super) fn id(self, name: &str) -> String {
        match self {
            Self::First => name.to_owned(),
            Self::Second => format!("{name}-beside"),
        }
    }
}

/// The choice of a predictor.
pub(super) struct Choice {
    pane: Pane,
    chosen: Chosen,
    /// Facts about the predictor, once it is loaded.
    known: Option<Known>,
    /// The reason why there is no predictor.
    refused: Option<String>,
    /// The reason why the last opened file cannot be used.
    unusable: Option<String>,
}

/// A predictor.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Chosen {
    /// A predictor that a link can name.
    Linked(Source),
    /// A predictor from a file that the user opened. No link can name it.
    File,
}

/// Facts about a predictor.
#[derive(Default)]
struct Known {
    /// The number of trials that trained the predictor.
    trials: usize,
    /// The reason why the predictor uses only the frequencies of the inputs, if it does.
    fallback: Option<String>,
    /// The analysis that trained the predictor, if any.
    source: Option<PredictorSource>,
    /// The ids of the trials that trained the predictor.
    trained_on: Vec<String>,
    /// Number of features of a predictor from a file.
    features: usize,
    /// How often the predictor's sets contain the future of the tasks that did not train it, if the
    /// server has counted this.
    held: Option<Probabilities>,
}

/// Where to get a predictor from.
pub(super) enum Ask {
    /// From the server, with this request.
    Server(Command<Msg>),
    /// From nowhere: the predictor is already known, or there is an error.
    Nobody(Result<Box<Method>, String>),
}

impl Choice {
    pub(super) fn new(pane: Pane, source: Source) -> Self {
        let chosen = Chosen::Linked(source);
        Self { pane, chosen, known: None, refused: None, unusable: None }
    }

    /// Determines where to get the predictor from.
    pub(super) fn ask(&mut self, trial_id: &str) -> Ask {
        (self.known, self.refused) = (None, None);
        let predictor = |query: &str| {
            let route = routes::admin_predictor(trial_id);
            format!("{route}{query}")
        };
        let url = match &self.chosen {
            Chosen::Linked(Source::Way(way)) => match way.needs() {
                Needs::Model(_) if *way == Way::Earlier => predictor(""),
                Needs::Model(set) => predictor(&format!("?features={set}")),
                Needs::Trials(family) => {
                    let route = routes::admin_sets(trial_id);
                    format!("{route}?family={}", family.name())
                }
                Needs::Nothing => {
                    self.known = Some(Known::default());
                    let learned = way.learned(None).map(|learned| Box::new(learned.into()));
                    return Ask::Nobody(learned.map_err(|invalid| invalid.to_string()));
                }
            },
            Chosen::Linked(source @ Source::Model { .. }) => {
                predictor(&format!("?{}", queried(source)))
            }
            Chosen::File => predictor(""),
        };
        let pane = self.pane;
        let then = move |answer| Msg::Predictor(pane, answer);
        Ask::Server(Command::Send(Request::get(pane.request(), url, then)))
    }

    /// The source to name in links. For a predictor from a file, it is the default source.
    pub(super) fn source(&self) -> Source {
        match &self.chosen {
            Chosen::Linked(source) => source.clone(),
            Chosen::File => Source::default(),
        }
    }

    /// The choice as part of a query. Empty for the default.
    pub(super) fn query(&self) -> String {
        let source = self.source();
        match self.pane {
            Pane::First if source == Source::default() => String::new(),
            Pane::First => queried(&source),
            Pane::Second => format!("beside={}", encoded(&source.name())),
        }
    }

    /// Ids of the trials that trained the predictor. Empty if they are unknown, and `None` until
    /// the predictor is loaded.
    pub(super) fn trained_on(&self) -> Option<&[String]> {
        self.known.as_ref().map(|known| &*known.trained_on)
    }

    /// How often the predictor's sets contain the future of the tasks that did not train it, if the
    /// server has counted this.
    pub(super) fn held(&self) -> Option<&Probabilities> {
        self.known.as_ref().and_then(|known| known.held.as_ref())
    }

    /// Explains whether the predictor was trained on the tasks over which the probabilities are
    /// counted.
    pub(super) fn judged_on(&self) -> &'static str {
        match &self.chosen {
            Chosen::File => "The file does not say which of them trained the predictor.",
            Chosen::Linked(_) => "None of them trained the predictor.",
        }
    }

    /// The caption of the predictor's picture.
    pub(super) fn caption(&self) -> String {
        match &self.chosen {
            Chosen::Linked(source) => source.caption(),
            Chosen::File => FROM_FILE.to_owned(),
        }
    }

    /// Chooses another predictor.
    pub(super) fn choose(&mut self, value: &FieldValue) {
        self.chosen = Chosen::Linked(Source::of("predictor", value.text()).unwrap_or_default());
        self.unusable = None;
    }

    /// Processes the server's answer. Returns the predictor or the sets, or why there are none.
    pub(super) fn arrived(&mut self, answer: Answer) -> Result<Method, String> {
        if let Chosen::Linked(Source::Way(way)) = &self.chosen
            && let Needs::Trials(_) = way.needs()
        {
            let LearnedSets { sets, trials, held } =
                read(answer).map_err(|failure| failure.sentence)?;
            self.known = Some(Known { trials, held, ..Known::default() });
            return Ok(sets.into());
        }
        let trained: TrainedPredictor = read(answer).map_err(|failure| failure.sentence)?;
        let TrainedPredictor { predictor, trials, fallback, source, trained_on } = trained;
        let learned = Predictor::try_from(predictor).and_then(|predictor| match &self.chosen {
            Chosen::Linked(Source::Way(way)) => way.learned(Some(predictor)),
            _ => Learned::usual(predictor),
        });
        self.known = Some(Known { trials, fallback, source, trained_on, features: 0, held: None });
        learned.map(Method::from).map_err(|invalid| invalid.to_string())
    }

    /// Processes the content of a file. If it is not a predictor of turns, only the error message
    /// changes.
    pub(super) fn open(&mut self, content: &FieldValue) -> Option<Learned> {
        match of_file(content.text()) {
            Ok(learned) => {
                let features = learned.predictor.features().len();
                (self.chosen, self.refused, self.unusable) = (Chosen::File, None, None);
                self.known = Some(Known { features, ..Known::default() });
                Some(learned)
            }
            Err(why) => {
                self.unusable = Some(format!("This file cannot be used. {why}"));
                None
            }
        }
    }

    /// Records why there is no predictor.
    pub(super) fn refuse(&mut self, why: &str) {
        self.known = None;
        self.refused = Some(format!("No predicted sets. {why}"));
    }
}

/// Parses a predictor of turns from the text of a predictor.json.
fn of_file(text: &str) -> Result<Learned, String> {
    if is_too_deep(text) {
        return Err(
            "It is nested too deep: expected a predictor.json, as analyses save it.".to_owned()
        );
    }
    let value: serde_json::Value = json::read(text.as_bytes())
        .ok_or("It is not JSON: expected a predictor.json, as analyses save it.")?;
    let file = from_value::<PredictorFile>(&value);
    let learned = file.and_then(PredictorFile::of_turns).and_then(|predictor| {
        let is_turn = |class: &i8| (-1..=1).contains(class);
        if predictor.classes().iter().all(is_turn) {
            return Learned::usual(predictor);
        }
        let expected = "some of -1 (right), 0 (straight) and 1 (left)";
        Err(Invalid::new("classes", expected, format!("{:?}", predictor.classes())))
    });
    learned.map_err(|invalid| invalid.to_string())
}

/// A source as part of a query.
fn queried(source: &Source) -> String {
    match source {
        Source::Way(way) => format!("predictor={}", way.name()),
        Source::Model { analysis, file } => named(analysis, file).query(),
    }
}

fn named(analysis: &str, file: &str) -> Named {
    Named { analysis: analysis.to_owned(), file: file.to_owned() }
}

/// The control that chooses the predictor, and facts about the predictor.
pub(super) fn section(
    choice: &Choice,
    offered: &Offered,
    trial: &TrialDetail,
    heading: &str,
) -> Node {
    let pane = choice.pane;
    let is_waiting = choice.known.is_none() && choice.refused.is_none();
    let words = match &choice.known {
        Some(known) => Some(about(choice, known)),
        None => is_waiting.then(|| el("p").attr("role", "status").text("Loading…")),
    };
    let id = pane.id("choose-predictor");
    let source = choice.known.as_ref().and_then(|known| known.source.as_ref());
    let file = el("input")
        .attrs(&[("type", "file"), ("accept", ".json,application/json")])
        .attr("id", pane.id("predictor-file"))
        .test_id(&pane.id("predictor-file"))
        .on_input(move |value| Msg::Open(pane, value));
    let label = el("label").attr("for", pane.id("predictor-file")).text("From a file");
    el("section")
        .child(el("h2").child(el("label").attr("for", &id).text(heading)))
        .child(list(choice, offered, trial).attr("id", &id))
        .children(source.map(|source| note(source, pane)))
        .children(words.map(|words| words.class("quiet").test_id(&pane.id("predictor"))))
        .children(choice.refused.as_deref().map(|why| alert(&pane.id("refused"), why)))
        .child(el("div").class("pair").child(label).child(file))
        .children(choice.unusable.as_deref().map(|why| alert(&pane.id("unusable"), why)))
        .children((pane == Pane::First).then(|| offered.hint(&trial.study)).flatten())
        .child(
            button(&pane.id("find-models"), Msg::Find(pane))
                .class("plain find")
                .text("Models of other people and studies…"),
        )
}

fn list(choice: &Choice, offered: &Offered, trial: &TrialDetail) -> Node {
    let pane = choice.pane;
    let entry = |way: &Way| {
        // The default predictor needs no name in a link.
        let value = if *way == Way::Earlier { "" } else { way.name() };
        let is_chosen = choice.chosen == Chosen::Linked(Source::Way(*way));
        option(value.to_owned(), is_chosen, way.label().to_owned()).attr("title", way.meaning())
    };
    let number = trial.summary.participant_number;
    let model = match &choice.chosen {
        Chosen::Linked(Source::Model { analysis, file }) => Some(named(analysis, file)),
        _ => None,
    };
    let source = choice.known.as_ref().and_then(|known| known.source.as_ref());
    let (learning, others): (Vec<Way>, Vec<Way>) =
        Way::ALL.into_iter().partition(|way| way.needs() != Needs::Nothing);
    let file = (choice.chosen == Chosen::File).then(|| {
        let words = "Opened here".to_owned();
        group("From a file".to_owned()).child(option("file".to_owned(), true, words))
    });
    el("select")
        .attr("name", pane.id("predictor"))
        .test_id(&pane.id("choose-predictor"))
        .on_input(move |value| Msg::Choose(pane, value))
        .child(group("During the study".to_owned()).children(learning.iter().map(entry)))
        .child(group("Without learning".to_owned()).children(others.iter().map(entry)))
        .children(groups(offered, model.as_ref(), source, number))
        .children(file)
}

/// Describes the predictor.
fn about(choice: &Choice, known: &Known) -> Node {
    if let Some(source) = &known.source {
        return described(source);
    }
    let way = match &choice.chosen {
        Chosen::Linked(Source::Way(way)) => *way,
        Chosen::Linked(Source::Model { .. }) => return el("p").text("A model of an analysis."),
        Chosen::File => {
            let n = known.features;
            let ending = if n == 1 { "" } else { "s" };
            return el("p").text(format!(
                "On {n} feature{ending}, from a file on this computer, which the link cannot hold."
            ));
        }
    };
    let words = match (way, &known.fallback, known.trials) {
        (way, ..) if way.needs() == Needs::Nothing => way.meaning().to_owned(),
        (_, Some(why), _) => format!("Frequencies of the inputs so far: {why}"),
        (Way::Earlier, None, 1) => {
            "Logistic regression (B_hrd), trained on the trial before".to_owned()
        }
        (Way::Earlier, None, n) => {
            format!("Logistic regression (B_hrd), trained on the {n} trials before")
        }
        (way, None, n) => {
            format!("{} Trained on the {} before.", way.meaning(), count(n, "trial"))
        }
    };
    el("p").text(words)
}

/// How the model is related to this trial. Warns if the model was trained on it.
fn note(source: &PredictorSource, pane: Pane) -> Node {
    let number = source.summary.participant;
    let words = match source.trial {
        TrialUse::Trained => {
            return el("p")
                .class("waiting")
                .attr("role", "note")
                .test_id(&pane.id("trained-on-this"))
                .text(
                    "This model was trained on this trial; its predictions look better here than \
                     they are.",
                );
        }
        TrialUse::HeldOut => "This trial was held out: the model was not trained on it.".to_owned(),
        TrialUse::Unused => "The analysis did not use this trial.".to_owned(),
        TrialUse::OtherParticipant => {
            format!("The model was trained on participant {number}, who did not drive this trial.")
        }
        TrialUse::OtherStudy => format!(
            "The model was trained on participant {number} of study {}, whose vehicles and scenes \
             may differ.",
            source.study
        ),
    };
    el("p").class("quiet").attr("role", "note").test_id(&pane.id("trial-use")).text(words)
}
