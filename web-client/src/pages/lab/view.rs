//! What an experimenter sees.

use super::{Lab, Page, Place};
use crate::view::{Node, el};
use sidestep::api::{TrialSummary, routes};

pub(super) fn page(lab: &Lab) -> Node {
    let content = match &lab.page {
        Page::Loading => el("main").class("card").child(el("p").class("quiet").text("Loading…")),
        Page::SignIn { busy } => sign_in(lab, *busy),
        Page::Trials => trials(lab),
        Page::Replay(replay) => replay.view(),
        Page::SelfCheck { here, server } => self_check(here, server),
        Page::Stuck(why) => stuck(why),
    };
    let signed_in = !matches!(lab.page, Page::SignIn { .. });
    el("div").class("lab").child(header(lab, signed_in)).child(content)
}

fn header(lab: &Lab, signed_in: bool) -> Node {
    let link = |place: &Place, href: &str, words: &str| {
        el("a").attr("href", href).attr_if(lab.place == *place, "aria-current", "page").text(words)
    };
    let about = match &lab.page {
        Page::Replay(replay) => {
            let trial = replay.trial();
            let summary = &trial.summary;
            format!(
                "{} / participant {} / {} {}",
                trial.study,
                summary.participant_number,
                summary.phase.word(),
                summary.index + 1
            )
        }
        _ => String::new(),
    };
    let nav = el("nav").attr("aria-label", "Laboratory").children([
        link(&Place::Trials, "/lab", "Trials"),
        link(&Place::SelfCheck, "/lab/self-check", "Self-check"),
    ]);
    let end = el("span").class("end").child(el("span").class("quiet").text(about)).child(
        el("button")
            .class("plain")
            .attr("type", "button")
            .action("sign-out")
            .test_id("sign-out")
            .text("Sign out"),
    );
    el("header")
        .class("top")
        .child(el("a").class("brand").attr("href", "/").text("Sidestep"))
        .children(signed_in.then_some(nav))
        .children(signed_in.then_some(end))
}

fn sign_in(lab: &Lab, busy: bool) -> Node {
    el("main").class("card")
        .child(el("h1").text("Laboratory"))
        .child(el("p").text("Sign in with the experimenter’s key. It was printed, with a sign-in link, when the server was started for the first time."))
        .child(el("form").attr("data-action", "sign-in")
            .child(el("label").attr("for", "key").text("Experimenter’s key"))
            .child(el("input").attr("id", "key").attr("name", "key").attr("type", "password").attr("autocomplete", "current-password").attr("required", "").attr("data-autofocus", "").test_id("key"))
            .child(el("button").class("primary").attr("type", "submit").attr_if(busy, "disabled", "").test_id("sign-in").text("Sign in")))
        .children(lab.trouble.as_ref().map(|text| el("p").class("trouble").attr("role", "alert").test_id("trouble").text(text)))
        .child(el("p").class("quiet").text("Lost it? Restart the server with --new-admin-key."))
}

fn trials(lab: &Lab) -> Node {
    let Some(study) = lab.studies.first() else {
        return stuck("There is no study.");
    };
    let count = |n: u64, one: &str, many: &str| format!("{n} {}", if n == 1 { one } else { many });
    let head = el("div")
        .class("page-head")
        .child(el("div").child(el("h1").text(&study.title)).child(el("p").class("quiet").text(
            format!(
                "{} · {}",
                count(study.participants, "participant", "participants"),
                count(study.trials, "stored trial", "stored trials")
            ),
        )))
        .child(
            el("div")
                .class("actions")
                .child(
                    el("a")
                        .class("button")
                        .attr("href", format!("/s/{}", study.slug))
                        .test_id("drive")
                        .text("Drive a scene"),
                )
                .child(
                    el("a")
                        .class("button")
                        .attr("href", routes::export(&study.slug))
                        .attr("download", "")
                        .test_id("export")
                        .text("Export CSV"),
                ),
        );
    let body = if lab.trials.is_empty() {
        el("div").class("empty")
            .child(el("p").text("No trials yet."))
            .child(el("p").class("quiet").text("Drive a scene yourself, or send participants the address of the study. What they drive appears here, ready to replay."))
    } else {
        let columns =
            ["Participant", "Scene", "Closest", "Danger zone", "Turned", "Stored", "Flags", ""];
        let columns = columns.map(|words| el("th").attr("scope", "col").text(words));
        el("div").class("scroll").child(
            el("table")
                .class("trials")
                .test_id("trials")
                .child(el("thead").child(el("tr").children(columns)))
                .child(el("tbody").children(lab.trials.iter().map(trial_row))),
        )
    };
    let more = lab.next_before.map(|_| {
        el("button").class("plain").attr("type", "button").action("more").text("Show older trials")
    });
    el("main").class("page").child(head).child(body).children(more)
}

fn trial_row(trial: &TrialSummary) -> Node {
    let outcome = &trial.outcome;
    let danger = outcome
        .first_step_in_danger
        .map_or_else(|| "kept clear".to_owned(), |step| format!("from step {step}"));
    let turned = outcome
        .avoidance
        .map_or_else(|| "never".to_owned(), |(first, last)| format!("steps {first}–{last}"));
    let flags: Vec<_> = trial.flags.iter().map(|flag| flag.word().replace('_', " ")).collect();
    let cell = |words: String| el("td").text(words);
    let replay = format!("/lab/replay/{}", trial.trial_id);
    let words = format!(
        "Replay participant {}, {} {}",
        trial.participant_number,
        trial.phase.word(),
        trial.index + 1
    );
    el("tr").children([
        cell(trial.participant_number.to_string()),
        cell(format!("{} {}", trial.phase.word(), trial.index + 1)),
        cell(format!("{:.2} m", outcome.closest_m)),
        cell(danger).class(if outcome.first_step_in_danger.is_some() { "robot" } else { "" }),
        cell(turned),
        el("td").child(el("time").attr("data-ms", trial.received_at_ms)),
        cell(flags.join(", ")),
        el("td").child(
            el("a")
                .attr("href", replay)
                .attr("aria-label", words)
                .test_id("replay-link")
                .text("Replay"),
        ),
    ])
}

fn self_check(here: &str, server: &sidestep::api::SelfCheck) -> Node {
    let same = here == server.fingerprint;
    let verdict = if same {
        "This browser and the server simulate alike, bit for bit."
    } else {
        "This browser and the server do not simulate alike. Please report both fingerprints."
    };
    let row = |name: &str, id: &str, value: &str| {
        el("div")
            .child(el("dt").text(name))
            .child(el("dd").child(el("code").test_id(id).text(value)))
    };
    el("main")
        .class("card wide")
        .child(el("h1").text("Self-check"))
        .child(
            el("p").class(if same { "saved" } else { "trouble" }).test_id("verdict").text(verdict),
        )
        .child(el("p").class("quiet").text(format!(
            "SHA-256 of every state of {} random trials, seed {}.",
            server.trials, server.seed
        )))
        .child(el("dl").class("facts").children([
            row("here", "fingerprint-here", here),
            row("server", "fingerprint-server", &server.fingerprint),
        ]))
}

fn stuck(why: &str) -> Node {
    el("main")
        .class("card")
        .child(el("h1").text("This does not work"))
        .child(el("p").test_id("stuck").text(why))
        .child(el("p").child(el("a").attr("href", "/lab").text("Back to the trials")))
}
