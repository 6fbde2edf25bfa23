//! From what is shown to what is to be shown: a list of edits, as plain data.
//!
//! Siblings are matched by tag and identity ([`Node::identity`]), in order where they have
//! none. A matched element stays in the document, and with it the focus, selection, scrolling
//! and input in it.

use crate::view::{Child, Node};

/// What changes in an element that stays.
pub struct Patch<'a, M> {
    /// Attributes to set, or to remove where there is no value.
    pub attributes: Vec<(&'static str, Option<&'a str>)>,
    /// What changes among its children, in this order.
    pub children: Vec<Edit<'a, M>>,
}

/// A change among an element's children. Places are those at the time of the edit.
pub enum Edit<'a, M> {
    /// The child at this place goes.
    Remove(usize),
    /// A new child comes to this place.
    Insert(usize, &'a Child<M>),
    /// The child at the first place goes to the second, which lies before it.
    Move(usize, usize),
    /// The text at this place becomes that of the child.
    Text(usize, &'a Child<M>),
    /// The element at this place changes.
    Patch(usize, Patch<'a, M>),
}

/// The edits that bring `old` to `new`.
#[must_use]
pub fn children<'a, M>(old: &[Child<M>], new: &'a [Child<M>]) -> Vec<Edit<'a, M>> {
    let mut edits = Vec::new();
    let sources = matched(old, new);
    // Places in `old` of the children that are left in the document.
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
            // It is in none of the old places.
            present.insert(place, usize::MAX);
            continue;
        };
        if present[place] != source {
            // What is before `place` is settled, so that it lies behind.
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

/// For each new child the place of the old one that it continues.
fn matched<M>(old: &[Child<M>], new: &[Child<M>]) -> Vec<Option<usize>> {
    let mut free = vec![true; old.len()];
    let mut expected = 0;
    let continued = new.iter().map(|child| {
        // Most often the next one, so that the search begins there.
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

    /// A document: what the browser does with edits, and which object each child is.
    #[derive(Clone, Debug, PartialEq)]
    struct Object {
        number: usize,
        tag: String,
        attributes: Vec<(&'static str, String)>,
        children: Vec<Object>,
    }

    #[derive(Default)]
    struct Document {
        made: usize,
        touched: usize,
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
                self.touched += 1;
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

        /// Brings `objects` from one view to the next, and checks that they show it.
        fn show(&mut self, objects: &mut Vec<Object>, old: &[Child<()>], new: &[Child<()>]) {
            self.apply(objects, &children(old, new));
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
            assert_eq!(objects.len(), new.len());
            assert!(objects.iter().zip(new).all(|(object, child)| same(object, child)));
        }
    }

    fn rows(keys: &[&str]) -> Vec<Child<()>> {
        keys.iter().map(|key| Child::Node(el("tr").key(key).child(el("td").text(*key)))).collect()
    }

    /// The objects of both lists, after the first was brought to the second.
    fn rearranged(before: &[&str], after: &[&str]) -> (Vec<usize>, Vec<usize>, Document) {
        let mut document = Document::default();
        let mut objects = Vec::new();
        let (before, after) = (rows(before), rows(after));
        document.show(&mut objects, &[], &before);
        let numbers = |objects: &[Object]| objects.iter().map(|object| object.number).collect();
        let first: Vec<usize> = numbers(&objects);
        document.touched = 0;
        document.show(&mut objects, &before, &after);
        (first, numbers(&objects), document)
    }

    #[test]
    fn keyed_children_are_moved_and_not_made_anew() {
        let (first, second, _) = rearranged(&["a", "b", "c", "d"], &["d", "a", "x", "c"]);
        assert_eq!([second[0], second[1], second[3]], [first[3], first[0], first[2]]);
        assert!(!first.contains(&second[2]));
    }

    #[test]
    fn a_row_ahead_of_others_touches_none_of_them() {
        let (first, second, document) = rearranged(&["a", "b", "c"], &["new", "a", "b", "c"]);
        assert_eq!(second[1..], first);
        assert_eq!(document.touched, 1);
        let (_, _, document) = rearranged(&["a", "b", "c", "d"], &["b", "c", "d"]);
        assert_eq!(document.touched, 1);
    }

    #[test]
    fn a_row_that_changes_keeps_the_local_time_in_it() {
        let row = |flags: &str| {
            let time = el("time").moment(1_700_000_000_000);
            vec![Child::Node(el("tr").child(time).child(el("td").text(flags)))]
        };
        let (before, after) = (row(""), row("late sample"));
        let mut document = Document::default();
        let mut objects = Vec::new();
        document.show(&mut objects, &[], &before);
        let time = objects[0].children[0].clone();
        document.show(&mut objects, &before, &after);
        assert_eq!(objects[0].children[0], time);
        assert_eq!(time.children[0].tag, "@1700000000000");
    }

    #[test]
    fn an_element_with_another_identity_is_made_anew() {
        let button = |name: &str| vec![Child::<()>::Node(el("button").test_id(name).text("Go"))];
        let mut document = Document::default();
        let mut objects = Vec::new();
        document.show(&mut objects, &[], &button("consent"));
        let first = objects[0].number;
        document.show(&mut objects, &button("consent"), &button("continue"));
        assert_ne!(objects[0].number, first);
    }

    #[test]
    fn attributes_come_change_and_go() {
        let view = |busy: bool, words: &str| {
            let button = el("button").attr_if(busy, "disabled", "").attr("title", words);
            vec![Child::Node(button)]
        };
        let mut document = Document::default();
        let mut objects = Vec::new();
        let views = [view(false, "a"), view(true, "a"), view(true, "b"), view(false, "b")];
        let mut before: &[Child<()>] = &[];
        for after in &views {
            document.show(&mut objects, before, after);
            before = after;
        }
        assert_eq!(document.made, 1);
        assert!(children(before, &views[3]).is_empty());
    }

    #[test]
    fn any_list_becomes_any_other() {
        let mut rng = SeededRng::new(5);
        let mut random = || {
            let mut children = Vec::new();
            for _ in 0..rng.below(8) {
                let key = rng.below(6).to_string();
                children.push(match rng.below(4) {
                    0 => Child::Text(key),
                    1 => Child::Node(el("p").text(key)),
                    2 => Child::Moment(rng.below(3) as i64),
                    // Keys may come twice: that is a mistake of the page, but must do no harm.
                    _ => Child::Node(el("li").key(&key).attr("title", &key).child(el("b"))),
                });
            }
            children
        };
        let mut document = Document::default();
        let mut objects = Vec::new();
        let mut before = Vec::new();
        for _ in 0..2000 {
            let after = random();
            document.show(&mut objects, &before, &after);
            before = after;
        }
    }
}
