//! Where a page of the laboratory is opened, and by whom.

use crate::runtime::Address;
use sidestep::api::Session;

/// What a page knows when it opens.
pub(super) struct Visit<'a> {
    /// Its address.
    pub(super) address: &'a Address,
    /// The name that stands for `{id}` in the path of its route; empty where there is none.
    pub(super) id: &'a str,
    /// Who is signed in.
    pub(super) session: &'a Session,
    /// Width of the window when the laboratory was opened, px.
    pub(super) window_px: f64,
}
