//! Brings the document to what a view describes, changing only what differs, so
//! that focus, scrolling and a dragged slider survive.

use crate::view::{Child, Node};
use wasm_bindgen::prelude::*;
use web_sys::{Document, Element, HtmlElement, HtmlInputElement};

const SVG: &str = "http://www.w3.org/2000/svg";

/// Makes `node` the only child of `root`, given what was shown before.
pub(super) fn patch_root(document: &Document, root: &Element, shown: Option<&Node>, node: &Node) {
    let result = match (shown, root.first_element_child()) {
        (Some(shown), Some(element)) if shown.tag == node.tag => {
            patch(document, &element, shown, node)
        }
        _ => {
            root.set_text_content(None);
            create(document, node, false).and_then(|element| root.append_child(&element).map(drop))
        }
    };
    if let Err(error) = result {
        web_sys::console::error_2(&"the page could not be shown:".into(), &error);
    }
    focus_new(root);
}

/// Gives the keyboard to the element that asks for it, once.
fn focus_new(root: &Element) {
    let wanted = root.query_selector("[data-autofocus='']").ok().flatten();
    if let Some(element) = wanted.and_then(|e| e.dyn_into::<HtmlElement>().ok()) {
        let _ = element.set_attribute("data-autofocus", "done");
        let _ = element.focus();
    }
}

fn create(document: &Document, node: &Node, inside_svg: bool) -> Result<Element, JsValue> {
    let svg = inside_svg || node.tag == "svg";
    let element = if svg {
        document.create_element_ns(Some(SVG), node.tag)?
    } else {
        document.create_element(node.tag)?
    };
    for (name, value) in &node.attributes {
        set(&element, name, value)?;
    }
    for child in &node.children {
        element.append_child(&create_child(document, child, svg)?)?;
    }
    Ok(element)
}

fn create_child(document: &Document, child: &Child, svg: bool) -> Result<web_sys::Node, JsValue> {
    Ok(match child {
        Child::Text(text) => document.create_text_node(text).into(),
        Child::Node(node) => create(document, node, svg)?.into(),
    })
}

fn set(element: &Element, name: &str, value: &str) -> Result<(), JsValue> {
    match name {
        // The content security policy forbids style attributes, not the style object.
        "style" => {
            if let Some(element) = element.dyn_ref::<HtmlElement>() {
                element.style().set_css_text(value);
            }
            Ok(())
        }
        // Local date and time.
        "data-ms" => {
            let date = js_sys::Date::new(&js_sys::parse_float(value).into());
            element.set_attribute("datetime", &String::from(date.to_iso_string()))?;
            let words = date.to_locale_string("default", &JsValue::UNDEFINED);
            element.set_text_content(Some(&String::from(words)));
            Ok(())
        }
        _ => {
            if let ("value", Some(input)) = (name, element.dyn_ref::<HtmlInputElement>()) {
                input.set_value(value);
            }
            element.set_attribute(name, value)
        }
    }
}

fn patch(document: &Document, element: &Element, old: &Node, new: &Node) -> Result<(), JsValue> {
    for (name, value) in &new.attributes {
        let same = old.attributes.iter().any(|(n, v)| n == name && v == value);
        if !same {
            set(element, name, value)?;
        }
    }
    for (name, _) in &old.attributes {
        if !new.attributes.iter().any(|(n, _)| n == name) {
            element.remove_attribute(name)?;
        }
    }
    let svg = element.namespace_uri().as_deref() == Some(SVG);
    let nodes = element.child_nodes();
    for (i, child) in new.children.iter().enumerate() {
        let at = nodes.get(i as u32);
        match (old.children.get(i), child, at) {
            (Some(before), after, Some(_)) if before == after => {}
            (Some(Child::Text(_)), Child::Text(text), Some(node)) => {
                node.set_node_value(Some(text))
            }
            (Some(Child::Node(before)), Child::Node(after), Some(node))
                if before.tag == after.tag && identity(before) == identity(after) =>
            {
                patch(document, node.unchecked_ref(), before, after)?;
            }
            (_, after, Some(node)) => {
                element.replace_child(&create_child(document, after, svg)?, &node)?;
            }
            (_, after, None) => {
                element.append_child(&create_child(document, after, svg)?)?;
            }
        }
    }
    while nodes.length() as usize > new.children.len() {
        if let Some(last) = element.last_child() {
            element.remove_child(&last)?;
        }
    }
    Ok(())
}

/// An element that stands for something else is made anew and not bent into it.
fn identity(node: &Node) -> Option<&str> {
    let names = ["id", "data-testid"];
    node.attributes.iter().find(|(name, _)| names.contains(name)).map(|(_, value)| value.as_str())
}
