//! The Sidestep server and command line.
//!
//! A resource is one vertical slice ([`studies`], [`participants`], [`trials`],
//! [`value_functions`], [`laboratory`], [`exports`], [`analyses`]); [`app`] holds the one
//! table of routes; [`store`] is the only place that speaks SQL; each subcommand is one
//! module of [`commands`]; in the background [`safety`] solves value functions and
//! [`analyst`] makes analyses.

pub mod analyses;
pub mod analysis;
pub mod analyst;
pub mod app;
pub mod auth;
pub mod clock;
pub mod commands;
pub mod complaint;
pub mod config;
pub mod content;
pub mod csv_lines;
pub mod error;
pub mod exports;
pub mod features_csv;
pub mod figure;
pub mod guard;
pub mod json;
pub mod laboratory;
pub mod listen;
pub mod metrics;
pub mod npz;
pub mod params;
pub mod participants;
pub mod safety;
pub mod secrets;
pub mod session;
pub mod site;
pub mod store;
pub mod studies;
pub mod synthetic;
pub mod throttle;
pub mod training;
pub mod trials;
pub mod trials_csv;
pub mod value_functions;
pub mod whole_file;
pub mod whole_folder;
