//! Flags of trials.

use serde::{Deserialize, Serialize};

/// Evidence about a trial that an analyst should know. Flags never change or reject a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// The first state is not the scene's start.
    StartMismatch,
    /// The states do not follow from the inputs.
    ReplayMismatch,
    /// An input was sampled more than [`LATE_SAMPLE_MS`](super::LATE_SAMPLE_MS) before or after it was due.
    LateSample,
    /// The trial was read from a file, without evidence of timing and keys.
    Imported,
    /// The trial was interrupted: the page lost focus or was hidden, an input was sampled more than
    /// [`INTERRUPTED_MS`](super::INTERRUPTED_MS) late, or the scene had been shown before.
    Interrupted,
    /// The page lost focus or was hidden.
    FocusLost,
    /// The scene had been shown before: the page was reloaded or closed during an earlier showing.
    ShownBefore,
    /// The window was resized.
    Resized,
    /// The participant left full-screen mode.
    LeftFullscreen,
    /// The median frame rate was below [`LOW_FRAME_RATE_HZ`](super::LOW_FRAME_RATE_HZ).
    LowFrameRate,
    /// On the participant's clock, the trial started before 1970 or after 2100.
    WrongClock,
    /// The times of samples, keys or page events decrease.
    UnorderedTimes,
    /// More than [`FASTEST_PRESSES`](super::FASTEST_PRESSES) presses within a second, which points
    /// to a defective keyboard or a program.
    FastKeys,
    /// A character that files cannot contain was replaced by U+FFFD.
    ReplacedCharacters,
}

impl Flag {
    /// Every flag.
    pub const ALL: [Self; 14] = [
        Self::StartMismatch,
        Self::ReplayMismatch,
        Self::LateSample,
        Self::Imported,
        Self::Interrupted,
        Self::FocusLost,
        Self::ShownBefore,
        Self::Resized,
        Self::LeftFullscreen,
        Self::LowFrameRate,
        Self::WrongClock,
        Self::UnorderedTimes,
        Self::FastKeys,
        Self::ReplacedCharacters,
    ];

    /// Flags that earlier versions did not set. Trials from those versions can lack them.
    pub const LATER: [Self; 4] =
        [Self::WrongClock, Self::UnorderedTimes, Self::FastKeys, Self::ReplacedCharacters];

    /// The word used in files, rows and on the wire.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::StartMismatch => "start_mismatch",
            Self::ReplayMismatch => "replay_mismatch",
            Self::LateSample => "late_sample",
            Self::Imported => "imported",
            Self::Interrupted => "interrupted",
            Self::FocusLost => "focus_lost",
            Self::ShownBefore => "shown_before",
            Self::Resized => "resized",
            Self::LeftFullscreen => "left_fullscreen",
            Self::LowFrameRate => "low_frame_rate",
            Self::WrongClock => "wrong_clock",
            Self::UnorderedTimes => "unordered_times",
            Self::FastKeys => "fast_keys",
            Self::ReplacedCharacters => "replaced_characters",
        }
    }

    /// Whether these flags cast doubt on a trial. Any flag except [`Self::Imported`] does.
    #[must_use]
    pub fn question(flags: &[Self]) -> bool {
        flags.iter().any(|flag| *flag != Self::Imported)
    }

    /// The flag with this word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|flag| flag.word() == word)
    }
}
