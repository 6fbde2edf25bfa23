//! The game of a command, which is defined by flags or by a file with a value function.

use super::solving::{self, Interrupt, flagged};
use super::{CommandError, one_of};
use crate::formats::npz;
use sidestep::reachability::{ACCURACIES, Accuracy, Options, PursuitGame, ValueFunction};
use sidestep::vehicle::VehicleModel;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// GAME: the two vehicles and the danger radius.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct GameArgs {
    /// The evader's speed (m/s).
    #[arg(long, help_heading = "Game", value_name = "M/S", default_value_t = 2.0)]
    #[arg(allow_negative_numbers = true)]
    pub evader_speed: f64,
    /// The evader's largest turn rate (rad/s).
    #[arg(long, help_heading = "Game", value_name = "RAD/S", default_value_t = 0.5)]
    #[arg(allow_negative_numbers = true)]
    pub evader_turn_rate: f64,
    /// The pursuer's speed (m/s).
    #[arg(long, help_heading = "Game", value_name = "M/S", default_value_t = 2.0)]
    #[arg(allow_negative_numbers = true)]
    pub pursuer_speed: f64,
    /// The pursuer's largest turn rate (rad/s).
    #[arg(long, help_heading = "Game", value_name = "RAD/S", default_value_t = 0.5)]
    #[arg(allow_negative_numbers = true)]
    pub pursuer_turn_rate: f64,
    /// Danger radius (m). The vehicles collide if their distance is at most this radius.
    #[arg(long, help_heading = "Game", value_name = "M", default_value_t = 3.0)]
    #[arg(allow_negative_numbers = true)]
    pub radius: f64,
}

impl GameArgs {
    /// The game that the flags define.
    ///
    /// # Errors
    /// [`CommandError::Input`] naming the flag that is not a finite number > 0.
    pub fn game(self) -> Result<PursuitGame, CommandError> {
        let vehicle = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
        let game = PursuitGame {
            evader: vehicle(self.evader_speed, self.evader_turn_rate),
            pursuer: vehicle(self.pursuer_speed, self.pursuer_turn_rate),
            radius_m: self.radius,
        };
        game.check().map_err(flagged)
    }
}

/// GAME, or the file of a value function.
#[derive(Clone, Debug, clap::Args)]
pub struct FunctionArgs {
    #[command(flatten)]
    game: GameArgs,
    /// File of `sidestep solve`. It defines the game, and therefore excludes GAME.
    #[arg(long, value_name = "FILE.npz", conflicts_with = "GameArgs")]
    value_function: Option<PathBuf>,
    /// Accuracy of the grid for unequal vehicles (equal vehicles need no grid).
    #[arg(long, value_parser = one_of(ACCURACIES), default_value = "standard")]
    #[arg(conflicts_with = "value_function")]
    accuracy: Accuracy,
}

impl FunctionArgs {
    /// The flags of the game. If --value-function is given, they have their default values.
    pub(super) fn game(&self) -> GameArgs {
        self.game
    }

    /// The value function. It is read from the file, evaluated in closed form, or solved numerically.
    ///
    /// # Errors
    /// [`CommandError::Input`] naming the flag or the file and the fault in it;
    /// [`CommandError::Failure`] if the user cancels.
    pub(super) async fn function(
        &self,
        interrupt: &Interrupt,
    ) -> Result<ValueFunction, CommandError> {
        if let Some(path) = &self.value_function {
            return read(path);
        }
        let game = self.game.game()?;
        if game.identical() {
            return game.exact().map(ValueFunction::Exact).map_err(flagged);
        }
        let options = Options::default().with_accuracy(self.accuracy);
        Ok(solving::solved(game, options, interrupt).await?.0.function)
    }
}

/// Reads a value function from a file. Warns on stderr if the solver did not converge, or if the
/// file does not state whether it converged.
///
/// # Errors
/// [`CommandError::Input`] naming the file and the fault in it.
pub fn read(path: &Path) -> Result<ValueFunction, CommandError> {
    let name = path.display();
    let complain = |e: &dyn std::fmt::Display| CommandError::Input(format!("{name}: {e}"));
    let file = File::open(path).map_err(|e| complain(&format!("cannot read: {e}")))?;
    let stored = npz::read(BufReader::new(file)).map_err(|e| match e.field.is_empty() {
        true => complain(&format!("expected {}, found {}", e.expected, e.found)),
        false => complain(&e),
    })?;
    let unlimited =
        matches!(&stored.function, ValueFunction::Sampled(f) if f.horizon_s().is_infinite());
    match stored.converged {
        Some(false) => eprintln!(
            "sidestep: {name}: the solve did not converge: V may be too high, above all far away"
        ),
        None if unlimited => eprintln!(
            "sidestep: {name}: does not say whether its solve converged (an earlier version wrote \
             it); solve again to know"
        ),
        _ => {}
    }
    Ok(stored.function)
}
