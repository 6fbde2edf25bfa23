//! Points that show without words where the danger zone is. Driving close to it earns points, and
//! entering it loses all points of the scene.

use sidestep::chart::{LegendItem, Pen, colours};
use sidestep::picture::{Picture, Shape, stage};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::trial::outcome;
use sidestep::vehicle::{Pose, TurnInput};
use std::rc::Rc;

/// Points per second at the edge of the danger zone.
const MOST_A_SECOND: f64 = 100.0;

/// Score of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Score {
    /// Points so far.
    pub(super) points: u32,
    /// Whether the human entered the danger zone, which loses all points of the scene.
    pub(super) is_caught: bool,
    /// Smallest distance so far (m).
    pub(super) closest_m: f64,
    /// The points as text in the picture.
    words: Rc<str>,
}

impl Score {
    /// The score of the drive so far. Each step earns the points for the state at its start.
    pub(super) fn of(
        parameters: &SceneParameters,
        inputs: &[TurnInput],
        states: &[JointState],
    ) -> Self {
        let outcome = outcome(parameters, inputs, states);
        let is_caught = outcome.first_step_in_danger.is_some();
        let steps = states.iter().zip(inputs);
        let earned: f64 = steps.map(|(state, _)| share(parameters, state.distance_m())).sum();
        let points = (MOST_A_SECOND * parameters.step_s * earned).round();
        let points = if is_caught { 0 } else { points as u32 };
        let words = if is_caught || points > 0 { points.to_string() } else { String::new() };
        Self { points, is_caught, closest_m: outcome.closest_m, words: words.into() }
    }

    /// Paints the band around the robot in which a human earns points.
    pub(super) fn paint_band(
        &self,
        parameters: &SceneParameters,
        robot: Pose,
        picture: &mut Picture,
    ) {
        let radius_m = parameters.danger_radius_m;
        let colour = if self.is_caught { colours::ROBOT } else { colours::HUMAN };
        // The discs overlap: smaller discs are painted over larger ones, so the band is darker
        // where it earns more.
        for wide in [2.0, 1.75, 1.5, 1.25] {
            picture.push(Shape::Disc {
                centre: robot.position(),
                radius_m: wide * radius_m,
                fill: colour.at(0.045),
                outline: Pen::new(colour.at(0.12), 0.5),
            });
        }
        if self.is_caught {
            picture.push(stage::danger_zone(robot, radius_m));
        }
    }

    /// Legend entry for the band around the robot.
    pub(super) fn legend() -> LegendItem {
        let text = "rings: they earn points, the inner ones more";
        LegendItem::disc(text, Some(colours::HUMAN.at(0.09)), Pen::new(colours::HUMAN.at(0.4), 0.5))
    }

    /// Paints the points beside the human.
    pub(super) fn paint_points(&self, human: Pose, picture: &mut Picture) {
        if self.words.is_empty() {
            return;
        }
        let colour = if self.is_caught { colours::ROBOT } else { colours::HUMAN };
        let [x, y] = human.position();
        let text = Rc::clone(&self.words);
        picture.push(Shape::Label { at: [x, y + 2.2], text, colour });
    }
}

/// Fraction of the maximum points at a distance. It is 1 at the edge of the danger zone, and 0 at a
/// distance of two or more radii.
fn share(parameters: &SceneParameters, distance_m: f64) -> f64 {
    let beyond = distance_m / parameters.danger_radius_m - 1.0;
    let near = (1.0 - beyond.max(0.0)).max(0.0);
    near * near
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::scene::Scene;
    use sidestep::trial::simulate;

    /// Drives straight past an oncoming robot that is `aside_m` to the left.
    fn passed(aside_m: f64) -> Score {
        let parameters = SceneParameters::default();
        let robot = Pose::new(10.0, aside_m, sidestep::math::PI);
        let scene = Scene::new(&parameters, Pose::new(-10.0, 0.0, 0.0), robot);
        let inputs = vec![TurnInput::Straight; parameters.steps];
        let states = simulate(&parameters, &scene, &inputs);
        Score::of(&parameters, &inputs, &states)
    }

    #[test]
    fn nearness_pays_until_the_danger_zone() {
        let scores = [6.5, 5.0, 4.0, 3.1].map(passed);
        assert_eq!(scores[0].points, 0, "farther than two radii");
        assert!(scores.windows(2).all(|pair| pair[0].points < pair[1].points), "{scores:?}");
        assert!(scores.iter().all(|score| !score.is_caught));
        let caught = passed(2.9);
        assert_eq!((caught.points, caught.is_caught, &*caught.words), (0, true, "0"));
        assert!((caught.closest_m - 2.9).abs() < 1e-9);
    }

    /// The robot passes 3.1 m aside at a closing speed of 4 m/s. The sum over the steps
    /// approximates the integral over time.
    #[test]
    fn points_are_a_hundred_a_second_at_the_edge() {
        let parameters = SceneParameters::default();
        assert_eq!(share(&parameters, 3.0), 1.0);
        assert_eq!(share(&parameters, 6.0), 0.0);
        let rate = |t: f64| share(&parameters, (3.1f64.powi(2) + (4.0 * t).powi(2)).sqrt());
        let integral: f64 =
            (-5000..5000).map(|ms| 100.0 * 0.001 * rate(f64::from(ms) / 1000.0)).sum();
        assert!((f64::from(passed(3.1).points) - integral).abs() < 2.0, "{integral}");
    }
}
