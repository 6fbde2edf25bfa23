//! Sidestep in the browser.
//!
//! A page is a [`Page`](runtime::Page): it takes messages of its own type, returns commands, and
//! describes its view ([`view`], [`sidestep::picture`]). [`diff`] computes the document's edits
//! between two views. Only [`browser`] uses the browser's API, so tests can operate every page
//! natively.

pub mod form;
pub mod view;
pub mod diff;
pub mod json;
pub mod task;
pub mod texts;
pub mod evaluation;
pub mod runtime;
#[cfg(test)]
mod testing;
pub mod input;
pub mod drive;
pub mod outbox;
pub mod pages;
pub mod browser;
