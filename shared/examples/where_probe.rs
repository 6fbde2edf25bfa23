use sidestep::reachability::*;
fn main() {
    let p = Player { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let game = PursuitGame { evader: p, pursuer: p, radius_m: 3.0 };
    let exact = game.exact().unwrap();
    let mut go = |_: Progress| std::ops::ControlFlow::Continue(());
    let solved = solve(game, &Options { method: Some(Method::Polar), ..Options::default() }, &mut go).unwrap();
    let mut rng = sidestep::math::SeededRng::new(1);
    for _ in 0..200_000 {
        let s = [rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0), rng.uniform(0.0, 6.28)];
        let e = exact.value(s);
        if e.abs() < 0.5 { let v = solved.function.value(s); let (r, a) = (s[0].hypot(s[1]), s[1].atan2(s[0])); println!("D {r} {a} {} {e} {v}", s[2]); }
    }
}
