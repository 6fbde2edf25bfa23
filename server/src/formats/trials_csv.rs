//! Reading trials.csv: whole trials, or an error with its line.
//!
//! A file is refused as a whole unless every row can be assigned to a participant: it is
//! comma-separated UTF-8 text with as many fields in every row as the header has, and each row
//! names a participant. Any other fault concerns one participant only.

mod row;

use crate::formats::csv_lines::{LineError, Records};
use row::{Columns, Row};
use sidestep::invalid::{Invalid, length};
use sidestep::recording::{RecordedParticipant, RecordedTrial};
use sidestep::scene::SceneParameters;
use std::collections::HashMap;
use std::io::Read;

/// The columns of an export, in order. Every file must have the first [`REQUIRED`] columns, in any
/// order.
pub const COLUMNS: [&str; 24] = [
    "participant",
    "trial",
    "step",
    "t",
    "hx",
    "hy",
    "hpsi",
    "rx",
    "ry",
    "rpsi",
    "omega",
    "study",
    "phase",
    "phase_index",
    "attempt",
    "trial_id",
    "participant_id",
    "flags",
    "started_at_ms",
    "sampled_at_ms",
    "received_at_ms",
    "synthetic",
    "due_at_ms",
    "exposures",
];

/// The number of [`COLUMNS`] that every file must have.
pub const REQUIRED: usize = 11;

/// The content of a file.
#[derive(Debug)]
pub struct Contents {
    /// The participants with valid rows, in the order of their first rows.
    pub participants: Vec<RecordedParticipant>,
    /// The other participants, in the order of lines.
    pub faults: Vec<ParticipantFault>,
}

/// A participant with a wrong row or trial.
#[derive(Debug, PartialEq, Eq)]
pub struct ParticipantFault {
    /// The participant's name or number in the file.
    pub participant: String,
    /// The first invalid row or, if every row is valid, the first invalid trial.
    pub error: LineError,
}

/// The participants of a file, in the order of their first rows, if all rows are valid.
///
/// # Errors
/// [`LineError`] of [`read_each`], or the first of its faults.
pub fn read(
    file: impl Read,
    parameters: &SceneParameters,
) -> Result<Vec<RecordedParticipant>, LineError> {
    let Contents { participants, faults } = read_each(file, parameters)?;
    faults.into_iter().next().map_or(Ok(participants), |fault| Err(fault.error))
}

/// The participants of a file, and those with an invalid row or trial: an impossible value, or steps other
/// than 0, 1, 2, … to the end. Adjacent rows of a trial must be in order. If a trial's rows are
/// scattered, as in a file that was sorted by another column, their order does not matter.
///
/// # Errors
/// [`LineError`] if a row cannot be assigned to a participant: a missing column, text that is not
/// UTF-8, a row with another number of fields than the header, or without a participant; and if
/// there is no row.
pub fn read_each(file: impl Read, parameters: &SceneParameters) -> Result<Contents, LineError> {
    let (mut records, header) = Records::of(file)?;
    let columns = Columns::of(&header).map_err(at(1))?;
    let mut trials: Vec<Rows> = Vec::new();
    let mut places: HashMap<(String, u64), usize> = HashMap::new();
    let mut faults: HashMap<String, LineError> = HashMap::new();
    let mut previous = None;
    while let Some((line, record)) = records.read()? {
        let participant = columns.participant(record).map_err(at(line))?;
        let row = match Row::parse(&columns, record, participant, parameters) {
            Ok(row) => row,
            Err(what) => {
                faults.entry(participant.to_owned()).or_insert(LineError { line, what });
                continue;
            }
        };
        let place = *places.entry((row.participant.clone(), row.trial)).or_insert(trials.len());
        if place == trials.len() {
            trials.push(Rows::default());
        }
        trials[place].scattered |= previous != Some(place) && !trials[place].rows.is_empty();
        trials[place].rows.push((line, row));
        previous = Some(place);
    }
    if trials.is_empty() && faults.is_empty() {
        return Err(at(1)(Invalid::new("file", "at least one trial", "no row")));
    }
    let mut people: Vec<RecordedParticipant> = Vec::new();
    let mut person_of: HashMap<String, usize> = HashMap::new();
    for rows in trials {
        let (line, first) = &rows.rows[0];
        let (line, name, synthetic) = (*line, first.participant.clone(), first.synthetic);
        if faults.contains_key(&name) {
            continue;
        }
        let trial = match rows.trial(parameters) {
            Ok(trial) => trial,
            Err(error) => {
                faults.insert(name, error);
                continue;
            }
        };
        let place = *person_of.entry(name.clone()).or_insert(people.len());
        if place == people.len() {
            people.push(RecordedParticipant {
                name,
                line: Some(line),
                ..RecordedParticipant::default()
            });
        }
        people[place].trials.push(trial);
        people[place].marked_synthetic |= synthetic;
    }
    people.retain(|person| !faults.contains_key(&person.name));
    for person in &mut people {
        person.trials.sort_by_key(|trial| (trial.phase, trial.number));
    }
    let fault = |(participant, error)| ParticipantFault { participant, error };
    let mut faults: Vec<ParticipantFault> = faults.into_iter().map(fault).collect();
    faults.sort_by_key(|fault| fault.error.line);
    Ok(Contents { participants: people, faults })
}

fn at(line: u64) -> impl Fn(Invalid) -> LineError {
    move |what| LineError { line, what }
}

/// The rows of one trial with their lines, as the file has them; at least one.
#[derive(Default)]
struct Rows {
    rows: Vec<(u64, Row)>,
    scattered: bool,
}

impl Rows {
    fn trial(mut self, parameters: &SceneParameters) -> Result<RecordedTrial, LineError> {
        if self.scattered {
            self.rows.sort_by_key(|(_, row)| row.step);
        }
        let (line, first) = &self.rows[0];
        let mut trial = begun(*line, first);
        let mut last_line = *line;
        for (line, row) in self.rows {
            last_line = line;
            push(&mut trial, row, parameters).map_err(at(line))?;
        }
        length("step", parameters.steps, trial.inputs.len()).map_err(at(last_line))?;
        // The state after the last step follows from its input.
        if let (Some(&state), Some(&input)) = (trial.states.last(), trial.inputs.last()) {
            trial.states.push(state.advance(parameters, input, parameters.step_s));
        }
        Ok(trial)
    }
}

/// A trial without steps, as its first row says.
fn begun(line: u64, row: &Row) -> RecordedTrial {
    RecordedTrial {
        line: Some(line),
        number: row.trial,
        phase: row.phase,
        attempt: row.attempt,
        trial_id: row.trial_id.clone(),
        inputs: Vec::new(),
        states: Vec::new(),
        started_at_ms: row.started_at_ms,
        sampled_at_ms: row.sampled_at_ms.map(|_| Vec::new()),
        flags: row.flags.clone(),
    }
}

/// Adds the next row, which must continue the trial.
fn push(trial: &mut RecordedTrial, row: Row, parameters: &SceneParameters) -> Result<(), Invalid> {
    let next = trial.inputs.len();
    if next == parameters.steps {
        let expected = format!("{next} steps a trial");
        return Err(Invalid::new("step", expected, format!("a further row, {}", row.step)));
    }
    if row.step != next as u64 {
        return Err(Invalid::new("step", next.to_string(), row.step));
    }
    let t = next as f64 * parameters.step_s;
    if (row.t - t).abs() > 1e-2 * parameters.step_s {
        let expected = format!("{t} (steps of {} s)", parameters.step_s);
        return Err(Invalid::new("t", expected, row.t));
    }
    if row.phase != trial.phase {
        let expected = format!("{}, as in the trial's first row", trial.phase.word());
        return Err(Invalid::new("phase", expected, row.phase.word()));
    }
    if row.trial_id != trial.trial_id {
        let expected = "the same id in all rows of a trial";
        return Err(Invalid::new("trial_id", expected, "another one"));
    }
    match (&mut trial.sampled_at_ms, row.sampled_at_ms) {
        (Some(times), Some(at)) => times.push(at),
        (None, None) => {}
        _ => {
            let expected = "a time in all rows of a trial, or in none";
            return Err(Invalid::new("sampled_at_ms", expected, "some"));
        }
    }
    trial.inputs.push(row.input);
    trial.states.push(row.state);
    Ok(())
}
