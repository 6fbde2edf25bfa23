//! Sidestep in the browser.
//!
//! A page is a [`Page`](runtime::Page): it takes messages of its own type, answers with
//! commands, and describes what to show ([`view`], [`sidestep::picture`]). [`diff`] turns two views into
//! edits of the document. Only [`browser`] touches the browser, so that every page can be driven
//! natively in tests.

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
