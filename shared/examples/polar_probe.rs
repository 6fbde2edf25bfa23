use sidestep::reachability::*;
use sidestep::reachability::polar;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let p = Player { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: p, pursuer: p, radius_m: 3.0 };
    let settings = polar::Settings { range_nodes: args[1].parse().unwrap(), angle_nodes: args[2].parse().unwrap(), tolerance_m: args[3].parse().unwrap(), most_sweeps: args[4].parse().unwrap(), ..Default::default() };
    let exact = game.exact().unwrap();
    for _ in 0..2 {
    let t = Instant::now();
    let s = polar::solve::<f32>(&game, &settings, &mut |_| std::ops::ControlFlow::Continue(())).unwrap();
    let dt = t.elapsed().as_secs_f64();
    let n = s.angle_nodes; let m = s.deficit.len()/n/s.range.nodes;
    let mut errs: Vec<f64> = vec![]; let mut far = vec![];
    for i in 0..s.range.nodes { let r = s.range.node(i); for k in 0..m { let a = k as f64 * std::f64::consts::TAU / n as f64; for j in 0..n {
        let d = j as f64 * std::f64::consts::TAU / n as f64;
        let e = exact.value([r*a.cos(), r*a.sin(), d]);
        let mut w = s.deficit[(i*m+k)*n+j]; if m == n { w = w.max(s.deficit[(i*m+(n-k)%n)*n+(n-j)%n]); } let v = w as f64 + r - 3.0;
        if args.len() > 5 && e.abs() < 0.5 && (v-e).abs() > 0.05 { println!("D {r} {a} {d} {e} {v}"); }
        if e.abs() < 0.5 { errs.push((v-e).abs()); } else { far.push((v-e).abs()) }
    }}}
    errs.sort_by(f64::total_cmp); far.sort_by(f64::total_cmp);
    let q = |v: &Vec<f64>, p: f64| v[((v.len()-1) as f64 * p) as usize];
    println!("{dt:.3} s sweeps {} drift {:.1e}; n {} median {:.4} p90 {:.4} p99 {:.4} max {:.4}; far p99 {:.4} max {:.3}", s.sweeps, s.drift_m, errs.len(), q(&errs,0.5), q(&errs,0.9), q(&errs,0.99), q(&errs,1.0), q(&far,0.99), q(&far,1.0));
    }
}
