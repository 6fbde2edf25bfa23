//! Sidestep in the browser.
//!
//! A page is an [`App`](runtime::App): events in, commands out, and a pure
//! description of what to show ([`view`], [`shape`]). Only [`browser`] touches the
//! browser, so that every page can be driven natively in tests.

pub mod shape;
pub mod view;
pub mod json;
pub mod runtime;
pub mod input;
pub mod drive;
pub mod outbox;
pub mod overlays;
pub mod pages;
pub mod browser;
