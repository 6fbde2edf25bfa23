//! Context in which a page of the laboratory is opened.

use crate::runtime::Address;
use sidestep::api::Session;

/// The context of a page when it opens.
pub(super) struct Visit<'a> {
    /// Its address.
    pub(super) address: &'a Address,
    /// The text for `{id}` in the path of its route; empty if there is none.
    pub(super) id: &'a str,
    /// The session.
    pub(super) session: &'a Session,
    /// Width of the window when the laboratory was opened, px.
    pub(super) window_px: f64,
}
