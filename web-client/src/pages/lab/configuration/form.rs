//! The form of a study, which shows the fields of a study file in sections.

mod recruitment;

use super::document::{flag, get, list, number, text};
use super::edit::new_check;
use super::fields::Fields;
use super::questions;
use super::settings::{SETTINGS, Setting};
use super::{Edit, Msg};
use crate::pages::parts::{button, count};
use crate::view::{self, el};
use serde_json::{Value, json};
use sidestep::api::DraftChecked;

type Node = view::Node<Msg>;

/// The form, and what it is created from.
pub(super) struct Form<'a> {
    pub(super) fields: Fields<'a>,
    /// All languages that the server supports.
    pub(super) languages: &'a [String],
    /// Whether the study is new, so that its slug can still be chosen.
    pub(super) is_new: bool,
    /// Counts how often the form was filled. Its fields are created anew each time.
    pub(super) givings: u32,
    /// The sections that had errors. They stay open.
    pub(super) opened: &'a [String],
    /// The picture of the distribution of scenes.
    pub(super) picture: Option<Node>,
}

/// A section: its title, the path of its fields, a short summary, and the fields.
struct Section {
    name: &'static str,
    path: &'static str,
    said: String,
    is_open: bool,
    fields: Vec<Node>,
}

/// The phases in order, each with its label and its initial number of scenes.
const PHASES: [(&str, &str, u32); 3] =
    [("familiarisation", "Familiarisation", 6), ("practice", "Practice", 3), ("task", "Tasks", 50)];

impl Form<'_> {
    /// The whole form.
    pub(super) fn view(&self) -> Node {
        let sections = [
            self.about(),
            self.phases(),
            self.vehicles(),
            self.robots(),
            self.encounters(),
            self.trials(),
            self.consent(),
            self.comprehension(),
            self.questions(),
            self.closing(),
            self.recruitment(),
        ];
        let chooser = self.language_chooser();
        let sections = sections.into_iter().map(|section| {
            let was_wrong = self.opened.iter().any(|field| field == section.path);
            let about = self.fields.complaint_about(section.path);
            let named = (section.path.to_owned(), section.name.to_owned());
            self.fields.labels.borrow_mut().push(named);
            el("details")
                .key(section.name)
                .attr_if(section.is_open || was_wrong, "open", "")
                .test_id(&format!("section-{}", section.path))
                .child(
                    el("summary")
                        .child(el("h3").text(section.name))
                        .child(el("small").class("quiet").text(section.said)),
                )
                .children(about.map(|what| el("p").class("trouble").test_id("beside").text(what)))
                .child(el("div").class("fields").key(self.givings).children(section.fields))
        });
        el("div").class("study-form").test_id("study-form").children(chooser).children(sections)
    }

    /// The controls of a section's settings, or the control of a single setting.
    fn settings(&self, of: &'static str) -> impl Iterator<Item = Node> {
        let is_of = move |setting: &&Setting| setting.path.split('.').next() == Some(of);
        SETTINGS.iter().filter(is_of).map(|setting| self.fields.setting(setting))
    }

    fn study(&self) -> &Value {
        self.fields.study
    }

    /// The languages in which the study is offered.
    fn offered(&self) -> Vec<&str> {
        offered(self.study(), self.languages)
    }

    fn language_chooser(&self) -> Option<Node> {
        let offered = self.offered();
        let choice = |tag: &&str| {
            button(&format!("language-{tag}"), Msg::Language((*tag).to_owned()))
                .class("choice")
                .attr("aria-pressed", *tag == self.fields.language)
                .text(*tag)
        };
        (offered.len() > 1).then(|| {
            el("div")
                .class("choices")
                .attrs(&[("role", "group"), ("aria-label", "Language of the texts below")])
                .child(el("span").class("quiet").text("Texts in"))
                .children(offered.iter().map(choice))
        })
    }

    fn about(&self) -> Section {
        let fields = &self.fields;
        let ticked = list(fields.given, "languages");
        let languages = self.languages.iter().map(|tag| {
            let is_so = ticked.iter().any(|known| known == tag);
            let (chosen, tag_of) = (ticked.to_vec(), tag.clone());
            fields.ticked(&format!("languages.{tag}"), tag, "", is_so, move |ticked| {
                let others = chosen.iter().filter(|known| **known != *tag_of.as_str()).cloned();
                let one = ticked.then(|| Value::from(tag_of.as_str()));
                let edit = Edit::Fill(vec![("languages", others.chain(one).collect())]);
                Msg::Rebuild(edit, format!("field-languages.{tag_of}"))
            })
        });
        let languages = el("fieldset")
            .class("field wide")
            .child(el("legend").text("Languages to choose from"))
            .child(el("div").class("ticks").children(languages))
            .child(el("small").class("quiet").text(
                "If none is ticked, participants choose among those in which all texts of the study are \
                 written. People who read none of the ticked languages get the first of these.",
            ));
        let of_new = ["slug", "status"].into_iter().filter(|_| self.is_new);
        let first = std::iter::once("title").chain(of_new);
        let rows = first.chain(["version", "seed", "synthetic"]).flat_map(|it| self.settings(it));
        Section {
            name: "About the study",
            path: "title",
            said: String::new(),
            is_open: true,
            fields: rows.chain([languages]).collect(),
        }
    }

    fn phases(&self) -> Section {
        let fields = &self.fields;
        let driven = list(fields.given, "phases");
        let place = |phase: &str| driven.iter().position(|it| text(it, "phase") == phase);
        let rows = PHASES.iter().enumerate().map(|(i, &(phase, name, scenes))| {
            let there = place(phase);
            // Insert the phase at its place in the order, no matter which other phases are present.
            let at = PHASES[..i].iter().filter(|(before, ..)| place(before).is_some()).count();
            let include = fields.ticked(
                &format!("phases.{phase}"),
                name,
                "",
                there.is_some(),
                move |ticked| {
                    let (list, new) =
                        ("phases".to_owned(), json!({ "phase": phase, "scenes": scenes }));
                    let edit =
                        if ticked { Edit::Insert(list, at, new) } else { Edit::Remove(list, at) };
                    Msg::Rebuild(edit, format!("field-phases.{phase}"))
                },
            );
            let details = there.map(|i| {
                let of = |field: &str| format!("phases[{i}].{field}");
                let ticks = [
                    fields.tick(&of("show_danger_zone"), "The danger zone is drawn", ""),
                    fields.tick(
                        &of("feedback"),
                        "After each scene, participants read whether they stayed out of it",
                        "",
                    ),
                ];
                let label = format!("{name}: number of scenes");
                [fields.number(&of("scenes"), &label, "", ""), el("div").children(ticks)]
            });
            el("div").class("phase").child(include).children(details.into_iter().flatten())
        });
        Section {
            name: "Phases",
            path: "phases",
            said: self.driving(),
            is_open: true,
            fields: rows.collect(),
        }
    }

    /// A summary of how much participants drive.
    fn driving(&self) -> String {
        let study = self.study();
        let phases = list(study, "phases");
        let scenes: f64 = phases.iter().filter_map(|phase| number(phase, "scenes")).sum();
        let each = scene_s(study)
            + number(study, "trials.countdown_s").unwrap_or_default()
            + number(study, "trials.end_s").unwrap_or_default();
        let minutes = scenes * each / 60.0;
        format!("{}, about {minutes:.0} min with countdowns", count(scenes, "scene"))
    }

    fn vehicles(&self) -> Section {
        Section {
            name: "Vehicles and clock",
            path: "parameters",
            said: format!("a scene lasts {} s", (scene_s(self.study()) * 1000.0).round() / 1000.0),
            is_open: true,
            fields: self.settings("parameters").collect(),
        }
    }

    fn robots(&self) -> Section {
        let robots = list(self.study(), "robots").len();
        Section {
            name: "Robots",
            path: "robots",
            said: match robots {
                0 => "one, which drives straight to its goal".to_owned(),
                n => count(n, "robot"),
            },
            is_open: false,
            fields: super::robots::all(&self.fields),
        }
    }

    fn encounters(&self) -> Section {
        let picture = self.picture.clone();
        let picture = picture.map(|picture| el("div").class("field wide").child(picture));
        Section {
            name: "Scenes",
            path: "encounters",
            said: "which encounters are drawn, and how they are spread".to_owned(),
            is_open: false,
            fields: self.settings("encounters").chain(picture).collect(),
        }
    }

    fn trials(&self) -> Section {
        Section {
            name: "Course of a scene",
            path: "trials",
            said: "countdown, rests, interruptions".to_owned(),
            is_open: false,
            fields: self.settings("trials").collect(),
        }
    }

    fn consent(&self) -> Section {
        let study = self.study();
        let is_said = |path: &str| get(study, path).is_some_and(|it| *it != "" && *it != json!({}));
        let is_complete = is_said("consent.investigator") && is_said("consent.contact");
        Section {
            name: "Consent",
            path: "consent",
            said: if is_complete { "" } else { "participants read no name or no contact yet" }
                .to_owned(),
            is_open: true,
            fields: self.settings("consent").collect(),
        }
    }

    fn comprehension(&self) -> Section {
        let fields = &self.fields;
        let questions = list(fields.given, "comprehension.questions");
        let own = questions
            .iter()
            .enumerate()
            .map(|(i, question)| questions::check(fields, i, list(question, "options").len()));
        let focused = format!(".text.{}", fields.language);
        let add = fields.add("comprehension.questions", "Add a question", new_check(), &focused);
        let own_count = list(self.study(), "comprehension.questions").len();
        let standard =
            if flag(self.study(), "comprehension.standard") { "standard questions" } else { "" };
        let own_words =
            (own_count > 0).then(|| format!("{} of your own", count(own_count, "question")));
        let said: Vec<_> = [(!standard.is_empty()).then(|| standard.to_owned()), own_words]
            .into_iter()
            .flatten()
            .collect();
        Section {
            name: "Check of understanding",
            path: "comprehension",
            said: if said.is_empty() { "none".to_owned() } else { said.join(", ") },
            is_open: false,
            fields: self.settings("comprehension").chain(own).chain([add]).collect(),
        }
    }

    fn questions(&self) -> Section {
        let fields = &self.fields;
        let questions = list(fields.given, "questions");
        let nodes = questions
            .iter()
            .enumerate()
            .map(|(i, question)| questions::question(fields, i, question));
        let taken = |name: &String| questions.iter().any(|question| text(question, "name") == name);
        let name =
            (1..).map(|n| format!("question_{n}")).find(|name| !taken(name)).unwrap_or_default();
        let new = super::edit::new_question(&name, "text");
        let first = format!(".text.{}", fields.language);
        let add = fields.add("questions", "Add a question", new, &first);
        Section {
            name: "Questions after the last scene",
            path: "questions",
            said: match list(self.study(), "questions").len() {
                0 => "none".to_owned(),
                n => count(n, "question"),
            },
            is_open: false,
            fields: nodes.chain([add]).collect(),
        }
    }

    fn closing(&self) -> Section {
        Section {
            name: "Last page",
            path: "closing",
            said: String::new(),
            is_open: false,
            fields: self.settings("closing").collect(),
        }
    }
}

/// The languages for a study's texts: the languages that the study lists, or all that the server
/// supports.
pub(super) fn offered<'a>(study: &'a Value, all: &'a [String]) -> Vec<&'a str> {
    let named: Vec<_> = list(study, "languages").iter().filter_map(Value::as_str).collect();
    if named.is_empty() { all.iter().map(String::as_str).collect() } else { named }
}

/// Duration of a scene (s).
fn scene_s(study: &Value) -> f64 {
    let of = |field: &str| number(study, field).unwrap_or_default();
    of("parameters.step_s") * of("parameters.steps")
}

/// The picture of the distribution of scenes.
pub(super) fn picture(checked: &DraftChecked) -> Option<Node> {
    let svg = checked.picture.as_ref()?;
    Some(el("div").class("design").attr("tabindex", 0).test_id("design").html(svg))
}
