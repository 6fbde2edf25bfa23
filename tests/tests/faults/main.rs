//! Faults of a server and its environment. The server is killed or loses power, its clock jumps,
//! its clients are slow, broken or gone, or its file is read-only. Nothing acknowledged is lost,
//! nothing is stored twice, and the service recovers.
//!
//! A lock of another process, a full disk and a deleted database are tested in `api/trouble.rs`,
//! and browser faults in `browser/faults.rs`. `cargo xtask bench faults` makes many kills and power
//! cuts, and measures how fast the service recovers.

// Clippy permits `unwrap` in `#[test]` functions. Helpers outside them are also test code.
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
