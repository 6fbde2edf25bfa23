//! features.csv: a row a step, written and read.

use crate::formats::csv_lines::{LineError, Records};
use crate::formats::trials_csv::Person;
use csv::{StringRecord, Writer};
use sidestep::dataset::Dataset;
use sidestep::features::{FEATURES, FeatureSet};
use sidestep::invalid::{Invalid, finite};
use sidestep::safety::SafetyLevels;
use sidestep::vehicle::TurnInput;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::io::{self, Read, Write};

/// Columns that say whose row it is.
const ROW: [&str; 3] = ["participant", "trial", "step"];

/// Columns of the label, as this program writes them and as the reference does.
const TURN: [&str; 2] = ["turn", "y1"];

/// The paper's features: names here, and in the reference.
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

/// Largest feature, in its unit: sums of squares of many stay far from overflow.
const LARGEST: f64 = 1e9;

fn is_usable(feature: f64) -> bool {
    (-LARGEST..=LARGEST).contains(&feature)
}

/// The rows of a person's trials, with every feature.
///
/// # Errors
/// [`LineError`] for a trial with a feature that is larger than any distance can be.
pub fn dataset(person: &Person, safety: &SafetyLevels) -> Result<Dataset, LineError> {
    let trials = person.trials.iter().map(|trial| (&trial.inputs[..], &trial.states[..]));
    let data = Dataset::from_trials(&FeatureSet::all(), safety, trials);
    let Some(place) = data.values.iter().position(|value| !is_usable(*value)) else {
        return Ok(data);
    };
    let (row, feature) = (place / FEATURES.len(), &FEATURES[place % FEATURES.len()]);
    let trial = &person.trials[data.trials[row]];
    let step = data.trials[..row].iter().rev().take_while(|of| **of == data.trials[row]).count();
    let found = format!("{} in step {step} of trial {}", data.values[place], trial.number);
    let what = Invalid::new(feature.name, "features of at most 1e9", found);
    Err(LineError { line: trial.line, what })
}

/// Why features are not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The disk does not let them.
    #[error(transparent)]
    Disk(#[from] io::Error),
    /// They are no numbers.
    #[error(transparent)]
    Trials(#[from] LineError),
}

/// Writes the file.
///
/// # Errors
/// [`WriteError`] for what the disk says, or a trial that has no features.
pub fn write(out: impl Write, people: &[Person], safety: &SafetyLevels) -> Result<(), WriteError> {
    let mut out = Writer::from_writer(out);
    let further = || FEATURES[PAPERS.len()..].iter().map(|feature| feature.name);
    let papers = PAPERS.iter().map(|(name, _)| *name);
    let header = ROW.into_iter().chain(papers).chain(["turn", "avoid"]).chain(further());
    out.write_record(header).map_err(io::Error::from)?;
    for person in people {
        let data = dataset(person, safety)?;
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

/// What a features.csv holds: features of rows by whose they are.
#[derive(Debug)]
pub struct FeatureRows {
    /// The features that it has.
    pub features: FeatureSet,
    rows: HashMap<Key, FileRow>,
    /// Of each participant with a row that is wrong, the first.
    faults: HashMap<String, LineError>,
}

/// Participant, trial and step.
type Key = (String, u64, u64);

#[derive(Debug)]
struct FileRow {
    line: u64,
    turn: TurnInput,
    values: Vec<f64>,
}

/// Reads either form, by its header: this program's, or the reference's
/// `apx,apy,dpsi,cosd,sind,vh,vr,d,y1`. Other columns are left out. A value that cannot be and a row
/// that is there twice are one participant's fault, and told by [`FeatureRows::replace`].
///
/// # Errors
/// [`LineError`] for a missing column, or text that is no table.
pub fn read(file: impl Read) -> Result<FeatureRows, LineError> {
    let at = |line: u64| move |what: Invalid| LineError { line, what };
    let (mut records, header) = Records::of(file)?;
    let columns = Columns::of(&header).map_err(at(1))?;
    let mut rows: HashMap<Key, FileRow> = HashMap::new();
    let mut faults = HashMap::new();
    while let Some((line, record)) = records.read()? {
        let mut fault = |what| {
            let participant = columns.participant(record).to_owned();
            faults.entry(participant).or_insert(LineError { line, what });
        };
        match columns.row(record) {
            Ok((key, turn, values)) => match rows.entry(key) {
                Entry::Vacant(place) => {
                    place.insert(FileRow { line, turn, values });
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
    Ok(FeatureRows { features: columns.features, rows, faults })
}

impl FeatureRows {
    /// Replaces what `data`, the rows of `person`, has of these features.
    ///
    /// # Errors
    /// [`LineError`] for the person's first row that is wrong, a step that the file lacks, or one
    /// with another label.
    pub fn replace(&self, person: &Person, data: &mut Dataset) -> Result<(), LineError> {
        if let Some(error) = self.faults.get(&person.name) {
            return Err(error.clone());
        }
        let width = data.features.len();
        let known: Vec<&str> = data.features.features().map(|feature| feature.name).collect();
        let place = |name: &str| known.iter().position(|other| *other == name);
        let places: Vec<Option<usize>> =
            self.features.features().map(|feature| place(feature.name)).collect();
        let mut rows = data.values.chunks_exact_mut(width);
        for trial in &person.trials {
            for ((step, &input), row) in (0..).zip(&trial.inputs).zip(&mut rows) {
                let key = (person.name.clone(), trial.number, step);
                let found = self.rows.get(&key).ok_or_else(|| {
                    let expected =
                        format!("participant {}, trial {}, step {step}", key.0, trial.number);
                    LineError { line: 1, what: Invalid::new("row", expected, "no such row") }
                })?;
                if found.turn != input {
                    let expected = format!("{}, as in the trials", input.sign());
                    let what = Invalid::new(TURN[0], expected, found.turn.sign());
                    return Err(LineError { line: found.line, what });
                }
                if let Some(large) = found.values.iter().position(|v| !is_usable(*v)) {
                    let names: Vec<String> = self.features.clone().into();
                    let what =
                        Invalid::new(&names[large], "a number of at most 1e9", found.values[large]);
                    return Err(LineError { line: found.line, what });
                }
                for (place, value) in places.iter().zip(&found.values) {
                    if let Some(place) = place {
                        row[*place] = *value;
                    }
                }
            }
        }
        Ok(())
    }
}

struct Columns {
    row: [usize; 3],
    turn: usize,
    features: FeatureSet,
    places: Vec<usize>,
}

impl Columns {
    fn of(header: &StringRecord) -> Result<Self, Invalid> {
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

    fn participant<'a>(&self, record: &'a StringRecord) -> &'a str {
        record.get(self.row[0]).unwrap_or("").trim()
    }

    fn row(&self, record: &StringRecord) -> Result<(Key, TurnInput, Vec<f64>), Invalid> {
        let field = |place: usize| record.get(place).unwrap_or("").trim();
        let wrong = |name: &str, expected: &str, text: &str| {
            let found: String = text.chars().take(60).collect();
            Invalid::new(name, expected, format!("{found:?}"))
        };
        let count = |i: usize| {
            let text = field(self.row[i]);
            text.parse().map_err(|_| wrong(ROW[i], "a whole number ≥ 0", text))
        };
        let turn = field(self.turn);
        let turn = turn
            .parse::<f64>()
            .ok()
            .and_then(|sign| TurnInput::ALL.into_iter().find(|t| f64::from(t.sign()) == sign))
            .ok_or_else(|| wrong(TURN[0], "-1, 0 or 1", turn))?;
        let values = self.places.iter().zip(self.features.features()).map(|(&place, feature)| {
            let text = field(place);
            let value = text.parse().map_err(|_| wrong(feature.name, "a number", text))?;
            finite(feature.name, value)
        });
        let key = (self.participant(record).to_owned(), count(1)?, count(2)?);
        Ok((key, turn, values.collect::<Result<_, _>>()?))
    }
}
