//! The Sidestep server and command line.
//!
//! [`client`] calls a running server, through [`support::tls_client`] if the server has a
//! certificate. [`store`] is the only module that uses SQL. [`formats`] reads and writes files.
//! [`languages`] has the texts of the participant's page. [`report`] prints the files of an
//! analysis. [`jobs`] works in the background. [`http`] has a module for each resource and the
//! single table of routes. [`commands`] has a module for each subcommand,
//! and [`program`] parses the command line.

/// Prints to stderr. Ignores errors, because the reader might have closed stderr early, as `head`
/// does.
macro_rules! eprintln {
    ($($said:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($said)*);
    }};
}

pub mod support;
pub mod client;
pub mod trial_content;
pub mod store;
pub mod metrics;
pub mod database_check;
pub mod formats;
pub mod languages;
pub mod figure;
pub mod design;
pub mod study_recording;
pub mod transfer;
pub mod backups;
pub mod salvage;
pub mod report;
pub mod jobs;
pub mod http;
pub mod commands;
pub mod program;
