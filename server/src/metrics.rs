//! The server's metrics, for Prometheus.

use crate::store::Store;
use crate::store::commits::{Commits, SECONDS};
use crate::store::overview::Counts;
use prometheus_client::encoding::{EncodeLabelSet, EncodeLabelValue, text};
use prometheus_client::metrics::counter::{ConstCounter, Counter};
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::{ConstGauge, Gauge};
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};
use sidestep::api::DataCheck;
use std::time::Duration;

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Status {
    status: u16,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Route {
    method: String,
    route: String,
}

/// The label that distinguishes the values of the gauge of waiting writes.
#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Lane {
    lane: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct State {
    state: Word,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, EncodeLabelValue)]
#[allow(non_camel_case_types, reason = "these are the words that Prometheus reads")]
enum Word {
    queued,
    running,
    busy,
    idle,
}

/// Counts and durations of requests, and access to the store's counts and durations of commits.
#[derive(Debug)]
pub struct Metrics {
    requests: Family<Status, Counter>,
    seconds: Family<Route, Histogram, fn() -> Histogram>,
    commits: Commits,
}

impl Metrics {
    /// Metrics without any requests.
    #[must_use]
    pub fn new(store: &Store) -> Self {
        Self {
            requests: Family::default(),
            seconds: Family::new_with_constructor(|| Histogram::new(SECONDS)),
            commits: store.observed().clone(),
        }
    }

    /// Counts a request and its response.
    pub fn answered(&self, method: &str, route: &str, status: u16, took: Duration) {
        self.requests.get_or_create(&Status { status }).inc();
        let route = Route { method: method.to_owned(), route: route.to_owned() };
        self.seconds.get_or_create(&route).observe(took.as_secs_f64());
    }

    /// All metrics in the text format of OpenMetrics, with these counts of the store and of connections.
    ///
    /// # Errors
    /// No cause is known, because writing to a string does not fail.
    pub fn text(
        &self,
        store: &Store,
        counts: Counts,
        connections: usize,
        data_check: &DataCheck,
        writes_backups: bool,
    ) -> Result<String, std::fmt::Error> {
        let mut all = Registry::with_prefix("sidestep");
        all.register("http_requests", "Requests answered since the start", self.requests.clone());
        let seconds = self.seconds.clone();
        let help = "Time from the head of a request to the head of its answer";
        all.register_with_unit("http_request", help, Unit::Seconds, seconds);
        let [writes, seconds] = self.commits.histograms();
        all.register("commit_writes", "Trials and other writes per commit", writes);
        let help = "Duration of a transaction, including the wait for the disk";
        all.register_with_unit("commit", help, Unit::Seconds, seconds);
        let mut gauge = |name: &str, help: &str, value: i64| {
            all.register(name, help, ConstGauge::new(value));
        };
        gauge("participants", "Participants enrolled or imported", counts.participants);
        gauge("trials_stored", "Trials in the database", counts.trials);
        let help = "Trials waiting in the browsers of participants, as last reported";
        gauge("backlog_trials", help, counts.backlog);
        gauge("connections_open", "Open connections", clamped(connections));
        if let Some(free) = store.free_bytes() {
            let free = i64::try_from(free).unwrap_or(i64::MAX);
            gauge("free_bytes", "Free bytes on the disk of the database", free);
        }
        let faults = i64::try_from(data_check.fault_count).unwrap_or(i64::MAX);
        gauge("data_faults", "Faults found by the last check of the stored data", faults);
        let mut time = |name: &str, help: &str, at_ms: Option<i64>| {
            if let Some(at_ms) = at_ms {
                all.register_with_unit(name, help, Unit::Seconds, ConstGauge::new(at_ms / 1000));
            }
        };
        let help = "When the last check of the stored data ended, since 1970";
        time("data_check_timestamp", help, data_check.at_ms);
        // A server that should write backups but has none yet reports 0, which triggers alerts.
        let none_yet = writes_backups.then_some(0);
        let backup_at_ms = data_check.backup.as_ref().map(|backup| backup.at_ms).or(none_yet);
        let help =
            "When the newest backup of this server was written, since 1970; 0 before the first";
        time("backup_timestamp", help, backup_at_ms);
        let waiting = Family::<Lane, Gauge>::default();
        for (lane, count) in ["trial", "request", "background"].into_iter().zip(store.waiting()) {
            waiting.get_or_create(&Lane { lane }).set(clamped(count));
        }
        all.register("store_waiting", "Writes waiting for the database", waiting);
        let by_state = |words: [(Word, i64); 2]| {
            let family = Family::<State, Gauge>::default();
            for (state, count) in words {
                family.get_or_create(&State { state }).set(count);
            }
            family
        };
        let analyses = by_state([(Word::queued, counts.queued), (Word::running, counts.running)]);
        all.register("analyses", "Analyses queued or running", analyses);
        if let Some([busy, idle]) = store.sessions() {
            let sessions = by_state([(Word::busy, clamped(busy)), (Word::idle, clamped(idle))]);
            all.register("database_sessions", "Sessions of this server with PostgreSQL", sessions);
        }
        let mut process = Registry::default();
        if let Some((memory, seconds)) = process_use() {
            let help = "Memory that the server holds, without its analyses";
            process.register("process_resident_memory_bytes", help, ConstGauge::new(memory));
            let help = "Processor time of the server, without its analyses";
            process.register("process_cpu_seconds", help, ConstCounter::new(seconds));
        }
        let mut written = String::new();
        text::encode_registry(&mut written, &all)?;
        text::encode_registry(&mut written, &process)?;
        text::encode_eof(&mut written)?;
        Ok(written)
    }
}

fn clamped(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// The memory of this process (bytes), and the processor time that it has used (s). Returns `None`
/// on systems without `/proc`.
fn process_use() -> Option<(i64, f64)> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: i64 = pages.split(' ').nth(1)?.parse().ok()?;
    let memory = pages * i64::try_from(rustix::param::page_size()).ok()?;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The program's name, in parentheses, can contain spaces.
    let (_, stat) = stat.rsplit_once(") ")?;
    let ticks = stat.split(' ').skip(11).take(2).map(str::parse::<u64>);
    let ticks: u64 = ticks.collect::<Result<Vec<_>, _>>().ok()?.iter().sum();
    Some((memory, ticks as f64 / rustix::param::clock_ticks_per_second() as f64))
}
