//! A server is killed (SIGKILL) while people upload.

use sidestep_tests::load::kills::{Kills, kill};
use sidestep_tests::load::{Crowd, compare};
use sidestep_tests::{Database, Folder};
use tokio::task::LocalSet;

#[tokio::test]
async fn a_server_that_is_killed_keeps_its_word() {
    let folder = Folder::default();
    let database = Database::file(folder.root(), "sidestep.db");
    let kills = Kills { count: 4, most_between: 150, connections: 8, seed: 7 };
    let crowd = Crowd::of(&[]);
    let killing = kill(&crowd, std::slice::from_ref(&folder), &database, kills);
    LocalSet::new().run_until(killing).await;
    assert_eq!(crowd.problems(), [""; 0]);
    let found = compare(&crowd.everybody(), &database).await;
    assert_eq!(found.broken(), 0, "{found:?}");
    assert!(found.acknowledged > 0, "{found:?}");
}
