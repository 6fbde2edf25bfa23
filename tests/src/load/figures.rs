//! Measurements, and printing of measurements.

use hdrhistogram::Histogram;
use std::fmt::{Display, Formatter, Result};
use std::time::Duration;

/// Prints a row of the table: name, value and remark.
#[allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]
pub fn row(name: &str, figure: impl Display, said: impl Display) {
    println!("{name:36} {:>22}   {said}", figure.to_string());
}

/// Describes whether a value meets its lower bound.
#[must_use]
pub fn at_least(figure: f64, target: f64, unit: &str) -> String {
    format!("≥ {target}{unit} {}", if figure >= target { "met" } else { "MISSED" })
}

/// Describes whether a value meets its upper bound.
#[must_use]
pub fn at_most(figure: f64, target: f64, unit: &str) -> String {
    format!("≤ {target}{unit} {}", if figure <= target { "met" } else { "MISSED" })
}

/// Latencies of requests, each measured from the time when the request was due. A stall of a server
/// thus delays all requests that become due during the stall, not only the request in progress.
#[derive(Debug)]
pub struct Latencies {
    /// Latencies of answered requests (µs), with three significant digits.
    answered: Histogram<u64>,
    /// Number of refused requests. Their latency counts as infinite.
    refused: u64,
}

impl Default for Latencies {
    fn default() -> Self {
        let answered = Histogram::new(3).expect("three digits");
        Self { answered, refused: 0 }
    }
}

impl Latencies {
    /// Records the latency of an answered request.
    ///
    /// # Panics
    /// If the histogram cannot store the latency.
    pub fn note(&mut self, took: Duration) {
        let us = u64::try_from(took.as_micros()).unwrap_or(u64::MAX).max(1);
        self.answered.record(us).expect("a histogram that grows");
    }

    /// Records a refused request.
    pub fn refuse(&mut self) {
        self.refused += 1;
    }

    /// Number of requests.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.answered.len() + self.refused
    }

    /// The quantile `share` of the latencies (ms). Infinite if there are no requests, or if the
    /// quantile falls on a refused request.
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

/// Resources used by a process, as reported by Linux; NaN on other systems.
#[derive(Clone, Copy, Debug)]
pub struct Usage {
    /// CPU time of all threads (s).
    pub cpu_s: f64,
    /// Current and peak memory (MB).
    pub memory_mb: [f64; 2],
}

impl Usage {
    /// Resources used by the process with this id.
    #[must_use]
    pub fn of(process: u32) -> Self {
        /// Unit of CPU times in `/proc`. Linux always uses this value.
        const TICKS_PER_S: f64 = 100.0;
        let read = |name| std::fs::read_to_string(format!("/proc/{process}/{name}"));
        let (stat, status) = (read("stat").unwrap_or_default(), read("status").unwrap_or_default());
        // The program's name, in parentheses, can contain spaces.
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
