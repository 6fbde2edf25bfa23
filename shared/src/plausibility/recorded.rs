//! Checks of recorded trials. Errors name the columns of trials.csv.

use super::{DISTANCE_ROUNDING, ROUNDING, StepLimits};
use crate::invalid::Invalid;
use crate::math::wrap_angle;
use crate::recording::{Exclusion, Fault, RecordedTrial, Recording};
use crate::scene::{JointState, SceneParameters};
use crate::trial::{Replay, compare};
use crate::vehicle::{Pose, VehicleModel};

/// Checks every step of a trial except the last one. The last state needs no check, because it is
/// computed from the last input.
///
/// # Errors
/// [`Invalid`] for the first step that the human or the robot could not have driven. Its field names
/// the trial, the step and the invalid columns of trials.csv.
pub fn check(parameters: &SceneParameters, trial: &RecordedTrial) -> Result<(), Invalid> {
    type Of = fn(&JointState) -> Pose;
    let vehicles: [(char, VehicleModel, Of); 2] = [
        ('h', parameters.human, |state| state.human),
        ('r', parameters.robot, |state| state.robot),
    ];
    let recorded = &trial.states[..trial.inputs.len().min(trial.states.len())];
    for (step, ends) in recorded.windows(2).enumerate() {
        for (letter, vehicle, pose) in vehicles {
            let within_step = StepLimits::of(vehicle, parameters.step_s);
            within_step.check(pose(&ends[0]), pose(&ends[1])).map_err(|invalid| {
                let columns = invalid.field.split(", ").map(|of| format!("{letter}{of}"));
                let columns = columns.collect::<Vec<_>>().join(", ");
                let field = format!("trial {}, step {step}: {columns}", trial.number);
                Invalid { field, ..invalid }
            })?;
        }
    }
    Ok(())
}

/// Excludes every participant who has a trial that fails [`check`], and records the reason.
pub fn exclude_impossible(recording: &mut Recording) {
    let Recording { scene, participants, exclusions, .. } = recording;
    participants.retain(|participant| {
        let fault = participant.trials.iter().find_map(|trial| {
            check(scene, trial).err().map(|what| Fault { line: trial.line, what })
        });
        exclusions.extend(fault.iter().map(|fault| Exclusion::of_fault(&participant.name, fault)));
        fault.is_none()
    });
}

/// Whether a simulation of the inputs gives the recorded states, up to rounding to three decimals.
/// The robot may turn.
#[must_use]
pub fn replays(parameters: &SceneParameters, trial: &RecordedTrial) -> bool {
    let Some(&start) = trial.states.first() else { return true };
    // The recording does not say by which rule the robot moved, so the robot turns as recorded.
    let mut replayed = vec![start];
    for (pair, &input) in trial.states.windows(2).zip(&trial.inputs) {
        let robot_radps = pair[0].robot_turned(&pair[1]) / parameters.step_s;
        let now = replayed[replayed.len() - 1];
        replayed.push(now.advance(parameters, input, robot_radps, parameters.step_s));
    }
    is_rounding(parameters, trial.inputs.len(), &compare(&replayed, &trial.states))
}

/// Whether recorded states of a trial with this many steps differ from the replayed states only by
/// rounding to three decimals.
#[must_use]
pub fn is_rounding(parameters: &SceneParameters, steps: usize, replay: &Replay) -> bool {
    let speed = parameters.human.speed_mps.abs().max(parameters.robot.speed_mps.abs());
    let way_m = speed * parameters.step_s * steps as f64;
    // The rounding error of a heading adds a position error that grows with the length of the path.
    let position_m = DISTANCE_ROUNDING + ROUNDING * way_m;
    replay.exact
        || replay.max_position_error_m <= position_m
            && replay.max_heading_error_rad <= 2.0 * ROUNDING
}

/// Checks that the headings follow the inputs of the same rows, and not the opposite inputs or the
/// inputs of the previous or the next row.
///
/// # Errors
/// [`Invalid`] if one of these alternatives fits the headings of all trials far better.
pub fn check_inputs<'a>(
    parameters: &SceneParameters,
    trials: impl IntoIterator<Item = &'a RecordedTrial>,
) -> Result<(), Invalid> {
    let most = parameters.human.turn_rate_radps * parameters.step_s;
    let mut recorded = 0.0;
    let mut others = [
        (0.0, "the opposite of omega: give a positive omega for a left (counter-clockwise) turn"),
        (0.0, "omega of the row before: give the input held in the step that begins at the state"),
        (0.0, "omega of the row after: give the input held in the step that begins at the state"),
    ];
    for trial in trials {
        let turn = |step: usize| trial.inputs.get(step).map(|input| most * f64::from(input.sign()));
        // Skips the first step, which has no previous row, and the last step, whose end is computed
        // from the last input.
        for step in 1..trial.inputs.len().saturating_sub(1) {
            let psi = |at: usize| trial.states.get(at).map(|state| state.human.psi);
            let (Some(own), Some(from), Some(to)) = (turn(step), psi(step), psi(step + 1)) else {
                continue;
            };
            let turned = wrap_angle(to - from);
            let squared = |expected: f64| (turned - expected) * (turned - expected);
            let [before, after] = [step - 1, step + 1].map(|at| turn(at).unwrap_or(own));
            recorded += squared(own);
            for (other, expected) in others.iter_mut().zip([-own, before, after]) {
                other.0 += squared(expected);
            }
        }
    }
    // If keys change within steps, the inputs of the same row and of a neighbouring row fit about
    // equally badly. It is therefore an error if the sum of squares of an alternative is below a
    // quarter of the sum for the recorded inputs.
    match others.iter().find(|(other, _)| *other < 0.25 * recorded && recorded > ROUNDING) {
        Some((_, found)) => {
            let expected = "inputs that match the turns in hpsi (rad/s)";
            Err(Invalid::new("omega", expected, format!("that hpsi follows {found}")))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;
    use crate::scene::Scene;
    use crate::trial::{Phase, simulate};
    use crate::vehicle::TurnInput;

    fn driven(rng: &mut SeededRng, parameters: &SceneParameters) -> RecordedTrial {
        let mut pose = || {
            let [x, y] = [(); 2].map(|()| rng.uniform(-20.0, 20.0));
            Pose::new(x, y, rng.uniform(-4.0, 4.0))
        };
        let scene = Scene::new(parameters, pose(), pose());
        let mut inputs = vec![TurnInput::Straight; parameters.steps];
        for step in 1..inputs.len() {
            inputs[step] = match rng.below(4) {
                0 => TurnInput::ALL[rng.below(3)],
                _ => inputs[step - 1],
            };
        }
        let states = simulate(parameters, &scene, &inputs);
        RecordedTrial {
            line: None,
            number: 7,
            phase: Phase::Task,
            attempt: 1,
            trial_id: None,
            inputs,
            states,
            started_at_ms: None,
            sampled_at_ms: None,
            flags: Vec::new(),
            robot: None,
        }
    }

    fn all(parameters: &SceneParameters, trial: &RecordedTrial) -> Result<(), Invalid> {
        check(parameters, trial)?;
        check_inputs(parameters, [trial])
    }

    #[test]
    fn what_the_vehicles_drove_is_possible_whatever_the_rounding() {
        let mut rng = SeededRng::new(4);
        for case in 0..300 {
            let mut parameters = SceneParameters::default();
            parameters.human.speed_mps = [2.0, 0.2, 9.0][case % 3];
            parameters.human.turn_rate_radps = [0.5, 1.5, 0.05][case / 3 % 3];
            let mut trial = driven(&mut rng, &parameters);
            assert!(replays(&parameters, &trial));
            assert_eq!(all(&parameters, &trial), Ok(()), "{case}");
            for state in &mut trial.states {
                for pose in [&mut state.human, &mut state.robot] {
                    let [x, y, psi] =
                        <[f64; 3]>::from(*pose).map(|number| (number * 1e3).round() / 1e3);
                    *pose = Pose::new(x, y, psi);
                }
            }
            assert_eq!(all(&parameters, &trial), Ok(()), "{case} with three decimals");
            assert!(replays(&parameters, &trial), "{case} with three decimals");
        }
    }

    #[test]
    fn keys_that_change_within_a_step_are_possible_but_do_not_replay() {
        let mut rng = SeededRng::new(5);
        let parameters = SceneParameters::default();
        let fine = SceneParameters { step_s: 0.05, steps: 200, ..parameters };
        let (mut different, mut trials) = (0, Vec::new());
        for _ in 0..50 {
            let mut trial = driven(&mut rng, &fine);
            trial.inputs = trial.inputs.chunks(4).map(|four| four[1]).collect();
            trial.states = trial.states.into_iter().step_by(4).collect();
            assert_eq!(check(&parameters, &trial), Ok(()));
            different += usize::from(!replays(&parameters, &trial));
            trials.push(trial);
        }
        assert!(different > 40, "{different}");
        assert_eq!(check_inputs(&parameters, &trials), Ok(()));
    }

    #[test]
    fn what_no_vehicle_drove_is_named() {
        let parameters = SceneParameters::default();
        let refused = |change: &dyn Fn(&mut RecordedTrial), field: &str, words: &str| {
            let mut trial = driven(&mut SeededRng::new(6), &parameters);
            change(&mut trial);
            let error = all(&parameters, &trial).unwrap_err().to_string();
            assert!(error.starts_with(field) && error.contains(words), "{error}");
            assert!(!replays(&parameters, &trial));
        };
        refused(&|of| of.states[9].human.x += 0.02, "trial 7, step 8: hx, hy", "found 0.");
        refused(&|of| of.states[9].robot.y += 5.0, "trial 7, step 8: rx, ry", "0.4000 m");
        refused(&|of| of.states[9].robot.psi += 0.1, "trial 7, step 8: rpsi", "where the vehicle");
        let degrees = |of: &mut RecordedTrial| {
            for state in &mut of.states {
                state.human.psi = state.human.psi.to_degrees();
            }
        };
        refused(&degrees, "trial 7, step 0: hpsi", "which fits in degrees");
        let opposite = |of: &mut RecordedTrial| {
            let mirrored = |input: &TurnInput| {
                TurnInput::ALL.into_iter().find(|of| of.sign() == -input.sign())
            };
            of.inputs = of.inputs.iter().filter_map(mirrored).collect();
        };
        refused(&opposite, "omega", "the opposite");
        refused(&|of| of.inputs.rotate_left(1), "omega", "row before");
        refused(&|of| of.inputs.rotate_right(1), "omega", "row after");
    }
}
