//! Complete HTTP requests and commands, each against a server with its own database.

// Clippy permits `unwrap` in `#[test]` functions. Helpers outside them are also test code.
#![allow(clippy::unwrap_used)]

mod analyze;
mod analyze_input;
mod analyses;
mod analysis_processes;
mod changes;
mod client;
mod configurations;
mod copying;
mod damage;
mod database;
mod design;
mod trouble;
mod features;
mod files;
mod help;
mod exports;
mod export_examples;
mod keeping;
mod keys;
mod laboratory;
mod openapi;
mod participation;
mod people;
mod profiles;
mod prediction;
mod predictors;
mod privacy;
mod proxies;
mod recruitment;
mod retention;
mod rights;
mod attempts;
mod robots;
mod attacks;
mod gates;
mod process;
mod safety;
mod site;
mod studies;
mod study_guide;
mod texts;
mod evidence;
mod tables;
mod terminal;
mod several_servers;
mod shfrs;
mod simulate;
mod demo;
mod solving;
