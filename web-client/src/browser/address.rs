//! The address bar and the browser's history.

use crate::runtime::Address;
use js_sys::Array;
use wasm_bindgen::prelude::*;
use web_sys::{Url, UrlSearchParams, Window};

/// The address that the browser currently shows.
pub(super) fn current(window: &Window) -> Address {
    let location = window.location();
    address(
        location.origin().unwrap_or_default(),
        location.pathname().unwrap_or_default(),
        &location.search().unwrap_or_default(),
        &location.hash().unwrap_or_default(),
    )
}

/// Resolves `url` against the current address. Returns `None` if the result has a different origin.
pub(super) fn of_url(window: &Window, url: &str) -> Option<Address> {
    let location = window.location();
    let url = Url::new_with_base(url, &location.href().ok()?).ok()?;
    (url.origin() == location.origin().ok()?)
        .then(|| address(url.origin(), url.pathname(), &url.search(), &url.hash()))
}

fn address(origin: String, path: String, search: &str, hash: &str) -> Address {
    let fragment = hash.strip_prefix('#').unwrap_or_default().to_owned();
    Address { origin, path, search: search.to_owned(), query: decoded(search), fragment }
}

/// Decodes a query into pairs of names and values.
fn decoded(query: &str) -> Vec<(String, String)> {
    let Ok(parameters) = UrlSearchParams::new_with_str(query) else { return Vec::new() };
    let text = |pair: &Array, place| pair.get(place).as_string().unwrap_or_default();
    let pair = |pair: JsValue| {
        let pair: Array = pair.unchecked_into();
        (text(&pair, 0), text(&pair, 1))
    };
    Array::from(&parameters).iter().map(pair).collect()
}

/// Pushes an address onto the history, without loading it.
pub(super) fn push(window: &Window, url: &str) {
    if let Ok(history) = window.history() {
        let _ = history.push_state_with_url(&JsValue::NULL, "", Some(url));
    }
}

/// Replaces the current address, without loading it.
pub(super) fn replace(window: &Window, url: &str) {
    if let Ok(history) = window.history() {
        let _ = history.replace_state_with_url(&JsValue::NULL, "", Some(url));
    }
}
