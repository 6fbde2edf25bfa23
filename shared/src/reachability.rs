//! Hamilton–Jacobi reachability: how safe a configuration of two vehicles is.
//!
//! An evader and a pursuer move with bounded turn rates. The *value* of a
//! relative state is the smallest range, less the danger radius, that will ever
//! occur when the evader steers to keep it large and the pursuer to make it
//! small:
//!
//! V(x) = sup over evader, inf over pursuer, of min over t ≥ 0 of (r(t) − R).
//!
//! V ≤ 0: capture can be forced. V ≤ r − R always. It is the infinite-horizon
//! viscosity solution of min(l − V, H(x, ∇V)) = 0 with l = r − R (Mitchell,
//! Bayen and Tomlin 2005). For two identical vehicles it is known in closed form.

pub mod exact;
pub mod level_set;
pub mod value_function;

pub use exact::ExactValue;
pub use value_function::ValueFunction;
