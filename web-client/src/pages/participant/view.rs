//! What a participant sees around the canvas.

use super::{Leg, Participant, Stage};
use crate::view::{Node, el};
use sidestep::trial::Phase;

pub(super) fn page(page: &Participant) -> Node {
    let content = match &page.stage {
        Stage::Loading => note("Loading…", &[], None),
        Stage::Stuck(why) => note("This does not work", &[why], None).test_id("stuck"),
        Stage::Welcome | Stage::Enrolling => welcome(page),
        Stage::Instructions => instructions(page),
        Stage::Ready => ready(page),
        Stage::Still(_) | Stage::Driving(_) => scene(page),
        Stage::Finishing => finishing(page),
        Stage::Done(code) => done(code),
    };
    let trouble = page
        .trouble
        .as_ref()
        .map(|text| el("p").class("trouble").attr("role", "alert").test_id("trouble").text(text));
    el("div").class("participant").child(content).children(trouble)
}

fn card(heading: &str) -> Node {
    el("main").class("card").child(el("h1").text(heading))
}

fn note(heading: &str, lines: &[&str], action: Option<Node>) -> Node {
    let lines = lines.iter().map(|line| el("p").text(*line));
    card(heading).children(lines).children(action)
}

fn button(words: &str, action: &str) -> Node {
    el("button")
        .class("primary")
        .attr("type", "button")
        .attr("data-autofocus", "")
        .action(action)
        .test_id(action)
        .text(words)
}

fn welcome(page: &Participant) -> Node {
    let (title, scenes, minutes) = page.study.as_ref().map_or(("", 0, 0), |study| {
        let scenes: usize = study.phases.iter().map(|phase| phase.scenes).sum();
        let driving_s = scenes as f64 * (study.parameters.duration_s() + 5.0);
        (study.title.as_str(), scenes, (driving_s / 60.0).ceil() as usize)
    });
    let busy = matches!(page.stage, Stage::Enrolling);
    let facts = [
        format!("You will drive {scenes} short scenes. That takes about {minutes} minutes, and you may pause between scenes."),
        "You need a keyboard with arrow keys.".to_owned(),
        "We record how the vehicles move, which of the steering keys you press and when, your language and the size of your screen. We do not ask for your name.".to_owned(),
        "Taking part is voluntary. You can stop at any time by closing this page.".to_owned(),
    ];
    card(title)
        .child(el("p").class("lead").text("A study of how people keep clear of a robot."))
        .child(el("ul").children(facts.into_iter().map(|fact| el("li").text(fact))))
        .child(button("I agree and want to take part", "consent").attr_if(busy, "disabled", ""))
}

fn instructions(page: &Participant) -> Node {
    let radius = page.study.as_ref().map_or(0.0, |study| study.parameters.danger_radius_m);
    card("How it works")
        .child(picture())
        .child(el("ul").children([
            el("li").child(el("strong").class("human").text("You steer the blue vehicle."))
                .text(" It never stops: hold ").child(el("kbd").text("←")).text(" to turn left, ")
                .child(el("kbd").text("→")).text(" to turn right, no key to go straight. ")
                .child(el("kbd").text("A")).text(" and ").child(el("kbd").text("D")).text(" work too."),
            el("li").child(el("strong").class("robot").text("The red robot drives straight to the red square."))
                .text(" It does not see you and will not avoid you."),
            el("li").text(format!("Keep out of the robot’s danger zone: the disc of {radius} m around it, shown above and in the first scenes only.")),
            el("li").text("If nobody turns, you will collide. Steer from when you feel danger until you think that you will stay clear without steering."),
            el("li").text("The tail of each arrow, its dot, marks the exact position. A scene takes ten seconds."),
        ]))
        .child(button("I am ready", "continue"))
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
    el("svg").class("still").attr("viewBox", "0 0 480 150").attr("role", "img")
        .attr("aria-label", "The robot with its danger zone on the left drives to its goal on the right; your vehicle comes from below.")
        .child(el("circle").class("zone").attr("cx", "110").attr("cy", "60").attr("r", "46"))
        .child(el("path").class("way").attr("d", "M160 64L412 87"))
        .child(el("rect").class("goal").attr("x", "412").attr("y", "79").attr("width", "17").attr("height", "17"))
        .child(arrow("robot", "translate(110 60) rotate(5)"))
        .child(arrow("human", "translate(300 140) rotate(-112)"))
}

fn phase_words(leg: &Leg) -> String {
    let name = match leg.phase {
        Phase::Familiarisation => "Warm-up",
        Phase::Practice => "Practice",
        Phase::Task => "Task",
    };
    format!("{name} {} of {}", leg.planned.index + 1, leg.of_phase)
}

fn ready(page: &Participant) -> Node {
    let Some(leg) = page.next() else {
        return note("One moment…", &[], None);
    };
    let hint = match (leg.phase, leg.planned.index) {
        (Phase::Familiarisation, 0) => "Try the keys. The danger zone is drawn around the robot.",
        (Phase::Practice, 0) => {
            "From now on the danger zone is not drawn. These scenes are for practice."
        }
        (Phase::Task, 0) => "Practice is over. From here on every scene counts.",
        _ => "Take your time, then start.",
    };
    el("div").class("stage").child(bar(page, Some(leg))).child(
        note(&phase_words(leg), &[hint], Some(button("Start", "start"))).class("card small").child(
            el("p")
                .class("quiet")
                .text("Press ")
                .child(el("kbd").text("Space"))
                .text(" or the button. The scene stands still for a moment, then moves."),
        ),
    )
}

fn scene(page: &Participant) -> Node {
    let words = "Two vehicles seen from above: yours is blue, the robot is red.";
    el("div")
        .class("stage")
        .child(bar(page, page.next()))
        .child(
            el("canvas")
                .attr("id", "scene")
                .test_id("scene")
                .attr("role", "img")
                .attr("aria-label", words),
        )
        .child(el("footer").class("keys").attr("aria-hidden", "true").children([
            el("span").child(el("kbd").text("←")).text(" turn left"),
            el("span").text("no key: straight"),
            el("span").child(el("kbd").text("→")).text(" turn right"),
        ]))
}

fn bar(page: &Participant, leg: Option<&Leg>) -> Node {
    let done = page.course.iter().filter(|leg| {
        let id = &leg.planned.trial_id;
        page.stored.contains(id) || page.outbox.holds(id)
    });
    el("header")
        .class("bar")
        .child(el("span").text(leg.map(phase_words).unwrap_or_default()))
        .child(
            el("progress")
                .attr("max", page.course.len())
                .attr("value", done.count())
                .attr("aria-label", "Scenes driven"),
        )
        .child(saved(page))
}

fn saved(page: &Participant) -> Node {
    let waiting = page.outbox.len();
    let (class, words) = match (waiting, page.outbox.is_struggling()) {
        (0, _) if page.stored.is_empty() => ("quiet", String::new()),
        (0, _) => ("saved", "✓ saved".to_owned()),
        (_, false) => ("quiet", "saving…".to_owned()),
        (1, true) => ("waiting", "1 scene waits in this browser".to_owned()),
        (n, true) => ("waiting", format!("{n} scenes wait in this browser")),
    };
    el("span").class(class).attr("role", "status").test_id("saved").text(words)
}

fn finishing(page: &Participant) -> Node {
    let waiting = format!("{} still to be sent.", page.outbox.len());
    note("Sending your last scenes…", &["Please keep this page open.", &waiting], None)
        .child(saved(page))
}

fn done(code: &str) -> Node {
    card("Thank you!")
        .child(
            el("p").text(
                "You have driven every scene, and all of them are stored. Your completion code:",
            ),
        )
        .child(el("p").class("code").test_id("completion-code").text(code))
        .child(el("p").class("quiet").text("You may close this page."))
}
