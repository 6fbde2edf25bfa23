//! Participants' behaviour: how often they entered the danger zone, how close they came, when they
//! began to steer, and to which side.

use crate::math::hypot;
use crate::recording::{RecordedParticipant, RecordedTrial};
use crate::scene::{JointState, Scene, SceneParameters};
use crate::stats::{Estimate, Tally, mean_share, share};
use crate::trial::outcome;
use crate::vehicle::TurnInput;
use crate::vehicle::dubins::relative_state;
use serde::Serialize;
use std::collections::BTreeSet;

/// Number of consecutive parts into which a participant's tasks are divided, to show how behaviour
/// changes.
pub const PARTS: usize = 5;

/// A share about which nothing is known.
const UNKNOWN: Estimate = Estimate { value: 0.0, low: 0.0, high: 1.0 };

/// Confidence level of intervals.
const CONFIDENCE: f64 = 0.95;

/// A participant's behaviour in one task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TaskBehaviour {
    /// The trial's number in the data.
    pub trial: u64,
    /// The robot's name, if known.
    pub robot: Option<String>,
    /// Distance from the robot to its goal at the end of the trial (m).
    pub robot_to_goal_m: f64,
    /// Whether the human was in the robot's danger zone at any time.
    pub in_danger: bool,
    /// Smallest distance between the vehicles (m).
    pub closest_m: f64,
    /// Whether the robot was to the left of the human in the recorded state with the smallest
    /// distance.
    pub robot_on_left: bool,
    /// The first turn; `None` if the human never turned.
    pub onset: Option<Onset>,
    /// Share of steps in which the human turned, from 0 to 1.
    pub turning: f64,
}

/// When and how a participant starts to steer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Onset {
    /// Time after the start of the scene (s).
    pub time_s: f64,
    /// Distance between the vehicles (m).
    pub distance_m: f64,
    /// Whether the human turns left.
    pub to_left: bool,
}

impl TaskBehaviour {
    /// The behaviour in a recorded trial.
    #[must_use]
    pub fn of(parameters: &SceneParameters, trial: &RecordedTrial) -> Self {
        let outcome = outcome(parameters, &trial.inputs, &trial.states);
        let turns = |input: &&TurnInput| **input != TurnInput::Straight;
        let onset = outcome.avoidance.map(|(first, _)| Onset {
            time_s: first as f64 * parameters.step_s,
            distance_m: trial.states[first].distance_m(),
            to_left: trial.inputs[first] == TurnInput::Left,
        });
        let closest = trial.states.iter().min_by(|a, b| a.distance_m().total_cmp(&b.distance_m()));
        let turning = trial.inputs.iter().filter(turns).count() as f64;
        Self {
            trial: trial.number,
            robot: trial.robot.clone(),
            robot_to_goal_m: robot_to_goal_m(parameters, &trial.states),
            in_danger: outcome.first_step_in_danger.is_some(),
            closest_m: outcome.closest_m,
            robot_on_left: closest
                .is_some_and(|state| relative_state(state.human, state.robot)[1] > 0.0),
            onset,
            turning: turning / trial.inputs.len().max(1) as f64,
        }
    }
}

/// Distance from the robot to its goal in the last state (m). The goal lies straight ahead of the
/// robot's start.
fn robot_to_goal_m(parameters: &SceneParameters, states: &[JointState]) -> f64 {
    let (Some(first), Some(last)) = (states.first(), states.last()) else { return 0.0 };
    let [x, y] = Scene::new(parameters, first.human, first.robot).goal;
    hypot(last.robot.x - x, last.robot.y - y)
}

/// A participant's behaviour in some tasks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BehaviourSummary {
    /// Number of tasks.
    pub tasks: usize,
    /// Number of tasks in which the human was in the danger zone.
    pub in_danger: usize,
    /// Smallest distance in a task (m), averaged over the tasks.
    pub closest_m: f64,
    /// Smallest distance in any of the tasks (m).
    pub least_m: f64,
    /// Number of tasks in which the human turned at all.
    pub steered: usize,
    /// Number of tasks in which the first turn was to the left.
    pub to_left: usize,
    /// Number of tasks in which the robot was to the left of the human when the vehicles were
    /// closest.
    pub robot_on_left: usize,
    /// Mean time of the first turn (s), over the tasks with a turn.
    pub onset_s: Option<f64>,
    /// Mean distance between the vehicles at the first turn (m), over the tasks with a turn.
    pub onset_distance_m: Option<f64>,
    /// Mean share of steps in which the human turned, from 0 to 1.
    pub turning: f64,
    /// Mean distance from the robot to its goal at the end of a task (m).
    pub robot_to_goal_m: f64,
}

impl BehaviourSummary {
    /// Summarises these tasks. Returns `None` if there are no tasks.
    #[must_use]
    pub fn of(tasks: &[TaskBehaviour]) -> Option<Self> {
        let count = |is: &dyn Fn(&TaskBehaviour) -> bool| tasks.iter().filter(|of| is(of)).count();
        let mean = |numbers: Vec<f64>| {
            (!numbers.is_empty()).then(|| numbers.iter().sum::<f64>() / numbers.len() as f64)
        };
        let onsets: Vec<Onset> = tasks.iter().filter_map(|of| of.onset).collect();
        Some(Self {
            tasks: tasks.len(),
            in_danger: count(&|of| of.in_danger),
            closest_m: mean(tasks.iter().map(|of| of.closest_m).collect())?,
            least_m: tasks.iter().map(|of| of.closest_m).fold(f64::INFINITY, f64::min),
            steered: onsets.len(),
            to_left: onsets.iter().filter(|onset| onset.to_left).count(),
            robot_on_left: count(&|of| of.robot_on_left),
            onset_s: mean(onsets.iter().map(|onset| onset.time_s).collect()),
            onset_distance_m: mean(onsets.iter().map(|onset| onset.distance_m).collect()),
            turning: mean(tasks.iter().map(|of| of.turning).collect())?,
            robot_to_goal_m: mean(tasks.iter().map(|of| of.robot_to_goal_m).collect())?,
        })
    }

    /// The number of tasks in the danger zone, and of all tasks.
    fn danger(&self) -> Tally {
        Tally { hits: self.in_danger, of: self.tasks }
    }
}

/// One participant's behaviour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PersonBehaviour {
    /// The participant's name or number in the data.
    pub name: String,
    /// The participant's tasks, in order.
    pub tasks: Vec<TaskBehaviour>,
    /// Summary of all tasks.
    pub all: BehaviourSummary,
    /// Summary of each of [`PARTS`] equal parts of the tasks, in order; `None` for an empty part.
    pub parts: Vec<Option<BehaviourSummary>>,
}

/// The behaviour of all participants towards one of the study's robots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotBehaviour {
    /// The robot's name.
    pub name: String,
    /// Number of participants who met this robot in a task.
    pub people: usize,
    /// Summary of all tasks with this robot.
    pub all: BehaviourSummary,
    /// Each participant's share of tasks in the danger zone, averaged over the participants, with a
    /// 95 % confidence interval for the population mean.
    pub danger_of_people: Estimate,
}

impl RobotBehaviour {
    fn of(name: &str, people: &[PersonBehaviour]) -> Option<Self> {
        let met = |person: &PersonBehaviour| -> Vec<TaskBehaviour> {
            let is_it = |task: &&TaskBehaviour| task.robot.as_deref() == Some(name);
            person.tasks.iter().filter(is_it).cloned().collect()
        };
        let met: Vec<_> = people.iter().map(met).filter(|tasks| !tasks.is_empty()).collect();
        let shares: Vec<f64> = met
            .iter()
            .map(|tasks| tasks.iter().filter(|of| of.in_danger).count() as f64 / tasks.len() as f64)
            .collect();
        Some(Self {
            name: name.to_owned(),
            people: met.len(),
            all: BehaviourSummary::of(&met.concat())?,
            danger_of_people: mean_share(&shares, CONFIDENCE).unwrap_or(UNKNOWN),
        })
    }
}

/// All participants' behaviour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Behaviour {
    /// Each participant with at least one task.
    pub people: Vec<PersonBehaviour>,
    /// Summary of all participants' tasks; `None` if there are no tasks.
    pub all: Option<BehaviourSummary>,
    /// Share of all tasks in which the human was in the danger zone, with a 95 % confidence interval
    /// that counts the tasks of one participant as a single observation.
    pub danger: Estimate,
    /// Each participant's share of tasks in the danger zone, averaged over the participants, with a
    /// 95 % confidence interval for the population mean.
    pub danger_of_people: Estimate,
    /// The behaviour towards each robot that the study names, by name. Empty if it names none.
    pub robots: Vec<RobotBehaviour>,
}

impl Behaviour {
    /// The behaviour in these participants' trials. All trials must be tasks.
    #[must_use]
    pub fn of<'a>(
        parameters: &SceneParameters,
        participants: impl IntoIterator<Item = &'a RecordedParticipant>,
    ) -> Self {
        let person = |of: &RecordedParticipant| {
            let tasks: Vec<TaskBehaviour> =
                of.trials.iter().map(|trial| TaskBehaviour::of(parameters, trial)).collect();
            let part = |part: usize| {
                let end = |part: usize| part * tasks.len() / PARTS;
                BehaviourSummary::of(&tasks[end(part)..end(part + 1)])
            };
            Some(PersonBehaviour {
                name: of.name.clone(),
                all: BehaviourSummary::of(&tasks)?,
                parts: (0..PARTS).map(part).collect(),
                tasks,
            })
        };
        let people: Vec<PersonBehaviour> = participants.into_iter().filter_map(person).collect();
        let tallies: Vec<Tally> = people.iter().map(|person| person.all.danger()).collect();
        let tasks: Vec<TaskBehaviour> =
            people.iter().flat_map(|person| person.tasks.iter().cloned()).collect();
        let danger = share(&tallies, CONFIDENCE).unwrap_or(UNKNOWN);
        let share = |of: &Tally| of.hits as f64 / of.of as f64;
        let shares: Vec<f64> = tallies.iter().map(share).collect();
        let danger_of_people = mean_share(&shares, CONFIDENCE).unwrap_or(UNKNOWN);
        let names: BTreeSet<&str> = tasks.iter().filter_map(|of| of.robot.as_deref()).collect();
        let robots = names.into_iter().filter_map(|name| RobotBehaviour::of(name, &people));
        let robots = robots.collect();
        Self { robots, danger, danger_of_people, all: BehaviourSummary::of(&tasks), people }
    }

    /// For each of the [`PARTS`] parts of the tasks, returns the participants' values according to
    /// `value`, and the mean of these values (0 if there are none).
    pub fn by_part(
        &self,
        value: impl Fn(&BehaviourSummary) -> Option<f64>,
    ) -> Vec<(Vec<f64>, f64)> {
        let part = |part: usize| {
            let of = self.people.iter().filter_map(|person| value(person.parts[part].as_ref()?));
            let numbers: Vec<f64> = of.collect();
            let mean = numbers.iter().sum::<f64>() / numbers.len().max(1) as f64;
            (numbers, mean)
        };
        (0..PARTS).map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::trial::{Phase, simulate};
    use crate::vehicle::Pose;

    /// A head-on encounter from 20 m, offset by 1 m. The human drives `inputs` and then straight
    /// on.
    fn driven(number: u64, inputs: &[TurnInput]) -> RecordedTrial {
        let parameters = SceneParameters::default();
        let mut all = vec![TurnInput::Straight; parameters.steps];
        all[..inputs.len()].copy_from_slice(inputs);
        let robot = Pose::new(20.0, 1.0, core::f64::consts::PI);
        let scene = Scene::new(&parameters, Pose::new(0.0, 0.0, 0.0), robot);
        RecordedTrial {
            line: None,
            number,
            phase: Phase::Task,
            attempt: 1,
            trial_id: None,
            states: simulate(&parameters, &scene, &all),
            inputs: all,
            started_at_ms: None,
            sampled_at_ms: None,
            flags: Vec::new(),
            robot: None,
        }
    }

    #[test]
    fn robots_are_told_apart() {
        let parameters = SceneParameters::default();
        let with = |number, inputs: &[TurnInput], robot: &str| RecordedTrial {
            robot: Some(robot.to_owned()),
            ..driven(number, inputs)
        };
        let left = [TurnInput::Left; 20];
        let person = |trials| RecordedParticipant { trials, ..RecordedParticipant::default() };
        let people = [
            person(vec![with(0, &[], "b"), with(1, &left, "a"), with(2, &left, "b")]),
            person(vec![with(0, &left, "b"), driven(1, &[])]),
        ];
        let behaviour = Behaviour::of(&parameters, &people);
        let [a, b] = &behaviour.robots[..] else { panic!("{:?}", behaviour.robots) };
        assert_eq!((&*a.name, a.people, a.all.tasks, a.all.in_danger), ("a", 1, 1, 0));
        assert_eq!((&*b.name, b.people, b.all.tasks, b.all.in_danger), ("b", 2, 3, 1));
        // Half of the first person's tasks with b, and none of the second person's.
        assert!((b.danger_of_people.value - 0.25).abs() < 1e-12, "{:?}", b.danger_of_people);
        assert!(behaviour.people[0].tasks.iter().all(|task| task.robot_to_goal_m < 1e-9));
        let unnamed = Behaviour::of(&parameters, &[person(vec![driven(0, &left)])]);
        assert!(unnamed.robots.is_empty());
    }

    #[test]
    fn two_tasks_by_hand() {
        use TurnInput::{Right, Straight};
        let parameters = SceneParameters::default();
        let person = RecordedParticipant {
            name: "p".to_owned(),
            trials: vec![driven(4, &[]), driven(5, &[[Straight; 5], [Right; 5]].concat())],
            ..RecordedParticipant::default()
        };
        let found = Behaviour::of(&parameters, [&person, &RecordedParticipant::default()]);
        let [of] = &found.people[..] else { panic!("{found:?}") };
        let [straight, right] = &of.tasks[..] else { panic!("{of:?}") };
        assert_eq!((straight.trial, straight.onset, straight.turning), (4, None, 0.0));
        assert!(straight.in_danger && (straight.closest_m - 1.0).abs() < 1e-9);
        let onset = right.onset.unwrap();
        assert!((onset.time_s - 1.0).abs() < 1e-12 && !onset.to_left);
        // Both vehicles have driven 2 m towards each other.
        assert!((onset.distance_m - crate::math::hypot(16.0, 1.0)).abs() < 1e-9);
        assert!(!right.in_danger && right.robot_on_left && right.turning == 0.1);
        assert_eq!((of.all.tasks, of.all.in_danger, of.all.steered, of.all.to_left), (2, 1, 1, 0));
        assert_eq!(of.all.onset_s, Some(onset.time_s));
        assert!((of.all.closest_m - 0.5 * (1.0 + right.closest_m)).abs() < 1e-12);
        // Of two tasks, the first is in the third part and the second is in the fifth.
        let tasks: Vec<usize> =
            of.parts.iter().map(|part| part.as_ref().map_or(0, |of| of.tasks)).collect();
        assert_eq!(tasks, [0, 0, 1, 0, 1]);
        assert_eq!(found.all.as_ref(), Some(&of.all));
        let turning = found.by_part(|of| Some(of.turning));
        assert_eq!(turning[2..], [(vec![0.0], 0.0), (vec![], 0.0), (vec![0.1], 0.1)]);
        assert_eq!(found.danger.value, 0.5);
        assert!(found.danger.low < 0.1 && found.danger.high > 0.9, "one person says little");
        let of_people = found.danger_of_people;
        assert_eq!((of_people.low, of_people.value, of_people.high), (0.0, 0.5, 1.0));
    }

    #[test]
    fn nobody_does_nothing() {
        let found = Behaviour::of(&SceneParameters::default(), []);
        assert_eq!((found.people.len(), found.danger.high), (0, 1.0));
    }
}
