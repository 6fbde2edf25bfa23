//! Solids of known shape, ridges and jumps.

use super::*;
use crate::math::{PI, hypot};
use crate::reachability::{Accuracy, ExactValue, Options, PursuitGame, ValueFunction, solve};
use crate::vehicle::VehicleModel;
use core::ops::ControlFlow;
use std::collections::HashMap;

/// Checks that every edge is traversed equally often in both directions.
fn check_closed(surface: &Surface) {
    let mut edges: HashMap<_, i32> = HashMap::new();
    for &[a, b, c] in &surface.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_default() +=
                if from < to { 1 } else { -1 };
        }
    }
    assert!(edges.len() > 100);
    let open = edges.values().filter(|sum| **sum != 0).count();
    assert_eq!(open, 0, "of {} edges", edges.len());
}

/// Vertices that are not on the faces at the ends of ψ.
fn between_the_ends(surface: &Surface) -> impl Iterator<Item = [f64; 3]> + '_ {
    surface.vertices.iter().copied().filter(|[_, _, psi]| (1e-9..TAU - 1e-9).contains(psi))
}

fn radial([x, y, _]: [f64; 3]) -> [f64; 3] {
    [x / hypot(x, y), y / hypot(x, y), 0.0]
}

#[test]
fn without_time_the_set_is_the_disc_at_every_heading() {
    let margin = |[x, y, _]: [f64; 3]| hypot(x, y) - 3.0;
    let grid = Sampling::new(margin, [-4.0; 2], [4.0; 2], [40, 40, 12]);
    let surface = grid.surface(margin, radial, 0.0);
    check_closed(&surface);
    assert!(between_the_ends(&surface).all(|[x, y, _]| (hypot(x, y) - 3.0).abs() < 1e-4));
    let ends: Vec<_> = surface.vertices.iter().filter(|[.., psi]| *psi == TAU).collect();
    let rim = ends.iter().filter(|[x, y, _]| (hypot(*x, *y) - 3.0).abs() < 1e-4).count();
    assert!(rim > 40 && rim < ends.len() / 2, "{rim} of {}", ends.len());
    let expected = TAU * 9.0 * PI;
    assert!((surface.volume() - expected).abs() < 0.005 * expected, "{}", surface.volume());
}

#[test]
fn vertices_are_on_the_level() {
    let exact = ValueFunction::Exact(ExactValue::new(2.0, 0.5, 3.0).unwrap());
    let value = |state| exact.value(state);
    let gradient = |state| exact.state(state).gradient;
    let grid = Sampling::new(value, [-8.0, -12.0], [15.0, 12.0], [40, 40, 36]);
    for level in [-1.0, 0.0, 0.8] {
        let surface = grid.surface(value, gradient, level);
        check_closed(&surface);
        let missed = between_the_ends(&surface).map(|state| (value(state) - level).abs());
        let worst = missed.fold(0.0, f64::max);
        assert!(worst < 0.01, "{worst}");
    }
}

/// Two planes meet in a slanting line. For any position of the grid, vertices lie on the line, and
/// the triangles beside it are flat. Vertices on the grid's edges would replace the line by a
/// staircase.
#[test]
fn a_ridge_is_a_line_of_vertices() {
    let sides = [[0.8, 0.6, 0.1], [0.6, -0.8, 0.3]];
    let heights = move |state: [f64; 3]| sides.map(|side| dot(side, state));
    let value = move |state: [f64; 3]| heights(state)[0].max(heights(state)[1]) - 1.0;
    let gradient = move |state: [f64; 3]| {
        let [a, b] = heights(state);
        if a > b { sides[0] } else { sides[1] }
    };
    let surface =
        Sampling::new(value, [-5.0; 2], [5.0; 2], [23, 19, 17]).surface(value, gradient, 0.0);
    check_closed(&surface);
    let is_ridge = |state: &[f64; 3]| heights(*state).iter().all(|h| (h - 1.0).abs() < 0.02);
    let ridge = surface.vertices.iter().filter(|state| is_ridge(state)).count();
    assert!(ridge >= 16, "{ridge} vertices on the ridge");
    // No triangle extends from one side to the other, so the middle of each triangle is on the
    // level.
    let inner =
        |[x, y, psi]: &[f64; 3]| x.abs() < 4.9 && y.abs() < 4.9 && (0.01..TAU - 0.01).contains(psi);
    for triangle in &surface.triangles {
        let corners = triangle.map(|v| surface.vertices[v as usize]);
        if corners.iter().all(inner) {
            let sum = corners.iter().fold([0.0; 3], |sum, corner| add(sum, *corner, 1.0));
            let missed = value(sum.map(|part| part / 3.0));
            assert!(missed.abs() < 0.02, "{missed} at {corners:?}");
        }
    }
}

/// Where the function jumps, the surface follows the jump. The gradients on its two sides do not
/// matter.
#[test]
fn a_jump_is_part_of_the_surface() {
    let value = |[x, y, _]: [f64; 3]| if x + 0.3 * y < 0.7 { -2.0 + 0.1 * y } else { 5.0 };
    let grid = Sampling::new(value, [-3.0; 2], [3.0; 2], [20, 20, 8]);
    let surface = grid.surface(value, |_| [0.0, 0.1, 0.0], 0.0);
    check_closed(&surface);
    let is_jump = |[x, y, _]: &[f64; 3]| x.abs() < 2.9 && y.abs() < 2.9;
    let apart = surface.vertices.iter().filter(|at| is_jump(at) && at[2] > 0.0 && at[2] < TAU);
    let worst = apart.map(|[x, y, _]| (x + 0.3 * y - 0.7).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst}");
    let walls = surface.normals.iter().filter(|normal| normal[0] > 0.0 && normal[1] > 0.0);
    assert!(walls.count() > 100);
}

#[test]
fn the_volume_is_that_of_the_solver() {
    let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
    let game = PursuitGame { evader: vehicle(2.0, 0.5), pursuer: vehicle(1.6, 0.4), radius_m: 3.0 };
    let options = Options { accuracy: Accuracy::Draft, ..Options::default() };
    let solved = solve(game, &options, &mut |_| ControlFlow::Continue(())).unwrap();
    let ValueFunction::Sampled(samples) = &solved.function else { panic!("it is sampled") };
    let value = |state| solved.function.value(state);
    let gradient = |state| solved.function.state(state).gradient;
    let grid = Sampling::new(value, [-10.0, -12.0], [16.0, 12.0], [72, 72, 72]);
    let volume = grid.surface(value, gradient, 0.0).volume();
    let expected = samples.volume();
    assert!((volume - expected).abs() < 0.02 * expected, "{volume} {expected}");
}

#[test]
fn a_set_that_leaves_the_rectangle_is_closed_there() {
    let everywhere = |[x, _, _]: [f64; 3]| x - 100.0;
    let along = |_| [1.0, 0.0, 0.0];
    let grid = Sampling::new(everywhere, [0.0; 2], [4.0, 2.0], [9, 9, 4]);
    let surface = grid.surface(everywhere, along, 0.0);
    check_closed(&surface);
    assert!((surface.volume() - 8.0 * TAU).abs() < 1e-9, "{}", surface.volume());
    let nowhere = grid.surface(everywhere, along, -200.0);
    assert_eq!(nowhere, Surface::default());
}
