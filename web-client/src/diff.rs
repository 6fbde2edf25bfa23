//! Computes the edits that turn an old view into a new one, as plain data.
//!
//! Siblings are matched by tag and identity ([`Node::identity`]); siblings without an identity are
//! matched in order. A matched element stays in the document and so keeps its focus, selection,
//! scroll position and input.

use crate::view::{Child, Node};

/// Changes to an element that stays in the document.
pub struct Patch<'a, M> {
    /// Attributes to set, or to remove if the value is `None`.
    pub attributes: Vec<(&'static str, Option<&'a str>)>,
    /// Changes to the element's children, in order.
    pub children: Vec<Edit<'a, M>>,
}

/// A change to an element's children. Indices refer to the children after all previous edits.
pub enum Edit<'a, M> {
    /// Removes the child at this index.
    Remove(usize),
    /// Inserts a new child at this index.
    Insert(usize, &'a Child<M>),
    /// Moves the child at the first index to the second index, which is smaller.
    Move(usize, usize),
    /// Replaces the text at this index by the text of this child.
    Text(usize, &'a Child<M>),
    /// Changes the element at this index.
    Patch(usize, Patch<'a, M>),
}

/// Computes the edits that turn `old` into `new`.
#[must_use]
pub fn children<'a, M>(old: &[Child<M>], new: &'a [Child<M>]) -> Vec<Edit<'a, M>> {
    let mut edits = Vec::new();
    let sources = matched(old, new);
    // Indices in `old` of the children still in the document.
    let mut present: Vec<usize> = (0..old.len()).collect();
    for place in (0..old.len()).rev() {
        if !sources.contains(&Some(place)) {
            edits.push(Edit::Remove(place));
            present.remove(place);
        }
    }
    for (place, (child, source)) in new.iter().zip(sources).enumerate() {
        let Some(source) = source else {
            edits.push(Edit::Insert(place, child));
            // A new child has no index in `old`.
            present.insert(place, usize::MAX);
            continue;
        };
        if present[place] != source {
            // The children before `place` are final, so the wanted child is at or after it.
            let from = place + present[place..].iter().take_while(|&&at| at != source).count();
            edits.push(Edit::Move(from, place));
            present.remove(from);
            present.insert(place, source);
        }
        match (&old[source], child) {
            (Child::Node(before), Child::Node(after)) => {
                let patch = node(before, after);
                if !(patch.attributes.is_empty() && patch.children.is_empty()) {
                    edits.push(Edit::Patch(place, patch));
                }
            }
            (Child::Text(before), Child::Text(after)) if before == after => {}
            (Child::Moment(before), Child::Moment(after)) if before == after => {}
            _ => edits.push(Edit::Text(place, child)),
        }
    }
    edits
}

fn node<'a, M>(old: &Node<M>, new: &'a Node<M>) -> Patch<'a, M> {
    let changed =
        new.attributes.iter().filter(|(name, value)| old.attribute(name) != Some(value.as_str()));
    let set = changed.map(|(name, value)| (*name, Some(value.as_str())));
    let gone = old.attributes.iter().filter(|(name, _)| new.attribute(name).is_none());
    let attributes = set.chain(gone.map(|(name, _)| (*name, None))).collect();
    Patch { attributes, children: children(&old.children, &new.children) }
}

/// For each new child, the index of the matching old child, if any.
fn matched<M>(old: &[Child<M>], new: &[Child<M>]) -> Vec<Option<usize>> {
    let mut free = vec![true; old.len()];
    let mut expected = 0;
    let continued = new.iter().map(|child| {
        // Usually the next old child matches, so the search starts there.
        let mut places = (expected..old.len()).chain(0..expected);
        let place = places.find(|&place| free[place] && continues(&old[place], child))?;
        free[place] = false;
        expected = place + 1;
        Some(place)
    });
    continued.collect()
}

fn continues<M>(old: &Child<M>, new: &Child<M>) -> bool {
    match (old, new) {
        (Child::Node(old), Child::Node(new)) => {
            old.tag == new.tag && old.identity() == new.identity()
        }
        (Child::Text(_) | Child::Moment(_), Child::Text(_) | Child::Moment(_)) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::el;
    use sidestep::math::SeededRng;

    type View = Vec<Child<()>>;

    /// An object in the model of a document.
    #[derive(Clone, Debug, PartialEq)]
    struct Object {
        /// Unique number.
        number: usize,
        tag: String,
        attributes: Vec<(&'static str, String)>,
        children: Vec<Object>,
    }

    /// A model of the browser's document, to which edits are applied.
    #[derive(Default)]
    struct Document {
        shown: View,
        objects: Vec<Object>,
        /// The number of objects created and the number of edits applied.
        made: usize,
        edits: usize,
    }

    impl Document {
        fn create(&mut self, child: &Child<()>) -> Object {
            self.made += 1;
            let number = self.made;
            let (tag, attributes, children) = match child {
                Child::Text(text) => (format!("“{text}”"), Vec::new(), Vec::new()),
                Child::Moment(ms) => (format!("@{ms}"), Vec::new(), Vec::new()),
                Child::Node(node) => {
                    let children = node.children.iter().map(|child| self.create(child)).collect();
                    (node.tag.to_owned(), node.attributes.clone(), children)
                }
            };
            Object { number, tag, attributes, children }
        }

        fn apply(&mut self, objects: &mut Vec<Object>, edits: &[Edit<'_, ()>]) {
            for edit in edits {
                self.edits += 1;
                match edit {
                    Edit::Remove(place) => drop(objects.remove(*place)),
                    Edit::Insert(place, child) => objects.insert(*place, self.create(child)),
                    Edit::Move(from, to) => {
                        assert!(from > to);
                        let object = objects.remove(*from);
                        objects.insert(*to, object);
                    }
                    Edit::Text(place, child) => objects[*place].tag = self.create(child).tag,
                    Edit::Patch(place, patch) => {
                        let object = &mut objects[*place];
                        for (name, value) in &patch.attributes {
                            object.attributes.retain(|(known, _)| known != name);
                            object.attributes.extend(value.map(|value| (*name, value.to_owned())));
                        }
                        self.apply(&mut object.children, &patch.children);
                    }
                }
            }
        }

        /// Updates the document to a view and checks the result. Returns the numbers of the
        /// document's objects, and the number of edits.
        fn show(&mut self, view: View) -> (Vec<usize>, usize) {
            self.edits = 0;
            let mut objects = std::mem::take(&mut self.objects);
            self.apply(&mut objects, &children(&self.shown.clone(), &view));
            assert_eq!(objects.len(), view.len());
            assert!(objects.iter().zip(&view).all(|(object, child)| same(object, child)));
            (self.objects, self.shown) = (objects, view);
            (self.objects.iter().map(|object| object.number).collect(), self.edits)
        }
    }

    fn same(object: &Object, child: &Child<()>) -> bool {
        let fresh = Document::default().create(child);
        let children = match child {
            Child::Node(node) => node.children.as_slice(),
            _ => &[],
        };
        let mut attributes = [object.attributes.clone(), fresh.attributes];
        attributes.iter_mut().for_each(|list| list.sort());
        object.tag == fresh.tag
            && attributes[0] == attributes[1]
            && object.children.len() == children.len()
            && object.children.iter().zip(children).all(|(o, c)| same(o, c))
    }

    fn rows(keys: &[&str]) -> View {
        keys.iter().map(|key| Child::Node(el("tr").key(key).child(el("td").text(*key)))).collect()
    }

    #[test]
    fn keyed_children_are_moved_and_not_made_anew() {
        let mut document = Document::default();
        let (first, _) = document.show(rows(&["a", "b", "c", "d"]));
        let (second, _) = document.show(rows(&["d", "a", "x", "c"]));
        assert_eq!([second[0], second[1], second[3]], [first[3], first[0], first[2]]);
        assert!(!first.contains(&second[2]));
        // Inserting or removing a row does not edit the rows after it.
        let (third, edits) = document.show(rows(&["new", "d", "a", "x", "c"]));
        assert_eq!((&third[1..], edits), (&second[..], 1));
        assert_eq!(document.show(rows(&["d", "a", "x", "c"])), (second, 1));
    }

    #[test]
    fn a_row_that_changes_keeps_the_local_time_in_it() {
        let row = |flags: &str| {
            let time = el("time").moment(1_700_000_000_000);
            vec![Child::Node(el("tr").child(time).child(el("td").text(flags)))]
        };
        let mut document = Document::default();
        document.show(row(""));
        let time = document.objects[0].children[0].clone();
        document.show(row("late sample"));
        assert_eq!(document.objects[0].children[0], time);
        assert_eq!(time.children[0].tag, "@1700000000000");
    }

    #[test]
    fn an_element_with_another_identity_is_made_anew() {
        let button = |name: &str| vec![Child::Node(el("button").test_id(name).text("Go"))];
        let mut document = Document::default();
        assert_ne!(document.show(button("consent")).0, document.show(button("continue")).0);
    }

    #[test]
    fn attributes_come_change_and_go() {
        let mut document = Document::default();
        for (busy, words) in [(false, "a"), (true, "a"), (true, "b"), (false, "b")] {
            let button = el("button").attr_if(busy, "disabled", "").attr("title", words);
            document.show(vec![Child::Node(button.clone())]);
            assert_eq!(document.show(vec![Child::Node(button)]).1, 0);
        }
        assert_eq!(document.made, 1);
    }

    #[test]
    fn any_list_becomes_any_other() {
        let mut rng = SeededRng::new(5);
        let mut document = Document::default();
        for _ in 0..2000 {
            let mut view = Vec::new();
            for _ in 0..rng.below(8) {
                let key = rng.below(6).to_string();
                view.push(match rng.below(4) {
                    0 => Child::Text(key),
                    1 => Child::Node(el("p").text(key)),
                    2 => Child::Moment(rng.below(3) as i64),
                    // Duplicate keys are a bug in a page, but must not break the document.
                    _ => Child::Node(el("li").key(&key).attr("title", &key).child(el("b"))),
                });
            }
            document.show(view);
        }
    }
}
