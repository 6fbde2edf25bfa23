//! The table with a row for each key press and key release while a scene was driven.

use super::{Driven, participant_column, trial_column};
use crate::formats::table::Kind::{Text, Time, Whole, Word};
use crate::formats::table::{Batch, Column};
use sidestep::api::KeyEvent;

/// The columns.
#[must_use]
pub fn columns() -> Vec<Column> {
    vec![
        participant_column(),
        trial_column(),
        Column::new("trial_id", Word, "the trial's id on the server"),
        Column::new("event", Whole, "number of the event in the trial, from 0"),
        Column::new("t_ms", Time, "time after the scene's start; negative for a key held before")
            .unit("ms"),
        Column::new("key", Text, "the key's name; blur when the window lost the keyboard"),
        Column::new("down", Whole, "1 if it went down, 0 if it went up").range("0, 1"),
    ]
}

/// Adds the key events of a trial.
///
/// # Errors
/// If the stored events are not valid JSON.
pub fn add(batch: &mut Batch, driven: &Driven<'_>) -> serde_json::Result<()> {
    let Driven { number, trial, .. } = *driven;
    let events: Vec<KeyEvent> = serde_json::from_str(&trial.content.key_events)?;
    for (place, event) in events.iter().enumerate() {
        let mut row = batch.add(1);
        row.whole(|_| Some(trial.head.participant_number));
        row.whole(|_| Some(number as i64));
        row.text(&*trial.head.trial_id);
        row.whole(|_| Some(place as i64));
        row.number(|_| Some(event.t_ms));
        row.text(&*event.key);
        row.whole(|_| Some(i64::from(event.down)));
    }
    Ok(())
}
