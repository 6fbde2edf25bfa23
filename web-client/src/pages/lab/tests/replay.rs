//! Tests of the replay's player: keys, links, and files to save.

use super::explorer::{exact, usual};
use super::*;
use sidestep::api::Drive;
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::shfrs::probability::regions;
use sidestep::shfrs::window::WindowChoice;
use sidestep::shfrs::window_sets::Prediction;
use sidestep::shfrs::{PredictedHuman, ShfrsSettings};
use sidestep::stats::Estimate;

const PREDICTOR: &str = r#"{"predictor":{"format":"sidestep-predictor/1","kind":"constant",
    "features":["distance"],"classes":[-1,0,1],"probabilities":[0.6,0.3,0.1]},
    "trials":7,"fallback":null}"#;

/// Opens a replay at this address, and loads its value function and a predictor.
fn opened(path: &str) -> Session {
    let parameters = SceneParameters::default();
    let function = ValueFunction::Exact(parameters.game(Evader::Human).exact().unwrap());
    let id = Some(function.id());
    let mut session = signed_in(path);
    session.send("trial", 200, &trial(parameters, [id.clone(), id]));
    session.answer(of(Evader::Human), 200, &function.encode());
    session.answer("predictor", 200, PREDICTOR.as_bytes());
    session
}

impl Session {
    pub(super) fn key(&mut self, code: &str) {
        assert!(self.page.owns_key(code), "{code}");
        self.hear(&Event::Key { code: code.into(), key: String::new(), down: true });
    }

    pub(super) fn seen(&self, attribute: &str) -> String {
        let picture = self.picture().unwrap();
        let found = picture.attributes.iter().find(|(name, _)| *name == attribute);
        found.map(|(_, value)| value.clone()).unwrap()
    }

    /// Updates the link if an update is due, and returns it.
    pub(super) fn link(&mut self) -> &str {
        if self.timers.iter().any(|(name, ..)| *name == "link") {
            self.wake("link");
        }
        self.visited.last().map_or("", String::as_str)
    }
}

#[test]
fn keys_step_play_and_change_the_speed() {
    let mut session = opened("/lab/replay/t");
    for (code, step) in [
        ("ArrowRight", "1"),
        ("PageDown", "6"),
        ("ArrowLeft", "5"),
        ("End", "50"),
        ("ArrowRight", "50"),
        ("PageUp", "45"),
        ("Home", "0"),
        ("ArrowLeft", "0"),
    ] {
        session.key(code);
        assert_eq!(session.seen("data-step"), step, "{code}");
    }
    session.key("ArrowUp");
    session.key("ArrowUp");
    assert_eq!(session.link(), "/lab/replay/t?speed=4");
    // The replay plays at four times the speed, and shows the current time.
    session.at(1000.0).key("Space");
    session.at(1500.0).frame();
    assert_eq!(session.seen("data-step"), "10");
    assert!(session.text().contains("t = 2.00 s"), "{}", session.text());
    session.at(1600.0).key("Space");
    session.at(9000.0).frame();
    assert_eq!(session.seen("data-step"), "10", "a pause");
    assert_eq!(session.link(), "/lab/replay/t?t=2&speed=4");
    session.at(9000.0).key("Space");
    session.at(20_000.0).frame();
    assert_eq!((session.seen("data-step").as_str(), session.page.wants_frames()), ("50", false));
    // Other keys belong to the browser.
    assert!(!session.page.owns_key("Tab") && !session.page.owns_key("KeyX"));
}

#[test]
fn between_two_steps_the_first_step_back_is_to_the_begin_of_this_one() {
    let mut session = opened("/lab/replay/t?t=1.1");
    assert_eq!(session.seen("data-step"), "5");
    session.key("ArrowLeft");
    assert!(session.text().contains("t = 1.00 s"));
    session.key("ArrowLeft");
    assert!(session.text().contains("t = 0.80 s"));
}

#[test]
fn a_link_holds_the_whole_view() {
    let link = "/lab/replay/t?t=3.4&speed=0.5&show=v-hr,shfrs,samples&hr=0,1&sets=3&colours=safe";
    let mut session = opened(link);
    assert_eq!(session.seen("data-step"), "17");
    assert!(session.outlines()[0] >= 2 && session.outlines()[1] == 0, "{:?}", session.outlines());
    session.press("layer-trail");
    assert_eq!(session.link(), link.replace("samples", "samples,trail"));
    session.press("layer-trail");
    assert_eq!(session.link(), link);
    session.key("KeyC");
    session.key("KeyS");
    session.choose("levels-hr", "0");
    session.choose("speed", "1");
    assert_eq!(session.link(), "/lab/replay/t?t=3.4&show=v-hr,shfrs,samples");
}

#[test]
fn a_link_that_is_not_valid_says_what_is_wrong() {
    let mut session = opened("/lab/replay/t?t=3.4&hr=1,0");
    let said = session.words("misread").unwrap();
    assert!(said.contains("hr: expected 1 to 8 rising levels"), "{said}");
    // Fields are checked in the same way as links. An invalid input leaves the previous value
    // unchanged.
    session.choose("levels-hr", "0,1");
    assert_eq!(session.words("misread"), None);
    session.choose("levels-hr", "many");
    assert!(session.words("misread").unwrap().contains("found many"));
    assert_eq!(session.link(), "/lab/replay/t?hr=0,1");
}

#[test]
fn a_link_to_a_step_beyond_the_predicted_ones_shows_the_last_and_says_so() {
    let mut session = opened("/lab/replay/t?sets=99");
    let said = session.words("misread").unwrap();
    assert!(
        said.contains("after step 99") && said.contains("predictions cover 10 steps"),
        "{said}"
    );
    assert!(session.link().contains("sets=10"), "{}", session.link());
    assert!(session.words("legend").unwrap().contains("after 2.0 s"));
    assert_eq!(opened("/lab/replay/t?sets=10").words("misread"), None);
    // A notice about the step does not hide another error in the link.
    let unknown = opened("/lab/replay/t?row=yes&times=5").words("misread").unwrap();
    assert!(
        unknown.contains("does not use times in its link: expected t, speed, show"),
        "{unknown}"
    );
    let both = opened("/lab/replay/t?speed=3&sets=5").words("misread").unwrap();
    assert!(both.contains("speed"), "{both}");
}

#[test]
fn a_predictor_that_comes_before_the_trial_waits_for_it() {
    let function = exact();
    let mut session = signed_in("/lab/replay/t");
    let asked = [routes::admin_trial("t"), routes::admin_predictor("t")];
    assert_eq!(session.urls(), asked, "both at once");
    session.answer("predictor", 200, PREDICTOR.as_bytes());
    assert!(session.text().contains("Loading"));
    let id = Some(function.id());
    session.send("trial", 200, &trial(SceneParameters::default(), [id.clone(), id]));
    assert!(!session.urls().contains(&asked[1].as_str()), "it is not asked for again");
    session.answer(of(Evader::Human), 200, &function.encode());
    assert!(session.words("legend").unwrap().contains("F₁: where the human may be"));
    assert!(session.words("predictor").unwrap().contains("7"));
}

#[test]
fn a_link_with_a_predictor_asks_for_that_one_at_once() {
    let beginning = |query: &str| {
        let session = signed_in(&format!("/lab/replay/t?{query}"));
        session.urls().iter().map(|url| (*url).to_owned()).collect::<Vec<_>>()
    };
    let model = format!("{}?analysis=a1&file=m", routes::admin_predictor("t"));
    assert_eq!(beginning("analysis=a1&file=m"), [routes::admin_trial("t"), model]);
    assert_eq!(beginning("predictor=constant"), [routes::admin_trial("t")], "nobody is asked");
}

#[test]
fn trials_follow_one_after_the_other() {
    let mut session = opened("/lab/replay/t?t=1&colours=safe");
    let next = |session: &Session| {
        let view = session.page.view();
        view.find("next-trial").unwrap().attribute("href").map(str::to_owned)
    };
    assert_eq!(next(&session).as_deref(), Some("/lab/replay/after?colours=safe"));
    session.key("KeyP");
    assert_eq!(session.link(), "/lab/replay/before?colours=safe");
    session.press("in-a-row");
    session.at(0.0).key("Space");
    session.at(20_000.0).frame();
    let next = session.visited.last().map(String::as_str);
    assert_eq!(next, Some("/lab/replay/after?colours=safe&row=yes"));
    // The trial plays as soon as it is loaded.
    assert!(opened("/lab/replay/after?row=yes").page.wants_frames());
}

#[test]
fn the_picture_is_offered_as_svg_and_png() {
    let mut session = opened("/lab/replay/t?t=2");
    session.press("save-png");
    session.press("save-svg");
    let names: Vec<_> = session.files.iter().map(|(name, _)| name.as_str()).collect();
    let name = "default-participant-1-task-1-2.0-s";
    assert_eq!(names, [format!("{name}.png"), format!("{name}.svg")]);
    let svg = String::from_utf8(session.files[1].1.clone()).unwrap();
    for expected in ["<svg", "V_HR = 0 m: inside, the robot can force a collision", "t = 2.0 s"] {
        assert!(svg.contains(expected), "{expected}");
    }
}

#[test]
fn the_legend_says_what_is_drawn_and_can_be_hidden() {
    let mut session = opened("/lab/replay/t");
    let legend = session.words("legend").unwrap();
    for expected in ["danger zone: closer to the robot than 3 m", "F₁: where the human may be"] {
        assert!(legend.contains(expected), "{legend}");
    }
    session.press("layer-danger-zone");
    assert!(!session.words("legend").unwrap().contains("danger zone"));
    session.key("KeyL");
    assert_eq!(session.words("legend"), None);
}

#[test]
fn a_film_lasts_as_long_as_it_plays() {
    let mut session = opened("/lab/replay/t?t=8&row=yes");
    session.at(0.0).key("Space");
    session.at(1000.0).press("film");
    assert!(session.page.wants_frames(), "what is filmed plays");
    let (name, file, filmed) = session.films.remove(0);
    assert_eq!(file, "default-participant-1-task-1-8.0-s.webm");
    // The film ends with the trial, and no other trial follows.
    session.at(1500.0).frame();
    assert!(session.films_ended.is_empty());
    session.at(9000.0).frame();
    assert_eq!(session.films_ended, [name]);
    session.tell(filmed(Ok(())));
    assert!(!session.page.wants_frames());

    // The film ends at the next pause.
    session.key("Home");
    session.at(10_000.0).press("film");
    let (_, _, filmed) = session.films.remove(0);
    session.at(11_000.0).press("film");
    assert_eq!((session.films_ended.len(), session.seen("data-step").as_str()), (2, "0"));
    session.tell(filmed(Err("This browser cannot film.".to_owned())));
    assert!(session.text().contains("This browser cannot film."));
    assert_eq!(session.films_ended.len(), 2, "there is nothing to end any more");
}

/// The share of futures that the paper's sets contain, counted directly over tasks that did not
/// train this predictor.
fn counted(predictor: &Predictor, unseen: &[Drive], parameters: &SceneParameters) -> Vec<String> {
    let safety = SafetyLevels { human: exact(), robot: exact() };
    let human = PredictedHuman::new(predictor, &safety, parameters).unwrap();
    let tasks: Vec<_> = unseen.iter().map(|task| task.trajectory(parameters).unwrap()).collect();
    let prediction = Prediction::new(parameters, &human);
    let settings = ShfrsSettings::paper(3).unwrap().bounds;
    let every = WindowChoice::EveryStep;
    let found = regions(&tasks, every, prediction, &settings, 0.95);
    let found = found.unwrap().probabilities.inside;
    let words = |p: &Estimate| match p.low < p.high {
        true => format!("{:.3} {:.2}–{:.2}", p.value, p.low, p.high),
        false => format!("{:.3}", p.value),
    };
    found.iter().map(words).collect()
}

#[test]
fn sets_say_how_often_they_hold_the_future() {
    let mut session = opened("/lab/replay/t");
    assert!(session.evaluators.is_empty(), "there are no tasks yet");
    let drives = usual();
    session.send("drives", 200, &drives);
    assert_eq!(session.words("p-0"), Some("…".to_owned()));
    session.evaluate("chances");
    let file: PredictorFile = serde_json::from_value(
        serde_json::from_str::<serde_json::Value>(PREDICTOR).unwrap()["predictor"].clone(),
    )
    .unwrap();
    let predictor = Predictor::try_from(file).unwrap();
    let all = counted(&predictor, &drives.tasks, &drives.parameters);
    let shown = |session: &Session| -> Vec<String> {
        let words = (0..).map_while(|j| session.words(&format!("p-{j}")));
        words.map(|words| words.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    };
    assert_eq!(shown(&session), all);
    let words = session.words("p-words").unwrap();
    assert!(words.contains("492 windows of 12 tasks"), "{words}");
    assert!(session.evaluators.is_empty(), "it is not needed any more");

    // If another predictor is chosen, counting starts again. It leaves out the tasks that trained
    // the new predictor.
    session.choose("choose-predictor", "a1/models/m.json");
    assert_eq!(session.words("p-0"), None, "there are no sets either");
    let trained = PREDICTOR.replace("\"trials\":7", "\"trials\":2,\"trained_on\":[\"t0\",\"t5\"]");
    session.answer("predictor", 200, trained.as_bytes());
    session.evaluate("chances");
    let unseen: Vec<Drive> =
        drives.tasks.iter().filter(|it| !["t0", "t5"].contains(&&*it.trial_id)).cloned().collect();
    assert_eq!(shown(&session), counted(&predictor, &unseen, &drives.parameters));
    assert!(session.words("p-words").unwrap().contains("of 10 tasks"));

    // The worst case is a single set, and every trajectory stays inside it.
    session.choose("choose-predictor", "worst-case");
    session.evaluate("chances");
    let [only] = &shown(&session)[..] else { panic!("one set") };
    assert!(only.starts_with("1.000"), "{only}");
}
