//! Style of a picture's layers.

use crate::scene::Evader;

/// Style of a picture's layers.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// Levels of V_HR and of V_RH (m), in ascending order.
    pub levels_m: [Vec<f64>; 2],
    /// The drawn part of each predicted set.
    pub sets: Sets,
    /// The colours of the predicted sets.
    pub palette: Palette,
}

impl Default for Style {
    fn default() -> Self {
        let levels_m = [vec![0.0], vec![0.0]];
        Self { levels_m, sets: Sets::default(), palette: Palette::default() }
    }
}

impl Style {
    /// The levels of a vehicle's value function (m).
    #[must_use]
    pub fn levels(&self, evader: Evader) -> &[f64] {
        match evader {
            Evader::Human => &self.levels_m[0],
            Evader::Robot => &self.levels_m[1],
        }
    }
}

/// The drawn part of each predicted set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sets {
    /// All positions within the steps ahead.
    #[default]
    Tube,
    /// The positions after each step.
    EachStep,
    /// The positions after one step only, counted from 1.
    Step(usize),
}

/// The colours of the predicted sets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Palette {
    /// Red, yellow, green, blue and purple, as in the paper.
    #[default]
    Paper,
    /// From dark to bright, and hatched, for colour-blind readers and greyscale print.
    Safe,
}
