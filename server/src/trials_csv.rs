//! Reading trials.csv: rows in, whole trials out, or a complaint with its line.

mod row;

use csv::StringRecord;
use row::{Columns, Row};
use sidestep::invalid::{Invalid, length};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::trial::{Flag, Phase};
use sidestep::vehicle::TurnInput;
use std::collections::HashSet;
use std::io::Read;

/// Everything that one person drove.
#[derive(Clone, Debug)]
pub struct Person {
    /// As the file calls them.
    pub name: String,
    /// In the order of phases, then of the file's numbers.
    pub trials: Vec<FileTrial>,
}

/// One trial of a file.
#[derive(Clone, Debug)]
pub struct FileTrial {
    /// Line of its first row.
    pub line: u64,
    /// The file's number.
    pub number: u64,
    /// Its phase; a file without the column holds tasks.
    pub phase: Phase,
    /// Its id, where the file knows one.
    pub trial_id: Option<String>,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// Before each step, and after the last (which a file does not hold).
    pub states: Vec<JointState>,
    /// The participant's clock at the start, where the file knows it.
    pub started_at_ms: Option<f64>,
    /// When each input was sampled, where the file knows it.
    pub sampled_at_ms: Option<Vec<f64>>,
    /// What was known of it when it was exported.
    pub flags: Vec<Flag>,
}

/// A complaint about a line.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct LineError {
    /// From 1; the header is line 1.
    pub line: u64,
    /// Field, expected and found.
    pub what: Invalid,
}

/// The people of a file, in the order of their first rows.
///
/// # Errors
/// [`LineError`] for a missing column, a value that cannot be, or a trial whose
/// steps are not 0, 1, 2, … to the end.
pub fn read(file: impl Read, parameters: &SceneParameters) -> Result<Vec<Person>, LineError> {
    let mut reader = csv::Reader::from_reader(file);
    let header = reader.headers().map_err(broken)?.clone();
    let columns = Columns::of(&header).map_err(at(1))?;
    let mut people: Vec<Person> = Vec::new();
    let mut seen = HashSet::new();
    let mut open: Option<(String, OpenTrial)> = None;
    let mut record = StringRecord::new();
    while reader.read_record(&mut record).map_err(broken)? {
        let line = record.position().map_or(0, csv::Position::line);
        let row = Row::parse(&columns, &record, parameters).map_err(at(line))?;
        let same = |(name, trial): &(String, OpenTrial)| {
            *name == row.participant && trial.trial.number == row.trial
        };
        if !open.as_ref().is_some_and(same) {
            if let Some((name, trial)) = open.take() {
                close(&mut people, name, trial, parameters)?;
            }
            if !seen.insert((row.participant.clone(), row.trial)) {
                let expected = "the rows of a trial together, each trial once";
                let found = format!("{} of participant {} again", row.trial, row.participant);
                return Err(at(line)(Invalid::new("trial", expected, found)));
            }
            open = Some((row.participant.clone(), OpenTrial::new(line, &row)));
        }
        if let Some((_, trial)) = &mut open {
            trial.push(line, row, parameters).map_err(at(line))?;
        }
    }
    match open {
        Some((name, trial)) => close(&mut people, name, trial, parameters)?,
        None => return Err(at(1)(Invalid::new("file", "at least one trial", "no row"))),
    }
    for person in &mut people {
        person.trials.sort_by_key(|trial| (trial.phase, trial.number));
    }
    Ok(people)
}

fn at(line: u64) -> impl Fn(Invalid) -> LineError {
    move |what| LineError { line, what }
}

fn broken(error: csv::Error) -> LineError {
    let line = error.position().map_or(1, csv::Position::line);
    let found = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} fields under {expected_len} columns")
        }
        csv::ErrorKind::Utf8 { .. } => "octets that are not UTF-8".to_owned(),
        other => format!("{other:?}"),
    };
    at(line)(Invalid::new("row", "comma-separated UTF-8 text", found))
}

/// A trial whose rows are still coming.
struct OpenTrial {
    trial: FileTrial,
    last_line: u64,
}

impl OpenTrial {
    fn new(line: u64, row: &Row) -> Self {
        let trial = FileTrial {
            line,
            number: row.trial,
            phase: row.phase,
            trial_id: row.trial_id.clone(),
            inputs: Vec::new(),
            states: Vec::new(),
            started_at_ms: row.started_at_ms,
            sampled_at_ms: row.sampled_at_ms.map(|_| Vec::new()),
            flags: row.flags.clone(),
        };
        Self { trial, last_line: line }
    }

    fn push(&mut self, line: u64, row: Row, parameters: &SceneParameters) -> Result<(), Invalid> {
        let trial = &mut self.trial;
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
        self.last_line = line;
        Ok(())
    }
}

/// The state after the last step is the one that its input leads to.
fn close(
    people: &mut Vec<Person>,
    name: String,
    OpenTrial { mut trial, last_line }: OpenTrial,
    parameters: &SceneParameters,
) -> Result<(), LineError> {
    length("step", parameters.steps, trial.inputs.len()).map_err(at(last_line))?;
    if let (Some(&state), Some(&input)) = (trial.states.last(), trial.inputs.last()) {
        trial.states.push(state.advance(parameters, input, parameters.step_s));
    }
    match people.iter_mut().find(|person| person.name == name) {
        Some(person) => person.trials.push(trial),
        None => people.push(Person { name, trials: vec![trial] }),
    }
    Ok(())
}
