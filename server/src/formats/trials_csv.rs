//! Reads trials.csv. Returns whole trials, or an error with its line.
//!
//! A file is rejected if a row cannot be assigned to a participant. So the file must be a text table,
//! and every row must have as many fields as the header and must name a participant. Any other fault
//! affects only one participant.

mod row;

use crate::formats::csv_lines::{Dialect, LineError, Records};
use row::{Parser, Row};
use sidestep::invalid::{Invalid, length};
use sidestep::recording::{RecordedParticipant, RecordedTrial};
use sidestep::scene::SceneParameters;
use std::collections::{HashMap, HashSet};
use std::io::Read;
use std::ops::ControlFlow;
use uuid::Uuid;

/// The columns that every file must have, in any order.
pub const REQUIRED: [&str; 11] =
    ["participant", "trial", "step", "t", "hx", "hy", "hpsi", "rx", "ry", "rpsi", "omega"];

/// The content of a file.
#[derive(Debug)]
pub struct Contents {
    /// The participants with valid rows, in the order of their first rows.
    pub participants: Vec<RecordedParticipant>,
    /// The participants with a fault, in the order of lines.
    pub faults: Vec<ParticipantFault>,
    /// The dialect of the file.
    pub dialect: Dialect,
}

/// A participant with an invalid row or trial.
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
/// The [`LineError`] of [`read_each`], or the first fault.
pub fn read(
    file: impl Read,
    parameters: &SceneParameters,
) -> Result<Vec<RecordedParticipant>, LineError> {
    let Contents { participants, faults, .. } = read_each(file, parameters)?;
    faults.into_iter().next().map_or(Ok(participants), |fault| Err(fault.error))
}

/// The valid participants of a file, and the participants with an invalid row or trial. A row is
/// invalid if it has an impossible value. The steps of a valid trial are 0, 1, 2, … without gaps. If
/// the rows of a trial are adjacent, they must be in order. If they are scattered, as in a file sorted
/// by another column, their order does not matter.
///
/// # Errors
/// [`LineError`] if a row cannot be assigned to a participant (a missing column, text that is not UTF-8, a
/// number of fields that differs from the header's, no participant), or if there is no row.
pub fn read_each(file: impl Read, parameters: &SceneParameters) -> Result<Contents, LineError> {
    let mut rows = Rows::of(file, parameters)?;
    let mut people: Vec<Person> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    let mut current: Option<usize> = None;
    while let Some((line, name, row)) = rows.next()? {
        let place = match current.filter(|&place| people[place].name == name) {
            Some(place) => place,
            None => match places.get(name) {
                Some(&place) => {
                    people[place].comes_again();
                    place
                }
                None => {
                    places.insert(name.to_owned(), people.len());
                    people.push(Person::new(name));
                    people.len() - 1
                }
            },
        };
        people[place].add(line, row);
        current = Some(place);
    }
    let dialect = rows.records.dialect();
    let mut contents = Contents { participants: Vec::new(), faults: Vec::new(), dialect };
    for person in people {
        match person.recorded(parameters) {
            Ok(person) => contents.participants.push(person),
            Err(fault) => contents.faults.push(fault),
        }
    }
    contents.faults.sort_by_key(|fault| fault.error.line);
    Ok(contents)
}

/// Whether the rows of each participant are adjacent, as in exports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The rows of each participant are adjacent, so [`each`] can read the file.
    Together,
    /// The rows of a participant are in several places, so only [`read`] can read the file.
    Scattered,
}

/// Checks a file like [`read`], but keeps only one participant in memory. Returns the order and the
/// dialect. If the file is scattered, the check stops as soon as this is known.
///
/// # Errors
/// The errors of [`read`].
pub fn check(file: impl Read, parameters: &SceneParameters) -> Result<(Order, Dialect), LineError> {
    let mut fault = None;
    let (order, dialect) = people(file, parameters, |found| {
        // Continue, because a row that cannot be assigned to a participant is the more serious error.
        fault = fault.take().or(found.err().map(|fault| fault.error));
        ControlFlow::Continue(())
    })?;
    match (order, fault) {
        (Order::Together, Some(fault)) => Err(fault),
        (order, _) => Ok((order, dialect)),
    }
}

/// Passes the participants of a file one by one to `to`, until it returns `Break`.
///
/// # Errors
/// The errors of [`read`], in file order, or an error if the file is scattered.
pub fn each(
    file: impl Read,
    parameters: &SceneParameters,
    mut to: impl FnMut(RecordedParticipant) -> ControlFlow<()>,
) -> Result<(), LineError> {
    let mut fault = None;
    let (order, _) = people(file, parameters, |found| match found {
        Ok(person) => to(person),
        Err(found) => {
            fault = Some(found.error);
            ControlFlow::Break(())
        }
    })?;
    match (order, fault) {
        (_, Some(fault)) => Err(fault),
        (Order::Together, None) => Ok(()),
        (Order::Scattered, None) => {
            let expected = "all rows of a participant together, as before";
            Err(at(1)(Invalid::new("file", expected, "a file that changes while it is read")))
        }
    }
}

/// Passes the participants one by one to `to`, until `to` returns `Break` or a participant's rows
/// are found to be scattered.
fn people(
    file: impl Read,
    parameters: &SceneParameters,
    mut to: impl FnMut(Result<RecordedParticipant, ParticipantFault>) -> ControlFlow<()>,
) -> Result<(Order, Dialect), LineError> {
    let mut rows = Rows::of(file, parameters)?;
    let mut before: HashSet<String> = HashSet::new();
    let mut current: Option<Person> = None;
    while let Some((line, name, row)) = rows.next()? {
        if current.as_ref().is_none_or(|person| person.name != name) {
            if !before.insert(name.to_owned()) {
                return Ok((Order::Scattered, rows.records.dialect()));
            }
            if let Some(person) = current.replace(Person::new(name))
                && to(person.recorded(parameters)).is_break()
            {
                return Ok((Order::Together, rows.records.dialect()));
            }
        }
        if let Some(person) = &mut current {
            person.add(line, row);
        }
    }
    if let Some(person) = current {
        let _ = to(person.recorded(parameters));
    }
    Ok((Order::Together, rows.records.dialect()))
}

/// The rows of a file.
struct Rows<R> {
    records: Records<R>,
    parser: Parser,
    any: bool,
}

impl<R: Read> Rows<R> {
    fn of(file: R, parameters: &SceneParameters) -> Result<Self, LineError> {
        let (records, header) = Records::of(file)?;
        let parser = Parser::new(&header, parameters).map_err(at(1))?;
        Ok(Self { records, parser, any: false })
    }

    /// The next row, with its line and its participant. Returns `None` at the end.
    #[allow(clippy::type_complexity, reason = "a row, or what is wrong with it")]
    fn next(&mut self) -> Result<Option<(u64, &str, Result<Row, Invalid>)>, LineError> {
        let Some((line, record)) = self.records.read()? else {
            return match self.any {
                true => Ok(None),
                false => Err(at(1)(Invalid::new("file", "at least one trial", "no row"))),
            };
        };
        self.any = true;
        let participant = self.parser.participant(record).map_err(at(line))?;
        Ok(Some((line, participant, self.parser.row(record))))
    }
}

fn at(line: u64) -> impl Fn(Invalid) -> LineError {
    move |what| LineError { line, what }
}

/// The rows of one participant so far.
struct Person {
    name: String,
    trials: Vec<Trial>,
    places: HashMap<u64, usize>,
    /// The trial of the previous row, unless rows of another participant are in between.
    previous: Option<usize>,
    fault: Option<LineError>,
}

impl Person {
    fn new(name: &str) -> Self {
        let name = name.to_owned();
        Self { name, trials: Vec::new(), places: HashMap::new(), previous: None, fault: None }
    }

    /// Must be called before a row that follows rows of another participant.
    fn comes_again(&mut self) {
        self.previous = None;
    }

    fn add(&mut self, line: u64, row: Result<Row, Invalid>) {
        let row = match row {
            Ok(row) => row,
            Err(what) => {
                self.fault.get_or_insert(LineError { line, what });
                return;
            }
        };
        let place = match self.previous.filter(|&place| self.trials[place].number == row.trial) {
            Some(place) => place,
            None => *self.places.entry(row.trial).or_insert(self.trials.len()),
        };
        if place == self.trials.len() {
            self.trials.push(Trial { number: row.trial, rows: Vec::new(), scattered: false });
        }
        let trial = &mut self.trials[place];
        trial.scattered |= self.previous != Some(place) && !trial.rows.is_empty();
        trial.rows.push((line, row));
        self.previous = Some(place);
    }

    /// Returns the participant. The error is the first invalid row or, if all rows are valid, the
    /// first invalid trial.
    fn recorded(
        self,
        parameters: &SceneParameters,
    ) -> Result<RecordedParticipant, ParticipantFault> {
        let Self { name, trials, fault, .. } = self;
        let failed = |error, name: &str| ParticipantFault { participant: name.to_owned(), error };
        if let Some(error) = fault {
            return Err(failed(error, &name));
        }
        let line = trials.first().and_then(|trial| trial.rows.first()).map(|(line, _)| *line);
        let is_marked = |trial: &Trial| trial.rows.first().is_some_and(|(_, row)| row.synthetic);
        let marked_synthetic = trials.iter().any(is_marked);
        let recorded = trials.into_iter().map(|trial| trial.recorded(parameters));
        let mut trials: Vec<RecordedTrial> =
            recorded.collect::<Result<_, _>>().map_err(|error| failed(error, &name))?;
        trials.sort_by_key(|trial| (trial.phase, trial.number));
        Ok(RecordedParticipant { name, line, trials, marked_synthetic })
    }
}

/// The rows of one trial with their lines, in file order. There is at least one row.
struct Trial {
    number: u64,
    rows: Vec<(u64, Row)>,
    scattered: bool,
}

impl Trial {
    fn recorded(mut self, parameters: &SceneParameters) -> Result<RecordedTrial, LineError> {
        if self.scattered {
            self.rows.sort_by_key(|(_, row)| row.step);
        }
        let (line, first) = &self.rows[0];
        let (mut last_line, trial_id) = (*line, first.trial_id);
        let mut trial = begun(*line, first, self.rows.len());
        for (line, row) in self.rows {
            last_line = line;
            push(&mut trial, trial_id, &row, parameters).map_err(at(line))?;
        }
        length("step", parameters.steps, trial.inputs.len()).map_err(at(last_line))?;
        // The state after the last step is computed from the last input, with a robot that drives
        // straight. An import into a study with other robots corrects it.
        if let (Some(&state), Some(&input)) = (trial.states.last(), trial.inputs.last()) {
            trial.states.push(state.advance(parameters, input, 0.0, parameters.step_s));
        }
        Ok(trial)
    }
}

/// A trial without steps, with the number, phase, flags and other general data of its first row.
fn begun(line: u64, row: &Row, rows: usize) -> RecordedTrial {
    RecordedTrial {
        line: Some(line),
        number: row.trial,
        phase: row.phase,
        attempt: row.attempt,
        trial_id: row.trial_id.map(|id| id.to_string()),
        inputs: Vec::with_capacity(rows),
        states: Vec::with_capacity(rows + 1),
        started_at_ms: row.started_at_ms,
        sampled_at_ms: row.sampled_at_ms.map(|_| Vec::with_capacity(rows)),
        flags: row.flags.as_deref().unwrap_or_default().to_vec(),
        robot: None,
    }
}

/// Adds the next row, which must continue the trial.
fn push(
    trial: &mut RecordedTrial,
    trial_id: Option<Uuid>,
    row: &Row,
    parameters: &SceneParameters,
) -> Result<(), Invalid> {
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
    if row.trial_id != trial_id {
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
