//! What a participant sees around the canvas.

use super::{Msg, Participant, PlannedTrial, Stage};
use crate::json::number;
use crate::pages::parts::{self, alert, count};
use crate::view::{self, el};
use sidestep::api::StudyInfo;
use sidestep::study::PhaseConfig;
use sidestep::trial::Phase;

type Node = view::Node<Msg>;

pub(super) fn page(page: &Participant) -> Node {
    let content = match &page.stage {
        Stage::Loading => note("Loading…", &[]),
        Stage::Stuck(heading, why) => note(heading, &[why]).test_id("stuck"),
        Stage::Welcome | Stage::Enrolling => welcome(page),
        Stage::Instructions => instructions(page),
        Stage::Ready => ready(page),
        Stage::Still(trial, _) | Stage::Driving(trial, _) => scene(page, trial),
        Stage::Finishing => finishing(page),
        Stage::Done(code) => done(code),
    };
    let is_done = matches!(page.stage, Stage::Done(_));
    let not_kept = page.not_kept.filter(|_| !is_done).map(|reason| {
        let advice = "Keep this page open until you have your completion code.";
        alert("not-kept", &format!("{} {advice}", reason.sentence()))
    });
    let trouble = page.trouble.as_deref().map(|why| alert("trouble", why));
    el("div").class("participant").child(content).children(trouble).children(not_kept)
}

/// A card whose heading takes the focus when the card appears.
fn card(heading: &str) -> Node {
    el("main").class("card").key(heading).child(parts::heading(heading))
}

fn note(heading: &str, lines: &[&str]) -> Node {
    card(heading).children(lines.iter().map(|line| el("p").text(*line)))
}

fn button(test_id: &str, message: Msg, words: &str) -> Node {
    parts::button(test_id, message).class("primary").text(words)
}

fn kbd(key: &str) -> Node {
    el("kbd").text(key)
}

fn welcome(page: &Participant) -> Node {
    let (title, scenes, minutes) = page.study.as_ref().map_or(("", 0, 0), |study| {
        let scenes: usize = study.phases.iter().map(|phase| phase.scenes).sum();
        let driving_s = scenes as f64 * (study.parameters.duration_s() + 5.0);
        (study.title.as_str(), scenes, (driving_s / 60.0).ceil() as usize)
    });
    let busy = matches!(page.stage, Stage::Enrolling);
    let (scenes, minutes) = (count(scenes, "short scene"), count(minutes, "minute"));
    let facts = [
        format!(
            "You will drive {scenes}. That takes about {minutes}, and you may pause between scenes."
        ),
        "You need a keyboard with arrow keys.".to_owned(),
        "We record how the vehicles move, which steering keys you press and when, your language \
         and your screen size. We do not ask for your name."
            .to_owned(),
        "Taking part is voluntary. You can stop at any time by closing this page.".to_owned(),
    ];
    let consent = button("consent", Msg::Consent, "I agree and want to take part");
    card(title)
        .child(el("p").class("lead").text("A study of how people keep clear of a robot."))
        .child(el("ul").children(facts.map(|fact| el("li").text(fact))))
        .child(consent.attr_if(busy, "disabled", ""))
}

fn instructions(page: &Participant) -> Node {
    let (radius, zone, duration) = page.study.as_ref().map_or((0.0, "", 0.0), |study| {
        (study.parameters.danger_radius_m, zone_words(study), study.parameters.duration_s())
    });
    let (radius, duration) = (number(radius), number(duration));
    let strong = |class: &str, words: &str| el("strong").class(class).text(words);
    let points = [
        el("li")
            .child(strong("human", "You steer the blue vehicle."))
            .text(" It never stops. Hold ")
            .child(kbd("←"))
            .text(" to turn left, ")
            .child(kbd("→"))
            .text(" to turn right, and no key to go straight. ")
            .child(kbd("A"))
            .text(" and ")
            .child(kbd("D"))
            .text(" work too. If you hold two keys, the one pressed last counts."),
        el("li")
            .child(strong("robot", "The red robot drives straight to the red square."))
            .text(" It does not see you and will not avoid you."),
        el("li").text(format!(
            "Keep out of the robot’s danger zone: the disc of {radius} m around it. {zone}"
        )),
        el("li").text(
            "If nobody turns, you will collide. Start steering when you feel in danger; stop \
             when you think you will stay clear.",
        ),
        el("li").text(format!(
            "The dot at the tail of each arrow marks its exact position. A scene takes \
             {duration} seconds."
        )),
    ];
    card("How it works").child(picture()).child(el("ul").children(points)).child(button(
        "continue",
        Msg::Continue,
        "I am ready",
    ))
}

/// In which scenes the danger zone is drawn.
fn zone_words(study: &StudyInfo) -> &'static str {
    let shown = |phase: &&PhaseConfig| phase.show_danger_zone;
    let shown: Vec<_> = study.phases.iter().filter(shown).map(|phase| phase.phase).collect();
    match shown[..] {
        [] => "The picture above shows it; the scenes do not.",
        [Phase::Familiarisation] => "The warm-up scenes show it; the later ones do not.",
        _ if shown.len() == study.phases.len() => "Every scene shows it.",
        _ => "Only some scenes show it.",
    }
}

/// A still of a scene, with the danger zone.
fn picture() -> Node {
    let arrow = |class: &str, transform: &str| {
        el("g")
            .class(class)
            .attr("transform", transform)
            .child(el("circle").attr("r", "4.5"))
            .child(el("path").attr("d", "M0-1.6H34V-7L50 0L34 7V1.6H0Z"))
    };
    let words = "The robot, with its danger zone, drives from the left to its goal on the right. \
                 Your vehicle comes from below.";
    let goal = [("x", "412"), ("y", "79"), ("width", "17"), ("height", "17")];
    el("svg")
        .class("still")
        .attrs([("viewBox", "0 0 480 150"), ("role", "img"), ("aria-label", words)])
        .child(el("circle").class("zone").attrs([("cx", "110"), ("cy", "60"), ("r", "46")]))
        .child(el("path").class("way").attr("d", "M160 64L412 87"))
        .child(el("rect").class("goal").attrs(goal))
        .child(arrow("robot", "translate(110 60) rotate(5)"))
        .child(arrow("human", "translate(300 140) rotate(-112)"))
}

fn phase_words(trial: &PlannedTrial) -> String {
    let name = match trial.phase {
        Phase::Familiarisation => "Warm-up",
        Phase::Practice => "Practice",
        Phase::Task => "Task",
    };
    format!("{name} {} of {}", trial.scene.index + 1, trial.of_phase)
}

/// What to know before this scene.
fn hint(page: &Participant, trial: &PlannedTrial) -> String {
    if trial.scene.index > 0 {
        return "Take your time, then start.".to_owned();
    }
    let purpose = match trial.phase {
        Phase::Familiarisation => "Try the keys.",
        Phase::Practice => "These scenes are for practice.",
        Phase::Task if trial.id() == page.plan[0].id() => "Every scene counts.",
        Phase::Task => "Practice is over. From now on, every scene counts.",
    };
    let before = page.plan.iter().take_while(|other| other.id() != trial.id()).last();
    let zone = match (before.is_some_and(|trial| trial.show_danger_zone), trial.show_danger_zone) {
        (true, false) => " The danger zone is no longer shown.",
        (false, true) => " The danger zone is drawn around the robot.",
        _ => "",
    };
    format!("{purpose}{zone}")
}

fn ready(page: &Participant) -> Node {
    let Some(trial) = page.next() else {
        return note("One moment…", &[]);
    };
    let phase = phase_words(trial);
    let help = el("p")
        .class("quiet")
        .text("Press ")
        .child(kbd("Space"))
        .text(" or the button. After a short pause, the scene starts.");
    let card = el("main")
        .class("card small")
        .key(&phase)
        .child(el("h1").text(phase))
        .child(el("p").text(hint(page, trial)))
        .child(button("start", Msg::Start, "Start").focus())
        .child(help);
    el("div").class("stage").child(bar(page, trial)).child(card)
}

fn scene(page: &Participant, trial: &PlannedTrial) -> Node {
    let canvas = el("canvas")
        .attrs([("id", "scene"), ("role", "img")])
        .attr("aria-label", "Two vehicles seen from above: yours is blue, the robot is red.")
        .test_id("scene");
    let heading = el("h1").class("unseen").text(phase_words(trial));
    el("div")
        .class("stage")
        .child(bar(page, trial))
        .child(el("main").class("field").key("scene").child(heading).child(canvas))
        .child(el("footer").class("keys").attr("aria-hidden", "true").children([
            el("span").child(kbd("←")).text(" turn left"),
            el("span").text("no key: straight"),
            el("span").child(kbd("→")).text(" turn right"),
        ]))
}

fn bar(page: &Participant, trial: &PlannedTrial) -> Node {
    let done = page.plan.iter().filter(|trial| page.is_driven(trial)).count();
    let progress = el("progress")
        .attr("max", page.plan.len())
        .attr("value", done)
        .attr("aria-label", "Scenes driven");
    el("header")
        .class("bar")
        .child(el("span").text(phase_words(trial)))
        .child(progress)
        .child(saved(page))
}

/// Whether the driven scenes are stored.
fn saved(page: &Participant) -> Node {
    let waiting = page.outbox.len();
    let (class, words) = if waiting == 0 {
        ("saved", if page.stored.is_empty() { "" } else { "✓ saved" }.to_owned())
    } else if !page.outbox.is_struggling() {
        ("quiet", "saving…".to_owned())
    } else {
        let place = match (page.outbox.is_safe(), waiting) {
            (true, 1) => "it is safe in this browser.",
            (true, _) => "they are safe in this browser.",
            (false, _) => "keep this page open.",
        };
        ("waiting", format!("{} not uploaded yet; {place}", count(waiting, "scene")))
    };
    el("span").class(class).attr("role", "status").test_id("saved").text(words)
}

fn finishing(page: &Participant) -> Node {
    let waiting = match page.outbox.len() {
        0 => "All scenes are uploaded. Your completion code is on its way.".to_owned(),
        n => format!("{} left to upload. Please keep this page open.", count(n, "scene")),
    };
    card("Uploading your last scenes…").child(el("p").text(waiting)).child(saved(page))
}

fn done(code: &str) -> Node {
    card("Thank you!")
        .child(
            el("p").text("You have driven every scene, and all are stored. Your completion code:"),
        )
        .child(el("p").class("code").test_id("completion-code").text(code))
        .child(el("p").class("quiet").text("You may close this page."))
}
