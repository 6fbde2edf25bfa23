//! Studies that are set up in the laboratory.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{
    AuditPage, Change, Configuration, DraftChecked, KeyMade, StudyInfo, StudySummary, routes,
};
use sidestep::study::Status;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server};

async fn send(server: &Server, method: Method, route: &str, key: &str, body: &Value) -> Answer {
    Answer::of(server.request(method, route).bearer_auth(key).json(body)).await
}

async fn check(server: &Server, toml: &str, base: Option<&str>) -> DraftChecked {
    let draft = json!({ "toml": toml, "base": base });
    send(server, Method::POST, routes::ADMIN_DRAFTS, &server.key, &draft).await.into(200)
}

async fn make(server: &Server, toml: &str) -> Answer {
    let draft = json!({ "toml": toml });
    send(server, Method::POST, routes::ADMIN_STUDIES, &server.key, &draft).await
}

async fn change(server: &Server, slug: &str, toml: &str, base: &str) -> Answer {
    let draft = json!({ "toml": toml, "base": base });
    send(server, Method::PUT, &routes::admin_configuration(slug), &server.key, &draft).await
}

#[tokio::test]
async fn a_draft_is_checked_by_line_and_shown() {
    let server = Server::with_study(SHORT_STUDY).await;
    let wrong = check(&server, "slug = \"new\"\n[trials]\ncountdown_s = -1\n", None).await;
    let complaint = wrong.complaint.unwrap();
    assert_eq!(complaint.line, 3);
    assert!(complaint.message.starts_with("trials.countdown_s: expected"), "{complaint:?}");
    assert_eq!((wrong.picture, wrong.warnings.len()), (None, 0));
    for (text, line) in
        [("slug = ", 1), ("title = \"x\"", 1), ("slug = \"a\"\nlanguages = [\"xx\"]", 2)]
    {
        assert_eq!(check(&server, text, None).await.complaint.unwrap().line, line, "{text}");
    }
    // Texts that are missing in a language are no fault.
    let half =
        "slug = \"new\"\nlanguages = [\"en\", \"de\"]\n[consent]\ntext = { en = \"Hello.\" }\n";
    let half = check(&server, half, None).await;
    assert_eq!(half.complaint, None);
    assert_eq!(half.warnings[0].line, 4);
    assert!(half.warnings[0].message.contains("no text in de"), "{:?}", half.warnings);
    let picture = half.picture.unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("How the scenes are spread"));
    // Differences from the study of this name.
    let present: Configuration =
        server.admin(&routes::admin_configuration("default")).await.into(200);
    let same = check(&server, &present.toml, Some(&present.hash)).await;
    assert_eq!((same.complaint, same.changes), (None, Vec::new()));
    let other = present.toml.replace("title = \"Short\"", "title = \"Long\"");
    let changed = check(&server, &other, Some(&present.hash)).await;
    let title = Change {
        field: "title".into(),
        before: Some("\"Short\"".into()),
        after: Some("\"Long\"".into()),
    };
    assert_eq!(changed.changes, [title]);
}

#[tokio::test]
async fn a_study_is_made_changed_closed_and_kept_over_a_restart() {
    let server = Server::with_study(SHORT_STUDY).await;
    let new =
        "slug = \"second\"\ntitle = \"Second\"\nphases = [{ phase = \"task\", scenes = 2 }]\n";
    let made: Configuration = make(&server, new).await.into(201);
    assert_eq!((made.study.as_str(), made.participants), ("second", 0));
    make(&server, new).await.problem(409, "taken", None);
    let why = make(&server, "slug = \"third\"\nphases = 3").await;
    assert!(why.problem(422, "invalid", Some("toml")).starts_with("line 2: phases: expected"));
    // People take part at once.
    let body = json!({ "consent": true });
    let first =
        Driver { enrolled: Driver::ask_in(&server, "second", body.clone()).await.into(201) };
    assert_eq!(first.scenes().len(), 2);

    // A change is for those who come later; whoever has begun keeps what they began.
    let longer = made.toml.replace("scenes = 2", "scenes = 3");
    let changed: Configuration = change(&server, "second", &longer, &made.hash).await.into(200);
    assert_eq!(changed.participants, 1);
    assert_ne!(changed.hash, made.hash);
    let later =
        Driver { enrolled: Driver::ask_in(&server, "second", body.clone()).await.into(201) };
    assert_eq!((first.scenes().len(), later.scenes().len()), (2, 3));
    first.drive(&server, 2).await;
    // Two who edit at once: the second is told, and nothing is lost.
    let other = made.toml.replace("Second", "Other");
    change(&server, "second", &other, &made.hash).await.problem(409, "changed", None);
    let renamed = longer.replace("slug = \"second\"", "slug = \"third\"");
    change(&server, "second", &renamed, &changed.hash).await.problem(422, "invalid", Some("slug"));
    change(&server, "none", &longer, &changed.hash).await.problem(404, "not_found", None);

    let status = async |status: &str| {
        let route = routes::admin_status("second");
        send(&server, Method::PUT, &route, &server.key, &json!({ "status": status })).await
    };
    status("paused").await.problem(422, "invalid", Some("status"));
    status("closed").await.into::<Configuration>(200);
    Driver::ask_in(&server, "second", body.clone()).await.problem(403, "closed", None);
    later.drive(&server, 3).await;
    let audit: AuditPage = server.admin(routes::AUDIT).await.into(200);
    let said: Vec<_> = audit
        .entries
        .iter()
        .filter(|entry| entry.study.as_deref() == Some("second"))
        .map(|entry| (entry.action.word(), entry.subject.as_deref().unwrap_or("")))
        .collect();
    assert_eq!(
        said,
        [("study_changed", "status"), ("study_changed", "phases[0].scenes"), ("study_made", "")]
    );

    // The file of the first study is given again; both studies are as the laboratory left them.
    let route = routes::admin_status("default");
    let closed = json!({ "status": "closed" });
    let closed = send(&server, Method::PUT, &route, &server.key, &closed).await;
    closed.into::<Configuration>(200);
    let server = server.restarted().await;
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    let states: Vec<_> = studies.iter().map(|it| (it.slug.as_str(), it.status)).collect();
    assert_eq!(states, [("default", Status::Closed), ("second", Status::Closed)]);
    let info: StudyInfo = server.get(&routes::study("second")).await.into(200);
    assert_eq!(info.title, "Second");
}

#[tokio::test]
async fn who_may_not_manage_can_look_and_check_only() {
    let server = Server::with_study(SHORT_STUDY).await;
    let new = json!({ "name": "looks", "access": "export" });
    let made = send(&server, Method::POST, routes::ADMIN_KEYS, &server.key, &new).await;
    let key = made.into::<KeyMade>(201).secret;
    let draft = json!({ "toml": "slug = \"x\"" });
    send(&server, Method::POST, routes::ADMIN_DRAFTS, &key, &draft).await.into::<DraftChecked>(200);
    let configuration = routes::admin_configuration("default");
    let look = server.request(Method::GET, &configuration).bearer_auth(&key);
    assert_eq!(Answer::of(look).await.status, 200);
    send(&server, Method::POST, routes::ADMIN_STUDIES, &key, &draft)
        .await
        .problem(403, "access", None);
    send(&server, Method::PUT, &configuration, &key, &draft).await.problem(403, "access", None);
    let status = routes::admin_status("default");
    let closed = json!({ "status": "closed" });
    send(&server, Method::PUT, &status, &key, &closed).await.problem(403, "access", None);
}
