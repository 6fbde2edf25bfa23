//! Compares the fastest sample of each benchmark with its baseline and budget.

#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

use std::time::Instant;

use criterion::BenchmarkGroup;
use criterion::measurement::WallTime;

/// The fastest sample of each measurement of this run.
#[derive(Default)]
pub(crate) struct Fastest(Vec<Sample>);

struct Sample {
    name: &'static str,
    /// Number of items per call: states, or 1 for a solve.
    items: usize,
    /// Time per call (s).
    seconds: f64,
}

impl Fastest {
    /// Measures `work`. Criterion prints the part of `name` after the slash, because it prints the
    /// name of the group itself.
    pub(crate) fn measure(
        &mut self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        name: &'static str,
        items: usize,
        mut work: impl FnMut(),
    ) {
        let short = name.split_once('/').map_or(name, |(_, short)| short);
        let mut seconds = f64::INFINITY;
        group.bench_function(short, |bencher| {
            bencher.iter_custom(|calls| {
                let start = Instant::now();
                for _ in 0..calls {
                    work();
                }
                let took = start.elapsed();
                seconds = seconds.min(took.as_secs_f64() / calls as f64);
                took
            });
        });
        // A filter on the command line may have skipped this measurement.
        if seconds.is_finite() {
            self.0.push(Sample { name, items, seconds });
        }
    }

    fn of(&self, name: &str) -> Option<&Sample> {
        self.0.iter().find(|sample| sample.name == name)
    }

    /// Prints a table of all measurements. `budgets` are the maximum times per item (s), and
    /// `ratios` are pairs of a measurement and its baseline. A ratio above 1 means that the
    /// measurement is faster than its baseline.
    pub(crate) fn print_ratios(&self, ratios: &[(&str, &str)], budgets: &[(&str, f64)]) {
        let head = ["fastest sample", "time", "budget", "baseline", "ratio"];
        println!(
            "\n{:28} {:>12} {:>18}   {:26} {:>6}",
            head[0], head[1], head[2], head[3], head[4]
        );
        for sample in &self.0 {
            let budget = budgets.iter().find(|(name, _)| *name == sample.name);
            let budget = budget.map_or_else(String::new, |(_, limit)| {
                let verdict = if sample.each() <= *limit { "met" } else { "MISSED" };
                format!("{} {verdict}", time(*limit))
            });
            let bases = ratios.iter().filter(|(name, _)| *name == sample.name);
            let mut ratios: Vec<String> = bases
                .filter_map(|(_, base)| self.of(base))
                .map(|base| format!("{:26} {:6.2}", base.name, base.each() / sample.each()))
                .collect();
            if ratios.is_empty() {
                ratios.push(String::new());
            }
            for ratio in ratios {
                println!("{:28} {:>12} {budget:>18}   {ratio}", sample.name, time(sample.each()));
            }
        }
    }
}

impl Sample {
    /// Time per item (s).
    fn each(&self) -> f64 {
        self.seconds / self.items as f64
    }
}

fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1e-6 => format!("{:.1} ns", 1e9 * s),
        s if s < 1e-3 => format!("{:.1} µs", 1e6 * s),
        s => format!("{:.1} ms", 1e3 * s),
    }
}
