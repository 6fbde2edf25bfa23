//! The participants of a running study, with their progress and quality flags. The server filters,
//! sorts and paginates; the address contains the selection.

mod selection;
pub(super) mod table;

use self::selection::Selection;
use super::pager::pager;
use super::study::{self, Tab};
use super::visit::Visit;
use crate::form::{FieldValue, Form};
use crate::pages::parts::{self, alert, button};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, ParticipantPage, Stage, StudySummary, routes};
use sidestep::study::Status;

type Node = view::Node<Msg>;

/// The page of a study's participants.
pub(super) struct Participants {
    slug: String,
    /// Whether the user may download data.
    may_export: bool,
    selection: Selection,
    study: Option<StudySummary>,
    page: Option<ParticipantPage>,
    /// The reason why the list is missing or outdated.
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server described the study.
    Study(Answer),
    /// The server listed participants.
    Listed(Answer),
    /// Show only participants at this stage, or all if `None`.
    Stage(Option<Stage>),
    /// Show only participants with this flag, or all participants if the word is empty.
    Having(FieldValue),
    /// Sort by this column in descending order. If the list is already in that order, sort in
    /// ascending order.
    Sort(&'static str),
    /// Search for the entered text.
    Search(Form),
    /// Show pilots instead of participants, or participants again.
    Pilots(FieldValue),
    /// Show the page that begins after this number of participants.
    Page(u64),
}

impl Participants {
    /// Creates the page for `/lab/studies/SLUG?…` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            slug: visit.id.to_owned(),
            may_export: visit.session.access >= Access::Export,
            selection: Selection::of(visit.address),
            study: None,
            page: None,
            trouble: None,
        };
        let mut commands = page.ask();
        commands.push(study::follow(|| Msg::Changed));
        (page, commands)
    }

    fn ask(&self) -> Commands<Msg> {
        let url = format!("{}?{}", routes::admin_participants(&self.slug), self.selection.query());
        let people = Command::Send(Request::get("participants", url, Msg::Listed));
        vec![study::ask(&self.slug, Msg::Study), people]
    }

    /// Changes the selection, puts it into the address and requests the list.
    fn select(&mut self, change: impl FnOnce(&mut Selection)) -> Commands<Msg> {
        self.selection.offset = 0;
        change(&mut self.selection);
        let address =
            format!("{}?{}", Tab::Participants.address(&self.slug), self.selection.query());
        let mut commands = vec![Command::ReplaceAddress(address)];
        commands.extend(self.ask());
        commands
    }
}

impl Page for Participants {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Changed => return self.ask(),
            Msg::Study(answer) => match read(answer) {
                Ok(study) => self.study = Some(study),
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            Msg::Listed(answer) => match read(answer) {
                Ok(page) => {
                    self.page = Some(page);
                    self.trouble = None;
                }
                Err(failure) => self.trouble = Some(failure.sentence),
            },
            Msg::Stage(stage) => return self.select(|it| it.stage = stage),
            Msg::Having(word) => return self.select(|it| it.having = word.text().to_owned()),
            Msg::Sort(column) => return self.select(|it| it.sort_by(column)),
            Msg::Search(form) => {
                return self.select(|it| it.search = form.text("search").trim().to_owned());
            }
            Msg::Pilots(on) => {
                let pilots = on == FieldValue::Checked(true);
                return self.select(|it| *it = Selection { pilots, ..Selection::default() });
            }
            Msg::Page(offset) => return self.select(|it| it.offset = offset),
        }
        Vec::new()
    }

    fn view(&self) -> Node {
        let (study, page) = match (&self.study, &self.page, &self.trouble) {
            (Some(study), Some(page), _) => (study, page),
            (.., Some(why)) => return parts::stuck("No participants to show", why),
            _ => return parts::loading(),
        };
        let shown = if page.participants.is_empty() {
            self.empty(study)
        } else {
            let table = table::table(page, &self.selection, self.may_export);
            el("div").class("scroll").attr("tabindex", 0).child(table)
        };
        el("main")
            .class("page")
            .children(study::head(study, Tab::Participants, self.actions(study)))
            .children(self.trouble.as_deref().map(|why| alert("old", why)))
            .child(self.filters(page))
            .child(shown)
            .children(pager(
                (self.selection.offset, page.participants.len(), page.total),
                selection::PAGE_LENGTH,
                Msg::Page,
            ))
            .child(table::meanings())
    }

    fn title(&self) -> String {
        let name = self.study.as_ref().map_or(&self.slug, |study| &study.title);
        format!("{name}: participants")
    }
}

/// Links to try a study on the participant's page, in a new tab.
pub(super) fn trials<M: Clone>(slug: &str) -> [view::Node<M>; 2] {
    let link = |query: &str, name: &str, words: &str| {
        let link = el("a").class("button").attr("href", format!("/s/{slug}?{query}"));
        link.attr("target", "_blank").test_id(name).text(words)
    };
    [link("pilot", "try", "Test run"), link(study::REHEARSAL, "rehearse", "Watch a rehearsal")]
}

impl Participants {
    fn actions(&self, study: &StudySummary) -> Vec<Node> {
        let link = |href: String, name: &str, words: &str| {
            el("a").class("button").attr("href", href).test_id(name).text(words)
        };
        let slug = &study.slug;
        let mut actions = trials(slug).to_vec();
        if self.may_export {
            let whom = if self.selection.pilots { "&pilot=true" } else { "" };
            let table = format!("{}?format=csv{whom}", routes::admin_participants(slug));
            actions.push(link(table, "export", "Table as CSV").attr("download", ""));
        }
        actions
    }

    /// The filters by stage and by flag, and the search.
    fn filters(&self, page: &ParticipantPage) -> Node {
        let all: u64 = page.stages.iter().map(|count| count.participants).sum();
        let stage = |stage: Option<Stage>, words: &str, participants: u64| {
            let is_chosen = self.selection.stage == stage;
            button(&format!("stage-{words}"), Msg::Stage(stage))
                .class("choice")
                .attr("aria-pressed", is_chosen)
                .text(format!("{words} "))
                .child(el("small").text(participants.to_string()))
        };
        let stages = page.stages.iter().map(|count| {
            stage(Some(count.stage), table::stage_words(count.stage), count.participants)
        });
        let option = |word: &'static str, words: &'static str| {
            el("option")
                .attr("value", word)
                .attr_if(self.selection.having == word, "selected", "")
                .text(words)
        };
        let having = el("select")
            .attrs(&[("name", "having"), ("aria-label", "Only with")])
            .test_id("having")
            .on_input(Msg::Having)
            .child(option("", "any quality"))
            .child(option("doubtful", "in doubt"))
            .child(option("excluded", "excluded"))
            .children(table::LOOKS.iter().map(|look| option(look.word, look.words)));
        let placeholder = if self.may_export { "Number, external id or code" } else { "Number" };
        let search =
            el("form").on_submit(Msg::Search).attr("role", "search").test_id("search-form").child(
                el("input")
                    .attrs(&[("name", "search"), ("type", "search"), ("placeholder", placeholder)])
                    .attr("aria-label", "Find a participant")
                    .attr("value", &self.selection.search)
                    .test_id("search"),
            );
        let pilots = el("label").class("check").child(
            el("input")
                .attrs(&[("type", "checkbox"), ("name", "pilots")])
                .attr_if(self.selection.pilots, "checked", "")
                .test_id("pilots")
                .on_input(Msg::Pilots),
        );
        el("div")
            .class("filters")
            .child(
                el("div")
                    .class("choices")
                    .attrs(&[("role", "group"), ("aria-label", "Stage")])
                    .child(stage(None, "all", all))
                    .children(stages),
            )
            .child(having)
            .child(search)
            .child(pilots.text("Test runs"))
    }

    fn empty(&self, study: &StudySummary) -> Node {
        let empty = el("div").class("empty").test_id("nobody");
        if self.selection.is_filtered() {
            return empty.child(el("p").text("No participant matches the filters."));
        }
        if self.selection.pilots {
            let words = "Take part yourself (Test run), or watch a simulated person do so (Watch a \
                         rehearsal). Neither is part of the data.";
            return empty
                .child(el("p").text("No test runs yet."))
                .child(el("p").class("quiet").text(words));
        }
        let links = el("a").attr("href", Tab::Configuration.address(&study.slug));
        if study.status == Status::Closed {
            let words = "The study is closed. When you have rehearsed it, open it on the page ";
            return empty.child(el("p").text("No participants yet.")).child(
                el("p").class("quiet").text(words).child(links.text("Configuration")).text("."),
            );
        }
        empty.child(el("p").text("No participants yet.")).child(
            el("p")
                .class("quiet")
                .text("Send people one of the links on the page ")
                .child(links.text("Configuration"))
                .text(". They appear here as they join."),
        )
    }
}
