//! Reading trials.csv: rows in, whole trials out, or a complaint with its line.
//!
//! What tells whose a row is must be right everywhere, or the whole file is refused: it is
//! comma-separated UTF-8 text with as many fields in every row as the header has, and each row
//! names a participant. Anything else that is wrong is wrong with one person's rows.

mod row;

use crate::formats::csv_lines::{LineError, Records};
use row::{Columns, Row};
use sidestep::invalid::{Invalid, length};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::trial::{Flag, Phase};
use sidestep::vehicle::TurnInput;
use std::collections::HashMap;
use std::io::Read;

/// Everything that one person drove.
#[derive(Clone, Debug)]
pub struct Person {
    /// As the file calls them.
    pub name: String,
    /// Line of their first row, where they are from a file.
    pub line: Option<u64>,
    /// In the order of phases, then of the file's numbers.
    pub trials: Vec<FileTrial>,
    /// Whether a column `synthetic` says that nobody drove this.
    pub synthetic: bool,
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

/// What a file holds.
#[derive(Debug)]
pub struct Contents {
    /// Everybody whose rows are right, in the order of their first rows.
    pub people: Vec<Person>,
    /// Everybody else, in the order of lines.
    pub faults: Vec<Fault>,
}

/// Somebody whose rows are wrong.
#[derive(Debug, PartialEq, Eq)]
pub struct Fault {
    /// As the file calls them.
    pub participant: String,
    /// The first row that is wrong by itself or, where none is, the first trial that is wrong as
    /// a whole.
    pub error: LineError,
}

/// The people of a file, in the order of their first rows, if everybody's rows are right.
///
/// # Errors
/// [`LineError`] as of [`read_each`], or the first of its faults.
pub fn read(file: impl Read, parameters: &SceneParameters) -> Result<Vec<Person>, LineError> {
    let Contents { people, faults } = read_each(file, parameters)?;
    faults.into_iter().next().map_or(Ok(people), |fault| Err(fault.error))
}

/// Everybody in a file, and whose rows are wrong: a value that cannot be, or a trial whose
/// steps are not 0, 1, 2, … to the end. Where the rows of a trial stand together they must be in
/// order; where they are scattered, as in a file that was sorted by something else, their order
/// tells nothing.
///
/// # Errors
/// [`LineError`] where it cannot be told whose the rows are: a missing column, text that is not
/// UTF-8, a row with another number of fields than the header, or without a participant; and
/// where there is no row.
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
    let mut people: Vec<Person> = Vec::new();
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
            people.push(Person { name, line: Some(line), trials: Vec::new(), synthetic: false });
        }
        people[place].trials.push(trial);
        people[place].synthetic |= synthetic;
    }
    people.retain(|person| !faults.contains_key(&person.name));
    for person in &mut people {
        person.trials.sort_by_key(|trial| (trial.phase, trial.number));
    }
    let fault = |(participant, error)| Fault { participant, error };
    let mut faults: Vec<Fault> = faults.into_iter().map(fault).collect();
    faults.sort_by_key(|fault| fault.error.line);
    Ok(Contents { people, faults })
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
    fn trial(mut self, parameters: &SceneParameters) -> Result<FileTrial, LineError> {
        if self.scattered {
            self.rows.sort_by_key(|(_, row)| row.step);
        }
        let (line, first) = &self.rows[0];
        let mut trial = FileTrial::new(*line, first);
        let mut last_line = *line;
        for (line, row) in self.rows {
            last_line = line;
            trial.push(row, parameters).map_err(at(line))?;
        }
        length("step", parameters.steps, trial.inputs.len()).map_err(at(last_line))?;
        // The state after the last step is the one that its input leads to.
        if let (Some(&state), Some(&input)) = (trial.states.last(), trial.inputs.last()) {
            trial.states.push(state.advance(parameters, input, parameters.step_s));
        }
        Ok(trial)
    }
}

impl FileTrial {
    fn new(line: u64, row: &Row) -> Self {
        Self {
            line,
            number: row.trial,
            phase: row.phase,
            trial_id: row.trial_id.clone(),
            inputs: Vec::new(),
            states: Vec::new(),
            started_at_ms: row.started_at_ms,
            sampled_at_ms: row.sampled_at_ms.map(|_| Vec::new()),
            flags: row.flags.clone(),
        }
    }

    fn push(&mut self, row: Row, parameters: &SceneParameters) -> Result<(), Invalid> {
        let next = self.inputs.len();
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
        if row.phase != self.phase {
            let expected = format!("{}, as in the trial's first row", self.phase.word());
            return Err(Invalid::new("phase", expected, row.phase.word()));
        }
        if row.trial_id != self.trial_id {
            let expected = "the same id in all rows of a trial";
            return Err(Invalid::new("trial_id", expected, "another one"));
        }
        match (&mut self.sampled_at_ms, row.sampled_at_ms) {
            (Some(times), Some(at)) => times.push(at),
            (None, None) => {}
            _ => {
                let expected = "a time in all rows of a trial, or in none";
                return Err(Invalid::new("sampled_at_ms", expected, "some"));
            }
        }
        self.inputs.push(row.input);
        self.states.push(row.state);
        Ok(())
    }
}
