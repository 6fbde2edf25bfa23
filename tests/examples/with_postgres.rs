//! Runs a command with its own PostgreSQL cluster, in which tests create their databases:
//! `with_postgres cargo test …`. Removes the cluster afterwards.

use sidestep_tests::postgres::{Cluster, Fsync};
use std::env;
use std::process::{Command, ExitCode};

fn main() -> ExitCode {
    let mut words = env::args_os().skip(1);
    let Some(program) = words.next() else {
        eprintln!("expected a command and its arguments, found none");
        return ExitCode::from(2);
    };
    let cluster = Cluster::start(Fsync::Off);
    let mut command = Command::new(program);
    command.args(words).env("SIDESTEP_TEST_POSTGRES", cluster.url("DATABASE"));
    match command.status() {
        Ok(status) if status.success() => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("cannot run the command: {error}");
            ExitCode::FAILURE
        }
    }
}
