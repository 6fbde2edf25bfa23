//! Faults around a server: it is killed, loses power, its clock jumps, its clients are slow, broken
//! or gone, its file is read-only. Nothing acknowledged is lost, nothing is stored twice, and the
//! service recovers.
//!
//! A lock of another process, a full disk and a deleted database are in `api/trouble.rs`, browser
//! faults in `browser/faults.rs`. `cargo xtask bench faults` kills and cuts many times, and
//! measures how fast the service recovers.

// Helpers outside `#[test]` functions are tests too.
#![allow(clippy::unwrap_used)]

mod clients;
mod clock;
mod comparison;
mod file;
mod kills;
mod matrix;
mod power;
mod postgres;
mod servers;
