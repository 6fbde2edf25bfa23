use sidestep::reachability::*;
use std::time::Instant;
fn main() {
    let p = Player { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: p, pursuer: p, radius_m: 3.0 };
    let exact = game.exact().unwrap();
    let mut go = |_: Progress| std::ops::ControlFlow::Continue(());
    for (name, options) in [
        ("exact", Options { method: Some(Method::Exact), ..Options::default() }),
        ("exact fine", Options { method: Some(Method::Exact), accuracy: Accuracy::Fine, ..Options::default() }),
        ("polar", Options { method: Some(Method::Polar), ..Options::default() }),
        ("polar fine", Options { method: Some(Method::Polar), accuracy: Accuracy::Fine, ..Options::default() }),
        ("cart", Options { method: Some(Method::Cartesian), horizon_s: 6.3, ..Options::default() }),
    ] {
        let t = Instant::now();
        let solved = solve(game, &options, &mut go).unwrap();
        let wall = t.elapsed().as_secs_f64();
        let t = Instant::now();
        let volume = solved.samples.volume();
        let tv = t.elapsed().as_secs_f64();
        let f = ValueFunction::Sampled(solved.samples.clone());
        let mut rng = sidestep::math::SeededRng::new(1);
        let states: Vec<[f64; 3]> = (0..200_000).map(|_| [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, 6.28)]).collect();
        let t = Instant::now();
        let mut sum = 0.0;
        for s in &states { let e = solved.samples.state(*s); sum += e.value + e.gradient[2]; }
        let ns = t.elapsed().as_secs_f64() / states.len() as f64 * 1e9;
        let mut e: Vec<f64> = states.iter().filter(|s| exact.value(**s).abs() < 0.5).map(|s| (f.value(*s) - exact.value(*s)).abs()).collect();
        e.sort_by(f64::total_cmp);
        let octets = f.encode();
        let t = Instant::now();
        let curves: usize = (0..100).map(|i| f.level_curves(i as f64 * 0.0628, 0.0, CurveSettings::default()).iter().map(Vec::len).sum::<usize>()).sum();
        let us = t.elapsed().as_secs_f64() * 1e4;
        let back = ValueFunction::decode(&octets).unwrap();
        let worst = states.iter().map(|s| (back.value(*s) - f.value(*s)).abs()).fold(0.0, f64::max);
        println!("{name}: {wall:.3} s steps {} volume {volume:.3} ({tv:.3} s) {ns:.0} ns/state ({sum:.0}) |V|<.5 n {} median {:.4} p99 {:.4} max {:.3}; {} octets, transport error {worst:.5}; curve {us:.0} us, {} points", solved.steps, e.len(), e[e.len()/2], e[e.len()*99/100], e[e.len()-1], octets.len(), curves / 100);
    }
}
