//! Checks whether the vehicles of a scene could have driven the recorded states, and whether the
//! recorded inputs explain the human's turns.
//!
//! Files from other programs may not replay bit for bit, because keys may have been sampled more
//! than once per step, and numbers may be rounded. Therefore the checks test only necessary
//! conditions. Every drive at constant speed within the vehicle's turn rate passes them, even after
//! rounding to three decimals.

#[cfg(feature = "study")]
mod recorded;

#[cfg(feature = "study")]
pub use recorded::{check, check_inputs, exclude_impossible, is_rounding, replays};

use crate::invalid::Invalid;
use crate::math::{PI, asin, atan2, hypot, sinc, wrap_angle};
use crate::scene::{JointState, SceneParameters};
use crate::vehicle::{Pose, SpeedRange, VehicleModel};

/// Largest error (m or rad) of a number that was rounded to three decimals and single precision.
const ROUNDING: f64 = 5e-4 + 1e-6;

/// Largest error of the distance between two rounded positions (m).
const DISTANCE_ROUNDING: f64 = 2.0 * core::f64::consts::SQRT_2 * ROUNDING;

/// Checks that the human's vehicle of `parameters` could have driven `states`, and that it turned at
/// `turn_rates[i]` (rad/s) in step i. There is one more state than turn rates. The robot's motion
/// is not checked.
///
/// # Errors
/// [`Invalid`] for the first step that the human could not have driven, or whose turn rate does not
/// match the headings.
pub fn check_drive(
    parameters: &SceneParameters,
    states: &[JointState],
    turn_rates: &[f64],
) -> Result<(), Invalid> {
    crate::invalid::length("states", turn_rates.len() + 1, states.len())?;
    let within_step = StepLimits::of(parameters.human, parameters.step_s);
    let most = parameters.human.turn_rate_radps.abs();
    for (step, (ends, &held)) in states.windows(2).zip(turn_rates).enumerate() {
        let [from, to] = [ends[0].human, ends[1].human];
        within_step.check(from, to).map_err(|invalid| {
            let field = format!("states[{}].human.{}", step + 1, invalid.field);
            Invalid { field, ..invalid }
        })?;
        let turned = wrap_angle(to.psi - from.psi);
        if wrap_angle(turned - held * parameters.step_s).abs() > 2.0 * ROUNDING {
            let rate = turned / parameters.step_s;
            let expected = format!("{rate:.4} rad/s, by which the human turns in this step");
            return Err(Invalid::new(format!("turn_rates[{step}]"), expected, held));
        }
        // The comparison of wrapped angles cannot detect an error of a full circle per step.
        if held.abs() > most * (1.0 + 1e-9) + 2.0 * ROUNDING / parameters.step_s {
            let expected = format!("a turn rate of at most {most} rad/s to either side");
            return Err(Invalid::new(format!("turn_rates[{step}]"), expected, held));
        }
    }
    Ok(())
}

/// Checks that the human's vehicle of `parameters` could have driven one step. Like
/// [`check_drive`], tolerates errors of about a millimetre and a milliradian.
///
/// # Errors
/// [`Invalid`] naming the invalid fields among x, y and psi.
pub fn check_step(parameters: &SceneParameters, from: Pose, to: Pose) -> Result<(), Invalid> {
    StepLimits::of(parameters.human, parameters.step_s).check(from, to)
}

/// The reason why the human's vehicle could not have driven a step; see [`departure`]. `Display`
/// writes the measured value and the vehicle's limit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Departure {
    /// The human moved at another speed, or stood still.
    Speed {
        /// The distance between the two positions divided by the step duration (m/s).
        measured_mps: f64,
        /// The speeds of the vehicle.
        vehicle: SpeedRange,
    },
    /// The human did not move in the direction of the headings.
    Heading {
        /// The heading that does not fit (rad).
        psi_rad: f64,
        /// The direction of the motion (rad).
        direction_rad: f64,
        /// Whether both headings fit if they are interpreted as degrees.
        in_degrees: bool,
    },
    /// The human turned faster than the vehicle can.
    Turn {
        /// The change of heading divided by the step duration (rad/s).
        measured_radps: f64,
        /// The largest turn rate of the vehicle (rad/s).
        vehicle_radps: f64,
    },
}

impl core::fmt::Display for Departure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Speed { measured_mps, vehicle } => {
                write!(f, "the human moved at {measured_mps:.2} m/s, the vehicle at {vehicle}")
            }
            Self::Heading { psi_rad, direction_rad, in_degrees } => {
                let hint = if *in_degrees { ", which fits in degrees" } else { "" };
                write!(
                    f,
                    "the human moved in direction {direction_rad:.4} rad with the heading {psi_rad:.4} \
                     rad{hint}"
                )
            }
            Self::Turn { measured_radps, vehicle_radps } => write!(
                f,
                "the human turned at {measured_radps:.4} rad/s, the vehicle at most at {vehicle_radps} rad/s"
            ),
        }
    }
}

/// Returns the reason why the human's vehicle of `parameters` could not have driven a step, or
/// `None` if it could. Has the same tolerances as [`check_step`]. Does not allocate.
#[must_use]
pub fn departure(parameters: &SceneParameters, from: Pose, to: Pose) -> Option<Departure> {
    departure_at(parameters, parameters.human.speed_mps.into(), from, to)
}

/// Like [`departure`], for a human who chooses the speed from a range.
#[must_use]
pub fn departure_at(
    parameters: &SceneParameters,
    speed: SpeedRange,
    from: Pose,
    to: Pose,
) -> Option<Departure> {
    let vehicle = parameters.human;
    let limits = StepLimits::at(speed, vehicle.turn_rate_radps, parameters.step_s);
    Some(match limits.fault(from, to)? {
        Fault::Way { moved } => {
            Departure::Speed { measured_mps: moved / parameters.step_s, vehicle: speed }
        }
        Fault::Heading { psi, direction, in_degrees } => {
            Departure::Heading { psi_rad: psi, direction_rad: direction, in_degrees }
        }
        Fault::Turn { turned } => Departure::Turn {
            measured_radps: turned / parameters.step_s,
            vehicle_radps: vehicle.turn_rate_radps,
        },
    })
}

/// Limits of a vehicle's motion in one step.
struct StepLimits {
    /// Shortest and longest path (m).
    least_m: f64,
    most_m: f64,
    /// Largest turn (rad).
    turn_rad: f64,
    /// Largest angle between the direction of the motion and a heading, as a share of the largest turn. At a
    /// constant speed it is a half. A vehicle that can be slow at one end of an arc moves like the other end.
    lean: f64,
}

impl StepLimits {
    fn of(vehicle: VehicleModel, step_s: f64) -> Self {
        Self::at(vehicle.speed_mps.abs().into(), vehicle.turn_rate_radps, step_s)
    }

    fn at(speed: SpeedRange, turn_rate_radps: f64, step_s: f64) -> Self {
        Self {
            least_m: speed.lo_mps() * step_s,
            most_m: speed.hi_mps() * step_s,
            turn_rad: turn_rate_radps.abs() * step_s,
            lean: if speed.is_constant() { 0.5 } else { 1.0 },
        }
    }

    /// Checks the poses before and after a step. The error names the invalid fields among x, y and
    /// psi.
    fn check(&self, from: Pose, to: Pose) -> Result<(), Invalid> {
        let Some(fault) = self.fault(from, to) else { return Ok(()) };
        Err(match fault {
            Fault::Way { moved } => {
                let ahead = format!("a position {:.4} m away from the step before", self.most_m);
                Invalid::new("x, y", ahead, format!("{moved} m"))
            }
            Fault::Heading { psi, direction, in_degrees } => {
                let expected = format!(
                    "a heading in radians, counter-clockwise from +x, that points where the vehicle \
                     moves ({direction:.4})"
                );
                let hint = if in_degrees { ", which fits in degrees" } else { "" };
                Invalid::new("psi", expected, format!("{psi}{hint}"))
            }
            Fault::Turn { turned } => {
                let expected = format!("a turn of at most {:.4} rad in a step", self.turn_rad);
                Invalid::new("psi", expected, format!("{turned:.4} rad"))
            }
        })
    }

    /// The fault in the poses before and after a step, if any.
    fn fault(&self, from: Pose, to: Pose) -> Option<Fault> {
        let half = 0.5 * self.turn_rad;
        let moved = hypot(to.x - from.x, to.y - from.y);
        // If the vehicle turns by at most a full circle per step, the tightest arc has the shortest
        // chord of all paths of this length. If the speed changes, the path gets at least as far as this
        // chord along the heading in the middle of the step, if the vehicle turns by at most half a circle.
        let most_half = PI * if self.lean < 1.0 { 1.0 } else { 0.5 };
        let chord = if half < most_half { self.least_m * sinc(half) } else { 0.0 };
        if moved < chord - DISTANCE_ROUNDING || moved > self.most_m + DISTANCE_ROUNDING {
            return Some(Fault::Way { moved });
        }
        let turned = wrap_angle(to.psi - from.psi).abs();
        // If the vehicle turns by at most a sixth of a circle per step, the direction of motion
        // deviates most from the headings on the tightest arc.
        let most =
            self.lean * self.turn_rad + ROUNDING + asin((DISTANCE_ROUNDING / moved).min(1.0));
        let direction = atan2(to.y - from.y, to.x - from.x);
        let leads = |psi: f64| wrap_angle(direction - psi).abs() <= most;
        let is_bounded = self.turn_rad <= PI / 3.0 && moved > DISTANCE_ROUNDING;
        if is_bounded && !(leads(from.psi) && leads(to.psi)) {
            let psi = if leads(from.psi) { to.psi } else { from.psi };
            let in_degrees = leads(from.psi.to_radians()) && leads(to.psi.to_radians());
            return Some(Fault::Heading { psi, direction, in_degrees });
        }
        (turned > self.turn_rad + 2.0 * ROUNDING).then_some(Fault::Turn { turned })
    }
}

/// The reason why a vehicle could not have driven a step.
enum Fault {
    /// The distance between the positions (m).
    Way { moved: f64 },
    /// A heading and the direction of the motion (rad), and whether both headings fit if they are
    /// interpreted as degrees.
    Heading { psi: f64, direction: f64, in_degrees: bool },
    /// The change of the heading (rad).
    Turn { turned: f64 },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    /// The states of a human who turns at these rates, and of a robot that jumps.
    fn driven(parameters: &SceneParameters, rates: &[f64]) -> Vec<JointState> {
        let mut human = Pose::new(1.0, -2.0, 0.7);
        let mut states = vec![JointState { human, robot: Pose::new(9.0, 0.0, 3.0) }];
        for (step, &rate) in rates.iter().enumerate() {
            let (speed_mps, step_s) = (parameters.human.speed_mps, parameters.step_s);
            human = crate::vehicle::dubins::arc(human, speed_mps, rate, step_s);
            states.push(JointState { human, robot: Pose::new(step as f64 * 5.0, 0.0, 1.0) });
        }
        states
    }

    #[test]
    fn a_drive_fits_the_parameters_it_was_driven_with() {
        let mut rng = SeededRng::new(8);
        for case in 0..200 {
            let mut parameters = SceneParameters::default();
            parameters.human.speed_mps = [2.0, 0.3, 8.0][case % 3];
            parameters.human.turn_rate_radps = [0.5, 1.5, 12.0][case / 3 % 3];
            let most = parameters.human.turn_rate_radps;
            let rates: Vec<f64> = (0..30).map(|_| rng.uniform(-most, most)).collect();
            let states = driven(&parameters, &rates);
            assert_eq!(check_drive(&parameters, &states, &rates), Ok(()), "{case}");
            let departed =
                |ends: &[JointState]| departure(&parameters, ends[0].human, ends[1].human);
            assert!(states.windows(2).all(|ends| departed(ends).is_none()), "{case}");
        }
    }

    /// No drive of the vehicle is rejected, even if the turn rate changes within a step.
    #[test]
    fn a_drive_that_steers_at_any_time_never_departs() {
        let mut rng = SeededRng::new(17);
        for case in 0..3000 {
            let mut parameters = SceneParameters::default();
            parameters.human.speed_mps = [2.0, 0.3, 8.0][case % 3];
            parameters.human.turn_rate_radps = [0.5, 1.5, 12.0][case / 3 % 3];
            parameters.step_s = [0.2, 0.1, 0.4][case / 9 % 3];
            let most = parameters.human.turn_rate_radps;
            let from =
                Pose::new(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0));
            let (mut to, mut left_s) = (from, parameters.step_s);
            while left_s > 0.0 {
                let held_s = rng.uniform(0.01, 0.1).min(left_s);
                let rate = rng.uniform(-1.0, 1.0).signum() * most * rng.uniform(0.0, 2.0).min(1.0);
                to = crate::vehicle::dubins::arc(to, parameters.human.speed_mps, rate, held_s);
                left_s -= held_s;
            }
            let rounded = |at: Pose| {
                let [x, y, psi] =
                    [at.x, at.y, at.psi].map(|number| (1000.0 * number).round() / 1000.0);
                Pose { x, y, psi }
            };
            assert_eq!(departure(&parameters, from, to), None, "{case}");
            assert_eq!(departure(&parameters, rounded(from), rounded(to)), None, "{case}");
        }
    }

    /// The same, if the speed also changes within a step.
    #[test]
    fn a_drive_at_speeds_of_the_range_never_departs() {
        let mut rng = SeededRng::new(18);
        for case in 0..6000 {
            let mut parameters = SceneParameters::default();
            parameters.human.turn_rate_radps = [0.5, 1.5, 5.0, 12.0, 20.0][case % 5];
            let slow = [0.0, 0.2, 1.0][case / 5 % 3];
            let speed = SpeedRange::new(slow, slow + [0.1, 2.0][case / 15 % 2]).unwrap();
            let (from, most) = (Pose::new(1.0, 2.0, rng.uniform(-9.0, 9.0)), parameters.human);
            let (mut to, mut left_s) = (from, parameters.step_s);
            while left_s > 0.0 {
                let held_s = rng.uniform(0.01, 0.15).min(left_s);
                let rate = most.turn_rate_radps * rng.uniform(-2.0, 2.0).clamp(-1.0, 1.0);
                let share = rng.uniform(-0.5, 1.5).clamp(0.0, 1.0);
                let at_mps = speed.lo_mps() + (speed.hi_mps() - speed.lo_mps()) * share;
                to = crate::vehicle::dubins::arc(to, at_mps, rate, held_s);
                left_s -= held_s;
            }
            assert_eq!(departure_at(&parameters, speed, from, to), None, "{case}");
        }
        let speed = SpeedRange::new(0.5, 1.5).unwrap();
        let from = Pose::new(0.0, 0.0, 0.0);
        let said =
            |to| departure_at(&SceneParameters::default(), speed, from, to).unwrap().to_string();
        assert_eq!(said(from), "the human moved at 0.00 m/s, the vehicle at 0.5 to 1.5 m/s");
        assert!(said(Pose::new(0.31, 0.0, 0.0)).starts_with("the human moved at 1.55 m/s"));
        assert!(said(Pose::new(0.2, 0.03, 0.05)).starts_with("the human moved in direction"));
    }

    /// [`departure`] returns a reason exactly if [`check_step`] fails.
    #[test]
    fn a_departure_is_what_the_check_refuses() {
        let (parameters, mut rng) = (SceneParameters::default(), SeededRng::new(5));
        let from = Pose::new(0.0, 0.0, 0.0);
        let mut found = [0; 2];
        for _ in 0..4000 {
            let way_m = 0.4 * rng.uniform(0.99, 1.01);
            let aside = rng.uniform(-0.08, 0.08);
            let to = Pose::new(way_m, aside * way_m, rng.uniform(-0.15, 0.15));
            let departed = departure(&parameters, from, to);
            assert_eq!(departed.is_some(), check_step(&parameters, from, to).is_err());
            found[usize::from(departed.is_some())] += 1;
        }
        assert!(found[0] > 100 && found[1] > 100, "{found:?}");
        let said = |to: Pose| departure(&parameters, from, to).unwrap().to_string();
        assert_eq!(said(from), "the human moved at 0.00 m/s, the vehicle at 2 m/s");
        // 15 % slower and 15 % faster than the vehicle, as pedestrians can be.
        assert_eq!(
            said(Pose::new(0.34, 0.0, 0.0)),
            "the human moved at 1.70 m/s, the vehicle at 2 m/s"
        );
        assert_eq!(
            said(Pose::new(0.46, 0.0, 0.0)),
            "the human moved at 2.30 m/s, the vehicle at 2 m/s"
        );
        let turned = said(Pose::new(0.4, 0.0, 0.104));
        assert!(turned.starts_with("the human moved in direction 0.0000 rad with"), "{turned}");
    }

    #[test]
    fn a_drive_of_another_vehicle_is_named() {
        let parameters = SceneParameters::default();
        let rates = [0.5, 0.0, -0.5, -0.5, 0.25];
        let states = driven(&parameters, &rates);
        let refused = |change: &dyn Fn(&mut SceneParameters), rates: &[f64]| {
            let mut changed = parameters;
            change(&mut changed);
            check_drive(&changed, &states, rates).unwrap_err().to_string()
        };
        let slower = refused(&|of| of.human.speed_mps = 1.0, &rates);
        assert!(
            slower.starts_with("states[1].human.x, y: expected a position 0.2000 m"),
            "{slower}"
        );
        let oftener = refused(&|of| of.step_s = 0.1, &rates);
        assert!(oftener.starts_with("states[1].human.x, y"), "{oftener}");
        let straighter = refused(&|of| of.human.turn_rate_radps = 0.3, &rates);
        assert!(straighter.starts_with("states[1].human.psi"), "{straighter}");
        let told = refused(&|_| (), &[0.5, 0.0, -0.5, 0.5, 0.25]);
        assert!(told.starts_with("turn_rates[3]: expected -0.5000 rad/s"), "{told}");
        let whole_turns = rates.map(|rate| rate + 10.0 * PI);
        let whole_turns = refused(&|_| (), &whole_turns);
        assert!(whole_turns.starts_with("turn_rates[0]: expected a turn rate of at most 0.5"));
        assert_eq!(refused(&|_| (), &rates[1..]), "states: expected 5 entries, found 6 entries");
    }
}
