//! Figures, and how they are printed.

use std::fmt::Display;

/// A line of the table: name, figure, and what is said of it.
pub(crate) fn row(name: &str, figure: impl Display, said: impl Display) {
    println!("{name:36} {:>22}   {said}", figure.to_string());
}

/// A rate as a multiple of another.
pub(crate) fn versus(rate: f64, baseline: f64) -> String {
    format!("{:.2}×", rate / baseline)
}

/// A figure against its target.
pub(crate) struct Verdict(String);

impl Verdict {
    pub(crate) fn at_least(figure: f64, target: f64, unit: &str) -> Self {
        Self::of(figure >= target, format!("≥ {target}{unit}"))
    }

    pub(crate) fn at_most(figure: f64, target: f64, unit: &str) -> Self {
        Self::of(figure <= target, format!("≤ {target}{unit}"))
    }

    fn of(met: bool, target: String) -> Self {
        Self(format!("{target} {}", if met { "met" } else { "MISSED" }))
    }

    /// The same with something said after it.
    pub(crate) fn and(self, more: &str) -> Self {
        Self(format!("{}; {more}", self.0))
    }
}

impl Display for Verdict {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.0)
    }
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

    pub(crate) fn p99(&self) -> String {
        format!("{:.1} ms", self.p99_ms())
    }

    pub(crate) fn shown(&self) -> String {
        let [least, half, most] = [0.0, 0.5, 1.0].map(|share| self.quantile(share));
        format!("{least:.1} / {half:.1} / {:.1} / {most:.1} ms (0, 50, 99, 100 %)", self.p99_ms())
    }
}
