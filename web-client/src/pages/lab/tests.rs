//! A replay without a browser: where its value functions come from.

use super::Lab;
use crate::runtime::{Answer, App, Command, Event, Request, Solving, Surroundings, Tag};
use crate::shape::{Ink, Shape};
use sidestep::api::{TrialDetail, TrialSummary, routes};
use sidestep::reachability::{PursuitGame, ValueFunction};
use sidestep::safety::{SafetyLevels, value_function};
use sidestep::scene::{Evader, Scene, SceneParameters};
use sidestep::trial::{Phase, outcome, simulate, verify};
use sidestep::vehicle::{Pose, TurnInput};
use std::ops::ControlFlow;
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

/// The laboratory with a replay open.
struct Session {
    page: Lab,
    /// Addresses that were asked for.
    asked: Vec<String>,
    /// What was given to solvers.
    solving: Vec<(Evader, PursuitGame)>,
    /// How often solvers were stopped.
    stopped: usize,
}

impl Session {
    fn open(trial: &TrialDetail) -> Self {
        let mut session =
            Self { page: Lab::new(), asked: Vec::new(), solving: Vec::new(), stopped: 0 };
        let path = "/lab/replay/t".to_owned();
        session.tell(Event::Opened(Surroundings { path, ..Surroundings::default() }));
        session.answer(Tag::Session, 200, b"{\"signed_in\":true}".to_vec());
        session.asked.clear();
        session.answer(Tag::Trial, 200, serde_json::to_vec(trial).unwrap());
        session
    }

    fn tell(&mut self, event: Event) {
        for command in self.page.handle(event) {
            match command {
                Command::Send(Request { url, .. }) => self.asked.push(url),
                Command::Solve { evader, game } => self.solving.push((evader, game)),
                Command::StopSolving => self.stopped += 1,
                other => panic!("{other:?}"),
            }
        }
    }

    fn answer(&mut self, tag: Tag, status: u16, body: Vec<u8>) {
        self.tell(Event::Answered(tag, Answer::Received { status, body }));
    }

    fn hear(&mut self, evader: Evader, solving: Solving) {
        self.tell(Event::Solving(evader, solving));
    }

    fn press(&mut self, word: &str) {
        self.tell(Event::Action { word: word.into(), value: String::new(), t_ms: 0.0 });
    }

    fn words(&self, test_id: &str) -> Option<String> {
        self.page.view().find(test_id).map(crate::view::Node::words)
    }

    /// Outlines of level sets, of V_HR and of V_RH.
    fn outlines(&self) -> [usize; 2] {
        let picture = self.page.picture().unwrap();
        [Ink::Human, Ink::Robot].map(|ink| {
            let is_outline = |shape: &&Shape| match shape {
                Shape::Polygon { stroke: Some(stroke), points, .. } => {
                    stroke.ink == ink && stroke.dash_px.is_some() && points.len() > 10
                }
                _ => false,
            };
            picture.shapes.iter().filter(is_outline).count()
        })
    }
}

#[test]
fn a_study_is_shown_with_its_trials_or_not_yet() {
    let study = r#"[{"slug":"default","title":"Study","participants":1,"trials":1}]"#;
    let summary = serde_json::to_string(&trial(unequal(), [None, None]).summary).unwrap();
    let listed = format!(r#"{{"trials":[{summary}],"next_before":null}}"#);
    let nobody = r#"{"trials":[],"next_before":null}"#;
    for (list, table) in [(listed.as_str(), true), (nobody, false)] {
        let mut page = Lab::new();
        let path = "/lab".to_owned();
        page.handle(Event::Opened(Surroundings { path, ..Surroundings::default() }));
        let mut answer = |tag, body: &str| {
            let body = body.as_bytes().to_vec();
            page.handle(Event::Answered(tag, Answer::Received { status: 200, body }));
            page.view()
        };
        answer(Tag::Session, r#"{"signed_in":true}"#);
        let view = answer(Tag::Studies, study);
        assert!(view.find("trials").is_none() && view.words().contains("Loading"));
        let view = answer(Tag::Trials, list);
        assert_eq!(view.find("trials").is_some(), table);
        assert_eq!(view.words().contains("No trials yet"), !table);
    }
}

#[test]
fn the_servers_solution_is_used_where_there_is_one() {
    let ids = Evader::ALL.map(|evader| Some(SOLVED.of(evader).id()));
    let mut session = Session::open(&trial(unequal(), ids.clone()));
    for id in ids.iter().flatten() {
        assert!(session.asked.contains(&routes::value_function(id)), "{:?}", session.asked);
    }
    assert_eq!(session.solving, []);
    assert_eq!(session.words("solving"), None);
    session.answer(Tag::ValueFunction(Evader::Robot), 200, SOLVED.robot.encode());
    assert_eq!(session.outlines(), [0, 0]);
    session.answer(Tag::ValueFunction(Evader::Human), 200, SOLVED.human.encode());
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
    assert_eq!(session.asked.len(), 2, "the function and the predictor: {:?}", session.asked);
    session.answer(Tag::ValueFunction(Evader::Human), 200, function.encode());
    assert_eq!(session.outlines(), [1, 1]);
    assert!(session.words("safety-levels").unwrap().contains("closed form"));
}

#[test]
fn predicted_sets_are_drawn_whole_or_step_by_step() {
    let parameters = SceneParameters::default();
    let function = ValueFunction::Exact(parameters.game(Evader::Human).exact().unwrap());
    let id = Some(function.id());
    let mut session = Session::open(&trial(parameters, [id.clone(), id]));
    session.answer(Tag::ValueFunction(Evader::Human), 200, function.encode());
    let predictor = r#"{"format":"sidestep-predictor/1","kind":"constant","features":["distance"],
        "classes":[-1,0,1],"probabilities":[0.6,0.3,0.1]}"#;
    let trained = format!(r#"{{"predictor":{predictor},"trials":7,"fallback":null}}"#);
    session.answer(Tag::Predictor, 200, trained.into_bytes());
    // How many areas each set has, from F_1 to F_5.
    let areas = |session: &Session| {
        let mut counts = [0; 5];
        for shape in session.page.picture().unwrap().shapes {
            if let Shape::Polygon { fill: Some((Ink::Region(j), _)), points, .. } = shape {
                assert!(!points.is_empty());
                counts[j] += 1;
            }
        }
        counts
    };
    let pressed = |session: &Session| {
        let view = session.page.view();
        let switch = view.find("by-step").unwrap();
        switch.attributes.iter().find(|(name, _)| *name == "aria-pressed").unwrap().1 == "true"
    };
    assert_eq!((areas(&session), pressed(&session)), ([1; 5], false));
    session.press("by-step");
    assert_eq!((areas(&session), pressed(&session)), ([10; 5], true));
    session.press("shfrs");
    assert_eq!(areas(&session), [0; 5], "hidden with its layer");
    session.press("shfrs");
    session.press("by-step");
    assert_eq!((areas(&session), pressed(&session)), ([1; 5], false));
}

#[test]
fn what_the_server_lacks_is_solved_beside_the_page() {
    let parameters = unequal();
    let mut session = Session::open(&trial(parameters, [None, None]));
    let games = Evader::ALL.map(|evader| (evader, parameters.game(evader)));
    assert_eq!(session.solving, games);
    assert_eq!(session.asked, [routes::admin_predictor("t")]);
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
    assert!(session.asked.contains(&routes::value_function(&id)));
    assert_eq!(session.solving, [(Evader::Robot, unequal().game(Evader::Robot))]);
    session.hear(Evader::Robot, Solving::Solved(SOLVED.robot.encode()));
    session.answer(Tag::ValueFunction(Evader::Human), 200, SOLVED.human.encode());
    assert!(session.outlines().iter().all(|&count| count >= 1));
}

#[test]
fn a_failure_is_said_and_can_be_tried_again() {
    let mut session = Session::open(&trial(unequal(), [None, None]));
    session.hear(Evader::Human, Solving::Solved(SOLVED.human.encode()));
    session.hear(Evader::Robot, Solving::Failed("out of memory".into()));
    assert!(session.words("unsolved").unwrap().contains("out of memory"));
    assert_eq!(session.words("solving"), None);
    // What comes too late changes nothing.
    session.hear(Evader::Robot, Solving::Done(0.9));
    assert!(session.words("unsolved").is_some());
    session.solving.clear();
    session.press("solve-again");
    assert_eq!(session.solving, [(Evader::Robot, unequal().game(Evader::Robot))]);
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
    session.tell(Event::Answered(Tag::ValueFunction(Evader::Human), Answer::Unreachable));
    assert!(session.words("unsolved").unwrap().contains("cannot be reached"));
    session.asked.clear();
    session.press("solve-again");
    assert_eq!(session.asked, [routes::value_function(&SOLVED.human.id())]);
    assert_eq!(session.solving, []);
}

#[test]
fn nobody_solves_for_a_page_that_is_left() {
    let mut session = Session::open(&trial(unequal(), [None, None]));
    session.press("stop-solving");
    assert_eq!(session.stopped, 1);
    assert!(session.words("unsolved").unwrap().contains("stopped"));
    session.press("solve-again");
    assert_eq!(session.solving.len(), 4);
    // The session has ended: the sign-in takes the replay's place.
    let problem = br#"{"code":"unauthorized","message":"sign in"}"#.to_vec();
    session.answer(Tag::Predictor, 401, problem);
    assert!(session.words("key").is_some());
    assert_eq!(session.stopped, 2);
}

#[test]
fn the_solver_comes_to_what_the_server_has() {
    // What the page is given to solve, solved as the worker does.
    let session = Session::open(&trial(unequal(), [None, None]));
    for (evader, game) in session.solving {
        let function = value_function(game, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(function.id(), SOLVED.of(evader).id());
    }
}
