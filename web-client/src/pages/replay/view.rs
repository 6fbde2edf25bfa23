//! The parts of the replay's view around the canvas.

use super::chances::Chances;
use super::choice::{self, Choice, Pane};
use super::finder::Finder;
use super::keys;
use super::{CANVAS, CANVAS_BESIDE, Msg, Replay};
use crate::pages::coverage::chance;
use crate::pages::moment::{self, metres, select, switch};
use crate::pages::parts::{self, alert, button, cell, fact};
use crate::view::{self, el, subscripted};
use sidestep::chart::fixed;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, JointState};
use sidestep::trial::Phase;
use sidestep::trial_view::source::{Source, Way};
use sidestep::trial_view::style::{Palette, Sets};
use sidestep::trial_view::view::SPEEDS;
use sidestep::trial_view::{Playback, legend_of_both};

type Node = view::Node<Msg>;

pub(super) fn page(replay: &Replay) -> Node {
    el("main").class("replay").children([scene(replay), panel(replay), timeline(replay)])
}

fn scene(replay: &Replay) -> Node {
    let switches = moment::switches(&replay.view, |_| true, keys::of_layer, Msg::Layer);
    let canvas = |id: &str, words: String| {
        el("canvas").attr("id", id).attr("role", "img").attr("aria-label", words).test_id(id)
    };
    let words = "The trial seen from above, with the chosen layers";
    let pane = |id: &str, caption: String| {
        let canvas = canvas(id, format!("{words}, predicted by: {caption}"));
        el("div").class("pane").child(el("p").class("caption").text(caption)).child(canvas)
    };
    let canvases = match &replay.beside {
        None => vec![canvas(CANVAS, words.to_owned())],
        Some(beside) => vec![
            pane(CANVAS, replay.choice.caption()),
            pane(CANVAS_BESIDE, beside.choice.caption()),
        ],
    };
    let picture = el("div")
        .class(if replay.beside.is_some() { "seen beside" } else { "seen" })
        .children(canvases)
        .children(replay.shows_legend.then(|| legend(replay)))
        .children(replay.sources.notice(Msg::StopSolving, Msg::SolveAgain));
    el("section")
        .class("view")
        .attr("aria-label", "Scene")
        .children(parts::synthetic(replay.trial.synthetic))
        .child(switches)
        .child(picture)
}

/// The legend. If there are two pictures, it is for both.
fn legend(replay: &Replay) -> Node {
    let items = match &replay.beside {
        None => replay.playback.legend(&replay.view),
        Some(beside) => legend_of_both(&replay.playback, &beside.playback, &replay.view),
    };
    moment::legend(items, &replay.view, replay.beside.is_some())
}

fn panel(replay: &Replay) -> Node {
    let now = replay.playback.now();
    let heading = parts::heading(&format!("Step {}", now.step))
        .child(el("small").text(format!("t = {:.2} s", now.time_s)));
    let beside = replay.beside.as_deref();
    let both = beside.is_some();
    let finder = |pane: Pane| {
        let finder = replay.finder.as_ref().filter(|finder| finder.pane == pane);
        finder.map(Finder::view)
    };
    let first = if both { "Predictor on the left, or above" } else { "Predictor" };
    let second = "Predictor on the right, or below";
    let chosen = |choice, heading| choice::section(choice, &replay.offered, &replay.trial, heading);
    // The panel scrolls, so it must be reachable by keyboard.
    el("aside")
        .class("panel")
        .attrs(&[("tabindex", "0"), ("aria-label", "Numbers at this step")])
        .child(whose(replay))
        .child(heading)
        .children(replay.misread.as_deref().map(|why| alert("misread", why)))
        .children(replay.unfilmed.as_deref().map(|why| alert("unfilmed", why)))
        .child(facts(replay))
        .children(doubt(replay))
        .child(chosen(&replay.choice, first))
        .children(finder(Pane::First))
        .children(predicted(replay, &replay.playback, &replay.choice, &replay.chances))
        .children(beside.map(|beside| chosen(&beside.choice, second)))
        .children(finder(Pane::Second))
        .children(beside.map(|beside| {
            el("div").class("numbers-beside").test_id("numbers-beside").children(predicted(
                replay,
                &beside.playback,
                &beside.choice,
                &beside.chances,
            ))
        }))
        .child(drawing(replay))
        .child(outcome(replay))
        .children(replay.trouble.as_deref().map(|why| alert("trouble", why)))
        .child(keys::list())
}

/// The probabilities of the next inputs, if the predictor has them, and the predicted sets, once
/// they are known.
fn predicted(
    replay: &Replay,
    playback: &Playback,
    choice: &Choice,
    chances: &Chances,
) -> Vec<Node> {
    let inputs = playback.probabilities().map(|probabilities| moment::inputs(probabilities));
    let has_sets = playback.set_count() > 0;
    let regions = has_sets.then(|| regions(replay, playback, choice, chances));
    inputs.into_iter().chain(regions).collect()
}

/// The predicted sets, and how often they contain this participant's future.
fn regions(replay: &Replay, playback: &Playback, choice: &Choice, chances: &Chances) -> Node {
    let sets = playback.set_count();
    let cells = (replay.trial.summary.phase == Phase::Task).then(|| {
        let known = chances.probabilities(sets);
        let wait = if playback.empirical().is_some() { "—" } else { "…" };
        let of = |j: usize| {
            known.and_then(|it| it.inside.get(j)).map_or_else(|| cell(wait), |p| chance(*p))
        };
        (0..sets).map(|j| of(j).test_id(&format!("p-{j}"))).collect()
    });
    let words = chances.words(sets, choice.judged_on());
    moment::regions(playback, &replay.view, cells)
        .children(words.map(|words| el("p").class("quiet").test_id("p-words").text(words)))
}

/// The study and the participant as links, and the scene.
fn whose(replay: &Replay) -> Node {
    let summary = &replay.trial.summary;
    let study = format!("/lab/studies/{}", replay.trial.study);
    let participant = format!("/lab/participants/{}", summary.participant_id);
    let words = format!("participant {}", summary.participant_number);
    // The explorer shows only tasks.
    let explorer = (summary.phase == Phase::Task).then(|| {
        // The explorer has another default predictor, so the link must name the predictor of the
        // replay.
        let chosen = match replay.choice.source() {
            Source::Way(Way::Constant) | Source::Model { .. } => replay.choice.query(),
            Source::Way(_) => "predictor=earlier".to_owned(),
        };
        let parts = [format!("trial={}", summary.trial_id), chosen, replay.view.query()];
        let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        let link = format!("/lab/explorer/{}?{}", summary.participant_id, parts.join("&"));
        let link = el("a").attr("href", link).test_id("explorer-link");
        el("span").text(" · ").child(link.text("Explore the settings"))
    });
    el("p")
        .class("quiet")
        .test_id("whose")
        .child(el("a").attr("href", study).text(replay.trial.study.clone()))
        .text(" / ")
        .child(el("a").attr("href", participant).text(words))
        .text(format!(" / {}", summary.scene_words()))
        .children(explorer)
}

/// Controls for how the layers are drawn.
fn drawing(replay: &Replay) -> Node {
    let style = &replay.view.style;
    let has_sets = replay.playback.set_count() > 0;
    let steps = if has_sets { replay.playback.steps_ahead() } else { 0 };
    let chosen = match style.sets {
        Sets::Tube => "tube".to_owned(),
        Sets::EachStep => "steps".to_owned(),
        Sets::Step(step) => step.to_string(),
    };
    let step_s = replay.trial.parameters.step_s;
    let mut sets = vec![
        ("tube".to_owned(), "within the whole time ahead".to_owned()),
        ("steps".to_owned(), "after each step".to_owned()),
    ];
    // Before the prediction is known, the list offers only the requested step.
    let asked = match style.sets {
        Sets::Step(step) if !has_sets => step..=step,
        _ => 1..=steps,
    };
    sets.extend(
        asked.map(|step| (step.to_string(), format!("after {} s", fixed(step as f64 * step_s, 1)))),
    );
    let colours = [("paper", "as in the paper"), ("safe", "for all eyes, hatched")];
    let palette = match style.palette {
        Palette::Paper => "paper",
        Palette::Safe => "safe",
    };
    let colours = colours.map(|(value, words)| (value.to_owned(), words.to_owned()));
    let levels = |evader: Evader, below: &str, id: &'static str| {
        let levels: Vec<String> = style.levels(evader).iter().map(f64::to_string).collect();
        let label =
            el("label").attr("for", id).child(subscripted("span", "V", below)).text(" = … m");
        let field = el("input")
            .attrs(&[("id", id), ("type", "text"), ("autocomplete", "off")])
            .attr("value", levels.join(","))
            .attr("title", "Levels in metres, increasing, separated by commas")
            .test_id(id)
            .on_input(move |value| Msg::Levels(evader, value));
        el("div").class("pair").child(label).child(field)
    };
    el("section").class("drawing").child(el("h2").text("Drawing")).children([
        select("sets", "Predicted sets", sets, &chosen, Msg::Sets),
        select("colours", "Their colours", colours.into(), palette, Msg::Colours),
        levels(Evader::Human, "HR", "levels-hr"),
        levels(Evader::Robot, "RH", "levels-rh"),
    ])
}

fn facts(replay: &Replay) -> Node {
    let state = replay.playback.now().state;
    let level = |evader, words: &str, below: &str| {
        let name = el("dt").text(words).child(subscripted("span", "V", below));
        let value = match replay.playback.safety() {
            Some(safety) if replay.playback.is_doubtful(evader) => {
                let value = metres(level_of(safety, evader, &state), 1);
                el("dd").class("doubtful").text(format!("≈ {value}"))
            }
            Some(safety) => el("dd").text(metres(level_of(safety, evader, &state), 2)),
            None if replay.sources.missing().is_some() => el("dd").text("—"),
            None => el("dd").text("…"),
        };
        el("div").child(name).child(value)
    };
    let input =
        replay.trial.inputs.get(replay.playback.now().step).map_or("—", |input| input.word());
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

/// A warning about safety levels that did not converge.
fn doubt(replay: &Replay) -> Option<Node> {
    let doubtful = [(Evader::Human, "HR"), (Evader::Robot, "RH")];
    let mut doubtful =
        doubtful.into_iter().filter(|(evader, _)| replay.playback.is_doubtful(*evader)).peekable();
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

/// How the trial ended, and whether its data can be trusted.
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
        fact("robot", replay.trial.scene.robot_name()),
        fact("flags", flags.unwrap_or_else(|| "none".to_owned())),
    ]))
}

fn timeline(replay: &Replay) -> Node {
    let now = replay.playback.now();
    let slider = el("input")
        .attrs(&[("type", "range"), ("min", "0"), ("step", "any"), ("aria-label", "Time")])
        .attr("max", format!("{:.3}", replay.playback.duration_s()))
        .attr("value", format!("{:.3}", now.time_s))
        .attr("aria-valuetext", format!("{:.1} seconds, step {}", now.time_s, now.step))
        .test_id("slider")
        .on_input(|value| Msg::Seek(value.number().unwrap_or(0.0)));
    el("section")
        .class("timeline")
        .attr("aria-label", "Timeline")
        .child(controls(replay))
        .child(el("div").class("chart").child(replay.strip.view(&replay.playback)).child(slider))
        .children(replay.shows_numbers.then(|| numbers(replay)))
}

/// The numbers of every step as a table.
fn numbers(replay: &Replay) -> Node {
    let table = replay.strip.table(&replay.trial, &replay.playback);
    let row = |cells: Vec<String>| el("tr").children(cells.into_iter().map(cell));
    el("div")
        .class("scroll table-twin")
        .attrs(&[("tabindex", "0"), ("role", "region"), ("aria-label", "Numbers of every step")])
        .child(parts::table(table.columns, table.rows.into_iter().map(row)))
}

/// The buttons of the player, and the legend of the chart.
fn controls(replay: &Replay) -> Node {
    let picture = |path: &'static str| {
        el("svg")
            .attrs(&[("viewBox", "0 0 24 24"), ("aria-hidden", "true")])
            .child(el("path").attr("d", path))
    };
    let (words, icon) = match replay.is_playing() {
        true => ("Pause", "M6 5h4v14H6zM14 5h4v14h-4z"),
        false => ("Play", "M8 5v14l11-7z"),
    };
    let small = |id: &str, words: &str, icon, message| {
        button(id, message)
            .class("plain small")
            .attr("aria-label", words)
            .attr("title", words)
            .child(picture(icon))
    };
    let other = |id: &str, words: &str, icon, trial: &Option<String>| {
        let link = el("a").class("small").test_id(id).attr("title", words).child(picture(icon));
        match trial {
            Some(trial) => link.attr("href", replay.link_to(trial)).attr("aria-label", words),
            None => link
                .attr("aria-disabled", "true")
                .attr("role", "link")
                .attr("aria-label", format!("{words}: none")),
        }
    };
    let speed = SPEEDS.map(|speed| {
        (speed.to_string(), format!("{speed}×").replace("0.25", "¼").replace("0.5", "½"))
    });
    let speed = select("speed", "Speed", speed.into(), &replay.view.speed.to_string(), Msg::Speed);
    let in_a_row = switch("in-a-row", replay.in_a_row, Msg::InARow)
        .attr("title", "Play one trial after the other")
        .text("one after the other");
    let beside = switch("beside", replay.beside.is_some(), Msg::Beside)
        .attr("title", "Two predictors of the same moment (key B)")
        .text("side by side");
    let legend_switch = switch("legend-switch", replay.shows_legend, Msg::Legend).text("legend");
    let numbers_switch =
        switch("numbers-switch", replay.shows_numbers, Msg::Numbers).text("numbers");
    let save = |id: &str, words: &str, message| {
        let title = format!("Save the picture as {words}");
        button(id, message).class("plain").attr("title", title).text(words)
    };
    let saves = [save("save-svg", "SVG", Msg::SaveSvg), save("save-png", "PNG", Msg::SavePng)];
    let (title, sign) = match replay.filming {
        true => ("End the film and save it", "■ WebM"),
        false => ("Record a film from here to the end or to the next pause", "WebM"),
    };
    let film = switch("film", replay.filming, Msg::Film).attr("title", title).text(sign);
    el("div")
        .class("controls")
        .child(other(
            "previous-trial",
            "Previous trial",
            "M6 5h2v14H6zM19 5v14L9 12z",
            &replay.trial.previous,
        ))
        .child(small("step-back", "A step back", "M16 6v12l-9-6z", Msg::Step(-1)))
        .child(
            button("play", Msg::Play).class("play").attr("aria-label", words).child(picture(icon)),
        )
        .child(small("step-on", "A step on", "M8 6v12l9-6z", Msg::Step(1)))
        .child(other("next-trial", "Next trial", "M16 5h2v14h-2zM5 5v14l10-7z", &replay.trial.next))
        .child(el("span").class("time").text(format!("{:.1} s", replay.playback.now().time_s)))
        .child(speed)
        .child(in_a_row)
        .child(beside)
        .child(legend_switch)
        .child(numbers_switch)
        .children(saves)
        .child(film)
        .child(replay.strip.legend())
}
