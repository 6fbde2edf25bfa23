//! What knowledge of an external id permits, and what it does not.

use serde_json::json;
use sidestep::api::{Completed, ComprehensionStored, Enrolled, Progress, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server, behind, driven};

async fn enrolled(server: &Server, request: &str, status: u16) -> Driver {
    let body = json!({
        "consent": true, "external_id": "leaver-77", "request_id": format!("a-request-called-{request}"),
        "locale": "en", "parameters": { "SESSION_ID": "session-77" }, "screen": { "note": "screen-77" },
    });
    let enrolled: Enrolled = Driver::ask(server, body).await.into(status);
    Driver { enrolled }
}

#[tokio::test]
async fn who_knows_the_external_id_goes_on_and_sees_and_deletes_nothing() {
    let server = Server::with_study(SHORT_STUDY).await;
    let owner = enrolled(&server, "mine", 201).await;
    owner.drive(&server, 2).await;
    let other = enrolled(&server, "other", 200).await;
    for data in ["keep", "delete"] {
        other.withdraw(&server, data).await.problem(403, "not_yours", None);
    }
    let me: Progress = other.me(&server).await.into(200);
    assert!(!me.may_withdraw && me.stored.len() == 2);
    // The owner and the other client can store trials. The owner finishes, and only the owner sees
    // the code.
    let scenes = owner.scenes();
    let send = async |driver: &Driver, i: usize| {
        driver.send(&server, &scenes[i].0, &driven(&scenes[i].1)).await.status
    };
    assert_eq!(
        (send(&other, 2).await, send(&owner, 3).await, send(&other, 4).await),
        (201, 201, 201)
    );
    let code: Completed = owner.complete(&server).await.into(200);
    other.complete(&server).await.problem(403, "not_yours", None);
    let me: Progress = other.me(&server).await.into(200);
    assert_eq!((me.complete, me.completion_code), (true, None));
    // A request with the same request id comes from the browser that enrolled.
    let again = enrolled(&server, "mine", 200).await;
    let me: Progress = again.me(&server).await.into(200);
    assert_eq!((me.may_withdraw, me.completion_code), (true, Some(code.completion_code)));
    assert_eq!(again.withdraw(&server, "delete").await.status, 200);
    other.me(&server).await.problem(410, "withdrawn", None);
}

#[tokio::test]
async fn who_finishes_on_another_computer_gets_the_code_there() {
    let server = Server::with_study(SHORT_STUDY).await;
    let owner = enrolled(&server, "mine", 201).await;
    owner.drive(&server, 5).await;
    let other = enrolled(&server, "other", 200).await;
    let code: Completed = other.complete(&server).await.into(200);
    for driver in [&other, &owner] {
        assert_eq!(driver.complete(&server).await.into::<Completed>(200), code);
        let me: Progress = driver.me(&server).await.into(200);
        assert_eq!(me.completion_code.as_ref(), Some(&code.completion_code));
    }
    let third = enrolled(&server, "third", 200).await;
    third.complete(&server).await.problem(403, "not_yours", None);
}

#[tokio::test]
async fn who_knows_the_external_id_ends_and_replaces_nothing() {
    let study = format!(
        "{SHORT_STUDY}\n[comprehension]\nattempts = 2\n\n\
         [[questions]]\nname = \"words\"\nkind = \"text\"\ntext = {{ en = \"How was it?\" }}\n"
    );
    let server = Server::with_study(&study).await;
    let owner = enrolled(&server, "mine", 201).await;
    let other = enrolled(&server, "other", 200).await;
    let check = async |driver: &Driver, attempts: usize, passed: bool| {
        let body = json!({ "attempts": attempts, "passed": passed });
        let stored = driver.put(&server, routes::COMPREHENSION, &body).await;
        stored.into::<ComprehensionStored>(200).screened_out
    };
    // A call counts as one attempt, even if it states more attempts. An attempt by the other client
    // does not count as the owner's, and can end the participation only for the other client.
    assert!(!check(&other, 1_000, false).await);
    let attempts = async |driver: &Driver| {
        let me: Progress = driver.me(&server).await.into(200);
        (me.comprehension_attempts, me.understood)
    };
    assert_eq!((attempts(&other).await, attempts(&owner).await), ((1, false), (0, false)));
    for passed in [false, true] {
        assert!(check(&other, 1_000, passed).await, "{passed}");
    }
    assert!(!check(&owner, 1, false).await);
    assert!(!check(&owner, 2, true).await);
    assert_eq!(attempts(&owner).await, (2, true));
    let answer = async |driver: &Driver, words: &str| {
        let body = json!({ "answers": { "words": words } });
        driver.put(&server, routes::ANSWERS, &body).await
    };
    for words in ["fine", "good"] {
        assert_eq!(answer(&owner, words).await.status, 204);
    }
    assert_eq!(answer(&other, "good").await.status, 204, "the same again");
    answer(&other, "bad").await.problem(409, "answered", None);
}

#[tokio::test]
async fn deletion_leaves_a_number_and_nothing_in_the_file() {
    let server = Server::on_a_file(SHORT_STUDY).await;
    let owner = enrolled(&server, "mine", 201).await;
    owner.drive(&server, 5).await;
    let code: Completed = owner.complete(&server).await.into(200);
    let words =
        ["leaver-77", "session-77", "screen-77", &code.completion_code, &owner.scenes()[0].0];
    let found = || -> Vec<&str> {
        let read = |name: &str| std::fs::read(server.path(name)).unwrap();
        let bytes = [read("sidestep.db"), read("sidestep.db-wal")].concat();
        let is_there =
            |word: &&str| bytes.windows(word.len()).any(|window| window == word.as_bytes());
        words.into_iter().filter(is_there).collect()
    };
    assert_eq!(found(), words);
    assert_eq!(owner.withdraw(&server, "delete").await.status, 200);
    // The write-ahead log is emptied as soon as no reader uses it.
    for _ in 0..50 {
        if found().is_empty() {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    }
    assert_eq!(found(), [""; 0]);
    let studies = server.admin(sidestep::api::routes::ADMIN_STUDIES).await.body;
    assert_eq!((&studies[0]["participants"], &studies[0]["trials"]), (&json!(1), &json!(0)));
    let row = "SELECT json_array(number, enrolled_at_ms > 0, withdrawn_at_ms > 0, last_seen_at_ms = \
                   withdrawn_at_ms, external_id, external_key, locale, answers, place, seed, \
                   screened_out_at_ms, understood_at_ms, completed_at_ms) FROM participant";
    let tokens = "SELECT json_group_array(completed) FROM participant_token \
                  JOIN participant ON participant.id = participant_id AND created_at_ms = enrolled_at_ms";
    let asked = async |query| -> String {
        behind(&server.database()).row(query, |row| row.get(0)).await.unwrap()
    };
    assert_eq!(asked(row).await, "[1,1,1,1,null,null,null,null,null,null,null,null,null]");
    assert_eq!(asked(tokens).await, "[0]");
    // The external id is now unknown, so the same person can begin again.
    enrolled(&server, "mine", 201).await;
}

#[tokio::test]
async fn deletion_after_being_screened_out_leaves_no_trace_of_it() {
    let study = format!("{SHORT_STUDY}\n[comprehension]\nattempts = 1\n");
    let server = Server::with_study(&study).await;
    let driver = enrolled(&server, "mine", 201).await;
    let wrong = json!({ "attempts": 1, "passed": false });
    driver.put(&server, routes::COMPREHENSION, &wrong).await.into::<ComprehensionStored>(200);
    assert_eq!(driver.withdraw(&server, "delete").await.status, 200);
    let query = "SELECT count(*) FROM participant WHERE screened_out_at_ms IS NOT NULL";
    let count: i64 = behind(&server.database()).row(query, |row| row.get(0)).await.unwrap();
    assert_eq!(count, 0);
}
