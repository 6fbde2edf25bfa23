//! Reads form input.

use crate::form::{FieldValue, Form};
use js_sys::Reflect;
use wasm_bindgen::prelude::*;
use web_sys::Element;

/// The values of a form's fields.
pub(super) fn form(form: &Element) -> Form {
    let mut values = Vec::new();
    if let Ok(elements) = form.query_selector_all("[name]:not(:disabled)") {
        for i in 0..elements.length() {
            let Some(element) = elements.get(i) else { continue };
            let element: Element = element.unchecked_into();
            let name = element.get_attribute("name").unwrap_or_default();
            values.extend(value(&element).map(|value| (name, value)));
        }
    }
    Form::new(values)
}

/// The value of a field; `None` for a radio button that is not selected.
pub(super) fn value(field: &Element) -> Option<FieldValue> {
    let is_checked = || property(field, "checked").is_truthy();
    Some(match text(field, "type").as_str() {
        "checkbox" => FieldValue::Checked(is_checked()),
        "radio" if !is_checked() => return None,
        "number" | "range" => {
            let number = property(field, "valueAsNumber").as_f64();
            FieldValue::Number(number.filter(|number| number.is_finite()))
        }
        _ => FieldValue::Text(text(field, "value")),
    })
}

fn property(element: &JsValue, name: &str) -> JsValue {
    Reflect::get(element, &name.into()).unwrap_or(JsValue::UNDEFINED)
}

fn text(element: &JsValue, name: &str) -> String {
    property(element, name).as_string().unwrap_or_default()
}
