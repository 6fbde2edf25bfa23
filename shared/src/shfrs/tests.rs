use super::*;
use crate::features::FeatureSet;
use crate::vehicle::Pose;

fn setup(probabilities: [f64; 3]) -> (SceneParameters, SafetyLevels, Predictor) {
    let parameters = SceneParameters::default();
    let progress = &mut |_| core::ops::ControlFlow::Continue(());
    let safety = SafetyLevels::solve(&parameters, progress).unwrap();
    let features = FeatureSet::subset("hrd").unwrap();
    let predictor = Predictor::constant(features, vec![-1, 0, 1], probabilities.to_vec()).unwrap();
    (parameters, safety, predictor)
}

fn sets(probabilities: [f64; 3]) -> Shfrs {
    let (parameters, safety, predictor) = setup(probabilities);
    let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
    let now = JointState { human: Pose::new(1.0, 2.0, 0.5), robot: Pose::new(9.0, 2.0, 3.0) };
    predict(&[now], &parameters, &human, &ShfrsSettings::paper(3).unwrap()).unwrap()
}

/// The paper's settings of Figure 3, left, with a predictor that expects a turn to the right.
/// The expected areas (m²) come from the reference sketch of the replay page.
#[test]
fn areas_of_a_human_who_turns_right() {
    let areas: Vec<f64> = sets([0.6, 0.3, 0.1]).sets.iter().map(|set| set.area_m2).collect();
    for (found, expected) in areas.iter().zip([1.22, 2.05, 2.60, 3.43, 5.33]) {
        assert!((found - expected).abs() < 0.01, "{areas:?}");
    }
}

#[test]
fn the_last_set_is_everything_that_can_be_reached() {
    for probabilities in [[0.6, 0.3, 0.1], [0.1, 0.8, 0.1], [0.4, 0.2, 0.4]] {
        let shfrs = sets(probabilities);
        assert!((shfrs.sets[4].area_m2 - 16.0 / 3.0).abs() < 0.01);
        assert!(shfrs.sets.windows(2).all(|pair| pair[0].area_m2 <= pair[1].area_m2 + 1e-9));
    }
}

#[test]
fn a_prediction_ends_when_it_is_told() {
    let (parameters, safety, predictor) = setup([0.6, 0.3, 0.1]);
    let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
    let now = [JointState { human: Pose::new(1.0, 2.0, 0.5), robot: Pose::new(9.0, 2.0, 3.0) }];
    let settings = ShfrsSettings::paper(3).unwrap().with_by_step(true);
    let whole = predict(&now, &parameters, &human, &settings).unwrap();
    // Five tubes and fifty step polygons.
    for (most, ends) in [(0, true), (1, true), (30, true), (54, true), (55, false)] {
        let (mut online, mut asked) = (ShfrsPredictor::default(), 0);
        let goes_on = &mut || {
            asked += 1;
            if asked > most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let found = online.predict_while(&now, &parameters, &human, &settings, goes_on);
        assert_eq!(found.unwrap().is_none(), ends, "{most}");
        assert_eq!(online.shfrs().sets.is_empty(), ends);
        assert_eq!(online.predict(&now, &parameters, &human, &settings).unwrap(), &whole);
    }
}

/// A predictor reused for frames with different settings gives the same results as a new one.
#[test]
fn nothing_is_left_from_the_frame_before() {
    let (parameters, safety, predictor) = setup([0.6, 0.3, 0.1]);
    let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
    let mut reused = ShfrsPredictor::default();
    for (by_step, sets, steps) in [(true, 5, 10), (false, 2, 4), (true, 3, 12)] {
        let epsilon = [0.0, 0.15, 0.25, 0.4, 1.0][..sets].to_vec();
        let choice = ActionChoice::TopK(vec![2; steps]);
        let bounds = BoundsSettings::new(epsilon, choice, Rollout::Base, 3).unwrap();
        let settings = ShfrsSettings { bounds, by_step, ..ShfrsSettings::paper(3).unwrap() };
        let human_at = Pose::new(1.0, 2.0, 0.1 * steps as f64);
        let now = [JointState { human: human_at, robot: Pose::new(9.0, 2.0, 3.0) }];
        let found = reused.predict(&now, &parameters, &human, &settings).unwrap();
        assert_eq!(found, &predict(&now, &parameters, &human, &settings).unwrap());
        assert_eq!(found.sets.len(), sets);
        assert!(found.sets.iter().all(|set| set.steps.len() == if by_step { steps } else { 0 }));
    }
}

#[test]
fn every_polygon_says_of_which_kind_it_is() {
    let (parameters, safety, predictor) = setup([0.6, 0.3, 0.1]);
    let human = PredictedHuman::new(&predictor, &safety, &parameters).unwrap();
    let now = [JointState { human: Pose::new(1.0, 2.0, 0.5), robot: Pose::new(9.0, 2.0, 3.0) }];
    let usual = ShfrsSettings { by_step: true, ..ShfrsSettings::paper(3).unwrap() };
    let kinds = |polygon| {
        let settings = ShfrsSettings { polygon, ..usual.clone() };
        let sets = predict(&now, &parameters, &human, &settings).unwrap().sets;
        assert!(sets.iter().all(|set| set.step_outlines.len() == set.steps.len()));
        let kinds = sets.into_iter().map(|set| [set.step_outlines, vec![set.tube_outline]]);
        kinds.flatten().flatten().collect::<Vec<_>>()
    };
    let refined = |kind: &Outline| *kind == Outline::Refined { margin_m: 0.0 };
    assert!(kinds(usual.polygon).iter().all(refined));
    let convex = kinds(usual.polygon.with_most_work(0));
    assert!(convex.iter().all(|kind| *kind == Outline::ConvexHull));
    let surely = kinds(usual.polygon.conservative());
    assert!(
        surely.iter().any(|kind| matches!(kind, Outline::Refined { margin_m } if *margin_m > 0.0))
    );
}

#[test]
fn classes_that_are_no_turns_need_their_actions() {
    let (parameters, safety, _) = setup([0.6, 0.3, 0.1]);
    let features = FeatureSet::subset("hrd").unwrap();
    let five = Predictor::constant(features, vec![-2, -1, 0, 1, 2], vec![0.2; 5]).unwrap();
    let complaint = PredictedHuman::new(&five, &safety, &parameters).err().unwrap();
    assert_eq!((complaint.field.as_str(), complaint.found.as_str()), ("classes[0]", "-2"));
    let actions = vec![-0.5, -0.2, 0.0, 0.2, 0.5];
    let five = five.with_actions(actions.clone()).unwrap();
    let human = PredictedHuman::new(&five, &safety, &parameters).unwrap();
    assert_eq!(human.actions().rates(), actions);
}
