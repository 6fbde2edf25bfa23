//! One row of trials.csv: its columns and their valid values.

use super::REQUIRED;
use crate::formats::csv_lines::Record;
use sidestep::api::MAX_NAME_CHARS;
use sidestep::invalid::{Invalid, finite};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::trial::{Flag, Phase};
use sidestep::vehicle::{Pose, TurnInput};
use std::sync::Arc;
use uuid::Uuid;

/// The position of each column.
pub(super) struct Columns {
    required: [usize; REQUIRED.len()],
    phase: Option<usize>,
    attempt: Option<usize>,
    trial_id: Option<usize>,
    flags: Option<usize>,
    started_at_ms: Option<usize>,
    sampled_at_ms: Option<usize>,
    synthetic: Option<usize>,
}

impl Columns {
    pub(super) fn of(header: &Record) -> Result<Self, Invalid> {
        let clean = |name: &str| name.trim().trim_start_matches('\u{feff}').to_owned();
        let names: Vec<String> = header.iter().map(clean).collect();
        let find = |wanted: &str| names.iter().position(|name| name == wanted);
        if let Some((i, twice)) = names.iter().enumerate().find(|(i, n)| names[..*i].contains(n)) {
            let found = format!("{twice:?} again as column {}", i + 1);
            return Err(Invalid::new("header", "each column once", found));
        }
        let mut required = [0; REQUIRED.len()];
        for (wanted, place) in REQUIRED.iter().zip(&mut required) {
            *place = find(wanted).ok_or_else(|| {
                let expected = format!("the columns {}", REQUIRED.join(","));
                let found: String = names.join(",").chars().take(60).collect();
                let hint = match &names[..] {
                    [_] => "; separate columns by commas, semicolons or tabs",
                    _ if find("closest_m").is_some() => "; the steps of an export are in steps.csv",
                    _ => "",
                };
                Invalid::new("header", expected, format!("no column {wanted} in {found:?}{hint}"))
            })?;
        }
        Ok(Self {
            required,
            phase: find("phase"),
            attempt: find("attempt"),
            trial_id: find("trial_id"),
            flags: find("flags"),
            started_at_ms: find("started_at_ms"),
            sampled_at_ms: find("sampled_at_ms"),
            synthetic: find("synthetic"),
        })
    }

    /// The participant of a row.
    pub(super) fn participant<'a>(&self, record: &'a Record) -> Result<&'a str, Invalid> {
        let name = record.get(self.required[0]).unwrap_or("").trim();
        let characters = name.chars().count();
        if (1..=MAX_NAME_CHARS).contains(&characters) {
            return Ok(name);
        }
        let expected = format!("a name or number of at most {MAX_NAME_CHARS} characters");
        let found =
            if characters == 0 { "nothing".to_owned() } else { format!("{characters} characters") };
        Err(Invalid::new("participant", expected, found))
    }
}

/// The flags of a row; `None` means no flag.
pub(super) type Flags = Option<Arc<[Flag]>>;

/// One row, parsed.
pub(super) struct Row {
    pub(super) trial: u64,
    pub(super) step: u64,
    pub(super) t: f64,
    pub(super) state: JointState,
    pub(super) input: TurnInput,
    pub(super) phase: Phase,
    pub(super) attempt: u32,
    pub(super) trial_id: Option<Uuid>,
    pub(super) flags: Flags,
    pub(super) started_at_ms: Option<f64>,
    pub(super) sampled_at_ms: Option<f64>,
    pub(super) synthetic: bool,
}

/// Parses rows. Most ids and flags equal those of the previous row, so repeated ones are parsed only once.
pub(super) struct Parser {
    columns: Columns,
    parameters: SceneParameters,
    trial_id: (String, Option<Uuid>),
    flags: (String, Flags),
}

impl Parser {
    pub(super) fn new(header: &Record, parameters: &SceneParameters) -> Result<Self, Invalid> {
        Ok(Self {
            columns: Columns::of(header)?,
            parameters: *parameters,
            trial_id: (String::new(), None),
            flags: (String::new(), None),
        })
    }

    /// The participant of a row.
    pub(super) fn participant<'a>(&self, record: &'a Record) -> Result<&'a str, Invalid> {
        self.columns.participant(record)
    }

    pub(super) fn row(&mut self, record: &Record) -> Result<Row, Invalid> {
        let columns = &self.columns;
        let field = |i: usize| record.get(columns.required[i]).unwrap_or("").trim();
        let finite_at = |place, name: &str| finite(name, record.number(place, name)?);
        let real = |i: usize| finite_at(columns.required[i], REQUIRED[i]);
        let coordinate = |i: usize| Pose::checked(REQUIRED[i], real(i)?);
        let optional = |place: Option<usize>| {
            let text = record.get(place?)?.trim();
            (!text.is_empty()).then_some(text)
        };
        let time = |name, place: Option<usize>| {
            place.filter(|_| optional(place).is_some()).map(|at| finite_at(at, name)).transpose()
        };
        Ok(Row {
            trial: count("trial", field(1))?,
            step: count("step", field(2))?,
            t: real(3)?,
            state: JointState {
                human: Pose::from([coordinate(4)?, coordinate(5)?, coordinate(6)?]),
                robot: Pose::from([coordinate(7)?, coordinate(8)?, coordinate(9)?]),
            },
            input: input(real(10)?, &self.parameters)?,
            phase: optional(columns.phase).map_or(Ok(Phase::Task), phase)?,
            attempt: optional(columns.attempt).map_or(Ok(1), attempt)?,
            trial_id: repeated(&mut self.trial_id, optional(columns.trial_id), trial_id)?,
            flags: repeated(&mut self.flags, optional(columns.flags), flags)?,
            started_at_ms: time("started_at_ms", columns.started_at_ms)?,
            sampled_at_ms: time("sampled_at_ms", columns.sampled_at_ms)?,
            synthetic: optional(columns.synthetic)
                .is_some_and(|word| !matches!(word, "0" | "false")),
        })
    }
}

/// Parses a text. If it equals the previous text, returns the stored value of that text instead.
fn repeated<T: Clone + Default>(
    last: &mut (String, T),
    text: Option<&str>,
    parse: impl FnOnce(&str) -> Result<T, Invalid>,
) -> Result<T, Invalid> {
    let Some(text) = text else { return Ok(T::default()) };
    if last.0 != text {
        *last = (text.to_owned(), parse(text)?);
    }
    Ok(last.1.clone())
}

fn count(field: &str, text: &str) -> Result<u64, Invalid> {
    text.parse().map_err(|_| quoted(field, "a whole number ≥ 0", text))
}

fn input(omega: f64, parameters: &SceneParameters) -> Result<TurnInput, Invalid> {
    let rate = parameters.human.turn_rate_radps;
    TurnInput::ALL
        .into_iter()
        .find(|&input| (parameters.human.turn_rate(input) - omega).abs() <= 1e-9 * rate)
        .ok_or_else(|| Invalid::new("omega", format!("-{rate}, 0 or {rate}"), omega))
}

fn phase(word: &str) -> Result<Phase, Invalid> {
    let expected = "familiarisation, practice or task";
    Phase::from_word(word).ok_or_else(|| quoted("phase", expected, word))
}

fn attempt(text: &str) -> Result<u32, Invalid> {
    let attempt = text.parse().ok().filter(|attempt| *attempt >= 1);
    attempt.ok_or_else(|| quoted("attempt", "a whole number ≥ 1", text))
}

fn trial_id(text: &str) -> Result<Option<Uuid>, Invalid> {
    Uuid::try_parse(text).map(Some).map_err(|_| quoted("trial_id", "a UUID", text))
}

fn flags(words: &str) -> Result<Flags, Invalid> {
    let flag = |word| Flag::from_word(word).ok_or_else(|| quoted("flags", "known flags", word));
    words.split(';').map(flag).collect::<Result<_, _>>().map(Some)
}

fn quoted(field: &str, expected: &str, found: &str) -> Invalid {
    let found: String = found.chars().take(60).collect();
    Invalid::new(field, expected, format!("{found:?}"))
}
