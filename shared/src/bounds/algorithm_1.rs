//! Algorithm 1 of the paper.

use super::action_space::ShortestInterval;
use super::{ActionChoice, ActionModel, ActionSpace, BoundsSettings, InputBounds, Motion, Rollout};
use crate::invalid::Invalid;
use crate::scene::{JointState, SceneParameters};
use crate::stats::rank::TIE;
use crate::vehicle::dubins;

/// The result of Algorithm 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PredictedBounds {
    /// The bounds of each set F_j.
    pub sets: Vec<InputBounds>,
    /// The bounds of each step before widening (rad/s).
    pub raw: Vec<(f64, f64)>,
    /// The T + 1 states of the roll-out along the low bounds, starting with the present state.
    pub low: Vec<JointState>,
    /// The T + 1 states of the roll-out along the high bounds, starting with the present state.
    pub high: Vec<JointState>,
}

/// Algorithm 1 of the paper with reusable buffers. A run allocates nothing if the previous run
/// succeeded, chose actions in the same way, and had at least as many states, steps, sets and actions.
#[derive(Clone, Debug, Default)]
pub struct Algorithm1 {
    /// Past and predicted states, along the low and along the high bounds.
    low: Vec<JointState>,
    high: Vec<JointState>,
    likely: LikelyActions,
    found: PredictedBounds,
}

impl Algorithm1 {
    /// Bounds on the human's turn rate for each future step and each set.
    ///
    /// `history` contains every joint state of the trial up to now, at least one. `robot_action`
    /// (`getRobotAction`) returns the robot's turn rate (rad/s) from the states so far. Like the
    /// model, it is evaluated along both roll-outs and must be deterministic. Step indices count
    /// from the present step.
    ///
    /// # Errors
    /// [`Invalid`] if there is no state; a coordinate is not finite; a field of `motion` is
    /// invalid; an action of the human or the robot is outside the vehicle's turn rate; the model's
    /// number of actions differs from the number in the settings; or the model's probabilities are
    /// not numbers ≥ 0 that sum to 1 within 10⁻⁶.
    pub fn run(
        &mut self,
        history: &[JointState],
        motion: &Motion,
        model: &impl ActionModel,
        robot_action: impl Fn(&[JointState]) -> f64,
        settings: &BoundsSettings,
    ) -> Result<&PredictedBounds, Invalid> {
        check(history, motion, model.actions(), settings)?;
        self.start(history, settings.epsilon.len());
        for i in 0..settings.steps() {
            let mut raw = self.likely.range(model, &self.low, settings, i)?;
            // While both roll-outs are equal, their likely actions are equal too.
            let differ = self.low != self.high;
            if differ {
                let other = self.likely.range(model, &self.high, settings, i)?;
                raw = (raw.0.min(other.0), raw.1.max(other.1));
            }
            self.found.raw.push(raw);
            for (set, &epsilon) in self.found.sets.iter_mut().zip(&settings.epsilon) {
                let (lo, hi) = widened(raw, epsilon, motion.human_turn_rate);
                set.lo.push(lo);
                set.hi.push(hi);
            }
            let epsilon = match settings.rollout {
                Rollout::Paper => settings.epsilon[0],
                Rollout::Base => 0.0,
            };
            let (lo, hi) = widened(raw, epsilon, motion.human_turn_rate);
            let robot_low = turn_of_robot(robot_action(&self.low), motion, i)?;
            let robot_high = if differ {
                turn_of_robot(robot_action(&self.high), motion, i)?
            } else {
                robot_low
            };
            advance(&mut self.low, lo, robot_low, motion);
            advance(&mut self.high, hi, robot_high, motion);
        }
        let now = history.len() - 1;
        self.found.low.extend_from_slice(&self.low[now..]);
        self.found.high.extend_from_slice(&self.high[now..]);
        Ok(&self.found)
    }

    /// The result of the last run. It is empty before the first run and incomplete after an error.
    #[must_use]
    pub fn found(&self) -> &PredictedBounds {
        &self.found
    }

    /// Clears all buffers, keeping their capacity, and copies `history`.
    fn start(&mut self, history: &[JointState], sets: usize) {
        for path in [&mut self.low, &mut self.high] {
            path.clear();
            path.extend_from_slice(history);
        }
        let found = &mut self.found;
        found.sets.resize_with(sets, || InputBounds { lo: Vec::new(), hi: Vec::new() });
        for set in &mut found.sets {
            set.lo.clear();
            set.hi.clear();
        }
        found.raw.clear();
        found.low.clear();
        found.high.clear();
    }
}

/// Runs [`Algorithm1::run`] once, for the vehicles of `parameters`.
///
/// # Errors
/// The errors of [`Algorithm1::run`].
pub fn input_bounds(
    history: &[JointState],
    parameters: &SceneParameters,
    model: &impl ActionModel,
    robot_action: impl Fn(&[JointState]) -> f64,
    settings: &BoundsSettings,
) -> Result<PredictedBounds, Invalid> {
    let mut algorithm = Algorithm1::default();
    algorithm.run(history, &Motion::from(parameters), model, robot_action, settings)?;
    Ok(algorithm.found)
}

fn check(
    history: &[JointState],
    motion: &Motion,
    actions: ActionSpace<'_>,
    settings: &BoundsSettings,
) -> Result<(), Invalid> {
    if history.is_empty() {
        return Err(Invalid::new("history", "at least one state", "none"));
    }
    for (i, state) in history.iter().enumerate() {
        state.check().map_err(|invalid| invalid.within(&format!("history[{i}]")))?;
    }
    motion.check().map_err(|invalid| invalid.within("motion"))?;
    if actions.len() != settings.actions {
        let expected = format!("{} actions, as in the settings", settings.actions);
        return Err(Invalid::new("actions", expected, actions.len()));
    }
    if let ActionSpace::Bins(_) = actions {
        actions.check()?;
        if !matches!(settings.choice, ActionChoice::Interval(_)) {
            let expected = "q, because the model has bins of turn rates";
            return Err(Invalid::new("settings", expected, &settings.choice));
        }
    }
    let (least, most) = motion.human_turn_rate;
    let rates = actions.rates();
    if let Some(a) = rates.iter().position(|rate| !(least..=most).contains(rate)) {
        let expected = format!("a turn rate from {least} to {most} rad/s");
        return Err(Invalid::new(format!("actions[{a}]"), expected, rates[a]));
    }
    Ok(())
}

/// The bounds widened by `epsilon` on both sides, but not beyond `range`.
fn widened((lo, hi): (f64, f64), epsilon: f64, range: (f64, f64)) -> (f64, f64) {
    ((lo - epsilon).max(range.0), (hi + epsilon).min(range.1))
}

fn turn_of_robot(rate: f64, motion: &Motion, i: usize) -> Result<f64, Invalid> {
    let (least, most) = motion.robot_turn_rate;
    if (least..=most).contains(&rate) {
        return Ok(rate);
    }
    let expected = format!("a turn rate from {least} to {most} rad/s");
    Err(Invalid::new(format!("robot_action of step {i}"), expected, rate))
}

/// Appends the state after one more step.
fn advance(path: &mut Vec<JointState>, human_turn: f64, robot_turn: f64, motion: &Motion) {
    if let Some(&JointState { human, robot }) = path.last() {
        path.push(JointState {
            human: dubins::arc(human, motion.human_speed_mps, human_turn, motion.step_s),
            robot: dubins::arc(robot, motion.robot_speed_mps, robot_turn, motion.step_s),
        });
    }
}

/// Largest accepted deviation of the sum of probabilities from 1.
const SUM_TOLERANCE: f64 = 1e-6;

/// Finds the likely actions (getTopKPredictedHumanActions).
#[derive(Clone, Debug, Default)]
struct LikelyActions {
    probabilities: Vec<f64>,
    sorted: Vec<f64>,
    shortest: ShortestInterval,
}

impl LikelyActions {
    /// Lowest and highest turn rate among the likely actions at future step `i`.
    fn range(
        &mut self,
        model: &impl ActionModel,
        history: &[JointState],
        settings: &BoundsSettings,
        i: usize,
    ) -> Result<(f64, f64), Invalid> {
        let actions = model.actions();
        self.probabilities.clear();
        self.probabilities.resize(actions.len(), f64::NAN);
        model.probabilities(history, &mut self.probabilities);
        if let Some(a) = self.probabilities.iter().position(|p| !(p.is_finite() && *p >= 0.0)) {
            let field = format!("probabilities[{a}] of step {i}");
            return Err(Invalid::new(field, "a finite number ≥ 0", self.probabilities[a]));
        }
        let total: f64 = self.probabilities.iter().sum();
        if (total - 1.0).abs() > SUM_TOLERANCE {
            let field = format!("probabilities of step {i}");
            return Err(Invalid::new(field, "numbers that sum to 1", total));
        }
        let least = match &settings.choice {
            ActionChoice::Interval(q) => {
                return Ok(self.shortest.find(actions, &self.probabilities, q[i]));
            }
            ActionChoice::Adaptive { tau, .. } => {
                tau.min(self.probabilities.iter().copied().fold(0.0, f64::max))
            }
            ActionChoice::TopK(k) => self.highest(k[i]),
        };
        // Rounding by a softmax or a file does not separate equal probabilities.
        let threshold = least - TIE;
        let rates = actions.rates().iter();
        let likely = rates.zip(&self.probabilities).filter(|&(_, &p)| p >= threshold);
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        Ok(likely.fold(none, |(lo, hi), (&rate, _)| (lo.min(rate), hi.max(rate))))
    }

    /// The `k`-th highest probability, k ≥ 1.
    fn highest(&mut self, k: usize) -> f64 {
        self.sorted.clear();
        self.sorted.extend_from_slice(&self.probabilities);
        let (_, kth, _) = self.sorted.select_nth_unstable_by(k - 1, |a, b| b.total_cmp(a));
        *kth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Pose;

    /// The same probabilities in every state.
    struct Fixed<'a>(&'a [f64], &'a [f64]);

    impl ActionModel for Fixed<'_> {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(self.0)
        }

        fn probabilities(&self, _: &[JointState], out: &mut [f64]) {
            out.copy_from_slice(self.1);
        }
    }

    const RATES: [f64; 3] = [-0.5, 0.0, 0.5];

    fn start() -> [JointState; 1] {
        [JointState { human: Pose::new(0.0, 0.0, 0.3), robot: Pose::new(9.0, 2.0, 3.0) }]
    }

    fn run(p: [f64; 3], epsilon: &[f64], choice: ActionChoice) -> PredictedBounds {
        let settings = BoundsSettings::new(epsilon.to_vec(), choice, Rollout::Paper, 3).unwrap();
        let model = Fixed(&RATES, &p);
        input_bounds(&start(), &SceneParameters::default(), &model, |_| 0.0, &settings).unwrap()
    }

    #[test]
    fn top_k_takes_the_interval_between_likely_actions() {
        let found = run([0.5, 0.2, 0.3], &[0.0, 0.2, 1.0], ActionChoice::TopK(vec![2, 1]));
        assert_eq!(found.raw, [(-0.5, 0.5), (-0.5, -0.5)]);
        assert_eq!(found.sets[1].hi(), [0.5, -0.3]);
        assert_eq!((found.sets[2].lo(), found.sets[2].hi()), (&[-0.5; 2][..], &[0.5; 2][..]));
        assert_eq!((found.low.len(), found.high.len()), (3, 3));
        assert_eq!(found.low[0], start()[0]);
    }

    #[test]
    fn ties_with_the_kth_all_count() {
        let raw = |p, k| run(p, &[0.0], ActionChoice::TopK(vec![k])).raw[0];
        assert_eq!(raw([0.4, 0.2, 0.4], 1), (-0.5, 0.5));
        assert_eq!(raw([0.6, 0.2, 0.2], 2), (-0.5, 0.5));
        assert_eq!(raw([0.2, 0.6, 0.2], 1), (0.0, 0.0));
        // The second most likely action has probability 0. The third action ties with it, so all
        // actions are likely.
        assert_eq!(raw([1.0, 0.0, 0.0], 2), (-0.5, 0.5));
        // All probabilities are thirds, but a file or a softmax rounded them in different
        // directions.
        for last in [0.3333333333333334, 1.0 / 3.0, 0.3333333333333332] {
            assert_eq!(raw([1.0 / 3.0, 1.0 / 3.0, last], 1), (-0.5, 0.5), "{last}");
        }
        assert_eq!(raw([0.4, 0.2 + 1e-9, 0.4 - 1e-9], 1), (-0.5, -0.5));
    }

    #[test]
    fn the_adaptive_set_follows_the_probabilities() {
        let adaptive = |p, tau| run(p, &[0.0], ActionChoice::Adaptive { tau, steps: 1 }).raw[0];
        assert_eq!(adaptive([0.1, 0.6, 0.3], 0.25), (0.0, 0.5));
        assert_eq!(adaptive([0.05, 0.9, 0.05], 0.25), (0.0, 0.0));
        // If no action reaches τ, the most likely action and all actions that tie with it are
        // selected.
        assert_eq!(adaptive([0.5, 0.3, 0.2], 1.0), (-0.5, -0.5));
        assert_eq!(adaptive([0.4, 0.2, 0.4], 0.9), (-0.5, 0.5));
        // 0.1 + 0.2 is 0.30000000000000004.
        assert_eq!(adaptive([0.3, 0.6, 0.1], 0.1 + 0.2), (-0.5, 0.0));
    }

    /// A model of a range: bins with single turn rates at 0 and at the ends.
    #[test]
    fn a_range_gives_the_shortest_interval() {
        struct Range;

        impl ActionModel for Range {
            fn actions(&self) -> ActionSpace<'_> {
                ActionSpace::Bins(&[-0.5, -0.5, 0.0, 0.0, 0.25, 0.5, 0.5])
            }

            fn probabilities(&self, _: &[JointState], out: &mut [f64]) {
                out.copy_from_slice(&[0.05, 0.05, 0.4, 0.3, 0.1, 0.1]);
            }
        }

        let parameters = SceneParameters::default();
        let find = |q: Vec<f64>, epsilon: &[f64]| {
            let choice = ActionChoice::Interval(q);
            let settings =
                BoundsSettings::new(epsilon.to_vec(), choice, Rollout::Paper, 6).unwrap();
            input_bounds(&start(), &parameters, &Range, |_| 0.0, &settings)
        };
        let found = find(vec![0.4, 0.7, 0.9, 1.0], &[0.0, 0.1]).unwrap();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-8;
        for (found, expected) in
            found.raw.iter().zip([(0.0, 0.0), (0.0, 0.25), (0.0, 0.5), (-0.5, 0.5)])
        {
            assert!(near(found.0, expected.0) && near(found.1, expected.1), "{found:?}");
        }
        assert!(near(found.sets[1].lo()[1], -0.1) && near(found.sets[1].hi()[1], 0.35));
        let top = BoundsSettings::new(vec![0.0], ActionChoice::TopK(vec![1]), Rollout::Paper, 6);
        let refused = input_bounds(&start(), &parameters, &Range, |_| 0.0, &top.unwrap());
        assert_eq!(refused.unwrap_err().field, "settings");
        let mut slow = parameters;
        slow.human.turn_rate_radps = 0.4;
        let one =
            BoundsSettings::new(vec![0.0], ActionChoice::Interval(vec![0.5]), Rollout::Base, 6);
        let refused = input_bounds(&start(), &slow, &Range, |_| 0.0, &one.unwrap());
        assert_eq!(refused.unwrap_err().field, "actions[0]");
    }

    /// Five actions and an asymmetric turn rate.
    #[test]
    fn any_actions_within_any_turn_rate() {
        let motion =
            Motion { human_turn_rate: (-0.3, 0.6), ..Motion::from(&SceneParameters::default()) };
        let model = Fixed(&[-0.3, -0.1, 0.0, 0.2, 0.6], &[0.05, 0.1, 0.25, 0.4, 0.2]);
        let k = ActionChoice::TopK(vec![1, 2, 3, 4, 5]);
        let epsilon = vec![0.0, 0.15, 0.9];
        let settings = BoundsSettings::new(epsilon, k, Rollout::Base, 5).unwrap();
        let mut algorithm = Algorithm1::default();
        let found = algorithm.run(&start(), &motion, &model, |_| 0.0, &settings).unwrap();
        let raw = [(0.2, 0.2), (0.0, 0.2), (0.0, 0.6), (-0.1, 0.6), (-0.3, 0.6)];
        assert_eq!(found.raw, raw);
        let lo = found.sets[1].lo();
        assert!((lo[0] - 0.05).abs() < 1e-15 && lo[3] == -0.25 && lo[4] == -0.3, "{lo:?}");
        assert!(found.sets[2].lo().iter().all(|&rate| rate == -0.3));
        assert!(found.sets[2].hi().iter().all(|&rate| rate == 0.6));
    }

    /// The robot's turn rate comes from the states of each roll-out.
    #[test]
    fn the_robot_is_asked_along_both_roll_outs() {
        let settings =
            BoundsSettings::new(vec![0.0], ActionChoice::TopK(vec![3; 4]), Rollout::Paper, 3);
        let toward = |states: &[JointState]| 0.5 * states[states.len() - 1].human.y.signum();
        let model = Fixed(&RATES, &[0.2, 0.6, 0.2]);
        let parameters = SceneParameters::default();
        let mut history = start();
        history[0].human.psi = 0.0;
        let found =
            input_bounds(&history, &parameters, &model, toward, &settings.unwrap()).unwrap();
        assert!(found.low[4].human.y < 0.0 && found.high[4].human.y > 0.0);
        let turned = |path: &[JointState]| crate::math::wrap_angle(path[4].robot.psi - 3.0);
        // At first both roll-outs are in the same state, where y = 0 counts as left.
        assert!((turned(&found.high) - 0.4).abs() < 1e-12, "{}", turned(&found.high));
        assert!((turned(&found.low) + 0.2).abs() < 1e-12, "{}", turned(&found.low));
    }

    #[test]
    fn complaints_name_the_field() {
        type Change = fn(&mut Vec<JointState>, &mut Motion, &mut Vec<f64>, &mut Vec<f64>);
        let field = |change: Change, robot: f64| {
            let (mut history, mut actions) = (start().to_vec(), RATES.to_vec());
            let mut p = vec![0.2, 0.5, 0.3];
            let mut motion = Motion::from(&SceneParameters::default());
            change(&mut history, &mut motion, &mut actions, &mut p);
            let choice = ActionChoice::TopK(vec![1, 1]);
            let settings = BoundsSettings::new(vec![0.0], choice, Rollout::Base, 3).unwrap();
            let model = Fixed(&actions, &p);
            let found = Algorithm1::default();
            { found }.run(&history, &motion, &model, |_| robot, &settings).unwrap_err().field
        };
        assert_eq!(field(|h, _, _, _| h.clear(), 0.0), "history");
        assert_eq!(field(|h, _, _, _| h[0].robot.y = f64::NAN, 0.0), "history[0].robot.y");
        assert_eq!(field(|_, m, _, _| m.step_s = 0.0, 0.0), "motion.step_s");
        assert_eq!(field(|_, m, _, _| m.human_speed_mps = -1.0, 0.0), "motion.human_speed_mps");
        let turned = field(|_, m, _, _| m.human_turn_rate = (0.5, -0.5), 0.0);
        assert_eq!(turned, "motion.human_turn_rate");
        assert_eq!(field(|_, m, _, _| m.human_turn_rate = (-0.5, 0.4), 0.0), "actions[2]");
        assert_eq!(field(|_, _, a, _| a[1] = f64::NAN, 0.0), "actions[1]");
        assert_eq!(
            field(
                |_, _, a, p| {
                    a.pop();
                    p.pop();
                },
                0.0
            ),
            "actions"
        );
        assert_eq!(field(|_, _, _, p| p[1] = f64::NAN, 0.0), "probabilities[1] of step 0");
        assert_eq!(
            field(|_, _, _, p| *p = vec![0.6, 0.6, -0.2], 0.0),
            "probabilities[2] of step 0"
        );
        assert_eq!(field(|_, _, _, p| p[1] = 0.6, 0.0), "probabilities of step 0");
        assert_eq!(field(|_, _, _, _| {}, 0.7), "robot_action of step 0");
        assert_eq!(field(|_, _, _, _| {}, f64::NAN), "robot_action of step 0");
    }
}
