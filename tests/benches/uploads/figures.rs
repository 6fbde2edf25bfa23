//! Figures, and how they are printed.

use std::fmt::{Display, Formatter, Result};

/// A line of the table: name, figure, and what is said of it.
pub(crate) fn row(name: &str, figure: impl Display, said: impl Display) {
    println!("{name:36} {:>22}   {said}", figure.to_string());
}

/// A figure against the least that is wanted.
pub(crate) fn at_least(figure: f64, target: f64, unit: &str) -> String {
    format!("≥ {target}{unit} {}", if figure >= target { "met" } else { "MISSED" })
}

/// A figure against the most that is wanted.
pub(crate) fn at_most(figure: f64, target: f64, unit: &str) -> String {
    format!("≤ {target}{unit} {}", if figure <= target { "met" } else { "MISSED" })
}

/// Times, ms.
#[derive(Default)]
pub(crate) struct Milliseconds(Vec<f64>);

impl Milliseconds {
    pub(crate) fn push(&mut self, ms: f64) {
        self.0.push(ms);
    }

    /// The time within which this share lies; infinite for no times.
    fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted.get((share * last as f64).ceil() as usize).copied().unwrap_or(f64::INFINITY)
    }

    pub(crate) fn p99_ms(&self) -> f64 {
        self.quantile(0.99)
    }
}

impl Display for Milliseconds {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let [least, half, p99, most] = [0.0, 0.5, 0.99, 1.0].map(|share| self.quantile(share));
        write!(out, "{least:.1} / {half:.1} / {p99:.1} / {most:.1} ms (0, 50, 99, 100 %)")
    }
}

/// What a process has used, as Linux counts it; elsewhere nothing is known.
pub(crate) struct Usage {
    /// CPU time of all its threads, s.
    pub(crate) cpu_s: f64,
    /// In memory now and at most, MB.
    pub(crate) memory_mb: [f64; 2],
}

impl Usage {
    pub(crate) fn of(process: u32) -> Self {
        /// Of the clock that processes are shown; Linux has no other.
        const TICKS_PER_S: f64 = 100.0;
        let read = |name| std::fs::read_to_string(format!("/proc/{process}/{name}"));
        let (stat, status) = (read("stat").unwrap_or_default(), read("status").unwrap_or_default());
        // The name of the program, in brackets, may hold spaces.
        let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields).split_whitespace();
        let ticks: Vec<f64> = fields.skip(11).take(2).flat_map(str::parse).collect();
        let kilobytes = |field: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(field))?;
            line.split_whitespace().next()?.parse::<f64>().ok()
        };
        Self {
            cpu_s: if ticks.is_empty() {
                f64::NAN
            } else {
                ticks.iter().sum::<f64>() / TICKS_PER_S
            },
            memory_mb: ["VmRSS:", "VmHWM:"]
                .map(|field| kilobytes(field).unwrap_or(f64::NAN) / 1024.0),
        }
    }
}
