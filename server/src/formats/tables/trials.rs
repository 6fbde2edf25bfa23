//! The table with a row for each trial: its place in the study, its scene, its outcome and its record.

use super::{Driven, damaged_column, flags_column, participant_column, trial_column};
use crate::formats::table::Kind::{Hash, Json, Number, Text, Time, Whole, Word};
use crate::formats::table::{Batch, Column};
use crate::store::trials::flag_words;

/// The columns.
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
        Column::new("trial_id", Word, "the trial's id on the server"),
        Column::new("participant_id", Word, "as in the table of participants"),
        Column::new("study", Word, "name of the study in addresses"),
        Column::new("configuration", Hash, "SHA-256 of the configuration at the enrolment"),
        Column::new("phase", Word, "part of the study; only tasks are analysed")
            .range("familiarisation, practice, task"),
        Column::new("phase_index", Whole, "place of the scene within its phase, from 0"),
        Column::new("attempt", Whole, "1; 2 if the scene was driven again after an interruption"),
        flags_column(),
        Column::new("synthetic", Whole, "1 if a program drove, else 0").range("0, 1"),
        Column::new("exposures", Whole, "how often the scene was shown, this time included"),
        Column::new("started_at_ms", Time, "start of the scene by the participant's clock")
            .unit("ms since 1970"),
        Column::new("received_at_ms", Whole, "when the server stored the trial")
            .unit("ms since 1970"),
        Column::new("steps", Whole, "number of steps, each with one input"),
        Column::new("step_s", Number, "length of a step").unit("s"),
        position("human_x", "human's position at the scene's start, as planned"),
        position("human_y", "human's position at the scene's start, as planned"),
        heading("human_psi", "human's heading at the scene's start, as planned"),
        position("robot_x", "robot's position at the scene's start, as planned"),
        position("robot_y", "robot's position at the scene's start, as planned"),
        heading("robot_psi", "robot's heading at the scene's start, as planned"),
        position("goal_x", "robot's goal"),
        position("goal_y", "robot's goal"),
        position("end_hx", "human's position after the last step"),
        position("end_hy", "human's position after the last step"),
        heading("end_hpsi", "human's heading after the last step"),
        position("end_rx", "robot's position after the last step"),
        position("end_ry", "robot's position after the last step"),
        heading("end_rpsi", "robot's heading after the last step"),
        Column::new("closest_m", Number, "smallest distance between the vehicles").unit("m"),
        Column::new("danger_radius_m", Number, "radius of the danger zone").unit("m"),
        Column::new("first_step_in_danger", Whole, "first step with the human in the danger zone"),
        Column::new("first_turn", Whole, "first step in which the human turned"),
        Column::new("last_turn", Whole, "last step in which the human turned"),
        Column::new(
            "page_events",
            Json,
            "what happened to the page during the scene, with times in ms",
        ),
        Column::new("display", Json, "what the page recorded about the display"),
        damaged_column(),
        Column::new("damage", Text, "what is wrong with a damaged trial"),
        Column::new(
            "robot",
            Word,
            "the robot's name in the configuration; straight if it has none",
        ),
    ]
}

/// Adds the row of a trial.
pub fn add(batch: &mut Batch, driven: &Driven<'_>) {
    let Driven { number, trial, parameters, damage } = *driven;
    let (head, content, scene) = (&trial.head, &trial.content, &trial.scene);
    let step = |step: Option<usize>| step.map(|step| step as i64);
    let mut row = batch.add(1);
    row.whole(|_| Some(head.participant_number));
    row.whole(|_| Some(number as i64));
    row.text(&*head.trial_id);
    row.text(&*head.participant_id);
    row.text(&*trial.study);
    row.text(&*trial.config_hash);
    row.text(head.phase.word());
    row.whole(|_| Some(head.index as i64));
    row.whole(|_| Some(i64::from(head.attempt)));
    row.text(&*flag_words(&head.flags));
    row.whole(|_| Some(i64::from(trial.is_synthetic())));
    row.whole(|_| content.exposures.map(i64::from));
    row.number(|_| content.started_at_ms);
    row.whole(|_| Some(head.received_at_ms));
    row.whole(|_| Some(content.inputs.len() as i64));
    row.number(|_| Some(parameters.step_s));
    for pose in [scene.human, scene.robot] {
        row.number(|_| Some(pose.x));
        row.number(|_| Some(pose.y));
        row.number(|_| Some(pose.psi));
    }
    row.number(|_| Some(scene.goal[0]));
    row.number(|_| Some(scene.goal[1]));
    let end = content.states.last().copied();
    for pose in [end.map(|end| end.human), end.map(|end| end.robot)] {
        row.number(|_| pose.map(|pose| pose.x));
        row.number(|_| pose.map(|pose| pose.y));
        row.number(|_| pose.map(|pose| pose.psi));
    }
    row.number(|_| Some(head.outcome.closest_m));
    row.number(|_| Some(parameters.danger_radius_m));
    row.whole(|_| step(head.outcome.first_step_in_danger));
    row.whole(|_| step(head.outcome.avoidance.map(|(first, _)| first)));
    row.whole(|_| step(head.outcome.avoidance.map(|(_, last)| last)));
    row.text(content.page_events.as_deref());
    row.text(&*content.display);
    row.whole(|_| Some(i64::from(damage.is_some())));
    row.text(damage);
    row.text(scene.robot_name());
}
