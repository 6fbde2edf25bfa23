//! Where a replay gets its value functions: from the server if it has solved them, else from
//! a solver beside this page.

use super::Msg;
use crate::runtime::{Command, Commands, Failure, Request, Solving};
use crate::view::{self, el};
use sidestep::api::{TrialDetail, routes};
use sidestep::reachability::ValueFunction;
use sidestep::safety::SafetyLevels;
use sidestep::scene::Evader;
use std::rc::Rc;

type Node = view::Node<Msg>;

/// The functions of both roles, or how far each has come.
pub(super) struct Sources {
    human: Source,
    /// None where the human's function serves both roles.
    robot: Option<Source>,
}

/// Where one function is to come from, and whether it has.
struct Source {
    evader: Evader,
    origin: Origin,
    state: State,
}

/// Who finds a function.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Origin {
    Server,
    Here,
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
    fn new(trial: &TrialDetail, evader: Evader) -> Self {
        let origin = match trial.value_function(evader) {
            Some(_) => Origin::Server,
            None => Origin::Here,
        };
        Self { evader, origin, state: State::Underway(0.0) }
    }

    /// Begins, or begins again.
    fn ask(&mut self, trial: &TrialDetail) -> Command<Msg> {
        self.state = State::Underway(0.0);
        let evader = self.evader;
        match trial.value_function(evader) {
            Some(id) => {
                let url = routes::value_function(id);
                let then = move |answer| Msg::ValueFunction(evader, answer);
                Command::Send(Request::get(self.name(), url, then))
            }
            None => {
                let then = Rc::new(move |solving| Msg::Solving(evader, solving));
                Command::Solve { name: self.name(), game: trial.parameters.game(evader), then }
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

    fn take_bytes(&mut self, bytes: &[u8]) {
        self.state = match ValueFunction::decode(bytes) {
            Ok(function) => State::Known(function),
            Err(invalid) => State::Missing(invalid.to_string()),
        };
    }
}

impl Sources {
    /// Nothing is there, and nothing asked for.
    pub(super) fn new(trial: &TrialDetail) -> Self {
        let [human, robot] = Evader::ALL.map(|evader| Source::new(trial, evader));
        let ids = Evader::ALL.map(|evader| trial.value_function(evader));
        let games = Evader::ALL.map(|evader| trial.parameters.game(evader));
        let same = ids[0] == ids[1] && (ids[0].is_some() || games[0] == games[1]);
        Self { human, robot: (!same).then_some(robot) }
    }

    fn all(&self) -> impl Iterator<Item = &Source> {
        [&self.human].into_iter().chain(&self.robot)
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut Source> {
        [&mut self.human].into_iter().chain(&mut self.robot)
    }

    /// Asks for everything.
    pub(super) fn begin(&mut self, trial: &TrialDetail) -> Commands<Msg> {
        self.all_mut().map(|source| source.ask(trial)).collect()
    }

    /// Asks again for what is missing.
    pub(super) fn retry(&mut self, trial: &TrialDetail) -> Commands<Msg> {
        let missing = self.all_mut().filter(|source| matches!(source.state, State::Missing(_)));
        missing.map(|source| source.ask(trial)).collect()
    }

    /// Gives up what is being solved here.
    pub(super) fn stop(&mut self) -> Commands<Msg> {
        let solving = self.all_mut().filter(|source| {
            source.origin == Origin::Here && matches!(source.state, State::Underway(_))
        });
        let stop = |source: &mut Source| {
            source.state = State::Missing("The solve was stopped.".to_owned());
            Command::Cancel(source.name())
        };
        solving.map(stop).collect()
    }

    /// What the server sent for `evader`, or why it did not.
    pub(super) fn take_answer(&mut self, evader: Evader, answer: Result<&[u8], Failure>) {
        let asked = self.all_mut().find(|s| s.evader == evader && s.origin == Origin::Server);
        if let Some(source) = asked {
            match answer {
                Ok(bytes) => source.take_bytes(bytes),
                Err(failure) => source.state = State::Missing(failure.sentence()),
            }
        }
    }

    /// What the solver reports on `evader`; it may come too late.
    pub(super) fn take_solving(&mut self, evader: Evader, solving: Solving) {
        let waits = |s: &&mut Source| {
            s.evader == evader && s.origin == Origin::Here && matches!(s.state, State::Underway(_))
        };
        if let Some(source) = self.all_mut().find(waits) {
            match solving {
                Solving::Done(share) => source.state = State::Underway(share),
                Solving::Solved(bytes) => source.take_bytes(&bytes),
                Solving::Failed(why) => source.state = State::Missing(why),
            }
        }
    }

    /// Both functions, once they are here.
    pub(super) fn functions(&self) -> Option<SafetyLevels> {
        let known = |source: &Source| match &source.state {
            State::Known(function) => Some(function.clone()),
            _ => None,
        };
        let human = known(&self.human)?;
        let robot = match &self.robot {
            Some(robot) => known(robot)?,
            None => human.clone(),
        };
        Some(SafetyLevels { human, robot })
    }

    /// Why there will be no functions, if one did not come.
    pub(super) fn missing(&self) -> Option<&str> {
        self.all().find_map(|source| match &source.state {
            State::Missing(why) => Some(why.as_str()),
            _ => None,
        })
    }

    /// Where they come from, for the facts of the trial.
    pub(super) fn words(&self) -> &'static str {
        let any = |holds: fn(&Source) -> bool| self.all().any(holds);
        if self.missing().is_some() {
            "none"
        } else if any(|s| matches!(s.state, State::Underway(_))) {
            "…"
        } else if any(|s| matches!(s.state, State::Known(ValueFunction::Exact(_)))) {
            "closed form"
        } else if any(|s| s.origin == Origin::Here) {
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
        let here = self.all().filter(|source| source.origin == Origin::Here);
        let shares: Vec<f64> = here
            .map(|source| match source.state {
                State::Underway(share) => share,
                _ => 1.0,
            })
            .collect();
        let underway = shares.iter().any(|&share| share < 1.0);
        let share = shares.iter().sum::<f64>() / shares.len() as f64;
        underway.then(|| progress((100.0 * share) as u32))
    }
}

fn progress(percent: u32) -> Node {
    let bar = el("progress")
        .attr("max", 100)
        .attr("value", percent)
        .attr("aria-label", "Solving the safety levels");
    el("div")
        .class("notice")
        .test_id("solving")
        .child(
            el("p")
                .child(el("span").attr("role", "status").text("Solving the safety levels"))
                .child(el("span").test_id("solved-percent").text(format!("{percent} %"))),
        )
        .child(bar)
        .child(
            el("p")
                .child(el("span").class("quiet").text(
                    "The server has not solved these vehicles’ games yet, so this browser does.",
                ))
                .child(button("stop-solving", "Stop", Msg::StopSolving)),
        )
}

fn trouble(why: &str) -> Node {
    el("div")
        .class("notice lasting")
        .test_id("unsolved")
        .child(el("p").attr("role", "alert").text(format!("No safety levels. {why}")))
        .child(
            el("p")
                .child(
                    el("span")
                        .class("quiet")
                        .text("Level sets and predicted sets cannot be drawn without them."),
                )
                .child(button("solve-again", "Try again", Msg::SolveAgain)),
        )
}

fn button(name: &str, words: &str, message: Msg) -> Node {
    el("button").class("plain").attr("type", "button").test_id(name).on_press(message).text(words)
}
