//! The paper's comparison: does what is known of the danger help to predict a person?

pub mod avoidance;
pub mod metrics;
pub mod split;
pub mod cell;
pub mod tables;
pub mod rollout;
