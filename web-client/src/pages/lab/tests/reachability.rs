//! Tests of the reachability page: parameters, solves, maps, optimal play and links.

use super::*;
use crate::form::{Does, Pointing};
use sidestep::reachability::Method;

const PATH: &str = "/lab/reachability";
const SOLVE: &str = "value-function";

impl Session {
    fn written_link(&mut self) -> String {
        if self.timers.iter().any(|(name, ..)| *name == "link") {
            self.wake("link");
        }
        self.visited.last().cloned().unwrap_or_default()
    }

    /// Performs a pointer action at this position, in fractions of the element's width and height.
    fn point(&mut self, test_id: &str, at: [f32; 2], does: Does) {
        let value = FieldValue::Pointing(Pointing { at, does });
        self.tell(self.page.view().enter(test_id, value).unwrap());
    }

    fn type_key(&mut self, code: &str) {
        assert!(self.page.owns_key(code), "{code}");
        self.hear(&Event::Key { code: code.into(), key: String::new(), down: true });
    }

    fn number(&self, name: &str) -> String {
        let all = self.words("numbers").unwrap();
        let (_, after) = all.split_once(name).unwrap_or_else(|| panic!("{name}: {all}"));
        after.trim().split(" ∂").next().unwrap().to_owned()
    }
}

/// The solver's solution of a game, with the draft accuracy.
fn solved(game: PursuitGame, method: Method) -> Vec<u8> {
    let task = crate::task::Task {
        method: Some(method),
        accuracy: Some(sidestep::reachability::Accuracy::Draft),
        ..game.into()
    };
    task.solved(&mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn equal_vehicles_are_shown_at_once_in_closed_form() {
    let session = signed_in(PATH);
    assert!(session.solving.is_empty());
    assert!(session.words("origin").unwrap().contains("closed form"));
    // If the robot approaches head on, 2 m to the side, the paper's human can no longer avoid a
    // collision.
    let expected = ExactLevel::at([8.0, 2.0, std::f64::consts::PI]);
    assert!(session.number("V").starts_with(&sidestep::chart::fixed(expected, 3)));
    assert!(session.words("verdict").unwrap().contains("can force a collision"));
    let map = session.page.view();
    let map = map.find("map").unwrap().words();
    for part in ["x, ahead of the evader (m)", "y, to its left (m)", "V (m)"] {
        assert!(map.contains(part), "{part}: {map}");
    }
}

/// V of the page's default game, by the closed form.
struct ExactLevel;

impl ExactLevel {
    fn at(state: [f64; 3]) -> f64 {
        SceneParameters::default().game(Evader::Human).exact().unwrap().value(state)
    }
}

#[test]
fn unequal_vehicles_are_solved_beside_the_page() {
    let mut session = signed_in(PATH);
    session.choose("pursuer-turn-rate", "0.35");
    assert_eq!(session.games(), [(SOLVE, unequal().game(Evader::Human))]);
    session.solver(SOLVE, Solving::Done(0.42));
    assert_eq!(session.words("solved-percent").as_deref(), Some("42 %"));
    // Another change replaces the solve in progress.
    session.choose("accuracy", "draft");
    assert_eq!(session.solving.len(), 1);
    assert_eq!(session.words("solved-percent").as_deref(), Some("0 %"));
    session.at(310.0).solver(SOLVE, Solving::Solved(SOLVED.human.encode()));
    assert_eq!(session.words("solving"), None);
    let origin = session.words("origin").unwrap();
    assert!(origin.contains("polar, 65 × 96 × 96 nodes, solved here in 0.31 s"), "{origin}");
    assert_eq!(session.written_link(), format!("{PATH}?pursuer-turn-rate=0.35&accuracy=draft"));
    // The vehicles are identical again, so there is nothing to solve.
    session.choose("pursuer-turn-rate", "0.4");
    session.choose("pursuer-turn-rate", "0.5");
    assert!(session.solving.is_empty());
    assert!(session.words("origin").unwrap().contains("closed form"));
}

#[test]
fn a_solve_is_stopped_fails_and_is_tried_again_in_words() {
    let mut session = signed_in(&format!("{PATH}?evader-speed=3"));
    session.press("stop-solving");
    assert!(session.solving.is_empty());
    assert!(session.words("unsolved").unwrap().contains("The solve was stopped."));
    session.press("solve-again");
    session.solver(SOLVE, Solving::Failed("out of memory".into()));
    assert!(session.words("unsolved").unwrap().contains("out of memory"));
    session.press("solve-again");
    session.solver(SOLVE, Solving::Solved(b"nonsense".to_vec()));
    assert!(session.words("unsolved").unwrap().contains("value function"));
}

#[test]
fn values_that_are_not_valid_are_named_and_change_nothing() {
    let mut session = signed_in(PATH);
    session.choose("radius", "-1");
    let said = session.words("misread").unwrap();
    assert_eq!(said, "radius: expected a finite number > 0, found -1.");
    assert!(session.words("map").is_some());
    session.choose("radius", "3");
    assert_eq!(session.words("misread"), None);
    // An invalid combination gives the same error message as on the command line.
    session.choose("method", "exact");
    session.choose("evader-speed", "1");
    let why = session.words("unsolved").unwrap();
    assert!(why.contains("method: expected polar or cartesian"), "{why}");
    session.choose("method", "best");
    assert_eq!(session.solving.len(), 1);
    session.choose("horizon", "soon");
    assert!(session.words("misread").unwrap().contains("horizon: expected a number > 0, or inf"));
}

#[test]
fn a_link_holds_the_whole_view() {
    let link = format!("{PATH}?radius=2.5&psi=90&at=-3.25,4&play=yes");
    let mut session = signed_in(&link);
    assert!(session.number("x, y").starts_with("−3.25 m, 4.00 m"));
    assert!(session.words("played").is_some());
    session.slide("psi", 91.0);
    assert_eq!(session.written_link(), link.replace("psi=90", "psi=91"));
    let broken = signed_in(&format!("{PATH}?psi=400&radius=2"));
    let said = broken.words("misread").unwrap();
    assert!(said.contains("The link is not valid: psi: expected whole degrees"), "{said}");
    assert!(broken.text().contains("180°"));
    let unknown = signed_in(&format!("{PATH}?radii=2")).words("misread").unwrap();
    assert!(unknown.contains("does not use radii in its link: expected evader-speed"), "{unknown}");
}

#[test]
fn pointers_and_keys_read_numbers_and_play() {
    let mut session = signed_in(PATH);
    session.point("map", [0.5, 0.5], Does::Hover);
    assert!(session.text().contains("under the pointer"));
    let before = session.number("x, y");
    session.type_key("ArrowRight");
    assert!(session.text().contains("at the cross-hair"));
    assert_ne!(session.number("x, y"), before);
    session.type_key("PageUp");
    session.type_key("BracketLeft");
    assert!(session.written_link().contains("psi=184"));
    session.type_key("Enter");
    let played = session.words("played").unwrap();
    assert!(played.contains("closest distance"), "{played}");
    assert!(session.words("world").is_some());
    session.type_key("Escape");
    assert_eq!(session.words("played"), None);
    // Pressing on the map starts a game at that position. Pressing outside the axes has no effect.
    session.point("map", [0.0, 0.0], Does::Press);
    assert_eq!(session.words("played"), None);
    session.point("map", [0.3, 0.4], Does::Press);
    assert!(session.words("played").is_some());
    // Optimal play achieves V within a few centimetres.
    let words = session.words("played").unwrap();
    let difference = words.rsplit("difference").next().unwrap().trim().replace(" m", "");
    assert!(difference.replace('−', "-").parse::<f64>().unwrap().abs() < 0.03, "{words}");
}

#[test]
fn a_finite_horizon_is_not_played() {
    let mut session = signed_in(&format!("{PATH}?horizon=1&accuracy=draft&play=yes"));
    let game = SceneParameters::default().game(Evader::Human);
    let task = crate::task::Task {
        horizon_s: Some(1.0),
        accuracy: Some(sidestep::reachability::Accuracy::Draft),
        ..game.into()
    };
    let bytes = task.solved(&mut |_| ControlFlow::Continue(())).unwrap();
    session.solver(SOLVE, Solving::Solved(bytes));
    assert!(session.words("no-play").unwrap().contains("expected inf: optimal play"));
    session.type_key("Digit2");
    assert!(session.words("no-closed-form").unwrap().contains("finite horizon"));
}

#[test]
fn a_solver_is_compared_with_the_closed_form() {
    let mut session = signed_in(&format!("{PATH}?show=error"));
    assert!(session.words("no-closed-form").unwrap().contains("This is the closed form"));
    session.choose("method", "polar");
    let game = SceneParameters::default().game(Evader::Human);
    session.solver(SOLVE, Solving::Solved(solved(game, Method::Polar)));
    let errors = session.words("errors").unwrap();
    let greatest = errors.split("greatest at 24 headings").nth(1).unwrap().trim();
    let greatest: f64 = greatest.split(' ').next().unwrap().parse().unwrap();
    assert!((0.05..0.8).contains(&greatest), "a draft: {errors}");
    session.choose("evader-speed", "2.5");
    session.solver(SOLVE, Solving::Solved(SOLVED.human.encode()));
    assert!(session.words("no-closed-form").unwrap().contains("unequal vehicles"));
}

#[test]
fn what_did_not_converge_is_marked() {
    let mut session = signed_in(&format!("{PATH}?pursuer-turn-rate=0.35"));
    let ValueFunction::Sampled(samples) = &SOLVED.human else { panic!("it is sampled") };
    let unsettled = SampledValue::clone(samples).unsettled(Some(0.02));
    let unsettled = ValueFunction::Sampled(unsettled.into());
    session.solver(SOLVE, Solving::Solved(unsettled.encode()));
    assert!(session.words("not-converged").unwrap().contains("did not converge"));
    assert!(session.number("V").starts_with("≈ "), "{}", session.number("V"));
}

#[test]
fn the_tube_turns_and_has_a_substitute() {
    let mut session = signed_in(PATH);
    assert!(session.page.solid().is_none());
    session.type_key("Digit3");
    let solid = session.page.solid().unwrap();
    assert!(solid.mesh.indices.len() > 3000);
    session.type_key("ArrowLeft");
    let turned = session.page.solid().unwrap();
    assert!(turned.matrix != solid.matrix && std::rc::Rc::ptr_eq(&turned.mesh, &solid.mesh));
    session.point("tube", [0.5, 0.5], Does::Press);
    session.point("tube", [0.75, 0.25], Does::Drag);
    session.point("tube", [0.75, 0.25], Does::Roll(-100.0));
    assert_eq!(session.written_link(), format!("{PATH}?show=tube&around=-137&above=-19&zoom=138"));
    session.point("tube", [0.1, 0.1], Does::Hover);
    session.point("tube", [0.2, 0.2], Does::Drag);
    assert!(session.written_link().contains("around=-137"), "nobody holds it");
    session.choose("level", "1");
    assert!(!std::rc::Rc::ptr_eq(&session.page.solid().unwrap().mesh, &solid.mesh));
    session.choose("level", "-3");
    assert!(session.words("no-tube").is_some());
    session.choose("level", "0");
    // While the graphics context is lost, the page shows slices.
    let tell = session.page.solid().unwrap().then;
    session.tell(tell(false));
    assert!(session.page.solid().is_none());
    assert!(session.words("no-graphics").unwrap().contains("ψ = 315°"));
    session.tell(tell(true));
    assert!(session.page.solid().is_some() && session.words("no-graphics").is_none());
}

#[test]
fn pictures_are_offered_as_svg_and_png() {
    let mut session = signed_in(&format!("{PATH}?play=yes"));
    session.press("save-svg");
    session.type_key("Digit3");
    session.press("save-png");
    let names: Vec<_> = session.files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["value-psi-180.svg", "tube.png"]);
    for (_, content) in &session.files {
        assert!(String::from_utf8_lossy(content).starts_with("<svg"));
    }
}
