//! The driver, and the part of the current scene driven so far.

use crate::drive::{Drive, straight};
use crate::input::{HeldKeys, KeyMap};
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::synthetic::{Keys, SyntheticDrive, SyntheticParticipant};
use sidestep::vehicle::TurnInput;

/// Who drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Driver {
    /// The user at the keyboard.
    #[default]
    You,
    /// The synthetic person with this number, from 1.
    Synthetic(u64),
}

/// Highest driver number that a link (`synthetic-N`) can have.
const MOST_DRIVERS: u64 = 999;

/// Seed of the population of synthetic drivers.
const POPULATION: u64 = 1;

impl Driver {
    /// The driver that a link names. `None` for an invalid name.
    pub(super) fn of_query(value: Option<&str>) -> Option<Self> {
        match value {
            None => Some(Self::You),
            Some(value) => {
                let number = value.strip_prefix("synthetic-")?.parse().ok()?;
                (1..=MOST_DRIVERS).contains(&number).then_some(Self::Synthetic(number))
            }
        }
    }

    /// The link parameter that names the driver. `None` for the default driver.
    pub(super) fn query(self) -> Option<String> {
        match self {
            Self::You => None,
            Self::Synthetic(number) => Some(format!("driver=synthetic-{number}")),
        }
    }

    /// The next synthetic driver.
    pub(super) fn another(self) -> Self {
        match self {
            Self::You => Self::Synthetic(1),
            Self::Synthetic(number) => Self::Synthetic(number % MOST_DRIVERS + 1),
        }
    }
}

/// A scene in progress.
pub(super) enum Driving {
    /// Driven by keys.
    Live(Drive),
    /// Driven by a synthetic driver. The whole drive is computed at the start and shown in real
    /// time.
    Shown(Shown),
}

/// The drive of a synthetic driver, and how much of it is shown.
pub(super) struct Shown {
    drive: SyntheticDrive,
    step_s: f64,
    /// The start on the page's clock (ms). Pauses shift it.
    start_ms: f64,
    /// The time at which the current pause began (ms), if there is a pause.
    paused_ms: Option<f64>,
    /// Number of steps begun.
    begun: usize,
}

impl Driving {
    /// Starts a scene. `index` is its index from 0.
    pub(super) fn start(
        driver: Driver,
        index: usize,
        parameters: &SceneParameters,
        scene: &Scene,
        keys: (&KeyMap, &HeldKeys),
        now_ms: f64,
    ) -> Self {
        match driver {
            Driver::You => {
                // The drive is not uploaded, so its date does not matter.
                let started_at_ms = 0.0;
                let (keys, held) = keys;
                let drive =
                    Drive::new(*parameters, scene, straight(), now_ms, started_at_ms, keys, held);
                Self::Live(drive)
            }
            Driver::Synthetic(number) => {
                let person = SyntheticParticipant::new(POPULATION, number - 1);
                let drive = person.drive(index as u64, parameters, scene, Keys::Clock);
                let step_s = parameters.step_s;
                Self::Shown(Shown { drive, step_s, start_ms: now_ms, paused_ms: None, begun: 1 })
            }
        }
    }

    /// Advances to `now_ms`. Returns whether the scene is over.
    pub(super) fn tick(&mut self, now_ms: f64) -> bool {
        match self {
            Self::Live(drive) => drive.tick(now_ms),
            Self::Shown(shown) => {
                let steps = shown.drive.inputs.len();
                let begun = shown.time_s(now_ms) / shown.step_s + 1e-9;
                shown.begun = (begun as usize + 1).min(steps);
                begun >= steps as f64
            }
        }
    }

    /// Time since the start of the scene (s).
    pub(super) fn time_s(&self, now_ms: f64) -> f64 {
        match self {
            Self::Live(drive) => drive.time_s(now_ms),
            Self::Shown(shown) => shown.time_s(now_ms),
        }
    }

    /// The input of each step that has begun.
    pub(super) fn inputs(&self) -> &[TurnInput] {
        match self {
            Self::Live(drive) => drive.inputs(),
            Self::Shown(shown) => &shown.drive.inputs[..shown.begun],
        }
    }

    /// The state before each step that has begun, and the state after the last of these steps.
    pub(super) fn states(&self) -> &[JointState] {
        match self {
            Self::Live(drive) => drive.states(),
            Self::Shown(shown) => &shown.drive.states[..=shown.begun],
        }
    }

    /// Handles a key, if the user drives.
    pub(super) fn key(&mut self, t_ms: f64, code: &str, down: bool) {
        if let Self::Live(drive) = self {
            drive.key(t_ms, code, down);
        }
    }

    /// Whether the drive is paused.
    pub(super) fn is_paused(&self) -> bool {
        matches!(self, Self::Shown(Shown { paused_ms: Some(_), .. }))
    }

    /// Pauses or resumes a synthetic driver. A user who drives cannot pause, because the study has
    /// no pause either.
    pub(super) fn pause_or_go_on(&mut self, now_ms: f64) {
        if let Self::Shown(shown) = self {
            match shown.paused_ms.take() {
                Some(paused_ms) => shown.start_ms += now_ms - paused_ms,
                None => shown.paused_ms = Some(now_ms),
            }
        }
    }
}

impl Shown {
    fn time_s(&self, now_ms: f64) -> f64 {
        (self.paused_ms.unwrap_or(now_ms) - self.start_ms).max(0.0) / 1000.0
    }
}
