//! The load harness detects the faults that it is meant to detect.

use sidestep_tests::load::crowd::Pace;
use sidestep_tests::load::natural::Habits;
use sidestep_tests::load::{Comparison, Crowd, compare};
use sidestep_tests::{Database, Folder, Process};
use tokio::task::LocalSet;

#[tokio::test]
async fn a_lost_a_changed_and_a_doubled_trial_are_noticed() {
    let folder = Folder::default();
    let database = Database::file(folder.root(), "sidestep.db");
    let server = Process::start_on(&folder, &database).await;
    let crowd = Crowd::of(&[&server]);
    LocalSet::new()
        .run_until(async {
            crowd.enrol(4, 2, 60.0).await;
            let upload = crowd.upload(4, 60.0, Pace::Fast);
            let enough = async {
                crowd.until_acknowledged(20).await;
                crowd.stop();
            };
            tokio::join!(upload, enough);
        })
        .await;
    server.kill().await;
    let people = crowd.everybody();
    let sound = compare(&people, &database).await;
    assert!(sound.acknowledged >= 20, "{sound:?}");
    assert_eq!(sound, Comparison { acknowledged: sound.acknowledged, ..Comparison::default() });
    // Overwrite the states of one trial, give another trial a start time that then occurs twice,
    // and delete a row.
    let third = "(SELECT sequence FROM trial ORDER BY sequence LIMIT 1 OFFSET 2)";
    let change = format!(
        "UPDATE trial SET states = zeroblob(length(states)) WHERE sequence = {third}; \
         UPDATE trial SET started_at_ms = (SELECT max(started_at_ms) FROM trial) \
         WHERE sequence = (SELECT min(sequence) FROM trial); \
         DELETE FROM trial WHERE sequence = (SELECT max(sequence) FROM trial \
         WHERE started_at_ms < (SELECT max(started_at_ms) FROM trial));"
    );
    database.change(&change).await;
    let found = compare(&people, &database).await;
    assert_eq!((found.lost, found.different, found.twice), (1, 2, 1), "{found:?}");
}

#[tokio::test]
async fn people_who_reload_repeat_vanish_and_withdraw_are_owed_the_same() {
    let folder = Folder::default();
    let database = Database::file(folder.root(), "sidestep.db");
    let server = Process::start_on(&folder, &database).await;
    let crowd = Crowd::of(&[&server]);
    let habits = Habits {
        period_s: 0.02,
        reloads: 100,
        repeats: 100,
        vanishes: 100,
        withdrawals: 40,
        seed: 3,
    };
    // All people drive to the end of their plans, or withdraw earlier.
    LocalSet::new().run_until(crowd.take_part(12, habits, 0.1, 60.0)).await;
    server.kill().await;
    assert_eq!(crowd.problems(), [""; 0]);
    let people = crowd.everybody();
    let withdrawn = people.iter().filter_map(|person| person.withdrawal);
    assert!(withdrawn.clone().any(|one| one.delete) && withdrawn.clone().any(|one| !one.delete));
    let found = compare(&people, &database).await;
    assert_eq!(found, Comparison { acknowledged: found.acknowledged, ..Comparison::default() });
    assert!(found.acknowledged > 59, "{found:?}");
}
