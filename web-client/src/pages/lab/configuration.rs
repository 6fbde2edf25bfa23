//! The page of a study's configuration. It shows the study as a form or as a file, and the study is
//! checked while the user edits it. It also shows who can take part, and the links for
//! participants.
//!
//! The text of the study file is the draft. The form shows the draft, and the server converts input
//! in the form back to text.

mod document;
mod edit;
mod settings;
mod fields;
mod questions;
mod robots;
mod form;
mod editor;
mod links;
mod outcome;
mod taking_part;
mod versions;

use self::edit::Edit;
use self::editor::{Editor, Mode};
use super::study::{self, Tab};
use super::visit::Visit;
use crate::form::FieldValue;
use crate::json;
use crate::pages::parts::{self, alert};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, Configuration, NewStatus, StudyInfo, StudySummary, routes};
use sidestep::study::Status;

type Node = view::Node<Msg>;

/// The page of a study's configuration, or of a new study.
pub(super) struct ConfigurationPage {
    /// The study's slug; `None` for a new study.
    slug: Option<String>,
    may_manage: bool,
    /// Scheme and host of the server.
    origin: String,
    study: Option<StudySummary>,
    info: Option<StudyInfo>,
    /// The stored configuration; `None` before it is loaded, and for a new study.
    base: Option<Configuration>,
    editor: Editor,
    /// Whether the page shows the differences and asks the user to confirm that the draft is
    /// stored.
    confirming: bool,
    /// Whether the study is incomplete and the page asks the user to confirm that it is opened.
    opening: bool,
    /// Whether the draft was just stored.
    stored: bool,
    /// Whether another user has stored a different configuration in the meantime.
    overtaken: bool,
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// The server described the study.
    Study(Answer),
    /// The server sent the study's information for participants.
    Info(Answer),
    /// The server sent the configuration.
    Configuration(Answer),
    /// Show the form or the text.
    Show(Mode),
    /// Show the texts of this language in the form.
    Language(String),
    /// A field of the form has changed.
    Edit(Edit),
    /// Apply this edit, rebuild the form with other fields, and focus this control.
    Rebuild(Edit, String),
    /// The text has changed.
    Typed(FieldValue),
    /// The user has stopped typing for long enough, so check the draft.
    Check,
    /// The server checked the draft.
    Checked(Answer),
    /// Store the draft.
    Store,
    /// Cancel the confirmation and continue to edit.
    GoOn,
    /// The user has confirmed the differences.
    Confirm,
    /// The server stored the draft, or refused.
    Stored(Answer),
    /// Open, close or archive the study.
    Set(Status),
    /// The server has changed the status, or refused.
    StatusSet(Answer),
    /// Replace the draft by the stored configuration.
    Reload,
}

/// Delay after the last input before the draft is checked (ms).
const PAUSE_MS: f64 = 350.0;

/// Template for a new study.
const TEMPLATE: &str = "\
slug = \"my-study\"
title = \"My study\"
# Nobody can take part yet: try and rehearse the study, then open it.
status = \"closed\"

# Defaults are those of the paper, such as
# six scenes of familiarisation, three of practice, fifty tasks.
# [[phases]]
# phase = \"task\"
# scenes = 20

[consent]
investigator = \"\"
contact = \"\"
";

impl ConfigurationPage {
    /// Creates the page for `/lab/studies/SLUG/configuration` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let mut page = Self::blank(visit);
        page.slug = Some(visit.id.to_owned());
        let commands = page.ask(visit.id);
        (page, commands)
    }

    /// Creates the page for `/lab/new`, or for `/lab/new?from=SLUG` (a copy), and its first
    /// commands.
    pub(super) fn open_new(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let mut page = Self::blank(visit);
        let commands = match visit.address.parameter("from") {
            Some(slug) => {
                let url = routes::admin_configuration(slug);
                vec![Command::Send(Request::get("configuration", url, Msg::Configuration))]
            }
            None => {
                page.editor.begin_new(TEMPLATE.to_owned());
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
            editor: Editor::new(),
            confirming: false,
            opening: false,
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

    /// Starts a draft with this text.
    fn begin(&mut self, text: String) {
        self.editor.begin(text);
        (self.confirming, self.overtaken, self.stored) = (false, false, false);
    }

    /// Whether there is something to store.
    fn is_changed(&self) -> bool {
        self.slug.is_none() || self.editor.is_changed()
    }

    fn base_hash(&self) -> Option<String> {
        self.base.as_ref().map(|base| base.hash.clone())
    }

    fn check(&mut self) -> Command<Msg> {
        let (url, body) = self.editor.check(self.base_hash());
        let ask = Request::get("check", url, Msg::Checked);
        Command::Send(Request { method: "POST", body: Some(body), ..ask })
    }

    /// Handles input: schedules a check of the draft for when the user stops typing.
    fn entered(&mut self) -> Commands<Msg> {
        (self.confirming, self.stored) = (false, false);
        let wake = Command::Wake { timer: "pause", after_ms: PAUSE_MS, message: Msg::Check };
        vec![Command::GuardLeaving(self.editor.is_changed()), wake]
    }

    fn store(&mut self) -> Commands<Msg> {
        self.trouble = None;
        let (method, url) = match &self.slug {
            Some(slug) => ("PUT", routes::admin_configuration(slug)),
            None => ("POST", routes::ADMIN_STUDIES.to_owned()),
        };
        let ask = Request::get("store", url, Msg::Stored);
        let body = Some(self.editor.draft(self.base_hash()));
        vec![Command::Send(Request { method, body, ..ask })]
    }

    fn configuration_arrived(&mut self, found: Configuration) -> Commands<Msg> {
        if self.slug.is_some() {
            self.begin(found.toml.clone());
            self.base = Some(found);
            return vec![Command::GuardLeaving(false), self.check()];
        }
        // A copy needs a slug of its own.
        self.editor.begin_new(copy_of(&found));
        vec![self.check()]
    }
}

/// The text of a copy, with another slug and the status closed.
fn copy_of(configuration: &Configuration) -> String {
    let slug = &configuration.study;
    let renamed = |line: &str| match line.split_once(" = ") {
        Some(("slug", _)) => format!("slug = \"{slug}-copy\"\nstatus = \"closed\"\n"),
        Some(("status", _)) => String::new(),
        _ => format!("{line}\n"),
    };
    // Only the lines before the first table are settings of the study itself.
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
            Msg::Show(mode) => self.editor.show(mode),
            Msg::Language(language) => self.editor.show_language(language),
            Msg::Edit(edit) => {
                self.editor.edit(edit);
                return self.entered();
            }
            Msg::Rebuild(edit, focus) => {
                self.editor.rebuild(edit, focus);
                return self.entered();
            }
            Msg::Typed(value) => {
                self.editor.type_text(value.text());
                return self.entered();
            }
            Msg::Check => return vec![self.check()],
            Msg::Checked(answer) => match read(answer) {
                Ok(checked) => {
                    self.trouble = None;
                    self.editor.take(checked);
                    return vec![Command::GuardLeaving(self.editor.is_changed())];
                }
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            // A new study has no differences to confirm, but storing it may open it to
            // participants.
            Msg::Store if self.slug.is_none() => {
                if !self.opening && self.editor.opens() && !self.editor.warnings().is_empty() {
                    self.opening = true;
                } else {
                    self.opening = false;
                    return self.store();
                }
            }
            Msg::Store => self.confirming = true,
            Msg::GoOn => (self.confirming, self.opening) = (false, false),
            Msg::Confirm => return self.store(),
            Msg::Stored(answer) => match read::<Configuration>(answer) {
                Ok(stored) => {
                    let is_new = self.slug.is_none();
                    let mut commands = vec![Command::GuardLeaving(false)];
                    if is_new {
                        commands.push(Command::Visit(Tab::Configuration.address(&stored.study)));
                        return commands;
                    }
                    // Until the user leaves the page, the text stays exactly as the user wrote it,
                    // including comments.
                    self.editor.stored();
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
            Msg::Set(Status::Open) if !self.opening && !self.editor.warnings().is_empty() => {
                self.opening = true;
            }
            Msg::Set(status) => {
                self.opening = false;
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
        if self.slug.is_none() && !self.may_manage {
            let why = "Your key may not create studies. Ask for a key with the right to manage.";
            return parts::stuck("No new study", why);
        }
        let is_there = self.editor.has_begun() && (self.slug.is_none() || self.study.is_some());
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
                .child(taking_part::taking_part(self, study)),
            None => page
                .child(parts::heading("New study"))
                .children(taking_part::opening(self, Msg::Store)),
        };
        page.children(self.trouble.as_deref().map(|why| alert("trouble", why)))
            .child(self.configuration())
            .children(self.editor.picture())
            .children(self.base.as_ref().map(|base| versions::versions(&base.versions)))
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

    /// The study as a form or as text, with the server's remarks and the buttons to store the
    /// draft.
    fn configuration(&self) -> Node {
        let editor = el("div")
            .class("editor")
            .child(self.editor.view(self.slug.is_none(), self.may_manage))
            .child(el("div").class("said").children(outcome::said(self)));
        el("section").child(el("h2").text("Configuration")).child(self.editor.modes()).child(editor)
    }
}
