//! Number rules of languages, from the browser.

/// The plural category of a number: `one`, `other`, ….
#[cfg(target_arch = "wasm32")]
pub(super) fn plural(language: &str, number: f64) -> String {
    intl("PluralRules", "select", language, number).unwrap_or_else(|| "other".to_owned())
}

/// A number as people of this language write it.
#[cfg(target_arch = "wasm32")]
pub(super) fn written(language: &str, number: f64) -> String {
    intl("NumberFormat", "format", language, number).unwrap_or_else(|| crate::json::number(number))
}

/// Calls `new Intl[kind](language)[method](number)`; `None` for an invalid language.
#[cfg(target_arch = "wasm32")]
fn intl(kind: &str, method: &str, language: &str, number: f64) -> Option<String> {
    use js_sys::{Array, Function, Reflect};
    use wasm_bindgen::JsCast;
    let intl = Reflect::get(&js_sys::global(), &"Intl".into()).ok()?;
    let maker: Function = Reflect::get(&intl, &kind.into()).ok()?.dyn_into().ok()?;
    let made = Reflect::construct(&maker, &Array::of1(&language.into())).ok()?;
    // In a number format the method is a getter for a bound function; calling it works for both.
    let method: Function = Reflect::get(&made, &method.into()).ok()?.dyn_into().ok()?;
    method.call1(&made, &number.into()).ok()?.as_string()
}

/// The plural rule of English, for use without a browser.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn plural(_: &str, number: f64) -> String {
    (if number == 1.0 { "one" } else { "other" }).to_owned()
}

/// Plain digits, for use without a browser.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn written(_: &str, number: f64) -> String {
    crate::json::number(number)
}
