//! Configurations to measure: a database and one or more servers.

use std::rc::Rc;

use sidestep_tests::load::{Comparison, Crowd, Usage, compare};
use sidestep_tests::postgres::{Cluster, Fsync};
use sidestep_tests::{Database, Folder, Process};

/// One or more servers on a database: one line of the table.
pub(crate) struct Subject {
    pub(crate) name: &'static str,
    kind: Kind,
    servers: usize,
    /// Target (uploads per second).
    least_per_s: f64,
}

#[derive(Clone, Copy)]
enum Kind {
    Sqlite,
    Postgres,
}

/// All configurations.
pub(crate) const SUBJECTS: &[Subject] = &[
    Subject { name: "sqlite", kind: Kind::Sqlite, servers: 1, least_per_s: 3_000.0 },
    Subject { name: "postgres-1-server", kind: Kind::Postgres, servers: 1, least_per_s: 2_000.0 },
    Subject { name: "postgres-2-servers", kind: Kind::Postgres, servers: 2, least_per_s: 2_000.0 },
    Subject { name: "postgres-3-servers", kind: Kind::Postgres, servers: 3, least_per_s: 2_000.0 },
];

/// Servers under load.
pub(crate) struct Under {
    pub(crate) crowd: Rc<Crowd>,
    pub(crate) least_per_s: f64,
    servers: Vec<Process>,
    database: Database,
    // Dropped last, because fields are dropped in order.
    _cluster: Option<Cluster>,
    _folders: Vec<Folder>,
}

impl Subject {
    /// Creates a database. For PostgreSQL, also returns its cluster.
    pub(crate) fn database(&self, folder: &Folder, file: &str) -> (Database, Option<Cluster>) {
        match self.kind {
            Kind::Sqlite => (Database::file(folder.root(), file), None),
            Kind::Postgres => {
                // Every commit waits for the disk, as in production.
                let cluster = Cluster::start(Fsync::On);
                (cluster.create(), Some(cluster))
            }
        }
    }

    /// Whether a single server uses the database.
    pub(crate) fn is_alone(&self) -> bool {
        self.servers == 1
    }

    /// Starts the servers on a new database in a folder. The error is the last line of the log of a
    /// server that did not start.
    pub(crate) async fn start(&self, folder: &Folder) -> Result<Under, String> {
        let (database, cluster) = self.database(folder, "load.db");
        let folders: Vec<Folder> = (0..self.servers).map(|_| Folder::default()).collect();
        let mut servers = Vec::new();
        for folder in &folders {
            let started = Process::try_start_on(folder, &database).await;
            servers.push(started.map_err(|log| log.lines().last().unwrap_or_default().to_owned())?);
        }
        let addresses: Vec<_> = servers.iter().map(|server| &**server).collect();
        Ok(Under {
            crowd: Crowd::of(&addresses),
            least_per_s: self.least_per_s,
            servers,
            database,
            _cluster: cluster,
            _folders: folders,
        })
    }
}

impl Under {
    /// Resources used by all servers together.
    pub(crate) fn usage(&self) -> Usage {
        let all = self.servers.iter().map(|server| Usage::of(server.id()));
        let none = Usage { cpu_s: 0.0, memory_mb: [0.0; 2] };
        all.fold(none, |sum, one| Usage {
            cpu_s: sum.cpu_s + one.cpu_s,
            memory_mb: [0, 1].map(|i| sum.memory_mb[i] + one.memory_mb[i]),
        })
    }

    /// Kills the servers, which need no clean shutdown, and compares the database with the
    /// acknowledged uploads.
    pub(crate) async fn compared(self) -> Comparison {
        for server in self.servers {
            server.kill().await;
        }
        compare(&self.crowd.everybody(), &self.database).await
    }
}
