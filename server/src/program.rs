//! The program `sidestep`: parses the command line, calls a subcommand, and reports errors.
//!
//! This module is in the library, because a separate package would compile the async functions
//! again.

use crate::commands::serve::LogFormat;
use crate::commands::{
    CommandError, analyze, backup, bounds, check, child, copy, design, export, features, hash_key,
    import, languages, plot, reach, retention, salvage, serve, shfrs, simulate, solve, value,
};
use crate::jobs::children::SUBCOMMAND;
use crate::store::harmless;
use clap::error::{ContextKind, ContextValue};
use clap::{Parser, Subcommand};
use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

/// Collects, checks and serves studies of how people avoid a robot.
#[derive(Debug, Parser)]
#[command(name = "sidestep", version, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 failure, 2 usage or bad input. Errors go to \
                          stderr, results to stdout as JSON. RUST_LOG sets the log level \
                          [default: info].";

#[derive(Debug, Subcommand)]
enum Command {
    Serve(serve::ServeArgs),
    HashKey(hash_key::HashKeyArgs),
    Languages(languages::LanguagesArgs),
    Solve(solve::SolveArgs),
    Value(value::ValueArgs),
    Plot(plot::PlotArgs),
    Bounds(bounds::BoundsArgs),
    Reach(reach::ReachArgs),
    Shfrs(shfrs::ShfrsArgs),
    Features(features::FeaturesArgs),
    Analyze(analyze::AnalyzeArgs),
    Design(design::DesignArgs),
    Simulate(simulate::SimulateArgs),
    Export(export::ExportArgs),
    Import(import::ImportArgs),
    Check(check::CheckArgs),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
    Salvage(salvage::SalvageArgs),
    Copy(copy::CopyArgs),
    Retention(retention::RetentionArgs),
    #[command(hide = true, name = SUBCOMMAND)]
    Child(child::ChildArgs),
}

/// The signal SIGXFSZ on Linux and macOS, which is sent when a file would exceed the size limit.
const SIGXFSZ: i32 = 25;

/// Runs the program with the arguments of this process.
#[must_use]
pub fn run() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| without_addresses(error).exit());
    let done = match cli.command {
        Command::Child(args) => child::run(&args),
        command => {
            let (is_demo, format) = match &command {
                Command::Serve(args) => (args.demo, args.log_format),
                _ => (false, LogFormat::Text),
            };
            log_to_stderr(is_demo, format);
            tokio::runtime::Runtime::new()
                .map_err(CommandError::failure)
                .and_then(|runtime| runtime.block_on(call(command)))
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if let Some(said) = error.said() {
                // Ignore errors, because stderr might be closed.
                let _ = writeln!(std::io::stderr(), "sidestep: {said}");
            }
            ExitCode::from(error.exit_code())
        }
    }
}

/// The error without addresses that were given in the wrong place, because they might contain a
/// password.
fn without_addresses(mut error: clap::Error) -> clap::Error {
    for kind in [ContextKind::InvalidArg, ContextKind::InvalidValue, ContextKind::InvalidSubcommand]
    {
        if let Some(ContextValue::String(found)) = error.get(kind)
            && found.contains("://")
        {
            let found = ContextValue::String(harmless(found));
            error.insert(kind, found);
        }
    }
    error
}

async fn call(command: Command) -> Result<(), CommandError> {
    // Handle SIGXFSZ, so that a write beyond the file size limit (ulimit -f) fails as on a full disk
    // instead of killing the process.
    let _too_long = signal(SignalKind::from_raw(SIGXFSZ)).map_err(CommandError::failure)?;
    match command {
        Command::Serve(args) => serve::run(args).await,
        Command::HashKey(_) => hash_key::run(),
        Command::Languages(args) => languages::run(&args),
        Command::Solve(args) => solve::run(args).await,
        Command::Value(args) => value::run(args).await,
        Command::Plot(args) => plot::run(args).await,
        Command::Bounds(args) => bounds::run(args).await,
        Command::Reach(args) => reach::run(args).await,
        Command::Shfrs(args) => shfrs::run(args).await,
        Command::Features(args) => features::run(args).await,
        Command::Analyze(args) => analyze::run(args).await,
        Command::Design(args) => design::run(args).await,
        Command::Simulate(args) => simulate::run(args).await,
        Command::Export(args) => export::run(args).await,
        Command::Import(args) => import::run(args).await,
        Command::Check(args) => check::run(args).await,
        Command::Backup(args) => backup::back_up(args).await,
        Command::Restore(args) => backup::restore(args).await,
        Command::Salvage(args) => salvage::run(args).await,
        Command::Copy(args) => copy::run(args).await,
        Command::Retention(args) => retention::run(args).await,
        Command::Child(args) => child::run(&args),
    }
}

/// Initialises logging to stderr. A demonstration logs no requests, because hundreds of requests
/// fill its study, and their log would scroll the sign-in link off the screen.
fn log_to_stderr(is_demo: bool, format: LogFormat) {
    use tracing::Level;
    let requests = if is_demo { Level::WARN } else { Level::INFO };
    let default = Targets::new()
        .with_default(Level::INFO)
        .with_target("sidestep_server::http::guard", requests);
    let wanted = std::env::var("RUST_LOG").ok().and_then(|text| text.parse::<Targets>().ok());
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let lines = match format {
        LogFormat::Text => {
            lines.with_ansi(std::io::stderr().is_terminal()).with_target(false).boxed()
        }
        LogFormat::Json => lines.json().flatten_event(true).with_span_list(false).boxed(),
    };
    tracing_subscriber::registry().with(lines).with(wanted.unwrap_or(default)).init();
}
