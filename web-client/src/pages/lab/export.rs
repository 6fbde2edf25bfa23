//! Export of a study's data as one archive, in a choice of formats.

use super::study::{self, Tab};
use super::visit::Visit;
use crate::pages::parts::{self, alert, count};
use crate::runtime::{Answer, Command, Commands, Page, Request, read};
use crate::view::{self, el};
use sidestep::api::{Access, Configuration, ConfigurationVersion, StudySummary, routes};

type Node = view::Node<Msg>;

/// The page that exports a study's data.
pub(super) struct Export {
    slug: String,
    /// Whether the user may download data.
    may_export: bool,
    study: Option<StudySummary>,
    /// The configurations of the study, newest first.
    versions: Vec<ConfigurationVersion>,
    /// The reason why the page has no data, or why its data are outdated.
    trouble: Option<String>,
}

/// Messages to the page.
#[derive(Clone, Debug)]
pub(super) enum Msg {
    /// Something on the server has changed.
    Changed,
    /// The server described the study.
    Study(Answer),
    /// The server sent the configurations.
    Configuration(Answer),
}

/// The formats, each with its word in the URL, its name, and its purpose. The first format is the
/// default.
const FORMATS: [(&str, &str, &str); 5] = [
    ("csv", "CSV", "for R, pandas, spreadsheets"),
    ("parquet", "Parquet", "for polars, pyarrow, DuckDB: small, with types"),
    ("jsonl", "JSON Lines", "for programs: one object per line"),
    ("psych-ds", "Psych-DS", "CSV in a described folder, to be shared and archived"),
    ("sqlite", "SQLite", "one database for SQL, with keys and types"),
];

impl Export {
    /// Creates the page for `/lab/studies/SLUG/export` and its first commands.
    pub(super) fn open(visit: &Visit<'_>) -> (Self, Commands<Msg>) {
        let page = Self {
            slug: visit.id.to_owned(),
            may_export: visit.session.access >= Access::Export,
            study: None,
            versions: Vec::new(),
            trouble: None,
        };
        let mut commands = page.ask();
        commands.push(study::follow(|| Msg::Changed));
        (page, commands)
    }

    fn ask(&self) -> Commands<Msg> {
        let url = routes::admin_configuration(&self.slug);
        let configuration = Command::Send(Request::get("configuration", url, Msg::Configuration));
        vec![study::ask(&self.slug, Msg::Study), configuration]
    }
}

impl Page for Export {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        let told = match message {
            Msg::Changed => return self.ask(),
            Msg::Study(answer) => read(answer).map(|study| self.study = Some(study)),
            Msg::Configuration(answer) => read::<Configuration>(answer)
                .map(|configuration| self.versions = configuration.versions),
        };
        self.trouble = told.err().map(|failure| failure.sentence);
        Vec::new()
    }

    fn view(&self) -> Node {
        let Some(study) = &self.study else {
            return match &self.trouble {
                Some(why) => parts::stuck("No study to export", why),
                None => parts::loading(),
            };
        };
        let empty = (study.trials == 0).then(|| {
            let words = "No trials are stored yet: the tables will be empty.";
            el("p").class("quiet").test_id("no-trials").text(words)
        });
        let content = match self.may_export {
            true => self.form(study),
            false => el("p")
                .test_id("no-right")
                .text("Your key may not export a study. Ask for a key with the right to export."),
        };
        el("main")
            .class("page")
            .children(study::head(study, Tab::Export, []))
            .children(self.trouble.as_deref().map(|why| alert("old", why)))
            .children(empty)
            .child(content)
    }

    fn title(&self) -> String {
        let name = self.study.as_ref().map_or(&self.slug, |study| &study.title);
        format!("{name}: export")
    }
}

impl Export {
    /// The form with the options. The browser itself requests the archive and saves it to a file.
    fn form(&self, study: &StudySummary) -> Node {
        let format = |(place, &(word, name, use_))| {
            let input = el("input")
                .attrs(&[("type", "radio"), ("name", "format"), ("value", word)])
                .attr_if(place == 0, "checked", "")
                .test_id(&format!("format-{word}"));
            let about = el("span").child(el("strong").text(name)).text(format!(" {use_}"));
            el("label").child(input).child(about)
        };
        let formats = el("fieldset")
            .child(el("legend").text("Format"))
            .children(FORMATS.iter().enumerate().map(format));
        // If a study returned to an earlier configuration, two of its versions have the same hash.
        let newest = |(i, version): &(usize, &ConfigurationVersion)| {
            !self.versions[..*i].iter().any(|newer| newer.hash == version.hash)
        };
        let versions = self.versions.iter().enumerate().filter(newest).map(|(i, version)| {
            let present = if i == 0 { " (current)" } else { "" };
            let participants = count(version.participants, "participant");
            let words = format!("version {}{present}: {participants}", version.number);
            (version.hash.as_str(), words)
        });
        let people = [("", "all participants".to_owned())].into_iter().chain(versions);
        let phases = [
            ("", "all phases"),
            ("task", "tasks only"),
            ("practice", "practice only"),
            ("familiarisation", "familiarisation only"),
        ];
        let qualities = [("all", "all trials"), ("unflagged", "trials without a flag")];
        let pilots = el("label").class("check").child(
            el("input")
                .attrs(&[("type", "checkbox"), ("name", "pilots"), ("value", "true")])
                .test_id("pilots"),
        );
        let choices = el("div")
            .class("filters")
            .child(select("phase", "Phase", phases.map(|(word, words)| (word, words.to_owned()))))
            .child(select(
                "quality",
                "Quality",
                qualities.map(|(word, words)| (word, words.to_owned())),
            ))
            .child(select("configuration", "Version", people))
            .child(pilots.text("Test runs instead"));
        let submit = el("button").class("primary").attr("type", "submit").test_id("download");
        el("section")
            .child(el("p").text(
                "One ZIP archive with the tables of steps, trials, key events and participants, the \
                 configurations, the meaning of every column, and a manifest with the SHA-256 of \
                 every file. The table of participants contains recruiting ids and codes.",
            ))
            .child(
                el("form")
                    .class("export")
                    .attrs(&[("method", "get")])
                    .attr("action", routes::exports(&study.slug))
                    .test_id("export-form")
                    .child(formats)
                    .child(choices)
                    .child(submit.text("Download")),
            )
            .child(el("p").class("quiet").text(
                "The manifest is the last file of the archive. An archive whose download was interrupted \
                 cannot be opened: let the browser resume the download, or start it again. \
                 sidestep export writes the same tables.",
            ))
    }
}

fn select(
    name: &'static str,
    label: &'static str,
    options: impl IntoIterator<Item = (impl AsRef<str>, String)>,
) -> Node {
    let option = |(word, words): (_, String)| {
        el("option").attr("value", AsRef::<str>::as_ref(&word)).text(words)
    };
    el("select")
        .attrs(&[("name", name), ("aria-label", label)])
        .test_id(name)
        .children(options.into_iter().map(option))
}
