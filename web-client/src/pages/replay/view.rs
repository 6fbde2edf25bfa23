//! What a replay shows around the canvas.

use super::chart;
use super::choice;
use super::{Msg, Replay};
use crate::overlays::LAYERS;
use crate::pages::parts::{self, alert, button, cell, fact};
use crate::view::{self, el, subscripted};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, JointState};
use sidestep::vehicle::TurnInput;

type Node = view::Node<Msg>;

pub(super) fn page(replay: &Replay) -> Node {
    el("main").class("replay").children([scene(replay), panel(replay), timeline(replay)])
}

fn scene(replay: &Replay) -> Node {
    let switches = LAYERS.iter().enumerate().map(|(place, layer)| {
        let shown = replay.shown[place];
        let swatch = el("i").class(&format!("swatch {}", layer.swatch));
        let button = switch(&format!("layer-{}", layer.name), shown, Msg::Layer(place))
            .attr("title", layer.meaning)
            .child(swatch)
            .child(el("span").text(layer.label));
        let Some(below) = layer.level else { return button };
        // Otherwise a user would search for the line.
        let is_empty = shown && replay.safety.is_some() && replay.drawn[place].is_empty();
        button
            .child(subscripted("span", "V", below).text(" ≤ 0"))
            .children(is_empty.then(|| el("span").text("(nowhere now)")))
    });
    let meaning = "Predicted sets: show where the human may be at each step instead of within \
                   the whole time ahead";
    let by_step =
        switch("by-step", replay.by_step, Msg::ByStep).attr("title", meaning).text("per step");
    let switches = el("div")
        .class("switches")
        .attrs(&[("role", "group"), ("aria-label", "Layers")])
        .children(switches)
        .child(by_step);
    let canvas = el("canvas")
        .attrs(&[("id", "replay"), ("role", "img")])
        .attr("aria-label", "The trial seen from above, with the chosen layers")
        .test_id("replay");
    el("section")
        .class("view")
        .attr("aria-label", "Scene")
        .child(switches)
        .child(canvas)
        .children(replay.sources.notice())
}

/// A button that is on or off.
fn switch(test_id: &str, is_on: bool, message: Msg) -> Node {
    button(test_id, message).class("switch").attr("aria-pressed", is_on)
}

fn panel(replay: &Replay) -> Node {
    let heading = parts::heading(&format!("Step {}", replay.step()))
        .child(el("small").text(format!("t = {:.1} s", replay.time_s)));
    // It scrolls, so the keyboard must be able to reach it.
    el("aside")
        .class("panel")
        .attrs(&[("tabindex", "0"), ("aria-label", "Numbers at this step")])
        .child(heading)
        .child(facts(replay))
        .children(doubt(replay))
        .child(choice::section(&replay.choice, &replay.trial, trained(replay)))
        .children(replay.prediction.as_ref().map(|probabilities| inputs(probabilities)))
        .children(replay.prediction.as_ref().map(|_| regions(replay)))
        .child(outcome(replay))
        .children(replay.trouble.as_deref().map(|why| alert("trouble", why)))
}

/// A length in metres, with a proper minus sign.
fn metres(value: f64, decimals: usize) -> String {
    format!("{value:.decimals$} m").replace('-', "−")
}

fn facts(replay: &Replay) -> Node {
    let state = replay.state();
    let level = |evader, words: &str, below: &str| {
        let name = el("dt").text(words).child(subscripted("span", "V", below));
        let value = match &replay.safety {
            Some(safety) if replay.is_doubtful(evader) => {
                let value = metres(level_of(safety, evader, &state), 1);
                el("dd").class("doubtful").text(format!("≈ {value}"))
            }
            Some(safety) => el("dd").text(metres(level_of(safety, evader, &state), 2)),
            None if replay.sources.missing().is_some() => el("dd").text("—"),
            None => el("dd").text("…"),
        };
        el("div").child(name).child(value)
    };
    let input = replay.trial.inputs.get(replay.step()).map_or("—", |input| input.word());
    el("dl").class("facts").children([
        level(Evader::Human, "human’s safety ", "HR"),
        level(Evader::Robot, "robot’s safety ", "RH"),
        fact("distance", metres(state.distance_m(), 2)),
        fact("input", input),
    ])
}

fn level_of(safety: &SafetyLevels, evader: Evader, state: &JointState) -> f64 {
    match evader {
        Evader::Human => safety.human_level(state),
        Evader::Robot => safety.robot_level(state),
    }
}

/// A warning about levels that prove nothing.
fn doubt(replay: &Replay) -> Option<Node> {
    let doubtful = [(Evader::Human, "HR"), (Evader::Robot, "RH")];
    let mut doubtful =
        doubtful.into_iter().filter(|(evader, _)| replay.is_doubtful(*evader)).peekable();
    doubtful.peek()?;
    let mut words = el("p").class("waiting").attr("role", "note").test_id("not-converged");
    for (place, (_, below)) in doubtful.enumerate() {
        words =
            words.text(if place > 0 { " and " } else { "" }).child(subscripted("b", "V", below));
    }
    Some(words.text(
        " did not converge: the solver stopped while the values still changed, so they may be \
         too high by decimetres. Draw no conclusion from them, nor from the predicted sets that \
         use them.",
    ))
}

/// How the predictor came about that is trained on the trials before this one; empty for another.
fn trained(replay: &Replay) -> Option<String> {
    let learned = replay.learned.as_ref()?;
    Some(match (&learned.fallback, learned.trials) {
        (None, 1) => "Logistic regression (B_hrd), trained on the trial before".to_owned(),
        (None, n) => format!("Logistic regression (B_hrd), trained on the {n} trials before"),
        (Some(why), _) => format!("Frequencies of the inputs so far: {why}"),
    })
}

fn inputs(probabilities: &[(TurnInput, f64)]) -> Node {
    let bars = probabilities.iter().map(|(input, p)| {
        let percent = 100.0 * p;
        let bar = el("i").attr("style", format!("width:{percent:.1}%"));
        el("div")
            .child(el("dt").text(input.word()))
            .child(el("dd").class("bar").attr("aria-hidden", "true").child(bar))
            .child(el("dd").text(format!("{percent:.0} %")))
    });
    el("section")
        .test_id("prediction")
        .child(el("h2").text("Next input"))
        .child(el("dl").class("bars").children(bars))
}

fn regions(replay: &Replay) -> Node {
    let rows = replay.predictor.shfrs().sets.iter().zip(1..).map(|(set, j)| {
        let swatch = el("i").class(&format!("swatch region-{j}"));
        let name = subscripted("span", "F", &j.to_string());
        el("tr")
            .child(el("th").attr("scope", "row").child(swatch).child(name))
            .child(cell(format!("{:.2}", set.epsilon)))
            .child(cell(format!("{:.2}", set.area_m2)))
    });
    let table = parts::table(["set", "ε / rad s⁻¹", "tube / m²"], rows);
    let ahead = if replay.by_step { "next 2 s, per step" } else { "next 2 s" };
    el("section")
        .child(el("h2").text("Predicted sets").child(el("small").text(ahead)))
        .child(table.class("regions").test_id("regions"))
}

/// How the trial ended, and whether it can be trusted.
fn outcome(replay: &Replay) -> Node {
    let summary = &replay.trial.summary;
    let danger = summary.outcome.first_step_in_danger;
    let danger = danger.map_or_else(|| "never".to_owned(), |step| format!("from step {step}"));
    let check = &replay.trial.replay;
    let exact = if check.exact {
        "exact".to_owned()
    } else {
        format!("differs by up to {:.2e} m", check.max_position_error_m)
    };
    let flags = Some(parts::flags(&summary.flags)).filter(|flags| !flags.is_empty());
    el("section").child(el("h2").text("Trial")).child(el("dl").class("facts").children([
        fact("closest", metres(summary.outcome.closest_m, 2)),
        fact("in danger zone", danger),
        fact("replay", exact),
        fact("safety levels", replay.sources.words()).test_id("safety-levels"),
        fact("flags", flags.unwrap_or_else(|| "none".to_owned())),
    ]))
}

fn timeline(replay: &Replay) -> Node {
    let lines = chart::lines(replay);
    let (words, icon) = match replay.is_playing() {
        true => ("Pause", "M6 5h4v14H6zM14 5h4v14h-4z"),
        false => ("Play", "M8 5v14l11-7z"),
    };
    let icon = el("svg")
        .attrs(&[("viewBox", "0 0 24 24"), ("aria-hidden", "true")])
        .child(el("path").attr("d", icon));
    let controls = el("div")
        .class("controls")
        .child(button("play", Msg::Play).class("play").attr("aria-label", words).child(icon))
        .child(el("span").class("time").text(format!("{:.1} s", replay.time_s)))
        .child(chart::legend(&lines));
    let slider = el("input")
        .attrs(&[("type", "range"), ("min", "0"), ("step", "1"), ("aria-label", "Step")])
        .attr("max", replay.trial.inputs.len())
        .attr("value", replay.step())
        .test_id("slider")
        .on_input(|value| Msg::Seek(value.number().unwrap_or(0.0) as usize));
    let table = chart::table(replay, &lines);
    let row = |cells: Vec<String>| el("tr").children(cells.into_iter().map(cell));
    let numbers = el("div")
        .class("scroll")
        .attrs(&[("tabindex", "0"), ("role", "region"), ("aria-label", "Numbers of every step")])
        .child(parts::table(table.columns, table.rows.into_iter().map(row)));
    el("section")
        .class("timeline")
        .attr("aria-label", "Timeline")
        .child(controls)
        .child(el("div").class("chart").child(chart::draw(replay, &lines)).child(slider))
        .child(
            el("details").class("table-twin").child(el("summary").text("Numbers")).child(numbers),
        )
}
