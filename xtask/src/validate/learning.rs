//! `docs/validation/learning.md`: how near models, comparison and tests are to scikit-learn and
//! scipy.
//!
//! The example `validate_learning` of the library computes and prints numbers; here they become
//! the page ([`page`]).

mod report;
mod differences;
mod page;

use anyhow::Result;

use super::{folder, measured, write};
use crate::workspace::Workspace;

/// Measures and writes.
///
/// # Errors
/// When the library cannot be built, a measurement fails or the file cannot be written.
pub(super) fn run(workspace: &Workspace) -> Result<()> {
    let report = measured(workspace, "validate_learning")?;
    let page = folder(workspace).join("learning.md");
    write(&page, &page::page(&report))?;
    println!("{}", page.display());
    Ok(())
}
