//! The PostgreSQL cluster that tests create for themselves.

use sidestep_tests::postgres::{Cluster, Fsync, Stop};

#[tokio::test]
async fn a_cluster_survives_what_is_done_to_it() {
    let mut cluster = Cluster::new(Fsync::On).await;
    let [database, other] = [cluster.create(), cluster.create()];
    assert_ne!(database.url(), other.url());
    let made = "CREATE TABLE kept (id bigint, name text, bytes bytea, x double precision)";
    database.change(made).await;
    let filled =
        r"INSERT INTO kept VALUES (7, 'a b', '\x00ff', 1760000000123.25), (8, NULL, NULL, -0.5)";
    database.change(filled).await;
    for stop in [Stop::Fast, Stop::Immediate, Stop::Kill] {
        cluster.stop(stop);
        cluster.start_again();
        let mut rows = Vec::new();
        let query = "SELECT id, name, bytes, x FROM kept ORDER BY id";
        database.each_row(query, |row| rows.push(row.join("|"))).await;
        assert_eq!(rows, ["7|a b|00ff|1760000000123.25", "8|||-0.5"]);
    }
    let tables = "SELECT count(*) FROM pg_tables WHERE schemaname = 'public'";
    assert_eq!(other.number(tables).await, 0);
    let folder = cluster.folder().to_owned();
    drop(cluster);
    assert!(!folder.exists());
}
