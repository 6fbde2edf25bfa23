//! The view of a page as plain data. It is a tree of elements, whose controls contain the page's
//! messages. [`browser`](crate::browser) updates the document to match the view with few changes.

use crate::form::{FieldValue, Form, Pointing};
use sidestep::chart::Element;
use std::ops::{Deref, DerefMut};
use std::rc::Rc;

/// The attribute that contains an element's content if the content is HTML; see [`Node::html`].
pub const HTML: &str = "innerHTML";

/// The attribute of an element that listens to pointers. Its value says whether the element also
/// listens to the wheel.
pub const POINTS: &str = "data-points";

/// An element. `M` is the page's message type. An element is only a pointer to its content.
/// Building a page moves elements, and moving a pointer needs less code, so the download is
/// smaller.
#[derive(Clone)]
pub struct Node<M>(Box<Inside<M>>);

impl<M> Deref for Node<M> {
    type Target = Inside<M>;

    fn deref(&self) -> &Inside<M> {
        &self.0
    }
}

impl<M> DerefMut for Node<M> {
    fn deref_mut(&mut self) -> &mut Inside<M> {
        &mut self.0
    }
}

/// Content of an element.
#[derive(Clone)]
pub struct Inside<M> {
    /// Name of the element.
    pub tag: &'static str,
    /// Attributes by name.
    pub attributes: Vec<(&'static str, String)>,
    /// Children, in order.
    pub children: Vec<Child<M>>,
    /// Creates the message when the element is used.
    pub handler: Option<Handler<M>>,
    /// Identifies the element among its siblings; see [`Node::key`].
    key: Option<String>,
    /// See [`Node::focus`].
    pub takes_focus: bool,
}

/// A child of an element.
#[derive(Clone)]
pub enum Child<M> {
    /// An element.
    Node(Node<M>),
    /// Text.
    Text(String),
    /// A time (ms since 1970), which is shown as local date and time.
    Moment(i64),
}

/// How an element creates a message when it is used.
#[derive(Clone)]
pub enum Handler<M> {
    /// The element was pressed.
    Press(M),
    /// A field has a new value.
    Input(Rc<dyn Fn(FieldValue) -> M>),
    /// A form was submitted.
    Submit(Rc<dyn Fn(Form) -> M>),
}

/// Creates an element with this tag.
#[must_use]
pub fn el<M>(tag: &'static str) -> Node<M> {
    Node(Box::new(Inside {
        tag,
        attributes: Vec::new(),
        children: Vec::new(),
        handler: None,
        key: None,
        takes_focus: false,
    }))
}

impl<M> Node<M> {
    /// Sets an attribute. Replaces an attribute with the same name.
    #[must_use]
    pub fn attr(self, name: &'static str, value: impl ToString) -> Self {
        self.with(name, value.to_string())
    }

    #[inline(never)]
    fn with(mut self, name: &'static str, value: String) -> Self {
        self.attributes.retain(|(known, _)| *known != name);
        self.attributes.push((name, value));
        self
    }

    /// Sets several attributes.
    #[must_use]
    #[inline(never)]
    pub fn attrs(self, attributes: &[(&'static str, &str)]) -> Self {
        attributes.iter().fold(self, |node, (name, value)| node.attr(name, *value))
    }

    /// Sets an attribute if the condition holds.
    #[must_use]
    pub fn attr_if(self, condition: bool, name: &'static str, value: &str) -> Self {
        if condition { self.attr(name, value) } else { self }
    }

    /// Sets the CSS classes.
    #[must_use]
    #[inline(never)]
    pub fn class(self, names: &str) -> Self {
        self.attr("class", names)
    }

    /// Sets the name under which tests find the element.
    #[must_use]
    #[inline(never)]
    pub fn test_id(self, name: &str) -> Self {
        self.attr("data-testid", name)
    }

    /// Sets a key, which must be unique among the siblings. If an element's key moves among the
    /// siblings, the element keeps its DOM node, with its focus, scroll position and input. For a
    /// new key, a new DOM node is created.
    #[must_use]
    pub fn key(mut self, key: impl ToString) -> Self {
        self.key = Some(key.to_string());
        self
    }

    /// Makes the element take the keyboard focus when it appears. Used for titles, so that screen
    /// readers start there on a new page.
    #[must_use]
    pub fn focus(mut self) -> Self {
        self.takes_focus = true;
        self
    }

    /// Sends `message` when the element is pressed.
    #[must_use]
    pub fn on_press(mut self, message: M) -> Self {
        self.handler = Some(Handler::Press(message));
        self
    }

    /// Sends a message with the new value whenever the value of this field changes.
    #[must_use]
    pub fn on_input(mut self, message: impl Fn(FieldValue) -> M + 'static) -> Self {
        self.handler = Some(Handler::Input(Rc::new(message)));
        self
    }

    /// Sends a message for each pointer action on this element, except the wheel. The page's
    /// [`points`](crate::runtime::Page::points) must return true.
    #[must_use]
    pub fn on_point(self, message: impl Fn(Pointing) -> M + 'static) -> Self {
        let message = move |value| match value {
            FieldValue::Pointing(pointing) => message(pointing),
            _ => message(Pointing::default()),
        };
        self.attr(POINTS, "").on_input(message)
    }

    /// Like [`Self::on_point`], but also for the wheel, which then does not scroll the page.
    #[must_use]
    pub fn on_point_and_wheel(self, message: impl Fn(Pointing) -> M + 'static) -> Self {
        self.on_point(message).attr(POINTS, "wheel")
    }

    /// Sends a message with all values of this form when the form is submitted.
    #[must_use]
    pub fn on_submit(mut self, message: impl Fn(Form) -> M + 'static) -> Self {
        self.handler = Some(Handler::Submit(Rc::new(message)));
        self
    }

    /// Adds text.
    #[must_use]
    pub fn text(self, text: impl Into<String>) -> Self {
        self.holding(Child::Text(text.into()))
    }

    #[inline(never)]
    fn holding(mut self, child: Child<M>) -> Self {
        self.children.push(child);
        self
    }

    /// Adds a time (ms since 1970), shown as local date and time.
    #[must_use]
    pub fn moment(self, ms: i64) -> Self {
        self.holding(Child::Moment(ms))
    }

    /// Sets HTML as the only content. The HTML is either a researcher's text, from which the server
    /// has removed all elements that could run code, or a drawing of the library, whose text is
    /// escaped.
    #[must_use]
    pub fn html(self, html: impl Into<String>) -> Self {
        self.attr(HTML, html.into())
    }

    /// Adds a child element.
    #[must_use]
    pub fn child(self, node: Self) -> Self {
        self.holding(Child::Node(node))
    }

    /// Adds child elements.
    #[must_use]
    #[inline(never)]
    pub fn children(mut self, nodes: impl IntoIterator<Item = Self>) -> Self {
        self.children.extend(nodes.into_iter().map(Child::Node));
        self
    }

    /// The identity of the element among its siblings: its key or, if it has none, its test name.
    #[must_use]
    pub fn identity(&self) -> Option<&str> {
        self.key.as_deref().or_else(|| self.attribute("data-testid"))
    }

    /// The value of an attribute.
    #[must_use]
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(known, _)| *known == name).map(|(_, value)| value.as_str())
    }

    /// Maps the messages to the messages of a page that contains this node.
    #[must_use]
    pub fn map<N: 'static>(self, lift: &Rc<dyn Fn(M) -> N>) -> Node<N>
    where
        M: 'static,
    {
        let lifted = |child| match child {
            Child::Node(node) => Child::Node(node.map(lift)),
            Child::Text(text) => Child::Text(text),
            Child::Moment(ms) => Child::Moment(ms),
        };
        let lift = Rc::clone(lift);
        let Inside { tag, attributes, children, handler, key, takes_focus } = *self.0;
        Node(Box::new(Inside {
            tag,
            attributes,
            children: children.into_iter().map(lifted).collect(),
            handler: handler.map(|handler| match handler {
                Handler::Press(message) => Handler::Press(lift(message)),
                Handler::Input(make) => Handler::Input(Rc::new(move |value| lift(make(value)))),
                Handler::Submit(make) => Handler::Submit(Rc::new(move |form| lift(make(form)))),
            }),
            key,
            takes_focus,
        }))
    }
}

/// Access to a view for tests.
impl<M: Clone> Node<M> {
    /// All text within the element.
    #[must_use]
    pub fn words(&self) -> String {
        if let Some(html) = self.attribute(HTML) {
            let texts =
                html.split('<').map(|tag| tag.split_once('>').map_or(tag, |(_, text)| text));
            return texts.collect();
        }
        let words = self.children.iter().map(|child| match child {
            Child::Text(text) => text.clone(),
            Child::Moment(ms) => ms.to_string(),
            Child::Node(node) => node.words(),
        });
        words.collect::<Vec<_>>().join(" ")
    }

    /// The first element with this test name, within this element.
    #[must_use]
    pub fn find(&self, test_id: &str) -> Option<&Self> {
        if self.attribute("data-testid") == Some(test_id) {
            return Some(self);
        }
        self.children.iter().find_map(|child| match child {
            Child::Node(node) => node.find(test_id),
            Child::Text(_) | Child::Moment(_) => None,
        })
    }

    /// The test names of all elements within this element.
    #[must_use]
    pub fn test_ids(&self) -> Vec<&str> {
        let inner = self.children.iter().flat_map(|child| match child {
            Child::Node(node) => node.test_ids(),
            Child::Text(_) | Child::Moment(_) => Vec::new(),
        });
        self.attribute("data-testid").into_iter().chain(inner).collect()
    }

    /// The message when the element with this test name is pressed. `None` if it cannot be pressed.
    #[must_use]
    pub fn press(&self, test_id: &str) -> Option<M> {
        let node = self.find(test_id)?;
        match &node.handler {
            Some(Handler::Press(message)) if node.attribute("disabled").is_none() => {
                Some(message.clone())
            }
            _ => None,
        }
    }

    /// The message when the field with this test name gets this value.
    #[must_use]
    pub fn enter(&self, test_id: &str, value: FieldValue) -> Option<M> {
        match &self.find(test_id)?.handler {
            Some(Handler::Input(make)) => Some(make(value)),
            _ => None,
        }
    }

    /// The message when the form with this test name is submitted with these values.
    #[must_use]
    pub fn submit(&self, test_id: &str, form: Form) -> Option<M> {
        match &self.find(test_id)?.handler {
            Some(Handler::Submit(make)) => Some(make(form)),
            _ => None,
        }
    }
}

/// Follows `path`, a list of child indices that starts in `children`, and finds the innermost
/// handler that satisfies `hears`. Also returns how many indices of the path lead to the handler.
#[must_use]
pub fn handler_along<'a, M>(
    children: &'a [Child<M>],
    path: &[usize],
    hears: fn(&Handler<M>) -> bool,
) -> Option<(usize, &'a Handler<M>)> {
    let mut children = children;
    let mut found = None;
    for (depth, &place) in path.iter().enumerate() {
        let Some(Child::Node(node)) = children.get(place) else { break };
        if let Some(handler) = node.handler.as_ref().filter(|handler| hears(handler)) {
            found = Some((depth + 1, handler));
        }
        children = &node.children;
    }
    found
}

/// A letter with a subscript, such as V with HR.
#[must_use]
pub fn subscripted<M>(tag: &'static str, letter: &str, below: &str) -> Node<M> {
    el(tag).text(letter).child(el("sub").text(below))
}

/// A text in which `V_HR` becomes V with the subscript HR, and `F_1` becomes F with the
/// subscript 1.
pub fn with_subscripts<M>(tag: &'static str, words: &str) -> Node<M> {
    let mut parts = words.split('_');
    let mut node = el(tag).text(parts.next().unwrap_or_default());
    for part in parts {
        let is_below = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit();
        let (below, rest) = part.split_at(part.find(|c| !is_below(c)).unwrap_or(part.len()));
        node = if below.is_empty() { node.text("_") } else { node.child(el("sub").text(below)) };
        node = if rest.is_empty() { node } else { node.text(rest) };
    }
    node
}

/// Converts a drawing of the library to elements of a view.
#[must_use]
pub fn drawn<M>(element: Element) -> Node<M> {
    let mut node = el(element.name).children(element.children.into_iter().map(drawn));
    node.attributes = element.attributes;
    if element.text.is_empty() { node } else { node.text(element.text) }
}

/// Converts a drawing to a single piece of markup. This is cheaper than elements if the page is
/// updated often and the drawing rarely changes.
#[must_use]
pub fn still<M>(element: &Element) -> Node<M> {
    let mut node = el(element.name);
    node.attributes.clone_from(&element.attributes);
    node.html(element.children.iter().map(ToString::to_string).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_control_hears_a_use() {
        let form: Node<&str> = el("form").on_submit(|_| "sent").child(
            el("p")
                .on_press("paragraph")
                .child(el("b").text("bold"))
                .child(el("button").on_press("button").child(el("svg"))),
        );
        let view = [Child::Node(form)];
        let heard = |path: &[usize], hears| match handler_along(&view, path, hears)? {
            (depth, Handler::Press(message)) => Some((depth, *message)),
            (depth, Handler::Submit(make)) => Some((depth, make(Form::default()))),
            (_, Handler::Input(_)) => None,
        };
        let press = |handler: &Handler<&str>| matches!(handler, Handler::Press(_));
        let submit = |handler: &Handler<&str>| matches!(handler, Handler::Submit(_));
        assert_eq!(heard(&[0, 0, 1, 0], press), Some((3, "button")));
        assert_eq!(heard(&[0, 0, 0, 0], press), Some((2, "paragraph")));
        assert_eq!(heard(&[0, 0, 1, 0], submit), Some((1, "sent")));
        assert_eq!(heard(&[0], press), None);
        assert_eq!(heard(&[7, 0], press), None);
    }

    #[test]
    fn the_words_of_html_are_those_without_tags() {
        let node: Node<()> = el("div").html("<h2>Why</h2><p>We <b>study</b> driving.</p>");
        assert_eq!(node.words(), "WhyWe study driving.");
    }

    #[test]
    fn a_part_of_a_page_sends_the_page_s_messages() {
        #[derive(Clone, Debug, PartialEq)]
        enum Whole {
            Part(f64),
        }
        let part: Node<f64> = el("div")
            .child(el("button").test_id("press").on_press(1.0))
            .child(el("input").test_id("type").on_input(|value| value.number().unwrap_or(0.0)));
        let lift: Rc<dyn Fn(f64) -> Whole> = Rc::new(Whole::Part);
        let whole = part.map(&lift);
        assert_eq!(whole.press("press"), Some(Whole::Part(1.0)));
        let typed = FieldValue::Number(Some(2.5));
        assert_eq!(whole.enter("type", typed), Some(Whole::Part(2.5)));
    }
}
