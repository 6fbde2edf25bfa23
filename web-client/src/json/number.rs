//! Formats a number for people and for JSON.

/// The shortest decimal digits that parse back to `number`, such as `3` and `2.5`, as JavaScript
/// formats them.
#[cfg(target_arch = "wasm32")]
#[must_use]
pub fn number(number: f64) -> String {
    js_sys::Number::from(number).to_string_with_radix(10).map(String::from).unwrap_or_default()
}

/// The native version, for tests. It never uses an exponent.
#[cfg(not(target_arch = "wasm32"))]
#[must_use]
pub fn number(number: f64) -> String {
    number.to_string()
}
