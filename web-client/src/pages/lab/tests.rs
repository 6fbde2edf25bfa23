//! The laboratory without a browser.

use super::{Lab, Msg};
use crate::form::{FieldValue, Form};
use crate::runtime::{
    Address, Answer, Command, Commands, Event, Page, PageContext, Request, Solving,
};
use crate::shape::{ColourToken, Shape};
use sidestep::api::{TrialDetail, TrialPage, TrialSummary, routes};
use sidestep::reachability::{PursuitGame, SampledValue, ValueFunction, polar};
use sidestep::safety::{SafetyLevels, value_function};
use sidestep::scene::{Evader, Scene, SceneParameters};
use sidestep::trial::{Phase, outcome, simulate, verify};
use sidestep::vehicle::{Pose, TurnInput};
use std::ops::ControlFlow;
use std::rc::Rc;
use std::sync::LazyLock;

/// The paper's vehicles, but for a robot that turns more slowly.
fn unequal() -> SceneParameters {
    let mut parameters = SceneParameters::default();
    parameters.robot.turn_rate_radps = 0.35;
    parameters
}

/// Its functions, solved once for all tests.
static SOLVED: LazyLock<SafetyLevels> =
    LazyLock::new(|| SafetyLevels::solve(&unequal(), &mut |_| ControlFlow::Continue(())).unwrap());

fn trial(parameters: SceneParameters, ids: [Option<String>; 2]) -> TrialDetail {
    let scene = Scene::new(&parameters, Pose::new(-8.0, 0.0, 0.0), Pose::new(8.0, 1.0, 3.1));
    let inputs = vec![TurnInput::Straight; parameters.steps];
    let states = simulate(&parameters, scene.start(), &inputs);
    let [value_function_hr, value_function_rh] = ids;
    TrialDetail {
        summary: TrialSummary {
            trial_id: "t".into(),
            participant_id: "p".into(),
            participant_number: 1,
            phase: Phase::Task,
            index: 0,
            received_at_ms: 0,
            outcome: outcome(&parameters, &inputs, &states),
            flags: Vec::new(),
        },
        study: "default".into(),
        parameters,
        scene,
        replay: verify(&parameters, scene.start(), &inputs, &states),
        inputs,
        states,
        value_function_hr,
        value_function_rh,
    }
}

type Report = Rc<dyn Fn(Solving) -> Msg>;

/// The laboratory in a browser of few lines.
struct Session {
    lab: Lab,
    /// What is asked of the server and not answered yet.
    asked: Vec<Request<Msg>>,
    /// What solvers work on, under the name of the solve.
    solving: Vec<(&'static str, PursuitGame, Report)>,
    /// Where the page went, without and with leaving the document.
    visited: Vec<String>,
    left: Option<String>,
}

fn address(path: &str) -> Address {
    let (path, query) = path.split_once("?study=").map_or((path, None), |(p, s)| (p, Some(s)));
    let (path, fragment) = path.split_once('#').unwrap_or((path, ""));
    let query = query.map(|slug| ("study".to_owned(), slug.to_owned()));
    Address { path: path.into(), query: query.into_iter().collect(), fragment: fragment.into() }
}

impl Session {
    /// The laboratory at this address, before the server has said anything.
    fn start(path: &str) -> Self {
        let context = PageContext { address: address(path), ..PageContext::default() };
        let (lab, commands) = Lab::open(context);
        let mut session =
            Self { lab, asked: Vec::new(), solving: Vec::new(), visited: Vec::new(), left: None };
        session.apply(commands);
        session
    }

    /// The same, signed in.
    fn at(path: &str) -> Self {
        let mut session = Self::start(path);
        session.answer("session", 200, br#"{"signed_in":true}"#);
        session
    }

    /// A replay of this trial.
    fn open(trial: &TrialDetail) -> Self {
        let mut session = Self::at("/lab/replay/t");
        session.answer("trial", 200, &serde_json::to_vec(trial).unwrap());
        session
    }

    fn apply(&mut self, commands: Commands<Msg>) {
        for command in commands {
            match command {
                Command::Send(request) => {
                    self.cancel(|name| name == request.name);
                    self.asked.push(request);
                }
                Command::Solve { name, game, then } => {
                    self.cancel(|other| other == name);
                    self.solving.push((name, game, then));
                }
                Command::Cancel(name) => self.cancel(|other| other == name),
                Command::CancelAll => self.cancel(|_| true),
                Command::Visit(url) | Command::ReplaceAddress(url) => self.visited.push(url),
                Command::Leave(url) => self.left = Some(url),
                _ => panic!("the laboratory asks for nothing else"),
            }
        }
    }

    fn cancel(&mut self, named: impl Fn(&str) -> bool) {
        self.asked.retain(|request| !named(request.name));
        self.solving.retain(|(name, ..)| !named(name));
    }

    fn tell(&mut self, message: Msg) {
        let commands = self.lab.update(message, 0.0);
        self.apply(commands);
    }

    fn go(&mut self, path: &str) {
        let message = self.lab.hear(&Event::Address(address(path))).unwrap();
        self.tell(message);
    }

    fn take(&mut self, name: &str) -> Request<Msg> {
        let at = self.asked.iter().position(|request| request.name == name);
        let names: Vec<_> = self.asked.iter().map(|request| request.name).collect();
        self.asked.remove(at.unwrap_or_else(|| panic!("no {name} in {names:?}")))
    }

    fn answer(&mut self, name: &str, status: u16, body: &[u8]) {
        let request = self.take(name);
        self.tell((request.then)(Answer::Received { status, body: body.to_vec() }));
    }

    fn unreachable(&mut self, name: &str) {
        let request = self.take(name);
        self.tell((request.then)(Answer::Unreachable));
    }

    /// The solver of this vehicle's game reports.
    fn hear(&mut self, evader: Evader, solving: Solving) {
        let at = self.solving.iter().position(|(name, ..)| *name == of(evader)).unwrap();
        let message = (self.solving[at].2)(solving.clone());
        if !matches!(solving, Solving::Done(_)) {
            self.solving.remove(at);
        }
        self.tell(message);
    }

    fn press(&mut self, name: &str) {
        let message = self.lab.view().press(name);
        self.tell(message.unwrap_or_else(|| panic!("no {name} in: {}", self.lab.view().words())));
    }

    fn words(&self, test_id: &str) -> Option<String> {
        self.lab.view().find(test_id).map(crate::view::Node::words)
    }

    fn urls(&self) -> Vec<&str> {
        self.asked.iter().map(|request| request.url.as_str()).collect()
    }

    fn games(&self) -> Vec<(&str, PursuitGame)> {
        self.solving.iter().map(|(name, game, _)| (*name, *game)).collect()
    }

    /// Outlines of level sets, of V_HR and of V_RH.
    fn outlines(&self) -> [usize; 2] {
        let picture = self.lab.picture().unwrap();
        [ColourToken::Human, ColourToken::Robot].map(|colour| {
            let is_outline = |shape: &&Shape| match shape {
                Shape::Polygon { stroke: Some(stroke), points, .. } => {
                    stroke.colour == colour && stroke.dash_px.is_some() && points.len() > 10
                }
                _ => false,
            };
            picture.shapes.iter().filter(is_outline).count()
        })
    }
}

/// The name under which a vehicle's value function is asked for or solved.
fn of(evader: Evader) -> &'static str {
    match evader {
        Evader::Human => "value-function-human",
        Evader::Robot => "value-function-robot",
    }
}

/// One study, or two, as the server lists them.
const ONE: &[u8] = br#"[{"slug":"default","title":"Study","participants":1,"trials":1}]"#;
const TWO: &[u8] = br#"[{"slug":"default","title":"Study","participants":1,"trials":1},
    {"slug":"second","title":"Pilot","participants":9,"trials":22}]"#;

/// A page of trials with these ids, as the server lists them.
fn listed(ids: &[&str], next_before: Option<i64>) -> Vec<u8> {
    let summary = trial(unequal(), [None, None]).summary;
    let trials = ids.iter().map(|id| TrialSummary { trial_id: (*id).into(), ..summary.clone() });
    serde_json::to_vec(&TrialPage { trials: trials.collect(), next_before }).unwrap()
}

#[test]
fn a_study_is_shown_with_its_trials_or_not_yet() {
    for (ids, table) in [(&["t"][..], true), (&[], false)] {
        let mut session = Session::at("/lab");
        session.answer("studies", 200, ONE);
        let view = session.lab.view();
        assert!(view.find("trials").is_none() && view.words().contains("Loading"));
        session.answer("trials", 200, &listed(ids, None));
        let view = session.lab.view();
        assert_eq!(view.find("trials").is_some(), table);
        assert_eq!(view.words().contains("No trials yet"), !table);
        assert!(view.find("study").is_none(), "one study needs no choice");
    }
}

#[test]
fn every_study_can_be_chosen() {
    let mut session = Session::at("/lab");
    session.answer("studies", 200, TWO);
    session.answer("trials", 200, &listed(&["t"], None));
    let view = session.lab.view();
    assert!(view.find("study").unwrap().words().contains("Pilot (22 trials)"));
    let choice = FieldValue::Text("second".into());
    session.tell(view.enter("study", choice).unwrap());
    assert_eq!(session.visited, ["/lab?study=second"]);
    session.go("/lab?study=second");
    session.answer("studies", 200, TWO);
    assert!(session.urls()[0].starts_with(&routes::admin_trials("second")));
    session.answer("trials", 200, &listed(&["u"], None));
    assert!(session.lab.view().words().contains("9 participants · 22 stored trials"));
    assert_eq!(session.lab.title(), "Pilot · Sidestep laboratory");
    session.go("/lab?study=third");
    session.answer("studies", 200, TWO);
    let why = session.words("stuck").unwrap();
    assert!(why.contains("third") && why.contains("default, second"), "{why}");
}

#[test]
fn older_trials_come_once_however_often_they_are_asked_for() {
    let mut session = Session::at("/lab");
    session.answer("studies", 200, ONE);
    session.answer("trials", 200, &listed(&["b"], Some(7)));
    let more = session.lab.view().press("more").unwrap();
    session.tell(more.clone());
    session.tell(more);
    assert_eq!(session.urls().len(), 1);
    assert!(session.urls()[0].ends_with("&before=7"), "{:?}", session.urls());
    assert!(session.lab.view().press("more").is_none(), "the button is off meanwhile");
    session.answer("trials", 200, &listed(&["a"], None));
    let table = session.words("trials").unwrap();
    assert_eq!(table.matches("Replay").count(), 3, "the column and two rows: {table}");
    assert!(session.words("more").is_none());
}

#[test]
fn what_a_page_asked_for_is_no_matter_to_the_next() {
    let mut session = Session::at("/lab");
    let late = session.take("studies");
    let late = (late.then)(Answer::Received { status: 200, body: ONE.to_vec() });
    session.go("/lab/self-check");
    session.go("/lab");
    session.tell(late);
    assert_eq!(session.urls(), [routes::ADMIN_STUDIES], "only this visit's request");
    assert!(session.lab.view().words().contains("Loading"));
}

#[test]
fn an_address_without_a_page_says_so() {
    let mut session = Session::at("/lab/nothing");
    assert!(session.words("stuck").unwrap().contains("no page at this address"));
    session.go("/lab/self-check");
    assert_eq!(session.urls(), [routes::SELF_CHECK]);
    for elsewhere in ["/s/default", "/laboratory"] {
        assert!(session.lab.hear(&Event::Address(address(elsewhere))).is_none(), "{elsewhere}");
    }
}

#[test]
fn a_pasted_link_signs_in_wherever_one_is() {
    let mut session = Session::start("/lab");
    session.answer("session", 401, b"{}");
    assert!(session.words("key").is_some() && session.words("trouble").is_none());
    session.go("/lab#key=secret");
    assert_eq!(session.visited, ["/lab"], "the key leaves the address");
    let request = session.take("session");
    assert_eq!((request.method, request.body.as_deref()), ("POST", Some(r#"{"key":"secret"}"#)));
    session.tell((request.then)(Answer::Received { status: 200, body: b"{}".to_vec() }));
    assert_eq!(session.urls(), [routes::ADMIN_STUDIES]);
}

#[test]
fn a_wrong_key_is_called_so() {
    let mut session = Session::start("/lab");
    session.answer("session", 401, b"{}");
    let form = Form::new(vec![("key".into(), FieldValue::Text(" wrong ".into()))]);
    session.tell(session.lab.view().submit("sign-in-form", form).unwrap());
    assert!(session.lab.view().find("sign-in").unwrap().attribute("disabled").is_some());
    session.answer("session", 401, br#"{"code":"unauthorized","message":"no"}"#);
    assert_eq!(session.words("trouble").unwrap(), "That key is not valid.");
    assert!(session.lab.view().find("sign-in").unwrap().attribute("disabled").is_none());
}

#[test]
fn one_leaves_only_once_one_is_signed_out() {
    let mut session = Session::at("/lab");
    session.press("sign-out");
    assert_eq!(session.left, None);
    session.unreachable("session");
    assert_eq!(session.left, None);
    assert!(session.words("trouble").unwrap().contains("still signed in"));
    session.press("sign-out");
    session.answer("session", 204, b"");
    assert_eq!(session.left.as_deref(), Some("/"));
}

#[test]
fn the_servers_solution_is_used_where_there_is_one() {
    let ids = Evader::ALL.map(|evader| Some(SOLVED.of(evader).id()));
    let mut session = Session::open(&trial(unequal(), ids.clone()));
    for id in ids.iter().flatten() {
        assert!(session.urls().contains(&routes::value_function(id).as_str()));
    }
    assert_eq!(session.games(), []);
    assert_eq!(session.words("solving"), None);
    session.answer(of(Evader::Robot), 200, &SOLVED.robot.encode());
    assert_eq!(session.outlines(), [0, 0]);
    session.answer(of(Evader::Human), 200, &SOLVED.human.encode());
    let [human, robot] = session.outlines();
    assert!(human >= 1 && robot >= 1);
    assert!(session.words("safety-levels").unwrap().contains("solved by the server"));
}

#[test]
fn equal_vehicles_take_one_request() {
    let parameters = SceneParameters::default();
    let function = ValueFunction::Exact(parameters.game(Evader::Human).exact().unwrap());
    let id = Some(function.id());
    let mut session = Session::open(&trial(parameters, [id.clone(), id]));
    assert_eq!(session.asked.len(), 2, "the function and the predictor: {:?}", session.urls());
    session.answer(of(Evader::Human), 200, &function.encode());
    assert_eq!(session.outlines(), [1, 1]);
    assert!(session.words("safety-levels").unwrap().contains("closed form"));
}

#[test]
fn predicted_sets_are_drawn_whole_or_step_by_step() {
    let parameters = SceneParameters::default();
    let function = ValueFunction::Exact(parameters.game(Evader::Human).exact().unwrap());
    let id = Some(function.id());
    let mut session = Session::open(&trial(parameters, [id.clone(), id]));
    session.answer(of(Evader::Human), 200, &function.encode());
    let predictor = r#"{"format":"sidestep-predictor/1","kind":"constant","features":["distance"],
        "classes":[-1,0,1],"probabilities":[0.6,0.3,0.1]}"#;
    let trained = format!(r#"{{"predictor":{predictor},"trials":7,"fallback":null}}"#);
    session.answer("predictor", 200, trained.as_bytes());
    // How many areas each set has, from F_1 to F_5.
    let areas = |session: &Session| {
        let mut counts = [0; 5];
        for shape in session.lab.picture().unwrap().shapes {
            if let Shape::Polygon { fill: Some((ColourToken::Region(j), _)), points, .. } = shape {
                assert!(!points.is_empty());
                counts[j] += 1;
            }
        }
        counts
    };
    let pressed = |session: &Session| {
        let view = session.lab.view();
        view.find("by-step").unwrap().attribute("aria-pressed") == Some("true")
    };
    assert_eq!((areas(&session), pressed(&session)), ([1; 5], false));
    session.press("by-step");
    assert_eq!((areas(&session), pressed(&session)), ([10; 5], true));
    session.press("layer-shfrs");
    assert_eq!(areas(&session), [0; 5], "hidden with its layer");
    session.press("layer-shfrs");
    session.press("by-step");
    assert_eq!((areas(&session), pressed(&session)), ([1; 5], false));
}

#[test]
fn what_the_server_lacks_is_solved_beside_the_page() {
    let parameters = unequal();
    let mut session = Session::open(&trial(parameters, [None, None]));
    let games = Evader::ALL.map(|evader| (of(evader), parameters.game(evader)));
    assert_eq!(session.games(), games);
    assert_eq!(session.urls(), [routes::admin_predictor("t")]);
    let percent = |session: &Session| session.words("solved-percent").unwrap();
    assert_eq!(percent(&session), "0 %");
    session.hear(Evader::Human, Solving::Done(0.5));
    assert_eq!(percent(&session), "25 %");
    session.hear(Evader::Robot, Solving::Done(0.75));
    assert_eq!(percent(&session), "62 %");
    session.hear(Evader::Human, Solving::Solved(SOLVED.human.encode()));
    assert_eq!((percent(&session).as_str(), session.outlines()), ("87 %", [0, 0]));
    session.hear(Evader::Robot, Solving::Solved(SOLVED.robot.encode()));
    assert_eq!(session.words("solving"), None);
    let [human, robot] = session.outlines();
    assert!(human >= 1 && robot >= 1);
    assert!(session.words("safety-levels").unwrap().contains("solved in this browser"));
}

#[test]
fn only_what_is_missing_is_solved_here() {
    let id = SOLVED.human.id();
    let mut session = Session::open(&trial(unequal(), [Some(id.clone()), None]));
    assert!(session.urls().contains(&routes::value_function(&id).as_str()));
    assert_eq!(session.games(), [(of(Evader::Robot), unequal().game(Evader::Robot))]);
    session.hear(Evader::Robot, Solving::Solved(SOLVED.robot.encode()));
    session.answer(of(Evader::Human), 200, &SOLVED.human.encode());
    assert!(session.outlines().iter().all(|&count| count >= 1));
}

#[test]
fn a_failure_is_said_and_can_be_tried_again() {
    let mut session = Session::open(&trial(unequal(), [None, None]));
    session.hear(Evader::Human, Solving::Solved(SOLVED.human.encode()));
    session.hear(Evader::Robot, Solving::Failed("out of memory".into()));
    assert!(session.words("unsolved").unwrap().contains("out of memory"));
    assert_eq!(session.words("solving"), None);
    session.press("solve-again");
    assert_eq!(session.games(), [(of(Evader::Robot), unequal().game(Evader::Robot))]);
    session.hear(Evader::Robot, Solving::Solved(b"nonsense".to_vec()));
    assert!(session.words("unsolved").unwrap().contains("value function"));
    session.press("solve-again");
    session.hear(Evader::Robot, Solving::Solved(SOLVED.robot.encode()));
    assert_eq!(session.words("unsolved"), None);
    assert!(session.outlines().iter().all(|&count| count >= 1));
}

#[test]
fn a_server_that_fails_is_said_too() {
    let ids = Evader::ALL.map(|evader| Some(SOLVED.of(evader).id()));
    let mut session = Session::open(&trial(unequal(), ids));
    session.unreachable(of(Evader::Human));
    assert!(session.words("unsolved").unwrap().contains("cannot be reached"));
    session.press("solve-again");
    assert!(session.urls().contains(&routes::value_function(&SOLVED.human.id()).as_str()));
    assert_eq!(session.games(), []);
}

#[test]
fn nobody_solves_for_a_page_that_is_left() {
    let mut session = Session::open(&trial(unequal(), [None, None]));
    session.press("stop-solving");
    assert_eq!(session.games(), []);
    assert!(session.words("unsolved").unwrap().contains("stopped"));
    session.press("solve-again");
    assert_eq!(session.solving.len(), 2);
    let late = (session.solving[0].2)(Solving::Failed("late".into()));
    session.go("/lab");
    assert_eq!(session.games(), []);
    session.tell(late);
    assert!(session.words("unsolved").is_none());
}

#[test]
fn a_session_that_ends_asks_for_the_key() {
    let mut session = Session::open(&trial(unequal(), [None, None]));
    let problem = br#"{"code":"unauthorized","message":"sign in"}"#;
    session.answer("predictor", 401, problem);
    assert!(session.words("key").is_some());
    assert!(session.words("trouble").unwrap().contains("session has ended"));
    assert_eq!((session.games(), session.urls()), (vec![], vec![]));
}

#[test]
fn a_trial_that_is_not_there_says_so() {
    let mut session = Session::at("/lab/replay/none");
    session.answer("trial", 404, br#"{"code":"not_found","message":"x"}"#);
    assert!(session.words("stuck").unwrap().contains("no such trial"));
}

#[test]
fn the_time_axis_has_round_ticks_for_any_duration() {
    let parameters = SceneParameters { steps: 40, ..SceneParameters::default() };
    let session = Session::open(&trial(parameters, [None, None]));
    let words = session.lab.view().words();
    assert!(words.contains(" 0 1 2 3 4 5 6 7 8 s "), "{words}");
}

#[test]
fn levels_that_did_not_converge_are_marked() {
    let mut settled = Session::open(&trial(unequal(), [None, None]));
    settled.hear(Evader::Human, Solving::Solved(SOLVED.human.encode()));
    settled.hear(Evader::Robot, Solving::Solved(SOLVED.robot.encode()));
    assert!(settled.words("not-converged").is_none());
    assert!(settled.outlines()[0] > 0);
    // A solve that gives up after its first sweeps.
    let parameters = unequal();
    let game = parameters.game(Evader::Human);
    let settings = polar::Settings {
        range_m: 12.0,
        range_nodes: 17,
        angle_nodes: 24,
        most_sweeps: 40,
        ..polar::Settings::default()
    };
    let solution = polar::solve(&game, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let unsettled = SampledValue::from_polar(game, &solution).unwrap();
    let unsettled = ValueFunction::Sampled(unsettled.into());
    assert!(unsettled.unsettled_m().is_some());
    let mut session = Session::open(&trial(parameters, [None, None]));
    session.hear(Evader::Human, Solving::Solved(unsettled.encode()));
    session.hear(Evader::Robot, Solving::Solved(SOLVED.robot.encode()));
    assert_eq!(session.words("unsolved"), None);
    let warning = session.words("not-converged").unwrap();
    assert!(warning.contains("HR") && !warning.contains("RH"), "{warning}");
    assert_eq!(session.outlines()[0], 0, "not in the human's colour");
}

#[test]
fn the_solver_comes_to_what_the_server_has() {
    // What the page is given to solve, solved as the worker does.
    let session = Session::open(&trial(unequal(), [None, None]));
    for (evader, (_, game)) in Evader::ALL.into_iter().zip(session.games()) {
        let function = value_function(game, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(function.id(), SOLVED.of(evader).id());
    }
}
