//! The paper's claims about Algorithm 1 (Theorem 1 and its corollaries), tested with random models,
//! widenings, numbers of actions and horizons. Also tests a claim that is not a theorem.

use std::cell::RefCell;

use sidestep::bounds::{
    ActionChoice, ActionModel, ActionSpace, Algorithm1, BoundsSettings, InputBounds, Motion,
    PredictedBounds, Rollout, input_bounds,
};
use sidestep::math::{PI, SeededRng};
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::vehicle::{Pose, dubins};

/// An arbitrary function of the whole history, so its values for two histories are unrelated. The
/// weights are small integers, so that there are many ties.
struct Arbitrary {
    seed: u64,
    /// Levels, or the edges of bins.
    actions: Vec<f64>,
    bins: bool,
    highest_weight: usize,
}

impl ActionModel for Arbitrary {
    fn actions(&self) -> ActionSpace<'_> {
        match self.bins {
            true => ActionSpace::Bins(&self.actions),
            false => ActionSpace::Levels(&self.actions),
        }
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        let mixed = history.iter().fold(self.seed, |hash, state| {
            let bits = state.human.x.to_bits() ^ state.human.psi.to_bits().rotate_left(17);
            (hash ^ bits ^ state.robot.y.to_bits().rotate_left(31))
                .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        });
        let mut rng = SeededRng::new(mixed);
        out.iter_mut().for_each(|p| *p = (1 + rng.below(self.highest_weight)) as f64);
        let total: f64 = out.iter().sum();
        out.iter_mut().for_each(|p| *p /= total);
    }
}

/// A random problem with all inputs of Algorithm 1.
struct Problem {
    history: Vec<JointState>,
    motion: Motion,
    model: Arbitrary,
    choice: ActionChoice,
    rollout: Rollout,
}

impl Problem {
    fn random(seed: u64) -> Self {
        let mut rng = SeededRng::new(seed);
        let motion = Motion {
            human_speed_mps: rng.uniform(0.5, 3.0),
            human_turn_rate: (rng.uniform(-0.8, 0.0), rng.uniform(0.0, 0.8)),
            step_s: rng.uniform(0.1, 0.3),
            ..Motion::from(&SceneParameters::default())
        };
        let mut pose =
            || Pose::new(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-PI, PI));
        let history = [(); 3].map(|()| JointState { human: pose(), robot: pose() }).to_vec();
        let (least, most) = motion.human_turn_rate;
        let actions: Vec<f64> = (0..1 + rng.below(6)).map(|_| rng.uniform(least, most)).collect();
        let steps = 1 + rng.below(20);
        let choice = if rng.below(3) == 0 {
            ActionChoice::Adaptive { tau: rng.uniform(0.01, 1.0), steps }
        } else {
            ActionChoice::TopK((0..steps).map(|_| 1 + rng.below(actions.len())).collect())
        };
        let rollout = if rng.below(2) == 0 { Rollout::Paper } else { Rollout::Base };
        let mut model = Arbitrary {
            seed: rng.below(1 << 30) as u64,
            actions,
            bins: false,
            highest_weight: 1 + rng.below(9),
        };
        // A third of the problems select shortest intervals, most of them of bins.
        let mut rng = SeededRng::new(!seed ^ 0x5a5a);
        let choice = match rng.below(3) {
            0 => {
                model.bins = model.actions.len() > 1;
                if model.bins {
                    model.actions.sort_unstable_by(f64::total_cmp);
                }
                ActionChoice::Interval((0..steps).map(|_| 1.0 - rng.unit()).collect())
            }
            _ => choice,
        };
        Self { history, motion, model, choice, rollout }
    }

    fn solve(
        &self,
        algorithm: &mut Algorithm1,
        epsilon: Vec<f64>,
        rollout: Rollout,
    ) -> PredictedBounds {
        let actions = self.model.actions().len();
        let settings = BoundsSettings::new(epsilon, self.choice.clone(), rollout, actions);
        let settings = settings.expect("settings");
        let left = |states: &[JointState]| 0.3 * (states.len() % 2) as f64;
        algorithm
            .run(&self.history, &self.motion, &self.model, left, &settings)
            .expect("bounds")
            .clone()
    }
}

/// Random widenings in ascending order. The last one is large enough for the full range.
fn widenings(rng: &mut SeededRng) -> Vec<f64> {
    let mut epsilon = vec![if rng.below(3) == 0 { 0.0 } else { rng.uniform(0.0, 0.5) }];
    for _ in 0..rng.below(5) {
        // Equal widenings are allowed.
        let step = if rng.below(4) == 0 { 0.0 } else { rng.uniform(0.0, 0.3) };
        epsilon.push(epsilon[epsilon.len() - 1] + step);
    }
    epsilon.push(epsilon[epsilon.len() - 1] + 2.0);
    epsilon
}

fn lies_within(inner: &InputBounds, outer: &InputBounds) -> bool {
    let steps = inner.steps();
    steps == outer.steps()
        && (0..steps).all(|i| outer.lo()[i] <= inner.lo()[i] && inner.hi()[i] <= outer.hi()[i])
}

const PROBLEMS: u64 = 10_000;

/// Theorem 1: F_j ⊆ F_{j+1}, because every action that is admissible for F_j is admissible for
/// F_{j+1}. Also tests the premise of the second corollary: F_F admits every turn rate, so it
/// contains every trajectory.
#[test]
fn within_one_run_sets_are_nested() {
    // All runs share one workspace, because state left from the previous run must not matter.
    let mut algorithm = Algorithm1::default();
    for seed in 0..PROBLEMS {
        let problem = Problem::random(seed);
        let epsilon = widenings(&mut SeededRng::new(!seed));
        let found = problem.solve(&mut algorithm, epsilon.clone(), problem.rollout);
        assert_eq!(found.sets.len(), epsilon.len());
        for pair in found.sets.windows(2) {
            assert!(lies_within(&pair[0], &pair[1]), "problem {seed}: {found:?}");
        }
        let (least, most) = problem.motion.human_turn_rate;
        let last = &found.sets[found.sets.len() - 1];
        assert!(last.lo().iter().all(|&lo| lo == least), "problem {seed}");
        assert!(last.hi().iter().all(|&hi| hi == most), "problem {seed}");
        // The checked constructor accepts all bounds.
        for set in &found.sets {
            InputBounds::new(set.lo().to_vec(), set.hi().to_vec(), (least, most)).unwrap();
        }
        let fresh = problem.solve(&mut Algorithm1::default(), epsilon, problem.rollout);
        assert_eq!(found, fresh, "problem {seed}");
    }
}

/// Corollaries 1 and 2: a trajectory inside F_j is inside F_{j+1}. Therefore the shares of
/// trajectories increase with j, and the last share is 1.
#[test]
fn shares_of_trajectories_ascend_to_one() {
    let mut algorithm = Algorithm1::default();
    for seed in 0..PROBLEMS {
        let problem = Problem::random(seed);
        let mut rng = SeededRng::new(!seed);
        let found = problem.solve(&mut algorithm, widenings(&mut rng), problem.rollout);
        let (least, most) = problem.motion.human_turn_rate;
        let mut inside = vec![0; found.sets.len()];
        for _ in 0..20 {
            // Some trajectories are random, and others stay near the bounds before widening.
            let wide = rng.uniform(0.0, 0.5);
            let inputs: Vec<f64> = (found.raw.iter())
                .map(|&(lo, hi)| rng.uniform(lo - wide, hi + wide + 1e-9).clamp(least, most))
                .collect();
            let admissible = |set: &InputBounds| {
                (inputs.iter().zip(set.lo()).zip(set.hi())).all(|((u, lo), hi)| lo <= u && u <= hi)
            };
            for (count, set) in inside.iter_mut().zip(&found.sets) {
                *count += usize::from(admissible(set));
            }
        }
        assert!(inside.is_sorted(), "problem {seed}: {inside:?}");
        assert_eq!(inside[inside.len() - 1], 20, "problem {seed}");
    }
}

/// With base roll-outs, a larger ε never gives a smaller set. This does not hold for the paper's
/// roll-outs.
#[test]
fn with_base_rollouts_sets_grow_with_epsilon() {
    let mut algorithm = Algorithm1::default();
    for seed in 0..PROBLEMS {
        let problem = Problem::random(seed);
        let mut rng = SeededRng::new(!seed);
        let (small, more) = (rng.uniform(0.0, 0.4), rng.uniform(0.0, 0.3));
        let narrow = problem.solve(&mut algorithm, vec![small], Rollout::Base);
        let wide = problem.solve(&mut algorithm, vec![small + more], Rollout::Base);
        assert_eq!(narrow.raw, wide.raw, "problem {seed}");
        assert!(lies_within(&narrow.sets[0], &wide.sets[0]), "problem {seed}");
    }
}

/// A person who turns left or right at random when looking straight ahead, and otherwise drives
/// straight.
struct Undecided;

impl ActionModel for Undecided {
    fn actions(&self) -> ActionSpace<'_> {
        ActionSpace::Levels(&[-0.5, 0.0, 0.5])
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        let psi = history[history.len() - 1].human.psi;
        let first = history.len() == 1;
        let torn = !first && psi.abs() < 0.031;
        out.copy_from_slice(if torn { &[0.4, 0.2, 0.4] } else { &[0.1, 0.8, 0.1] });
    }
}

/// No theorem excludes that a larger ε gives a smaller set. The paper's roll-outs follow the bounds
/// of F_1 itself, so a wider F_1 evaluates the model in other states. In this example, the
/// roll-outs with ε_1 = 0.16 rad/s leave the states in which the human is undecided between left
/// and right. The resulting set does not contain the set with ε_1 = 0.15.
#[test]
fn with_the_papers_rollouts_a_larger_epsilon_can_give_a_smaller_set() {
    let history = [JointState { human: Pose::new(0.0, 0.0, 0.0), robot: Pose::new(9.0, 0.0, 3.0) }];
    let parameters = SceneParameters::default();
    let set = |epsilon, rollout| {
        let choice = ActionChoice::TopK(vec![1, 1]);
        let settings = BoundsSettings::new(vec![epsilon], choice, rollout, 3).unwrap();
        let found = input_bounds(&history, &parameters, &Undecided, |_| 0.0, &settings).unwrap();
        ReachableSet::new(history[0].human, &found.sets[0], 2.0, 0.2).unwrap()
    };
    let sticks_out = |rollout| {
        let polygon = |epsilon| set(epsilon, rollout).step_polygon(2, PolygonSettings::default());
        let outer = polygon(0.16);
        polygon(0.15).iter().map(|&p| signed_distance(&outer, p)).fold(f64::MIN, f64::max)
    };
    assert!(sticks_out(Rollout::Paper) > 5e-3, "{}", sticks_out(Rollout::Paper));
    assert!(sticks_out(Rollout::Base) < 1e-4, "{}", sticks_out(Rollout::Base));
}

/// The model gets the past, followed by the states of one roll-out.
#[test]
fn the_model_sees_the_past_and_one_rollout() {
    struct Listening(RefCell<Vec<Vec<JointState>>>);
    impl ActionModel for Listening {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(&[-0.5, 0.0, 0.5])
        }

        fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
            self.0.borrow_mut().push(history.to_vec());
            out.copy_from_slice(&[0.3, 0.4, 0.3]);
        }
    }
    let pose = |x: f64| Pose::new(x, 0.1 * x, 0.2);
    let history: Vec<JointState> = (0..4)
        .map(|i| JointState { human: pose(f64::from(i)), robot: pose(9.0 - f64::from(i)) })
        .collect();
    let model = Listening(RefCell::default());
    let choice = ActionChoice::TopK(vec![1, 3, 1]);
    let settings = BoundsSettings::new(vec![0.1], choice, Rollout::Paper, 3).unwrap();
    let parameters = SceneParameters::default();
    let found = input_bounds(&history, &parameters, &model, |_| 0.0, &settings).unwrap();
    let asked = model.0.into_inner();
    // The model is called once for the present, which both roll-outs share, and then for each
    // roll-out.
    assert_eq!(asked.iter().map(Vec::len).collect::<Vec<_>>(), [4, 5, 5, 6, 6]);
    assert_eq!(asked[0], history);
    for (i, states) in asked.iter().enumerate() {
        assert_eq!(states[..4], history);
        let rollout = if i % 2 == 1 { &found.low } else { &found.high };
        assert_eq!(states[3..], rollout[..states.len() - 3]);
    }
    let human = |states: &[JointState], rate| dubins::arc(states[0].human, 2.0, rate, 0.2);
    assert_eq!(found.low[1].human, human(&found.low, -0.1));
    assert_eq!(found.high[1].human, human(&found.high, 0.1));
}

/// Polygons satisfy the theorem up to their accuracy: the vertices of F_j are in F_{j+1}, up to the
/// requested accuracy of its edges. Where headings span more than a quarter turn, polygons exceed
/// the accuracy a few times at sharp corners.
#[test]
fn drawn_sets_are_nested_within_their_accuracy() {
    let mut algorithm = Algorithm1::default();
    let drawn = PolygonSettings::new(1e-3, 4).unwrap();
    for seed in 0..40 {
        let problem = Problem::random(seed);
        let epsilon = widenings(&mut SeededRng::new(!seed));
        let found = problem.solve(&mut algorithm, epsilon, problem.rollout);
        let motion = &problem.motion;
        let set = |bounds| {
            ReachableSet::new(
                Pose::new(0.0, 0.0, 0.0),
                bounds,
                motion.human_speed_mps,
                motion.step_s,
            )
            .unwrap()
        };
        let sets: Vec<ReachableSet> = found.sets.iter().map(set).collect();
        let (least, most) = motion.human_turn_rate;
        let turn = least.abs().max(most) * motion.step_s * sets[0].steps() as f64;
        let allowed = if turn <= PI / 2.0 { 1.0 } else { 4.0 } * drawn.accuracy_m();
        let check = |of: &dyn Fn(&ReachableSet) -> Vec<[f64; 2]>, what: &str| {
            let polygons: Vec<_> = sets.iter().map(of).collect();
            for (j, pair) in polygons.windows(2).enumerate() {
                for &vertex in &pair[0] {
                    let out = signed_distance(&pair[1], vertex);
                    assert!(out <= allowed, "problem {seed} {what} {j}: {out} m");
                }
            }
        };
        check(&|set| set.tube_polygon(drawn), "tube");
        for step in [1, sets[0].steps()] {
            check(&|set| set.step_polygon(step, drawn), &format!("step {step}"));
        }
    }
}
