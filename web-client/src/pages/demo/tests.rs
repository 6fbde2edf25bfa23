//! Tests of the demonstration without a browser.

use super::*;
use crate::testing;
use sidestep::math::hypot;
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep::trial::simulate;
use sidestep::vehicle::TurnInput;
use std::collections::BTreeMap;

type Session = testing::Session<DemoPage>;

fn opened(query: &[(&str, &str)]) -> Session {
    let query = query.iter().map(|&(name, value)| (name.to_owned(), value.to_owned())).collect();
    let address = Address { path: "/demo".into(), query, ..Address::default() };
    Session::new(DemoPage::open(&address), BTreeMap::new())
}

impl Session {
    fn demo(&self) -> &Demo {
        match &self.page {
            DemoPage::Open(demo) => demo,
            DemoPage::Failed(why) => panic!("{why}"),
        }
    }

    fn key(&mut self, code: &str, down: bool) {
        self.hear(&Event::Key { code: code.into(), key: String::new(), down });
    }

    /// Shows frames at 60 Hz until this time.
    fn until(&mut self, end_ms: f64) {
        while self.now_ms < end_ms {
            let next_ms = (self.now_ms + 1000.0 / 60.0).min(end_ms);
            self.at(next_ms).frame();
        }
    }

    /// Drives a scene that starts at `begin_ms`. The key is down from 2.05 s to 4.05 s.
    fn drive(&mut self, begin_ms: f64, key: &str) {
        self.at(begin_ms).key("Space", true);
        self.until(begin_ms + 2050.0);
        self.key(key, true);
        self.until(begin_ms + 4050.0);
        self.key(key, false);
        self.until(begin_ms + 10_050.0);
    }
}

#[test]
fn a_scene_is_driven_scored_and_learned_from() {
    let mut session = opened(&[]);
    assert!(session.words("model").unwrap().contains("No scene to learn from yet"));
    assert!(!session.page.wants_frames(), "nothing moves before the start");
    assert!(session.page.owns_key("Space") && session.page.owns_key("ArrowLeft"));
    assert!(!session.page.owns_key("Tab"));
    session.drive(1000.0, "ArrowLeft");

    // The recorded trial is the one that these keys would give in the study: left from step 11 to
    // step 20.
    let recorded = session.demo().playback.recorded().clone();
    let turn = |step| if (11..=20).contains(&step) { TurnInput::Left } else { TurnInput::Straight };
    let inputs: Vec<TurnInput> = (0..50).map(turn).collect();
    assert_eq!(recorded.inputs, inputs);
    assert_eq!(recorded.states, simulate(&recorded.parameters, &recorded.scene, &inputs));

    assert!(!session.page.wants_frames());
    let points = session.demo().score.points;
    assert_eq!(session.demo().points, [points]);
    assert!(session.words("model").unwrap().contains("trained on 1 scene."));
    assert!(session.words("card").unwrap().contains("at the closest"));

    // The next scene is different, and the learned model predicts it.
    session.drive(30_000.0, "KeyD");
    assert_eq!((session.demo().index, session.demo().points.len()), (1, 2));
    assert!(session.words("model").unwrap().contains("trained on 2 scenes."));
    assert_ne!(session.demo().playback.recorded().scene, recorded.scene);
}

/// Compares the drawn tubes at each instant with the true future positions.
#[test]
fn what_stayed_inside_is_counted_as_it_was_drawn() {
    let mut session = opened(&[]);
    session.drive(0.0, "KeyA");
    let used = session.demo().model.learned.clone();
    session.drive(20_000.0, "KeyD");
    let demo = session.demo();
    let recorded = demo.playback.recorded().clone();
    let mut playback = Playback::new(recorded.clone()).unwrap();
    playback.use_safety(demo.safety.clone()).unwrap();
    playback.use_learned(Some(used)).unwrap();
    let mut inside = [0.0; 5];
    for step in 0..=40 {
        let view = View { time_s: f64::from(step) * 0.2, ..View::default() };
        playback.go(&view).unwrap();
        let future = &recorded.states[step as usize..step as usize + 11];
        for (count, set) in inside.iter_mut().zip(playback.sets()) {
            let is_in =
                |state: &sidestep::scene::JointState| near(&set.tube[0], state.human.position());
            *count += f64::from(u8::from(future.iter().all(is_in))) / 41.0;
        }
    }
    let counted = &demo.model.foreseen[1].inside;
    // A position inside the tube may be outside the set for its own step, but not vice versa.
    for (set, (drawn, counted)) in inside.iter().zip(counted).enumerate() {
        assert!(drawn + 1e-9 >= *counted, "{set}: {drawn} {counted}");
    }
    assert_eq!((counted[4], counted.windows(2).all(|pair| pair[0] <= pair[1])), (1.0, true));
    let mean = 0.5 * (demo.model.foreseen[0].inside[0] + counted[0]);
    assert!((demo.model.inside()[0] - mean).abs() < 1e-12);
}

/// Whether a point is inside a polygon or within a centimetre of its edge.
fn near(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let edges = || polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossings = edges().filter(|([ax, ay], [bx, by])| {
        (*ay > y) != (*by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay)
    });
    let distance = |([ax, ay], [bx, by]): (&[f64; 2], &[f64; 2])| {
        let (dx, dy) = (bx - ax, by - ay);
        let along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy).max(1e-30);
        let along = along.clamp(0.0, 1.0);
        hypot(x - ax - along * dx, y - ay - along * dy)
    };
    crossings.count() % 2 == 1 || edges().any(|edge| distance(edge) < 0.01)
}

#[test]
fn a_synthetic_driver_is_watched_scene_after_scene() {
    let mut session = opened(&[("driver", "synthetic-2")]);
    assert!(!session.page.owns_key("ArrowLeft"), "nothing to steer");
    session.at(500.0).key("Space", true);
    session.until(3000.0);
    let demo = session.demo();
    let person = SyntheticParticipant::new(1, 2 - 1);
    let whole = person.drive(0, &demo.parameters, demo.scene(), Keys::Clock);
    assert_eq!(demo.playback.recorded().inputs, whole.inputs[..13]);
    assert_eq!(demo.playback.recorded().states, whole.states[..14]);
    // Both a key and hiding the page pause the scene.
    session.key("Space", true);
    assert!(!session.page.wants_frames());
    session.at(9000.0).frame();
    assert_eq!(session.demo().playback.now().step, 12);
    session.key("Space", true);
    session.hear(&Event::FocusLost { hidden: true });
    session.at(60_000.0).key("Space", true);
    session.until(67_600.0);
    assert_eq!(session.demo().playback.recorded().states, whole.states);
    assert!(session.words("card").unwrap().contains("The next scene follows."));
    // The next scene starts automatically.
    session.until(70_500.0);
    assert_eq!((session.demo().index, session.page.wants_frames()), (1, true));
    // The model of another driver has not learned anything.
    session.press("another");
    assert_eq!(session.visited.last().unwrap(), "/demo?driver=synthetic-3");
    assert!(session.words("model").unwrap().contains("No scene to learn from yet"));
    session.press("drive");
    assert_eq!(session.visited.last().unwrap(), "/demo");
}

#[test]
fn nobody_drives_a_page_that_is_hidden() {
    let mut session = opened(&[]);
    session.at(100.0).key("Space", true);
    session.until(2000.0);
    session.hear(&Event::FocusLost { hidden: false });
    assert!(session.page.wants_frames(), "the keys are released, the scene goes on");
    session.hear(&Event::FocusLost { hidden: true });
    assert_eq!((session.page.wants_frames(), session.demo().playback.now().step), (false, 0));
    assert!(session.demo().points.is_empty());
    session.key("Space", true);
    session.until(3000.0);
    session.press("give-up");
    assert_eq!((session.page.wants_frames(), session.demo().index), (false, 0));
}

#[test]
fn layers_and_colours_are_in_the_link() {
    let mut session = opened(&[]);
    session.key("Digit8", true);
    session.key("KeyC", true);
    let link = session.visited.last().unwrap().clone();
    assert!(link.contains("colours=safe") && link.contains("avoidance"), "{link}");
    let pairs = link.split_once('?').unwrap().1.split('&').filter_map(|pair| pair.split_once('='));
    let again = opened(&pairs.collect::<Vec<_>>());
    assert_eq!(again.demo().view, session.demo().view);
    assert!(session.page.view().find("layer-future").is_none(), "nobody knows the future");
    session.key("KeyL", true);
    assert!(session.words("legend").unwrap().contains("danger zone"));
}

#[test]
fn a_link_that_is_not_valid_is_named() {
    for (name, value, words) in [
        ("driver", "synthetic-0", "unknown driver"),
        ("driver", "nobody", "unknown driver"),
        ("show", "moon", "moon"),
        ("colours", "all", "all"),
        ("seed", "2", "does not use seed in its link"),
    ] {
        let session = opened(&[(name, value)]);
        let said = session.words("misread").unwrap();
        assert!(said.contains(words), "{said}");
    }
    // A link for a replay may contain further parameters.
    assert_eq!(opened(&[("t", "soon")]).words("misread"), None);
}

/// Random keys are pressed and released for a minute. Nothing fails, and each step has the input
/// for its time.
#[test]
fn wild_keys_do_no_harm() {
    let mut session = opened(&[]);
    let codes =
        ["ArrowLeft", "ArrowRight", "KeyA", "KeyD", "Space", "Escape", "Digit3", "KeyC", "KeyX"];
    let mut number: u32 = 7;
    for i in 0..6000 {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let code = codes[(number >> 16) as usize % codes.len()];
        session.at(f64::from(i) * 10.0).key(code, number & 0x100 == 0);
        session.frame();
    }
    let recorded = session.demo().playback.recorded();
    let states = simulate(&recorded.parameters, &recorded.scene, &recorded.inputs);
    assert_eq!(recorded.states, states);
}

#[test]
fn scenes_are_the_same_for_everybody_and_do_not_end() {
    let parameters = SceneParameters::default();
    assert_eq!(block(&parameters, 0).unwrap(), block(&parameters, 0).unwrap());
    assert_ne!(block(&parameters, 0).unwrap(), block(&parameters, 1).unwrap());
    let mut session = opened(&[]);
    for scene in 0..BLOCK {
        session.drive(20_000.0 * scene as f64, "KeyA");
    }
    session.at(1e6).key("Space", true);
    assert_eq!((session.demo().index, session.demo().scenes.len()), (BLOCK, 2 * BLOCK));
}
