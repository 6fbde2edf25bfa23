//! The pictures of the page: SVG on white, legible on light and dark pages.
//!
//! The backend rounds to whole units, so pictures are drawn in units of a quarter of a
//! pixel (`canvas::FINE`) and shown at their size. Sizes in this folder are in pixels.

mod canvas;
mod convergence;
mod error_map;
mod exceedance;
mod slices;

use anyhow::Result;

use super::report::Report;

/// One picture.
pub(super) struct Figure {
    /// Its file's name, beside the page.
    pub(super) file: &'static str,
    pub(super) draw: fn(&Report) -> Result<String>,
}

/// Every picture: one line each.
pub(super) const FIGURES: &[Figure] = &[
    Figure { file: "slices.svg", draw: slices::draw },
    Figure { file: "polar-errors.svg", draw: exceedance::draw },
    Figure { file: "error-map.svg", draw: error_map::draw },
    Figure { file: "convergence.svg", draw: convergence::draw },
];
