//! Recordings of participants' trials. Files, studies in the database and the simulator produce a
//! [`Recording`]; training and analysis consume one.

use crate::invalid::Invalid;
use crate::scene::{JointState, SceneParameters};
use crate::trial::{Flag, Phase};
use crate::vehicle::TurnInput;
use core::fmt;
use serde::Serialize;
use std::collections::BTreeMap;

/// The trials of some participants who drove under the same parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Origin of the trials.
    pub provenance: Provenance,
    /// The vehicles, steps and danger radius of all trials.
    pub scene: SceneParameters,
    /// Each participant with their trials.
    pub participants: Vec<RecordedParticipant>,
    /// Participants whose trials cannot be used.
    pub exclusions: Vec<Exclusion>,
}

/// Origin of trials, and whether they are synthetic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// The file or study.
    pub origin: Origin,
    /// The evidence that all or some trials are synthetic; `None` for trials of people.
    pub synthetic: Option<String>,
    /// Whether only some of the trials are known to be synthetic.
    pub is_mixed: bool,
}

/// The file or study from which a recording was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A file of trials, by its name.
    File(String),
    /// A study, by its name in URLs.
    Study(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(name) => f.write_str(name),
            Self::Study(slug) => write!(f, "study {slug}"),
        }
    }
}

/// One participant and the trials that they drove.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedParticipant {
    /// The participant's name or number in the data.
    pub name: String,
    /// The line of the participant's first row, if the source is a file.
    pub line: Option<u64>,
    /// The trials, sorted by phase and then by number.
    pub trials: Vec<RecordedTrial>,
    /// Whether the data say that the participant is synthetic.
    pub marked_synthetic: bool,
}

/// One driven scene.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedTrial {
    /// The line of the trial's first row, if the source is a file.
    pub line: Option<u64>,
    /// The trial's number, unique within the participant.
    pub number: u64,
    /// The phase of the study that the trial belongs to.
    pub phase: Phase,
    /// Attempt number: 1, or 2 if the scene was driven again because its first trial was
    /// interrupted.
    pub attempt: u32,
    /// The id of the trial, if it has one.
    pub trial_id: Option<String>,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// The joint states before each step and after the last step.
    pub states: Vec<JointState>,
    /// Start of the trial on the participant's clock (ms since 1970), if known.
    pub started_at_ms: Option<f64>,
    /// When each input was sampled (ms after the start), if known.
    pub sampled_at_ms: Option<Vec<f64>>,
    /// The flags of the trial.
    pub flags: Vec<Flag>,
    /// The robot's name, if the study names its robots and the source knows it.
    pub robot: Option<String>,
}

impl RecordedParticipant {
    /// Drops every trial that is not a task, because only tasks are analysed.
    pub fn keep_tasks(&mut self) {
        self.trials.retain(|trial| trial.phase == Phase::Task);
    }

    /// Keeps one trial of each scene that was driven again: the first uninterrupted trial, or the
    /// first trial if all were interrupted.
    pub fn keep_one_attempt(&mut self) {
        let again: Vec<usize> =
            (0..self.trials.len()).filter(|&i| self.trials[i].attempt > 1).collect();
        let mut dropped = vec![false; self.trials.len()];
        for later in again {
            let trial = &self.trials[later];
            let is_first = |other: &RecordedTrial| {
                other.attempt < trial.attempt
                    && other.phase == trial.phase
                    && other.states.first() == trial.states.first()
            };
            let kept = (0..later).rfind(|&i| !dropped[i] && is_first(&self.trials[i]));
            let Some(kept) = kept else { continue };
            let was_interrupted = |i: usize| self.trials[i].flags.contains(&Flag::Interrupted);
            let worse = if was_interrupted(kept) && !was_interrupted(later) { kept } else { later };
            dropped[worse] = true;
        }
        let mut dropped = dropped.into_iter();
        self.trials.retain(|_| !dropped.next().unwrap_or(false));
    }
}

/// Counts the trials with each flag. Omits [`Flag::Imported`], which casts no doubt on a trial.
#[must_use]
pub fn flagged<'a>(
    participants: impl IntoIterator<Item = &'a RecordedParticipant>,
) -> BTreeMap<String, usize> {
    let trials = participants.into_iter().flat_map(|participant| &participant.trials);
    let mut flagged = BTreeMap::new();
    for flag in trials.flat_map(|trial| &trial.flags).filter(|flag| **flag != Flag::Imported) {
        *flagged.entry(flag.word().to_owned()).or_insert(0) += 1;
    }
    flagged
}

/// A fault in a participant's data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The invalid line, if the source is a file.
    pub line: Option<u64>,
    /// The field, the expected value and the value found.
    pub what: Invalid,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.line.map_or(Ok(()), |line| write!(f, "line {line}: "))?;
        write!(f, "{}", self.what)
    }
}

/// A participant whose trials are not used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Exclusion {
    /// The participant's name or number in the data.
    pub participant: String,
    /// The reason for the exclusion.
    pub reason: String,
    /// The invalid line of the file, if there is a single one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// The line of the participant's first row, if all of the participant's rows together are the
    /// reason. Only messages contain this line, because it depends on the order of the rows, which
    /// must not change the output files of an analysis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_line: Option<u64>,
}

impl Exclusion {
    /// An exclusion that does not name an invalid line.
    #[must_use]
    pub fn new(participant: &str, reason: String) -> Self {
        Self { participant: participant.to_owned(), reason, line: None, first_line: None }
    }

    /// An exclusion by an experimenter.
    #[must_use]
    pub fn by_experimenter(participant: &str, reason: &str) -> Self {
        Self::new(participant, format!("excluded by an experimenter: {reason}"))
    }

    /// An exclusion for a fault in the participant's rows.
    #[must_use]
    pub fn of_fault(participant: &str, fault: &Fault) -> Self {
        Self { line: fault.line, ..Self::new(participant, fault.what.to_string()) }
    }

    /// The reason, with the invalid line.
    #[must_use]
    pub fn why(&self) -> String {
        match self.line {
            Some(line) => format!("line {line}: {}", self.reason),
            None => self.reason.clone(),
        }
    }
}

impl fmt::Display for Exclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The name is escaped, because it can contain terminal control sequences.
        write!(f, "participant {}: {}", self.participant.escape_debug(), self.why())?;
        self.first_line.map_or(Ok(()), |line| write!(f, " (their rows begin in line {line})"))
    }
}
