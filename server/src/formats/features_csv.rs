//! Writes and reads features.csv, which has a row for each step.

use crate::formats::csv_lines::{Dialect, LineError, Record, Records};
use csv::Writer;
use sidestep::dataset::{Dataset, GivenFeatures, GivenRow, StepKey};
use sidestep::features::{FEATURES, FeatureSet};
use sidestep::invalid::{Invalid, finite};
use sidestep::recording::{Fault, RecordedParticipant};
use sidestep::safety::SafetyLevels;
use sidestep::vehicle::TurnInput;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::io::{self, Read, Write};

/// Columns that identify a row.
const ROW: [&str; 3] = ["participant", "trial", "step"];

/// Names of the label's column: the name in this program's files, and the name in the reference's
/// files.
const TURN: [&str; 2] = ["turn", "y1"];

/// The paper's features: each feature's name in this program, and its name in the reference's
/// files.
const PAPERS: [(&str, &str); 8] = [
    ("abs_dx", "apx"),
    ("abs_dy", "apy"),
    ("dpsi", "dpsi"),
    ("cos_dpsi", "cosd"),
    ("sin_dpsi", "sind"),
    ("v_h", "vh"),
    ("v_r", "vr"),
    ("distance", "d"),
];

/// The reason why features cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// An error of the disk.
    #[error(transparent)]
    Disk(#[from] io::Error),
    /// A trial has no features.
    #[error("{0}")]
    Trials(Fault),
}

/// Writes the file.
///
/// # Errors
/// [`WriteError`] for an error of the disk, or a trial that has no features.
pub fn write(
    out: impl Write,
    people: &[RecordedParticipant],
    safety: &SafetyLevels,
) -> Result<(), WriteError> {
    let mut out = Writer::from_writer(out);
    let further = || FEATURES[PAPERS.len()..].iter().map(|feature| feature.name);
    let papers = PAPERS.iter().map(|(name, _)| *name);
    let header = ROW.into_iter().chain(papers).chain(["turn", "avoid"]).chain(further());
    out.write_record(header).map_err(io::Error::from)?;
    for person in people {
        let data = Dataset::of(person, safety).map_err(WriteError::Trials)?;
        let mut rows = data.values.chunks_exact(FEATURES.len());
        for trial in &person.trials {
            let number = trial.number.to_string();
            for ((step, input), row) in trial.inputs.iter().enumerate().zip(&mut rows) {
                let turns = *input != TurnInput::Straight;
                let label = [input.sign().to_string(), u8::from(turns).to_string()];
                let (papers, further) = row.split_at(PAPERS.len());
                let first = [person.name.clone(), number.clone(), step.to_string()];
                let fields = first.into_iter().chain(papers.iter().map(f64::to_string));
                let fields = fields.chain(label).chain(further.iter().map(f64::to_string));
                out.write_record(fields).map_err(io::Error::from)?;
            }
        }
    }
    Ok(out.flush()?)
}

/// Reads a file in this program's form or in the reference's form,
/// `apx,apy,dpsi,cosd,sind,vh,vr,d,y1`. The header determines the form. Other columns are ignored.
/// An impossible value or a repeated row is a fault of one participant, which
/// [`GivenFeatures::replace`] returns. Also returns the dialect.
///
/// # Errors
/// [`LineError`] for a missing column, or text that is not a table.
pub fn read(file: impl Read) -> Result<(GivenFeatures, Dialect), LineError> {
    let at = |line: u64| move |what: Invalid| LineError { line, what };
    let (mut records, header) = Records::of(file)?;
    let columns = Columns::of(&header).map_err(at(1))?;
    let mut rows: HashMap<StepKey, GivenRow> = HashMap::new();
    let mut faults = HashMap::new();
    while let Some((line, record)) = records.read()? {
        let mut fault = |what| {
            let participant = columns.participant(record).to_owned();
            faults.entry(participant).or_insert(Fault { line: Some(line), what });
        };
        match columns.row(record) {
            Ok((key, turn, values)) => match rows.entry(key) {
                Entry::Vacant(place) => {
                    place.insert(GivenRow { line, turn, values });
                }
                Entry::Occupied(place) => {
                    let ((_, trial, step), before) = (place.key(), place.get().line);
                    let found = format!("trial {trial}, step {step} again, after line {before}");
                    fault(Invalid::new("row", "each step once", found));
                }
            },
            Err(what) => fault(what),
        }
    }
    Ok((GivenFeatures { features: columns.features, rows, faults }, records.dialect()))
}

struct Columns {
    row: [usize; 3],
    turn: usize,
    features: FeatureSet,
    places: Vec<usize>,
}

impl Columns {
    fn of(header: &Record) -> Result<Self, Invalid> {
        let clean = |name: &str| name.trim().trim_start_matches('\u{feff}').to_owned();
        let names: Vec<String> = header.iter().map(clean).collect();
        if let Some((i, twice)) = names.iter().enumerate().find(|(i, n)| names[..*i].contains(n)) {
            let found = format!("{twice:?} again as column {}", i + 1);
            return Err(Invalid::new("header", "each column once", found));
        }
        let find = |wanted: &[&str]| {
            names.iter().position(|name| wanted.contains(&name.as_str())).ok_or_else(|| {
                let expected = format!("a column {}", wanted.join(" or "));
                Invalid::new("header", expected, "none")
            })
        };
        let mut row = [0; 3];
        for (place, wanted) in row.iter_mut().zip(ROW) {
            *place = find(&[wanted])?;
        }
        let mut features = Vec::new();
        let mut places = Vec::new();
        for (name, reference) in PAPERS {
            features.push(name);
            places.push(find(&[name, reference])?);
        }
        for feature in &FEATURES[PAPERS.len()..] {
            if let Some(place) = names.iter().position(|name| name == feature.name) {
                features.push(feature.name);
                places.push(place);
            }
        }
        Ok(Self { row, turn: find(&TURN)?, features: FeatureSet::of(&features)?, places })
    }

    fn participant<'a>(&self, record: &'a Record) -> &'a str {
        record.get(self.row[0]).unwrap_or("").trim()
    }

    fn row(&self, record: &Record) -> Result<(StepKey, TurnInput, Vec<f64>), Invalid> {
        let field = |place: usize| record.get(place).unwrap_or("").trim();
        let wrong = |name: &str, expected: &str, text: &str| {
            let found: String = text.chars().take(60).collect();
            Invalid::new(name, expected, format!("{found:?}"))
        };
        let count = |i: usize| {
            let text = field(self.row[i]);
            text.parse().map_err(|_| wrong(ROW[i], "a whole number ≥ 0", text))
        };
        let turn = record
            .number(self.turn, TURN[0])
            .ok()
            .and_then(|sign| TurnInput::ALL.into_iter().find(|t| f64::from(t.sign()) == sign))
            .ok_or_else(|| wrong(TURN[0], "-1, 0 or 1", field(self.turn)))?;
        let values = self
            .places
            .iter()
            .zip(self.features.features())
            .map(|(&place, feature)| finite(feature.name, record.number(place, feature.name)?));
        let key = (self.participant(record).to_owned(), count(1)?, count(2)?);
        Ok((key, turn, values.collect::<Result<_, _>>()?))
    }
}
