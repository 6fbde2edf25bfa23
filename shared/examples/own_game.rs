//! A custom game, defined by f and G. From which states can a car avoid a wall, whatever the wind
//! does? `cargo run --release -p sidestep --example own_game`.
#![allow(clippy::print_stdout, reason = "it shows values")]

use sidestep::reachability::cartesian::{Problem, Settings, solve};
use sidestep::reachability::{Axis, ControlAffine, Grid, Scheme};
use std::error::Error;
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn Error>> {
    // The axes are the distance from the wall (m) and the speed towards it (m/s).
    let grid = Grid { axes: [Axis::bounded(-1.0, 6.0, 141), Axis::bounded(-3.0, 3.0, 121)] };
    // The wind (0.3 m/s²) pushes the car towards the wall, so it minimises the value. The brakes (1
    // m/s²) maximise it.
    let game = ControlAffine::new(grid, |[_, v]| [-v, 0.0])?
        .minimiser(|_| [[0.0], [0.3]], [[-1.0, 1.0]])?
        .maximiser(|_| [[0.0], [1.0]], [[-1.0, 1.0]])?;
    let wall = |[distance, _]: [f64; 2]| distance; // negative inside
    let problem = Problem::reach(&game, grid, &wall, 4.0); // within 4 s
    let progress = &mut |_| ControlFlow::Continue(());
    let solution = solve::<f32, 2, _>(&problem, &Settings::new(Scheme::Weno5), progress)?;
    for distance in [1.0, 2.0, 4.0] {
        let state = [distance, 2.0];
        let sample = solution.sample(state)?;
        let brakes = solution.inputs(&game, state)?.maximiser[0];
        println!("{distance} m at 2 m/s: V = {:+.2} m, brakes at {brakes:+} m/s²", sample.value);
    }
    Ok(())
}
