//! The pages before the scenes: consent, keyboard and screen, instructions, and the comprehension
//! check.

use super::Node;
use super::around::{
    alert, button, card, hint, keyed, languages, menu, paragraph, primary, quiet, unanswered,
};
use crate::pages::participant::equipment::Equipment;
use crate::pages::participant::state::Quiz;
use crate::pages::participant::{Msg, Part, Participant};
use crate::texts::{Fill, Sentences as _};
use crate::view::el;
use sidestep::api::{CheckForm, StudyInfo};
use sidestep::study::PhaseConfig;
use sidestep::trial::Phase;

/// Estimated time between two scenes (s).
const BETWEEN_S: f64 = 3.0;

/// Estimated times for the consent text, the checks and the instructions together (s), and for each
/// question (s).
const READING_S: f64 = 150.0;
const QUESTION_S: f64 = 15.0;

pub(super) fn touch(page: &Participant) -> Node {
    let here = page.link.here();
    card(&page.say("touch.heading"))
        .test_id("touch")
        .child(paragraph(page.say("touch.why")))
        .child(paragraph(page.say("touch.link")))
        .child(el("p").class("address").text(here))
        .child(button("anyway", Msg::Go(Part::Welcome), &page.say("touch.anyway")))
        .children(languages(page))
}

pub(super) fn welcome(page: &Participant) -> Node {
    let Some(study) = &page.study else { return card("") };
    let texts = &page.texts;
    let scenes: usize = study.phases.iter().map(|phase| phase.scenes).sum();
    let course_s = study.parameters.duration_s() + f64::from(study.trials.countdown_s) + BETWEEN_S;
    let questions = texts.check.len() + texts.questions.len();
    let all_s = READING_S + QUESTION_S * questions as f64 + course_s * scenes as f64;
    let minutes = (all_s / 60.0).ceil() as usize;
    let count =
        [texts.count("welcome.scenes", scenes, &[]), texts.count("welcome.minutes", minutes, &[])];
    let recruited = page.link.external_id(study).is_some();
    let lines = [
        Some(page.join(&count)),
        Some(page.say("welcome.keyboard")),
        Some(page.say("welcome.recorded")),
        recruited.then(|| page.say("welcome.recruited")),
        Some(page.say("welcome.voluntary")),
    ];
    let own = page.texts.consent.as_deref().map(|html| el("div").class("prose").html(html));
    let fact = |(name, value): &(String, String)| {
        el("div")
            .child(el("dt").text(page.say(&format!("welcome.{name}"))))
            .child(el("dd").text(value))
    };
    let facts = (!page.texts.facts.is_empty()).then(|| {
        el("section")
            .class("about")
            .child(el("h2").text(page.say("welcome.facts")))
            .child(el("dl").class("facts").children(page.texts.facts.iter().map(fact)))
    });
    // The consent button does not take the focus, because a key press meant for scrolling must not
    // give consent.
    card(&study.title)
        .children(languages(page))
        .child(el("p").class("lead").text(page.say("welcome.lead")))
        .children(own)
        .child(el("ul").children(lines.into_iter().flatten().map(|line| el("li").text(line))))
        .children(facts)
        .child(primary("consent", Msg::Go(Part::Equipment), &page.say("welcome.agree")))
        .child(quiet(page.say("welcome.next")))
}

pub(super) fn equipment(page: &Participant, found: &Equipment) -> Node {
    let key = |printed: &str, words: &str, works: bool| {
        let state = match works {
            true => el("span").class("saved").text(format!("✓ {}", page.say("check.works"))),
            false => el("span").class("quiet").text(page.say("check.waiting")),
        };
        el("li")
            .class(if works { "done" } else { "" })
            .child(el("kbd").text(printed))
            .child(el("span").text(page.say(words)))
            .child(state)
    };
    let keys = match &found.choosing {
        Some(first) => {
            let words = if first.is_none() { "check.choose_left" } else { "check.choose_right" };
            let refused = found.refused.then(|| alert("taken", &page.say("check.taken")));
            el("div")
                .class("prose")
                .key("choosing")
                .child(paragraph(page.say(words)).attr("role", "status").test_id("choosing"))
                .children(refused)
        }
        None => {
            el("div").class("prose").key("pressing").child(keyed(page, "p", "check.press")).child(
                el("div").attr("role", "status").child(el("ul").class("checks").children([
                    key(&page.steering.left, "check.left", found.left),
                    key(&page.steering.right, "check.right", found.right),
                ])),
            )
        }
    };
    let is_usual = page.steering.left == "←" && found.choosing.is_none();
    let change = match is_usual {
        true => button("choose-keys", Msg::ChooseKeys(true), &page.say("check.change")),
        false => button("usual-keys", Msg::ChooseKeys(false), &page.say("check.standard")),
    };
    let screen = match Equipment::is_small(&page.context.screen) {
        true => el("span").class("waiting").text(page.say("check.screen_small")),
        false => el("span").class("saved").text(format!("✓ {}", page.say("check.screen_good"))),
    };
    let frames = match found.rate_hz() {
        None => el("span").class("quiet").text(page.say("check.frames_measuring")),
        Some(hz) => {
            let (class, key) = match hz < 30.0 {
                true => ("waiting", "check.frames_low"),
                false => ("saved", "check.frames_good"),
            };
            let words = page.texts.get(key, &[("hz", hz.into())]);
            el("span").class(class).text(if hz < 30.0 { words } else { format!("✓ {words}") })
        }
    };
    let fact = |key: &str, state: Node| {
        el("div").child(el("dt").text(page.say(key))).child(el("dd").child(state))
    };
    let is_ready = found.left && found.right && !found.is_measuring() && !found.is_enrolling;
    let go_on = primary("continue", Msg::Go(Part::Enrolment), &page.say("check.continue"));
    card(&page.say("check.heading"))
        .test_id("equipment")
        .child(keys)
        .child(change.class("plain"))
        .child(
            el("dl")
                .class("facts")
                .child(fact("check.screen", screen))
                .child(fact("check.frames", frames)),
        )
        .child(go_on.attr_if(!is_ready, "disabled", ""))
}

pub(super) fn instructions(page: &Participant) -> Node {
    let Some(study) = &page.study else { return card("") };
    let strong = |class: &str, key: &str| el("strong").class(class).text(page.say(key));
    let radius = [("radius", Fill::Number(study.parameters.danger_radius_m))];
    let seconds = [("seconds", Fill::Number(study.parameters.duration_s()))];
    let zone = [page.texts.get("instructions.zone", &radius), page.say(zone_words(study))];
    let dot = [page.say("instructions.dot"), page.texts.get("instructions.duration", &seconds)];
    let points = [
        el("li")
            .child(strong("human", "instructions.you"))
            .text(page.say("page.between"))
            .child(keyed(page, "span", "instructions.keys")),
        el("li")
            .child(strong("robot", "instructions.robot"))
            .text(page.say("page.between"))
            .text(page.say("instructions.robot_why")),
        el("li").text(page.join(&zone)),
        el("li").text(page.say("instructions.when")),
        el("li").text(page.join(&dot)),
    ];
    let canvas = el("canvas")
        .attrs(&[("id", "arena"), ("role", "img")])
        .attr("aria-label", page.say("instructions.picture"))
        .test_id("arena");
    card(&page.say("instructions.heading"))
        .class("card wide")
        .children(hint(page))
        .child(el("div").class("arena").child(canvas))
        .child(keyed(page, "p", "instructions.try").class("quiet"))
        .child(el("ul").children(points))
        .child(primary("continue", Msg::Go(Part::Understanding), &page.say("instructions.ready")))
        .child(menu(page))
}

/// The key of the sentence about the scenes in which the danger zone is visible.
fn zone_words(study: &StudyInfo) -> &'static str {
    let shown = |phase: &&PhaseConfig| phase.show_danger_zone;
    let shown: Vec<_> = study.phases.iter().filter(shown).map(|phase| phase.phase).collect();
    match shown[..] {
        [] => "instructions.zone_never",
        _ if shown.len() == study.phases.len() => "instructions.zone_always",
        [Phase::Familiarisation] => "instructions.zone_familiarisation",
        _ => "instructions.zone_some",
    }
}

pub(super) fn comprehension(page: &Participant, quiz: &Quiz) -> Node {
    let Some(study) = &page.study else { return card("") };
    let heading = page.say("comprehension.heading");
    let is_stored = page.progress.as_ref().is_some_and(|progress| progress.understood);
    if quiz.is_passed {
        let words = page.say("comprehension.all_right");
        let go_on = primary("continue", Msg::Go(Part::Ready), &page.say("check.continue"));
        return card(&page.say("comprehension.passed"))
            .child(el("p").class("saved").attr("role", "status").text(words))
            .child(go_on.attr_if(!is_stored, "disabled", ""));
    }
    let question = |(place, form): (usize, &CheckForm)| {
        let chosen = quiz.chosen.get(place).copied().flatten();
        let result = quiz.is_marked.then(|| match chosen {
            Some(chosen) if chosen == form.answer => {
                el("p").class("saved").text(page.say("comprehension.right"))
            }
            _ => el("p").class("trouble").text(page.say("comprehension.wrong")),
        });
        let options = form.options.iter().enumerate().map(|(option, words)| {
            let input = el("input")
                .attrs(&[("type", "radio")])
                .attr("name", format!("check-{place}"))
                .attr("value", option)
                .test_id(&format!("check-{place}-{option}"))
                .attr_if(page.link.simulates() && option == form.answer, "data-right", "");
            el("label").child(input).child(el("span").text(filled(study, page, words)))
        });
        let missing = quiz.is_incomplete && chosen.is_none();
        let legend = el("legend").text(filled(study, page, &form.text));
        el("fieldset")
            .key(format!("{}-{place}", quiz.drawn_at))
            .attr("role", "radiogroup")
            .attr_if(missing, "aria-invalid", "true")
            .child(legend.children(missing.then(|| unanswered(page))))
            .children(options)
            .children(result)
    };
    let limit = study.comprehension_attempts;
    let left = (limit > 0 && quiz.attempts > 0).then(|| {
        let left = limit.saturating_sub(quiz.attempts);
        quiet(page.texts.count("comprehension.attempts_left", left, &[]))
    });
    let missing = quiz.is_incomplete.then(|| alert("missing", &page.say("comprehension.missing")));
    let submit = el("button").class("primary").attr("type", "submit").test_id("submit");
    let again = page.say("comprehension.again");
    // With this key, new questions count as a new page, which is shown from its top.
    card(&heading)
        .key(quiz.drawn_at)
        .children(hint(page))
        .child(paragraph(page.say("comprehension.why")))
        .child(
            el("form")
                .class("questions")
                .test_id("comprehension")
                .on_submit(Msg::Checked)
                .children(page.texts.check.iter().enumerate().map(question))
                .children(missing)
                .children(left)
                .child(submit.text(page.say("comprehension.submit"))),
        )
        .child(button("again", Msg::Go(Part::Instructions), &again).class("plain"))
        .child(menu(page))
}

/// Fills facts about the study into a sentence, which is either a standard sentence or one written
/// by the researcher.
fn filled(study: &StudyInfo, page: &Participant, sentence: &str) -> String {
    page.texts.fill(sentence, &[("radius", study.parameters.danger_radius_m.into())])
}
