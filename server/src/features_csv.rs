//! features.csv: a row a step, written and read.

use crate::trials_csv::{LineError, Person};
use csv::{StringRecord, Writer};
use sidestep::dataset::Dataset;
use sidestep::features::{FEATURES, FeatureSet, SafetyFunctions};
use sidestep::invalid::{Invalid, finite};
use sidestep::vehicle::TurnInput;
use std::collections::HashMap;
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

/// The rows of a person's trials, with every feature.
#[must_use]
pub fn dataset(person: &Person, safety: &SafetyFunctions) -> Dataset {
    let trials = person.trials.iter().map(|trial| (&trial.inputs[..], &trial.states[..]));
    Dataset::from_trials(&FeatureSet::all(), safety, trials)
}

/// Writes the file.
///
/// # Errors
/// What the disk says.
pub fn write(out: impl Write, people: &[Person], safety: &SafetyFunctions) -> io::Result<()> {
    let mut out = Writer::from_writer(out);
    let further = || FEATURES[PAPERS.len()..].iter().map(|feature| feature.name);
    let papers = PAPERS.iter().map(|(name, _)| *name);
    out.write_record(ROW.into_iter().chain(papers).chain(["turn", "avoid"]).chain(further()))?;
    for person in people {
        let data = dataset(person, safety);
        let mut rows = data.values.chunks_exact(FEATURES.len());
        for trial in &person.trials {
            let number = trial.number.to_string();
            for ((step, input), row) in trial.inputs.iter().enumerate().zip(&mut rows) {
                out.write_field(&person.name)?;
                out.write_field(&number)?;
                out.write_field(step.to_string())?;
                let mut fields = row.iter().map(f64::to_string);
                for field in fields.by_ref().take(PAPERS.len()) {
                    out.write_field(field)?;
                }
                out.write_field(input.sign().to_string())?;
                out.write_field(if *input == TurnInput::Straight { "0" } else { "1" })?;
                for field in fields {
                    out.write_field(field)?;
                }
                out.write_record(None::<&[u8]>)?;
            }
        }
    }
    out.flush()
}

/// What a features.csv holds: features of rows by whose they are.
#[derive(Debug)]
pub struct FeatureRows {
    /// The features that it has.
    pub features: FeatureSet,
    rows: HashMap<Key, FileRow>,
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
/// `apx,apy,dpsi,cosd,sind,vh,vr,d,y1`. Other columns are left out.
///
/// # Errors
/// [`LineError`] for a missing column, a value that cannot be or a row that is there twice.
pub fn read(file: impl Read) -> Result<FeatureRows, LineError> {
    let at = |line: u64| move |what: Invalid| LineError { line, what };
    let broken = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        at(line)(Invalid::new("row", "comma-separated UTF-8 text", error))
    };
    let mut reader = csv::Reader::from_reader(file);
    let header = reader.headers().map_err(broken)?.clone();
    let columns = Columns::of(&header).map_err(at(1))?;
    let mut rows = HashMap::new();
    let mut record = StringRecord::new();
    while reader.read_record(&mut record).map_err(broken)? {
        let line = record.position().map_or(0, csv::Position::line);
        let (key, turn, values) = columns.row(&record).map_err(at(line))?;
        let again = format!("participant {}, trial {}, step {}", key.0, key.1, key.2);
        if let Some(before) = rows.insert(key, FileRow { line, turn, values }) {
            let found = format!("{again} again, after line {}", before.line);
            return Err(at(line)(Invalid::new("row", "each step once", found)));
        }
    }
    Ok(FeatureRows { features: columns.features, rows })
}

impl FeatureRows {
    /// Replaces what `data`, the rows of `person`, has of these features.
    ///
    /// # Errors
    /// [`LineError`] for a step that the file lacks, or where it has another label.
    pub fn replace(&self, person: &Person, data: &mut Dataset) -> Result<(), LineError> {
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
        let key = (field(self.row[0]).to_owned(), count(1)?, count(2)?);
        Ok((key, turn, values.collect::<Result<_, _>>()?))
    }
}
