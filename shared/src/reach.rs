//! Planar reachable sets of a vehicle that moves at a constant speed or chooses its speed from a range. The
//! bounds on its turn rate can differ from step to step, and so can the range of its speed.
//!
//! There is no grid and no level set: by Pontryagin's principle the boundary of the set
//! consists of a few families of explicit paths ([`ReachableSet`], `boundary`).
//!
//! There are no extremals for speeds from a [range](crate::vehicle::SpeedRange). Then every polygon is
//! constructed like a conservative one, within the accuracy.
//!
//! By default, a polygon follows the boundary of the set within the requested accuracy, on either side
//! of it. A [conservative](PolygonSettings::conservative) polygon encloses the set (`outer`). The
//! start can be uncertain ([`StartSet`]). [`ReachableSet::contains_state`] decides without polygons
//! whether a full state (position and heading) is reachable (`membership`).
//!
//! The work per polygon is [limited](PolygonSettings::with_most_work), whatever the bounds, the start
//! and the number of steps. If the limit is exceeded, the result is a convex polygon around the set
//! (`hull`); [`Outline`] says which kind a polygon is. A caller that reuses a [`Workspace`] and calls
//! [`ReachableSet::reset`] causes no allocations from the second polygon on.
//!
//! # Guarantees
//! For all accepted bounds, a conservative polygon (`outer`) contains every position that an
//! admissible path reaches, and so does a convex one (`hull`). Decision 0007 has the proof;
//! `shared/tests/reach` searches for counterexamples.
//!
//! For all accepted bounds, [`ReachableSet::contains_state`] is true for every state that an admissible
//! path reaches within the tolerance. It is also true for an unreachable state if no proof was found that
//! this state is outside. [`ReachableSet::state_membership`] distinguishes the two cases. With speeds from a
//! range, no state is found inside: it is either outside or open.
//!
//! Polygons that are not conservative follow the boundary within the accuracy if their
//! [margin](Outline::Refined) is 0:
//! * They consist of extremals if the headings along each of the two outermost paths are within a
//!   quarter turn of each other (15 steps of 0.2 s at ±0.5 rad/s). It is proven that these extremals
//!   bound the tube. There is no proof that they also bound the set after a step, but tests measure
//!   this (`shared/tests/reach/closeness.rs`, `promises.rs`).
//! * Otherwise, where the bounds narrowly forbid driving straight, and for speeds from a range, polygons are
//!   constructed like conservative ones but without the margin. It is proven that they miss no position by more than
//!   the accuracy. At sharp corners they can extend beyond the set by a few times the accuracy.
//!
//! With large turns per step, many steps or a high accuracy, the work can exceed its limit. The polygon
//! is then conservative even if this was not requested. Either its margin is above 0, or it is a convex
//! hull.
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
