//! Numbers of threads, SIMD lanes and number types.

use super::*;

/// The bits of V do not depend on the number of threads and lanes. f32 differs from f64 by at most
/// `single`, relative to the maximum |V|.
pub(crate) fn compare_threads<const D: usize>(axes: [Axis; D], seconds: f64, single: f64) {
    let grid = Grid { axes };
    assert!(grid.len() >= 50_000, "small grids use one thread whatever is asked for");
    let still_ball = |x| ball(x, 0.0);
    let target = Region::OfMarchTime(&bumpy);
    let problem = Problem::new(&Twisted, grid, target, Horizon::Finite(seconds))
        .with_avoid(Region::Static(&still_ball));
    for scheme in [Scheme::Upwind, Scheme::Eno2, Scheme::Weno5] {
        let with = |threads| settings(scheme).with_threads(threads);
        let one = solved::<f64, D, _>(&problem, &with(1));
        let one_single = solved::<f32, D, _>(&problem, &with(1));
        for threads in [0, 2, 3, 1_000_000] {
            let many = solved::<f64, D, _>(&problem, &with(threads));
            let same = one.values.iter().zip(&many.values).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same && one.residual.to_bits() == many.residual.to_bits(), "{threads} threads");
            let many = solved::<f32, D, _>(&problem, &with(threads));
            let mut pairs = one_single.values.iter().zip(&many.values);
            assert!(pairs.all(|(a, b)| a.to_bits() == b.to_bits()), "{threads} threads, f32");
        }
        for lanes in [Lanes::Bits128, Lanes::Bits256, Lanes::Bits512] {
            let with = with(2).with_lanes(lanes);
            let double = solved::<f64, D, _>(&problem, &with);
            let mut pairs = one.values.iter().zip(&double.values);
            assert!(pairs.all(|(a, b)| a.to_bits() == b.to_bits()), "{lanes:?}");
            let single = solved::<f32, D, _>(&problem, &with);
            let mut pairs = one_single.values.iter().zip(&single.values);
            assert!(pairs.all(|(a, b)| a.to_bits() == b.to_bits()), "{lanes:?}, f32");
        }
        let size = one.values.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
        let gaps = one.values.iter().zip(&one_single.values);
        let worst = gaps.fold(0.0_f64, |worst, (a, b)| worst.max((a - f64::from(*b)).abs())) / size;
        eprintln!("threads {D}-D {}: f32 within {worst:.1e} of f64", scheme.name());
        assert!(worst <= single, "{worst}");
    }
}

#[test]
fn threads_and_lanes_do_not_change_a_bit() {
    compare_threads([Axis::periodic(0.0, TAU, 50_001)], 1e-3, 5e-6);
    compare_threads([Axis::bounded(-2.1, 2.4, 301), Axis::periodic(0.0, TAU, 203)], 0.03, 5e-6);
    compare_threads(
        [Axis::bounded(-2.1, 2.4, 37), Axis::periodic(0.0, TAU, 41), Axis::bounded(-1.0, 2.0, 43)],
        0.03,
        2e-6,
    );
    compare_threads(
        [
            Axis::periodic(0.0, TAU, 17),
            Axis::bounded(-2.1, 2.4, 13),
            Axis::bounded(-2.1, 2.4, 15),
            Axis::periodic(0.0, TAU, 16),
        ],
        0.03,
        2e-6,
    );
}
