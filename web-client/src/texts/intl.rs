//! Plural rules and number formats of languages, from the browser.

/// The plural category of a number, such as `one` or `other`.
#[cfg(target_arch = "wasm32")]
pub(super) fn plural(language: &str, number: f64) -> String {
    intl("PluralRules", "select", language, number).unwrap_or_else(|| "other".to_owned())
}

/// Formats a number for the language.
#[cfg(target_arch = "wasm32")]
pub(super) fn written(language: &str, number: f64) -> String {
    intl("NumberFormat", "format", language, number).unwrap_or_else(|| crate::json::number(number))
}

/// Calls `new Intl[kind](language)[method](number)`. Returns `None` for an invalid language.
#[cfg(target_arch = "wasm32")]
fn intl(kind: &str, method: &str, language: &str, number: f64) -> Option<String> {
    use js_sys::{Array, Function, Reflect};
    use wasm_bindgen::JsCast;
    let intl = Reflect::get(&js_sys::global(), &"Intl".into()).ok()?;
    let maker: Function = Reflect::get(&intl, &kind.into()).ok()?.dyn_into().ok()?;
    let made = Reflect::construct(&maker, &Array::of1(&language.into())).ok()?;
    // In a number format, `method` is a getter that returns a bound function. This call works in
    // both cases.
    let method: Function = Reflect::get(&made, &method.into()).ok()?.dyn_into().ok()?;
    method.call1(&made, &number.into()).ok()?.as_string()
}

/// The plural rule of English, for native tests.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn plural(_: &str, number: f64) -> String {
    (if number == 1.0 { "one" } else { "other" }).to_owned()
}

/// Plain digits, for native tests.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn written(_: &str, number: f64) -> String {
    crate::json::number(number)
}
