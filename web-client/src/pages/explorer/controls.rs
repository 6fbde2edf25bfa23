//! The settings of a prediction as form controls. Each error is shown beside its control.

use super::{Explorer, Msg};
use crate::form::FieldValue;
use crate::json;
use crate::pages::coverage::worded;
use crate::pages::moment::{select, switch};
use crate::pages::parts::{alert, button};
use crate::runtime::{Command, Offer};
use crate::view::{self, el};
use sidestep::bounds::Rollout;
use sidestep::chart::{fixed, number};
use sidestep::shfrs::file::{MOST_SETS, MOST_STEPS, PRESETS, ShfrsFile};

type Node = view::Node<Msg>;

/// Name of the settings file.
const FILE: &str = "shfrs-settings.json";

/// Buttons for the paper's settings.
pub(super) fn presets(explorer: &Explorer) -> Node {
    let button = |(place, preset): (usize, &sidestep::shfrs::file::Preset)| {
        let wanted = &explorer.wanted;
        let turn_rate = explorer.drives.parameters.human.turn_rate_radps;
        let suited = preset.settings(explorer.actions()).for_turn_rate(turn_rate);
        let is_on = *wanted == suited.with_rollout(wanted.rollout);
        switch(&format!("preset-{place}"), is_on, Msg::Preset(place))
            .attr("title", preset.meaning)
            .text(preset.name)
    };
    el("div")
        .class("switches")
        .attrs(&[("role", "group"), ("aria-label", "Settings of the paper")])
        .children(PRESETS.iter().enumerate().map(button))
}

/// The number of future steps, the number of sets, the choice of actions, and the roll-outs.
pub(super) fn section(explorer: &Explorer) -> Node {
    let wanted = &explorer.wanted;
    let step_s = explorer.drives.parameters.step_s;
    let ahead = format!("{} = {} s", wanted.steps, fixed(wanted.steps as f64 * step_s, 1));
    let rollouts = [
        (Rollout::Base.word().to_owned(), "not widened: regions stay nested".to_owned()),
        (Rollout::Paper.word().to_owned(), "widened by ε1, as the paper prints it".to_owned()),
    ];
    let most = MOST_STEPS.to_string();
    let sets = MOST_SETS.to_string();
    el("section")
        .class("knobs")
        .child(el("h2").text("Prediction"))
        .child(slider(
            "steps",
            "Steps ahead, T",
            ["1", &most, "1"],
            (wanted.steps as f64, ahead),
            Msg::Steps,
        ))
        .children(said(explorer, &["T", "steps"]))
        .child(slider(
            "sets",
            "Sets, F",
            ["1", &sets, "1"],
            (wanted.epsilon.len() as f64, wanted.epsilon.len().to_string()),
            Msg::Count,
        ))
        .children(actions(explorer))
        .child(select("rollout", "Roll-outs", rollouts.into(), wanted.rollout.word(), Msg::Rollout))
        .children(said(explorer, &["rollout"]))
}

/// Controls for the choice of actions at each step.
fn actions(explorer: &Explorer) -> Vec<Node> {
    let wanted = &explorer.wanted;
    let by = [
        ("k".to_owned(), "the k most likely".to_owned()),
        ("tau".to_owned(), "those with a probability of τ or more".to_owned()),
        ("q".to_owned(), "the shortest interval with a probability of q".to_owned()),
    ];
    let chosen = match (&wanted.tau, &wanted.q) {
        (Some(_), _) => "tau",
        (None, Some(_)) => "q",
        (None, None) => "k",
    };
    let mut nodes = vec![select("by", "Actions that count", by.into(), chosen, Msg::By)];
    if let Some(tau) = wanted.tau {
        let range = ["0.005", "1", "0.005"];
        nodes.push(slider("tau", "τ", range, (tau, number(tau)), Msg::Tau));
    }
    if let Some(q) = &wanted.q {
        let (first, last) = (q.first().copied().unwrap_or(1.0), q.last().copied().unwrap_or(1.0));
        let words = match first == last {
            true => number(first),
            false => format!("{} to {}", number(first), number(last)),
        };
        nodes.push(slider("q", "q", ["0.05", "1", "0.05"], (first, words), Msg::Q));
    }
    if let Some(k) = &wanted.k {
        for (least, id) in [(2, "up-to-2"), (3, "up-to-3")] {
            if least > explorer.actions() {
                continue;
            }
            let upto = k.iter().take_while(|&&k| k >= least).count();
            let words = match upto {
                0 => "in no step".to_owned(),
                1 => "in step 1".to_owned(),
                _ => format!("in steps 1–{upto}"),
            };
            let most = wanted.steps.to_string();
            let label = if least == 2 { "k ≥ 2" } else { "k = 3" };
            let then = move |value| Msg::UpTo(least, value);
            nodes.push(slider(id, label, ["0", &most, "1"], (upto as f64, words), then));
        }
        let listed: Vec<String> = k.iter().map(usize::to_string).collect();
        let field = el("input")
            .attrs(&[("id", "k"), ("type", "text"), ("autocomplete", "off")])
            .attr("value", listed.join(","))
            .attr("title", "Number of actions that count at each step, separated by commas")
            .test_id("k")
            .on_input(Msg::K);
        let label = el("label").attr("for", "k").text("k of each step");
        nodes.push(el("div").class("pair").child(label).child(field));
    }
    nodes.extend(said(explorer, &["k", "tau", "q"]));
    nodes
}

/// A slider with its label and with its value in words. `then` converts input to a message.
fn slider(
    id: &'static str,
    label: &str,
    [min, max, step]: [&str; 3],
    (value, words): (f64, String),
    then: impl Fn(FieldValue) -> Msg + 'static,
) -> Node {
    let control = el("input")
        .attrs(&[("id", id), ("type", "range"), ("min", min), ("max", max), ("step", step)])
        .attr("data-own-keys", "")
        .attr("value", value)
        .attr("aria-valuetext", &words)
        .test_id(id)
        .on_input(then);
    el("div")
        .class("pair knob")
        .child(el("label").attr("for", id).text(label))
        .child(control)
        .child(el("output").attr("for", id).text(words))
}

/// The error message, if the error is in one of these settings.
pub(super) fn said(explorer: &Explorer, fields: &[&str]) -> Option<Node> {
    let complaint = explorer.complaint.as_ref()?;
    let named = complaint.field.split('[').next().unwrap_or_default();
    fields.contains(&named).then(|| alert("complaint", &worded(&format!("{complaint}."))))
}

/// Admits at least `least` actions in the first `upto` steps, and fewer than `least` in the later
/// steps.
pub(super) fn count_up_to(settings: &mut ShfrsFile, least: usize, upto: usize) {
    for (i, k) in settings.k.iter_mut().flatten().enumerate() {
        *k = if i < upto { (*k).max(least) } else { (*k).min(least - 1) };
    }
}

/// The settings as a file, as a command and as JSON text.
pub(super) fn file(explorer: &Explorer) -> Node {
    let area = el("textarea")
        .attrs(&[("rows", "5"), ("spellcheck", "false"), ("aria-label", "Settings as JSON")])
        .attr("value", json::write(&explorer.wanted))
        .test_id("json")
        .on_input(Msg::Json);
    let (study, number) = (&explorer.drives.study, explorer.drives.number);
    let flags = explorer.choice.flags();
    let command = format!(
        "sidestep shfrs --database DATABASE --study {study} --participant {number}{} \
         --settings {} {} --out shfrs",
        flags.as_deref().unwrap_or_default(),
        FILE,
        explorer.tuning.flags()
    );
    let is_right = explorer.complaint.is_none() && explorer.is_valid();
    let save = button("save", Msg::Save).attr_if(!is_right, "disabled", "").text("Save as a file");
    // The command line excludes pilots.
    let command = (!explorer.drives.pilot).then(|| {
        el("pre").attr("tabindex", "0").child(el("code").test_id("command").text(command))
    });
    let words = match command {
        Some(_) => {
            "The link of this page has all settings but those of Tune. The file has those of the sets, for the \
             command line, where DATABASE is what the server was started with, such as sqlite:sidestep.db:"
        }
        None => {
            "The link of this page has all settings but those of Tune; the file has those of the sets."
        }
    };
    let other = (command.is_some() && flags.is_none()).then(|| {
        el("p").class("quiet").text(
            "The command trains a predictor of its own, so its numbers are not those of the predictor chosen above.",
        )
    });
    el("section")
        .child(el("h2").text("Keep these settings"))
        .child(el("p").class("quiet").text(words))
        .children(command)
        .children(other)
        .child(el("p").child(save))
        .child(
            el("details")
                .child(el("summary").text("As JSON, to copy or to paste"))
                .child(area)
                .children(said(explorer, &["JSON", "format"])),
        )
}

impl Explorer {
    /// The settings as a file for download.
    pub(super) fn file(&self) -> Command<Msg> {
        let content = json::write(&self.wanted) + "\n";
        Command::offer(Offer::File {
            name: FILE.to_owned(),
            media_type: "application/json",
            content: content.into_bytes(),
        })
    }
}
