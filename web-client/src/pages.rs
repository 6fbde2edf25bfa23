//! The pages, one state machine each.

mod parts;
pub mod participant;
pub mod replay;
pub mod lab;
