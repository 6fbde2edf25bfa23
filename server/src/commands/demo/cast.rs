//! The participants of the demonstration, chosen so that every page of the laboratory has content.

use super::super::simulate::volunteer::Mishap;
use sidestep::trial::{PageEvent, PageEventKind, Phase, simulate};
use sidestep::vehicle::TurnInput;

/// A synthetic participant of the demonstration. The participant's number determines how they steer.
#[derive(Clone, Copy)]
pub(super) struct Role {
    /// How their participation ends.
    pub(super) ending: Ending,
    /// Attempts at the comprehension check.
    pub(super) attempts: usize,
    /// A mishap that changes their trials.
    pub(super) mishap: Mishap,
    /// An experimenter's note about them.
    pub(super) note: Option<&'static str>,
}

/// How a participation ends.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    /// They get the completion code.
    Complete,
    /// They get the completion code, and are excluded from analyses for this reason.
    Excluded(&'static str),
    /// They withdraw after this number of tasks, and their data are kept.
    Withdrawn(u64),
    /// They are still taking part, after this number of tasks.
    UnderWay(u64),
    /// They fail the comprehension check.
    ScreenedOut,
}

impl Ending {
    /// Upper bound on the number of tasks that they drive.
    pub(super) fn tasks(self) -> u64 {
        match self {
            Self::Complete | Self::Excluded(_) => u64::MAX,
            Self::Withdrawn(tasks) | Self::UnderWay(tasks) => tasks,
            Self::ScreenedOut => 0,
        }
    }
}

const USUAL: Role =
    Role { ending: Ending::Complete, attempts: 1, mishap: |_, _, _, _| (), note: None };

/// All participants, in the order of their numbers.
pub(super) const CAST: [Role; 12] = [
    USUAL,
    Role { attempts: 2, ..USUAL },
    Role {
        mishap: LOOKS_AWAY,
        note: Some("The phone rang twice. Both tasks were driven again at the end."),
        ..USUAL
    },
    USUAL,
    Role {
        ending: Ending::Excluded("never steered in any task"),
        mishap: NEVER_STEERS,
        note: Some("Said afterwards that the keys did nothing. The keyboard was not plugged in."),
        ..USUAL
    },
    USUAL,
    Role {
        ending: Ending::Withdrawn(12),
        note: Some("Had to leave, and agreed that the data so far are used."),
        ..USUAL
    },
    USUAL,
    Role { ending: Ending::ScreenedOut, attempts: 3, ..USUAL },
    Role {
        mishap: SLOW_COMPUTER,
        note: Some("An old computer: some inputs were sampled late."),
        ..USUAL
    },
    USUAL,
    Role { ending: Ending::UnderWay(15), ..USUAL },
];

/// The window loses keyboard focus in two tasks, in the first attempt at each.
const LOOKS_AWAY: Mishap = |_, phase, planned, trial| {
    if phase == Phase::Task && planned.attempt == 1 && [6, 19].contains(&planned.index) {
        let event = |t_ms, kind| PageEvent { t_ms, kind };
        trial.page_events = vec![
            event(3200.0, PageEventKind::FocusLost),
            event(4900.0, PageEventKind::FocusGained),
        ];
    }
};

/// No key is ever pressed.
const NEVER_STEERS: Mishap = |parameters, _, planned, trial| {
    trial.inputs.fill(TurnInput::Straight);
    trial.states = simulate(parameters, &planned.scene(), &trial.inputs);
    trial.key_events.clear();
};

/// In every fourth task, one input is sampled 60 ms late.
const SLOW_COMPUTER: Mishap = |_, phase, planned, trial| {
    let late = trial.sampled_at_ms.get_mut(20 + planned.index);
    if let Some(late) = late.filter(|_| phase == Phase::Task && planned.index % 4 == 1) {
        *late += 60.0;
    }
};
