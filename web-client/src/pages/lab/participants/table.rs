//! The table of participants, and the meaning of its flags.

use super::Msg;
use super::selection::Selection;
use crate::pages::parts::{button, cell};
use crate::view::{self, el};
use sidestep::api::{ParticipantPage, ParticipantSummary, Quality, Stage};

type Node = view::Node<Msg>;

/// A flag for the experimenter's attention.
pub(super) struct Look {
    /// The flag's word in the server's list.
    pub(super) word: &'static str,
    /// The flag's name.
    pub(super) words: &'static str,
    meaning: &'static str,
    tasks: fn(&Quality) -> u32,
}

/// All flags, the most serious first.
pub(super) const LOOKS: [Look; 8] = [
    Look {
        word: "same_timing",
        words: "identical timing",
        meaning: "Keys went down and up at exactly the times of an earlier trial of the study, to the \
                  millisecond. A program drove.",
        tasks: |quality| quality.same_timing,
    },
    Look {
        word: "never_steered",
        words: "never steered",
        meaning: "The participant drove straight on for the whole task.",
        tasks: |quality| quality.never_steered,
    },
    Look {
        word: "always_steered",
        words: "always steered",
        meaning: "A key was held in every step of the task.",
        tasks: |quality| quality.always_steered,
    },
    Look {
        word: "failed_checks",
        words: "failed check",
        meaning: "The participant answered the check of understanding wrongly. The number counts \
                  such attempts.",
        tasks: |quality| quality.failed_checks,
    },
    Look {
        word: "interrupted",
        words: "interrupted",
        meaning: "The participant could not drive all of the task: the page lost the focus or was \
                  hidden, an input was sampled more than 100 ms late, or the scene had been shown \
                  before.",
        tasks: |quality| quality.interrupted,
    },
    Look {
        word: "focus_lost",
        words: "focus lost",
        meaning: "The page lost the keyboard or was hidden during the task.",
        tasks: |quality| quality.focus_lost,
    },
    Look {
        word: "late_sample",
        words: "late samples",
        meaning: "An input was sampled well before or after it was due. The computer was busy.",
        tasks: |quality| quality.late_sample,
    },
    Look {
        word: "danger_entered",
        words: "danger zone",
        meaning: "The vehicle entered the robot’s danger zone. This is behaviour, not a fault.",
        tasks: |quality| quality.danger_entered,
    },
];

/// A stage in words.
pub(in super::super) fn stage_words(stage: Stage) -> &'static str {
    match stage {
        Stage::Joined => "joined",
        Stage::Familiarisation => "familiarisation",
        Stage::Practice => "practice",
        Stage::Task => "tasks",
        Stage::Closing => "questions",
        Stage::Complete => "complete",
        Stage::ScreenedOut => "screened out",
        Stage::Withdrawn => "withdrawn",
        Stage::Imported => "imported",
    }
}

/// The table of the participants on this page of the list. Only users who may download data see
/// external ids and codes.
pub(super) fn table(page: &ParticipantPage, selection: &Selection, identities: bool) -> Node {
    let sort = if selection.sort.is_empty() { "number" } else { &selection.sort };
    let column = |words: &'static str, word: &'static str| {
        let head = el("th").attr("scope", "col");
        if word.is_empty() {
            return head.text(words);
        }
        let (order, arrow) = match (sort == word, selection.descending) {
            (false, _) => ("none", ""),
            (true, true) => ("descending", " ↓"),
            (true, false) => ("ascending", " ↑"),
        };
        let press = button(&format!("sort-{word}"), Msg::Sort(word)).class("plain");
        head.attr("aria-sort", order).child(press.text(format!("{words}{arrow}")))
    };
    let mut columns = vec![column("Participant", "number")];
    if identities {
        columns.push(column("External id", ""));
    }
    columns.extend([
        column("Stage", ""),
        column("Scenes", "stored"),
        column("Last seen", "last_seen"),
        column("Check", "comprehension_attempts"),
        column("To look at", ""),
    ]);
    if identities {
        columns.push(column("Code", ""));
    }
    let rows = page.participants.iter().map(|person| row(person, identities));
    el("table")
        .class("people")
        .test_id("participants")
        .child(el("thead").child(el("tr").children(columns)))
        .child(el("tbody").children(rows))
}

fn row(person: &ParticipantSummary, identities: bool) -> Node {
    let of = person.planned.max(person.stored);
    let progress = el("td")
        .class("progress")
        .child(
            el("progress")
                .attr("max", of.max(1))
                .attr("value", person.stored)
                .attr("aria-label", format!("{} of {of} scenes stored", person.stored)),
        )
        .text(format!("{} / {of}", person.stored))
        .children((person.waiting > 0).then(|| {
            el("span")
                .class("chip look")
                .attr(
                    "title",
                    "Driven, and not uploaded yet when the server last stored a trial of this \
                     participant. They wait safely in the browser.",
                )
                .text(format!("{} waiting", person.waiting))
        }));
    let check = match (person.comprehension_attempts, person.understood) {
        (0, _) => cell("–"),
        (1, true) => cell("passed"),
        (tries, true) => cell(format!("passed, {tries} tries")),
        (tries, false) => cell(format!("{tries} wrong")).class("waiting"),
    };
    let code = |text: &Option<String>| match text {
        Some(text) => el("td").child(el("code").text(text)),
        None => cell("–"),
    };
    let stage = el("td").child(
        el("span")
            .class(if person.stage == Stage::Complete { "chip open" } else { "chip" })
            .text(stage_words(person.stage)),
    );
    let link = el("a")
        .attr("href", format!("/lab/participants/{}", person.participant_id))
        .test_id("participant-link")
        .text(person.number.to_string());
    let mut cells = vec![el("th").attr("scope", "row").child(link)];
    if identities {
        cells.push(code(&person.external_id));
    }
    cells.extend([
        stage,
        progress,
        el("td").child(el("time").moment(person.last_seen_at_ms)),
        check,
        el("td")
            .class("looks")
            .children(person.excluded.then(|| el("span").class("chip look").text("excluded")))
            .children(looks(&person.quality)),
    ]);
    if identities {
        cells.push(code(&person.completion_code));
    }
    el("tr").key(&person.participant_id).children(cells)
}

/// The flags, each with its number of tasks.
pub(in super::super) fn looks<M>(quality: &Quality) -> impl Iterator<Item = view::Node<M>> {
    LOOKS.iter().filter_map(|look| {
        let tasks = (look.tasks)(quality);
        let chip =
            el("span").class(&format!("chip look {}", look.word)).attr("title", look.meaning);
        (tasks > 0).then(|| chip.text(format!("{} {tasks}", look.words)))
    })
}

/// Explains the flags in the column “To look at”.
pub(super) fn meanings() -> Node {
    let meaning =
        |look: &Look| el("div").child(el("dt").text(look.words)).child(el("dd").text(look.meaning));
    el("details")
        .class("meanings")
        .child(el("summary").text("What “To look at” means"))
        .child(el("p").class("quiet").text(
            "Each number counts tasks, first and further attempts (of failed checks: answers). None alone is a reason \
             to exclude a participant. Participants are in doubt if they steered in no task, or throughout every task, \
             or if their timing is identical.",
        ))
        .child(el("dl").children(LOOKS.iter().map(meaning)))
}
