//! How a replay comes by its value functions: from the server, where it has solved
//! them, else from a solver beside this page.

use crate::runtime::{Command, Failure, Request, Solving, Tag};
use crate::view::{Node, el};
use sidestep::api::{TrialDetail, routes};
use sidestep::reachability::ValueFunction;
use sidestep::safety::SafetyLevels;
use sidestep::scene::Evader;

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
    fn ask(&mut self, trial: &TrialDetail) -> Command {
        self.state = State::Underway(0.0);
        match trial.value_function(self.evader) {
            Some(id) => {
                let tag = Tag::ValueFunction(self.evader);
                Command::Send(Request::get(tag, routes::value_function(id)))
            }
            None => {
                let game = trial.parameters.game(self.evader);
                Command::Solve { evader: self.evader, game }
            }
        }
    }

    fn take_octets(&mut self, octets: &[u8]) {
        self.state = match ValueFunction::decode(octets) {
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
    pub(super) fn begin(&mut self, trial: &TrialDetail) -> Vec<Command> {
        self.all_mut().map(|source| source.ask(trial)).collect()
    }

    /// Asks again for what is missing.
    pub(super) fn retry(&mut self, trial: &TrialDetail) -> Vec<Command> {
        let missing = self.all_mut().filter(|source| matches!(source.state, State::Missing(_)));
        missing.map(|source| source.ask(trial)).collect()
    }

    /// Gives up what is being solved here.
    pub(super) fn stop(&mut self) -> Vec<Command> {
        for source in self.all_mut() {
            if source.origin == Origin::Here && matches!(source.state, State::Underway(_)) {
                source.state = State::Missing("The solve was stopped.".to_owned());
            }
        }
        vec![Command::StopSolving]
    }

    /// What the server sent for `evader`, or why it did not.
    pub(super) fn take_answer(&mut self, evader: Evader, answer: Result<&[u8], &Failure>) {
        let asked = self.all_mut().find(|s| s.evader == evader && s.origin == Origin::Server);
        if let Some(source) = asked {
            match answer {
                Ok(octets) => source.take_octets(octets),
                Err(failure) => source.state = State::Missing(failure.sentence()),
            }
        }
    }

    /// What the solver says of `evader`; it may come too late.
    pub(super) fn take_solving(&mut self, evader: Evader, solving: Solving) {
        let waits = |s: &&mut Source| {
            s.evader == evader && s.origin == Origin::Here && matches!(s.state, State::Underway(_))
        };
        if let Some(source) = self.all_mut().find(waits) {
            match solving {
                Solving::Done(share) => source.state = State::Underway(share),
                Solving::Solved(octets) => source.take_octets(&octets),
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

    /// What is to be said over the scene: progress, or what went wrong.
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
                    "The server has none for these vehicles yet, so this browser works them out.",
                ))
                .child(button("stop-solving", "Stop")),
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
                        .text("Level sets and predicted sets are not drawn without them."),
                )
                .child(button("solve-again", "Try again")),
        )
}

fn button(word: &str, words: &str) -> Node {
    el("button").class("plain").attr("type", "button").action(word).test_id(word).text(words)
}
