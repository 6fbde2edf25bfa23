//! Exact planar reachable sets of a vehicle at constant speed under bounds on its turn rate
//! that change from step to step.
//!
//! There is no grid and no level set: by Pontryagin's principle the boundary of the set
//! consists of a few families of explicit paths ([`ReachableSet`], `boundary`).
//!
//! A polygon follows the set to either side within the accuracy asked for, or, if
//! [conservative](PolygonSettings::conservative), around it (`outer`). The start may be
//! uncertain ([`StartSet`]). Whether a full state, position and heading, is reachable is
//! decided without polygons ([`ReachableSet::contains_state`], `membership`).
//! The work of a polygon is [bounded](PolygonSettings::with_most_work), whatever the bounds and the number of steps. What would
//! take more becomes a convex polygon around the set (`hull`); [`Outline`] says which kind a polygon is.
//! With a [`Workspace`] and [`ReachableSet::reset`] nothing is allocated from the second time on.
//!
//! # What is promised
//! A conservative polygon contains every position that an admissible path reaches, for all bounds that are
//! accepted (`outer`), and so does a convex one (`hull`): that is shown in decision 0007, and searched for counterexamples in `shared/tests/reach`.
//!
//! [`ReachableSet::contains_state`] is true for every state that an admissible path leads to, to within the
//! tolerance, for all bounds that are accepted. It can be true for others, if their being outside is not proven:
//! [`ReachableSet::state_membership`] tells them apart.
//!
//! Polygons that follow the boundary and are not conservative can pass inside a reachable position by more than the
//! accuracy: by 0.147 mm and 0.194 mm at an accuracy of 0.1 mm, at the paper's rates. These drives
//! are there too.

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
pub use membership::{Membership, Side, StateMargins, Tolerance};
pub use minkowski::minkowski_disc;
pub(crate) use paths::NEARLY_ZERO;
pub use sampling::{Outline, PolygonSettings};
pub use set::ReachableSet;
pub use start::{PositionUncertainty, StartSet};
