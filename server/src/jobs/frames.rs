//! Messages between the server and its child process, over the child's stdin and stdout.
//!
//! A frame begins with the lengths of its message and of its attachment, as two little-endian 32-bit
//! integers. The message is JSON. The attachment is binary, for data that JSON would inflate. Both ends
//! are the same program.

use super::model_index::{IndexedModel, IndexedTask};
use crate::database_check::Report;
use crate::support::bytes::{pack_inputs, pack_states, unpack_inputs, unpack_states};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sidestep::api::AnalysisResult;
use sidestep::comparison::Request;
use sidestep::recording::{RecordedParticipant, RecordedTrial};
use sidestep::scene::SceneParameters;
use sidestep::trial::{Flag, Phase};
use std::io::{self, Read, Write};
use std::path::PathBuf;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

/// Messages from the server to the child.
#[derive(Debug, Serialize, Deserialize)]
pub enum ToChild {
    /// The first message. The child solves the games of these vehicles.
    Solve(SceneParameters),
    /// The first message. The child checks a database, or writes a backup and checks the backup.
    Check {
        /// The folder to which relative paths refer.
        folder: PathBuf,
        /// The database's address. It can contain a password, so it is sent only to the child.
        database: String,
        /// The backup to write, if any.
        backup: Option<PathBuf>,
    },
    /// The first message. The child analyses the participants that follow. Attachment: V_HR, then V_RH.
    Analyse {
        /// The request.
        request: Box<Request>,
        /// The study's name.
        study: String,
        /// The study's vehicles, steps and danger radius.
        scene: SceneParameters,
        /// The number of bytes of V_HR.
        human: usize,
    },
    /// A participant's tasks. Attachment: inputs and states, trial by trial.
    Participant {
        /// The name in the recording.
        name: String,
        /// Whether the recording marks the participant as synthetic.
        marked_synthetic: bool,
        /// The trials without their inputs and states.
        trials: Vec<TrialHead>,
    },
    /// The name of an excluded participant, and the reason.
    Excluded(String, String),
    /// All participants have been sent.
    Begin,
    /// The answer to [`FromChild::Wanted`]. Attachment: the cells, if they are cached.
    Cells {
        /// Whether the cells are cached.
        kept: bool,
    },
}

/// A trial without its inputs and states.
#[derive(Debug, Serialize, Deserialize)]
pub struct TrialHead {
    number: u64,
    phase: Phase,
    attempt: u32,
    trial_id: Option<String>,
    started_at_ms: Option<f64>,
    flags: Vec<Flag>,
    robot: Option<String>,
    inputs: usize,
    states: usize,
}

/// Messages from the child to the server.
#[derive(Debug, Serialize, Deserialize)]
pub enum FromChild {
    /// Both value functions are solved. Attachment: V_HR, then V_RH.
    Solved {
        /// The number of bytes of V_HR.
        human: usize,
        /// Warnings about convergence.
        complaints: Vec<String>,
    },
    /// Progress of the fits.
    Progress {
        /// Number of finished fits.
        done: usize,
        /// Total number of fits.
        of: usize,
    },
    /// Requests the cells under this key. The answer is [`ToChild::Cells`].
    Wanted(String),
    /// Computed cells, to be cached under this key. Attachment: the cells.
    Computed(String),
    /// A file of the analysis. Attachment: its content, compressed with gzip.
    File {
        /// The name of the file.
        name: String,
        /// The length before compression (bytes).
        octets: usize,
    },
    /// Models whose files were sent.
    Models(Vec<IndexedModel>),
    /// Tasks that were used to train or test models.
    Tasks(Vec<IndexedTask>),
    /// The analysis is done, and everything has been sent.
    Done {
        /// The summary.
        result: Box<AnalysisResult>,
        /// The names of the participants who were compared.
        compared: Vec<String>,
    },
    /// The database, or the backup, was checked.
    Checked {
        /// The findings.
        report: Box<Report>,
        /// The length of the backup (bytes); 0 without a backup.
        bytes: u64,
    },
    /// The task failed for this reason.
    Failed(String),
}

impl ToChild {
    /// The message with a participant's tasks, and its attachment. Sampling times are left out,
    /// because analyses do not use them.
    #[must_use]
    pub fn participant(participant: &RecordedParticipant) -> (Self, Vec<u8>) {
        let mut bytes = Vec::new();
        let head = |trial: &RecordedTrial| {
            bytes.extend(pack_inputs(&trial.inputs));
            bytes.extend(pack_states(&trial.states));
            TrialHead {
                number: trial.number,
                phase: trial.phase,
                attempt: trial.attempt,
                trial_id: trial.trial_id.clone(),
                started_at_ms: trial.started_at_ms,
                flags: trial.flags.clone(),
                robot: trial.robot.clone(),
                inputs: trial.inputs.len(),
                states: trial.states.len(),
            }
        };
        let trials = participant.trials.iter().map(head).collect();
        let (name, marked_synthetic) = (participant.name.clone(), participant.marked_synthetic);
        (Self::Participant { name, marked_synthetic, trials }, bytes)
    }
}

/// Restores the participant of a [`ToChild::Participant`].
///
/// # Errors
/// If the attachment does not match the trials.
pub fn participant(
    name: String,
    marked_synthetic: bool,
    trials: Vec<TrialHead>,
    mut bytes: &[u8],
) -> io::Result<RecordedParticipant> {
    let mut part = |length: usize| {
        let (part, rest) = bytes.split_at_checked(length).ok_or(io::ErrorKind::UnexpectedEof)?;
        bytes = rest;
        Ok::<_, io::Error>(part)
    };
    let mut trial = |head: TrialHead| {
        Ok(RecordedTrial {
            line: None,
            number: head.number,
            phase: head.phase,
            attempt: head.attempt,
            trial_id: head.trial_id,
            inputs: unpack_inputs(part(head.inputs)?).map_err(io::Error::other)?,
            states: unpack_states(part(48 * head.states)?),
            started_at_ms: head.started_at_ms,
            sampled_at_ms: None,
            flags: head.flags,
            robot: head.robot,
        })
    };
    let trials = trials.into_iter().map(&mut trial).collect::<io::Result<_>>()?;
    Ok(RecordedParticipant { name, line: None, trials, marked_synthetic })
}

/// Encodes the two lengths and the message, without the attachment.
fn encoded(message: &impl Serialize, beside: &[u8]) -> io::Result<Vec<u8>> {
    let json = serde_json::to_vec(message)?;
    let mut out = Vec::with_capacity(8 + json.len());
    for length in [json.len(), beside.len()] {
        let length = u32::try_from(length).map_err(io::Error::other)?;
        out.extend(length.to_le_bytes());
    }
    out.extend(json);
    Ok(out)
}

fn lengths(head: [u8; 8]) -> [usize; 2] {
    let [a, b, c, d, rest @ ..] = head;
    [u32::from_le_bytes([a, b, c, d]) as usize, u32::from_le_bytes(rest) as usize]
}

/// Writes a message.
///
/// # Errors
/// If the other end has closed.
pub fn write(out: &mut impl Write, message: &impl Serialize, beside: &[u8]) -> io::Result<()> {
    out.write_all(&encoded(message, beside)?)?;
    out.write_all(beside)?;
    out.flush()
}

/// Reads a message with its attachment.
///
/// # Errors
/// If the other end has closed or sent another type of message.
pub fn read<M: DeserializeOwned>(from: &mut impl Read) -> io::Result<(M, Vec<u8>)> {
    let mut head = [0; 8];
    from.read_exact(&mut head)?;
    let [mut json, mut beside] = lengths(head).map(|length| vec![0; length]);
    from.read_exact(&mut json)?;
    from.read_exact(&mut beside)?;
    Ok((serde_json::from_slice(&json)?, beside))
}

/// Writes a message without blocking a thread.
///
/// # Errors
/// If the other end has closed.
pub async fn send(
    out: &mut (impl AsyncWrite + Unpin),
    message: &impl Serialize,
    beside: &[u8],
) -> io::Result<()> {
    out.write_all(&encoded(message, beside)?).await?;
    out.write_all(beside).await?;
    out.flush().await
}

/// Reads a message without blocking a thread.
///
/// # Errors
/// If the other end has closed or sent another type of message.
pub async fn receive<M: DeserializeOwned>(
    from: &mut (impl AsyncRead + Unpin),
) -> io::Result<(M, Vec<u8>)> {
    let mut head = [0; 8];
    from.read_exact(&mut head).await?;
    let [mut json, mut beside] = lengths(head).map(|length| vec![0; length]);
    from.read_exact(&mut json).await?;
    from.read_exact(&mut beside).await?;
    Ok((serde_json::from_slice(&json)?, beside))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::synthetic::{Keys, SyntheticParticipant};

    #[tokio::test]
    async fn a_participant_arrives_bit_by_bit() {
        let mut sent = SyntheticParticipant::new(7, 0).recorded(3, Keys::Clock);
        sent.trials[1].states[2].human.x = -0.0;
        sent.trials[2].states[0].robot.psi = f64::NAN;
        sent.trials[0].flags = vec![Flag::Resized];
        let (message, beside) = ToChild::participant(&sent);
        let mut bytes = Vec::new();
        write(&mut bytes, &message, &beside).unwrap();
        let mut again = Vec::new();
        send(&mut again, &message, &beside).await.unwrap();
        assert_eq!(bytes, again);
        let read: (ToChild, Vec<u8>) = read(&mut &bytes[..]).unwrap();
        let received: (ToChild, Vec<u8>) = receive(&mut &bytes[..]).await.unwrap();
        for (message, beside) in [read, received] {
            let ToChild::Participant { name, marked_synthetic, trials } = message else {
                panic!("{message:?}");
            };
            let found = participant(name, marked_synthetic, trials, &beside).unwrap();
            sent.trials.iter_mut().for_each(|trial| trial.sampled_at_ms = None);
            assert_eq!(format!("{found:?}"), format!("{sent:?}"));
        }
    }

    #[test]
    fn half_a_message_is_an_error() {
        let mut bytes = Vec::new();
        write(&mut bytes, &ToChild::Cells { kept: true }, b"cells").unwrap();
        for length in 0..bytes.len() {
            assert!(read::<ToChild>(&mut &bytes[..length]).is_err(), "{length}");
        }
        assert!(participant("1".to_owned(), false, Vec::new(), &[]).is_ok());
    }
}
