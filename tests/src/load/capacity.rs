//! A queueing simulation that estimates the capacity of sites on machines that are not available.
//!
//! Operations arrive as a Poisson process. Each operation first occupies a core of a server and
//! then waits for a writer. A free writer takes the waiting operations, up to a batch. It processes
//! the batch on a core of the database, waits for the disk, and answers all operations. Service
//! times were measured on one machine. They are constant in the simulation, so the tails of the
//! latencies come from queueing alone.

use super::figures::Latencies;
use sidestep::math::SeededRng;
use std::time::Duration;

/// Cost of an operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// CPU time on a server (ms).
    pub server_ms: f64,
    /// CPU time in the database (ms).
    pub database_ms: f64,
}

/// Servers and a database.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Number of cores of all servers together.
    pub server_cores: usize,
    /// Number of concurrent transactions.
    pub writers: usize,
    /// Maximum number of operations per transaction.
    pub batch: usize,
    /// Number of cores of the database.
    pub database_cores: usize,
    /// CPU time of a transaction in the database without its operations (ms).
    pub transaction_ms: f64,
    /// Time that a transaction waits for the disk (ms).
    pub commit_ms: f64,
}

/// Result of a simulation.
#[derive(Debug)]
pub struct Shown {
    /// Latencies of all operations, from arrival to answer.
    pub latencies: Latencies,
    /// Utilization of the servers' cores, the database's cores and the writers. Above 1, the queue
    /// grows without bound.
    pub busy: [f64; 3],
}

/// Names of the stages of work.
pub const STAGES: [&str; 2] = ["work of the servers", "work of the database"];

/// The times at which each of several cores or writers becomes free (s).
struct Free(Vec<f64>);

impl Free {
    fn new(count: usize) -> Self {
        Self(vec![0.0; count.max(1)])
    }

    /// The earliest time at which a core or writer is free (s).
    fn at_s(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Occupies the core or writer that is free first, until this time (s).
    fn hold(&mut self, until_s: f64) {
        if let Some(first) = self.0.iter_mut().min_by(|a, b| a.total_cmp(b)) {
            *first = until_s;
        }
    }
}

impl Site {
    /// Simulates arrivals of each kind of operation at its rate per second (> 0), for this number
    /// of seconds.
    #[must_use]
    pub fn simulate(&self, kinds: &[(f64, Work)], seconds: f64, seed: u64) -> Shown {
        let mut rng = SeededRng::new(seed);
        // Arrival time (s) and work of each operation.
        let mut arrivals: Vec<(f64, Work)> = Vec::new();
        for &(per_s, work) in kinds {
            let mut next_s = || -(1.0 - rng.unit()).ln() / per_s;
            let mut at_s = next_s();
            while at_s < seconds {
                arrivals.push((at_s, work));
                at_s += next_s();
            }
        }
        arrivals.sort_by(|a, b| a.0.total_cmp(&b.0));

        let mut busy_s = [0.0; 3];
        let mut cores = Free::new(self.server_cores);
        // Time at which the operation leaves the server (s), its arrival time (s), and its work in
        // the database (s).
        let mut ready: Vec<(f64, f64, f64)> = Vec::with_capacity(arrivals.len());
        for (arrived_s, work) in arrivals {
            let ends_s = arrived_s.max(cores.at_s()) + work.server_ms / 1e3;
            cores.hold(ends_s);
            busy_s[0] += work.server_ms / 1e3;
            ready.push((ends_s, arrived_s, work.database_ms / 1e3));
        }
        ready.sort_by(|a, b| a.0.total_cmp(&b.0));

        let mut latencies = Latencies::default();
        let (mut writers, mut cores) = (Free::new(self.writers), Free::new(self.database_cores));
        let mut waiting = ready.as_slice();
        while let [(first_s, ..), ..] = waiting {
            let begins_s = writers.at_s().max(*first_s);
            let there = waiting.partition_point(|(ready_s, ..)| *ready_s <= begins_s);
            let (batch, others) = waiting.split_at(there.min(self.batch.max(1)));
            waiting = others;
            let work_s =
                self.transaction_ms / 1e3 + batch.iter().map(|(.., work_s)| work_s).sum::<f64>();
            let stored_s = begins_s.max(cores.at_s()) + work_s;
            cores.hold(stored_s);
            let ends_s = stored_s + self.commit_ms / 1e3;
            writers.hold(ends_s);
            busy_s[1] += work_s;
            busy_s[2] += ends_s - begins_s;
            for (_, arrived_s, _) in batch {
                latencies.note(Duration::from_secs_f64(ends_s - arrived_s));
            }
        }
        let of = [self.server_cores, self.database_cores, self.writers];
        let busy = std::array::from_fn(|stage| busy_s[stage] / seconds / of[stage].max(1) as f64);
        Shown { latencies, busy }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Work = Work { server_ms: 0.0, database_ms: 0.0 };

    /// A site where only the work of the servers takes time.
    fn servers(server_cores: usize) -> Site {
        Site {
            server_cores,
            writers: 1,
            batch: usize::MAX,
            database_cores: 1,
            transaction_ms: 0.0,
            commit_ms: 0.0,
        }
    }

    fn mean_ms(latencies: &Latencies) -> f64 {
        let shares: Vec<f64> = (1..1000).map(|i| f64::from(i) / 1000.0).collect();
        shares.iter().map(|share| latencies.quantile_ms(*share)).sum::<f64>() / shares.len() as f64
    }

    #[test]
    fn one_core_is_the_queue_of_pollaczek_and_khinchine() {
        let work = Work { server_ms: 1.0, ..NOTHING };
        for busy in [0.3, 0.6, 0.8] {
            let shown = servers(1).simulate(&[(1e3 * busy, work)], 400.0, 7);
            // For M/D/1, the mean wait is ρ/(2(1 − ρ)) service times.
            let expected_ms = 1.0 + busy / (2.0 * (1.0 - busy));
            let found_ms = mean_ms(&shown.latencies);
            assert!((found_ms / expected_ms - 1.0).abs() < 0.03, "{found_ms} for {expected_ms}");
            assert!((shown.busy[0] - busy).abs() < 0.01);
        }
    }

    #[test]
    fn a_writer_alone_that_takes_one_at_a_time_is_the_same_queue() {
        let work = Work { database_ms: 0.25, ..NOTHING };
        let site =
            Site { batch: 1, transaction_ms: 0.25, commit_ms: 0.5, server_cores: 1, ..servers(1) };
        let shown = site.simulate(&[(600.0, work)], 400.0, 3);
        let expected_ms = 1.0 + 0.6 / (2.0 * 0.4);
        assert!((mean_ms(&shown.latencies) / expected_ms - 1.0).abs() < 0.03);
        assert!((shown.busy[2] - 0.6).abs() < 0.01 && (shown.busy[1] - 0.3).abs() < 0.01);
    }

    #[test]
    fn a_batch_shares_the_wait_for_the_disk() {
        let (work, per_s) = (Work { database_ms: 0.01, ..NOTHING }, 2_000.0);
        let alone = Site { batch: 1, commit_ms: 2.0, ..servers(1) };
        let together = Site { batch: 64, ..alone };
        assert!(alone.simulate(&[(per_s, work)], 10.0, 1).busy[2] > 3.0, "it piles up");
        let shown = together.simulate(&[(per_s, work)], 10.0, 1);
        // An operation waits for at most the current batch and its own batch.
        assert!(shown.latencies.quantile_ms(1.0) < 2.0 * (2.0 + 64.0 * 0.01));
    }

    #[test]
    fn the_same_seed_shows_the_same() {
        let work = Work { server_ms: 0.2, database_ms: 0.1 };
        let site = Site { writers: 4, batch: 16, commit_ms: 1.0, ..servers(2) };
        let shown = |seed| site.simulate(&[(3_000.0, work), (20.0, work)], 5.0, seed);
        assert_eq!(shown(5).busy, shown(5).busy);
        assert_ne!(shown(5).busy, shown(6).busy);
    }
}
