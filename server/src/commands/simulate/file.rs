//! Writes trials of synthetic participants to a CSV file.

use super::super::solving::Interrupt;
use super::super::{CommandError, print_json};
use super::{FlagCounts, SimulateArgs, bar};
use crate::formats::atomic_file;
use crate::formats::trials_csv::REQUIRED;
use sidestep::scene::SceneParameters;
use sidestep::synthetic::{Keys, REFERENCE_SEED, SyntheticParticipant};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes the whole file or nothing, and prints the summary. If `out` is `-`, writes to stdout
/// without a summary.
pub(super) fn write(args: &SimulateArgs, out: &str) -> Result<(), CommandError> {
    if out == "-" {
        let mut stdout = BufWriter::new(io::stdout().lock());
        return content(args, &mut stdout)
            .and_then(|_| stdout.flush())
            .map_err(|error| CommandError::of_stdout(&error));
    }
    let path = Path::new(out);
    let interrupt = Interrupt::listen();
    let mut flags = FlagCounts::default();
    atomic_file::write(path, &interrupt.token, |file| {
        flags = content(args, file)?;
        Ok(())
    })
    .map_err(|e: io::Error| interrupt.unwritten(path, &e))?;
    let trials = args.participants * args.trials();
    print_json(&serde_json::json!({
        "synthetic": true,
        "participants": args.participants,
        "trials": trials,
        "rows": trials * SceneParameters::default().steps as u64,
        "keys": match args.keys() { Keys::Clock => "clock", Keys::Free => "free" },
        "flags": flags,
        "file": path,
    }))
}

fn content(args: &SimulateArgs, out: &mut dyn Write) -> io::Result<FlagCounts> {
    let parameters = SceneParameters::default();
    let mut flags = FlagCounts::default();
    let bar = bar(args.participants * args.trials());
    // Use the number format and line endings of a study's exports, or those of the reference data.
    let (print, end): (fn(f64) -> String, _) = match args.keys() {
        Keys::Clock => (exact, "\n"),
        Keys::Free => (nine_digits, "\r\n"),
    };
    // The reference file must be reproduced byte for byte, and has no column `synthetic`. All other
    // files have this column.
    let says = args.keys() == Keys::Clock || args.seed != REFERENCE_SEED;
    let columns = REQUIRED.join(",");
    write!(out, "{columns}{}{end}", if says { ",synthetic" } else { "" })?;
    for number in 0..args.participants {
        let participant = SyntheticParticipant::new(args.seed, number);
        for trial in 0..args.trials() {
            let (scene, drive) = participant.own_trial(trial, args.keys());
            flags.count(&parameters, &scene, &drive);
            for (step, (input, state)) in drive.inputs.iter().zip(&drive.states).enumerate() {
                // Round to nanoseconds, so that a time is 0.6 rather than 0.6000000000000001.
                let t = (step as f64 * parameters.step_s * 1e9).round() / 1e9;
                let ([hx, hy, hpsi], [rx, ry, rpsi]) = (state.human.into(), state.robot.into());
                let omega = parameters.human.turn_rate(*input);
                let numbers = [t, hx, hy, hpsi, rx, ry, rpsi, omega].map(print).join(",");
                let mark = if says { ",1" } else { "" };
                write!(out, "{number},{trial},{step},{numbers}{mark}{end}")?;
            }
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(flags)
}

/// The shortest decimal number that parses to the same bits.
fn exact(number: f64) -> String {
    format!("{number:?}")
}

/// At most nine significant digits, in the format of Python's `repr`.
fn nine_digits(number: f64) -> String {
    let rounded: f64 = format!("{number:.8e}").parse().unwrap_or(number);
    let scientific = format!("{rounded:e}");
    match scientific.split_once('e').map(|(digits, power)| (digits, power.parse::<i32>())) {
        Some((digits, Ok(power @ ..-4))) => format!("{digits}e-{:02}", -power),
        Some((digits, Ok(power @ 16..))) => format!("{digits}e+{power:02}"),
        _ if rounded.fract() == 0.0 => format!("{rounded}.0"),
        _ => rounded.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_the_reference_prints_them() {
        for (number, printed) in [
            (0.0, "0.0"),
            (-0.5, "-0.5"),
            (10.0, "10.0"),
            (-7.098_616_443_2, "-7.09861644"),
            (-1.114_321_100_2, "-1.1143211"),
            (0.000_963_620_84, "0.00096362084"),
            (0.000_1, "0.0001"),
            (-6.923_240_34e-5, "-6.92324034e-05"),
            (2e-12, "2e-12"),
            (3.25e16, "3.25e+16"),
            (0.999_999_999_96, "1.0"),
        ] {
            assert_eq!(nine_digits(number), printed);
        }
    }
}
