//! The settings of a study that have one control each, in the order of the form.

/// The control of a setting.
#[derive(Clone, Copy)]
pub(super) enum Control {
    /// A field for a number, with this unit.
    Number(&'static str),
    Tick,
    /// A field for a single line of text.
    Line,
    /// A field for a few words.
    Short,
    /// A field for texts, separated by commas.
    Names,
    /// A field for one text for all languages, or for one text per language.
    Fact,
    /// A field for a long text in each language.
    Markdown,
    /// A selection list with these values and labels.
    Choice(&'static [(&'static str, &'static str)]),
}

/// A setting.
pub(super) struct Setting {
    /// The setting's path in the study, such as `trials.countdown_s`. The first part of the path
    /// selects the section.
    pub(super) path: &'static str,
    pub(super) control: Control,
    pub(super) label: &'static str,
    /// An explanation below the control. May be empty.
    pub(super) hint: &'static str,
}

const fn row(
    path: &'static str,
    control: Control,
    label: &'static str,
    hint: &'static str,
) -> Setting {
    Setting { path, control, label, hint }
}

use Control::{Choice, Fact, Line, Markdown, Names, Number, Short, Tick};

/// The hint for a return link.
const LINK: &str =
    "From the service, such as https://app.prolific.com/submissions/complete?cc=CODE; empty: none.";

/// All settings.
#[rustfmt::skip]
pub(super) const SETTINGS: &[Setting] = &[
    row("title", Line, "Title", "The heading of the first page, in every language."),
    row("slug", Line, "Name in addresses", "In addresses: /s/NAME. Lower-case letters, digits and hyphens. It can never be \
        changed after the study is created."),
    row("status", Choice(&[("closed", "closed"), ("open", "open")]), "The study begins", "Closed: you can try and rehearse \
        the study, but nobody can take part until you open it. Open: everybody with the link can take part as soon as the \
        study is created."),
    row("version", Short, "Label of this version", "For your own reference, in the list of versions."),
    row("seed", Number(""), "Seed of the scenes", "Another number gives participants other scenes."),
    row("synthetic", Tick, "Synthetic participants only", "For rehearsals: programs take part (sidestep simulate), and no \
        people. Every page, export and report says so. This cannot be changed once someone has taken part."),

    row("parameters.human.speed_mps", Number("m/s"), "Participant: speed", ""),
    row("parameters.human.turn_rate_radps", Number("rad/s"), "Participant: turn rate", ""),
    row("parameters.robot.speed_mps", Number("m/s"), "Robot: speed", ""),
    row("parameters.robot.turn_rate_radps", Number("rad/s"), "Robot: turn rate", ""),
    row("parameters.danger_radius_m", Number("m"), "Radius of the danger zone", ""),
    row("parameters.step_s", Number("s"), "Time between two inputs", ""),
    row("parameters.steps", Number("steps"), "Steps of a scene", ""),

    row("encounters.min_approach_rad", Number("rad"), "Least angle between the headings", ""),
    row("encounters.max_miss_share", Number("of the danger radius"), "Greatest miss distance", ""),
    row("encounters.min_entry_s", Number("s"), "Entry without a turn, earliest", ""),
    row("encounters.max_entry_s", Number("s"), "Entry without a turn, latest", ""),
    row("encounters.min_start_distance_m", Number("m"), "Distance at the start, least", ""),
    row("encounters.max_start_distance_m", Number("m"), "Distance at the start, greatest", ""),
    row("encounters.escape_clearance_m", Number("m"), "An escape keeps this distance from the danger zone", ""),
    row("encounters.escape_delay_s", Number("s"), "Participants can wait this long and still escape", ""),

    row("trials.countdown_s", Number("s"), "Countdown", ""),
    row("trials.end_s", Number("s"), "The last picture stays for", ""),
    row("trials.feedback_s", Number("s"), "With feedback, it stays for at least", "1.5 s or more."),
    row("trials.rest_after", Number("tasks"), "A rest is offered after", "0: no rests."),
    row("trials.repeat_interrupted", Tick, "An interrupted task is driven once more at the end", ""),
    row("trials.fullscreen", Tick, "Ask for the full screen", ""),

    row("consent.investigator", Fact, "Investigator", ""),
    row("consent.institution", Fact, "Institution", ""),
    row("consent.contact", Fact, "Contact", "An address that participants can write to."),
    row("consent.ethics", Fact, "Ethics approval", ""),
    row("consent.retention", Fact, "How long and where data are kept", ""),
    row("consent.text", Markdown, "What participants agree to (Markdown)", "Empty: Sidestep’s own text."),

    row("comprehension.standard", Tick, "Ask Sidestep’s questions on the robot, the keys and the danger zone", ""),
    row("comprehension.attempts", Number(""), "Attempts", "After this many attempts with a wrong answer, the participation \
        ends. 0: never."),
    row("comprehension.draw", Number(""), "Questions that each participant is asked", "Drawn at random from all, with six \
        standard questions. 0: all, with the three standard ones."),
    row("comprehension.after_wrong", Choice(&[
        ("mark", "each answer is marked as right or wrong"),
        ("renew", "other questions and orders, without saying which was wrong"),
        ("reread", "the same, after the instructions again"),
    ]), "After a wrong answer", ""),

    row("closing.debrief", Markdown, "Debriefing (Markdown)", "What participants read on the last page. Empty: only thanks."),

    row("recruitment.quota", Number(""), "Participants who complete, at most", "0: no limit."),
    row("recruitment.hold_min", Number("min"), "A place is held for", ""),
    row("recruitment.external_id", Names, "Parameters of the link with the person’s id", "Separated by commas. If a link has \
        several of them, the first in this list is used."),
    row("recruitment.require_external_id", Tick, "Require such an id", ""),
    row("recruitment.record", Names, "Other parameters of the link to store", ""),
    row("recruitment.return_hosts", Names, "Hosts that participants may be sent back to", "Such as app.prolific.com."),
    row("recruitment.completed_url", Line, "Return link after completion", LINK),
    row("recruitment.screened_out_url", Line, "Return link for people who are screened out", LINK),
    row("recruitment.withdrawn_url", Line, "Return link for people who withdraw", LINK),
    row("recruitment.finished_url", Line, "Return link for people who come again after they have finished", LINK),
    row("recruitment.full_url", Line, "Return link for people who come when the study is full", LINK),
    row("recruitment.closed_url", Line, "Return link for people who come when the study is closed", LINK),
];
