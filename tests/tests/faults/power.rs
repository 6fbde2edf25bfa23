//! Power cuts, simulated from SQLite's recorded writes and syncs.

use sidestep_tests::load::Usage;
use sidestep_tests::power::Disk;
use sidestep_tests::power::cuts::Session;
use sidestep_tests::{Database, Process};

/// Cuts the power at random points of one session with enrolments, uploads and a deletion. After
/// the deletion, the log is written back.
#[tokio::test]
async fn what_was_acknowledged_survives_a_power_cut() {
    let mut recorded = Session { people: 3, trials: 12, seed: 11 }.record().await;
    let (first, last) = recorded.moments();
    assert!(last > first);
    for cut in 0..60 {
        // The first cut is at the last point, when everything was acknowledged.
        let moment = if cut == 0 { last } else { recorded.any_moment() };
        let (found, folder) = recorded.cut(moment, Disk::Honest).await.unwrap();
        assert_eq!(found.broken(), 0, "at {moment} of {last}: {found:?}");
        if cut % 20 == 0 {
            let database = Database::file(folder.root(), "sidestep.db");
            let server = Process::start_on(&folder, &database).await;
            // Limit the CPU time, because the wall-clock time would depend on the load of the
            // machine.
            assert!(Usage::of(server.id()).cpu_s < 2.0);
            assert_eq!(server.get("/readyz").await.status, 200);
        }
    }
    // On a disk that ignores syncs of the log, acknowledged trials are lost. This shows that the
    // comparison would detect a server that does not sync.
    let mut lost = 0;
    for _ in 0..40 {
        let moment = recorded.any_moment();
        lost += usize::from(recorded.cut(moment, Disk::Lying).await.is_ok_and(|(f, _)| f.lost > 0));
    }
    assert!(lost > 0);
}
