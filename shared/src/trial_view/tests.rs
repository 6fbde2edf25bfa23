//! Compares playbacks with the recorded trial.

use super::source::{Needs, Way};
use super::view::View;
use super::*;
use crate::features::FeatureSet;
use crate::math::hypot;
use crate::picture::Shape;
use crate::shfrs::window::Trajectory;
use crate::trial::simulate;
use crate::vehicle::Pose;

/// A trial with turns, its safety levels and a predictor.
fn playback() -> Playback {
    let parameters = SceneParameters::default();
    let scene = Scene::new(&parameters, Pose::new(-8.0, 0.0, 0.2), Pose::new(8.0, 1.0, 3.1));
    let turn = |step: usize| TurnInput::ALL[(step / 5) % 3];
    let inputs: Vec<TurnInput> = (0..parameters.steps).map(turn).collect();
    let states = simulate(&parameters, &scene, &inputs);
    let mut playback = Playback::new(Recorded { parameters, scene, inputs, states }).unwrap();
    let progress = &mut |_| core::ops::ControlFlow::Continue(());
    playback.use_safety(SafetyLevels::solve(&parameters, progress).unwrap()).unwrap();
    let features = FeatureSet::subset("hrd").unwrap();
    let predictor = Predictor::constant(features, vec![-1, 0, 1], vec![0.2, 0.5, 0.3]).unwrap();
    let settings = ShfrsSettings::paper(3).unwrap();
    playback.use_learned(Some(Learned { predictor, settings })).unwrap();
    playback
}

fn at(time_s: f64) -> View {
    View { time_s, ..View::default() }
}

#[test]
fn the_vehicles_are_where_they_were() {
    let mut playback = playback();
    let Recorded { parameters, inputs, states, .. } = playback.recorded().clone();
    for (step, state) in states.iter().enumerate() {
        playback.go(&at(step as f64 * parameters.step_s)).unwrap();
        assert_eq!((playback.now().step, playback.now().state), (step, *state));
    }
    // Between two steps the vehicles drive arcs.
    playback.go(&at(2.3)).unwrap();
    let expected = states[11].advance(&parameters, inputs[11], 0.0, 2.3 - 11.0 * parameters.step_s);
    assert_eq!(playback.now().state, expected);
    // Times beyond the trial are clamped to its end.
    playback.go(&at(1e9)).unwrap();
    assert_eq!(playback.now().state, states[50]);
    assert_eq!(playback.duration_s(), 10.0);
}

#[test]
fn the_forecast_is_what_is_predicted_then() {
    let mut playback = playback();
    assert_eq!(playback.forecast().len(), 51);
    for step in [0, 7, 50] {
        playback.go(&at(step as f64 * 0.2)).unwrap();
        assert_eq!(playback.probabilities(), Some(&playback.forecast()[step]));
    }
    assert_eq!(playback.forecast()[3].map(|(_, p)| p), [0.3, 0.5, 0.2], "left, straight, right");
}

#[test]
fn a_frame_does_not_depend_on_the_frames_before() {
    let view = View { shown: [true; LAYERS.len()], ..at(3.3) };
    let paint = |playback: &mut Playback| {
        let mut picture = Picture::default();
        playback.go(&view).unwrap();
        playback.paint(&view, &mut picture);
        picture
    };
    let fresh = paint(&mut playback());
    let mut used = playback();
    for time in [0.0, 9.9, 3.2] {
        let other = View { time_s: time, ..view.clone() };
        used.go(&other).unwrap();
        used.paint(&other, &mut Picture::default());
    }
    assert_eq!(paint(&mut used), fresh);
}

/// Records a trial step by step. Each step is first recorded with a wrong input and then corrected.
/// At each moment, the playback looks like the playback of the whole trial.
#[test]
fn a_trial_that_is_being_driven_is_seen_like_a_recorded_one() {
    let mut whole = playback();
    let Recorded { parameters, scene, inputs, states } = whole.recorded().clone();
    let start = vec![states[0]];
    let recorded = Recorded { parameters, scene, inputs: Vec::new(), states: start };
    let mut live = Playback::new(recorded).unwrap();
    live.use_safety(whole.safety().unwrap().clone()).unwrap();
    live.use_learned(whole.learned().cloned()).unwrap();
    live.show_window(whole.window());
    // Only the future may differ, because only the whole trial contains it.
    let mut view = View::default();
    view.shown[layers::place("future").unwrap()] = false;
    for step in 1..inputs.len() {
        let mut mistaken = inputs[..step].to_vec();
        mistaken[step - 1] =
            if mistaken[step - 1] == TurnInput::Left { TurnInput::Right } else { TurnInput::Left };
        let mut elsewhere = states[..=step].to_vec();
        elsewhere[step] =
            states[step - 1].advance(&parameters, mistaken[step - 1], 0.0, parameters.step_s);
        live.record(&mistaken, &elsewhere).unwrap();
        live.record(&inputs[..step], &states[..=step]).unwrap();
        assert_eq!(live.levels(), &whole.levels()[..=step]);
        assert_eq!(live.forecast(), &whole.forecast()[..=step]);
        view.time_s = (step as f64 - 0.4) * parameters.step_s;
        let picture = |playback: &mut Playback| {
            let mut picture = Picture::default();
            playback.go(&view).unwrap();
            playback.paint(&view, &mut picture);
            picture
        };
        assert_eq!(picture(&mut live), picture(&mut whole), "step {step}");
    }
    assert!(live.record(&inputs, &states[..50]).is_err());
}

/// Likely futures are drives. Their ends differ and are no farther from the current position than
/// the path length.
#[test]
fn likely_futures_are_drives_of_the_human() {
    let mut playback = playback();
    let view = View::of_query([("show", "samples"), ("t", "4")]).unwrap();
    playback.go(&view).unwrap();
    let mut picture = Picture::default();
    playback.paint(&view, &mut picture);
    let here = playback.now().state.human.position();
    let mut ends = Vec::new();
    for shape in picture.shapes() {
        let Shape::Path { points, pen: Some(pen), .. } = shape else { continue };
        if *pen != samples::pen() {
            continue;
        }
        let points = picture.points(points);
        assert_eq!((points.len(), points[0]), (11, here));
        for pair in points.windows(2) {
            let way = hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
            assert!((0.39..0.4001).contains(&way), "{way}");
        }
        ends.push(points[10].map(f64::to_bits));
    }
    assert_eq!(ends.len(), 16);
    ends.sort_unstable();
    ends.dedup();
    assert!(ends.len() > 8, "{} different ends", ends.len());
    assert_eq!(playback.history.len(), 21, "nothing is left of the drives");
}

/// Optimal avoidance never decreases V_HR, whatever the robot does, because V_HR is the value of
/// the game.
#[test]
fn best_avoidance_loses_no_safety() {
    let mut playback = playback();
    let view = View::of_query([("show", "avoidance"), ("t", "3")]).unwrap();
    playback.go(&view).unwrap();
    let mut picture = Picture::default();
    playback.paint(&view, &mut picture);
    let path = picture.shapes().iter().find_map(|shape| match shape {
        Shape::Path { points, pen: Some(pen), .. } if *pen == avoidance::pen() => {
            Some(picture.points(points).to_vec())
        }
        _ => None,
    });
    let path = path.unwrap();
    assert_eq!(path.len(), 41);
    // The distance to the robot never falls below V plus the radius.
    let state = playback.now().state;
    let promised = playback.safety().unwrap().human_level(&state);
    let robot = state.robot;
    for (i, [x, y]) in path.into_iter().enumerate() {
        let seconds = 0.05 * i as f64;
        let parameters = &playback.recorded().parameters;
        let at = parameters.robot.advance(robot, TurnInput::Straight, seconds);
        let range = hypot(x - at.x, y - at.y) - parameters.danger_radius_m;
        assert!(range >= promised - 0.02, "{i}: {range} < {promised}");
    }
}

#[test]
fn a_figure_says_what_its_signs_mean() {
    let mut playback = playback();
    let view = View { shown: [true; LAYERS.len()], ..at(3.0) };
    playback.go(&view).unwrap();
    let figure = playback.figure(&view, "study / participant 1 / task 1");
    let svg = figure.svg();
    for expected in ["participant 1", "t = 3.0 s", "F₅: ε = 1.00 rad/s", "best avoidance"] {
        assert!(svg.contains(expected), "{expected}");
    }
    assert_eq!(playback.legend(&View { shown: [false; LAYERS.len()], ..at(3.0) }).len(), 2);
}

#[test]
fn states_that_are_missing_are_named() {
    let Recorded { parameters, scene, inputs, mut states } = playback().recorded().clone();
    states.pop();
    let found = Playback::new(Recorded { parameters, scene, inputs, states }).err().unwrap();
    assert_eq!(found.to_string(), "states: expected 51, one more than inputs, found 50");
}

/// Sets learned from recorded futures need no safety levels and have no probabilities of inputs.
#[test]
fn learned_sets_are_shown_without_a_function() {
    let recorded = playback().recorded().clone();
    let Recorded { parameters, inputs, states, .. } = &recorded;
    let earlier = [Trajectory::driven(states.clone(), inputs, parameters).unwrap()];
    for (way, level) in
        [(Way::Empirical, "share of futures"), (Way::Gaussian, "Mahalanobis radius")]
    {
        let Needs::Trials(family) = way.needs() else { panic!("{way:?}") };
        let mut playback = Playback::new(recorded.clone()).unwrap();
        let sets = source::fitted(family, parameters, &earlier).unwrap().sets;
        playback.use_method(Some(sets.into())).unwrap();
        assert!(playback.empirical().is_some() && playback.learned().is_none());
        assert_eq!(
            (playback.sets().count(), playback.steps_ahead()),
            (0, 10),
            "nothing is predicted yet"
        );
        let view = View { shown: [true; LAYERS.len()], ..at(3.0) };
        playback.go(&view).unwrap();
        assert_eq!((playback.probabilities(), playback.forecast().len()), (None, 0));
        assert_eq!(playback.sets().count(), 5);
        let figure = playback.figure(&view, "").svg();
        assert!(figure.contains(&format!("F₁: where the human may be within 2.0 s, {level} ")));
        assert!(figure.contains(", the worst case"));
        assert!(!figure.contains("rad/s") && !figure.contains("likely futures"));
        // At the end of a step, the held input is the input of that step. Within the next step, the
        // held input is the input of the next step.
        for (time_s, held) in [(0.0, TurnInput::Straight), (1.0, inputs[4]), (1.05, inputs[5])] {
            playback.go(&at(time_s)).unwrap();
            let mut expected = source::fitted(family, parameters, &earlier).unwrap().sets;
            expected.place(playback.now().state.human, held);
            assert_eq!(playback.empirical().unwrap().sets(), expected.sets(), "{time_s}");
        }
        assert_ne!(inputs[4], inputs[5]);
    }
}

/// The legend of two pictures has the levels of both.
#[test]
fn two_pictures_have_one_legend() {
    let (mut first, mut second) = (playback(), playback());
    let Recorded { parameters, inputs, states, .. } = first.recorded().clone();
    let earlier = [Trajectory::driven(states, &inputs, &parameters).unwrap()];
    first.go(&at(3.0)).unwrap();
    second.go(&at(3.0)).unwrap();
    let texts = |first: &Playback, second: &Playback| -> Vec<String> {
        let items = legend_of_both(first, second, &at(3.0)).into_iter();
        items.map(|item| item.text).collect()
    };
    let alone: Vec<String> = first.legend(&at(3.0)).into_iter().map(|item| item.text).collect();
    assert_eq!(texts(&first, &second), alone);
    let family = crate::shfrs::baselines::EmpiricalFamily::Empirical;
    let sets = source::fitted(family, &parameters, &earlier).unwrap().sets;
    second.use_method(Some(sets.into())).unwrap();
    second.go(&at(3.0)).unwrap();
    let both = texts(&first, &second);
    assert_eq!(both[..alone.len()], alone);
    assert_eq!(both.len(), alone.len() + 5);
    assert_eq!(both.last().unwrap(), "beside: F₅: share of futures 1.00, the worst case");
}
