//! The first page of the laboratory: every study with its state, and what needs attention.

use super::data_check;
use super::study::{self, REHEARSAL, Tab};
use super::visit::Visit;
use crate::pages::parts::{self, alert, count, fact};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, StudySummary, routes};
use sidestep::study::Status;

type Node = view::Node<Msg>;

/// The page with the list of studies.
pub(super) struct Home {
    /// The studies, newest first. `None` before the server has answered.
    studies: Option<Vec<StudySummary>>,
    may_manage: bool,
    /// Error message about the stored data, if the server found errors.
    faults: Option<String>,
    /// The reason why the list is missing or outdated.
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server listed the studies.
    Listed(Answer),
    /// The server sent the result of its last data check.
    Checked(Answer),
}

impl Home {
    /// Creates the page and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let may_manage = visit.session.access >= Access::Manage;
        let page = Self { studies: None, may_manage, faults: None, trouble: None };
        (page, vec![ask(), data_check::ask(Msg::Checked), study::follow(|| Msg::Changed)])
    }
}

fn ask() -> Command<Msg> {
    Command::Send(Request::get("studies", routes::ADMIN_STUDIES, Msg::Listed))
}

impl Page for Home {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Changed => return vec![ask()],
            Msg::Listed(answer) => match read::<Vec<StudySummary>>(answer) {
                Ok(studies) => {
                    self.studies = Some(studies.into_iter().rev().collect());
                    self.trouble = None;
                }
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            // If the request failed, no errors are known. The self-check page shows the reason.
            Msg::Checked(answer) => {
                self.faults = read(answer).ok().as_ref().and_then(data_check::trouble);
            }
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        let studies = match (&self.studies, &self.trouble) {
            (Some(studies), _) => studies,
            (None, Some(why)) => return parts::stuck("No studies to show", why),
            (None, None) => return parts::loading(),
        };
        // Before anyone has taken part, there is nothing to monitor, so suggest first steps.
        let begins = studies.iter().all(|study| study.participants == 0);
        let newest = studies.iter().find(|study| !study.synthetic).filter(|_| begins);
        el("main")
            .class("page")
            .child(el("div").class("page-head").child(parts::heading("Studies")).children(
                self.may_manage.then(|| {
                    el("div").class("actions").child(
                        el("a")
                            .class("button")
                            .attr("href", "/lab/new")
                            .test_id("new-study")
                            .text("New study"),
                    )
                }),
            ))
            .children(self.trouble.as_deref().map(|why| alert("old", why)))
            .children(self.faults.as_deref().map(|what| alert("faults", what)))
            .children(newest.map(first_steps))
            .child(
                el("ul").class("studies").test_id("studies").children(
                    studies.iter().map(|study| el("li").key(&study.slug).child(card(study))),
                ),
            )
    }

    fn title(&self) -> String {
        "Studies".to_owned()
    }
}

/// A card for a study: its numbers, and what needs attention.
fn card(study: &StudySummary) -> Node {
    let name = if study.title.is_empty() { &study.slug } else { &study.title };
    let link = el("a")
        .attr("href", Tab::Participants.address(&study.slug))
        .test_id(&format!("study-{}", study.slug))
        .text(name);
    let head =
        el("div").class("title").child(el("h2").child(link)).child(study::status(study.status));
    let mut facts = vec![
        fact("Participants", study.participants.to_string()),
        fact("Complete", study.complete.to_string()),
        fact("Active now", study.active.to_string()),
        fact("Trials", study.trials.to_string()),
    ];
    if study.pilots > 0 {
        facts.push(fact("Test runs", study.pilots.to_string()));
    }
    let last = study
        .last_seen_at_ms
        .map(|ms| el("p").class("quiet").text("Last stored ").child(el("time").moment(ms)));
    el("article")
        .class("panel-card")
        .child(head)
        .children(parts::synthetic(study.synthetic))
        .child(el("dl").class("numbers").children(facts))
        .children(attention(study))
        .children(last)
}

/// What an experimenter should check or do in this study.
fn attention(study: &StudySummary) -> Vec<Node> {
    let mut lines = Vec::new();
    if study.doubtful > 0 {
        let people = count(study.doubtful, "participant");
        let words =
            format!("{people} steered never, always, or with the key times of an earlier trial. ");
        let link = el("a")
            .attr("href", format!("{}?having=doubtful", Tab::Participants.address(&study.slug)))
            .text("Look at them");
        lines.push(el("p").class("waiting").test_id("doubtful").text(words).child(link));
    }
    if study.title.is_empty() {
        let words = "Its configuration cannot be read. Run sidestep check.";
        lines.push(el("p").class("trouble").text(words));
    }
    if study.status == Status::Closed && study.active > 0 {
        let people = count(study.active, "participant");
        lines.push(el("p").class("quiet").text(format!("Closed; {people} may still finish.")));
    }
    lines
}

/// First steps, shown while no study has participants.
fn first_steps(study: &StudySummary) -> Node {
    let link = |href: String, name: &str, words: &str| {
        // The link opens the participant's page in a new tab.
        el("a")
            .class("button")
            .attr("href", href)
            .attr("target", "_blank")
            .test_id(name)
            .text(words)
    };
    let step = |title: &str, words: &str, action: Option<Node>| {
        el("li").child(el("h3").text(title)).child(el("p").text(words)).children(action)
    };
    let slug = &study.slug;
    let steps = [
        step(
            "Drive it yourself",
            "Take part as a participant would. A test run is kept apart from the data.",
            Some(link(format!("/s/{slug}?pilot"), "try", "Start a test run")),
        ),
        step(
            "Rehearse with a simulated person",
            "A program presses the keys on the real page, thirty times as fast as a person.",
            Some(link(format!("/s/{slug}?{REHEARSAL}"), "rehearse", "Watch a rehearsal")),
        ),
        step(
            "Look at a finished study",
            "Start the server with --demo: it fills a study with synthetic people, and analyses it.",
            Some(el("code").class("command").test_id("demo").text("sidestep serve --demo")),
        ),
        step(
            "Make the study your own",
            "Scenes, texts, questions and links are set in a form or a file, and checked while you \
             write.",
            Some(
                el("a").class("button").attr("href", "/lab/new").test_id("make").text("New study"),
            ),
        ),
    ];
    el("section")
        .class("first-steps")
        .test_id("first-steps")
        .child(el("h2").text("Nobody has taken part yet"))
        .child(el("ol").children(steps))
}
