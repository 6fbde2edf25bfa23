//! The PostgreSQL server that tests start for themselves.

use sidestep_tests::postgres::{Cluster, Fsync, Stop};

#[test]
fn a_cluster_survives_what_is_done_to_it() {
    let mut cluster = Cluster::start(Fsync::On);
    let [database, other] = [cluster.create(), cluster.create()];
    assert_ne!(database.url(), other.url());
    database.change("CREATE TABLE kept (id bigint, name text, bytes bytea, x double precision)");
    database.change(
        r"INSERT INTO kept VALUES (7, 'a b', '\x00ff', 1760000000123.25), (8, NULL, NULL, -0.5)",
    );
    for stop in [Stop::Fast, Stop::Immediate, Stop::Kill] {
        cluster.stop(stop);
        cluster.start_again();
        let mut rows = Vec::new();
        database.each_row("SELECT id, name, bytes, x FROM kept ORDER BY id", |row| {
            rows.push(row.join("|"));
        });
        assert_eq!(rows, ["7|a b|00ff|1760000000123.25", "8|||-0.5"]);
    }
    assert_eq!(other.number("SELECT count(*) FROM pg_tables WHERE schemaname = 'public'"), 0);
    let folder = cluster.folder().to_owned();
    drop(cluster);
    assert!(!folder.exists());
}
