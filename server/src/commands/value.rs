//! `sidestep value`.

use super::degrees::Degrees;
use super::game::FunctionArgs;
use super::solving::Interrupt;
use super::{CommandError, print_json, table_file, unwritable};
use crate::formats::atomic_file;
use crate::formats::csv_lines::{Dialect, LineError, Record, Records};
use csv::Writer;
use sidestep::invalid::{Invalid, finite};
use sidestep::reachability::{ValueFunction, ValueState};
use std::io::{self, Read};
use std::path::PathBuf;

/// Evaluate the value function, its gradient and both optimal turns at given states.
///
/// Prints one line of JSON with the number of states, and the number of states outside the solved grid.
#[derive(Clone, Debug, clap::Args)]
pub struct ValueArgs {
    #[command(flatten)]
    function: FunctionArgs,
    /// CSV file with the columns x, y (m) and psi (rad) in any order; - reads stdin.
    ///
    /// A state is the pursuer's pose in the evader's frame. Other columns are ignored. A psi of
    /// more than a full turn is reported, because it may be in degrees.
    #[arg(long, value_name = "FILE.csv")]
    states: PathBuf,
    /// File to write, one row per state in the same order.
    ///
    /// Columns: x, y, psi, value (m), dvalue_dx, dvalue_dy (m/m), dvalue_dpsi (m/rad), evader_turn,
    /// pursuer_turn (rad/s, positive to the left; 0 if all turns are equally good or straight
    /// driving is best), exact (1 if from the closed form, 0 if from a grid), inside (1 inside the
    /// solved grid; outside, V is the range margin plus the difference between V and the range
    /// margin at the nearest point of the grid).
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
}

const COLUMNS: [&str; 3] = ["x", "y", "psi"];

const RESULTS: [&str; 8] = [
    "value",
    "dvalue_dx",
    "dvalue_dy",
    "dvalue_dpsi",
    "evader_turn",
    "pursuer_turn",
    "exact",
    "inside",
];

/// Evaluates the states, and writes the whole file or nothing.
///
/// # Errors
/// [`CommandError`] for bad flags or an invalid file, with its line and column (input), or if the
/// output cannot be written (failure).
pub async fn run(args: ValueArgs) -> Result<(), CommandError> {
    let name = table_file::name(&args.states);
    let mut states = Vec::new();
    table_file::open(&args.states)
        .and_then(|mut file| file.read_to_end(&mut states))
        .map_err(|e| CommandError::Input(format!("{name}: cannot read: {e}")))?;
    atomic_file::check(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let interrupt = Interrupt::listen();
    let function = args.function.function(&interrupt).await?;
    let (mut rows, mut outside) = (0_u64, 0_u64);
    let mut degrees = Degrees::of(name.as_str());
    atomic_file::write(&args.out, &interrupt.token, |out| -> Result<(), Fault> {
        let mut writer = Writer::from_writer(out);
        writer.write_record(COLUMNS.iter().chain(&RESULTS))?;
        let dialect = read(&states, |line, state| {
            degrees.look(state[2], || format!("line {line}, psi"));
            let found = evaluated(&function, state)?;
            rows += 1;
            outside += u64::from(!found.inside);
            writer.write_record(fields(state, &found))?;
            Ok(())
        })?;
        table_file::tell(&args.states, dialect);
        Ok(writer.flush()?)
    })
    .map_err(|fault| match fault {
        Fault::Line(error) => CommandError::Input(format!("{name}: {error}")),
        Fault::Disk(error) => interrupt.unwritten(&args.out, &error),
        Fault::State(invalid) => CommandError::failure(invalid),
    })?;
    degrees.warn();
    print_json(&serde_json::json!({ "states": rows, "outside": outside, "file": args.out }))
}

/// The reason why an evaluation failed.
enum Fault {
    Line(LineError),
    Disk(io::Error),
    /// An invalid state in a row. [`read`] adds the line number and returns [`Self::Line`].
    State(Invalid),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Self::Disk(error)
    }
}

impl From<csv::Error> for Fault {
    fn from(error: csv::Error) -> Self {
        Self::Disk(error.into())
    }
}

impl From<Invalid> for Fault {
    fn from(invalid: Invalid) -> Self {
        Self::State(invalid)
    }
}

/// Passes every state of the file to `each`, with its line. Returns the file's dialect.
fn read(
    file: &[u8],
    mut each: impl FnMut(u64, [f64; 3]) -> Result<(), Fault>,
) -> Result<Dialect, Fault> {
    let at = |line: u64| move |what: Invalid| Fault::Line(LineError { line, what });
    let (mut records, header) = Records::of(file).map_err(Fault::Line)?;
    let columns = columns(&header).map_err(at(1))?;
    while let Some((line, record)) = records.read().map_err(Fault::Line)? {
        let mut state = [0.0; 3];
        for (d, name) in COLUMNS.into_iter().enumerate() {
            let number = record.number(columns[d], name).map_err(at(line))?;
            // Quote the number as written. For example, 1e999 parses as infinity, which is not the text
            // in the file.
            let as_written =
                |invalid| Invalid { found: format!("{:?}", &record[columns[d]]), ..invalid };
            state[d] = finite(name, number).map_err(as_written).map_err(at(line))?;
        }
        each(line, state).map_err(|fault| match fault {
            Fault::State(invalid) => at(line)(invalid),
            other => other,
        })?;
    }
    Ok(records.dialect())
}

/// The column indices of x, y and psi.
fn columns(header: &Record) -> Result<[usize; 3], Invalid> {
    // Spreadsheets put a byte-order mark at the start of UTF-8.
    let names: Vec<&str> =
        header.iter().map(|name| name.trim_start_matches('\u{feff}').trim()).collect();
    // Quote the names, because a name can contain a line break.
    let all = format!("{:?}", names.join(","));
    let mut places = [0; 3];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        let mut found = (0..names.len()).filter(|i| names[*i] == column);
        *place = found.next().ok_or_else(|| Invalid::new(column, "a column of that name", &all))?;
        if found.next().is_some() {
            return Err(Invalid::new(column, "one column of that name", &all));
        }
    }
    Ok(places)
}

/// The value, gradient and turns at a state. Value and gradient are finite.
fn evaluated(function: &ValueFunction, state: [f64; 3]) -> Result<ValueState, Invalid> {
    let found = function.state(state);
    if found.value.is_finite() && found.gradient.iter().all(|g| g.is_finite()) {
        return Ok(found);
    }
    let [x, y, _] = state;
    let (name, large) = if x.abs() >= y.abs() { ("x", x) } else { ("y", y) };
    Err(Invalid::new(name, "a coordinate whose square is finite", large))
}

/// A row. Each printed number parses to the same double.
fn fields(state: [f64; 3], found: &ValueState) -> impl Iterator<Item = String> {
    let turns = [found.evader_turn, found.pursuer_turn];
    let numbers: Vec<f64> = [&state[..], &[found.value], &found.gradient, &turns].concat();
    let flags = [found.exact, found.inside].map(|flag| u8::from(flag).to_string());
    numbers.into_iter().map(|number| format!("{number:?}")).chain(flags)
}
