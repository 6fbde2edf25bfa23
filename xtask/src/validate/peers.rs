//! Times and accuracies of other solvers, measured for `cargo xtask validate --peers`.

use std::num::NonZero;
use std::thread::available_parallelism;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Result;
use serde_json::{Value, json};

use crate::bench::peers::measure;
use crate::workspace::Workspace;

/// Runs every comparison of `cargo xtask bench peers`. Returns the figures of both solvers (the
/// peer's first, in each case), the date and the machine's number of cores.
///
/// # Errors
/// When a solver cannot be run.
pub(super) fn measured(workspace: &Workspace) -> Result<Value> {
    let figures = measure(workspace)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
    let cores = available_parallelism().map_or(1, NonZero::get);
    Ok(json!({ "date": date(now.as_secs() / 86_400), "cores": cores, "solved": figures }))
}

/// The date (year-month-day) of a day counted from 1970-01-01. The algorithm is Howard Hinnant's
/// `civil_from_days`.
fn date(days: u64) -> String {
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, later) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{:04}-{month:02}-{day:02}", year + 400 * era + later)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_their_dates() {
        assert_eq!(date(0), "1970-01-01");
        assert_eq!(date(19_782), "2024-02-29");
        assert_eq!(date(20_818), "2026-12-31");
    }
}
