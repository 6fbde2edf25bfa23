//! One participant: a timeline of the trials as small pictures, quality flags, answers, notes by
//! experimenters, exclusion with a reason, and deletion on request.

mod pictures;

use super::participants::table::{looks, stage_words};
use super::study::{self, Tab};
use super::visit::Visit;
use crate::form::Form;
use crate::json;
use crate::pages::parts::{self, alert, button, fact};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, NewExclusion, NewNote, Note, ParticipantDetail, routes};
use sidestep::trial::Phase;

type Node = view::Node<Msg>;

/// The page of a participant.
pub(super) struct Profile {
    id: String,
    access: Access,
    found: Option<ParticipantDetail>,
    /// Number of changes sent. The forms are reset after each change.
    writings: u32,
    /// Whether the page asks the user to confirm the deletion of the data.
    deleting: bool,
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server described the participant.
    Found(Answer),
    /// Add a note.
    AddNote(Form),
    /// Delete a note.
    DeleteNote(i64),
    /// Exclude the participant, with a reason.
    Exclude(Form),
    /// Include the participant in analyses again.
    Include,
    /// Ask for confirmation before the participant's data are deleted, or stop asking.
    AskToDelete(bool),
    /// The user has confirmed the deletion.
    Delete,
    /// The server has made the change, or refused.
    Done(Answer),
}

impl Profile {
    /// Creates the page for `/lab/participants/ID` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            id: visit.id.to_owned(),
            access: visit.session.access,
            found: None,
            writings: 0,
            deleting: false,
            trouble: None,
        };
        let commands = vec![page.ask(), study::follow(|| Msg::Changed)];
        (page, commands)
    }

    fn ask(&self) -> Command<Msg> {
        let url = routes::admin_participant(&self.id);
        Command::Send(Request::get("participant", url, Msg::Found))
    }

    fn change(&self, method: &'static str, url: String, body: Option<String>) -> Commands<Msg> {
        let ask = Request::get("change", url, Msg::Done);
        vec![Command::Send(Request { method, body, ..ask })]
    }

    fn may_manage(&self) -> bool {
        self.access >= Access::Manage
    }
}

impl Page for Profile {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Changed => return vec![self.ask()],
            Msg::Found(answer) => match read(answer) {
                Ok(found) => self.found = Some(found),
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            Msg::AddNote(form) => {
                let text = form.text("text").trim().to_owned();
                let body = Some(json::write(&NewNote { text }));
                return self.change("POST", routes::admin_notes(&self.id), body);
            }
            Msg::DeleteNote(note) => {
                let url = routes::admin_note(&self.id, &note.to_string());
                return self.change("DELETE", url, None);
            }
            Msg::Exclude(form) => {
                let reason = form.text("reason").trim().to_owned();
                let body = Some(json::write(&NewExclusion { reason }));
                return self.change("PUT", routes::admin_exclusion(&self.id), body);
            }
            Msg::Include => {
                return self.change("DELETE", routes::admin_exclusion(&self.id), None);
            }
            Msg::AskToDelete(on) => self.deleting = on,
            Msg::Delete => {
                return self.change("DELETE", routes::admin_participant(&self.id), None);
            }
            Msg::Done(answer) => match answer {
                Ok(_) => {
                    self.writings += 1;
                    (self.deleting, self.trouble) = (false, None);
                    return vec![self.ask()];
                }
                Err(failure) => self.trouble = Some(failure.sentence),
            },
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        let found = match (&self.found, &self.trouble) {
            (Some(found), _) => found,
            (None, Some(why)) => return parts::stuck("No participant to show", why),
            (None, None) => return parts::loading(),
        };
        el("main")
            .class("page")
            .child(head(found))
            .children(self.trouble.as_deref().map(|why| alert("trouble", why)))
            .children(self.exclusion(found))
            .child(self.facts(found))
            .child(timeline(found))
            .child(self.notes(found))
            .children(self.deletion(found))
    }

    fn title(&self) -> String {
        self.found.as_ref().map_or_else(|| "Participant".to_owned(), name)
    }
}

/// The name of the participant in the laboratory.
fn name(found: &ParticipantDetail) -> String {
    let kind = if found.summary.pilot { "Test run" } else { "Participant" };
    format!("{kind} {}", found.summary.number)
}

fn head(found: &ParticipantDetail) -> Node {
    let back = el("a").attr("href", Tab::Participants.address(&found.study));
    let chip = |words: &str| el("span").class("chip").text(words);
    let excluded = found
        .exclusion
        .as_ref()
        .map(|_| el("span").class("chip look").test_id("excluded").text("excluded"));
    el("div")
        .child(el("p").class("quiet").child(back.text(format!("Study {}", found.study))))
        .child(
            el("div")
                .class("title")
                .child(parts::heading(&name(found)))
                .child(chip(stage_words(found.summary.stage)).test_id("stage"))
                .children(excluded),
        )
        .children(parts::synthetic(found.synthetic))
        .child(el("p").children(looks(&found.summary.quality)))
}

/// The version of the study with which the participant enrolled, named as in the table of versions.
fn configuration(found: &ParticipantDetail) -> Node {
    let short = &found.configuration[..found.configuration.len().min(8)];
    let words = match found.configuration_number {
        Some(number) => format!("version {number}, labelled “{}”", found.configuration_label),
        None => format!("none of the study’s versions ({short})"),
    };
    let page = Tab::Configuration.address(&found.study);
    let link = el("a").attr("href", page).text(words);
    let link = link.attr("title", format!("SHA-256 {}", found.configuration));
    el("div").child(el("dt").text("Configuration")).child(el("dd").child(link))
}

/// The trials in the order of the plan, with links to their replays.
fn timeline(found: &ParticipantDetail) -> Node {
    let section = el("section").child(el("h2").text("Trials"));
    if found.trials.is_empty() {
        let why =
            if found.data_deleted { "The data were deleted." } else { "No trial is stored yet." };
        return section.child(el("p").class("quiet").test_id("no-trials").text(why));
    }
    let trials = found.trials.iter().map(|trial| pictures::card(trial, found.danger_radius_m));
    let explorer = format!("/lab/explorer/{}", found.summary.participant_id);
    let has_tasks = found.trials.iter().any(|trial| trial.summary.phase == Phase::Task);
    let link = has_tasks.then(|| {
        let words = "Explore predicted sets";
        el("p").child(el("a").attr("href", explorer).test_id("explorer-link").text(words))
    });
    section
        .children(link)
        .child(pictures::legend())
        .child(el("ol").class("timeline-of-trials").test_id("timeline").children(trials))
}

impl Profile {
    fn facts(&self, found: &ParticipantDetail) -> Node {
        let person = &found.summary;
        let moment = |name: &str, ms: i64| {
            el("div").child(el("dt").text(name)).child(el("dd").child(el("time").moment(ms)))
        };
        let planned = person.planned.max(person.stored);
        let mut facts = vec![
            fact("Scenes stored", format!("{} of {planned}", person.stored)),
            moment("Enrolled", person.enrolled_at_ms),
            moment("Last seen", person.last_seen_at_ms),
        ];
        facts.extend(found.withdrawn_at_ms.map(|ms| moment("Withdrew", ms)));
        let check = match (person.comprehension_attempts, person.understood) {
            (0, _) => None,
            (1, true) => Some("passed at the first attempt".to_owned()),
            (attempts, true) => Some(format!("passed at attempt {attempts}")),
            (1, false) => Some("not passed, 1 attempt".to_owned()),
            (attempts, false) => Some(format!("not passed, {attempts} attempts")),
        };
        facts.extend(check.map(|words| fact("Check of understanding", words)));
        facts.extend(person.external_id.as_ref().map(|id| fact("External id", id)));
        facts.extend(person.completion_code.as_ref().map(|code| fact("Completion code", code)));
        facts.push(configuration(found));
        facts.extend(found.parameters.iter().map(|(name, value)| fact(name, value)));
        let answer = |value: &serde_json::Value| match value {
            serde_json::Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let answers = found.answers.iter().map(|(name, value)| fact(name, answer(value)));
        let answers = (!found.answers.is_empty()).then(|| {
            el("div")
                .child(el("h2").text("Answers"))
                .child(el("dl").class("facts-of-person").test_id("answers").children(answers))
        });
        el("section")
            .class("about-person")
            .child(
                el("div")
                    .child(el("h2").text("About"))
                    .child(el("dl").class("facts-of-person").test_id("about").children(facts)),
            )
            .children(answers)
    }

    /// The reason why analyses leave the participant out, or the form to exclude the participant.
    fn exclusion(&self, found: &ParticipantDetail) -> Option<Node> {
        if let Some(exclusion) = &found.exclusion {
            let by = el("p")
                .class("quiet")
                .text(format!("{}, ", exclusion.who))
                .child(el("time").moment(exclusion.at_ms));
            let include = button("include", Msg::Include).text("Include again");
            return Some(
                el("section")
                    .class("excluded")
                    .child(
                        el("p").test_id("reason").text(format!(
                            "Analyses leave this participant out: {}",
                            exclusion.reason
                        )),
                    )
                    .child(by)
                    .children(self.may_manage().then_some(include)),
            );
        }
        let is_possible = self.may_manage() && !found.summary.pilot && !found.data_deleted;
        is_possible.then(|| {
            let field = el("input")
                .attrs(&[("name", "reason"), ("required", ""), ("maxlength", "200")])
                .attrs(&[
                    ("aria-label", "Reason"),
                    ("placeholder", "Reason"),
                    ("autocomplete", "off"),
                ])
                .test_id("reason-field");
            let submit = el("button").attr("type", "submit").test_id("exclude").text("Exclude");
            el("details")
                .class("exclude")
                .key(self.writings)
                .child(el("summary").test_id("exclude-open").text("Exclude from analyses…"))
                .child(el("p").class("quiet").text(
                    "The data stay, are exported with the reason, and can be included again. \
                     Reports name the reason.",
                ))
                .child(
                    el("form")
                        .class("row")
                        .on_submit(Msg::Exclude)
                        .test_id("exclude-form")
                        .child(field)
                        .child(submit),
                )
        })
    }

    fn notes(&self, found: &ParticipantDetail) -> Node {
        let note = |note: &Note| {
            let delete = button(&format!("delete-note-{}", note.id), Msg::DeleteNote(note.id))
                .class("danger")
                .attr("aria-label", "Delete this note")
                .text("Delete");
            let by = el("p")
                .class("quiet")
                .text(format!("{}, ", note.who))
                .child(el("time").moment(note.at_ms))
                .children(self.may_manage().then_some(delete));
            el("li").key(note.id).child(el("p").class("text").text(&note.text)).child(by)
        };
        let form = (self.may_manage() && !found.data_deleted).then(|| {
            el("form")
                .class("new-note")
                .key(self.writings)
                .on_submit(Msg::AddNote)
                .test_id("new-note")
                .child(
                    el("textarea")
                        .attrs(&[("name", "text"), ("required", ""), ("maxlength", "2000")])
                        .attrs(&[("rows", "3"), ("aria-label", "A note")])
                        .test_id("note"),
                )
                .child(el("button").attr("type", "submit").test_id("add-note").text("Add note"))
        });
        let none = found.notes.is_empty().then(|| el("p").class("quiet").text("No notes yet."));
        el("section")
            .child(el("h2").text("Notes"))
            .children(none)
            .child(el("ul").class("notes").test_id("notes").children(found.notes.iter().map(note)))
            .children(form)
    }

    /// The section for deleting the data of a participant who asks the researchers to do so.
    fn deletion(&self, found: &ParticipantDetail) -> Option<Node> {
        if !self.may_manage() || found.data_deleted {
            return None;
        }
        let section = el("section").child(el("h2").text("Delete on request"));
        Some(if self.deleting {
            section
                .child(el("p").text(
                    "All trials, answers, notes and identifiers of this participant will be \
                     deleted, with analyses that used them. Only the number stays. This cannot \
                     be undone.",
                ))
                .child(
                    el("p")
                        .class("sure")
                        .child(
                            button("sure", Msg::Delete)
                                .class("danger")
                                .focus()
                                .text("Delete for ever"),
                        )
                        .child(button("keep", Msg::AskToDelete(false)).class("plain").text("Keep")),
                )
        } else {
            section.child(el("p").child(
                button("delete", Msg::AskToDelete(true)).class("danger").text("Delete the data…"),
            ))
        })
    }
}
