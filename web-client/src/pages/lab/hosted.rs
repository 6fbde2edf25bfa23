//! Type erasure for the messages of a page, so that the route table can list all pages. Outside
//! this file, messages have their own types.

use crate::runtime::{Commands, Event, Page, Solid};
use crate::view::Node;
use sidestep::picture::Picture;
use std::any::Any;
use std::rc::Rc;

/// A message of any page.
pub(super) type AnyMsg = Rc<dyn Any>;

/// A page whose message type is erased. It ignores messages of other pages.
pub(super) type AnyPage = Box<dyn Page<Msg = AnyMsg>>;

/// Erases the message type of a page and of its first commands, for the route table.
pub(super) fn host<P: Page + 'static>(
    (page, commands): (P, Commands<P::Msg>),
) -> (AnyPage, Commands<AnyMsg>) {
    (Box::new(Hosted(page)), lifted(commands))
}

struct Hosted<P>(P);

fn lift<M: 'static>(message: M) -> AnyMsg {
    Rc::new(message)
}

fn lifted<M: 'static>(commands: Commands<M>) -> Commands<AnyMsg> {
    commands.into_iter().map(|command| command.map(lift)).collect()
}

impl<P: Page> Page for Hosted<P> {
    type Msg = AnyMsg;

    fn update(&mut self, message: AnyMsg, now_ms: f64) -> Commands<AnyMsg> {
        let message = message.downcast::<P::Msg>().map(Rc::unwrap_or_clone);
        message.map_or_else(|_| Vec::new(), |message| lifted(self.0.update(message, now_ms)))
    }

    fn view(&self) -> Node<AnyMsg> {
        let lift: Rc<dyn Fn(P::Msg) -> AnyMsg> = Rc::new(lift);
        self.0.view().map(&lift)
    }

    fn title(&self) -> String {
        self.0.title()
    }

    fn hear(&self, event: &Event) -> Option<AnyMsg> {
        self.0.hear(event).map(lift)
    }

    fn owns_key(&self, code: &str) -> bool {
        self.0.owns_key(code)
    }

    fn tick(&mut self, now_ms: f64) -> Option<AnyMsg> {
        self.0.tick(now_ms).map(lift)
    }

    fn wants_frames(&self) -> bool {
        self.0.wants_frames()
    }

    fn solid(&self) -> Option<Solid<AnyMsg>> {
        self.0.solid().map(|solid| solid.map(lift))
    }

    fn draw(&self, at_ms: f64, picture: &mut Picture) -> bool {
        self.0.draw(at_ms, picture)
    }

    fn draw_beside(&self, at_ms: f64, picture: &mut Picture) -> bool {
        self.0.draw_beside(at_ms, picture)
    }
}
