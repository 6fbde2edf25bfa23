//! How dangerous is a state? This example prints the value of a pursuit game, its gradient and the
//! optimal turns. `cargo run --release -p sidestep --example value`.
#![allow(clippy::print_stdout, reason = "it shows values")]

use sidestep::reachability::{CurveSettings, Options, PursuitGame, solve};
use sidestep::vehicle::VehicleModel;
use std::error::Error;
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn Error>> {
    let person = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let robot = VehicleModel { speed_mps: 1.5, turn_rate_radps: 0.8 };
    // Identical vehicles have a closed form. The other game is solved on a grid.
    for pursuer in [person, robot] {
        let game = PursuitGame { evader: person, pursuer, radius_m: 3.0 };
        let solved = solve(game, &Options::default(), &mut |_| ControlFlow::Continue(()))?;
        // The pursuer is 6 m ahead, 1 m to the left, and comes towards the evader.
        let state = solved.function.state([6.0, 1.0, 3.0]);
        println!(
            "{}: V = {:.3} m, gradient {:.3?} (m/m, m/m, m/rad), the evader turns at {:+} rad/s",
            solved.method.name(),
            state.value,
            state.gradient,
            state.evader_turn
        );
        let curves = solved.function.level_curves(3.0, 0.0, CurveSettings::default())?;
        println!("{} curve(s) surround where a collision can be forced", curves.len());
    }
    Ok(())
}
