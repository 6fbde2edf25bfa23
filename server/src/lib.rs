//! The Sidestep server and command line.
//!
//! [`store`] is the only place that speaks SQL; [`formats`] reads and writes files; [`jobs`]
//! works in the background; [`http`] has one module a resource and the one table of routes;
//! [`commands`] has one module a subcommand.

pub mod clock;
pub mod threads;
pub mod secrets;
pub mod bytes;
pub mod content;
pub mod store;
pub mod formats;
pub mod figure;
pub mod recordings;
pub mod report;
pub mod jobs;
pub mod http;
pub mod commands;
