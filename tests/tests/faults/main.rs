//! What goes wrong around a server: it is killed, loses power, its clock jumps, its clients are slow,
//! broken or gone, its file may not be written. Nothing that was acknowledged is lost, nothing is
//! stored twice, and the service is back.
//!
//! A lock of another process, a full disk and a deleted database are in `api/trouble.rs`, what goes
//! wrong in a browser in `browser/faults.rs`. `cargo xtask bench faults` kills and cuts many times, and
//! measures how soon the service is back.

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
