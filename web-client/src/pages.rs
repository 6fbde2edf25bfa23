//! The pages, one state machine each.

mod parts;
pub mod participant;
mod moment;
mod safety;
mod models;
mod coverage;
pub mod replay;
pub mod explorer;
pub mod demo;
pub mod reachability;
pub mod lab;
