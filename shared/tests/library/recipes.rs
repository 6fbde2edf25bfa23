//! The recipes of CONTRIBUTING.md. Each takes a few lines.

use core::ops::ControlFlow;
use sidestep::bounds::{
    ActionChoice, ActionModel, ActionSpace, BoundsSettings, Rollout, input_bounds,
};
use sidestep::features::{Compute, FEATURES, Feature, FeatureSet};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::reachability::cartesian::{Problem, Settings, solve};
use sidestep::reachability::{Axis, Game, Grid, Real, Scheme, TERMS};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::vehicle::Pose;

fn now() -> JointState {
    JointState { human: Pose::new(1.0, 2.0, 0.0), robot: Pose::new(4.0, 6.0, 3.0) }
}

fn safety() -> SafetyLevels {
    let parameters = SceneParameters::default();
    SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).expect("equal vehicles")
}

/// A feature is one entry of the table, which contains its column in files, its meaning, and how to
/// compute it.
#[test]
fn a_feature_is_one_entry() {
    let bearing = Feature {
        name: "bearing",
        unit: "rad",
        meaning: "direction from the human to the robot, world frame",
        compute: Compute::FromMotion(|history| {
            let JointState { human, robot } = history[history.len() - 1];
            sidestep::math::atan2(robot.y - human.y, robot.x - human.x)
        }),
    };
    let safety = safety();
    assert!((bearing.value(&[now()], &safety) - sidestep::math::atan2(4.0, 3.0)).abs() < 1e-15);
    // Every feature of the table can be used in a set, in a predictor.json and in a dataset.
    for feature in FEATURES {
        let set = FeatureSet::of(&[feature.name]).expect("a feature of the table");
        let mut row = [f64::NAN];
        set.compute_into(&[now()], &safety, &mut row);
        assert_eq!(
            row[0].to_bits(),
            feature.value(&[now()], &safety).to_bits(),
            "{}",
            feature.name
        );
        let predictor = Predictor::constant(set, vec![0], vec![1.0]).expect("a predictor");
        let text = serde_json::to_string(&PredictorFile::from(&predictor)).expect("a document");
        let file: PredictorFile = serde_json::from_str(&text).expect("the same document");
        assert_eq!(Predictor::try_from(file), Ok(predictor));
    }
}

/// A custom predictor for Algorithm 1. It predicts a human who turns away from a robot on the left.
#[test]
fn a_predictor_is_two_methods() {
    struct Avoider;
    impl ActionModel for Avoider {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(&[-0.5, 0.0, 0.5]) // rad/s
        }
        fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
            let [_, left, _] = history[history.len() - 1].robot_seen_by_human();
            out.copy_from_slice(if left > 0.0 { &[0.8, 0.2, 0.0] } else { &[0.0, 0.2, 0.8] });
        }
    }
    let choice = ActionChoice::TopK(vec![1; 3]);
    let settings = BoundsSettings::new(vec![0.0], choice, Rollout::Base, 3).expect("settings");
    let found = input_bounds(&[now()], &SceneParameters::default(), &Avoider, |_| 0.0, &settings);
    assert_eq!(found.expect("bounds").raw[0], (-0.5, -0.5));
}

/// Each kind of model has a file in `predict`, a name in predictor.json and a section in
/// docs/predictor.md.
#[test]
fn every_kind_of_model_is_described() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| std::fs::read_to_string(root.join(path)).expect("a file");
    let document = read("../docs/predictor.md");
    let unknown = r#"{"format":"sidestep-predictor/1","kind":"x","features":[],"classes":[]}"#;
    let said = sidestep::document::from_json::<PredictorFile>(unknown).unwrap_err().to_string();
    let (_, kinds) = said.split_once("expected ").expect("the kinds that there are");
    let (kinds, _) = kinds.split_once(", found").expect("what was found");
    let kinds: Vec<&str> = kinds.split([',', ' ']).filter(|w| !matches!(*w, "" | "or")).collect();
    assert!(kinds.len() >= 5, "{said}");
    for kind in kinds {
        assert!(document.contains(&format!("\n### {kind}\n")), "no section on {kind}");
        let file = read(&format!("src/predict/{}.rs", kind.replace("boosted", "boosting")));
        assert!(file.contains(&format!("pub fn {kind}(")), "no Predictor::{kind}");
        assert!(file.contains("impl Kind for "), "{kind} implements no Kind");
    }
}

/// A custom game of two runners on a line. The state x is the lead of the evader (m). The evader
/// runs at up to 1 m/s and the pursuer at up to 2 m/s, so ẋ = a − b.
#[test]
fn a_game_is_three_methods() {
    struct Chase;
    impl Game<1> for Chase {
        fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
            [0.0; TERMS]
        }
        fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; 1], [p]: [T; 1]) -> T {
            p.abs() - T::from_f64(2.0) * p.abs()
        }
        fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; 1]) -> [T; 1] {
            [T::from_f64(3.0)]
        }
    }
    // V is the minimum distance within 1 s, minus 0.5 m. In this time, the lead shrinks by 1 m.
    let grid = Grid { axes: [Axis::bounded(-4.0, 4.0, 161)] };
    let near = |[x]: [f64; 1]| x.abs() - 0.5;
    let problem = Problem::reach(&Chase, grid, &near, 1.0);
    let settings = Settings::new(Scheme::Weno5);
    let solution = solve::<f64, 1, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()));
    let solution = solution.expect("a solution");
    // Node 140 is x = 3 m.
    assert!((solution.values[140] - 1.5).abs() < 1e-3, "{}", solution.values[140]);
}
