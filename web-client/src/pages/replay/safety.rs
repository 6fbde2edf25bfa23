//! Where a replay gets its value functions: from the server if it has solved them, otherwise
//! from a solver beside this page.

use super::Msg;
use crate::pages::parts::button;
use crate::runtime::{Answer, Command, Commands, Request, Solving};
use crate::view::{self, el};
use sidestep::api::{TrialDetail, routes};
use sidestep::reachability::ValueFunction;
use sidestep::safety::SafetyLevels;
use sidestep::scene::Evader;
use std::rc::Rc;

type Node = view::Node<Msg>;

/// The functions of both vehicles as evaders, or how far each has come. One alone serves both.
pub(super) struct Sources(Vec<Source>);

/// Where one function comes from, and how far it has come.
struct Source {
    evader: Evader,
    /// Whether a solver beside this page finds it.
    is_solved_here: bool,
    state: State,
}

enum State {
    /// Under way; the share that is done.
    Underway(f64),
    /// It is here.
    Known(ValueFunction),
    /// It did not come, for this reason.
    Missing(String),
}

impl Source {
    /// Begins, or begins again.
    fn ask(&mut self, trial: &TrialDetail) -> Command<Msg> {
        self.state = State::Underway(0.0);
        let evader = self.evader;
        let report = move |solving| Msg::ValueFunction(evader, solving);
        match trial.value_function(evader) {
            Some(id) => {
                let then = move |answer: Answer| match answer {
                    Ok(bytes) => report(Solving::Solved(bytes)),
                    Err(failure) => report(Solving::Failed(failure.sentence)),
                };
                Command::Send(Request::get(self.name(), routes::value_function(id), then))
            }
            None => {
                let game = trial.parameters.game(evader);
                Command::Solve { name: self.name(), game, then: Rc::new(report) }
            }
        }
    }

    /// The name of its request or solve.
    fn name(&self) -> &'static str {
        match self.evader {
            Evader::Human => "value-function-human",
            Evader::Robot => "value-function-robot",
        }
    }

    fn is_underway(&self) -> bool {
        matches!(self.state, State::Underway(_))
    }
}

impl Sources {
    /// Nothing is there, and nothing was asked for.
    pub(super) fn new(trial: &TrialDetail) -> Self {
        let [human, robot] = Evader::ALL.map(|evader| trial.value_function(evader));
        let games = Evader::ALL.map(|evader| trial.parameters.game(evader));
        let one_serves_both = human == robot && (human.is_some() || games[0] == games[1]);
        let evaders = if one_serves_both { &Evader::ALL[..1] } else { &Evader::ALL };
        let source = |&evader: &Evader| Source {
            evader,
            is_solved_here: trial.value_function(evader).is_none(),
            state: State::Underway(0.0),
        };
        Self(evaders.iter().map(source).collect())
    }

    /// Asks for everything.
    pub(super) fn begin(&mut self, trial: &TrialDetail) -> Commands<Msg> {
        self.0.iter_mut().map(|source| source.ask(trial)).collect()
    }

    /// Asks again for what is missing.
    pub(super) fn retry(&mut self, trial: &TrialDetail) -> Commands<Msg> {
        let missing = self.0.iter_mut().filter(|s| matches!(s.state, State::Missing(_)));
        missing.map(|source| source.ask(trial)).collect()
    }

    /// Cancels what is being solved here.
    pub(super) fn stop(&mut self) -> Commands<Msg> {
        let solving = self.0.iter_mut().filter(|s| s.is_solved_here && s.is_underway());
        let stop = |source: &mut Source| {
            source.state = State::Missing("The solve was stopped.".to_owned());
            Command::Cancel(source.name())
        };
        solving.map(stop).collect()
    }

    /// Takes what the server or the solver reports on `evader`; it may come too late.
    pub(super) fn take(&mut self, evader: Evader, solving: Solving) {
        let source = self.0.iter_mut().find(|s| s.evader == evader && s.is_underway());
        if let Some(source) = source {
            source.state = match solving {
                Solving::Done(share) => State::Underway(share),
                Solving::Solved(bytes) => match ValueFunction::decode(&bytes) {
                    Ok(function) => State::Known(function),
                    Err(invalid) => State::Missing(invalid.to_string()),
                },
                Solving::Failed(why) => State::Missing(why),
            };
        }
    }

    /// Both functions, once they are here.
    pub(super) fn functions(&self) -> Option<SafetyLevels> {
        let known = |source: &Source| match &source.state {
            State::Known(function) => Some(function.clone()),
            _ => None,
        };
        let human = known(self.0.first()?)?;
        let robot = self.0.get(1).map_or_else(|| Some(human.clone()), known)?;
        Some(SafetyLevels { human, robot })
    }

    /// Why there will be no functions, if one did not come.
    pub(super) fn missing(&self) -> Option<&str> {
        self.0.iter().find_map(|source| match &source.state {
            State::Missing(why) => Some(why.as_str()),
            _ => None,
        })
    }

    /// Where they come from, for the facts of the trial.
    pub(super) fn words(&self) -> &'static str {
        let any = |holds: fn(&Source) -> bool| self.0.iter().any(holds);
        if self.missing().is_some() {
            "none"
        } else if any(Source::is_underway) {
            "…"
        } else if any(|s| matches!(s.state, State::Known(ValueFunction::Exact(_)))) {
            "closed form"
        } else if any(|s| s.is_solved_here) {
            "solved in this browser"
        } else {
            "solved by the server"
        }
    }

    /// The note over the scene: progress, or what went wrong.
    pub(super) fn notice(&self) -> Option<Node> {
        if let Some(why) = self.missing() {
            return Some(trouble(why));
        }
        let here = self.0.iter().filter(|source| source.is_solved_here);
        let share = |source: &Source| match source.state {
            State::Underway(share) => share,
            _ => 1.0,
        };
        let shares: Vec<f64> = here.map(share).collect();
        let share = shares.iter().sum::<f64>() / shares.len() as f64;
        shares.iter().any(|&share| share < 1.0).then(|| progress((100.0 * share) as u32))
    }
}

fn progress(percent: u32) -> Node {
    let heading = el("p")
        .child(el("span").attr("role", "status").text("Solving the safety levels"))
        .child(el("span").test_id("solved-percent").text(format!("{percent} %")));
    let bar = el("progress")
        .attrs(&[("max", "100"), ("aria-label", "Solving the safety levels")])
        .attr("value", percent);
    let why = "The server has not yet solved the games of these vehicles, so this browser does.";
    let stop = button("stop-solving", Msg::StopSolving).class("plain").text("Stop");
    el("div").class("notice").test_id("solving").children([heading, bar, advice(why, stop)])
}

fn trouble(why: &str) -> Node {
    let what = el("p").attr("role", "alert").text(format!("No safety levels. {why}"));
    let needs = "Level sets and predicted sets cannot be drawn without them.";
    let again = button("solve-again", Msg::SolveAgain).class("plain").text("Try again");
    el("div").class("notice lasting").test_id("unsolved").children([what, advice(needs, again)])
}

fn advice(words: &str, action: Node) -> Node {
    el("p").child(el("span").class("quiet").text(words)).child(action)
}
