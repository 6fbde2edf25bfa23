//! Time-varying bounds on the human's turn rate (the paper, Definition 1 and
//! Algorithm 1).

use crate::invalid::{Invalid, length};
use crate::scene::{JointState, SceneParameters};
use crate::vehicle::dubins;

/// Lowest and highest turn rate of each coming step, rad/s.
#[derive(Clone, Debug, PartialEq)]
pub struct InputBounds {
    lo: Vec<f64>,
    hi: Vec<f64>,
}

impl InputBounds {
    /// Bounds of `lo.len()` ≥ 1 steps within [`turn_rate.0`, `turn_rate.1`] rad/s.
    ///
    /// # Errors
    /// [`Invalid`] if the lists are empty or differ in length, a bound is not
    /// finite or outside the turn rate, or `lo[i] > hi[i]`.
    pub fn new(lo: Vec<f64>, hi: Vec<f64>, turn_rate: (f64, f64)) -> Result<Self, Invalid> {
        if lo.is_empty() {
            return Err(Invalid::new("lo", "at least one step", "none"));
        }
        length("hi", lo.len(), hi.len())?;
        for (i, (&low, &high)) in lo.iter().zip(&hi).enumerate() {
            for (name, bound) in [("lo", low), ("hi", high)] {
                if !(turn_rate.0..=turn_rate.1).contains(&bound) {
                    let range =
                        format!("a turn rate from {} to {} rad/s", turn_rate.0, turn_rate.1);
                    return Err(Invalid::new(format!("{name}[{i}]"), range, bound));
                }
            }
            if low > high {
                let expected = format!("at most hi[{i}] = {high}");
                return Err(Invalid::new(format!("lo[{i}]"), expected, low));
            }
        }
        Ok(Self { lo, hi })
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.lo.len()
    }

    /// Lowest turn rate of each step, rad/s.
    #[must_use]
    pub fn lo(&self) -> &[f64] {
        &self.lo
    }

    /// Highest turn rate of each step, rad/s.
    #[must_use]
    pub fn hi(&self) -> &[f64] {
        &self.hi
    }
}

/// The learned function G: how likely each action of the human is, given the
/// joint states so far.
pub trait ActionModel {
    /// The turn rate of each action, rad/s.
    fn actions(&self) -> &[f64];

    /// Writes the probability of each action to `out`. `history` ends with the
    /// state in which the action is taken; it is never empty.
    fn probabilities(&self, history: &[JointState], out: &mut [f64]);
}

/// Which actions are likely enough to count.
#[derive(Clone, Debug, PartialEq)]
pub enum ActionChoice {
    /// The k most likely at each coming step; every action that ties with the
    /// k-th counts too.
    TopK(Vec<usize>),
    /// Those with P(a) ≥ min(τ, max P), for a number of steps.
    Adaptive {
        /// Probability that makes an action count, in (0, 1].
        tau: f64,
        /// Coming steps.
        steps: usize,
    },
}

/// What the vehicles do in the low and the high roll-out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rollout {
    /// The bounds of F_1, widened by ε_1, as the paper prints it.
    Paper,
    /// The bounds before widening. Only so do regions grow with ε_1 for certain.
    Base,
}

/// What Algorithm 1 is run with.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundsSettings {
    epsilon: Vec<f64>,
    choice: ActionChoice,
    rollout: Rollout,
}

impl BoundsSettings {
    /// Settings for `epsilon.len()` sets (rad/s, ascending from ≥ 0) over the
    /// steps of `choice`, for a model of `actions` actions.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn new(
        epsilon: Vec<f64>,
        choice: ActionChoice,
        rollout: Rollout,
        actions: usize,
    ) -> Result<Self, Invalid> {
        if epsilon.is_empty() {
            return Err(Invalid::new("epsilon", "at least one set", "none"));
        }
        for (j, &e) in epsilon.iter().enumerate() {
            let least = if j == 0 { 0.0 } else { epsilon[j - 1] };
            if !e.is_finite() || e < least {
                let expected = format!("a finite number ≥ {least} (ascending)");
                return Err(Invalid::new(format!("epsilon[{j}]"), expected, e));
            }
        }
        match &choice {
            ActionChoice::TopK(k) => {
                if k.is_empty() {
                    return Err(Invalid::new("k", "at least one step", "none"));
                }
                if let Some(i) = k.iter().position(|k| !(1..=actions).contains(k)) {
                    let expected = format!("a whole number from 1 to {actions}");
                    return Err(Invalid::new(format!("k[{i}]"), expected, k[i]));
                }
            }
            ActionChoice::Adaptive { tau, steps } => {
                if !(*tau > 0.0 && *tau <= 1.0) {
                    return Err(Invalid::new("tau", "a number in (0, 1]", tau));
                }
                if *steps == 0 {
                    return Err(Invalid::new("steps", "at least 1", steps));
                }
            }
        }
        Ok(Self { epsilon, choice, rollout })
    }

    /// How many steps ahead, T.
    #[must_use]
    pub fn steps(&self) -> usize {
        match &self.choice {
            ActionChoice::TopK(k) => k.len(),
            ActionChoice::Adaptive { steps, .. } => *steps,
        }
    }

    /// By how much each set widens the bounds, rad/s.
    #[must_use]
    pub fn epsilon(&self) -> &[f64] {
        &self.epsilon
    }

    /// Least probability that counts at step `i`.
    fn threshold(&self, i: usize, probabilities: &[f64]) -> f64 {
        let top = probabilities.iter().copied().fold(0.0, f64::max);
        match &self.choice {
            ActionChoice::Adaptive { tau, .. } => tau.min(top),
            // The k-th largest: the smallest p that at least k actions reach.
            ActionChoice::TopK(k) => {
                let reaches = |p: f64| probabilities.iter().filter(|&&q| q >= p).count() >= k[i];
                probabilities.iter().copied().filter(|&p| reaches(p)).fold(0.0, f64::max)
            }
        }
    }
}

/// What Algorithm 1 finds.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedBounds {
    /// The bounds of each set F_j.
    pub sets: Vec<InputBounds>,
    /// The bounds before widening, of each step, rad/s.
    pub raw: Vec<(f64, f64)>,
    /// The states of the roll-out along the low bounds, from now: T + 1.
    pub low: Vec<JointState>,
    /// The states of the roll-out along the high bounds, from now: T + 1.
    pub high: Vec<JointState>,
}

/// Algorithm 1 of the paper: bounds on the human's turn rate for each coming step
/// and each set. `history` is every joint state up to now, at least one.
/// `robot_action` gives the robot's turn rate, rad/s, from the states so far
/// (`getRobotAction`). Indices count from the present step.
///
/// # Errors
/// [`Invalid`] if there is no state, or the model gives a probability that is not
/// a number.
pub fn input_bounds(
    history: &[JointState],
    parameters: &SceneParameters,
    model: &impl ActionModel,
    robot_action: impl Fn(&[JointState]) -> f64,
    settings: &BoundsSettings,
) -> Result<PredictedBounds, Invalid> {
    let Some(&now) = history.last() else {
        return Err(Invalid::new("history", "at least one state", "none"));
    };
    let rate = parameters.human.turn_rate_radps;
    let steps = settings.steps();
    let mut low = history.to_vec();
    let mut high = history.to_vec();
    let mut raw = Vec::with_capacity(steps);
    let mut sets =
        vec![(Vec::with_capacity(steps), Vec::with_capacity(steps)); settings.epsilon.len()];
    for i in 0..steps {
        let (a, b) =
            (likely_range(model, &low, settings, i)?, likely_range(model, &high, settings, i)?);
        let bounds = (a.0.min(b.0), a.1.max(b.1));
        raw.push(bounds);
        let widen =
            |epsilon: f64| ((bounds.0 - epsilon).max(-rate), (bounds.1 + epsilon).min(rate));
        for ((lo, hi), &epsilon) in sets.iter_mut().zip(&settings.epsilon) {
            let (l, h) = widen(epsilon);
            lo.push(l);
            hi.push(h);
        }
        let driven = match settings.rollout {
            Rollout::Paper => widen(settings.epsilon[0]),
            Rollout::Base => widen(0.0),
        };
        for (path, turn_rate) in [(&mut low, driven.0), (&mut high, driven.1)] {
            let state = path[path.len() - 1];
            let turn = robot_action(path);
            path.push(JointState {
                human: dubins::arc(
                    state.human,
                    parameters.human.speed_mps,
                    turn_rate,
                    parameters.step_s,
                ),
                robot: dubins::arc(
                    state.robot,
                    parameters.robot.speed_mps,
                    turn,
                    parameters.step_s,
                ),
            });
        }
    }
    let past = history.len() - 1;
    debug_assert_eq!(low[past], now);
    Ok(PredictedBounds {
        sets: sets
            .into_iter()
            .map(|(lo, hi)| InputBounds::new(lo, hi, (-rate, rate)))
            .collect::<Result<_, _>>()?,
        raw,
        low: low.split_off(past),
        high: high.split_off(past),
    })
}

/// Lowest and highest turn rate among the actions that count.
fn likely_range(
    model: &impl ActionModel,
    history: &[JointState],
    settings: &BoundsSettings,
    i: usize,
) -> Result<(f64, f64), Invalid> {
    let mut probabilities = vec![0.0; model.actions().len()];
    model.probabilities(history, &mut probabilities);
    if let Some(p) = probabilities.iter().find(|p| !p.is_finite()) {
        return Err(Invalid::new(format!("probabilities at step {i}"), "finite numbers", p));
    }
    let threshold = settings.threshold(i, &probabilities);
    let likely = model.actions().iter().zip(&probabilities).filter(|&(_, &p)| p >= threshold);
    Ok(likely.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), (&a, _)| (lo.min(a), hi.max(a))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;
    use crate::vehicle::Pose;
    use proptest::prelude::*;

    const RATES: [f64; 3] = [-0.5, 0.0, 0.5];

    /// Probabilities that depend on the state only through a seed, so that low and
    /// high roll-outs disagree.
    struct Random(u64);

    impl ActionModel for Random {
        fn actions(&self) -> &[f64] {
            &RATES
        }

        fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
            let last = history[history.len() - 1].human;
            let mut rng =
                SeededRng::new(self.0 ^ last.x.to_bits() ^ last.psi.to_bits().rotate_left(17));
            out.iter_mut().for_each(|p| *p = rng.unit());
            let total: f64 = out.iter().sum();
            out.iter_mut().for_each(|p| *p /= total);
        }
    }

    /// The same probabilities everywhere.
    struct Fixed([f64; 3]);

    impl ActionModel for Fixed {
        fn actions(&self) -> &[f64] {
            &RATES
        }

        fn probabilities(&self, _: &[JointState], out: &mut [f64]) {
            out.copy_from_slice(&self.0);
        }
    }

    fn start() -> [JointState; 1] {
        [JointState { human: Pose::new(0.0, 0.0, 0.3), robot: Pose::new(9.0, 2.0, 3.0) }]
    }

    fn run(
        model: &impl ActionModel,
        epsilon: &[f64],
        choice: ActionChoice,
        rollout: Rollout,
    ) -> PredictedBounds {
        let settings = BoundsSettings::new(epsilon.to_vec(), choice, rollout, 3).unwrap();
        input_bounds(&start(), &SceneParameters::default(), model, |_| 0.0, &settings).unwrap()
    }

    #[test]
    fn top_k_takes_the_interval_between_likely_actions() {
        let model = Fixed([0.5, 0.2, 0.3]);
        let found = run(&model, &[0.0, 0.2, 1.0], ActionChoice::TopK(vec![2, 1]), Rollout::Paper);
        assert_eq!(found.raw, [(-0.5, 0.5), (-0.5, -0.5)]);
        assert_eq!(found.sets[1].hi(), [0.5, -0.3]);
        assert_eq!((found.sets[2].lo(), found.sets[2].hi()), (&[-0.5; 2][..], &[0.5; 2][..]));
        assert_eq!(found.low.len(), 3);
    }

    #[test]
    fn ties_with_the_kth_all_count() {
        let found =
            run(&Fixed([0.4, 0.2, 0.4]), &[0.0], ActionChoice::TopK(vec![1]), Rollout::Paper);
        assert_eq!(found.raw, [(-0.5, 0.5)]);
    }

    #[test]
    fn the_adaptive_set_follows_the_probabilities() {
        let adaptive = |p| {
            run(&Fixed(p), &[0.0], ActionChoice::Adaptive { tau: 0.25, steps: 1 }, Rollout::Base)
                .raw[0]
        };
        assert_eq!(adaptive([0.1, 0.6, 0.3]), (0.0, 0.5));
        assert_eq!(adaptive([0.05, 0.9, 0.05]), (0.0, 0.0));
    }

    #[test]
    fn complaints_name_the_field() {
        let field = |epsilon: &[f64], choice| {
            BoundsSettings::new(epsilon.to_vec(), choice, Rollout::Base, 3).unwrap_err().field
        };
        assert_eq!(field(&[], ActionChoice::TopK(vec![1])), "epsilon");
        assert_eq!(field(&[0.2, 0.1], ActionChoice::TopK(vec![1])), "epsilon[1]");
        assert_eq!(field(&[f64::NAN], ActionChoice::TopK(vec![1])), "epsilon[0]");
        assert_eq!(field(&[0.0], ActionChoice::TopK(vec![1, 4])), "k[1]");
        assert_eq!(field(&[0.0], ActionChoice::TopK(vec![])), "k");
        assert_eq!(field(&[0.0], ActionChoice::Adaptive { tau: 0.0, steps: 3 }), "tau");
        assert_eq!(field(&[0.0], ActionChoice::Adaptive { tau: 0.5, steps: 0 }), "steps");
        let turn = (-0.5, 0.5);
        assert_eq!(InputBounds::new(vec![0.2], vec![0.1], turn).unwrap_err().field, "lo[0]");
        assert_eq!(InputBounds::new(vec![0.0], vec![f64::NAN], turn).unwrap_err().field, "hi[0]");
        assert_eq!(InputBounds::new(vec![-0.6], vec![0.1], turn).unwrap_err().field, "lo[0]");
    }

    proptest! {
        /// Theorem 1 at the level of inputs: F_j's bounds lie within those of F_{j+1}.
        #[test]
        fn bounds_are_nested(seed: u64, k in prop::collection::vec(1usize..=3, 1..12), e in 0.0..0.4f64, paper: bool) {
            let rollout = if paper { Rollout::Paper } else { Rollout::Base };
            let found = run(&Random(seed), &[e, e + 0.1, 1.0], ActionChoice::TopK(k), rollout);
            for pair in found.sets.windows(2) {
                for i in 0..pair[0].steps() {
                    prop_assert!(pair[1].lo()[i] <= pair[0].lo()[i] && pair[0].hi()[i] <= pair[1].hi()[i]);
                }
            }
            let last = &found.sets[2];
            prop_assert!(last.lo().iter().all(|&u| u == -0.5) && last.hi().iter().all(|&u| u == 0.5));
        }

        /// With roll-outs that do not depend on ε, widening it never narrows a bound.
        #[test]
        fn base_rollouts_are_monotone(seed: u64, k in prop::collection::vec(1usize..=3, 1..12), e in 0.0..0.4f64) {
            let of = |e| run(&Random(seed), &[e], ActionChoice::TopK(k.clone()), Rollout::Base).sets.remove(0);
            let (narrow, wide) = (of(e), of(e + 0.07));
            for i in 0..narrow.steps() {
                prop_assert!(wide.lo()[i] <= narrow.lo()[i] && narrow.hi()[i] <= wide.hi()[i]);
            }
        }
    }
}
