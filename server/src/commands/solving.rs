//! Solves games in a terminal, with a progress bar and cancellation.

use super::{CommandError, unwritable};
use crate::support::threads;
use indicatif::{ProgressBar, ProgressStyle};
use sidestep::invalid::Invalid;
use sidestep::reachability::{
    Method, Options, PursuitGame, SolveError, Solved, ValueFunction, solve,
};
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, SceneParameters};
use sidestep::value_view::parameter;
use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;
use tokio_util::sync::CancellationToken;

/// Handles Ctrl-C (SIGINT) and SIGTERM, so that a command leaves nothing half-written.
pub(super) struct Interrupt {
    /// Cancelled by the first signal.
    pub(super) token: CancellationToken,
}

impl Interrupt {
    /// Installs the signal handlers. From now on, the signals only cancel [`Interrupt::token`].
    pub(super) fn listen() -> Self {
        let token = CancellationToken::new();
        let heard = token.clone();
        tokio::spawn(async move {
            signalled().await;
            heard.cancel();
        });
        Self { token }
    }

    /// Returns the result of `work`, or an error if a signal comes first. After a signal, `work` is no
    /// longer awaited, so it must not write anything.
    pub(super) async fn unless_stopped<T>(
        &self,
        work: impl Future<Output = T>,
    ) -> Result<T, CommandError> {
        tokio::select! {
            biased;
            () = self.token.cancelled() => Err(stopped()),
            found = work => Ok(found),
        }
    }

    /// The error for a file or folder that was not written, because of a signal or a disk error.
    pub(super) fn unwritten(&self, path: &Path, error: &dyn Display) -> CommandError {
        self.check().err().unwrap_or_else(|| unwritable(path, error))
    }

    /// Returns an error once a signal has come.
    pub(super) fn check(&self) -> Result<(), CommandError> {
        if self.token.is_cancelled() { Err(stopped()) } else { Ok(()) }
    }
}

fn stopped() -> CommandError {
    CommandError::Failure("stopped; nothing was written".to_owned())
}

async fn signalled() {
    #[cfg(unix)]
    if let Ok(mut terminate) =
        tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())
    {
        tokio::select! {
            _ = tokio::signal::ctrl_c() => {}
            _ = terminate.recv() => {}
        }
        return;
    }
    // If the process cannot listen for signals, wait forever.
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending::<()>().await;
    }
}

/// Solves the game, with a progress bar if stderr is a terminal. Warns on stderr if the solve did
/// not converge. Also returns the duration (s).
pub(super) async fn solved(
    game: PursuitGame,
    options: Options,
    interrupt: &Interrupt,
) -> Result<(Solved, f64), CommandError> {
    let (solved, wall_s) = solved_silently(game, options, interrupt).await?;
    if solved.converged == Some(false) {
        eprintln!(
            "sidestep: not converged: V still moves by {:.1e} {}; it may be too high, above all \
             far away",
            solved.residual,
            if solved.method == Method::Polar { "m in 16 sweeps" } else { "m/s" }
        );
    }
    Ok((solved, wall_s))
}

/// Like [`solved`], but without the warning on stderr.
pub(super) async fn solved_silently(
    game: PursuitGame,
    options: Options,
    interrupt: &Interrupt,
) -> Result<(Solved, f64), CommandError> {
    let token = interrupt.token.clone();
    let work = move || {
        let bar = bar(
            BAR_STEPS,
            "solving [{bar:40}] {percent:>3} %  {elapsed_precise}  still moves {msg}",
        );
        let start = Instant::now();
        let result = solve(game, &options, &mut |progress| {
            bar.set_position((progress.done.clamp(0.0, 1.0) * BAR_STEPS as f64) as u64);
            bar.set_message(format!("{:.1e}", progress.residual));
            if token.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let wall_s = start.elapsed().as_secs_f64();
        bar.finish_and_clear();
        (result, wall_s)
    };
    let (result, wall_s) =
        threads::run("solve", None, work).await.map_err(CommandError::failure)?;
    interrupt.check()?;
    match result {
        Ok(solved) => Ok((solved, wall_s)),
        Err(SolveError::Invalid(invalid)) => Err(flagged(invalid)),
        Err(SolveError::Cancelled) => Err(stopped()),
        Err(other) => Err(CommandError::failure(other)),
    }
}

/// The safety levels of both vehicles. Only unequal vehicles need a numerical solution. Warns if a
/// value function did not converge.
pub(super) async fn safety_levels(
    parameters: &SceneParameters,
    interrupt: &Interrupt,
) -> Result<SafetyLevels, CommandError> {
    let [game_h, game_r] = Evader::ALL.map(|evader| parameters.game(evader));
    let human = value_function(game_h, interrupt).await?;
    let robot =
        if game_r == game_h { human.clone() } else { value_function(game_r, interrupt).await? };
    let safety = SafetyLevels { human, robot };
    for complaint in safety.complaints() {
        eprintln!("sidestep: {complaint}");
    }
    Ok(safety)
}

async fn value_function(
    game: PursuitGame,
    interrupt: &Interrupt,
) -> Result<ValueFunction, CommandError> {
    match game.exact() {
        Ok(exact) => Ok(ValueFunction::Exact(exact)),
        Err(_) => Ok(solved_silently(game, Options::default(), interrupt).await?.0.function),
    }
}

const BAR_STEPS: u64 = 1000;

/// A progress bar with this number of steps; hidden unless stderr is a terminal.
pub(super) fn bar(steps: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("█▉▊▋▌▍▎▏ "));
    }
    bar
}

/// Converts a library error to an error about the flag.
pub(super) fn flagged(invalid: Invalid) -> CommandError {
    let flag = match invalid.field.as_str() {
        // For unequal vehicles, both turn rates are checked together.
        "turn_rate_radps" => "evader-turn-rate and --pursuer-turn-rate",
        "axes[0].low" => "domain, X0",
        "axes[0].high" => "domain, X1",
        "axes[1].low" => "domain, Y0",
        "axes[1].high" => "domain, Y1",
        "axes[0].nodes" => "grid, NX",
        "axes[1].nodes" => "grid, NY",
        "axes[2].nodes" => "grid, NPSI",
        other => parameter(other),
    };
    CommandError::Input(format!("--{flag}: expected {}, found {}", invalid.expected, invalid.found))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};

    #[derive(Parser)]
    struct Game {
        #[command(flatten)]
        game: super::super::game::GameArgs,
    }

    #[tokio::test]
    async fn a_solve_that_is_refused_names_flags_that_exist() {
        let args = ["game", "--radius", "1e6", "--pursuer-speed", "3"];
        let game = Game::parse_from(args).game.game().unwrap();
        let refused = solved(game, Options::default(), &Interrupt::listen()).await;
        let said = refused.err().unwrap().to_string();
        let (flags, _) = said.split_once(':').unwrap();
        let command = Game::command();
        for flag in flags.split(" and ") {
            let known = |arg: &clap::Arg| arg.get_long() == flag.strip_prefix("--");
            assert!(command.get_arguments().any(known), "{said}");
        }
    }
}
