//! Simulates many people who take part at the same time, in one thread, and then checks the
//! database.
//!
//! A [`Crowd`] enrols, uploads at full speed or at a fixed rate, reloads, retries, vanishes and
//! withdraws. Afterwards, its [ledger](ledger::compare) compares every acknowledged trial with the
//! database, value by value.

pub mod capacity;
pub mod figures;
pub mod http;
pub mod person;
pub mod crowd;
pub mod natural;
pub mod kills;
pub mod ledger;

pub use crowd::Crowd;
pub use figures::{Latencies, Usage};
pub use ledger::{Comparison, compare};
pub use person::Person;
