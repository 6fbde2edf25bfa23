//! Where can a person be within two seconds? This example predicts sets online, state by state,
//! with a custom model. `cargo run --release -p sidestep --example online`.
#![allow(clippy::print_stdout, reason = "it shows the sets")]

use sidestep::bounds::{ActionModel, ActionSpace};
use sidestep::invalid::Invalid;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::{ShfrsPredictor, ShfrsSettings};
use sidestep::vehicle::{Pose, dubins};

/// A model of a person who prefers to turn away from the robot's side.
struct Shy;

impl ActionModel for Shy {
    fn actions(&self) -> ActionSpace<'_> {
        ActionSpace::Levels(&[-0.5, 0.0, 0.5]) // rad/s
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        let now = history[history.len() - 1];
        let is_left = now.robot.y > now.human.y;
        out.copy_from_slice(if is_left { &[0.6, 0.3, 0.1] } else { &[0.1, 0.3, 0.6] });
    }
}

fn main() -> Result<(), Invalid> {
    let parameters = SceneParameters::default();
    let settings = ShfrsSettings::paper(3)?; // five sets over ten steps of 0.2 s
    let (mut predictor, mut history) = (ShfrsPredictor::default(), Vec::new());
    let mut human = Pose::new(0.0, 0.0, 0.0);
    for tick in 0..5 {
        let robot = Pose::new(12.0 - 0.4 * f64::from(tick), 1.0, 3.0);
        history.push(JointState { human, robot });
        let shfrs = predictor.predict(&history, &parameters, &Shy, &settings)?;
        let areas: Vec<f64> = shfrs.sets.iter().map(|set| set.area_m2).collect();
        println!("{:.1} s: the five sets cover {areas:.2?} m²", 0.2 * f64::from(tick));
        human = dubins::arc(human, 2.0, -0.5, 0.2);
    }
    Ok(())
}
