//! The context in which a page of the laboratory opens.

use crate::runtime::Address;
use sidestep::api::Session;

/// What a page gets when it opens.
pub(super) struct Visit<'a> {
    /// The page's address.
    pub(super) address: &'a Address,
    /// The id in the path. Empty if the route has no `{id}`.
    pub(super) id: &'a str,
    /// The user's session.
    pub(super) session: &'a Session,
    /// Width of the window when the laboratory was opened (px).
    pub(super) window_px: f64,
}
