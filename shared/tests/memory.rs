//! Peak memory of a solve. This is a separate program, because it counts allocations of the whole
//! process.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use core::ops::ControlFlow;
use peak_alloc::PeakAlloc;
use sidestep::reachability::{PursuitGame, polar};
use sidestep::vehicle::VehicleModel;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

#[test]
fn the_polar_solver_takes_three_arrays_of_its_grid() {
    let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 3.0 };
    let settings = polar::Settings::default();
    let grid = settings.range_nodes * settings.angle_nodes * settings.angle_nodes;
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    let solution =
        polar::solve::<f32>(&game, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let arrays = (MEMORY.peak_usage() - before) as f64 / (grid * size_of::<f32>()) as f64;
    eprintln!("{arrays:.2} arrays of {grid} numbers");
    assert!(arrays <= 3.0, "{arrays:.2}");
    assert!(arrays > 1.0, "{arrays:.2}: is anything counted?");
    drop(solution);
}
