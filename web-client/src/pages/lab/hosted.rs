//! A page of the laboratory whatever its message type, so that the route table can list them
//! all. Messages are typed on both sides of this file.

use crate::runtime::{Commands, Event, Page};
use crate::shape::Picture;
use crate::view::Node;
use std::any::Any;
use std::rc::Rc;

/// A message of some page.
pub(super) type AnyMsg = Rc<dyn Any>;

/// A [`Page`] with its message type hidden.
pub(super) trait Hosted {
    /// See [`Page::update`]. A message of another page changes nothing.
    fn update(&mut self, message: AnyMsg, now_ms: f64) -> Commands<AnyMsg>;
    /// See [`Page::view`].
    fn view(&self) -> Node<AnyMsg>;
    /// See [`Page::title`].
    fn title(&self) -> String;
    /// See [`Page::hear`].
    fn hear(&self, event: &Event) -> Option<AnyMsg>;
    /// See [`Page::picture`].
    fn picture(&self) -> Option<Picture>;
    /// See [`Page::wants_frames`].
    fn wants_frames(&self) -> bool;
}

fn lift<M: 'static>(message: M) -> AnyMsg {
    Rc::new(message)
}

/// A page and its first commands, as the route table takes them.
pub(super) fn host<P: Page + 'static>(
    (page, commands): (P, Commands<P::Msg>),
) -> (Box<dyn Hosted>, Commands<AnyMsg>) {
    (Box::new(page), lifted(commands))
}

fn lifted<M: 'static>(commands: Commands<M>) -> Commands<AnyMsg> {
    commands.into_iter().map(|command| command.map(lift)).collect()
}

impl<P: Page> Hosted for P {
    fn update(&mut self, message: AnyMsg, now_ms: f64) -> Commands<AnyMsg> {
        let message = message.downcast::<P::Msg>().map(Rc::unwrap_or_clone);
        message.map_or_else(|_| Vec::new(), |message| lifted(Page::update(self, message, now_ms)))
    }

    fn view(&self) -> Node<AnyMsg> {
        let lift: Rc<dyn Fn(P::Msg) -> AnyMsg> = Rc::new(lift);
        Page::view(self).map(&lift)
    }

    fn title(&self) -> String {
        Page::title(self)
    }

    fn hear(&self, event: &Event) -> Option<AnyMsg> {
        Page::hear(self, event).map(lift)
    }

    fn picture(&self) -> Option<Picture> {
        Page::picture(self)
    }

    fn wants_frames(&self) -> bool {
        Page::wants_frames(self)
    }
}
