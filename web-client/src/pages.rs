//! The pages. Each is a state machine.

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
