//! Updates the document to match a view, by the edits that [`diff`] finds.

use crate::diff::{self, Edit};
use crate::view::{Child, HTML, Handler, Node, handler_along};
use js_sys::{Function, Reflect};
use wasm_bindgen::prelude::*;
use web_sys::{Document, Element, FocusOptions, HtmlElement};

const SVG: &str = "http://www.w3.org/2000/svg";

/// The view shown, and the DOM nodes that show it.
pub(super) struct Dom<M> {
    document: Document,
    root: Mounted,
    shown: Vec<Child<M>>,
}

/// A DOM node and the children of it that this program created. Browser extensions, such as
/// translators, may have inserted other children.
struct Mounted {
    object: web_sys::Node,
    children: Vec<Mounted>,
}

impl<M> Dom<M> {
    /// Wraps the empty element `root`.
    pub(super) fn new(document: &Document, root: &HtmlElement) -> Self {
        let root = Mounted { object: root.clone().into(), children: Vec::new() };
        Self { document: document.clone(), root, shown: Vec::new() }
    }

    /// Updates the document to show this view.
    pub(super) fn show(&mut self, view: Node<M>) {
        let new = vec![Child::Node(view)];
        let edits = diff::children(&self.shown, &new);
        if !edits.is_empty() {
            let active = self.document.active_element();
            let mut hand = Hand { document: &self.document, focus: None };
            if hand.apply(&mut self.root, &edits).is_err() {
                // Other code has changed the document, so rebuild it.
                self.root.object.set_text_content(None);
                self.root.children.clear();
                if let Err(error) = hand.apply(&mut self.root, &diff::children(&[], &new)) {
                    web_sys::console::error_2(&"the page could not be shown:".into(), &error);
                }
            }
            // Some browsers remove the focus from an element that is moved.
            let active = active.filter(|active| {
                active.is_connected() && self.document.active_element().as_ref() != Some(active)
            });
            // A new element that takes the focus marks the start of a new page, so scroll to the
            // top.
            if let (Some(_), Some(window)) = (&hand.focus, self.document.default_view()) {
                window.scroll_to_with_x_and_y(0.0, 0.0);
            }
            if let Some(element) = hand.focus.or(active) {
                focus(&element);
            }
        }
        self.shown = new;
    }

    /// Finds the innermost handler around `target` that satisfies `hears`. Returns it with its
    /// element.
    pub(super) fn handler(
        &self,
        target: &web_sys::Node,
        hears: fn(&Handler<M>) -> bool,
    ) -> Option<(&Handler<M>, Element)> {
        let mut path = Vec::new();
        let mut way = vec![&self.root];
        let mut at = &self.root;
        while let Some(place) =
            at.children.iter().position(|child| child.object.contains(Some(target)))
        {
            at = &at.children[place];
            path.push(place);
            way.push(at);
        }
        let (depth, handler) = handler_along(&self.shown, &path, hears)?;
        Some((handler, way[depth].object.clone().dyn_into().ok()?))
    }
}

fn focus(element: &Element) {
    if let Some(element) = element.dyn_ref::<HtmlElement>() {
        let options = FocusOptions::new();
        options.set_prevent_scroll(true);
        let _ = element.focus_with_options(&options);
    }
}

/// Applies edits to the document.
struct Hand<'a> {
    document: &'a Document,
    /// The new element that requests the focus.
    focus: Option<Element>,
}

impl Hand<'_> {
    fn apply<M>(&mut self, parent: &mut Mounted, edits: &[Edit<'_, M>]) -> Result<(), JsValue> {
        let object = parent.object.clone();
        for edit in edits {
            match edit {
                Edit::Remove(place) => {
                    object.remove_child(&parent.children.remove(*place).object)?;
                }
                Edit::Insert(place, child) => {
                    let is_svg = object.dyn_ref::<Element>().is_some_and(is_svg);
                    let child = self.create(child, is_svg)?;
                    let next = parent.children.get(*place).map(|next| &next.object);
                    object.insert_before(&child.object, next)?;
                    parent.children.insert(*place, child);
                }
                Edit::Move(from, to) => {
                    let child = parent.children.remove(*from);
                    move_before(&object, &child.object, &parent.children[*to].object)?;
                    parent.children.insert(*to, child);
                }
                Edit::Text(place, child) => {
                    parent.children[*place].object.set_node_value(Some(&words(child)));
                }
                Edit::Patch(place, patch) => {
                    let child = &mut parent.children[*place];
                    if let Some(element) = child.object.dyn_ref::<Element>() {
                        for (name, value) in &patch.attributes {
                            set(element, name, *value)?;
                        }
                    }
                    self.apply(child, &patch.children)?;
                }
            }
        }
        Ok(())
    }

    fn create<M>(&mut self, child: &Child<M>, inside_svg: bool) -> Result<Mounted, JsValue> {
        let Child::Node(node) = child else {
            let text = self.document.create_text_node(&words(child));
            return Ok(Mounted { object: text.into(), children: Vec::new() });
        };
        let is_svg = inside_svg || node.tag == "svg";
        let element = if is_svg {
            self.document.create_element_ns(Some(SVG), node.tag)?
        } else {
            self.document.create_element(node.tag)?
        };
        for (name, value) in &node.attributes {
            set(&element, name, Some(value))?;
        }
        let mut children = Vec::with_capacity(node.children.len());
        for child in &node.children {
            let child = self.create(child, is_svg)?;
            element.append_child(&child.object)?;
            children.push(child);
        }
        if node.takes_focus {
            self.focus = Some(element.clone());
        }
        Ok(Mounted { object: element.into(), children })
    }
}

fn is_svg(element: &Element) -> bool {
    element.namespace_uri().as_deref() == Some(SVG)
}

/// The text of a child that is not an element.
fn words<M>(child: &Child<M>) -> String {
    match child {
        Child::Text(text) => text.clone(),
        Child::Moment(ms) => {
            let date = js_sys::Date::new(&(*ms as f64).into());
            date.to_locale_string("default", &JsValue::UNDEFINED).into()
        }
        Child::Node(_) => String::new(),
    }
}

/// Moves a node among its siblings. Keeps its focus and scroll position if the browser can do so.
fn move_before(
    parent: &web_sys::Node,
    object: &web_sys::Node,
    next: &web_sys::Node,
) -> Result<(), JsValue> {
    let method = Reflect::get(parent, &"moveBefore".into()).unwrap_or(JsValue::UNDEFINED);
    match method.dyn_ref::<Function>() {
        Some(method) => method.call2(parent, object, next).map(drop),
        None => parent.insert_before(object, Some(next)).map(drop),
    }
}

/// Sets an attribute, or removes it if `value` is `None`.
fn set(element: &Element, name: &str, value: Option<&str>) -> Result<(), JsValue> {
    match name {
        // The content security policy forbids style attributes, but allows the style object.
        "style" => {
            if let Some(element) = element.dyn_ref::<HtmlElement>() {
                element.style().set_css_text(value.unwrap_or_default());
            }
            return Ok(());
        }
        HTML => {
            element.set_inner_html(value.unwrap_or_default());
            return Ok(());
        }
        // Once a user has changed a field, its attribute sets only the initial value, so set the
        // property too.
        "value" => drop(Reflect::set(element, &name.into(), &value.unwrap_or_default().into())),
        "checked" | "selected" => {
            drop(Reflect::set(element, &name.into(), &value.is_some().into()))
        }
        _ => {}
    }
    match value {
        Some(value) => element.set_attribute(name, value),
        None => element.remove_attribute(name),
    }
}
