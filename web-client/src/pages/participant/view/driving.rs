//! The scenes, the hints before them, and the rests between them.

use super::Node;
use super::around::{card, hint, keyed, menu, paragraph, primary};
use crate::pages::participant::state::{PlannedTrial, Stage};
use crate::pages::participant::{Msg, Part, Participant};
use crate::texts::Sentences as _;
use crate::view::el;
use sidestep::trial::{Outcome, Phase};
use sidestep::vehicle::TurnInput;

fn phase_words(page: &Participant, trial: &PlannedTrial) -> String {
    let key = match trial.phase {
        _ if trial.scene.attempt > 1 => "ready.again",
        Phase::Familiarisation => "ready.familiarisation",
        Phase::Practice => "ready.practice",
        Phase::Task => "ready.task",
    };
    let place = trial.scene.index + 1;
    page.texts.get(key, &[("i", place.into()), ("n", trial.of_phase.into())])
}

/// Hints before this scene.
fn hints(page: &Participant, trial: &PlannedTrial) -> Vec<String> {
    if trial.scene.attempt > 1 {
        return vec![page.say("ready.why_again")];
    }
    if trial.scene.index > 0 {
        return vec![page.say("ready.take_time")];
    }
    let purpose = match trial.phase {
        Phase::Familiarisation => page.say("ready.try_keys"),
        Phase::Practice => page.texts.count("ready.for_practice", trial.of_phase, &[]),
        Phase::Task if trial.id() == page.plan[0].id() => page.say("ready.all_count"),
        Phase::Task => page.say("ready.now_counts"),
    };
    let before = page.plan.iter().take_while(|other| other.id() != trial.id()).last();
    let zone = match (before.is_some_and(|trial| trial.show_danger_zone), trial.show_danger_zone) {
        (true, false) => Some("ready.zone_gone"),
        (false, true) => Some("ready.zone_shown"),
        _ => None,
    };
    let mut words = vec![purpose];
    words.extend(zone.map(|key| page.say(key)));
    words
}

pub(super) fn ready(page: &Participant) -> Node {
    let Some(trial) = page.next() else { return card(&page.say("page.loading")) };
    let phase = phase_words(page, trial);
    let card = el("main")
        .class("card small")
        .key(&phase)
        .child(el("h1").text(phase))
        .children(hint(page))
        .child(paragraph(page.join(&hints(page, trial))))
        .child(primary("start", Msg::Start, &page.say("ready.start")).focus())
        .child(keyed(page, "p", "ready.how").class("quiet"))
        .child(menu(page));
    el("div").class("stage").child(bar(page, Some(trial))).child(card)
}

pub(super) fn rest(page: &Participant) -> Node {
    let done = page.plan.iter().filter(|trial| page.is_driven(trial)).count();
    let fills = [("done", done.into()), ("all", page.plan.len().into())];
    let go_on = primary("continue", Msg::Go(Part::Ready), &page.say("rest.continue"));
    let card = card(&page.say("rest.heading"))
        .class("card small")
        .test_id("rest")
        .child(paragraph(page.texts.get("rest.done", &fills)))
        .child(paragraph(page.say("rest.words")))
        .child(go_on)
        .child(menu(page));
    el("div").class("stage").child(bar(page, None)).child(card)
}

/// A scene during its countdown, in motion, or after its end. `outcome` is given only after the
/// end.
pub(super) fn scene(
    page: &Participant,
    trial: &PlannedTrial,
    left_s: Option<u32>,
    outcome: Option<&Outcome>,
) -> Node {
    let canvas = el("canvas")
        .attrs(&[("id", "scene"), ("role", "img")])
        .attr("aria-label", page.say("scene.canvas"))
        .test_id("scene");
    let heading = el("h1").class("unseen").text(phase_words(page, trial));
    let countdown = left_s.map(|seconds| {
        let waits = seconds <= 1 && !page.held.is_empty();
        let words = match waits {
            true => page.say("ready.release"),
            false => page.texts.number(f64::from(seconds)),
        };
        let class = if waits { "over words" } else { "over count" };
        el("p")
            .class(class)
            .key("countdown")
            .attr("role", "status")
            .test_id("countdown")
            .text(words)
    });
    let ended = outcome.map(|outcome| {
        let key = match (trial.feedback, outcome.first_step_in_danger) {
            (false, _) => "scene.over",
            (true, None) => "scene.clear",
            (true, Some(_)) => "scene.entered",
        };
        el("p")
            .class("over words")
            .key("over")
            .attr("role", "status")
            .test_id("over")
            .text(page.say(key))
    });
    let field = el("main")
        .class("field")
        .key("scene")
        .child(heading)
        .child(canvas)
        .children(countdown)
        .children(ended);
    el("div").class("stage").child(bar(page, Some(trial))).child(field).child(keys(page))
}

/// What the steering keys do, and which of them is held.
fn keys(page: &Participant) -> Node {
    let turn = page.held.turn(&page.steering.keys);
    let moves = matches!(page.stage, Stage::Driving(..) | Stage::Countdown(..));
    let class = |held: TurnInput| if moves && turn == held { "held" } else { "" };
    let key = |printed: &str, words: &str, held: TurnInput, id: &str| {
        el("span")
            .class(class(held))
            .test_id(id)
            .child(el("kbd").text(printed))
            .text(format!(" {}", page.say(words)))
    };
    // Names beside moving vehicles would distract, so the names are shown below the scene.
    let name = |of: &str, tail: &str, name: &str| el("b").class(of).text(tail).text(name);
    el("footer").class("keys").attr("aria-hidden", "true").children([
        name("human", "●▸ ", &page.names[0]),
        key(&page.steering.left, "scene.left", TurnInput::Left, "held-left"),
        el("span").text(page.say("scene.straight")),
        key(&page.steering.right, "scene.right", TurnInput::Right, "held-right"),
        name("robot", "■▸ ", &page.names[1]),
    ])
}

fn bar(page: &Participant, trial: Option<&PlannedTrial>) -> Node {
    let done = page.plan.iter().filter(|trial| page.is_driven(trial)).count();
    let progress = el("progress")
        .attr("max", page.plan.len())
        .attr("value", done)
        .attr("aria-label", page.say("page.scenes_driven"));
    let phase = trial.map_or_else(String::new, |trial| phase_words(page, trial));
    el("header").class("bar").child(el("span").text(phase)).child(progress).child(saved(page))
}

/// A message about whether the driven scenes are stored.
pub(super) fn saved(page: &Participant) -> Node {
    let waiting = page.outbox.len();
    let (class, words) = if waiting == 0 {
        let words = match page.stored.len() {
            0 => String::new(),
            n => page.texts.count("saved.all", n, &[]),
        };
        ("saved", words)
    } else if !page.outbox.is_struggling() {
        ("quiet", page.say("saved.sending"))
    } else {
        let key = if page.outbox.is_safe() { "saved.safe" } else { "saved.memory" };
        ("waiting", page.texts.count(key, waiting, &[]))
    };
    el("span").class(class).attr("role", "status").test_id("saved").text(words)
}
