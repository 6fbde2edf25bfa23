//! `docs/validation/shfrs.md`: what the reachable sets and their probabilities are worth.
//!
//! The example `validate_shfrs` of the library computes and prints numbers; here they become
//! the page ([`page`]). The paper's Figure 3 is rebuilt by the program itself ([`figure3`]).

mod figure3;
mod report;
mod page;

use anyhow::Result;

use super::{folder, measured, write};
use crate::workspace::Workspace;

/// Measures and writes.
///
/// # Errors
/// When the library or the program cannot be built, a measurement fails or a file cannot be
/// written.
pub(super) fn run(workspace: &Workspace) -> Result<()> {
    let report = measured(workspace, "validate_shfrs")?;
    let panels = figure3::panels(workspace)?;
    let page = folder(workspace).join("shfrs.md");
    write(&page, &page::page(&report, &panels))?;
    println!("{}", page.display());
    Ok(())
}
