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
//! The work of a polygon is [bounded](PolygonSettings::with_most_work), whatever the bounds, the start and the number of steps. What
//! would take more becomes a convex polygon around the set (`hull`); [`Outline`] says which kind a polygon is.
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
//! Other polygons follow the boundary within the accuracy, if their [margin](Outline::Refined) is 0:
//! * Polygons consist of extremals as long as the headings along each of the two outermost paths are within a quarter turn of
//!   each other (15 steps of 0.2 s at ±0.5 rad/s). That these extremals bound the tube is proved; that they bound the set after
//!   a step is measured (`shared/tests/reach/closeness.rs`, `promises.rs`).
//! * Beyond, and where bounds just forbid driving straight, polygons are made as conservative ones are, without the margin. No
//!   position is missed by more than the accuracy: that is proven. At sharp corners they can stick out by a few times the accuracy.
//!
//! Beyond, the work can be too much for the accuracy: at large turns a step, over many steps, or at high accuracy. Then the
//! polygon is conservative without having been asked to be; its margin, which is above 0, or its being a convex hull tells so.
//!
//! # Cancelling
//! What may take long has a twin that asks its caller from time to time whether to go on: [`ReachableSet::try_step_polygon_into`],
//! [`ReachableSet::try_tube_polygon_into`] and [`ReachableSet::try_state_membership`].

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
