//! The draft of a study, as a form and as the text of a study file.
//!
//! The text is the draft. The form shows the text, and the server converts input in the form back
//! to text.

use super::Msg;
use super::document::set;
use super::edit::Edit;
use super::fields::Fields;
use super::form::{Form, offered, picture};
use crate::json;
use crate::pages::parts::button;
use crate::view::{self, el};
use serde_json::Value;
use sidestep::api::{Draft, DraftChecked, FormDraft, Remark, routes};
use sidestep::study::Status;
use std::cell::RefCell;

type Node = view::Node<Msg>;

/// How the draft is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::pages::lab) enum Mode {
    /// As the fields of a form.
    Form,
    /// As the text of a study file.
    Text,
}

/// A draft that the user is editing.
pub(super) struct Editor {
    /// The initial text of the draft; `None` before it is loaded.
    begun: Option<String>,
    text: String,
    /// The text last put into the text area. Typing does not change it.
    given: String,
    /// The draft as a form; `None` until the server has parsed the text.
    form: Option<FormState>,
    /// Counts how often the form was filled. Its fields are created anew each time.
    givings: u32,
    /// Counts how often the text area was filled. It is not filled again when text typed into it
    /// updates the form.
    text_givings: u32,
    mode: Mode,
    /// Whether the slug is derived from the title. This ends when the user enters a slug.
    names_itself: bool,
    /// Numbers of edits: so far (`entered`), before the last request to the server (`asked`), and
    /// before the last answered request (`answered`).
    entered: u32,
    asked: u32,
    answered: u32,
    /// Top-level fields of the study that had errors. Their sections stay open.
    opened: Vec<String>,
    /// The server's last check of the draft.
    pub(super) checked: Option<DraftChecked>,
}

/// Content of the form.
struct FormState {
    /// The study that filled the form's fields.
    given: Value,
    /// The study including the user's input.
    study: Value,
    /// Whether the form contains input that is not in the text yet.
    is_ahead: bool,
    /// The language whose texts are shown.
    language: String,
    /// The name of the control to focus.
    focus: String,
}

impl Editor {
    /// Creates an editor without a draft.
    pub(super) fn new() -> Self {
        Self {
            begun: None,
            text: String::new(),
            given: String::new(),
            form: None,
            givings: 0,
            text_givings: 0,
            mode: Mode::Form,
            names_itself: false,
            entered: 0,
            asked: 0,
            answered: 0,
            opened: Vec::new(),
            checked: None,
        }
    }

    /// Starts a draft with this text.
    pub(super) fn begin(&mut self, text: String) {
        self.text.clone_from(&text);
        self.begun = Some(text);
        (self.form, self.checked) = (None, None);
        self.show_text();
    }

    /// Starts the draft of a new study.
    pub(super) fn begin_new(&mut self, text: String) {
        self.begin(text);
        self.names_itself = true;
    }

    pub(super) fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    /// Marks the current draft as stored.
    pub(super) fn stored(&mut self) {
        self.begun = Some(self.text.clone());
    }

    /// Puts the draft into the text area.
    fn show_text(&mut self) {
        self.given.clone_from(&self.text);
        self.givings += 1;
        self.text_givings += 1;
    }

    /// Whether the draft differs, or may differ, from the initial text.
    pub(super) fn is_changed(&self) -> bool {
        let is_ahead = || self.form.as_ref().is_some_and(|form| form.is_ahead);
        let is_other = || self.begun.as_ref() != Some(&self.text);
        self.has_begun() && (is_other() || is_ahead() || !self.is_current())
    }

    /// Warnings about missing parts of a valid study.
    pub(super) fn warnings(&self) -> &[Remark] {
        self.checked.as_ref().map_or(&[], |checked| &checked.warnings)
    }

    /// Whether storing the draft opens the study to participants.
    pub(super) fn opens(&self) -> bool {
        self.form.as_ref().is_some_and(|form| form.study["status"] == Status::Open.word())
    }

    /// Whether `checked` refers to the current draft.
    pub(super) fn is_current(&self) -> bool {
        self.answered == self.entered
    }

    /// The request body that stores the draft.
    pub(super) fn draft(&self, base: Option<String>) -> String {
        json::write(&Draft { toml: self.text.clone(), base })
    }

    /// The URL and request body that check the draft.
    pub(super) fn check(&mut self, base: Option<String>) -> (&'static str, String) {
        self.asked = self.entered;
        match self.form.as_ref().filter(|form| form.is_ahead) {
            Some(form) => {
                let config = form.study.clone();
                (routes::ADMIN_FORM_DRAFTS, json::write(&FormDraft { config, base }))
            }
            None => (routes::ADMIN_DRAFTS, self.draft(base)),
        }
    }

    /// Processes the server's check of the draft. Only the answer to the last request arrives here.
    pub(super) fn take(&mut self, mut checked: DraftChecked) {
        self.answered = self.asked;
        let is_current = self.is_current();
        if let Some(text) = checked.toml.take() {
            self.text = text;
            if let Some(form) = self.form.as_mut().filter(|_| is_current) {
                form.is_ahead = false;
            }
            if self.mode == Mode::Text {
                self.show_text();
            }
        } else if is_current && !self.form.as_ref().is_some_and(|form| form.is_ahead) {
            match checked.config.take() {
                // If the values are the same, the form keeps its fields.
                Some(config) if self.form.as_ref().is_some_and(|form| form.study == config) => {}
                Some(config) => self.give_form(config),
                None => self.form = None,
            }
        }
        let wrong = checked.complaint.as_ref().and_then(|complaint| complaint.field.as_deref());
        let section = wrong.and_then(|field| field.split(['.', '[']).next());
        self.opened.extend(section.map(str::to_owned));
        self.opened.dedup();
        self.checked = Some(checked);
    }

    fn give_form(&mut self, study: Value) {
        let language = self.form.take().map(|form| form.language).unwrap_or_default();
        let (given, focus) = (study.clone(), String::new());
        self.form = Some(FormState { given, study, is_ahead: false, language, focus });
        self.givings += 1;
    }

    /// Switches to the form or to the text.
    pub(super) fn show(&mut self, mode: Mode) {
        self.mode = mode;
        self.show_text();
        if let Some(form) = &mut self.form {
            form.given.clone_from(&form.study);
            form.focus.clear();
        }
    }

    /// Shows the texts of this language in the form.
    pub(super) fn show_language(&mut self, language: String) {
        if let Some(form) = &mut self.form {
            form.focus = format!("language-{language}");
            form.language = language;
            form.given.clone_from(&form.study);
            self.givings += 1;
        }
    }

    /// Handles input in a field of the form.
    pub(super) fn edit(&mut self, edit: Edit) {
        if let Some(form) = &mut self.form {
            match &edit {
                Edit::Set(path, _) if path == "slug" => self.names_itself = false,
                Edit::Set(path, title) if path == "title" && self.names_itself => {
                    let name = name_in_addresses(title.as_str().unwrap_or_default());
                    // The user did not type the slug, so its control must be refilled from `given`.
                    for study in [&mut form.study, &mut form.given] {
                        name.iter().for_each(|name| set(study, "slug", name.as_str().into()));
                    }
                }
                _ => {}
            }
            edit.apply(&mut form.study);
            form.is_ahead = true;
            self.entered += 1;
        }
    }

    /// Handles an edit that changes which fields the form has, and focuses the control with this
    /// name.
    pub(super) fn rebuild(&mut self, edit: Edit, focus: String) {
        self.edit(edit);
        if let Some(form) = &mut self.form {
            form.given.clone_from(&form.study);
            form.focus = focus;
            self.givings += 1;
        }
    }

    /// Handles input in the text area.
    pub(super) fn type_text(&mut self, text: &str) {
        text.clone_into(&mut self.text);
        self.names_itself = false;
        self.entered += 1;
        if let Some(form) = &mut self.form {
            form.is_ahead = false;
        }
    }

    /// The buttons that switch between form and text.
    pub(super) fn modes(&self) -> Node {
        let mode = |mode: Mode, name: &str, words: &str| {
            button(&format!("as-{name}"), Msg::Show(mode))
                .class("choice")
                .attr("aria-pressed", self.mode == mode)
                .text(words)
        };
        el("div")
            .class("choices")
            .attrs(&[("role", "group"), ("aria-label", "How the configuration is shown")])
            .child(mode(Mode::Form, "form", "Form"))
            .child(mode(Mode::Text, "text", "Study file (TOML)"))
    }

    /// The form or the text area.
    pub(super) fn view(&self, is_new: bool, may_manage: bool) -> Node {
        match self.mode {
            Mode::Form => self.form(is_new, may_manage),
            Mode::Text => self.text_area(may_manage),
        }
    }

    fn form(&self, is_new: bool, may_manage: bool) -> Node {
        if let Some(form) = self.form_of(is_new, may_manage) {
            return form.view();
        }
        let words = if self.checked.is_some() {
            "The form appears when the study file can be read: correct its text."
        } else {
            "Loading…"
        };
        el("p").class("quiet").test_id("no-form").text(words)
    }

    fn form_of(&self, is_new: bool, may_manage: bool) -> Option<Form<'_>> {
        let form = self.form.as_ref()?;
        let checked = self.checked.as_ref();
        let languages = checked.map_or(&[][..], |checked| &checked.languages[..]);
        let offered = offered(&form.study, languages);
        let chosen = offered.iter().find(|tag| **tag == form.language).or(offered.first());
        let fields = Fields {
            given: &form.given,
            study: &form.study,
            complaint: checked.and_then(|checked| checked.complaint.as_ref()),
            language: chosen.copied().unwrap_or("en"),
            focus: &form.focus,
            may_manage,
            labels: RefCell::default(),
        };
        let picture = checked.and_then(picture);
        let (givings, opened) = (self.givings, &self.opened[..]);
        Some(Form { fields, languages, is_new, givings, opened, picture })
    }

    /// The labels of the form's controls, and the language of the texts in the form.
    pub(super) fn labels(&self, is_new: bool, may_manage: bool) -> (Vec<(String, String)>, &str) {
        self.form_of(is_new, may_manage).map_or_else(Default::default, |form| {
            form.view();
            (form.fields.labels.into_inner(), form.fields.language)
        })
    }

    fn text_area(&self, may_manage: bool) -> Node {
        let area = el("textarea")
            .key(self.text_givings)
            .attrs(&[("id", "toml"), ("name", "toml"), ("spellcheck", "false"), ("rows", "24")])
            .attr("aria-label", "Study file (TOML)")
            .attr_if(!may_manage, "readonly", "")
            .test_id("toml")
            .on_input(Msg::Typed)
            .text(&self.given);
        let about = el("p").class("quiet").text(
            "Settings missing from the file are as in the paper. The study guide (docs/study.md) has \
             every field with its unit, default and range. Comments are not kept.",
        );
        el("div").class("as-text").child(about).child(area)
    }

    /// The picture of the distribution of scenes. `None` in the form, which shows the picture
    /// beside the settings that determine the distribution.
    pub(super) fn picture(&self) -> Option<Node> {
        let picture = picture(self.checked.as_ref()?)?;
        let section = el("section").child(el("h2").text("Scenes")).child(picture);
        (self.mode == Mode::Text).then_some(section)
    }
}

/// Derives a slug (lower-case letters, digits and hyphens) from a title. Returns `None` if the
/// title has no suitable letters or digits.
fn name_in_addresses(title: &str) -> Option<String> {
    let mut name = String::new();
    for letter in title.chars().flat_map(char::to_lowercase) {
        match letter {
            'a'..='z' | '0'..='9' => name.push(letter),
            'ä' | 'æ' => name.push_str("ae"),
            'ö' | 'ø' => name.push_str("oe"),
            'ü' => name.push_str("ue"),
            'ß' => name.push_str("ss"),
            'à' | 'á' | 'â' | 'ã' | 'å' => name.push('a'),
            'è' | 'é' | 'ê' | 'ë' => name.push('e'),
            'ì' | 'í' | 'î' | 'ï' => name.push('i'),
            'ò' | 'ó' | 'ô' | 'õ' => name.push('o'),
            'ù' | 'ú' | 'û' => name.push('u'),
            'ñ' => name.push('n'),
            'ç' => name.push('c'),
            '\'' | '’' => {}
            _ if name.is_empty() || name.ends_with('-') => {}
            _ => name.push('-'),
        }
    }
    name.truncate(LONGEST_NAME);
    let name = name.trim_end_matches('-');
    (!name.is_empty()).then(|| name.to_owned())
}

/// Maximum number of characters in a slug.
const LONGEST_NAME: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_give_names_in_addresses() {
        for (title, name) in [
            ("Pilot of the spring, 2nd part", "pilot-of-the-spring-2nd-part"),
            ("  Größe & Señor’s Éclair! ", "groesse-senors-eclair"),
            ("C++", "c"),
        ] {
            assert_eq!(name_in_addresses(title).as_deref(), Some(name));
        }
        assert_eq!(name_in_addresses("避让机器人"), None);
        assert_eq!(name_in_addresses(""), None);
        let long = "word ".repeat(40);
        assert_eq!(name_in_addresses(&long).map(|name| name.len()), Some(64));
    }
}
