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
//! **Outside this range they can miss reachable positions**: at large turns per step, by up to
//! 4.5 cm in 6 steps of ±1.5 rad, and by more over more steps (21.6 cm in 9, 0.53 m in 10
//! such steps, at 2 m/s and 10 m/s); 17 of 8,478 random bounds of six such classes were affected.
//! `shared/tests/reach_known_failures.rs` has the smallest cases.

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
pub use minkowski::{minkowski_disc, minkowski_disc_into};
pub use sampling::PolygonSettings;
pub use set::ReachableSet;
pub use start::{PositionUncertainty, StartSet};
