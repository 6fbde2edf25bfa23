//! What a page shows, as plain data: a tree of elements that
//! [`browser`](crate::browser) brings to the document with the fewest changes.

/// An element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// Name of the element.
    pub tag: &'static str,
    /// Attributes by name.
    pub attributes: Vec<(&'static str, String)>,
    /// What it holds.
    pub children: Vec<Child>,
}

/// What an element holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Child {
    /// Another element.
    Node(Node),
    /// Words.
    Text(String),
}

/// An element of this name.
#[must_use]
pub fn el(tag: &'static str) -> Node {
    Node { tag, attributes: Vec::new(), children: Vec::new() }
}

impl Node {
    /// With an attribute, instead of one of the same name.
    #[must_use]
    pub fn attr(mut self, name: &'static str, value: impl ToString) -> Self {
        self.attributes.retain(|(known, _)| *known != name);
        self.attributes.push((name, value.to_string()));
        self
    }

    /// With an attribute, if the condition holds.
    #[must_use]
    pub fn attr_if(self, condition: bool, name: &'static str, value: &str) -> Self {
        if condition { self.attr(name, value) } else { self }
    }

    /// With style classes.
    #[must_use]
    pub fn class(self, names: &str) -> Self {
        self.attr("class", names)
    }

    /// With the name under which tests find it.
    #[must_use]
    pub fn test_id(self, name: &str) -> Self {
        self.attr("data-testid", name)
    }

    /// A press on it is reported to the page as
    /// [`Event::Action`](crate::runtime::Event::Action) with this word.
    #[must_use]
    pub fn action(self, word: &str) -> Self {
        self.attr("data-action", word)
    }

    /// With words.
    #[must_use]
    pub fn text(mut self, words: impl Into<String>) -> Self {
        self.children.push(Child::Text(words.into()));
        self
    }

    /// With an element inside.
    #[must_use]
    pub fn child(mut self, node: Node) -> Self {
        self.children.push(Child::Node(node));
        self
    }

    /// With elements inside.
    #[must_use]
    pub fn children(mut self, nodes: impl IntoIterator<Item = Node>) -> Self {
        self.children.extend(nodes.into_iter().map(Child::Node));
        self
    }

    /// All the words in it, for tests.
    #[must_use]
    pub fn words(&self) -> String {
        let words = self.children.iter().map(|child| match child {
            Child::Text(text) => text.clone(),
            Child::Node(node) => node.words(),
        });
        words.collect::<Vec<_>>().join(" ")
    }

    /// The first element in it with that test name, for tests.
    #[must_use]
    pub fn find(&self, test_id: &str) -> Option<&Node> {
        if self.attributes.iter().any(|(name, value)| *name == "data-testid" && value == test_id) {
            return Some(self);
        }
        self.children.iter().find_map(|child| match child {
            Child::Node(node) => node.find(test_id),
            Child::Text(_) => None,
        })
    }
}

/// A letter with a subscript, such as V with HR.
#[must_use]
pub fn subscripted(tag: &'static str, letter: &str, below: &str) -> Node {
    el(tag).text(letter).child(el("sub").text(below))
}
