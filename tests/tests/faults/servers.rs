//! Faults of a PostgreSQL database while one or two servers store trials in it.
//!
//! Clients retry after a 503. In the end, every acknowledged trial is stored exactly once, and the
//! database is sound.

use sidestep_tests::front::free_port;
use sidestep_tests::postgres::{Cluster, Stop};
use sidestep_tests::{Database, Driver, Folder, Process, driven, run};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::time::sleep;

/// The database role of the servers. It is not a superuser, because limits do not apply to
/// superusers.
const ROLE: &str = "sidestep";

/// Duration of a fault.
const LASTS: Duration = Duration::from_millis(700);

/// Timeout for storing a trial despite the fault.
const PATIENCE: Duration = Duration::from_secs(300);

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Kill,
    StopFast,
    StopImmediate,
    EndSessions,
    LockTable,
    StatementTimeout,
    ConnectionLimit,
    Revoke,
    ReadOnly,
    LostStandby,
    FailoverAndReturn,
}

const FAULTS: [(Fault, &str); 11] = [
    (Fault::Kill, "the database is killed and started again"),
    (Fault::StopFast, "it is stopped (fast) and started again"),
    (Fault::StopImmediate, "it is stopped (immediate) and started again"),
    (Fault::EndSessions, "all sessions are ended"),
    (Fault::LockTable, "another session locks the table of trials"),
    (Fault::StatementTimeout, "`statement_timeout` is 1 ms"),
    (Fault::ConnectionLimit, "the database takes one session"),
    (Fault::Revoke, "the rights to store are revoked"),
    (Fault::ReadOnly, "transactions only read by default"),
    (Fault::LostStandby, "the standby is gone, for which commits wait"),
    (Fault::FailoverAndReturn, "the standby takes over, and the old primary comes back"),
];

/// A primary, its standby if the fault needs one, and the name and address of the database.
struct Site {
    primary: Cluster,
    standby: Option<Cluster>,
    name: String,
    url: String,
}

impl Site {
    fn new(fault: Fault) -> Self {
        let ports = [free_port(), free_port()];
        let primary = Cluster::at_port(ports[0]);
        let has_standby = matches!(fault, Fault::LostStandby | Fault::FailoverAndReturn);
        let standby = has_standby.then(|| primary.standby(ports[1]));
        let url = primary.create().url();
        let name = url.split(['/', '?']).nth(3).unwrap().to_owned();
        let hosts = if has_standby { &ports[..] } else { &ports[..1] };
        let hosts: Vec<_> = hosts.iter().map(|port| format!("127.0.0.1:{port}")).collect();
        let url = format!("postgres://{ROLE}@{}/{name}", hosts.join(","));
        Self { primary, standby, name, url }
    }

    /// The database on the current primary, accessed as superuser.
    fn database(&self, fault: Fault) -> Database {
        let now = match &self.standby {
            Some(standby) if fault == Fault::FailoverAndReturn => standby,
            _ => &self.primary,
        };
        Database::Postgres(now.url(&self.name))
    }

    /// Runs statements as superuser in the database `postgres`, whose settings do not change.
    async fn order(&self, statements: &str) {
        Database::Postgres(self.primary.url("postgres")).change(statements).await;
    }

    /// Like [`Self::order`], but also ends the sessions of the servers, because the sessions can
    /// still use the earlier settings.
    async fn set(&self, statement: &str) {
        self.order(statement).await;
        self.order(&format!(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = '{ROLE}'"
        ))
        .await;
    }

    async fn restart(&mut self, stop: Stop) {
        self.primary.stop(stop);
        sleep(LASTS).await;
        tokio::task::block_in_place(|| self.primary.start_again());
    }

    /// Causes the fault, and then undoes it.
    async fn suffer(&mut self, fault: Fault) {
        let name = self.name.clone();
        let own = Database::Postgres(self.primary.url(&name));
        match fault {
            Fault::Kill => self.restart(Stop::Kill).await,
            Fault::StopFast => self.restart(Stop::Fast).await,
            Fault::StopImmediate => self.restart(Stop::Immediate).await,
            Fault::EndSessions => {
                for _ in 0..3 {
                    self.set("SELECT 1").await;
                    sleep(LASTS / 3).await;
                }
            }
            Fault::LockTable => {
                let lock = format!("LOCK TABLE trial; SELECT pg_sleep({})", LASTS.as_secs_f64());
                own.change(&lock).await;
            }
            Fault::StatementTimeout => {
                self.set(&format!("ALTER DATABASE {name} SET statement_timeout = 1")).await;
                sleep(LASTS).await;
                self.set(&format!("ALTER DATABASE {name} RESET statement_timeout")).await;
            }
            Fault::ConnectionLimit => {
                self.set(&format!("ALTER DATABASE {name} CONNECTION LIMIT 1")).await;
                sleep(LASTS).await;
                self.set(&format!("ALTER DATABASE {name} CONNECTION LIMIT -1")).await;
            }
            Fault::Revoke => {
                let all = "ALL TABLES IN SCHEMA public";
                own.change(&format!("REVOKE INSERT, UPDATE ON {all} FROM {ROLE}")).await;
                sleep(LASTS).await;
                own.change(&format!("GRANT INSERT, UPDATE ON {all} TO {ROLE}")).await;
            }
            Fault::ReadOnly => {
                let setting = "default_transaction_read_only";
                self.set(&format!("ALTER DATABASE {name} SET {setting} = on")).await;
                sleep(LASTS).await;
                self.set(&format!("ALTER DATABASE {name} RESET {setting}")).await;
            }
            Fault::LostStandby => {
                let standby = self.standby.as_mut().unwrap();
                standby.stop(Stop::Kill);
                sleep(LASTS).await;
                tokio::task::block_in_place(|| standby.start_again());
            }
            Fault::FailoverAndReturn => {
                self.primary.stop(Stop::Kill);
                sleep(LASTS).await;
                let standby = self.standby.as_ref().unwrap();
                standby.promote();
                // The old primary is not fenced, and does not wait for a standby.
                self.primary.settings.push("synchronous_standby_names=".to_owned());
                tokio::task::block_in_place(|| self.primary.start_again());
                let sessions = format!(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = '{ROLE}'"
                );
                Database::Postgres(standby.url("postgres")).change(&sessions).await;
            }
        }
    }
}

/// Runs a case. Returns whether requests were refused, and the number of trials.
async fn case(fault: Fault, servers: usize) -> String {
    let mut site = tokio::task::block_in_place(|| Site::new(fault));
    let owned = format!("CREATE ROLE {ROLE} LOGIN; ALTER DATABASE {} OWNER TO {ROLE}", site.name);
    site.order(&owned).await;
    let database = Database::Postgres(site.url.clone());
    let mut running = Vec::new();
    for _ in 0..servers {
        let folder = Folder::default();
        running.push((Process::start_on(&folder, &database).await, folder));
    }
    let mut people = Vec::new();
    for at in 0..4 {
        people.push(Driver::enrol(&running[at % servers].0).await);
    }
    let (stored, refused) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let send = async |at: usize| {
        let (driver, mut sent) = (&people[at], Vec::new());
        for (turn, (id, scene)) in driver.scenes().into_iter().take(12).enumerate() {
            let trial = driven(&scene);
            let begun = Instant::now();
            loop {
                let answer = driver.send(&running[(at + turn) % servers].0, &id, &trial).await;
                match answer.status {
                    // 200 means that an earlier request was stored, but its response was lost.
                    200 | 201 => break,
                    503 => drop(refused.fetch_add(1, Ordering::Relaxed)),
                    _ => panic!("{fault:?}, {servers}: {} {}", answer.status, answer.body),
                }
                assert!(begun.elapsed() < PATIENCE, "{fault:?}, {servers}: {}", answer.body);
                sleep(Duration::from_millis(50)).await;
            }
            stored.fetch_add(1, Ordering::Relaxed);
            sent.push(id);
            sleep(Duration::from_millis(60)).await;
        }
        sent
    };
    let fault_beside = async {
        while stored.load(Ordering::Relaxed) < 4 {
            sleep(Duration::from_millis(10)).await;
        }
        site.suffer(fault).await;
    };
    let (a, b, c, d, ()) = tokio::join!(send(0), send(1), send(2), send(3), fault_beside);
    let acknowledged: Vec<String> = [a, b, c, d].concat();

    let database = site.database(fault);
    let mut rows: BTreeMap<String, usize> = BTreeMap::new();
    let query = "SELECT trial_id FROM trial";
    database.each_row(query, |row| *rows.entry(row[0].to_owned()).or_default() += 1).await;
    assert_eq!(rows.len(), acknowledged.len(), "{fault:?}, {servers}");
    assert!(acknowledged.iter().all(|id| rows.get(id) == Some(&1)), "{fault:?}, {servers}");
    for (server, _) in running {
        assert_eq!(server.get("/readyz").await.status, 200, "{fault:?}, {servers}");
        server.stop().await;
    }
    let check = run(&["check", "--database", &database.url()]).await;
    assert_eq!(check.json()["trials"], acknowledged.len(), "{fault:?}, {servers}");
    let requests = if refused.into_inner() == 0 { "none" } else { "some" };
    format!("{requests} refused; all {} are stored once", rows.len())
}

/// Runs all faults with this number of servers, and prints a table.
async fn all(servers: usize) {
    let mut table = String::new();
    for (fault, words) in FAULTS {
        let found = case(fault, servers).await;
        writeln!(table, "| {words} | {servers} | {found} |").unwrap();
    }
    eprintln!("| what is done | servers | trials |\n|---|---|---|\n{table}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whatever_is_done_to_postgresql_one_server_stores_everything_once() {
    all(1).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whatever_is_done_to_postgresql_two_servers_store_everything_once() {
    all(2).await;
}
