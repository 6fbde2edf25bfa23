//! Exact planar reachable sets of a vehicle at constant speed under bounds on its turn rate
//! that change from step to step.
//!
//! There is no grid and no level set: by Pontryagin's principle the boundary of the set
//! consists of a few families of explicit paths ([`ReachableSet`], `boundary`).
//!
//! A polygon follows the set to either side within the accuracy asked for, or, if
//! [conservative](PolygonSettings::conservative), around it (`minkowski`). The start may be
//! uncertain ([`StartSet`]). Whether a full state, position and heading, is reachable is
//! decided without polygons ([`ReachableSet::contains_state`], `membership`).
//! With a [`Workspace`] and [`ReachableSet::reset`] nothing is allocated from the second time on.
//!
//! # Where conservative polygons were shown to hold
//! At turn rates of at most 0.5 rad/s, steps of 0.2 s (0.1 rad a step) and up to 15 steps, no
//! random drive left a conservative polygon: 23,428 random bounds with 60 drives each.
//! **Outside this range they can miss reachable positions**: at 10 m/s and up to 1.5 rad in a
//! step of 0.5 s, by 1.1 cm in 3 steps, 4.5 cm in 6 and 39 cm in 9. 17 of 8,478 random bounds
//! of six classes with larger turns or more steps were affected, the worst by 0.53 m in 10 steps.
//! `shared/tests/reach/known_failures.rs` has some of these cases.
//!
//! Polygons that are not conservative can pass inside a reachable position by more than the
//! accuracy: by 0.147 mm and 0.194 mm at an accuracy of 0.1 mm, at the paper's rates. These drives
//! are there too.

mod paths;
mod sampling;
mod start;
pub mod polygon;
mod outline;
mod boundary;
mod minkowski;
mod set;
mod membership;

pub use boundary::Workspace;
pub use membership::{Side, StateMargins, Tolerance};
pub use minkowski::minkowski_disc;
pub(crate) use paths::NEARLY_ZERO;
pub use sampling::PolygonSettings;
pub use set::ReachableSet;
pub use start::{PositionUncertainty, StartSet};
