//! The form of a study, which shows the fields of a study file in sections.

mod recruitment;

use super::document::{flag, get, list, number, text};
use super::edit::new_check;
use super::fields::Fields;
use super::questions;
use super::{Edit, Msg};
use crate::pages::parts::{button, count};
use crate::view::{self, el};
use serde_json::{Value, json};
use sidestep::api::DraftChecked;

type Node = view::Node<Msg>;

/// The form, and what it is created from.
pub(super) struct Form<'a> {
    pub(super) fields: Fields<'a>,
    /// The languages that the server supports.
    pub(super) languages: &'a [String],
    /// Whether the study is new, so that its slug can still be chosen.
    pub(super) is_new: bool,
    /// Counts how often the form was filled. Each time, its fields are created anew.
    pub(super) givings: u32,
    /// The sections that had errors. They stay open.
    pub(super) opened: &'a [String],
    /// The picture of the distribution of scenes.
    pub(super) picture: Option<Node>,
}

/// A section: its heading, a short summary, the path of its fields, and the fields.
struct Section {
    name: &'static str,
    path: &'static str,
    said: String,
    is_open: bool,
    fields: Vec<Node>,
}

/// The phases in order, each with its initial number of scenes.
const PHASES: [(&str, &str, u32); 3] =
    [("familiarisation", "Familiarisation", 6), ("practice", "Practice", 3), ("task", "Tasks", 50)];

impl Form<'_> {
    /// The whole form.
    pub(super) fn view(&self) -> Node {
        let sections = [
            self.about(),
            self.phases(),
            self.vehicles(),
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
        let slug = self.is_new.then(|| {
            let hint = "In addresses: /s/NAME. Lower-case letters, digits and hyphens. It can never be changed after \
                 the study is created.";
            fields.line("slug", "Name in addresses", hint)
        });
        let status = self.is_new.then(|| {
            let hint = "Closed: you can try and rehearse the study, but nobody can take part until you open it. Open: \
                 everybody with the link can take part as soon as the study is created.";
            let choices = [("closed", "closed"), ("open", "open")];
            fields.choice("status", "The study begins", hint, &choices)
        });
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
        let title =
            fields.line("title", "Title", "The heading of the first page, in every language.");
        let hint = "For rehearsals: programs take part (sidestep simulate), and no people. Every page, \
                    export and report says so. This cannot be changed once someone has taken part.";
        let synthetic = fields.tick("synthetic", "Synthetic participants only", hint);
        let hint = "For your own reference, in the list of versions.";
        let label = fields.line("version", "Label of this version", hint).class("field");
        let hint = "Another number gives participants other scenes.";
        let seed = fields.number("seed", "Seed of the scenes", "", hint);
        Section {
            name: "About the study",
            path: "title",
            said: String::new(),
            is_open: true,
            fields: [title]
                .into_iter()
                .chain(slug)
                .chain(status)
                .chain([label, seed, synthetic, languages])
                .collect(),
        }
    }

    fn phases(&self) -> Section {
        let fields = &self.fields;
        let driven = list(fields.given, "phases");
        let place = |phase: &str| driven.iter().position(|it| text(it, "phase") == phase);
        let rows = PHASES.iter().enumerate().map(|(i, &(phase, name, scenes))| {
            let there = place(phase);
            // Keeps the order of the phases, no matter which of them are present.
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
        let fields = &self.fields;
        let vehicle = |path: &str, name: &str| {
            [
                fields.number(
                    &format!("parameters.{path}.speed_mps"),
                    &format!("{name}: speed"),
                    "m/s",
                    "",
                ),
                fields.number(
                    &format!("parameters.{path}.turn_rate_radps"),
                    &format!("{name}: turn rate"),
                    "rad/s",
                    "",
                ),
            ]
        };
        let clock = [
            fields.number("parameters.danger_radius_m", "Radius of the danger zone", "m", ""),
            fields.number("parameters.step_s", "Time between two inputs", "s", ""),
            fields.number("parameters.steps", "Steps of a scene", "steps", ""),
        ];
        let vehicles = vehicle("human", "Participant").into_iter().chain(vehicle("robot", "Robot"));
        Section {
            name: "Vehicles and clock",
            path: "parameters",
            said: format!("a scene lasts {} s", (scene_s(self.study()) * 1000.0).round() / 1000.0),
            is_open: true,
            fields: vehicles.chain(clock).collect(),
        }
    }

    fn encounters(&self) -> Section {
        let number = |field: &str, label: &str, unit: &str| {
            self.fields.number(&format!("encounters.{field}"), label, unit, "")
        };
        let mut fields = vec![
            number("min_approach_rad", "Least angle between the headings", "rad"),
            number("max_miss_share", "Greatest miss distance", "of the danger radius"),
            number("min_entry_s", "Entry without a turn, earliest", "s"),
            number("max_entry_s", "Entry without a turn, latest", "s"),
            number("min_start_distance_m", "Distance at the start, least", "m"),
            number("max_start_distance_m", "Distance at the start, greatest", "m"),
            number("escape_clearance_m", "An escape keeps this distance from the danger zone", "m"),
            number("escape_delay_s", "Participants can wait this long and still escape", "s"),
        ];
        fields.extend(
            self.picture.clone().map(|picture| el("div").class("field wide").child(picture)),
        );
        Section {
            name: "Scenes",
            path: "encounters",
            said: "which encounters are drawn, and how they are spread".to_owned(),
            is_open: false,
            fields,
        }
    }

    fn trials(&self) -> Section {
        let fields = &self.fields;
        Section {
            name: "Course of a scene",
            path: "trials",
            said: "countdown, rests, interruptions".to_owned(),
            is_open: false,
            fields: vec![
                fields.number("trials.countdown_s", "Countdown", "s", ""),
                fields.number("trials.end_s", "The last picture stays for", "s", ""),
                fields.number(
                    "trials.feedback_s",
                    "With feedback, it stays for at least",
                    "s",
                    "1.5 s or more.",
                ),
                fields.number(
                    "trials.rest_after",
                    "A rest is offered after",
                    "tasks",
                    "0: no rests.",
                ),
                fields.tick(
                    "trials.repeat_interrupted",
                    "An interrupted task is driven once more at the end",
                    "",
                ),
                fields.tick("trials.fullscreen", "Ask for the full screen", ""),
            ],
        }
    }

    fn consent(&self) -> Section {
        let fields = &self.fields;
        let study = self.study();
        let is_said = |path: &str| get(study, path).is_some_and(|it| *it != "" && *it != json!({}));
        let is_complete = is_said("consent.investigator") && is_said("consent.contact");
        Section {
            name: "Consent",
            path: "consent",
            said: if is_complete { "" } else { "participants read no name or no contact yet" }
                .to_owned(),
            is_open: true,
            fields: vec![
                fields.fact("consent.investigator", "Investigator", ""),
                fields.fact("consent.institution", "Institution", ""),
                fields.fact(
                    "consent.contact",
                    "Contact",
                    "An address that participants can write to.",
                ),
                fields.fact("consent.ethics", "Ethics approval", ""),
                fields.fact("consent.retention", "How long and where data are kept", ""),
                fields.markdown(
                    "consent.text",
                    "What participants agree to (Markdown)",
                    "Empty: Sidestep’s own text.",
                ),
            ],
        }
    }

    fn comprehension(&self) -> Section {
        let fields = &self.fields;
        let questions = list(fields.given, "comprehension.questions");
        let own = questions
            .iter()
            .enumerate()
            .map(|(i, question)| questions::check(fields, i, list(question, "options").len()));
        let hint =
            "After this many attempts with a wrong answer, the participation ends. 0: never.";
        let first = [
            fields.tick(
                "comprehension.standard",
                "Ask Sidestep’s questions on the robot, the keys and the danger zone",
                "",
            ),
            fields.number("comprehension.attempts", "Attempts", "", hint),
            fields.number(
                "comprehension.draw",
                "Questions that each participant is asked",
                "",
                "Drawn at random from all, with six standard questions. 0: all, with the three standard ones.",
            ),
            fields.choice("comprehension.after_wrong", "After a wrong answer", "", &AFTER_WRONG),
        ];
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
            fields: first.into_iter().chain(own).chain([add]).collect(),
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
        let hint = "What participants read on the last page. Empty: only thanks.";
        Section {
            name: "Last page",
            path: "closing",
            said: String::new(),
            is_open: false,
            fields: vec![self.fields.markdown("closing.debrief", "Debriefing (Markdown)", hint)],
        }
    }
}

/// The languages for a study's texts: those that it names, otherwise all that the server supports.
pub(super) fn offered<'a>(study: &'a Value, all: &'a [String]) -> Vec<&'a str> {
    let named: Vec<_> = list(study, "languages").iter().filter_map(Value::as_str).collect();
    if named.is_empty() { all.iter().map(String::as_str).collect() } else { named }
}

/// The options for what happens after a wrong answer in the check of understanding.
const AFTER_WRONG: [(&str, &str); 3] = [
    ("mark", "each answer is marked as right or wrong"),
    ("renew", "other questions and orders, without saying which was wrong"),
    ("reread", "the same, after the instructions again"),
];

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
