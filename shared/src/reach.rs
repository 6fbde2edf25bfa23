//! Exact planar reachable sets of a vehicle at constant speed under bounds on its turn rate
//! that change from step to step.
//!
//! There is no grid and no level set: by Pontryagin's principle the boundary of the set
//! consists of a few families of explicit paths ([`ReachableSet`], `boundary`).
//!
//! A polygon follows the boundary of the set on either side within the requested accuracy or, if
//! [conservative](PolygonSettings::conservative), encloses the set (`outer`). The start may be
//! uncertain ([`StartSet`]). Whether a full state, position and heading, is reachable is decided
//! without polygons ([`ReachableSet::contains_state`], `membership`).
//! The work for a polygon is [bounded](PolygonSettings::with_most_work) for all bounds, starts and
//! numbers of steps. Beyond that limit the result is a convex polygon around the set (`hull`);
//! [`Outline`] says which kind a polygon is. With a [`Workspace`] and [`ReachableSet::reset`]
//! nothing is allocated from the second polygon on.
//!
//! # Guarantees
//! For all accepted bounds, a conservative polygon (`outer`) contains every position that an
//! admissible path reaches, and so does a convex one (`hull`). Decision 0007 has the proof;
//! `shared/tests/reach` searches for counterexamples.
//!
//! For all accepted bounds, [`ReachableSet::contains_state`] is true for every state that an
//! admissible path leads to, within the tolerance. It can be true for other states that are not
//! proven to be outside: [`ReachableSet::state_membership`] distinguishes the two.
//!
//! Other polygons follow the boundary within the accuracy if their [margin](Outline::Refined) is 0:
//! * Polygons consist of extremals as long as the headings along each of the two outermost paths
//!   are within a quarter turn of each other (15 steps of 0.2 s at ±0.5 rad/s). That these
//!   extremals bound the tube is proved; that they bound the set after a step is measured
//!   (`shared/tests/reach/closeness.rs`, `promises.rs`).
//! * Beyond that, and where bounds just forbid driving straight, polygons are made like
//!   conservative ones, without the margin. It is proven that they miss no position by more than
//!   the accuracy. At sharp corners they can stick out by a few times the accuracy.
//!
//! At large turns per step, over many steps, or at high accuracy, the work can exceed its limit. Then a polygon
//! is conservative even if that was not requested: its margin is above 0, or it is a convex hull.
//!
//! # Cancelling
//! Long-running methods have a variant that regularly asks the caller whether to continue:
//! [`ReachableSet::try_step_polygon_into`], [`ReachableSet::try_tube_polygon_into`] and
//! [`ReachableSet::try_state_membership`].

mod paths;
mod budget;
mod sampling;
mod start;
pub mod polygon;
mod outline;
mod outer;
mod boundary;
mod minkowski;
mod hull;
mod set;
mod membership;

pub use boundary::Workspace;
pub use budget::{Cancelled, Progress};
pub use membership::{Membership, Side, StateMargins, Tolerance};
pub use minkowski::minkowski_disc;
pub(crate) use paths::nearly_zero;
pub use sampling::{Outline, PolygonSettings};
pub use set::ReachableSet;
pub use start::{PositionUncertainty, StartSet};
