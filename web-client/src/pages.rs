//! The pages, one state machine each.

pub mod lab;
pub mod participant;
pub mod replay;
