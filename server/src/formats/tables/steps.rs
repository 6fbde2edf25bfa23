//! The table with a row for each step: the state at its start and the input held during it.

use super::{Driven, damaged_column, flags_column, participant_column, trial_column};
use crate::formats::table::Kind::{Number, Time, Whole, Word};
use crate::formats::table::{Batch, Column};
use crate::store::trials::flag_words;

/// The columns. An import requires the first eleven.
#[must_use]
pub fn columns() -> Vec<Column> {
    const WORLD: &str = "world: x to the right, y up";
    const HEADING: &str = "world: counter-clockwise from +x";
    let position = |name: &'static str, meaning: &'static str| {
        Column::new(name, Number, meaning).unit("m").frame(WORLD)
    };
    let heading = |name: &'static str, meaning: &'static str| {
        Column::new(name, Number, meaning).unit("rad").frame(HEADING)
    };
    vec![
        participant_column(),
        trial_column(),
        Column::new("step", Whole, "number of the step in the trial, from 0"),
        Column::new("t", Number, "time of the step's start after the scene's start").unit("s"),
        position("hx", "human's position before the step"),
        position("hy", "human's position before the step"),
        heading("hpsi", "human's heading before the step"),
        position("rx", "robot's position before the step"),
        position("ry", "robot's position before the step"),
        heading("rpsi", "robot's heading before the step"),
        Column::new(
            "omega",
            Number,
            "turn rate of the human held in the step; positive turns left",
        )
        .unit("rad/s"),
        Column::new("study", Word, "name of the study in addresses"),
        Column::new("phase", Word, "part of the study; only tasks are analysed")
            .range("familiarisation, practice, task"),
        Column::new("phase_index", Whole, "place of the scene within its phase, from 0"),
        Column::new("attempt", Whole, "1; 2 if the scene was driven again after an interruption"),
        Column::new("trial_id", Word, "the trial's id on the server"),
        Column::new("participant_id", Word, "as in the table of participants"),
        flags_column(),
        Column::new("started_at_ms", Time, "start of the scene by the participant's clock")
            .unit("ms since 1970"),
        Column::new(
            "sampled_at_ms",
            Time,
            "when the step's input was sampled, after the scene's start",
        )
        .unit("ms"),
        Column::new("received_at_ms", Whole, "when the server stored the trial")
            .unit("ms since 1970"),
        Column::new("synthetic", Whole, "1 if a program drove, else 0").range("0, 1"),
        Column::new("due_at_ms", Number, "when the step's input was due, after the scene's start")
            .unit("ms"),
        Column::new("exposures", Whole, "how often the scene was shown, this time included"),
        damaged_column(),
    ]
}

/// Adds the steps of a trial.
pub fn add(batch: &mut Batch, driven: &Driven<'_>) {
    let Driven { number, trial, parameters, damage } = *driven;
    let (head, content) = (&trial.head, &trial.content);
    let states = &content.states;
    // Round to nanoseconds, so that a time is 0.6 instead of 0.6000000000000001.
    let nanoseconds = |step: usize| (step as f64 * parameters.step_s * 1e9).round();
    let synthetic = i64::from(trial.is_synthetic());
    let sampled = content.sampled_at_ms.as_deref();
    let mut rows = batch.add(content.inputs.len());
    rows.whole(|_| Some(head.participant_number));
    rows.whole(|_| Some(number as i64));
    rows.whole(|step| Some(step as i64));
    rows.number(|step| Some(nanoseconds(step) / 1e9));
    rows.number(|step| Some(states[step].human.x));
    rows.number(|step| Some(states[step].human.y));
    rows.number(|step| Some(states[step].human.psi));
    rows.number(|step| Some(states[step].robot.x));
    rows.number(|step| Some(states[step].robot.y));
    rows.number(|step| Some(states[step].robot.psi));
    rows.number(|step| Some(parameters.human.turn_rate(content.inputs[step])));
    rows.text(&*trial.study);
    rows.text(head.phase.word());
    rows.whole(|_| Some(head.index as i64));
    rows.whole(|_| Some(i64::from(head.attempt)));
    rows.text(&*head.trial_id);
    rows.text(&*head.participant_id);
    rows.text(&*flag_words(&head.flags));
    rows.number(|_| content.started_at_ms);
    rows.number(|step| sampled.map(|times| times[step]));
    rows.whole(|_| Some(head.received_at_ms));
    rows.whole(|_| Some(synthetic));
    rows.number(|step| Some(nanoseconds(step) / 1e6));
    rows.whole(|_| content.exposures.map(i64::from));
    rows.whole(|_| Some(i64::from(damage.is_some())));
}
