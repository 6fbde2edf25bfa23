//! Solving at a terminal: a bar that shows how far it is, and a way to stop it.

use super::CommandError;
use crate::formats::atomic_file::Stop;
use indicatif::{ProgressBar, ProgressStyle};
use sidestep::invalid::Invalid;
use sidestep::reachability::{Method, Options, PursuitGame, SolveError, Solved, solve};
use std::ops::ControlFlow;
use std::time::Instant;
use tokio::sync::oneshot;

/// Ctrl-C (SIGINT) and SIGTERM of a command that is to leave nothing half-done.
pub(super) struct Interrupt {
    /// Set by the first of them.
    pub(super) stop: Stop,
}

impl Interrupt {
    /// From now on the signals only set [`Interrupt::stop`].
    pub(super) fn listen() -> Self {
        let stop = Stop::default();
        let heard = stop.clone();
        tokio::spawn(async move {
            signalled().await;
            heard.now();
        });
        Self { stop }
    }

    /// The complaint to end with, once stopped.
    pub(super) fn check(&self) -> Result<(), CommandError> {
        if self.stop.is_wanted() { Err(stopped()) } else { Ok(()) }
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
    // Without the means to listen there is nothing to wait for.
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending::<()>().await;
    }
}

/// Solves, with a progress bar if stderr is a terminal; also how long it took, s. Says so where
/// the solution did not settle.
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

/// Likewise, for who complains in words of its own.
pub(super) async fn solved_silently(
    game: PursuitGame,
    options: Options,
    interrupt: &Interrupt,
) -> Result<(Solved, f64), CommandError> {
    let (answer, answered) = oneshot::channel();
    let stop = interrupt.stop.clone();
    // A thread of its own: a runtime would wait for a blocking task at its end.
    std::thread::Builder::new()
        .name("solve".to_owned())
        .spawn(move || {
            let bar = bar(
                BAR_STEPS,
                "solving [{bar:40}] {percent:>3} %  {elapsed_precise}  still moves {msg}",
            );
            let start = Instant::now();
            let result = solve(game, &options, &mut |progress| {
                bar.set_position((progress.done.clamp(0.0, 1.0) * BAR_STEPS as f64) as u64);
                bar.set_message(format!("{:.1e}", progress.residual));
                if stop.is_wanted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            let wall_s = start.elapsed().as_secs_f64();
            bar.finish_and_clear();
            // Nobody waits any more only when the command is over.
            let _ = answer.send((result, wall_s));
        })
        .map_err(|e| CommandError::Failure(format!("cannot start a thread: {e}")))?;
    let (result, wall_s) = answered
        .await
        .map_err(|_| CommandError::Failure("the solver failed; see above".to_owned()))?;
    interrupt.check()?;
    match result {
        Ok(solved) => Ok((solved, wall_s)),
        Err(SolveError::Invalid(invalid)) => Err(flagged(invalid)),
        Err(SolveError::Cancelled) => Err(stopped()),
    }
}

const BAR_STEPS: u64 = 1000;

/// A bar of so many steps; hidden unless stderr is a terminal.
pub(super) fn bar(steps: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("█▉▊▋▌▍▎▏ "));
    }
    bar
}

/// A complaint of the library in terms of the command line.
pub(super) fn flagged(invalid: Invalid) -> CommandError {
    let flag = match invalid.field.as_str() {
        "evader.speed_mps" => "evader-speed",
        "evader.turn_rate_radps" => "evader-turn-rate",
        "pursuer.speed_mps" => "pursuer-speed",
        "pursuer.turn_rate_radps" => "pursuer-turn-rate",
        "radius_m" => "radius",
        "horizon_s" => "horizon",
        "range_m" => "range",
        "axes[0].low" => "domain, X0",
        "axes[0].high" => "domain, X1",
        "axes[1].low" => "domain, Y0",
        "axes[1].high" => "domain, Y1",
        "axes[0].nodes" => "grid, NX",
        "axes[1].nodes" => "grid, NY",
        "axes[2].nodes" => "grid, NPSI",
        other => other,
    };
    CommandError::Input(format!("--{flag}: expected {}, found {}", invalid.expected, invalid.found))
}
