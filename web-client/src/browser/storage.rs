//! What this browser keeps for pages of this origin.

use crate::runtime::NotKept;
use wasm_bindgen::prelude::*;
use web_sys::{DomException, Storage, Window};

/// A private window may have none, or refuse it with an error.
fn storage(window: &Window) -> Option<Storage> {
    window.local_storage().ok().flatten()
}

/// Everything of ours, by name.
pub(super) fn all(window: &Window) -> Option<Vec<(String, String)>> {
    let storage = storage(window)?;
    let names = (0..storage.length().ok()?).filter_map(|i| storage.key(i).ok()?);
    let ours = names.filter(|name| name.starts_with("sidestep."));
    Some(ours.filter_map(|name| Some((name.clone(), storage.get_item(&name).ok()??))).collect())
}

/// Keeps a text under a name.
pub(super) fn keep(window: &Window, name: &str, text: &str) -> Result<(), NotKept> {
    let storage = storage(window).ok_or(NotKept::Denied)?;
    storage.set_item(name, text).map_err(|error| {
        let is_full =
            error.dyn_ref::<DomException>().is_some_and(|e| e.name() == "QuotaExceededError");
        if is_full { NotKept::Full } else { NotKept::Denied }
    })
}

/// Forgets what is kept under a name.
pub(super) fn forget(window: &Window, name: &str) {
    if let Some(storage) = storage(window) {
        // What is not there cannot fail to be removed.
        let _ = storage.remove_item(name);
    }
}
