//! Access to the laboratory: the keys, and the audit trail of who did what.

use super::visit::Visit;
use crate::form::Form;
use crate::json;
use crate::pages::parts::{self, alert, button, cell};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, Action, AuditEntry, AuditPage, KeyMade, KeySummary, NewKey, routes};

type Node = view::Node<Msg>;

/// The page with the keys and the audit trail.
pub(super) struct AccessPage {
    /// The name of the user's key.
    name: String,
    access: Access,
    /// Scheme and host of this server.
    origin: String,
    keys: Option<Vec<KeySummary>>,
    entries: Vec<AuditEntry>,
    next_before: Option<i64>,
    /// The new key. It is shown until the user leaves the page, and cannot be shown again.
    made: Option<KeyMade>,
    /// Number of keys created. The form is reset after each new key.
    makings: u32,
    /// The key whose revocation the page asks the user to confirm.
    revoking: Option<i64>,
    /// The reason why the last action failed.
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// The server listed the keys.
    Keys(Answer),
    /// The server listed entries of the audit trail.
    Audit(Answer),
    /// Load older entries of the audit trail.
    More,
    /// The form for a new key was submitted.
    Make(Form),
    /// The server created a key.
    Made(Answer),
    /// Ask for confirmation before this key is revoked. `None` cancels.
    AskToRevoke(Option<i64>),
    /// The user has confirmed the revocation.
    Revoke(i64),
    /// The server revoked a key.
    Revoked(Answer),
}

impl AccessPage {
    /// Creates the page and its first commands. Users without the right to manage see only their
    /// own access.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            name: visit.session.name.clone(),
            access: visit.session.access,
            origin: visit.address.origin.clone(),
            keys: None,
            entries: Vec::new(),
            next_before: None,
            made: None,
            makings: 0,
            revoking: None,
            trouble: None,
        };
        let commands = if page.may_manage() { page.ask() } else { Vec::new() };
        (page, commands)
    }

    fn may_manage(&self) -> bool {
        self.access >= Access::Manage
    }

    fn ask(&self) -> Commands<Msg> {
        let keys = Request::get("keys", routes::ADMIN_KEYS, Msg::Keys);
        let audit = Request::get("audit", format!("{}?limit=50", routes::AUDIT), Msg::Audit);
        vec![Command::Send(keys), Command::Send(audit)]
    }

    /// Clears messages about the last change and reloads the lists.
    fn begin_again(&mut self) -> Commands<Msg> {
        (self.trouble, self.revoking) = (None, None);
        self.entries.clear();
        self.ask()
    }
}

impl Page for AccessPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        let failure = match message {
            Msg::Keys(answer) => read(answer).map(|keys| self.keys = Some(keys)).err(),
            Msg::Audit(answer) => match read::<AuditPage>(answer) {
                Ok(page) => {
                    self.entries.extend(page.entries);
                    self.next_before = page.next_before;
                    None
                }
                Err(failure) => Some(failure),
            },
            Msg::More => {
                let Some(before) = self.next_before.take() else { return Vec::new() };
                let url = format!("{}?limit=50&before={before}", routes::AUDIT);
                return vec![Command::Send(Request::get("audit", url, Msg::Audit))];
            }
            Msg::Make(form) => {
                let access = Access::ALL.into_iter().find(|it| it.word() == form.text("access"));
                let name = form.text("name").trim().to_owned();
                let new = NewKey { name, access: access.unwrap_or(Access::Read) };
                let body = Some(json::write(&new));
                let ask = Request::get("make", routes::ADMIN_KEYS, Msg::Made);
                return vec![Command::Send(Request { method: "POST", body, ..ask })];
            }
            Msg::Made(answer) => match read(answer) {
                Ok(made) => {
                    self.made = Some(made);
                    self.makings += 1;
                    return self.begin_again();
                }
                Err(failure) => Some(failure),
            },
            Msg::AskToRevoke(id) => {
                self.revoking = id;
                None
            }
            Msg::Revoke(id) => {
                let url = routes::admin_key(&id.to_string());
                let ask = Request::get("revoke", url, Msg::Revoked);
                return vec![Command::Send(Request { method: "DELETE", ..ask })];
            }
            Msg::Revoked(answer) => match answer {
                Ok(_) => return self.begin_again(),
                Err(failure) => Some(failure),
            },
        };
        if let Some(failure) = failure {
            self.trouble = Some(failure.sentence);
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        let mine = format!("You are signed in with the key “{}”. {}", self.name, may(self.access));
        let page = el("main")
            .class("page")
            .child(
                el("div")
                    .child(parts::heading("Access"))
                    .child(el("p").class("quiet").test_id("mine").text(mine)),
            )
            .children(self.trouble.as_deref().map(|why| alert("trouble", why)));
        if !self.may_manage() {
            let words = "Only users with the right to manage see the keys and the audit trail.";
            return page.child(el("p").text(words));
        }
        let Some(keys) = &self.keys else {
            return if self.trouble.is_some() { page } else { parts::loading() };
        };
        page.children(self.made.as_ref().map(|made| self.made_key(made)))
            .child(self.keys(keys))
            .child(self.form())
            .child(self.audit())
    }

    fn title(&self) -> String {
        "Access".to_owned()
    }
}

/// Describes the permissions of a key with this access.
fn may(access: Access) -> &'static str {
    match access {
        Access::Read => {
            "It may view everything except external ids, completion codes and answers, and download the files of \
             analyses, which contain no identities."
        }
        Access::Export => "It may look at everything and download all data.",
        Access::Manage => "It may look at everything, download all data, change and delete.",
    }
}

impl AccessPage {
    fn made_key(&self, made: &KeyMade) -> Node {
        let link = format!("{}/lab#key={}", self.origin, made.secret);
        let words = format!(
            "The key of “{}” is below. It is shown only now: only its hash is stored.",
            made.key.name
        );
        el("section")
            .class("made")
            .key(made.key.id)
            .attr("role", "status")
            .child(el("p").text(words))
            .child(el("p").child(el("code").class("secret").test_id("secret").text(&made.secret)))
            .child(el("p").class("quiet").text("Sign-in link, as secret as the key:"))
            .child(el("p").child(el("code").class("secret").test_id("sign-in-link").text(link)))
    }

    fn keys(&self, keys: &[KeySummary]) -> Node {
        let table = parts::table(
            ["Name", "Right", "Made", "Last used", "Revoke"],
            keys.iter().map(|key| self.key(key)),
        );
        el("section")
            .child(el("h2").text("Keys"))
            .child(
                el("p")
                    .class("quiet")
                    .text("Scripts send a key as a bearer token: ")
                    .child(el("a").attr("href", "/api/docs").text("the API with all routes"))
                    .text("."),
            )
            .child(el("div").class("scroll").attr("tabindex", 0).child(table.test_id("keys")))
    }

    fn key(&self, key: &KeySummary) -> Node {
        let moment = |ms: Option<i64>| match ms {
            Some(ms) => el("td").child(el("time").moment(ms)),
            None => cell("never"),
        };
        let end = match (key.revoked_at_ms, self.revoking == Some(key.id)) {
            (Some(ms), _) => el("td").class("quiet").text("revoked ").child(el("time").moment(ms)),
            (None, false) => el("td").child(
                button(&format!("revoke-{}", key.id), Msg::AskToRevoke(Some(key.id)))
                    .class("danger")
                    .attr("aria-label", format!("Revoke the key of {}", key.name))
                    .text("Revoke…"),
            ),
            (None, true) => el("td")
                .class("sure")
                .child(
                    button(&format!("sure-{}", key.id), Msg::Revoke(key.id))
                        .class("danger")
                        .focus()
                        .text("Revoke for ever"),
                )
                .child(
                    button(&format!("keep-{}", key.id), Msg::AskToRevoke(None))
                        .class("plain")
                        .text("Keep"),
                ),
        };
        el("tr").key(key.id).attr_if(key.revoked_at_ms.is_some(), "class", "quiet").children([
            el("th").attr("scope", "row").text(&key.name),
            cell(key.access.word()),
            moment(Some(key.created_at_ms)),
            moment(key.last_used_at_ms),
            end,
        ])
    }

    fn form(&self) -> Node {
        let option = |access: Access| {
            let radio = el("input")
                .attrs(&[("type", "radio"), ("name", "access"), ("value", access.word())])
                .attr_if(access == Access::Read, "checked", "")
                .test_id(&format!("access-{}", access.word()));
            let words = match access {
                Access::Read => "look at studies, participants, trials and analyses",
                Access::Export => "also download all data, and see external ids and codes",
                Access::Manage => "also change and delete: studies, participants, analyses, keys",
            };
            el("label")
                .child(radio)
                .child(el("span").child(el("b").text(access.word())).text(format!(": {words}")))
        };
        let name = el("input")
            .attrs(&[("id", "key-name"), ("name", "name"), ("required", ""), ("maxlength", "64")])
            .attrs(&[("autocomplete", "off"), ("placeholder", "Ada, or nightly export")])
            .test_id("key-name");
        let rights = el("fieldset")
            .child(el("legend").text("What it may do"))
            .children(Access::ALL.map(option));
        let submit = el("button").attr("type", "submit").test_id("make-key").text("Make a key");
        el("section").child(el("h2").text("New key")).child(
            el("form")
                .class("new-key")
                .key(self.makings)
                .on_submit(Msg::Make)
                .test_id("new-key")
                .child(
                    el("label")
                        .attr("for", "key-name")
                        .text("Name of the key: who or what uses it"),
                )
                .child(name)
                .child(rights)
                .child(submit),
        )
    }

    fn audit(&self) -> Node {
        let table = parts::table(
            ["When", "Key", "What", "Study", "Details"],
            self.entries.iter().map(entry),
        );
        let more = self
            .next_before
            .map(|_| button("more", Msg::More).class("plain").text("Show older entries"));
        el("section")
            .child(el("h2").text("Audit trail"))
            .child(el("div").class("scroll").attr("tabindex", 0).child(table.test_id("audit")))
            .children(more)
    }
}

fn entry(entry: &AuditEntry) -> Node {
    let class = if entry.action == Action::Refused { "waiting" } else { "" };
    el("tr").key(entry.sequence).children([
        el("td").child(el("time").moment(entry.at_ms)),
        cell(&entry.who),
        cell(entry.action.word().replace('_', " ")).class(class),
        cell(entry.study.as_deref().unwrap_or("–")),
        cell(entry.subject.as_deref().unwrap_or("–")),
    ])
}
