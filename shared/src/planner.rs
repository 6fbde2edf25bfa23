//! The planner's question: is a planned trajectory of the robot clear of where the human may be, and
//! with which probability?

mod plan;
mod headings;
mod farthest;
mod search;
mod clearance;
mod coverage;
mod online;

pub use clearance::{Clearance, ClearanceFinder, ClearanceSettings, Clearances, HumanFuture};
pub use coverage::{CollisionBound, CoverageBounds};
pub use online::{Continuity, OnlinePredictor};
pub use plan::{Footprint, Plan, PlanLimits};
