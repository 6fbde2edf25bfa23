//! How long other solvers take and how exact they are: kept figures, measured on demand.

use std::num::NonZero;
use std::thread::available_parallelism;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Result;
use serde::{Deserialize, Serialize};

use crate::bench::peers::measure;
use crate::workspace::Workspace;

/// `docs/validation/peers.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Peers {
    /// When `measured` was, year-month-day.
    pub(super) date: String,
    /// Cores of the machine.
    pub(super) cores: usize,
    pub(super) measured: Vec<Solved>,
    /// From our own earlier runs of programs that the bench does not start.
    pub(super) quoted: Vec<Solved>,
}

/// One solver's figures for one grid and scheme.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Solved {
    pub(super) solver: String,
    pub(super) grid: String,
    pub(super) scheme: String,
    pub(super) wall_s: f64,
    pub(super) mean_dx: f64,
    pub(super) max_dx: f64,
    pub(super) volume_percent: f64,
}

impl Peers {
    pub(super) fn parse(text: &str) -> Result<Self> {
        Ok(serde_json::from_str(text)?)
    }

    /// As it is kept: one solve a line.
    pub(super) fn text(&self) -> Result<String> {
        let lines = |rows: &[Solved]| -> Result<String> {
            let rows: Result<Vec<_>, _> = rows.iter().map(serde_json::to_string).collect();
            Ok(rows?.join(",\n    "))
        };
        Ok(format!(
            "{{\n  \"date\": \"{}\",\n  \"cores\": {},\n  \"measured\": [\n    {}\n  ],\n  \
             \"quoted\": [\n    {}\n  ]\n}}\n",
            self.date,
            self.cores,
            lines(&self.measured)?,
            lines(&self.quoted)?
        ))
    }

    /// With every comparison of `cargo xtask bench peers` run now.
    ///
    /// # Errors
    /// When a solver cannot be run.
    pub(super) fn measured_again(self, workspace: &Workspace) -> Result<Self> {
        let measured = measure(workspace)?.into_iter().map(|figures| Solved {
            solver: figures.solver,
            grid: figures.grid.to_owned(),
            scheme: figures.scheme.to_owned(),
            wall_s: rounded(figures.wall_s, 3),
            mean_dx: rounded(figures.accuracy.mean_dx, 4),
            max_dx: rounded(figures.accuracy.max_dx, 3),
            volume_percent: rounded(figures.accuracy.volume_percent, 3),
        });
        let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let cores = available_parallelism().map_or(1, NonZero::get);
        let date = date(now.as_secs() / 86_400);
        Ok(Self { date, cores, measured: measured.collect(), ..self })
    }
}

/// To so many places.
fn rounded(value: f64, places: i32) -> f64 {
    let unit = 10_f64.powi(places);
    (value * unit).round() / unit
}

/// Year-month-day so many days after 1970-01-01 (Howard Hinnant's `civil_from_days`).
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

    #[test]
    fn the_kept_figures_survive_being_written() {
        let kept = include_str!("../../../../docs/validation/peers.json");
        let peers = Peers::parse(kept).expect("the file is committed");
        let text = peers.text().expect("plain numbers");
        let again = Peers::parse(&text).expect("as written");
        assert_eq!(again.text().expect("plain numbers"), text);
        assert!(peers.measured.len() >= 8 && peers.measured.len().is_multiple_of(2));
    }
}
