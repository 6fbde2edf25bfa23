//! Sizes of a site for a number of participants: `cargo xtask bench capacity`.
//!
//! Simulates the queues of servers and of a database. The service times are measurements by `cargo
//! xtask bench load` on one machine. The first simulated site has the size of that machine, so that
//! the simulation can be compared with the measurements. The benchmark starts no server and is
//! fast.
#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

use clap::Parser;
use sidestep_tests::load::capacity::{STAGES, Shown, Site, Work};
use sidestep_tests::load::figures::row;

/// Simulates servers of other sizes.
#[derive(Parser)]
#[command(name = "cargo xtask bench capacity --")]
struct Options {
    /// Times for SQLite (ms): CPU time of an upload in the server and in the writer, and the time
    /// that a transaction waits for the disk.
    #[arg(long, value_delimiter = ',', num_args = 3, default_values_t = SQLITE)]
    sqlite: Vec<f64>,
    /// The corresponding times for PostgreSQL (ms).
    #[arg(long, value_delimiter = ',', num_args = 3, default_values_t = POSTGRES)]
    postgres: Vec<f64>,
    /// CPU time of an enrolment, as a multiple of the CPU time of an upload.
    #[arg(long, default_value_t = ENROLMENT)]
    enrolment: f64,
    /// Simulated time (s).
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Seed of the arrivals.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[arg(long, hide = true)]
    discard_baseline: bool,
    #[arg(long, hide = true)]
    bench: bool,
}

/// Measured values; see docs/operation.md.
const SQLITE: [f64; 3] = [0.16, 0.09, 1.0];
const POSTGRES: [f64; 3] = [0.44, 0.60, 1.5];
const ENROLMENT: f64 = 11.0;

/// CPU time of a transaction itself (ms).
const TRANSACTION_MS: f64 = 0.1;

/// Trials per participant, one every 12 s.
const TRIALS: f64 = 59.0;

/// 99 % of the trials should be acknowledged within this time (ms).
const WANTED_MS: f64 = 50.0;

/// Maximum utilization of the cores. The rest is reserved for pages, reads and bursts.
const ROOM: f64 = 0.7;

/// The number of servers, the cores of each, and the cores of the database (`None` for SQLite).
const SITES: [(usize, usize, Option<usize>); 8] = [
    (1, 2, None),
    (1, 4, None),
    (1, 8, None),
    (1, 2, Some(2)),
    (2, 2, Some(4)),
    (2, 4, Some(8)),
    (4, 4, Some(16)),
    (4, 8, Some(32)),
];

/// Rates at which participants start, per minute.
const PER_MINUTE: [f64; 4] = [1.0, 100.0, 1_000.0, 10_000.0];

impl Options {
    /// The queues of a site, and the cost of an upload on this site.
    fn site(&self, (servers, cores, database): (usize, usize, Option<usize>)) -> (Site, Work) {
        let of = |figures: &[f64]| {
            let work = Work { server_ms: figures[0], database_ms: figures[1] };
            (work, figures[2])
        };
        match database {
            // The writer is a thread of the server and occupies one of its cores.
            None => {
                let (work, commit_ms) = of(&self.sqlite);
                let site = Site {
                    server_cores: (cores - 1).max(1),
                    writers: 1,
                    batch: 64,
                    database_cores: 1,
                    transaction_ms: TRANSACTION_MS,
                    commit_ms,
                };
                (site, work)
            }
            Some(database_cores) => {
                let (work, commit_ms) = of(&self.postgres);
                let site = Site {
                    server_cores: servers * cores,
                    writers: 3 * servers,
                    batch: 32,
                    database_cores,
                    transaction_ms: TRANSACTION_MS,
                    commit_ms,
                };
                (site, work)
            }
        }
    }

    /// Simulates the site with `per_minute` participants starting per minute.
    fn with(&self, (site, work): (Site, Work), per_minute: f64) -> Shown {
        let [server_ms, database_ms] =
            [work.server_ms, work.database_ms].map(|ms| self.enrolment * ms);
        let per_s = per_minute / 60.0;
        let kinds = [(TRIALS * per_s, work), (per_s, Work { server_ms, database_ms })];
        site.simulate(&kinds, self.seconds, self.seed)
    }
}

fn is_enough(shown: &Shown) -> bool {
    shown.latencies.quantile_ms(0.99) <= WANTED_MS && shown.busy[..2].iter().all(|it| *it <= ROOM)
}

fn main() {
    let options = Options::parse();
    println!(
        "99 of 100 trials are to be acknowledged within {WANTED_MS} ms, with cores busy for at most \
         {:.0} % of the time",
        100.0 * ROOM
    );
    for of in SITES {
        let (servers, cores, database) = of;
        let name = match database {
            None => format!("SQLite, {cores} cores"),
            Some(database) => {
                format!("PostgreSQL, {database} cores; {servers} × {cores} cores")
            }
        };
        println!("\n{name}");
        let site = options.site(of);
        for per_minute in PER_MINUTE {
            let shown = options.with(site, per_minute);
            let [servers, database, writers] = shown.busy.map(|busy| 100.0 * busy);
            let p99_ms = shown.latencies.quantile_ms(0.99);
            let figure = match is_enough(&shown) {
                true => format!("{p99_ms:.1} ms"),
                false => "too much".to_owned(),
            };
            row(
                &format!("  {per_minute} participants a minute"),
                figure,
                format!(
                    "busy: servers {servers:.0} %, database {database:.0} %, writers {writers:.0} %"
                ),
            );
        }
        let (mut enough, mut too_many) = (0.0, 100_000.0);
        while too_many - enough > 0.01 * too_many {
            let between = 0.5 * (enough + too_many);
            match is_enough(&options.with(site, between)) {
                true => enough = between,
                false => too_many = between,
            }
        }
        let full = options.with(site, 1.02 * too_many);
        let first = STAGES.iter().zip(full.busy).find(|(_, busy)| *busy > ROOM);
        let first = first.map_or("wait for the disk", |(stage, _)| stage);
        row(
            "  at most",
            format!("{enough:.0} a minute"),
            format!(
                "{:.0} trials a second; then the {first} becomes too long or too busy",
                enough * TRIALS / 60.0
            ),
        );
    }
}
