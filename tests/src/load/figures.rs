//! Figures, and how they are printed.

use hdrhistogram::Histogram;
use std::fmt::{Display, Formatter, Result};
use std::time::Duration;

/// A line of the table: name, figure, and what is said of it.
#[allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]
pub fn row(name: &str, figure: impl Display, said: impl Display) {
    println!("{name:36} {:>22}   {said}", figure.to_string());
}

/// A figure against the least that is wanted.
#[must_use]
pub fn at_least(figure: f64, target: f64, unit: &str) -> String {
    format!("≥ {target}{unit} {}", if figure >= target { "met" } else { "MISSED" })
}

/// A figure against the most that is wanted.
#[must_use]
pub fn at_most(figure: f64, target: f64, unit: &str) -> String {
    format!("≤ {target}{unit} {}", if figure <= target { "met" } else { "MISSED" })
}

/// How long requests took, each from when it was due: a server that stalls makes all that was due
/// meanwhile late, and not only the one request that it held up.
#[derive(Debug)]
pub struct Latencies {
    /// µs, to three digits.
    answered: Histogram<u64>,
    /// Requests that were refused, which count as never answered.
    refused: u64,
}

impl Default for Latencies {
    fn default() -> Self {
        let answered = Histogram::new(3).expect("three digits");
        Self { answered, refused: 0 }
    }
}

impl Latencies {
    /// Notes an answer.
    ///
    /// # Panics
    /// If the duration has too many digits for an integer.
    pub fn note(&mut self, took: Duration) {
        let us = u64::try_from(took.as_micros()).unwrap_or(u64::MAX).max(1);
        self.answered.record(us).expect("a histogram that grows");
    }

    /// Notes a refusal.
    pub fn refuse(&mut self) {
        self.refused += 1;
    }

    /// How many requests there were.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.answered.len() + self.refused
    }

    /// The time within which this share was answered, ms; infinite for no requests.
    #[must_use]
    pub fn quantile_ms(&self, share: f64) -> f64 {
        let count = self.count();
        let rank = (share * count as f64).ceil();
        if count == 0 || rank > self.answered.len() as f64 {
            return f64::INFINITY;
        }
        let of_answered = rank / self.answered.len() as f64;
        self.answered.value_at_quantile(of_answered) as f64 / 1e3
    }
}

impl Display for Latencies {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let [half, most, p999, last] = [0.5, 0.99, 0.999, 1.0].map(|share| self.quantile_ms(share));
        write!(out, "{half:.1} / {most:.1} / {p999:.1} / {last:.1} ms (50, 99, 99.9, 100 %)")
    }
}

/// What a process has used, as Linux counts it; elsewhere nothing is known.
#[derive(Clone, Copy, Debug)]
pub struct Usage {
    /// CPU time of all its threads, s.
    pub cpu_s: f64,
    /// In memory now and at most, MB.
    pub memory_mb: [f64; 2],
}

impl Usage {
    /// Of a process, by its number.
    #[must_use]
    pub fn of(process: u32) -> Self {
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
