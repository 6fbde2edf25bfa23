use sidestep::reachability::*;
use sidestep::reachability::polar;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let f = |i: usize| args[i].parse::<f64>().unwrap();
    let game = PursuitGame { evader: Player { speed_mps: f(1), turn_rate_radps: f(2) }, pursuer: Player { speed_mps: f(3), turn_rate_radps: f(4) }, radius_m: 3.0 };
    let solve = |sweeps: usize| {
        let settings = polar::Settings { most_sweeps: sweeps, tolerance_m: f(7), ..Default::default() };
        polar::solve::<f32>(&game, &settings, &mut |_| std::ops::ControlFlow::Continue(())).unwrap() };
    let (a, b) = (solve(f(5) as usize), solve(f(6) as usize));
    let n = a.angle_nodes; let m = n/2+1;
    for i in (0..a.range.nodes).step_by(4) {
        let mut sum = 0.0; let mut most = (0.0, 0, 0, 0.0, 0.0);
        for k in 0..m { for j in 0..n { let p = (i*m+k)*n+j; let d = (a.deficit[p]-b.deficit[p]).abs(); sum += d; if d > most.0 { most = (d, k, j, a.deficit[p], b.deficit[p]); } } }
        println!("{i} r {:.2} mean {:.4} most {:?}", a.range.node(i), sum / (m * n) as f32, most);
    }
}
