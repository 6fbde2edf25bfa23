//! The laboratory. It handles signing in and out, and shows one page at a time, which the address
//! selects.

mod hosted;
mod visit;
mod study;
mod pager;
mod data_check;
mod home;
mod participants;
mod profile;
mod trials;
mod analyses;
mod compare;
mod predictors;
mod analysis;
mod export;
mod configuration;
mod access;
mod self_check;
mod routes;
#[cfg(test)]
mod tests;

use self::hosted::{AnyMsg, AnyPage};
pub use self::routes::{Demonstration, Inspector, Laboratory, Program, Viewer};
use self::routes::{NAVIGATION, OPEN_TO_ALL, Route, is_apart};
use self::visit::Visit;
use super::parts::{self, alert, button};
use crate::form::Form;
use crate::json;
use crate::runtime::{
    Address, Answer, Command, Commands, Event, Failure, Page, PageContext, Request, Solid, read,
};
use crate::view::{self, el};
use sidestep::api::{Access, Session, SignIn, routes as api};
use sidestep::picture::Picture;
use std::marker::PhantomData;
use std::rc::Rc;

type Node = view::Node<Msg>;

/// The laboratory, or the part of it that belongs to this program.
pub struct Lab<P> {
    address: Address,
    /// The session.
    session: Session,
    state: State,
    /// Width of the window when the laboratory was opened (px).
    window_px: f64,
    /// Number of pages opened so far. Messages for a page that the user has left are dropped.
    visits: u32,
    /// The reason why signing in or out failed.
    trouble: Option<String>,
    program: PhantomData<P>,
}

/// State of the laboratory.
enum State {
    /// The server has not yet answered whether the user is signed in.
    Asking,
    SignedOut {
        /// Whether the server is checking a key.
        busy: bool,
    },
    /// There is no page at this address.
    Nowhere,
    Open(AnyPage),
}

/// Messages to the laboratory.
#[derive(Clone)]
pub enum Msg {
    /// Show another address.
    Address(Address),
    /// The server answered whether the user is signed in, or whether a key is valid.
    Session(Answer),
    /// The form with the key was submitted.
    SignIn(Form),
    /// The user signs out.
    SignOut,
    /// The server answered the sign-out.
    SignedOut(Answer),
    /// The server reported that the session has ended.
    SessionEnded,
    /// A message to the page with this visit number.
    Page(u32, AnyMsg),
}

impl<P: Program> Lab<P> {
    /// Creates the laboratory and its first commands.
    #[must_use]
    pub fn open(context: PageContext) -> (Self, Commands<Msg>) {
        let session = Session { signed_in: false, name: String::new(), access: Access::Read };
        let (address, state) = (context.address, State::Asking);
        let (visits, trouble, program) = (0, None, PhantomData);
        let width = context.screen.iter().find(|(name, _)| *name == "window_width_px");
        let window_px = width.map_or(1280.0, |(_, px)| *px);
        let mut lab = Self { address, session, state, window_px, visits, trouble, program };
        let key = if lab.is_open_to_all() { None } else { lab.key_of_address() };
        let commands = match key {
            Some(commands) => commands,
            // A page that is the same for every user starts to load while the server checks the
            // session.
            None if lab.is_open_to_all() || is_apart(&lab.address.path) => lab.show_address(),
            None => vec![who_is_there()],
        };
        (lab, commands)
    }

    /// Whether the user is allowed to see the page, because it is open to all or the user is signed
    /// in.
    fn is_seen(&self) -> bool {
        self.session.signed_in || self.is_open_to_all()
    }

    /// Whether this page needs no sign-in.
    fn is_open_to_all(&self) -> bool {
        self.address.path.trim_end_matches('/') == OPEN_TO_ALL
    }

    /// Signs in with the key in the address, if there is one. The key is immediately removed from
    /// the address, so that it is not in the history or in screenshots.
    fn key_of_address(&mut self) -> Option<Commands<Msg>> {
        let key = self.address.fragment.strip_prefix("key=")?.to_owned();
        self.address.fragment.clear();
        let mut commands = vec![Command::ReplaceAddress(self.address.path.clone())];
        commands.extend(self.sign_in(&key));
        Some(commands)
    }

    fn sign_in(&mut self, key: &str) -> Commands<Msg> {
        self.state = State::SignedOut { busy: true };
        let body = Some(json::write(&SignIn { key: key.trim().to_owned() }));
        let ask = Request::get("session", api::SESSION, Msg::Session);
        vec![Command::CancelAll, Command::Send(Request { method: "POST", body, ..ask })]
    }

    fn address_changed(&mut self, address: Address) -> Commands<Msg> {
        let is_same = (&address.path, &address.query) == (&self.address.path, &self.address.query);
        self.address = address;
        if let Some(commands) = self.key_of_address() {
            return commands;
        }
        match self.state {
            State::Open(..) if is_same => Vec::new(),
            State::Open(..) | State::Nowhere => self.show_address(),
            State::Asking | State::SignedOut { .. } => Vec::new(),
        }
    }

    /// Opens the page at the current address and cancels the requests of the previous page.
    fn show_address(&mut self) -> Commands<Msg> {
        self.trouble = None;
        self.visits += 1;
        let found = page_at::<P>(&self.address.path);
        let Some((route, id)) = found else {
            self.state = State::Nowhere;
            return vec![Command::CancelAll];
        };
        let visit =
            Visit { address: &self.address, id, session: &self.session, window_px: self.window_px };
        let (page, commands) = (route.open)(&visit);
        self.state = State::Open(page);
        let commands = self.lifted(commands);
        let ask = (!self.is_seen()).then(who_is_there);
        [Command::CancelAll].into_iter().chain(ask).chain(commands).collect()
    }

    /// Wraps the page's commands, so that their messages return to this visit of the page. The
    /// laboratory itself handles the end of the session.
    fn lifted(&self, commands: Commands<AnyMsg>) -> Commands<Msg> {
        let visit = self.visits;
        let lift = move |message| Msg::Page(visit, message);
        let lifted = commands.into_iter().map(|command| match command.map(lift) {
            Command::Send(Request { name, method, url, token, body, then }) => {
                let then = Box::new(|answer| match answer {
                    Err(Failure { status: 401, .. }) => Msg::SessionEnded,
                    answer => then(answer),
                });
                Command::Send(Request { name, method, url, token, body, then })
            }
            other => other,
        });
        lifted.collect()
    }

    /// Shows the sign-in form.
    fn ask_for_key(&mut self, trouble: Option<String>) -> Commands<Msg> {
        self.trouble = trouble;
        self.state = State::SignedOut { busy: false };
        vec![Command::CancelAll]
    }
}

/// Asks the server whether the user is signed in.
fn who_is_there() -> Command<Msg> {
    Command::Send(Request::get("session", api::SESSION, Msg::Session))
}

/// Finds the page of this program at a path. Returns it with the id in the path.
fn page_at<P: Program>(path: &str) -> Option<(&'static Route, &str)> {
    let mut pages = P::PAGES.iter().copied().flatten();
    pages.find_map(|route| Some((route, route.matches(path)?)))
}

impl<P: Program> Page for Lab<P> {
    type Msg = Msg;

    fn navigates() -> bool {
        true
    }

    fn keeps() -> bool {
        false
    }

    fn solves() -> bool {
        P::SOLVES
    }

    fn shows_solids() -> bool {
        P::SHOWS_SOLIDS
    }

    fn points() -> bool {
        P::POINTS
    }

    fn follows() -> bool {
        true
    }

    fn offers_files() -> bool {
        P::OFFERS_FILES
    }

    fn has_panes() -> bool {
        P::HAS_PANES
    }

    fn has_short_cuts() -> bool {
        true
    }

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        match message {
            Msg::Address(address) => self.address_changed(address),
            Msg::Session(answer) => match read(answer) {
                Ok(session) => {
                    self.session = session;
                    match self.state {
                        // The page is already open.
                        State::Open(_) => Vec::new(),
                        _ => self.show_address(),
                    }
                }
                Err(Failure { status: 401, .. }) => {
                    // A user who has not yet tried to sign in gets no error message.
                    let gave_key = matches!(self.state, State::SignedOut { .. });
                    self.ask_for_key(gave_key.then(|| "That key is not valid.".to_owned()))
                }
                Err(failure) => self.ask_for_key(Some(failure.sentence)),
            },
            Msg::SignIn(form) => self.sign_in(form.text("key")),
            Msg::SignOut => {
                let ask = Request::get("session", api::SESSION, Msg::SignedOut);
                vec![Command::Send(Request { method: "DELETE", ..ask })]
            }
            Msg::SignedOut(answer) => match answer {
                Err(failure) if failure.status != 401 => {
                    self.trouble = Some(format!("You are still signed in. {}", failure.sentence));
                    Vec::new()
                }
                _ => vec![Command::CancelAll, Command::Leave("/".to_owned())],
            },
            Msg::SessionEnded => {
                let why = "Your session has ended. Please sign in again.";
                self.ask_for_key(self.session.signed_in.then(|| why.to_owned()))
            }
            Msg::Page(visit, message) => match &mut self.state {
                State::Open(page) if visit == self.visits => {
                    let commands = page.update(message, now_ms);
                    self.lifted(commands)
                }
                // The user has left the page that this message is for.
                _ => Vec::new(),
            },
        }
    }

    fn view(&self) -> Node {
        let content = match &self.state {
            State::SignedOut { busy } => self.sign_in_form(*busy),
            State::Asking => parts::loading(),
            State::Open(_) if !self.is_seen() => parts::loading(),
            State::Nowhere => {
                parts::stuck("Page not found", "The laboratory has no page at this address.")
            }
            State::Open(page) => {
                let visit = self.visits;
                let lift: Rc<dyn Fn(AnyMsg) -> Msg> =
                    Rc::new(move |message| Msg::Page(visit, message));
                page.view().map(&lift).key(visit)
            }
        };
        el("div").class("lab").child(self.header()).children(self.alert()).child(content)
    }

    fn title(&self) -> String {
        let title = match &self.state {
            State::Asking => None,
            State::SignedOut { .. } => Some("Sign in".to_owned()),
            State::Nowhere => Some("Page not found".to_owned()),
            State::Open(_) if !self.is_seen() => None,
            State::Open(page) => Some(page.title()),
        };
        title.map_or_else(String::new, |title| format!("{title} · ")) + "Sidestep laboratory"
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        if let Event::Address(address) = event {
            let path = &address.path;
            let is_lab = path == "/lab" || path.starts_with("/lab/");
            // All other addresses belong to other programs. The program that contains the first
            // page also handles addresses without a page.
            let is_ours = is_lab
                && (page_at::<P>(path).is_some()
                    || (page_at::<P>("/lab").is_some() && !is_apart(path)));
            return is_ours.then(|| Msg::Address(address.clone()));
        }
        self.page()?.hear(event).map(|message| Msg::Page(self.visits, message))
    }

    fn owns_key(&self, code: &str) -> bool {
        self.page().is_some_and(|page| page.owns_key(code))
    }

    fn tick(&mut self, now_ms: f64) -> Option<Msg> {
        if !self.is_seen() {
            return None;
        }
        let State::Open(page) = &mut self.state else { return None };
        page.tick(now_ms).map(|message| Msg::Page(self.visits, message))
    }

    fn wants_frames(&self) -> bool {
        self.page().is_some_and(|page| page.wants_frames())
    }

    fn solid(&self) -> Option<Solid<Msg>> {
        let visit = self.visits;
        Some(self.page()?.solid()?.map(move |message| Msg::Page(visit, message)))
    }

    fn draw(&self, at_ms: f64, picture: &mut Picture) -> bool {
        self.page().is_some_and(|page| page.draw(at_ms, picture))
    }

    fn draw_beside(&self, at_ms: f64, picture: &mut Picture) -> bool {
        self.page().is_some_and(|page| page.draw_beside(at_ms, picture))
    }
}

impl<P: Program> Lab<P> {
    fn page(&self) -> Option<&AnyPage> {
        match &self.state {
            State::Open(page) if self.is_seen() => Some(page),
            _ => None,
        }
    }

    fn header(&self) -> Node {
        let brand = el("a").class("brand").attr("href", "/").text("Sidestep");
        let header = el("header").class("top").child(brand);
        let path = self.address.path.trim_end_matches('/');
        let is_current = |address: &str| address == path;
        let about = match &self.state {
            State::Asking | State::SignedOut { .. } => return header,
            _ if self.is_open_to_all() || !self.is_seen() => return header,
            // If the navigation marks this page as the current one, the title is not repeated.
            State::Open(page) if !NAVIGATION.iter().any(|(it, _)| is_current(it)) => page.title(),
            State::Open(..) | State::Nowhere => String::new(),
        };
        let links = NAVIGATION.map(|(address, words)| {
            let is_current = is_current(address);
            let link = el("a").attr("href", address);
            link.attr_if(is_current, "aria-current", "page").text(words)
        });
        let sign_out = button("sign-out", Msg::SignOut).class("plain").text("Sign out");
        header.child(el("nav").attr("aria-label", "Laboratory").children(links)).child(
            el("span").class("end").child(el("span").class("quiet").text(about)).child(sign_out),
        )
    }

    /// The error message. The sign-in form shows its own.
    fn alert(&self) -> Option<Node> {
        let is_signed_in = matches!(self.state, State::Open(..) | State::Nowhere);
        self.trouble.as_deref().filter(|_| is_signed_in).map(|why| alert("trouble", why))
    }

    fn sign_in_form(&self, busy: bool) -> Node {
        let key = el("input")
            .attrs(&[("id", "key"), ("name", "key"), ("type", "password"), ("required", "")])
            .attr("autocomplete", "current-password")
            .focus()
            .test_id("key");
        let submit = el("button")
            .class("primary")
            .attr("type", "submit")
            .attr_if(busy, "disabled", "")
            .test_id("sign-in")
            .text("Sign in");
        let form = el("form").test_id("sign-in-form").on_submit(Msg::SignIn).children([
            el("label").attr("for", "key").text("Experimenter’s key"),
            key,
            submit,
        ]);
        el("main")
            .class("card")
            .key("sign-in")
            .child(el("h1").text("Laboratory"))
            .child(el("p").text(
                "Sign in with the experimenter’s key. The server printed it, with a sign-in \
                 link, when it was started for the first time.",
            ))
            .child(form)
            .children(self.trouble.as_deref().map(|why| alert("trouble", why)))
            .child(
                el("p")
                    .class("quiet")
                    .text("Lost the key? Restart the server with --new-admin-key."),
            )
    }
}
