//! The program `sidestep`.

use std::process::ExitCode;

fn main() -> ExitCode {
    sidestep_server::program::run()
}
