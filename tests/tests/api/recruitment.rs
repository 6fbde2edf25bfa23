//! Access to a study: quotas, closed studies, one participation per person, pilots and return
//! links.

use futures_util::future::join_all;
use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{
    Admission, Completed, ComprehensionStored, Enrolled, PilotsDeleted, Progress, StudyInfo, Texts,
    Withdrawn, routes,
};
use sidestep::study::AfterWrong;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Folder, Server, behind, run};
use std::collections::HashSet;

/// A study file with two tasks and further fields.
fn study(more: &str) -> String {
    format!("phases = [{{ phase = \"task\", scenes = 2 }}]\n{more}")
}

const RETURN: &str = r#"
[recruitment]
return_hosts = ["app.example.org"]
completed_url = "https://app.example.org/done?cc={code}&p={external_id}"
screened_out_url = "https://app.example.org/out?p={external_id}"
withdrawn_url = "https://app.example.org/left"
"#;

async fn admission(server: &Server) -> Admission {
    let info: StudyInfo = server.get(&routes::study("default")).await.into(200);
    info.admission
}

/// Moves everyone's last activity into the past.
async fn all_away_for_hours(server: &Server) {
    let db = behind(&server.database());
    db.execute("UPDATE participant SET last_seen_at_ms = last_seen_at_ms - 10000000")
        .await
        .unwrap();
}

#[tokio::test]
async fn of_fifty_at_once_ten_get_the_ten_places() {
    let server = Server::with_study(&study("[recruitment]\nquota = 10\n")).await;
    let come = (0..50).map(|_| Driver::ask(&server, json!({ "consent": true })));
    let answers = join_all(come).await;
    assert_eq!(answers.iter().filter(|answer| answer.status == 201).count(), 10);
    for refused in answers.iter().filter(|answer| answer.status != 201) {
        refused.problem(403, "full", None);
    }
    assert_eq!(admission(&server).await, Admission::Full);
    let query = "SELECT place FROM participant ORDER BY place";
    let db = behind(&server.database());
    let places: Vec<i64> = db.rows(query, |row| row.get(0)).await.unwrap();
    assert_eq!(places, (0..10).collect::<Vec<_>>());

    // Pilots do not count towards the quota. If participants withdraw, their places become free. If
    // participants stay away, their places also become free, but these participants can still
    // finish.
    assert_eq!(Driver::ask(&server, json!({ "consent": true, "pilot": true })).await.status, 201);
    let begun: Vec<_> = answers.into_iter().filter(|answer| answer.status == 201).collect();
    let begun: Vec<Driver> =
        begun.into_iter().map(|it| Driver { enrolled: it.into(201) }).collect();
    assert_eq!(begun[0].withdraw(&server, "keep").await.status, 200);
    assert_eq!(admission(&server).await, Admission::Open);
    Driver::enrol(&server).await;
    Driver::ask(&server, json!({ "consent": true })).await.problem(403, "full", None);
    all_away_for_hours(&server).await;
    assert_eq!(admission(&server).await, Admission::Open);
    begun[1].drive(&server, 2).await;
    assert_eq!(begun[1].complete(&server).await.status, 200);
    for _ in 0..9 {
        Driver::enrol(&server).await;
    }
    Driver::ask(&server, json!({ "consent": true })).await.problem(403, "full", None);
    begun[2].drive(&server, 2).await;
    assert_eq!(begun[2].complete(&server).await.status, 200);
    let held = "SELECT count(*), count(DISTINCT place) FROM participant WHERE holds_place";
    let counts: (i64, i64) = db.row(held, |row| Ok((row.get(0)?, row.get(1)?))).await.unwrap();
    assert_eq!(counts, (10, 10), "one holder a place");
}

#[tokio::test]
async fn whoever_opens_the_page_again_keeps_their_place() {
    let server = Server::with_study(&study("[recruitment]\nquota = 1\n")).await;
    let driver = Driver::enrol(&server).await;
    all_away_for_hours(&server).await;
    assert_eq!(admission(&server).await, Admission::Open);
    let _: Progress = driver.me(&server).await.into(200);
    // The visit is recorded after the response.
    while admission(&server).await == Admission::Open {
        tokio::task::yield_now().await;
    }
    Driver::ask(&server, json!({ "consent": true })).await.problem(403, "full", None);
}

#[tokio::test]
async fn the_same_place_has_the_same_scenes_and_another_place_others() {
    let server = Server::with_study(SHORT_STUDY).await;
    let scenes = |driver: &Driver| -> Vec<_> {
        driver.scenes().into_iter().map(|(_, scene)| scene).collect()
    };
    let first = Driver::enrol(&server).await;
    let second = Driver::enrol(&server).await;
    assert_ne!(scenes(&first), scenes(&second));
    first.withdraw(&server, "delete").await;
    let again = Driver::enrol(&server).await;
    assert_eq!(scenes(&again), scenes(&first));
    assert_ne!(again.scenes()[0].0, first.scenes()[0].0, "the trials are other ones");
}

#[tokio::test]
async fn a_crash_between_enrolment_and_plan_heals() {
    let server = Server::with_study(SHORT_STUDY).await;
    let body = json!({ "consent": true, "request_id": "3f0e2d6c-7a44-4c3e-9b1e-000000000009" });
    Driver::ask(&server, body.clone()).await.into::<Enrolled>(201);
    behind(&server.database()).execute("DELETE FROM scene").await.unwrap();
    let answers = join_all((0..8).map(|_| Driver::ask(&server, body.clone()))).await;
    let healed: Vec<Enrolled> = answers.into_iter().map(|answer| answer.into(200)).collect();
    assert_eq!(healed[0].plan.scenes().count(), 5);
    assert!(healed.iter().all(|enrolled| enrolled.plan == healed[0].plan));
}

#[tokio::test]
async fn one_person_is_one_participant_however_the_id_is_written() {
    let server = Server::with_study(SHORT_STUDY).await;
    let ids = ["P 1", "p 1", " P 1 ", "\u{a0}p 1"];
    let come = ids.iter().cycle().take(20);
    let come = come.map(|id| Driver::ask(&server, json!({ "consent": true, "external_id": id })));
    let answers = join_all(come).await;
    assert_eq!(answers.iter().filter(|answer| answer.status == 201).count(), 1);
    let people: HashSet<_> =
        answers.iter().map(|answer| answer.body["participant_id"].to_string()).collect();
    assert_eq!(people.len(), 1);
    for id in ["<b>", "a{code}", "a\u{202e}b", "a\nb", " ", "é", "e\u{301}"] {
        let body = json!({ "consent": true, "external_id": id });
        Driver::ask(&server, body).await.problem(422, "invalid", Some("external_id"));
    }
}

#[tokio::test]
async fn closed_and_archived_studies() {
    let server = Server::with_study(&study("")).await;
    let driver = Driver::enrol(&server).await;
    let named = json!({ "consent": true, "external_id": "ada" });
    assert_eq!(Driver::ask(&server, named.clone()).await.status, 201);
    let server = server.restarted_with_study(&format!("status = \"closed\"\n{}", study(""))).await;
    assert_eq!(admission(&server).await, Admission::Closed);
    Driver::ask(&server, json!({ "consent": true })).await.problem(403, "closed", None);
    assert_eq!(Driver::ask(&server, named.clone()).await.status, 200, "who began goes on");
    driver.drive(&server, 1).await;
    // A study can be rehearsed before it is opened.
    let pilot = json!({ "consent": true, "pilot": true });
    let pilot = Driver { enrolled: Driver::ask(&server, pilot).await.into(201) };
    pilot.drive(&server, 1).await;

    let archived = format!("status = \"archived\"\n{}", study(""));
    let server = server.restarted_with_study(&archived).await;
    assert_eq!(admission(&server).await, Admission::Archived);
    Driver::ask(&server, named).await.problem(410, "archived", None);
    let pilot = json!({ "consent": true, "pilot": true });
    Driver::ask(&server, pilot).await.problem(410, "archived", None);
    let (id, scene) = driver.scenes()[1].clone();
    let late = driver.send(&server, &id, &sidestep_tests::driven(&scene)).await;
    late.problem(410, "archived", None);
    driver.complete(&server).await.problem(410, "archived", None);
    for (route, body) in [
        (routes::COMPREHENSION, json!({ "attempts": 1, "passed": true })),
        (routes::ANSWERS, json!({ "answers": {} })),
    ] {
        driver.put(&server, route, &body).await.problem(410, "archived", None);
    }
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored.len(), 1);
    // The right to have one's data deleted does not expire.
    assert_eq!(driver.withdraw(&server, "delete").await.status, 200);
    server.get(&routes::study("none")).await.problem(404, "not_found", None);
    let none = Driver::ask_in(&server, "none", json!({ "consent": true })).await;
    none.problem(404, "not_found", None);
}

#[tokio::test]
async fn what_the_link_brought_is_stored_if_the_study_records_it() {
    let recruitment = "[recruitment]\nrecord = [\"STUDY_ID\"]\nrequire_external_id = true\n";
    let server = Server::with_study(&study(recruitment)).await;
    let nobody = json!({ "consent": true });
    Driver::ask(&server, nobody).await.problem(422, "invalid", Some("external_id"));
    let body = json!({
        "consent": true, "external_id": "P1", "locale": "de-AT",
        "parameters": { "STUDY_ID": "s-1", "email": "ada@example.org" },
    });
    Driver::ask(&server, body).await.into::<Enrolled>(201);
    let row = behind(&server.database())
        .row(
            "SELECT parameters, consent_language, length(consent_hash), external_id, external_key \
             FROM participant",
            |row| {
                let text = |i: usize| row.get::<String>(i);
                Ok((text(0)?, text(1)?, row.get::<i64>(2)?, text(3)?, text(4)?))
            },
        )
        .await
        .unwrap();
    let text = |text: &str| text.to_owned();
    assert_eq!(row, (text("{\"STUDY_ID\":\"s-1\"}"), text("de"), 64, text("P1"), text("p1")));
}

#[tokio::test]
async fn wrong_answers_too_often_end_a_participation() {
    let server =
        Server::with_study(&study(&format!("{RETURN}[comprehension]\nattempts = 2\n"))).await;
    let body = json!({ "consent": true, "external_id": "a/b" });
    let driver = Driver { enrolled: Driver::ask(&server, body.clone()).await.into(201) };
    let check = async |driver: &Driver, attempts: usize, passed: bool| {
        let body = json!({ "attempts": attempts, "passed": passed });
        driver.put(&server, routes::COMPREHENSION, &body).await
    };
    let me: Progress = driver.me(&server).await.into(200);
    assert!(!me.understood);
    check(&driver, 0, true).await.problem(422, "invalid", Some("attempts"));
    let stored: ComprehensionStored = check(&driver, 1, false).await.into(200);
    assert_eq!(
        stored,
        ComprehensionStored {
            screened_out: false,
            after_wrong: AfterWrong::Mark,
            return_url: None
        }
    );
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!((me.comprehension_attempts, me.understood), (1, false));
    for _ in 0..2 {
        let ended: ComprehensionStored = check(&driver, 2, false).await.into(200);
        let url = "https://app.example.org/out?p=a%2Fb".to_owned();
        assert_eq!(
            ended,
            ComprehensionStored {
                screened_out: true,
                after_wrong: AfterWrong::Mark,
                return_url: Some(url)
            }
        );
    }
    // A participant who returns, in this browser or another, gets the return link.
    for refused in [driver.me(&server).await, driver.complete(&server).await] {
        refused.problem(410, "screened_out", None);
        assert_eq!(refused.body["return_url"], "https://app.example.org/out?p=a%2Fb");
    }
    let refused = Driver::ask(&server, body).await;
    refused.problem(410, "screened_out", None);
    assert_eq!(refused.body["return_url"], "https://app.example.org/out?p=a%2Fb");
    // The place is free, and a participant who passes the check can continue.
    let next = Driver::enrol(&server).await;
    let scene = |driver: &Driver| driver.scenes()[0].1.clone();
    assert_eq!(scene(&next), scene(&driver));
    check(&next, 2, true).await.into::<ComprehensionStored>(200);
    let me: Progress = next.me(&server).await.into(200);
    assert!(me.understood);
    // A participant who drives has passed the check.
    next.drive(&server, 1).await;
    let late: ComprehensionStored = check(&next, 1_000, false).await.into(200);
    assert!(!late.screened_out);
}

const QUESTIONS: &str = r#"
[[questions]]
name = "age"
kind = "scale"
from = 18
to = 30
required = true
text = { en = "How old are you?" }
[[questions]]
name = "hand"
kind = "choice"
text = { en = "Which hand?" }
options = [{ value = "left", text = { en = "Left" } }, { value = "right", text = { en = "Right" } }]
[[questions]]
name = "words"
kind = "text"
max_chars = 5
text = { en = "Anything else?" }
"#;

#[tokio::test]
async fn answers_are_checked_replaced_and_kept() {
    let server = Server::with_study(&study(&format!("{QUESTIONS}{RETURN}"))).await;
    let body = json!({ "consent": true, "external_id": "P1" });
    let driver = Driver { enrolled: Driver::ask(&server, body).await.into(201) };
    let put = async |answers: Value| {
        driver.put(&server, routes::ANSWERS, &json!({ "answers": answers })).await
    };
    for (answers, field) in [
        (json!({}), "answers.age"),
        (json!({ "age": "20" }), "answers.age"),
        (json!({ "age": 31 }), "answers.age"),
        (json!({ "age": 20.5 }), "answers.age"),
        (json!({ "age": null }), "answers.age"),
        (json!({ "age": 20, "hand": "both" }), "answers.hand"),
        (json!({ "age": 20, "hand": ["left"] }), "answers.hand"),
        (json!({ "age": 20, "words": "six ch" }), "answers.words"),
        (json!({ "age": 20, "name": "Ada" }), "answers"),
    ] {
        put(answers.clone()).await.problem(422, "invalid", Some(field));
    }
    driver.drive(&server, 2).await;
    driver.complete(&server).await.problem(409, "unanswered", None);
    let me: Progress = driver.me(&server).await.into(200);
    assert!(!me.answered);
    assert_eq!(put(json!({ "age": 20, "words": "hello" })).await.status, 204);
    assert_eq!(put(json!({ "age": 21, "hand": "left" })).await.status, 204);
    let done: Completed = driver.complete(&server).await.into(200);
    let url = format!("https://app.example.org/done?cc={}&p=P1", done.completion_code);
    assert_eq!(done.return_url.as_deref(), Some(&url[..]));
    assert_eq!(put(json!({ "age": 21, "hand": "left" })).await.status, 204, "the same again");
    put(json!({ "age": 22 })).await.problem(409, "complete", None);
    let twice = r#"{"answers":{"age":21,"age":21,"hand":"left"}}"#;
    let request = driver.request(&server, Method::PUT, routes::ANSWERS);
    let request = request.header("content-type", "application/json").body(twice);
    Answer::of(request).await.problem(422, "invalid", Some(""));
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!((me.answered, me.return_url), (true, Some(url)));
    let query = "SELECT answers FROM participant";
    let stored: String = behind(&server.database()).row(query, |row| row.get(0)).await.unwrap();
    assert_eq!(stored, "{\"age\":21,\"hand\":\"left\"}");
    let left: Withdrawn = driver.withdraw(&server, "delete").await.into(200);
    assert_eq!(left.return_url.as_deref(), Some("https://app.example.org/left"));
    let stored: Option<String> =
        behind(&server.database()).row(query, |row| row.get(0)).await.unwrap();
    assert_eq!(stored, None);
}

#[tokio::test]
async fn researchers_find_codes_ids_and_answers_in_the_table_of_participants() {
    let recruitment = "[recruitment]\nrecord = [\"STUDY_ID\"]\n";
    let server = Server::with_study(&study(&format!("{QUESTIONS}{recruitment}"))).await;
    let body = json!({
        "consent": true, "external_id": "=P1", "locale": "de",
        "parameters": { "STUDY_ID": "s-1" },
    });
    let driver = Driver { enrolled: Driver::ask(&server, body).await.into(201) };
    driver.drive(&server, 2).await;
    let answers = json!({ "answers": { "age": 21, "words": "-1+1" } });
    assert_eq!(driver.put(&server, routes::ANSWERS, &answers).await.status, 204);
    let code: Completed = driver.complete(&server).await.into(200);
    Driver::enrol(&server).await;
    Driver::ask(&server, json!({ "consent": true, "pilot": true })).await.into::<Enrolled>(201);

    let folder = Folder::default();
    let (database, out) = (server.database(), folder.name("data"));
    run(&["export", "--database", &database, "--study", "default", "--out", &out]).await.json();
    let table = folder.text("data/participants.csv");
    let route = format!("{}?format=csv", routes::admin_participants("default"));
    let answer = server.request(Method::GET, &route).bearer_auth(&server.key).send().await.unwrap();
    assert_eq!(answer.text().await.unwrap(), table);
    server.get(&route).await.problem(401, "unauthorized", None);
    let lines: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 3, "no pilot");
    let cell = |name: &str| {
        let at = lines[0].iter().position(|column| *column == name).expect(name);
        (lines[1][at], lines[2][at])
    };
    for (name, cells) in [
        ("participant", ("1", "2")),
        // A spreadsheet does not interpret any of these as a formula.
        ("external_id", ("'=P1", "")),
        ("completion_code", (&code.completion_code, "")),
        ("place", ("0", "1")),
        ("task", ("2", "0")),
        // The questions exist only in English, so the study is offered only in English.
        ("consent_language", ("en", "")),
        ("parameter_STUDY_ID", ("s-1", "")),
        ("answer_age", ("21", "")),
        ("answer_hand", ("", "")),
        ("answer_words", ("'-1+1", "")),
        ("study", ("default", "default")),
    ] {
        assert_eq!(cell(name), cells, "{name}");
    }
    // Every column of each table is documented.
    let dictionary: Value = serde_json::from_str(&folder.text("data/dictionary.json")).unwrap();
    let named = |file: &str| -> Vec<&str> {
        let columns = dictionary.as_array().unwrap().iter();
        let columns = columns.filter(|column| column["file"] == file);
        columns.map(|column| column["name"].as_str().unwrap()).collect()
    };
    assert_eq!(named("participants.csv"), lines[0]);
    for name in ["steps.csv", "trials.csv", "key_events.csv"] {
        let table = folder.text(&format!("data/{name}"));
        let header: Vec<_> = table.lines().next().unwrap().split(',').collect();
        assert_eq!(named(name), header);
    }
    let hand = dictionary.as_array().unwrap().iter().find(|c| c["name"] == "answer_hand").unwrap();
    assert_eq!(
        (&hand["range"], &hand["meaning"]),
        (&json!("left, right"), &json!("answer to: Which hand?"))
    );
}

#[tokio::test]
async fn pilots_are_kept_apart_and_can_be_deleted() {
    let server = Server::with_study(&study(RETURN)).await;
    let body = json!({ "consent": true, "external_id": "ada", "pilot": true });
    let pilots: Vec<Driver> = join_all((0..2).map(|_| Driver::ask(&server, body.clone())))
        .await
        .into_iter()
        .map(|answer| Driver { enrolled: answer.into(201) })
        .collect();
    let pilot = &pilots[0];
    pilot.drive(&server, 2).await;
    let done: Completed = pilot.complete(&server).await.into(200);
    assert!(done.completion_code.starts_with("PILOT-") && done.return_url.is_none(), "{done:?}");
    let me: Progress = pilot.me(&server).await.into(200);
    assert!(me.pilot && me.return_url.is_none());
    // The same person takes part for real, as participant number 1 with the first place.
    let real = json!({ "consent": true, "external_id": "ada" });
    let driver = Driver { enrolled: Driver::ask(&server, real).await.into(201) };
    driver.drive(&server, 1).await;
    let export = server.export("default").await;
    assert_eq!(export.lines().count(), 51);
    assert!(export.lines().nth(1).unwrap().starts_with("1,0,0,"));
    // By default, an export contains no data of pilots. With `--pilots`, it contains nothing else.
    let (folder, database) = (Folder::default(), server.database());
    let args = ["export", "--database", &database, "--out", &folder.name("data")];
    for (more, rows) in [(&[][..], [50, 1, 1]), (&["--pilots"], [100, 2, 2])] {
        let said = run(&[&args[..], more].concat()).await.json();
        let found = [0, 1, 3].map(|file| said["files"][file]["rows"].as_u64().unwrap());
        assert_eq!(found, rows);
    }
    let studies = server.admin(routes::ADMIN_STUDIES).await.body;
    assert_eq!((&studies[0]["participants"], &studies[0]["trials"]), (&json!(1), &json!(1)));
    let trials = server.admin(&routes::admin_trials("default")).await.body;
    assert_eq!(trials["trials"].as_array().unwrap().len(), 1);
    // No data of deleted pilots remain.
    let delete = |key: &str| {
        Answer::of(
            server.request(Method::DELETE, &routes::admin_pilots("default")).bearer_auth(key),
        )
    };
    delete(&driver.enrolled.token).await.problem(401, "unauthorized", None);
    for deleted in [2, 0] {
        let answer: PilotsDeleted = delete(&server.key).await.into(200);
        assert_eq!(answer, PilotsDeleted { deleted });
    }
    pilot.me(&server).await.problem(401, "unauthorized", None);
    assert_eq!(server.export("default").await, export);
}

const ENDS: &str = r#"
[recruitment]
quota = 1
return_hosts = ["app.example.org"]
completed_url = "https://app.example.org/done?cc={code}"
withdrawn_url = "https://app.example.org/left"
finished_url = "https://app.example.org/again?p={external_id}"
full_url = "https://app.example.org/full"
closed_url = "https://app.example.org/closed?p={external_id}"
"#;

/// The admission and return link that the page gets before consent. `id` is an external id, or
/// empty for a new person.
async fn standing(server: &Server, id: &str) -> (Admission, Option<String>) {
    let query = if id.is_empty() { String::new() } else { format!("?external_id={id}") };
    let info: StudyInfo = server.get(&(routes::study("default") + &query)).await.into(200);
    (info.admission, info.return_url)
}

#[tokio::test]
async fn whoever_cannot_take_part_learns_it_and_the_way_back_before_consent() {
    let url = |path: &str| Some(format!("https://app.example.org/{path}"));
    let server = Server::with_study(&study(ENDS)).await;
    assert_eq!(standing(&server, "P1").await, (Admission::Open, None));
    let body = json!({ "consent": true, "external_id": "P1" });
    let driver = Driver { enrolled: Driver::ask(&server, body.clone()).await.into(201) };
    // The only place is taken, but the participant who has begun can continue.
    assert_eq!(standing(&server, "p1").await, (Admission::Open, None));
    for id in ["", "P2"] {
        assert_eq!(standing(&server, id).await, (Admission::Full, url("full")));
    }
    let refused = Driver::ask(&server, json!({ "consent": true, "external_id": "P2" })).await;
    refused.problem(403, "full", None);
    assert_eq!(refused.body["return_url"], "https://app.example.org/full");
    driver.drive(&server, 2).await;
    let done: Completed = driver.complete(&server).await.into(200);
    // A person who knows only the id gets the return link, but neither the code nor the link with
    // the code.
    assert_eq!(standing(&server, "%20P1").await, (Admission::Finished, url("again?p=P1")));
    let again = Driver { enrolled: Driver::ask(&server, body).await.into(200) };
    let other: Progress = again.me(&server).await.into(200);
    assert_eq!((other.complete, other.completion_code), (true, None));
    assert_eq!(other.return_url, url("again?p=P1"));
    again.complete(&server).await.problem(403, "not_yours", None);
    again.withdraw(&server, "delete").await.problem(403, "not_yours", None);
    // The code and the link with the code belong to the token of the browser that enrolled.
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.completion_code.as_deref(), Some(&*done.completion_code));
    assert_eq!(me.return_url, done.return_url);
    assert_eq!(driver.withdraw(&server, "keep").await.status, 200);
    assert_eq!(standing(&server, "P1").await, (Admission::Withdrawn, url("left")));
    let wrong = server.get(&(routes::study("default") + "?external_id=%3Cb%3E")).await;
    wrong.problem(422, "invalid", Some("external_id"));

    for (status, code, admission) in
        [("closed", 403, Admission::Closed), ("archived", 410, Admission::Archived)]
    {
        let text = format!("status = \"{status}\"\n{}", study(ENDS));
        let server = Server::with_study(&text).await;
        // The return link contains the external id, so there is no link without an id.
        assert_eq!(standing(&server, "").await, (admission, None));
        assert_eq!(standing(&server, "P3").await, (admission, url("closed?p=P3")));
        let refused = Driver::ask(&server, json!({ "consent": true, "external_id": "P3" })).await;
        refused.problem(code, status, None);
        assert_eq!(refused.body["return_url"], "https://app.example.org/closed?p=P3");
    }
}

#[tokio::test]
async fn a_check_of_understanding_is_drawn_for_each_attempt() {
    let more = "[comprehension]\ndraw = 2\nafter_wrong = \"renew\"\nattempts = 20\n";
    let server = Server::with_study(&study(more)).await;
    let asked = async |driver: &Driver| -> Vec<Vec<String>> {
        let url = routes::texts("default");
        let texts: Texts = driver.get(&server, &url).await.into(200);
        let forms = texts.check.into_iter();
        forms
            .map(|form| {
                let mut words = vec![form.text, form.options[form.answer].clone()];
                words.extend(form.options);
                words
            })
            .collect()
    };
    let driver = Driver::enrol(&server).await;
    let mut seen = HashSet::new();
    let mut right = HashSet::new();
    for attempts in 1..20 {
        let forms = asked(&driver).await;
        assert_eq!(forms, asked(&driver).await, "a reload changes nothing");
        assert_eq!(forms.len(), 2);
        right.extend(forms.iter().map(|form| (form[0].clone(), form[1].clone())));
        seen.insert(forms);
        let body = json!({ "attempts": attempts, "passed": false });
        let stored: ComprehensionStored =
            driver.put(&server, routes::COMPREHENSION, &body).await.into(200);
        assert_eq!((stored.screened_out, stored.after_wrong), (false, AfterWrong::Renew));
    }
    // There are six questions, each with one right answer, for any order of the options.
    assert_eq!(right.len(), 6, "{right:?}");
    assert!(seen.len() > 15, "{}", seen.len());
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.comprehension_attempts, 19);
    // The number of questions is known before enrolment.
    let texts: Texts = server.get(&routes::texts("default")).await.into(200);
    assert_eq!(texts.check.len(), 2);
}

#[tokio::test]
async fn whoever_began_in_a_language_goes_on_in_it() {
    let server = Server::with_study(&study("")).await;
    let body = json!({ "consent": true, "locale": "es" });
    let driver = Driver { enrolled: Driver::ask(&server, body).await.into(201) };
    // Store the configuration as an earlier version did. It offers all languages, but has a consent
    // text only in English.
    behind(&server.database())
        .execute(
            "UPDATE study_config SET json = replace(json, '\"text\":{}', '\"text\":{\"en\":\"Hello\"}')",
        ).await
        .unwrap();
    let server = server.restarted_with_study(&study("[consent.text]\nen = \"Hello\"\n")).await;
    let url = routes::texts("default") + "?language=es";
    let tags = |texts: &Texts| texts.offered.iter().map(|it| it.tag.clone()).collect::<Vec<_>>();
    let new: Texts = server.get(&url).await.into(200);
    assert_eq!((&*new.language, tags(&new)), ("en", vec!["en".to_owned()]));
    let mine: Texts = driver.get(&server, &url).await.into(200);
    assert_eq!((&*mine.language, tags(&mine)), ("es", vec!["en".to_owned(), "es".to_owned()]));
}
