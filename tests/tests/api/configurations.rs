//! Creating and changing studies in the laboratory.

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
    assert_eq!((complaint.line, complaint.field.as_deref()), (Some(3), Some("trials.countdown_s")));
    assert!(complaint.message.starts_with("trials.countdown_s: expected"), "{complaint:?}");
    assert_eq!((wrong.picture, wrong.warnings.len()), (None, 0));
    for (text, line) in
        [("slug = ", 1), ("title = \"x\"", 1), ("slug = \"a\"\nlanguages = [\"xx\"]", 2)]
    {
        assert_eq!(check(&server, text, None).await.complaint.unwrap().line, Some(line), "{text}");
    }
    // A missing translation is only a warning.
    let half =
        "slug = \"new\"\nlanguages = [\"en\", \"de\"]\n[consent]\ntext = { en = \"Hello.\" }\n";
    let half = check(&server, half, None).await;
    assert_eq!(half.complaint, None);
    assert_eq!(half.warnings[0].line, Some(4));
    assert!(half.warnings[0].message.contains("no text in de"), "{:?}", half.warnings);
    let text =
        "slug = \"a\"\n[recruitment]\nexternal_id = [\"PROLIFIC_PID\"]\nrequire_external_id = true";
    let paid = check(&server, text, None).await;
    let [warning] = &paid.warnings[..] else { panic!("{:?}", paid.warnings) };
    assert_eq!(
        (paid.complaint, warning.field.as_deref()),
        (None, Some("recruitment.completed_url"))
    );
    assert!(warning.message.contains("completion code"), "{warning:?}");
    let picture = half.picture.unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("How the scenes are spread"));
    // The draft is compared with the study of the same slug.
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
async fn a_form_is_checked_by_field_and_written_as_a_study_file() {
    let server = Server::with_study(SHORT_STUDY).await;
    let send_form = async |config: &Value| -> DraftChecked {
        let draft = json!({ "config": config, "base": "x" });
        send(&server, Method::POST, routes::ADMIN_FORM_DRAFTS, &server.key, &draft).await.into(200)
    };
    let present: Configuration =
        server.admin(&routes::admin_configuration("default")).await.into(200);
    let shown = check(&server, &present.toml, None).await;
    assert_eq!(shown.languages[0], "en");
    let config = shown.config.unwrap();
    // A form without changes gives the same study file.
    let same = send_form(&config).await;
    assert_eq!((same.toml.as_deref(), same.complaint), (Some(present.toml.as_str()), None));
    assert!(same.changes.is_empty() && same.picture.is_some());

    let mut entered = config.clone();
    entered["title"] = json!("Entered");
    entered["phases"][0]["scenes"] = json!(3);
    entered["consent"]["text"]["zh-CN"] = json!("你好");
    let written = send_form(&entered).await;
    assert_eq!(written.complaint, None);
    let fields: Vec<_> = written.changes.iter().map(|change| change.field.as_str()).collect();
    assert_eq!(fields, ["consent.text.zh-CN", "phases[0].scenes", "title"]);
    let read = check(&server, &written.toml.unwrap(), Some(&present.hash)).await;
    assert_eq!((read.complaint, read.config), (None, Some(entered)));

    // For every invalid input, the complaint names the field, and the form keeps its content.
    for (path, value, in_text) in [
        ("/phases/0/scenes", json!(0), true),
        ("/phases/0/scenes", json!(null), false),
        ("/phases/0/scenes", json!(2.5), false),
        ("/title", json!("   "), true),
        ("/parameters/human/speed_mps", json!("fast"), false),
        ("/parameters/human/turn_rate_radps", json!(28.6), true),
        ("/trials/countdown_s", json!(-1), false),
        ("/recruitment/completed_url", json!("http://x"), true),
    ] {
        let mut entered = config.clone();
        *entered.pointer_mut(path).unwrap() = value.clone();
        let checked = send_form(&entered).await;
        let complaint = checked.complaint.unwrap();
        let field = complaint.field.as_deref().unwrap_or_default();
        let expected = path[1..].replace("/0/", "[0].").replace('/', ".");
        assert_eq!(field, expected, "{complaint:?}");
        assert!(complaint.message.starts_with(field), "{complaint:?}");
        assert_eq!((complaint.line.is_some(), checked.toml.is_some()), (in_text, in_text));
        assert!(checked.config.is_some(), "{path}");
    }
    // If a field has no number or an invalid one, the complaint states the valid range.
    for (path, value, expected) in [
        ("/phases/0/scenes", json!(null), "a whole number from 1 to 1000, found nothing"),
        ("/phases/0/scenes", json!(2.5), "a whole number from 1 to 1000, found 2.5"),
        ("/trials/end_s", json!(null), "found nothing"),
    ] {
        let mut entered = config.clone();
        *entered.pointer_mut(path).unwrap() = value;
        let said = send_form(&entered).await.complaint.unwrap().message;
        assert!(said.ends_with(expected) && said.contains(" to "), "{said}");
    }
    // A draft without a base is a new study, which needs an unused slug.
    let taken = check(&server, &present.toml, None).await.complaint.unwrap();
    assert_eq!(taken.field.as_deref(), Some("slug"));
    assert!(taken.message.contains("a name that no study has"), "{taken:?}");
    // TOML cannot represent this number.
    let mut entered = config.clone();
    entered["recruitment"]["quota"] = json!(u64::MAX);
    let complaint = send_form(&entered).await.complaint.unwrap();
    assert!(!complaint.message.is_empty() && !complaint.message.contains('\n'), "{complaint:?}");
    // A text that parses as a study has a form, even if the study is invalid. Any other text has no
    // form.
    let invalid = check(&server, "slug = \"a\"\n[trials]\ncountdown_s = 99\n", None).await;
    assert_eq!(invalid.config.unwrap()["trials"]["countdown_s"], 99);
    for text in ["slug = ", "slug = \"a\"\ncolour = 1", "slug = \"a\"\n[trials]\nend_s = nan"] {
        let checked = check(&server, text, None).await;
        assert_eq!((checked.config, checked.complaint.is_some()), (None, true), "{text}");
    }
    let unknown = json!({ "config": {}, "form": 1 });
    let answer = send(&server, Method::POST, routes::ADMIN_FORM_DRAFTS, &server.key, &unknown);
    answer.await.problem(422, "invalid", Some("form"));
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
    assert_eq!((made.versions.len(), made.versions[0].number), (1, 1));
    // People can take part immediately.
    let body = json!({ "consent": true });
    let first =
        Driver { enrolled: Driver::ask_in(&server, "second", body.clone()).await.into(201) };
    assert_eq!(first.scenes().len(), 2);

    // A change applies to later participants; those who have begun keep their configuration.
    let longer = made.toml.replace("scenes = 2", "scenes = 3");
    let changed: Configuration = change(&server, "second", &longer, &made.hash).await.into(200);
    assert_eq!(changed.participants, 1);
    assert_ne!(changed.hash, made.hash);
    let [new, old] = &changed.versions[..] else { panic!("{:?}", changed.versions) };
    assert_eq!((new.number, new.participants, &new.hash), (2, 0, &changed.hash));
    assert_eq!(new.changed, ["phases[0].scenes"]);
    assert_eq!((old.number, old.participants, &old.hash), (1, 1, &made.hash));
    assert_eq!((&old.toml, old.changed.len()), (&made.toml, 0));
    let later =
        Driver { enrolled: Driver::ask_in(&server, "second", body.clone()).await.into(201) };
    assert_eq!((first.scenes().len(), later.scenes().len()), (2, 3));
    first.drive(&server, 2).await;
    // Of two concurrent edits, the second is refused, and nothing is lost.
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

    // The restarted server gets the file of the first study again, but both studies stay as the
    // laboratory left them.
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
