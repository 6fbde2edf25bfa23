//! Observed orders of convergence.

use super::*;

/// The observed order: log₂ of the ratio of the mean errors with `nodes` and `2 * nodes` nodes per
/// axis.
pub(crate) fn observed_order(name: &str, nodes: usize, error: impl Fn(usize) -> Errors) -> f64 {
    let order = ln(error(nodes).mean / error(2 * nodes).mean) / LN_2;
    eprintln!("{name}: order {order:.2}");
    order
}

pub(crate) fn check_order(scheme: Scheme, order: f64) {
    let fits = match scheme {
        Scheme::Upwind => (0.9..1.1).contains(&order),
        Scheme::Eno2 => order >= 1.8,
        Scheme::Eno3 | Scheme::Weno5 => order >= 2.5,
        _ => unreachable!("the order of {scheme:?} is not known here"),
    };
    assert!(fits, "{scheme:?}: order {order}");
}

/// V_τ = c·∇V on the torus, so l moves without changing its shape.
#[test]
fn each_scheme_has_its_order_for_a_smooth_drift() {
    let game = Drift { drift: [1.0, -0.6], speed: [0.0; 2] };
    let target = |[x, y]: [f64; 2]| sin(x) * cos(y) + 0.5 * sin(x + 2.0 * y);
    let exact = |[x, y]: [f64; 2]| target([x + 1.0, y - 0.6]);
    for scheme in SCHEMES {
        let name = format!("drift {}", scheme.name());
        let nodes = if scheme == Scheme::Upwind { 160 } else { 80 };
        let order = observed_order(&name, nodes, |nodes| {
            let axes = [Axis::periodic(0.0, TAU, nodes); 2];
            let problem = problem(&game, axes, &target, (Kind::Set, BACKWARD), 1.0);
            let solution = solved::<f64, 2, _>(&problem, &settings(scheme));
            errors(&format!("{name} {nodes}"), &solution, |_| true, exact)
        });
        check_order(scheme, order);
    }
}

pub(crate) fn steepening_order(scheme: Scheme, cfl: f64) -> f64 {
    let target = |[x]: [f64; 1]| cos(x);
    let name = format!("steepening {} cfl {cfl}", scheme.name());
    observed_order(&name, 160, |nodes| {
        let axes = [Axis::periodic(0.0, TAU, nodes)];
        let problem = problem(&Steepening, axes, &target, (Kind::Set, BACKWARD), SECONDS);
        let solution = solved::<f64, 1, _>(&problem, &settings(scheme).with_cfl(cfl));
        errors(&format!("{name} {nodes}"), &solution, |_| true, |[x]| exact(x))
    })
}

#[test]
fn each_scheme_has_its_order_before_a_kink_forms() {
    for scheme in SCHEMES {
        check_order(scheme, steepening_order(scheme, 0.375));
    }
    for scheme in [Scheme::Upwind, Scheme::Eno2, Scheme::Weno5] {
        check_order(scheme, steepening_order(scheme, 0.75));
    }
}

/// A known limit of the method, which the twin shares. Where the dissipation exceeds the slope,
/// ENO3 can choose its outermost stencils on both sides. Their fastest mode then decays at the rate
/// (20/3) · speed/cell. TVD-RK3 is stable up to a rate of 2.51 per time step, which corresponds to
/// a CFL number of 0.377.
#[test]
fn eno3_loses_its_order_with_long_steps() {
    let order = steepening_order(Scheme::Eno3, 0.75);
    assert!(order < 1.0, "order {order}: say so in the documentation of `Settings::cfl`");
}
