//! Many people who take part at once, in one thread, and what the server owes them afterwards.
//!
//! A [`Crowd`] enrols, uploads as fast as it is answered or by the clock, reloads, repeats, vanishes
//! and withdraws. Its [ledger](ledger::compare) then compares every trial that was acknowledged with the
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
