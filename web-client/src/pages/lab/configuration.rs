//! A study as it is set up: its file, checked while somebody writes it, who can take part, and the links
//! for participants.

mod links;
mod outcome;

use super::study::{self, Tab};
use super::visit::Visit;
use crate::form::FieldValue;
use crate::json;
use crate::pages::parts::{self, alert, button};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{
    Access, Configuration, Draft, DraftChecked, NewStatus, StudyInfo, StudySummary, routes,
};
use sidestep::study::Status;

type Node = view::Node<Msg>;

/// The page of a study's configuration, or of a new study.
pub(super) struct ConfigurationPage {
    /// The study; none if it is to be made.
    slug: Option<String>,
    may_manage: bool,
    /// Scheme and host of this server.
    origin: String,
    study: Option<StudySummary>,
    info: Option<StudyInfo>,
    /// What the text began with; none before it has come, and for a study that begins with nothing.
    base: Option<Configuration>,
    /// What the field was given. What is typed does not change it.
    given: Option<String>,
    /// How often the field was given a text: it is made anew each time.
    givings: u32,
    /// What is in the field.
    text: String,
    /// What the server says of the text, once it has.
    checked: Option<DraftChecked>,
    /// The differences are shown, and storing waits for a second press.
    confirming: bool,
    /// The text was stored just now.
    stored: bool,
    /// Somebody else has stored another configuration since.
    overtaken: bool,
    trouble: Option<String>,
}

/// What the page can be told.
#[derive(Clone)]
pub(super) enum Msg {
    /// The server described the study.
    Study(Answer),
    /// The server told what participants are told.
    Info(Answer),
    /// The server sent the configuration.
    Configuration(Answer),
    /// The text has changed.
    Typed(FieldValue),
    /// The text has not changed for a moment.
    Check,
    /// The server checked the text.
    Checked(Answer),
    /// The text is to be stored.
    Store,
    /// Not yet.
    GoOn,
    /// The differences are right.
    Confirm,
    /// The server stored the text, or refused.
    Stored(Answer),
    /// The study is to be open, closed or archived.
    Set(Status),
    /// The server has set it.
    StatusSet(Answer),
    /// The present configuration is wanted instead of the text.
    Reload,
}

/// After this pause in typing the text is checked, ms.
const PAUSE_MS: f64 = 350.0;

/// A new study begins with this.
const TEMPLATE: &str = "\
slug = \"my-study\"
title = \"My study\"

# What is not said here is as in the paper, such as
# six scenes of familiarisation, three of practice, fifty tasks.
# [[phases]]
# phase = \"task\"
# scenes = 20

[consent]
investigator = \"\"
contact = \"\"
";

impl ConfigurationPage {
    /// The page as it opens at `/lab/studies/SLUG/configuration`.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let mut page = Self::blank(visit);
        page.slug = Some(visit.id.to_owned());
        let commands = page.ask(visit.id);
        (page, commands)
    }

    /// The page as it opens at `/lab/new`, or `/lab/new?from=SLUG` for a copy.
    pub(super) fn open_new(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let mut page = Self::blank(visit);
        let commands = match visit.address.parameter("from") {
            Some(slug) => {
                let url = routes::admin_configuration(slug);
                vec![Command::Send(Request::get("configuration", url, Msg::Configuration))]
            }
            None => {
                page.give(TEMPLATE.to_owned());
                vec![page.check()]
            }
        };
        (page, commands)
    }

    fn blank(visit: &Visit<'_>) -> Self {
        Self {
            slug: None,
            may_manage: visit.session.access >= Access::Manage,
            origin: visit.address.origin.clone(),
            study: None,
            info: None,
            base: None,
            given: None,
            givings: 0,
            text: String::new(),
            checked: None,
            confirming: false,
            stored: false,
            overtaken: false,
            trouble: None,
        }
    }

    fn ask(&self, slug: &str) -> Commands<Msg> {
        let info = Request::get("info", routes::study(slug), Msg::Info);
        let configuration =
            Request::get("configuration", routes::admin_configuration(slug), Msg::Configuration);
        vec![study::ask(slug, Msg::Study), Command::Send(info), Command::Send(configuration)]
    }

    /// Puts a text into the field.
    fn give(&mut self, text: String) {
        self.text.clone_from(&text);
        self.given = Some(text);
        self.givings += 1;
        (self.confirming, self.overtaken, self.stored) = (false, false, false);
    }

    /// Whether there is anything to store.
    fn is_changed(&self) -> bool {
        self.given.as_ref() != Some(&self.text) || (self.slug.is_none() && self.given.is_some())
    }

    fn draft(&self) -> String {
        let base = self.base.as_ref().map(|base| base.hash.clone());
        json::write(&Draft { toml: self.text.clone(), base })
    }

    fn check(&self) -> Command<Msg> {
        let ask = Request::get("check", routes::ADMIN_DRAFTS, Msg::Checked);
        Command::Send(Request { method: "POST", body: Some(self.draft()), ..ask })
    }

    fn store(&mut self) -> Commands<Msg> {
        self.trouble = None;
        let (method, url) = match &self.slug {
            Some(slug) => ("PUT", routes::admin_configuration(slug)),
            None => ("POST", routes::ADMIN_STUDIES.to_owned()),
        };
        let ask = Request::get("store", url, Msg::Stored);
        vec![Command::Send(Request { method, body: Some(self.draft()), ..ask })]
    }

    fn configuration_arrived(&mut self, found: Configuration) -> Commands<Msg> {
        if self.slug.is_some() {
            self.give(found.toml.clone());
            self.base = Some(found);
            return vec![Command::GuardLeaving(false), self.check()];
        }
        // A copy needs a name of its own.
        let copy = copy_of(&found);
        self.give(copy);
        vec![self.check()]
    }
}

/// The text of a study with another name.
fn copy_of(configuration: &Configuration) -> String {
    let slug = &configuration.study;
    let renamed = |line: &str| match line.split_once(" = ") {
        Some(("slug", _)) => format!("slug = \"{slug}-copy\"\n"),
        Some(("status", _)) => String::new(),
        _ => format!("{line}\n"),
    };
    // Only the lines before the first table are about the study itself.
    let (head, tables) = match configuration.toml.find("\n[") {
        Some(at) => configuration.toml.split_at(at + 1),
        None => (configuration.toml.as_str(), ""),
    };
    head.lines().map(renamed).collect::<String>() + tables
}

impl Page for ConfigurationPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Study(answer) => match read(answer) {
                Ok(study) => self.study = Some(study),
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            Msg::Info(answer) => self.info = read(answer).ok(),
            Msg::Configuration(answer) => match read(answer) {
                Ok(configuration) => return self.configuration_arrived(configuration),
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            Msg::Typed(value) => {
                value.text().clone_into(&mut self.text);
                (self.confirming, self.stored) = (false, false);
                let guard = Command::GuardLeaving(self.given.as_ref() != Some(&self.text));
                let wake =
                    Command::Wake { timer: "pause", after_ms: PAUSE_MS, message: Msg::Check };
                return vec![guard, wake];
            }
            Msg::Check => return vec![self.check()],
            Msg::Checked(answer) => match read(answer) {
                Ok(checked) => {
                    self.checked = Some(checked);
                    self.trouble = None;
                }
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            // What is new changes nothing for anybody.
            Msg::Store if self.slug.is_none() => return self.store(),
            Msg::Store => self.confirming = true,
            Msg::GoOn => self.confirming = false,
            Msg::Confirm => return self.store(),
            Msg::Stored(answer) => match read::<Configuration>(answer) {
                Ok(stored) => {
                    let is_new = self.slug.is_none();
                    let mut commands = vec![Command::GuardLeaving(false)];
                    if is_new {
                        commands.push(Command::Visit(Tab::Configuration.address(&stored.study)));
                        return commands;
                    }
                    // The text stays as it was written, with its comments, until the page is left.
                    self.given = Some(self.text.clone());
                    (self.confirming, self.stored) = (false, true);
                    commands.push(study::ask(&stored.study, Msg::Study));
                    self.base = Some(stored);
                    commands.push(self.check());
                    return commands;
                }
                Err(failure) => {
                    self.confirming = false;
                    self.overtaken = failure.code == "changed";
                    self.trouble = Some(failure.sentence);
                }
            },
            Msg::Set(status) => {
                let Some(slug) = &self.slug else { return Vec::new() };
                let ask = Request::get("status", routes::admin_status(slug), Msg::StatusSet);
                let body = Some(json::write(&NewStatus { status }));
                return vec![Command::Send(Request { method: "PUT", body, ..ask })];
            }
            Msg::StatusSet(answer) => match read::<Configuration>(answer) {
                Ok(_) => return self.update(Msg::Reload, 0.0),
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            Msg::Reload => {
                self.trouble = None;
                return self.slug.as_deref().map_or_else(Vec::new, |slug| self.ask(slug));
            }
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        let is_there = self.given.is_some() && (self.slug.is_none() || self.study.is_some());
        if !is_there {
            return match &self.trouble {
                Some(why) => parts::stuck("No configuration to show", why),
                None => parts::loading(),
            };
        }
        let page = el("main").class("page");
        let page = match &self.study {
            Some(study) => page
                .children(study::head(study, Tab::Configuration, self.copy(study)))
                .child(self.status(study)),
            None => page.child(parts::heading("New study")),
        };
        page.children(self.trouble.as_deref().map(|why| alert("trouble", why)))
            .children(self.overtaken.then(|| {
                button("reload", Msg::Reload).text("Show the present configuration instead")
            }))
            .child(self.editor())
            .children(self.checked.as_ref().and_then(outcome::picture))
    }

    fn title(&self) -> String {
        match (&self.study, &self.slug) {
            (Some(study), _) => format!("{}: configuration", study.title),
            (None, Some(slug)) => format!("{slug}: configuration"),
            (None, None) => "New study".to_owned(),
        }
    }
}

impl ConfigurationPage {
    fn copy(&self, study: &StudySummary) -> Option<Node> {
        let link = el("a").class("button").attr("href", format!("/lab/new?from={}", study.slug));
        self.may_manage.then(|| link.test_id("copy").text("Duplicate"))
    }

    /// Whether people can take part, how to change that, and the links for them.
    fn status(&self, study: &StudySummary) -> Node {
        let words = match study.status {
            Status::Open => "Everybody with a link can take part.",
            Status::Closed => "Nobody new can take part. Participants who have begun can finish.",
            Status::Archived => "Nothing more is stored. The study can still be looked at.",
        };
        let choice = |status: Status, words: &str| {
            // Afterwards the present text is shown, so nothing that is being written is lost.
            button(&format!("set-{}", status.word()), Msg::Set(status))
                .attr_if(self.is_changed(), "disabled", "")
                .text(words)
        };
        let choices = match study.status {
            Status::Open => vec![choice(Status::Closed, "Close")],
            Status::Closed => {
                vec![choice(Status::Open, "Open again"), choice(Status::Archived, "Archive")]
            }
            Status::Archived => vec![choice(Status::Closed, "Take out of the archive")],
        };
        let choices = choices.into_iter().filter(|_| self.may_manage);
        let section = el("section").class("taking-part").child(el("h2").text("Taking part")).child(
            el("div")
                .class("actions")
                .child(el("p").test_id("status-words").text(words))
                .children(choices),
        );
        let is_open = study.status == Status::Open;
        let links = self.info.as_ref().filter(|_| is_open);
        section.children(links.map(|info| links::links(&self.origin, info)))
    }

    /// The text, what the server says of it, and how it is stored.
    fn editor(&self) -> Node {
        let area = el("textarea")
            .key(self.givings)
            .attrs(&[("id", "toml"), ("name", "toml"), ("spellcheck", "false"), ("rows", "24")])
            .attr_if(!self.may_manage, "readonly", "")
            .test_id("toml")
            .on_input(Msg::Typed)
            .text(self.given.clone().unwrap_or_default());
        let about = el("p").class("quiet").text(
            "What the file does not say is as in the paper. The study guide (docs/study.md) has \
             every field with its unit, default and range. Comments are not kept.",
        );
        el("section")
            .child(el("h2").child(el("label").attr("for", "toml").text("Study file (TOML)")))
            .child(about)
            .child(
                el("div")
                    .class("editor")
                    .child(area)
                    .child(el("div").class("said").children(self.said())),
            )
    }

    fn said(&self) -> Vec<Node> {
        let Some(checked) = &self.checked else {
            return vec![el("p").class("quiet").attr("role", "status").text("Checking…")];
        };
        let mut said = outcome::remarks(checked);
        if self.stored && !self.is_changed() {
            let words = "Stored. New participants get this configuration.";
            said.push(el("p").class("saved").attr("role", "status").test_id("stored").text(words));
        }
        if !self.may_manage || !self.is_changed() {
            return said;
        }
        let is_sound = checked.complaint.is_none();
        let store = |words: &str| {
            button("store", Msg::Store)
                .class("primary")
                .attr_if(!is_sound, "disabled", "")
                .text(words)
        };
        if self.slug.is_none() {
            said.push(store("Make this study"));
            return said;
        }
        said.extend(outcome::changes(checked));
        let is_same = checked.changes.is_empty();
        if self.confirming && is_sound {
            let participants = self.base.as_ref().map_or(0, |base| base.participants);
            let words = match participants {
                0 => "Nobody has begun yet.".to_owned(),
                1 => "1 participant has begun and keeps the configuration of that time; new \
                      participants get this one."
                    .to_owned(),
                many => format!(
                    "{many} participants have begun and keep the configuration of that time; new \
                     participants get this one."
                ),
            };
            said.push(
                el("div")
                    .class("confirm")
                    .child(el("p").test_id("keeps").text(words))
                    .child(
                        button("confirm", Msg::Confirm)
                            .class("primary")
                            .focus()
                            .text("Use for new participants"),
                    )
                    .child(button("go-on", Msg::GoOn).class("plain").text("Go on writing")),
            );
        } else if !is_same || !is_sound {
            said.push(store("Store…"));
        }
        said
    }
}
