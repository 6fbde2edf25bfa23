//! Who drives, and what they have driven of the present scene.

use crate::drive::Drive;
use crate::input::{HeldKeys, KeyMap};
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::synthetic::{Keys, SyntheticDrive, SyntheticParticipant};
use sidestep::vehicle::TurnInput;

/// Who drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Driver {
    /// Whoever sits at the keyboard.
    #[default]
    You,
    /// The synthetic person of this number, from 1.
    Synthetic(u64),
}

/// Number of synthetic drivers that a link can name.
const MOST_DRIVERS: u64 = 999;

/// The population of the synthetic drivers.
const POPULATION: u64 = 1;

impl Driver {
    /// The driver that a link names: nobody names one of no such number.
    pub(super) fn of_query(value: Option<&str>) -> Option<Self> {
        match value {
            None => Some(Self::You),
            Some(value) => {
                let number = value.strip_prefix("synthetic-")?.parse().ok()?;
                (1..=MOST_DRIVERS).contains(&number).then_some(Self::Synthetic(number))
            }
        }
    }

    /// The same for a link; nothing for who is meant without a name.
    pub(super) fn query(self) -> Option<String> {
        match self {
            Self::You => None,
            Self::Synthetic(number) => Some(format!("driver=synthetic-{number}")),
        }
    }

    /// The synthetic driver after this one.
    pub(super) fn another(self) -> Self {
        match self {
            Self::You => Self::Synthetic(1),
            Self::Synthetic(number) => Self::Synthetic(number % MOST_DRIVERS + 1),
        }
    }
}

/// A scene that is being driven.
pub(super) enum Driving {
    /// With keys.
    Live(Drive),
    /// By a synthetic driver, whose drive is known from the start and shown as time goes by.
    Shown(Shown),
}

/// The drive of a synthetic driver as far as it is shown.
pub(super) struct Shown {
    drive: SyntheticDrive,
    step_s: f64,
    /// Start on the page's clock, ms; a pause moves it.
    start_ms: f64,
    /// When it was paused.
    paused_ms: Option<f64>,
    /// Steps that have begun.
    begun: usize,
}

impl Driving {
    /// The scene of this index, from 0, at its start.
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
                // Nothing of it is sent, so nobody asks when it was.
                let started_at_ms = 0.0;
                let (keys, held) = keys;
                Self::Live(Drive::new(*parameters, scene, now_ms, started_at_ms, keys, held))
            }
            Driver::Synthetic(number) => {
                let person = SyntheticParticipant::new(POPULATION, number - 1);
                let drive = person.drive(index as u64, parameters, scene, Keys::Clock);
                let step_s = parameters.step_s;
                Self::Shown(Shown { drive, step_s, start_ms: now_ms, paused_ms: None, begun: 1 })
            }
        }
    }

    /// Goes on to `now_ms`; true when the scene is over.
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

    /// Time into the scene, s.
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

    /// The state before each step that has begun, and the one after the last of them.
    pub(super) fn states(&self) -> &[JointState] {
        match self {
            Self::Live(drive) => drive.states(),
            Self::Shown(shown) => &shown.drive.states[..=shown.begun],
        }
    }

    /// A key of somebody who drives.
    pub(super) fn key(&mut self, t_ms: f64, code: &str, down: bool) {
        if let Self::Live(drive) = self {
            drive.key(t_ms, code, down);
        }
    }

    /// Whether it stands still until somebody lets it go on.
    pub(super) fn is_paused(&self) -> bool {
        matches!(self, Self::Shown(Shown { paused_ms: Some(_), .. }))
    }

    /// Pauses, or goes on. Who drives cannot pause: the study has no pause either.
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
