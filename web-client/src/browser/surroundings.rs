//! What a page knows about its environment when it opens: its root element, the device and the
//! user's languages.

use super::address;
use crate::runtime::PageContext;
use wasm_bindgen::prelude::*;
use web_sys::{Document, HtmlElement, Window};

pub(super) fn place() -> Option<(Window, Document, HtmlElement)> {
    let window = web_sys::window()?;
    let document = window.document()?;
    let root = document.get_element_by_id("app")?.dyn_into().ok()?;
    Some((window, document, root))
}

/// The context that a page gets when it opens, without its stored records.
pub(super) fn context(window: &Window) -> PageContext {
    let screen = window.screen().ok();
    let width = screen.as_ref().and_then(|screen| screen.width().ok()).unwrap_or(0);
    let height = screen.as_ref().and_then(|screen| screen.height().ok()).unwrap_or(0);
    let (window_width, window_height, ratio) = window_size(window);
    let languages = window.navigator().languages();
    PageContext {
        address: address::current(window),
        languages: languages.iter().filter_map(|language| language.as_string()).collect(),
        // A device without any pointer counts as a device with a keyboard.
        touch_only: matches(window, "(any-pointer: coarse)")
            && !matches(window, "(any-pointer: fine), (any-hover: hover)"),
        reduced_motion: matches(window, "(prefers-reduced-motion: reduce)"),
        screen: vec![
            ("screen_width_px", width.into()),
            ("screen_height_px", height.into()),
            ("window_width_px", window_width),
            ("window_height_px", window_height),
            ("device_pixel_ratio", ratio),
        ],
        time_origin_ms: window.performance().map_or(0.0, |clock| clock.time_origin()),
        random_name: random_name(window),
        ..PageContext::default()
    }
}

/// Whether a media query matches.
fn matches(window: &Window, query: &str) -> bool {
    window.match_media(query).ok().flatten().is_some_and(|query| query.matches())
}

/// The width and height of the window's content (CSS pixels), and the number of device pixels per
/// CSS pixel.
pub(super) fn window_size(window: &Window) -> (f64, f64, f64) {
    let number =
        |value: Result<JsValue, JsValue>| value.ok().and_then(|v| v.as_f64()).unwrap_or(0.0);
    (number(window.inner_width()), number(window.inner_height()), window.device_pixel_ratio())
}

/// 32 random hexadecimal digits.
fn random_name(window: &Window) -> Option<String> {
    let mut bytes = [0; 16];
    window.crypto().ok()?.get_random_values_with_u8_array(&mut bytes).ok()?;
    Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
