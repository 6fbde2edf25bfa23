//! The pages, one state machine each.

mod notice;
pub mod participant;
pub mod replay;
pub mod lab;
