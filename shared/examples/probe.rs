use sidestep::reachability::*;
use sidestep::reachability::cartesian::*;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let n: [usize; 3] = if args[1] == "101" { [101; 3] } else { [51, 40, 50] };
    let scheme = if args[2] == "eno2" { Scheme::Eno2 } else { Scheme::Weno5 };
    let threads: usize = args[3].parse().unwrap();
    let p = Player { speed_mps: 5.0, turn_rate_radps: 1.0 };
    let game = PursuitGame { evader: p, pursuer: p, radius_m: 5.0 };
    let grid = Grid { axes: [Axis::bounded(-6.0, 20.0, n[0]), Axis::bounded(-10.0, 10.0, n[1]), Axis::periodic(0.0, std::f64::consts::TAU, n[2])] };
    let target = |s: [f64; 3]| game.target(s);
    let problem = Problem { game: &RelativeDubins(game), grid, target: Region::Static(&target), obstacle: None, kind: Kind::Tube, direction: Direction::Backward, horizon: Horizon::Finite(2.8) };
    let settings = Settings { scheme, threads, ..Default::default() };
    for _ in 0..2 {
    let t = Instant::now();
    let s = cartesian::solve::<f32, 3, _>(&problem, &settings, &mut |_| std::ops::ControlFlow::Continue(())).unwrap();
    let dt = t.elapsed().as_secs_f64();
    let inside = s.values.iter().filter(|v| **v <= 0.0).count() as f64 * grid.cell_volume();
    let exact = game.exact().unwrap();
    let err: f64 = s.values.iter().enumerate().map(|(i, v)| { let e = exact.value(grid.node(grid.index(i))); if e.abs() < 0.5 {(e - *v as f64).abs()} else {0.0} }).sum::<f64>() / s.values.len() as f64;
    println!("{dt:.3} s steps {} residual {:.3} volume~ {inside:.2} err {err:.5}  {:.0} Mcell-stages/s", s.steps, s.residual, (grid.len() * s.steps * scheme.stages()) as f64 / dt / 1e6);
    }
}
