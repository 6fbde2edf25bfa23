use sidestep::reachability::*;
use std::time::Instant;
fn main() {
    let p = Player { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: p, pursuer: p, radius_m: 3.0 };
    let mut go = |_: Progress| std::ops::ControlFlow::Continue(());
    let mut rng = sidestep::math::SeededRng::new(1);
    for method in [Method::Polar, Method::Exact, Method::Cartesian] {
        let solved = solve(game, &Options { method: Some(method), horizon_s: if method == Method::Cartesian { 0.1 } else { f64::INFINITY }, ..Options::default() }, &mut go).unwrap();
        let states: Vec<[f64; 3]> = (0..4096).map(|_| [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, 6.28)]).collect();
        let mut best = f64::INFINITY; let mut sum = 0.0;
        for _ in 0..300 {
            let t = Instant::now();
            for s in &states { let e = solved.samples.state(*s); sum += e.value + e.gradient[0] + e.gradient[1] + e.gradient[2]; }
            best = best.min(t.elapsed().as_secs_f64() / states.len() as f64 * 1e9);
        }
        println!("{} {best:.1} ns {sum}", method.name());
    }
}
