//! The Sidestep server and command line.
//!
//! [`client`] asks a running server, by [`tls_client`] if it has a certificate; [`store`] is the only module that speaks SQL; [`formats`] reads and writes files;
//! [`languages`] has the texts of the participant's page; [`report`] prints
//! the files of an analysis; [`jobs`] works in the background; [`http`] has a module for each resource
//! and the one table of routes; [`commands`] has a module for each subcommand.

/// Says something on stderr. Whoever reads it may have read enough, as `head` does: then nothing is said.
macro_rules! eprintln {
    ($($said:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($said)*);
    }};
}

pub mod tls_client;
pub mod client;
pub mod clock;
pub mod threads;
pub mod secrets;
mod private;
pub mod bytes;
pub mod content;
pub mod store;
pub mod observed;
pub mod soundness;
pub mod formats;
pub mod languages;
pub mod figure;
pub mod design;
pub mod recordings;
pub mod transfer;
pub mod backups;
pub mod salvage;
pub mod report;
pub mod jobs;
pub mod http;
pub mod commands;
