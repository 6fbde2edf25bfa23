//! Tests of the laboratory without a browser.

mod access;
mod analyses;
mod configuration;
mod explorer;
mod export;
mod predictors;
mod replay;
mod beside;
mod profile;
mod reachability;
mod studies;

use super::routes::{DEMONSTRATION, INSPECTOR, LABORATORY, Route, VIEWER};
use super::{Lab, Program};
use crate::form::{FieldValue, Form};
use crate::runtime::{Address, Event, Page, PageContext, Solving};
use crate::testing;
use sidestep::api::{
    Access, Backup, DataCheck, DataCheckState, Session as SignedIn, TrialDetail, TrialPage,
    TrialSummary, routes,
};
use sidestep::chart::colours;
use sidestep::picture::Shape;
use sidestep::reachability::{PursuitGame, SampledValue, ValueFunction, polar};
use sidestep::safety::{SafetyLevels, value_function};
use sidestep::scene::{Evader, Scene, SceneParameters};
use sidestep::trial::{Phase, outcome, simulate, verify};
use sidestep::vehicle::{Pose, TurnInput};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::LazyLock;

/// All programs of the laboratory in one.
struct Whole;

impl Program for Whole {
    const PAGES: &'static [&'static [Route]] = &[LABORATORY, VIEWER, INSPECTOR, DEMONSTRATION];
    const SOLVES: bool = true;
    const SHOWS_SOLIDS: bool = true;
    const POINTS: bool = true;
    const OFFERS_FILES: bool = true;
    const HAS_PANES: bool = true;
}

type Session = testing::Session<Lab<Whole>>;

/// The paper's vehicles, but the robot turns more slowly.
fn unequal() -> SceneParameters {
    let mut parameters = SceneParameters::default();
    parameters.robot.turn_rate_radps = 0.35;
    parameters
}

/// The value functions for these vehicles, solved once for all tests.
static SOLVED: LazyLock<SafetyLevels> =
    LazyLock::new(|| SafetyLevels::solve(&unequal(), &mut |_| ControlFlow::Continue(())).unwrap());

fn trial(parameters: SceneParameters, ids: [Option<String>; 2]) -> TrialDetail {
    let scene = Scene::new(&parameters, Pose::new(-8.0, 0.0, 0.0), Pose::new(8.0, 1.0, 3.1));
    let inputs = vec![TurnInput::Straight; parameters.steps];
    let states = simulate(&parameters, &scene, &inputs);
    let [value_function_hr, value_function_rh] = ids;
    TrialDetail {
        summary: TrialSummary {
            trial_id: "t".into(),
            participant_id: "p".into(),
            participant_number: 1,
            phase: Phase::Task,
            attempt: 1,
            index: 0,
            received_at_ms: 0,
            outcome: outcome(&parameters, &inputs, &states),
            flags: Vec::new(),
        },
        study: "default".into(),
        synthetic: false,
        parameters,
        replay: verify(&parameters, &scene, &inputs, &states),
        scene,
        inputs,
        states,
        value_function_hr,
        value_function_rh,
        previous: Some("before".into()),
        next: Some("after".into()),
    }
}

fn address(path: &str) -> Address {
    let (path, fragment) = path.split_once('#').unwrap_or((path, ""));
    let (path, query) = path.split_once('?').unwrap_or((path, ""));
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    Address {
        origin: "https://lab.example".into(),
        path: path.into(),
        query: pairs.map(|(name, value)| (name.to_owned(), value.to_owned())).collect(),
        fragment: fragment.into(),
        ..Address::default()
    }
}

/// Opens the laboratory at this address. The server has not answered yet.
fn start(path: &str) -> Session {
    let context = PageContext { address: address(path), ..PageContext::default() };
    Session::new(Lab::open(context), BTreeMap::new())
}

/// Opens the laboratory at this address and signs in.
fn signed_in(path: &str) -> Session {
    signed_in_to(path, Access::Manage)
}

/// Opens the laboratory at this address and signs in with a key that gives this access.
fn signed_in_to(path: &str, access: Access) -> Session {
    let mut session = start(path);
    session.send("session", 200, &SignedIn { signed_in: true, name: "Ada".into(), access });
    session
}

/// Opens a replay of this trial.
fn replay(trial: &TrialDetail) -> Session {
    let mut session = signed_in("/lab/replay/t");
    session.send("trial", 200, trial);
    session
}

/// Opens a replay of a trial with identical vehicles and loads the value function.
fn replay_of_equals() -> Session {
    let parameters = SceneParameters::default();
    let function = ValueFunction::Exact(parameters.game(Evader::Human).exact().unwrap());
    let id = Some(function.id());
    let mut session = replay(&trial(parameters, [id.clone(), id]));
    let urls = session.urls();
    assert_eq!(urls.len(), 3, "the function, the predictor and what else there is: {urls:?}");
    session.answer(of(Evader::Human), 200, &function.encode());
    session
}

/// Opens a replay of a trial with different vehicles, whose value functions the browser must solve.
fn replay_unsolved() -> Session {
    replay(&trial(unequal(), [None, None]))
}

impl Session {
    /// Moves a slider to this number.
    fn slide(&mut self, test_id: &str, number: f64) {
        let value = FieldValue::Number(Some(number));
        let message = self.page.view().enter(test_id, value).expect("a slider");
        self.tell(message);
    }

    fn go(&mut self, path: &str) {
        self.hear(&Event::Address(address(path)));
    }

    /// Makes the solver return the value function for this vehicle.
    fn solved(&mut self, evader: Evader) {
        self.solver(of(evader), Solving::Solved(SOLVED.of(evader).encode()));
    }

    /// Enters a value into a control.
    fn choose(&mut self, test_id: &str, value: &str) {
        let value = FieldValue::Text(value.to_owned());
        self.tell(self.page.view().enter(test_id, value).unwrap());
    }

    fn games(&self) -> Vec<(&str, PursuitGame)> {
        self.solving.iter().map(|(name, task, _)| (*name, task.game)).collect()
    }

    /// The number of outlines of level sets of V_HR, and the number of outlines of level sets of
    /// V_RH.
    fn outlines(&self) -> [usize; 2] {
        let picture = self.picture().unwrap();
        [colours::HUMAN, colours::ROBOT].map(|colour| {
            let is_outline = |shape: &&Shape| match shape {
                Shape::Path { pen: Some(pen), points, .. } => {
                    // The dots of recorded paths are shorter than the dashes of level sets.
                    let is_dashed = pen.dash.is_some_and(|[dash, _]| dash > 4.0);
                    pen.ink.colour == colour && is_dashed && points.len() > 10
                }
                _ => false,
            };
            picture.shapes().iter().filter(is_outline).count()
        })
    }

    fn draws_both(&self) -> bool {
        self.outlines().iter().all(|&count| count >= 1)
    }
}

/// The name of the request or solve for a vehicle's value function.
fn of(evader: Evader) -> &'static str {
    match evader {
        Evader::Human => "value-function-human",
        Evader::Robot => "value-function-robot",
    }
}

/// The requests of the first page.
const HOME: [&str; 2] = [routes::ADMIN_STUDIES, routes::DATA_CHECK];
/// The requests of the self-check page.
const CHECKS: [&str; 2] = [routes::SELF_CHECK, routes::DATA_CHECK];

/// An empty list of studies.
const NO_STUDIES: &[u8] = b"[]";

#[test]
fn what_a_page_asked_for_is_no_matter_to_the_next() {
    let mut session = signed_in("/lab");
    let late = session.take("studies");
    let late = (late.then)(Ok(NO_STUDIES.to_vec()));
    session.go("/lab/self-check");
    session.go("/lab");
    session.tell(late);
    assert_eq!(session.urls(), HOME, "only this visit's requests");
    assert!(session.text().contains("Loading"));
}

#[test]
fn an_address_without_a_page_says_so() {
    let mut session = signed_in("/lab/nothing");
    assert!(session.words("stuck").unwrap().contains("no page at this address"));
    session.go("/lab/self-check");
    assert_eq!(session.urls(), CHECKS);
    for elsewhere in ["/s/default", "/laboratory"] {
        assert!(session.page.hear(&Event::Address(address(elsewhere))).is_none(), "{elsewhere}");
    }
}

#[test]
fn faults_of_stored_data_are_told_at_once() {
    let found = |check: &DataCheck| {
        let mut first = signed_in("/lab");
        first.answer("studies", 200, NO_STUDIES);
        first.send("data-check", 200, check);
        let mut page = signed_in("/lab/self-check");
        page.answer("self-check", 503, b"{}");
        page.send("data-check", 200, check);
        [first.words("faults"), page.words("data")]
    };
    let mut check = DataCheck::default();
    let [first, page] = found(&check);
    assert!(first.is_none() && page.unwrap().contains("not checked its data since"));
    check.state = DataCheckState::Done;
    (check.at_ms, check.trials) = (Some(0), Some(12));
    let backup = Backup { name: "sidestep-1.db".into(), at_ms: 0, bytes: 1_200_000 };
    check.backup = Some(backup);
    let [first, page] = found(&check);
    let page = page.unwrap();
    assert!(first.is_none() && page.contains("Each of the 12 stored trials"), "{page}");
    assert!(page.contains("sidestep-1.db (1.2 MB)"), "{page}");
    (check.fault_count, check.faults) = (2, vec!["trial t: odd".into()]);
    for words in found(&check) {
        let words = words.unwrap();
        assert!(words.contains("2 faults") && words.contains("sidestep check"), "{words}");
    }
    assert!(found(&check)[1].as_ref().unwrap().contains("trial t: odd"));
    let failed = DataCheck {
        state: DataCheckState::Failed,
        message: Some("the disk is full".into()),
        ..DataCheck::default()
    };
    assert!(found(&failed).into_iter().all(|words| words.unwrap().contains("the disk is full")));
}

#[test]
fn nobody_signs_in_to_what_is_open_to_all() {
    let session = start("/demo");
    assert!(session.urls().is_empty() && session.words("demo").is_some());
    assert!(session.words("sign-out").is_none() && !session.text().contains("Studies"));
    assert_eq!(start("/lab/demo").urls(), [routes::SESSION]);
    assert!(signed_in("/lab/demo").words("demo").is_some());
}

#[test]
fn a_pasted_link_signs_in_wherever_one_is() {
    let mut session = start("/lab");
    session.answer("session", 401, b"{}");
    assert!(session.words("key").is_some() && session.words("trouble").is_none());
    session.go("/lab#key=secret");
    assert_eq!(session.visited, ["/lab"], "the key leaves the address");
    let request = &session.asked[0];
    assert_eq!((request.method, request.body.as_deref()), ("POST", Some(r#"{"key":"secret"}"#)));
    let ada = SignedIn { signed_in: true, name: "Ada".into(), access: Access::Read };
    session.send("session", 200, &ada);
    assert_eq!(session.urls(), HOME);
}

#[test]
fn a_wrong_key_is_called_so() {
    let mut session = start("/lab");
    session.answer("session", 401, b"{}");
    let form = Form::new(vec![("key".into(), FieldValue::Text(" wrong ".into()))]);
    session.tell(session.page.view().submit("sign-in-form", form).unwrap());
    assert!(session.page.view().find("sign-in").unwrap().attribute("disabled").is_some());
    session.answer("session", 401, br#"{"code":"unauthorized","message":"no"}"#);
    assert_eq!(session.words("trouble").unwrap(), "That key is not valid.");
    assert!(session.page.view().find("sign-in").unwrap().attribute("disabled").is_none());
}

#[test]
fn one_leaves_only_once_one_is_signed_out() {
    let mut session = signed_in("/lab");
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
    let mut session = replay(&trial(unequal(), ids.clone()));
    for id in ids.iter().flatten() {
        assert!(session.urls().contains(&routes::value_function(id).as_str()));
    }
    assert_eq!(session.games(), []);
    assert_eq!(session.words("solving"), None);
    session.answer(of(Evader::Robot), 200, &SOLVED.robot.encode());
    assert_eq!(session.outlines(), [0, 0]);
    session.answer(of(Evader::Human), 200, &SOLVED.human.encode());
    assert!(session.draws_both());
    assert!(session.words("safety-levels").unwrap().contains("solved by the server"));
}

#[test]
fn equal_vehicles_take_one_request() {
    let session = replay_of_equals();
    assert_eq!(session.outlines(), [1, 1]);
    assert!(session.words("safety-levels").unwrap().contains("closed form"));
}

#[test]
fn predicted_sets_are_drawn_whole_or_step_by_step() {
    let mut session = replay_of_equals();
    let predictor = r#"{"format":"sidestep-predictor/1","kind":"constant","features":["distance"],
        "classes":[-1,0,1],"probabilities":[0.6,0.3,0.1]}"#;
    let trained = format!(r#"{{"predictor":{predictor},"trials":7,"fallback":null}}"#);
    session.answer("predictor", 200, trained.as_bytes());
    // The number of areas of each set, from F_1 to F_5.
    let areas = |session: &Session| {
        let mut counts = [0; 5];
        for shape in session.picture().unwrap().shapes() {
            let Shape::Path { fill: Some(fill), points, .. } = shape else { continue };
            if let Some(j) = colours::REGIONS.iter().position(|&region| *fill == region.into()) {
                assert!(!points.is_empty());
                counts[j] += 1;
            }
        }
        counts
    };
    assert_eq!(areas(&session), [1; 5]);
    session.choose("sets", "steps");
    assert_eq!(areas(&session), [10; 5]);
    session.choose("sets", "7");
    assert_eq!(areas(&session), [1; 5]);
    session.press("layer-shfrs");
    assert_eq!(areas(&session), [0; 5], "hidden with its layer");
    session.press("layer-shfrs");
    session.choose("sets", "tube");
    assert_eq!(areas(&session), [1; 5]);
}

#[test]
fn what_the_server_lacks_is_solved_beside_the_page() {
    let parameters = unequal();
    let mut session = replay(&trial(parameters, [None, None]));
    let games = Evader::ALL.map(|evader| (of(evader), parameters.game(evader)));
    assert_eq!(session.games(), games);
    assert_eq!(session.urls(), [routes::admin_predictor("t"), routes::admin_analyses("default")]);
    let percent = |session: &Session| session.words("solved-percent").unwrap();
    assert_eq!(percent(&session), "0 %");
    session.solver(of(Evader::Human), Solving::Done(0.5));
    assert_eq!(percent(&session), "25 %");
    session.solver(of(Evader::Robot), Solving::Done(0.75));
    assert_eq!(percent(&session), "62 %");
    session.solved(Evader::Human);
    assert_eq!((percent(&session).as_str(), session.outlines()), ("87 %", [0, 0]));
    session.solved(Evader::Robot);
    assert_eq!(session.words("solving"), None);
    assert!(session.draws_both());
    assert!(session.words("safety-levels").unwrap().contains("solved in this browser"));
}

#[test]
fn only_what_is_missing_is_solved_here() {
    let id = SOLVED.human.id();
    let mut session = replay(&trial(unequal(), [Some(id.clone()), None]));
    assert!(session.urls().contains(&routes::value_function(&id).as_str()));
    assert_eq!(session.games(), [(of(Evader::Robot), unequal().game(Evader::Robot))]);
    session.solved(Evader::Robot);
    session.answer(of(Evader::Human), 200, &SOLVED.human.encode());
    assert!(session.draws_both());
}

#[test]
fn a_failure_is_said_and_can_be_tried_again() {
    let mut session = replay_unsolved();
    session.solved(Evader::Human);
    session.solver(of(Evader::Robot), Solving::Failed("out of memory".into()));
    assert!(session.words("unsolved").unwrap().contains("out of memory"));
    assert_eq!(session.words("solving"), None);
    session.press("solve-again");
    assert_eq!(session.games(), [(of(Evader::Robot), unequal().game(Evader::Robot))]);
    session.solver(of(Evader::Robot), Solving::Solved(b"nonsense".to_vec()));
    assert!(session.words("unsolved").unwrap().contains("value function"));
    session.press("solve-again");
    session.solved(Evader::Robot);
    assert_eq!(session.words("unsolved"), None);
    assert!(session.draws_both());
}

#[test]
fn a_server_that_fails_is_said_too() {
    let ids = Evader::ALL.map(|evader| Some(SOLVED.of(evader).id()));
    let mut session = replay(&trial(unequal(), ids));
    session.unreachable(of(Evader::Human));
    assert!(session.words("unsolved").unwrap().contains("cannot be reached"));
    session.press("solve-again");
    assert!(session.urls().contains(&routes::value_function(&SOLVED.human.id()).as_str()));
    assert_eq!(session.games(), []);
}

#[test]
fn nobody_solves_for_a_page_that_is_left() {
    let mut session = replay_unsolved();
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
    let mut session = replay_unsolved();
    let problem = br#"{"code":"unauthorized","message":"sign in"}"#;
    session.answer("predictor", 401, problem);
    assert!(session.words("key").is_some());
    assert!(session.words("trouble").unwrap().contains("session has ended"));
    assert_eq!((session.games(), session.urls()), (vec![], vec![]));
}

#[test]
fn a_page_begins_while_the_server_says_who_is_there() {
    let parameters = SceneParameters::default();
    let begun = || {
        let session = start("/lab/replay/t");
        let urls =
            [routes::SESSION.to_owned(), routes::admin_trial("t"), routes::admin_predictor("t")];
        assert_eq!(session.urls(), urls);
        session
    };
    // No part of the trial is shown before the session is confirmed.
    let mut session = begun();
    session.send("trial", 200, &trial(parameters, [None, None]));
    assert!(session.text().contains("Loading") && session.words("sign-out").is_none());
    assert!(session.picture().is_none() && session.page.title() == "Sidestep laboratory");
    let ada = SignedIn { signed_in: true, name: "Ada".into(), access: Access::Read };
    session.send("session", 200, &ada);
    assert!(session.words("sign-out").is_some() && session.picture().is_some());
    // A user who is not signed in is asked for the key without an error message, no matter which
    // answer comes first.
    for first in ["session", "trial"] {
        let mut session = begun();
        session.answer(first, 401, b"{}");
        assert!(session.words("key").is_some() && session.words("trouble").is_none(), "{first}");
        assert_eq!(session.urls(), Vec::<&str>::new(), "{first}");
    }
    // Going to another address does not cancel the request about the session.
    let mut session = begun();
    session.go("/lab/self-check");
    assert_eq!(session.urls(), [routes::SESSION, CHECKS[0], CHECKS[1]]);
}

#[test]
fn a_trial_that_is_not_there_says_so() {
    let mut session = signed_in("/lab/replay/none");
    session.answer("trial", 404, br#"{"code":"not_found","message":"x"}"#);
    assert!(session.words("stuck").unwrap().contains("no such trial"));
}

#[test]
fn the_time_axis_has_round_ticks_for_any_duration() {
    let parameters = SceneParameters { steps: 40, ..SceneParameters::default() };
    let session = replay(&trial(parameters, [None, None]));
    let words = session.text();
    assert!(words.contains(" 0 1 2 3 4 5 6 7 8 s "), "{words}");
}

#[test]
fn levels_that_did_not_converge_are_marked() {
    let mut settled = replay_unsolved();
    settled.solved(Evader::Human);
    settled.solved(Evader::Robot);
    assert!(settled.words("not-converged").is_none());
    assert!(settled.outlines()[0] > 0);
    // Report a solve that fails to converge because its number of sweeps is limited.
    let parameters = unequal();
    let game = parameters.game(Evader::Human);
    let settings = polar::Settings::default()
        .with_range(12.0)
        .with_range_nodes(17)
        .with_angle_nodes(24)
        .with_most_sweeps(40);
    let solution = polar::solve(&game, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let unsettled = SampledValue::from_polar(game, &solution).unwrap();
    let unsettled = ValueFunction::Sampled(unsettled.into());
    assert!(unsettled.unsettled_m().is_some());
    let mut session = replay(&trial(parameters, [None, None]));
    session.solver(of(Evader::Human), Solving::Solved(unsettled.encode()));
    session.solved(Evader::Robot);
    assert_eq!(session.words("unsolved"), None);
    let warning = session.words("not-converged").unwrap();
    assert!(warning.contains("HR") && !warning.contains("RH"), "{warning}");
    assert_eq!(session.outlines()[0], 0, "not in the human's colour");
}

#[test]
fn the_solver_comes_to_what_the_server_has() {
    // Solve the page's task as the worker does.
    let session = replay_unsolved();
    for (evader, (_, game)) in Evader::ALL.into_iter().zip(session.games()) {
        let function = value_function(game, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(function.id(), SOLVED.of(evader).id());
    }
}
