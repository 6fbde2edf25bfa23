//! The explorer's view: the scene at one instant, with the settings beside it.

use super::{CANVAS, Explorer, Msg};
use super::{areas, controls, predictor, sets, tuning};
use crate::pages::moment::{inputs, legend, switches};
use crate::pages::parts::{self, alert, button};
use crate::view::{self, el};
use sidestep::chart::fixed;

type Node = view::Node<Msg>;

pub(super) fn page(explorer: &Explorer) -> Node {
    el("main").class("explorer").children([scene(explorer), panel(explorer), moment(explorer)])
}

fn scene(explorer: &Explorer) -> Node {
    let canvas = el("canvas")
        .attrs(&[("id", CANVAS), ("role", "img")])
        .attr("aria-label", "The task seen from above, with the predicted sets")
        .test_id("explorer");
    let picture = el("div")
        .class("seen")
        .child(canvas)
        .child(legend(explorer.playback.legend(&explorer.view), &explorer.view, false))
        .children(explorer.sources.notice(Msg::StopSolving, Msg::SolveAgain));
    el("section")
        .class("view")
        .attr("aria-label", "Scene")
        .children(parts::synthetic(explorer.drives.synthetic))
        .child(switches(&explorer.view, |_| true, |_| None, Msg::Layer))
        .child(picture)
}

/// The controls for task and time.
fn moment(explorer: &Explorer) -> Node {
    let now = explorer.playback.now();
    let task = &explorer.drives.tasks[explorer.task];
    let option = |it: &sidestep::api::Drive| {
        let is_chosen = it.trial_id == task.trial_id;
        let option = el("option").attr("value", &it.trial_id);
        option.attr_if(is_chosen, "selected", "").text(it.words.clone())
    };
    let list = el("select")
        .attr("aria-label", "Task")
        .test_id("task")
        .on_input(Msg::Task)
        .children(explorer.drives.tasks.iter().map(option));
    let other = |id: &str, words: &str, sign: &str, by: i32| {
        button(id, Msg::Next(by))
            .class("plain")
            .attr("aria-label", words)
            .attr("title", words)
            .text(sign)
    };
    let time = format!("{} s", fixed(now.time_s, 1));
    let slider = el("input")
        .attrs(&[("type", "range"), ("min", "0"), ("step", "0.1"), ("aria-label", "Time")])
        .attr("max", fixed(explorer.playback.duration_s(), 3))
        .attr("value", fixed(now.time_s, 3))
        .attr("aria-valuetext", format!("{time}, step {}", now.step))
        .test_id("time")
        .on_input(Msg::Seek);
    let parts = [explorer.choice.named(), explorer.view.query()];
    let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    let replay = format!("/lab/replay/{}?{}", task.trial_id, parts.join("&"));
    el("section")
        .class("moment")
        .attr("aria-label", "Moment")
        .child(other("previous-task", "The previous task (key P)", "‹", -1))
        .child(list)
        .child(other("next-task", "The next task (key N)", "›", 1))
        .child(slider)
        .child(el("output").class("time").text(time))
        .child(el("a").attr("href", replay).test_id("replay-link").text("Replay"))
}

fn panel(explorer: &Explorer) -> Node {
    let probabilities = explorer.playback.probabilities();
    let steps = explorer.is_valid().then_some(explorer.wanted.steps);
    let ahead = steps.map(|steps| {
        let seconds = steps as f64 * explorer.drives.parameters.step_s;
        el("small").text(format!("where the human may be in {} s", fixed(seconds, 1)))
    });
    // The panel scrolls, so it must be reachable by keyboard.
    el("aside")
        .class("panel")
        .attrs(&[("tabindex", "0"), ("aria-label", "Settings")])
        .child(whose(explorer))
        .child(parts::heading("Predicted sets").children(ahead))
        .children(explorer.misread.as_deref().map(|why| alert("misread", why)))
        .children(explorer.trouble.as_deref().map(|why| alert("trouble", why)))
        .child(controls::presets(explorer))
        .child(sets::section(explorer))
        .child(controls::section(explorer))
        .child(tuning::section(explorer))
        .child(areas::section(explorer))
        .child(predictor::section(&explorer.choice, &explorer.drives))
        .children(probabilities.map(|probabilities| inputs(probabilities)))
        .child(controls::file(explorer))
}

/// Links to the study and the participant.
fn whose(explorer: &Explorer) -> Node {
    let drives = &explorer.drives;
    let pilot = if drives.pilot { "pilot" } else { "participant" };
    let left_out = drives
        .excluded
        .as_ref()
        .map(|why| el("span").text(format!(". Analyses leave this participant out: {why}")));
    el("p")
        .class("quiet")
        .test_id("whose")
        .child(el("a").attr("href", format!("/lab/studies/{}", drives.study)).text(&drives.study))
        .text(" / ")
        .child(
            el("a")
                .attr("href", format!("/lab/participants/{}", explorer.participant_id))
                .text(format!("{pilot} {}", drives.number)),
        )
        .text(" / explorer")
        .children(left_out)
}
