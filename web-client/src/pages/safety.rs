//! The value functions of a page that draws scenes. They come from the server if it has solved
//! them, and otherwise from a solver in a worker.

use super::parts::button;
use crate::runtime::{Answer, Command, Commands, Request, Solving};
use crate::view::{Node, el};
use sidestep::api::routes;
use sidestep::reachability::{PursuitGame, ValueFunction};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, SceneParameters};
use std::rc::Rc;

/// The value functions of a scene, one for each evading vehicle, or the progress of loading them. A
/// single function can serve both vehicles.
pub(super) struct Sources<M> {
    sources: Vec<Source>,
    /// Converts a report of the server or a solver to a message.
    report: fn(Evader, Solving) -> M,
}

/// Where one function comes from, and the progress of loading it.
struct Source {
    evader: Evader,
    /// The function's id on the server. `None` if a solver of this page must compute it.
    id: Option<String>,
    game: PursuitGame,
    state: State,
}

enum State {
    /// In progress, with the fraction done.
    Underway(f64),
    /// Loaded.
    Known(ValueFunction),
    /// Failed, for this reason.
    Missing(String),
}

impl Source {
    /// Requests or solves the function, possibly again.
    fn ask<M: 'static>(&mut self, report: fn(Evader, Solving) -> M) -> Command<M> {
        self.state = State::Underway(0.0);
        let (name, evader) = (self.name(), self.evader);
        match &self.id {
            Some(id) => {
                let then = move |answer: Answer| match answer {
                    Ok(bytes) => report(evader, Solving::Solved(bytes)),
                    Err(failure) => report(evader, Solving::Failed(failure.sentence)),
                };
                Command::Send(Request::get(name, routes::value_function(id), then))
            }
            None => {
                let then = Rc::new(move |solving| report(evader, solving));
                Command::Solve { name, task: self.game.into(), then }
            }
        }
    }

    /// The name of the function's request or solve.
    fn name(&self) -> &'static str {
        match self.evader {
            Evader::Human => "value-function-human",
            Evader::Robot => "value-function-robot",
        }
    }

    fn is_underway(&self) -> bool {
        matches!(self.state, State::Underway(_))
    }

    fn is_solved_here(&self) -> bool {
        self.id.is_none()
    }
}

impl<M: Clone + 'static> Sources<M> {
    /// Creates the sources without sending any requests. `ids` are the ids of V_HR and V_RH on the
    /// server, if the server has solved them.
    pub(super) fn new(
        parameters: &SceneParameters,
        ids: [Option<&str>; 2],
        report: fn(Evader, Solving) -> M,
    ) -> Self {
        let games = Evader::ALL.map(|evader| parameters.game(evader));
        let one_serves_both = ids[0] == ids[1] && (ids[0].is_some() || games[0] == games[1]);
        let all = Evader::ALL.into_iter().zip(ids).zip(games);
        let source = |((evader, id), game): ((Evader, Option<&str>), PursuitGame)| Source {
            evader,
            id: id.map(str::to_owned),
            game,
            state: State::Underway(0.0),
        };
        let sources = all.take(if one_serves_both { 1 } else { 2 }).map(source).collect();
        Self { sources, report }
    }

    /// Requests or solves all functions.
    pub(super) fn begin(&mut self) -> Commands<M> {
        self.sources.iter_mut().map(|source| source.ask(self.report)).collect()
    }

    /// Requests or solves the missing functions again.
    pub(super) fn retry(&mut self) -> Commands<M> {
        let missing = self.sources.iter_mut().filter(|s| matches!(s.state, State::Missing(_)));
        missing.map(|source| source.ask(self.report)).collect()
    }

    /// Cancels the solves of this page.
    pub(super) fn stop(&mut self) -> Commands<M> {
        let solving = self.sources.iter_mut().filter(|s| s.is_solved_here() && s.is_underway());
        let stop = |source: &mut Source| {
            source.state = State::Missing("The solve was stopped.".to_owned());
            Command::Cancel(source.name())
        };
        solving.map(stop).collect()
    }

    /// Processes a report from the server or the solver about the function in which `evader`
    /// evades. Ignores outdated reports.
    pub(super) fn take(&mut self, evader: Evader, solving: Solving) {
        let source = self.sources.iter_mut().find(|s| s.evader == evader && s.is_underway());
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

    /// Returns both functions as soon as they are loaded.
    pub(super) fn functions(&self) -> Option<SafetyLevels> {
        let known = |source: &Source| match &source.state {
            State::Known(function) => Some(function.clone()),
            _ => None,
        };
        let human = known(self.sources.first()?)?;
        let robot = self.sources.get(1).map_or_else(|| Some(human.clone()), known)?;
        Some(SafetyLevels { human, robot })
    }

    /// The reason why the functions are unavailable, if loading or solving one has failed.
    pub(super) fn missing(&self) -> Option<&str> {
        self.sources.iter().find_map(|source| match &source.state {
            State::Missing(why) => Some(why.as_str()),
            _ => None,
        })
    }

    /// Where the functions come from, in words, for the facts about the trial.
    pub(super) fn words(&self) -> &'static str {
        let any = |holds: fn(&Source) -> bool| self.sources.iter().any(holds);
        if self.missing().is_some() {
            "none"
        } else if any(Source::is_underway) {
            "…"
        } else if any(|s| matches!(s.state, State::Known(ValueFunction::Exact(_)))) {
            "closed form"
        } else if any(Source::is_solved_here) {
            "solved in this browser"
        } else {
            "solved by the server"
        }
    }

    /// The notice over the scene. It shows the progress, or an error message, with buttons that
    /// send `stop` or `again`.
    pub(super) fn notice(&self, stop: M, again: M) -> Option<Node<M>> {
        if let Some(why) = self.missing() {
            return Some(trouble(why, again));
        }
        let here = self.sources.iter().filter(|source| source.is_solved_here());
        let share = |source: &Source| match source.state {
            State::Underway(share) => share,
            _ => 1.0,
        };
        let shares: Vec<f64> = here.map(share).collect();
        let share = shares.iter().sum::<f64>() / shares.len() as f64;
        shares.iter().any(|&share| share < 1.0).then(|| progress((100.0 * share) as u32, stop))
    }
}

fn progress<M>(percent: u32, stop: M) -> Node<M> {
    let heading = el("p")
        .child(el("span").attr("role", "status").text("Solving the safety levels"))
        .child(el("span").test_id("solved-percent").text(format!("{percent} %")));
    let bar = el("progress")
        .attrs(&[("max", "100"), ("aria-label", "Solving the safety levels")])
        .attr("value", percent);
    let why = "The server has not solved the games of these vehicles, so this browser does.";
    let stop = button("stop-solving", stop).class("plain").text("Stop");
    el("div").class("notice").test_id("solving").children([heading, bar, advice(why, stop)])
}

fn trouble<M>(why: &str, again: M) -> Node<M> {
    let what = el("p").attr("role", "alert").text(format!("No safety levels. {why}"));
    let needs = "Level sets and predicted sets cannot be drawn without them.";
    let again = button("solve-again", again).class("plain").text("Try again");
    el("div").class("notice lasting").test_id("unsolved").children([what, advice(needs, again)])
}

fn advice<M>(words: &str, action: Node<M>) -> Node<M> {
    el("p").child(el("span").class("quiet").text(words)).child(action)
}
