//! `docs/validation/reachability.md`: what the value functions are worth.
//!
//! The example `validate` of the library computes, draws the pictures and prints numbers, which
//! become the page ([`page`]) here. Every number on the page comes from
//! there, except those of [`peers`], which take minutes to measure and depend on the machine:
//! they are kept in `docs/validation/peers.json`.

mod peers;
mod report;
mod page;

use anyhow::{Context, Result};

use super::{folder, measured, read, write};
use crate::workspace::Workspace;
use report::Report;

/// Measures and writes; the other programs too, if `again`.
///
/// # Errors
/// When the library cannot be built, a solve fails or a file cannot be written.
pub(super) fn run(workspace: &Workspace, again: bool) -> Result<()> {
    let report: Report = measured(workspace, "validate")?;
    let folder = folder(workspace);
    let peers_path = folder.join("peers.json");
    let kept = read(&peers_path)?;
    let kept = peers::Peers::parse(&kept).with_context(|| peers_path.display().to_string())?;
    let peers = if again { kept.measured_again(workspace)? } else { kept };
    if again {
        write(&peers_path, &peers.text()?)?;
    }

    for (file, svg) in &report.figures {
        write(&folder.join(file), svg)?;
    }
    let page = folder.join("reachability.md");
    write(&page, &page::page(&report, &peers))?;
    println!("{}", page.display());
    Ok(())
}
