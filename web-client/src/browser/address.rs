//! The address bar and the history.

use crate::runtime::Address;
use wasm_bindgen::prelude::*;
use web_sys::{Url, Window};

/// The address that is shown.
pub(super) fn current(window: &Window) -> Address {
    let location = window.location();
    address(
        location.origin().unwrap_or_default(),
        location.pathname().unwrap_or_default(),
        &location.search().unwrap_or_default(),
        &location.hash().unwrap_or_default(),
    )
}

/// The address that `url` leads to from here, if it is of this origin.
pub(super) fn of_url(window: &Window, url: &str) -> Option<Address> {
    let location = window.location();
    let url = Url::new_with_base(url, &location.href().ok()?).ok()?;
    (url.origin() == location.origin().ok()?)
        .then(|| address(url.origin(), url.pathname(), &url.search(), &url.hash()))
}

fn address(origin: String, path: String, search: &str, hash: &str) -> Address {
    let fragment = hash.trim_start_matches('#').to_owned();
    Address { origin, path, search: search.to_owned(), query: decode_query(search), fragment }
}

/// Names and values of an address's query.
fn decode_query(query: &str) -> Vec<(String, String)> {
    let decode = |text: &str| {
        let spaced = text.replace('+', " ");
        js_sys::decode_uri_component(&spaced).map(String::from).unwrap_or(spaced)
    };
    let pairs = query.trim_start_matches('?').split('&').filter(|pair| !pair.is_empty());
    pairs
        .map(|pair| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            (decode(name), decode(value))
        })
        .collect()
}

/// Adds an address to the history, without loading it.
pub(super) fn push(window: &Window, url: &str) {
    if let Ok(history) = window.history() {
        let _ = history.push_state_with_url(&JsValue::NULL, "", Some(url));
    }
}

/// Puts an address in place of the one that is shown, without loading it.
pub(super) fn replace(window: &Window, url: &str) {
    if let Ok(history) = window.history() {
        let _ = history.replace_state_with_url(&JsValue::NULL, "", Some(url));
    }
}
