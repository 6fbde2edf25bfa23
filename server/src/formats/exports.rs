//! A study's trials as a CSV file, for the route and the command.
//!
//! Participants are read one after the other, so that memory does not grow with the study and no long
//! read keeps SQLite from writing back its log. Each participant's rows come from one snapshot.

use crate::formats::trials_csv::COLUMNS;
use crate::store::studies::StoredStudy;
use crate::store::trials::{StoredTrial, flag_words};
use crate::store::{Store, StoreError};
use futures_util::stream::{self, Stream};
use sidestep::invalid::Invalid;
use sidestep::scene::SceneParameters;

/// Accepts the supported formats.
///
/// # Errors
/// [`Invalid`] naming them.
pub fn check_format(format: &str) -> Result<(), Invalid> {
    if format == "csv" { Ok(()) } else { Err(Invalid::new("format", "csv", format!("{format:?}"))) }
}

/// The file, piece by piece. After an error there are no further pieces, so a download breaks off instead
/// of ending as if it were complete.
pub fn stream(
    store: Store,
    study: StoredStudy,
) -> impl Stream<Item = Result<Vec<u8>, StoreError>> + Send + 'static {
    enum Stage {
        Header,
        People(std::vec::IntoIter<String>),
        End,
    }
    stream::unfold(Stage::Header, move |stage| {
        let (store, study_id) = (store.clone(), study.id);
        async move {
            match stage {
                Stage::Header => match store.participant_ids(study_id, false).await {
                    Ok(ids) => Some((Ok(header()), Stage::People(ids.into_iter()))),
                    Err(error) => Some((Err(error), Stage::End)),
                },
                Stage::People(mut ids) => match person(&store, &ids.next()?).await {
                    Ok(rows) => Some((Ok(rows), Stage::People(ids))),
                    Err(error) => Some((Err(error), Stage::End)),
                },
                Stage::End => None,
            }
        }
    })
}

fn header() -> Vec<u8> {
    let mut line = COLUMNS.join(",");
    line.push('\n');
    line.into_bytes()
}

/// The rows of one participant. Trials are numbered from 0 over all phases, so that (participant, trial)
/// identifies a trial.
async fn person(store: &Store, participant_id: &str) -> Result<Vec<u8>, StoreError> {
    let driven = store.trials_of(participant_id).await?;
    let Some(first) = driven.first() else {
        return Ok(Vec::new());
    };
    let parameters = store.config(&first.config_hash).await?.parameters;
    let mut writer = csv::Writer::from_writer(Vec::new());
    for (number, trial) in driven.iter().enumerate() {
        write_trial(&mut writer, &parameters, number, trial).map_err(|error| {
            StoreError::Corrupt(format!("trial {}: {error}", trial.head.trial_id))
        })?;
    }
    writer.into_inner().map_err(|error| StoreError::Defect(error.to_string()))
}

/// A row for each step: the state before it and the input held in it. Numbers have as many digits as
/// needed to read back the same bits.
fn write_trial(
    writer: &mut csv::Writer<Vec<u8>>,
    parameters: &SceneParameters,
    number: usize,
    trial: &StoredTrial,
) -> csv::Result<()> {
    let (head, content) = (&trial.head, &trial.content);
    let started_at_ms = content.started_at_ms.map(|t| t.to_string());
    let exposures = content.exposures.map(|count| count.to_string()).unwrap_or_default();
    let synthetic = if trial.is_synthetic() { "1" } else { "0" };
    for (step, (input, state)) in content.inputs.iter().zip(&content.states).enumerate() {
        let sampled = content.sampled_at_ms.as_ref().map(|times| times[step].to_string());
        let ([hx, hy, hpsi], [rx, ry, rpsi]) = (state.human.into(), state.robot.into());
        // Rounded to the nanosecond: 0.6 instead of 0.6000000000000001.
        let t = (step as f64 * parameters.step_s * 1e9).round() / 1e9;
        let numbers = [t, hx, hy, hpsi, rx, ry, rpsi, parameters.human.turn_rate(*input)];
        writer.write_field(head.participant_number.to_string())?;
        writer.write_field(number.to_string())?;
        writer.write_field(step.to_string())?;
        for number in numbers {
            writer.write_field(decimal(number))?;
        }
        writer.write_field(text(&trial.study))?;
        writer.write_field(head.phase.word())?;
        writer.write_field(head.index.to_string())?;
        writer.write_field(head.attempt.to_string())?;
        writer.write_field(text(&head.trial_id))?;
        writer.write_field(text(&head.participant_id))?;
        writer.write_field(flag_words(&head.flags))?;
        writer.write_field(started_at_ms.as_deref().unwrap_or(""))?;
        writer.write_field(sampled.as_deref().unwrap_or(""))?;
        writer.write_field(head.received_at_ms.to_string())?;
        writer.write_field(synthetic)?;
        writer.write_field(decimal((step as f64 * parameters.step_s * 1e9).round() / 1e6))?;
        writer.write_field(&exposures)?;
        writer.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

/// The shortest decimal that reads back as the same bits; whole numbers as `4.0`.
fn decimal(number: f64) -> String {
    format!("{number:?}")
}

/// The text, with an apostrophe before it if a spreadsheet could take it for a formula.
pub(super) fn text(text: &str) -> String {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r']) {
        format!("'{text}")
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_bit_for_bit() {
        for number in [0.1 + 0.2, -1.5, 1e300, f64::MIN_POSITIVE, 4.0, -0.0] {
            let again: f64 = decimal(number).parse().unwrap();
            assert_eq!(again.to_bits(), number.to_bits(), "{number:?}");
        }
        assert_eq!(decimal(4.0), "4.0");
    }

    #[test]
    fn formulas_are_disarmed_and_words_left_alone() {
        assert_eq!(text("=HYPERLINK(1)"), "'=HYPERLINK(1)");
        assert_eq!(text("-cmd"), "'-cmd");
        assert_eq!(text("default"), "default");
    }
}
