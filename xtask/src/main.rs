//! `cargo xtask`: one command for each task in this workspace.
//!
//! Each command has a file of the same name, which reads from top to bottom. The commands share [`workspace`]
//! (paths, and calls of cargo) and [`site`] (which makes the served folder from `static/` and the compiled
//! client).
//!
//! Progress goes to stderr, results go to stdout. The exit code is 0 for success, 1 for a failure and 2 for a
//! wrong command line; `test` and `bench` return the exit code of the program they run.

#![allow(clippy::print_stdout, reason = "a command-line tool answers on standard output")]

mod workspace;
mod command;
mod site;
mod python;
mod build;
mod check;
mod semver;
mod search;
mod fuzz;
mod serve;
mod wheel;
mod test;
mod bench;
mod validate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::workspace::Workspace;

/// Build, start, check and test Sidestep.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    /// The command.
    #[command(subcommand)]
    task: Task,
}

/// The commands, in the order in which a newcomer needs them.
#[derive(Subcommand)]
enum Task {
    Serve(serve::Options),
    Build(build::Options),
    Test(test::Options),
    /// Build the Python package as a wheel and print its path.
    Wheel,
    /// Check formatting, dependencies, lints (native and browser) and documentation, without running anything.
    Check,
    Semver(semver::Options),
    Search(search::Options),
    Fuzz(fuzz::Options),
    Bench(bench::Options),
    Validate(validate::Options),
}

fn main() -> ExitCode {
    match run(Cli::parse().task) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Finds the workspace and runs `task` in it.
fn run(task: Task) -> anyhow::Result<ExitCode> {
    let workspace = Workspace::locate()?;
    match task {
        Task::Serve(options) => serve::run(&workspace, &options),
        Task::Build(options) => build::run(&workspace, &options).map(|()| ExitCode::SUCCESS),
        Task::Test(options) => test::run(&workspace, &options),
        Task::Wheel => wheel::run(&workspace).map(|()| ExitCode::SUCCESS),
        Task::Check => check::run(&workspace).map(|()| ExitCode::SUCCESS),
        Task::Semver(options) => semver::run(&workspace, &options),
        Task::Search(options) => search::run(&workspace, &options),
        Task::Fuzz(options) => fuzz::run(&workspace, &options),
        Task::Bench(options) => bench::run(&workspace, &options),
        Task::Validate(options) => validate::run(&workspace, &options).map(|()| ExitCode::SUCCESS),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        super::Cli::command().debug_assert();
    }
}
