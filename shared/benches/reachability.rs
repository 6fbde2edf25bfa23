//! The exact value and the Cartesian solver, each beside its baseline: one state at a
//! time, and one thread. `cargo xtask bench reachability`.
//!
//! Criterion reports every measurement with its spread. The table of ratios at the end is
//! made of the fastest samples of this run, which other work on the machine disturbs least.

#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

use std::hint::black_box;
use std::ops::ControlFlow;
use std::thread;
use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, SamplingMode, Throughput};
use sidestep::math::TAU;
use sidestep::reachability::cartesian::{
    Direction, Horizon, Kind, Problem, Region, Settings, solve,
};
use sidestep::reachability::{Axis, ExactValue, Grid, Player, PursuitGame, RelativeDubins, Scheme};

/// What is compared: measurement and baseline. More than 1 means faster than the baseline.
const RATIOS: &[(&str, &str)] = &[
    ("exact/batch, 1 thread", "exact/scalar"),
    ("exact/batch, 2 threads", "exact/scalar"),
    ("exact/batch, 2 threads", "exact/batch, 1 thread"),
    ("cartesian/eno2, 2 threads", "cartesian/eno2, 1 thread"),
    ("cartesian/weno5, 2 threads", "cartesian/weno5, 1 thread"),
];

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut fastest = Fastest::default();
    exact(&mut criterion, &mut fastest);
    cartesian(&mut criterion, &mut fastest);
    criterion.final_summary();
    fastest.print_ratios();
}

/// The closed form at every node of a 61×61×48 grid.
fn exact(criterion: &mut Criterion, fastest: &mut Fastest) {
    let game = ExactValue::new(2.0, 0.5, 3.0).expect("the paper's parameters are valid");
    let [x, y] = [Axis::bounded(-30.0, 30.0, 61); 2];
    let grid = Grid { axes: [x, y, Axis::periodic(0.0, TAU, 48)] };
    let states: Vec<_> = (0..grid.len()).map(|i| grid.node(grid.index(i))).collect();
    let mut out = vec![0.0; states.len()];

    let mut group = criterion.benchmark_group("exact");
    group.sample_size(20).throughput(Throughput::Elements(states.len() as u64));
    fastest.measure(&mut group, "exact/scalar", states.len(), || {
        for state in &states {
            black_box(game.value(*black_box(state)));
        }
    });
    for (name, threads) in [("exact/batch, 1 thread", 1), ("exact/batch, 2 threads", 2)] {
        fastest.measure(&mut group, name, states.len(), || {
            evaluate(&game, black_box(&states), &mut out, threads);
            black_box(&out);
        });
    }
    group.finish();
}

/// The values of `states` on so many threads.
fn evaluate(game: &ExactValue, states: &[[f64; 3]], out: &mut [f64], threads: usize) {
    let share = states.len().div_ceil(threads);
    let fill = |states: &[[f64; 3]], out: &mut [f64]| {
        game.values_into(states, out).expect("the states are finite and the lengths agree");
    };
    if threads == 1 {
        return fill(states, out);
    }
    thread::scope(|scope| {
        for (states, out) in states.chunks(share).zip(out.chunks_mut(share)) {
            scope.spawn(move || fill(states, out));
        }
    });
}

/// Mitchell's game on 51×40×50 nodes over 2.8 s.
fn cartesian(criterion: &mut Criterion, fastest: &mut Fastest) {
    let player = Player { speed_mps: 5.0, turn_rate_radps: 1.0 };
    let game = PursuitGame { evader: player, pursuer: player, radius_m: 5.0 };
    let target = |state| game.target(state);
    let axes = [
        Axis::bounded(-6.0, 20.0, 51),
        Axis::bounded(-10.0, 10.0, 40),
        Axis::periodic(0.0, TAU, 50),
    ];
    let problem = Problem {
        game: &RelativeDubins(game),
        grid: Grid { axes },
        target: Region::Static(&target),
        obstacle: None,
        kind: Kind::Tube,
        direction: Direction::Backward,
        horizon: Horizon::Finite(2.8),
    };

    let mut group = criterion.benchmark_group("cartesian");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(500));
    for (name, scheme, threads) in [
        ("cartesian/eno2, 1 thread", Scheme::Eno2, 1),
        ("cartesian/eno2, 2 threads", Scheme::Eno2, 2),
        ("cartesian/weno5, 1 thread", Scheme::Weno5, 1),
        ("cartesian/weno5, 2 threads", Scheme::Weno5, 2),
    ] {
        let settings = Settings { threads, cfl: 0.75, ..Settings::of(scheme) };
        fastest.measure(&mut group, name, 1, || {
            let solution =
                solve::<f32, 3, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()));
            black_box(solution.expect("the problem is valid and nobody cancels"));
        });
    }
    group.finish();
}

/// The fastest sample of each measurement of this run.
#[derive(Default)]
struct Fastest(Vec<Sample>);

struct Sample {
    name: &'static str,
    /// What one call works on: states, or 1 for a solve.
    items: usize,
    /// Of one call, s.
    seconds: f64,
}

impl Fastest {
    /// Measures `work`, called `group/name`, under its name without the group's.
    fn measure(
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
        // A filter on the command line may have left it out.
        if seconds.is_finite() {
            self.0.push(Sample { name, items, seconds });
        }
    }

    fn of(&self, name: &str) -> Option<&Sample> {
        self.0.iter().find(|sample| sample.name == name)
    }

    fn print_ratios(&self) {
        println!("\n{:30} {:>16}   {:26} {:>6}", "fastest sample", "time", "baseline", "ratio");
        for (name, baseline) in RATIOS {
            if let (Some(sample), Some(base)) = (self.of(name), self.of(baseline)) {
                let ratio = base.seconds / sample.seconds;
                println!("{name:30} {:>16}   {baseline:26} {ratio:6.2}", sample.time());
            }
        }
        for sample in &self.0 {
            if RATIOS.iter().all(|(name, _)| *name != sample.name) {
                println!("{:30} {:>16}", sample.name, sample.time());
            }
        }
    }
}

impl Sample {
    fn time(&self) -> String {
        if self.items > 1 {
            return format!("{:.1} ns/state", 1e9 * self.seconds / self.items as f64);
        }
        format!("{:.1} ms", 1e3 * self.seconds)
    }
}
