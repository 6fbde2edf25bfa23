//! An analysis in the child process.

use super::{Server, end_with_stdin};
use crate::jobs::analysis::compute;
use crate::jobs::frames::{self, FromChild, ToChild};
use crate::jobs::model_index::{TrialIds, models, tasks};
use crate::{report, study_recording};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use sidestep::api::{AnalysisResult, MeanAccuracy};
use sidestep::comparison::cell::{Cell, Experiment};
use sidestep::comparison::models::ModelName;
use sidestep::comparison::{Analysis, Cache, Progress, Request};
use sidestep::reachability::ValueFunction;
use sidestep::recording::{Exclusion, Recording};
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use std::io::{self, BufReader, Read, Write};
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, PoisonError};

/// Number of rows of the index per message.
const ROWS_AT_ONCE: usize = 1_000;

/// The input of an analysis.
pub(super) struct Task {
    request: Request,
    recording: Recording,
    safety: SafetyLevels,
}

impl Task {
    /// Reads the participants that follow the first message, and completes the input.
    pub(super) fn read(
        orders: &mut impl Read,
        request: Request,
        study: &str,
        scene: SceneParameters,
        human: usize,
        functions: &[u8],
    ) -> io::Result<Self> {
        let (human, robot) =
            functions.split_at_checked(human).ok_or(io::ErrorKind::UnexpectedEof)?;
        let [human, robot] = [human, robot].map(ValueFunction::decode);
        let safety = SafetyLevels {
            human: human.map_err(io::Error::other)?,
            robot: robot.map_err(io::Error::other)?,
        };
        let (mut participants, mut exclusions) = (Vec::new(), Vec::new());
        loop {
            match frames::read(orders)? {
                (ToChild::Participant { name, marked_synthetic, trials }, bytes) => {
                    participants.push(frames::participant(name, marked_synthetic, trials, &bytes)?);
                }
                (ToChild::Excluded(name, reason), _) => {
                    exclusions.push(Exclusion::new(&name, reason));
                }
                (ToChild::Begin, _) => break,
                (other, _) => {
                    let message = format!("expected a participant, found {other:?}");
                    return Err(io::Error::other(message));
                }
            }
        }
        let recording = study_recording::complete(study, scene, participants, exclusions);
        Ok(Self { request, recording, safety })
    }

    /// Computes the analysis, and sends the results.
    pub(super) fn run(self, server: &Server) -> io::Result<()> {
        let (answer, answers) = channel();
        end_with_stdin(move |message, beside| {
            if let ToChild::Cells { kept } = message {
                // Sending fails after the end of the computation, because the receiver is gone.
                let _ = answer.send(kept.then_some(beside));
            }
        });
        let Self { request, recording, safety } = self;
        let ids = TrialIds::of(&recording);
        let cache = ServersCells { server, answers: Mutex::new(answers) };
        let step = |Progress { done, of }| match server.tell(&FromChild::Progress { done, of }, &[])
        {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        };
        match compute(recording, None, &safety, &request, &cache, &step) {
            Ok(analysis) => send(&analysis, &ids, server),
            Err(error) => server.tell(&FromChild::Failed(error.to_string()), &[]),
        }
    }
}

/// Sends the files one by one, then the index, and then the summary.
fn send(analysis: &Analysis, ids: &TrialIds, server: &Server) -> io::Result<()> {
    report::each_file(analysis, &mut |name, write| {
        let mut out = Counted { out: gzip(), bytes: 0 };
        write(&mut out)?;
        let file = FromChild::File { name: name.to_owned(), octets: out.bytes };
        server.tell(&file, &out.out.finish()?)
    })?;
    for rows in in_parts(models(analysis)) {
        server.tell(&FromChild::Models(rows), &[])?;
    }
    for rows in in_parts(tasks(analysis, ids)) {
        server.tell(&FromChild::Tasks(rows), &[])?;
    }
    let participants = &analysis.comparison.participants;
    let compared = participants.iter().map(|person| person.name.clone()).collect();
    server.tell(&FromChild::Done { result: Box::new(result(analysis)), compared }, &[])
}

fn in_parts<T>(mut rows: impl Iterator<Item = T>) -> impl Iterator<Item = Vec<T>> {
    std::iter::from_fn(move || {
        let part: Vec<T> = rows.by_ref().take(ROWS_AT_ONCE).collect();
        (!part.is_empty()).then_some(part)
    })
}

/// The summary of an analysis.
fn result(analysis: &Analysis) -> AnalysisResult {
    let (data, comparison) = (&analysis.data, &analysis.comparison);
    let sets = comparison.sets();
    let mut accuracies = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let means = comparison.accuracies(model, experiment, &sets);
            accuracies.extend(sets.iter().zip(means).map(|(set, percent)| MeanAccuracy {
                model: model.word().to_owned(),
                experiment: experiment.number(),
                features: (*set).to_owned(),
                percent,
            }));
        }
    }
    AnalysisResult {
        participants: comparison.participants.len(),
        excluded: data.exclusions.iter().map(Into::into).collect(),
        flagged: data.flagged.clone(),
        same_trials: data.same_trials.clone(),
        safety: data.safety,
        cells: comparison.cells.len(),
        models: Some(analysis.counts().models),
        version: Some(env!("CARGO_PKG_VERSION").to_owned()),
        study_versions: Vec::new(),
        data_sha256: Some(data.sha256.clone()),
        accuracies,
        synthetic: data.synthetic.clone(),
    }
}

fn gzip() -> GzEncoder<Vec<u8>> {
    GzEncoder::new(Vec::new(), Compression::fast())
}

/// A writer that counts its bytes.
struct Counted<W> {
    out: W,
    bytes: usize,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.bytes += written;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// A cache of cells that sends its queries to the server.
struct ServersCells<'a> {
    server: &'a Server,
    answers: Mutex<Receiver<Option<Vec<u8>>>>,
}

impl Cache for ServersCells<'_> {
    fn get(&self, key: &str) -> Option<Vec<Cell>> {
        let bytes = {
            // Send one query at a time, so that each answer belongs to its query.
            let answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
            self.server.tell(&FromChild::Wanted(key.to_owned()), &[]).ok()?;
            answers.recv().ok()??
        };
        serde_json::from_reader(BufReader::new(GzDecoder::new(&bytes[..]))).ok()
    }

    fn put(&self, key: &str, cells: &[Cell]) {
        let mut out = gzip();
        let packed = serde_json::to_writer(&mut out, cells).map_err(io::Error::from);
        let told = packed
            .and_then(|()| out.finish())
            .and_then(|bytes| self.server.tell(&FromChild::Computed(key.to_owned()), &bytes));
        // If the server has ended, the next step of the analysis detects it.
        drop(told);
    }
}
