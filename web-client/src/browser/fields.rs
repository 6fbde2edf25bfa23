//! Reads what people entered.

use crate::form::{FieldValue, File, Form};
use js_sys::{Reflect, Uint8Array};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;
use web_sys::{Blob, Element};

/// A field's value, or the files that have still to be read.
enum Entered {
    Value(FieldValue),
    Files(Vec<JsValue>),
}

/// The value of a field; nothing for a radio button that is not chosen.
pub(super) async fn value(field: &Element) -> Option<FieldValue> {
    match entered(field)? {
        Entered::Value(value) => Some(value),
        Entered::Files(files) => Some(FieldValue::Files(contents(files).await)),
    }
}

/// The values of a form's fields. All are read before any file is waited for.
pub(super) async fn form(form: &Element) -> Form {
    let mut fields = Vec::new();
    if let Ok(elements) = form.query_selector_all("[name]:not(:disabled)") {
        for i in 0..elements.length() {
            let Some(element) = elements.get(i) else { continue };
            let element: Element = element.unchecked_into();
            let name = element.get_attribute("name").unwrap_or_default();
            fields.extend(entered(&element).map(|entered| (name, entered)));
        }
    }
    let mut values = Vec::with_capacity(fields.len());
    for (name, entered) in fields {
        let value = match entered {
            Entered::Value(value) => value,
            Entered::Files(files) => FieldValue::Files(contents(files).await),
        };
        values.push((name, value));
    }
    Form::new(values)
}

fn property(element: &JsValue, name: &str) -> JsValue {
    Reflect::get(element, &name.into()).unwrap_or(JsValue::UNDEFINED)
}

fn text(element: &JsValue, name: &str) -> String {
    property(element, name).as_string().unwrap_or_default()
}

fn entered(field: &Element) -> Option<Entered> {
    let is_checked = || property(field, "checked").is_truthy();
    // A list says "select-one" or "select-multiple".
    let value = match text(field, "type").as_str() {
        "checkbox" => FieldValue::Checked(is_checked()),
        "radio" if !is_checked() => return None,
        "number" | "range" => {
            let number = property(field, "valueAsNumber").as_f64();
            FieldValue::Number(number.filter(|number| number.is_finite()))
        }
        "select-multiple" => {
            let chosen = js_sys::Array::from(&property(field, "selectedOptions"));
            FieldValue::Choices(chosen.iter().map(|option| text(&option, "value")).collect())
        }
        "file" => {
            let files = js_sys::Array::from(&property(field, "files"));
            return Some(Entered::Files(files.iter().collect()));
        }
        _ => FieldValue::Text(text(field, "value")),
    };
    Some(Entered::Value(value))
}

/// Files that cannot be read are left out.
async fn contents(files: Vec<JsValue>) -> Vec<File> {
    let mut read = Vec::with_capacity(files.len());
    for file in files {
        let name = text(&file, "name");
        let blob: Blob = file.unchecked_into();
        if let Ok(bytes) = JsFuture::from(blob.array_buffer()).await {
            read.push(File { name, bytes: Uint8Array::new(&bytes).to_vec() });
        }
    }
    read
}
