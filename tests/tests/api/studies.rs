//! What happens to the studies of a server when it starts.

use reqwest::Method;
use serde_json::json;
use sidestep::api::{Configuration, StudyInfo, Texts, routes};
use sidestep_tests::server::{SHORT_STUDY, with_slug};
use sidestep_tests::{Answer, Driver, Server, behind, run};

/// The slugs of the studies that the server announced at its start.
fn announced(server: &Server) -> Vec<String> {
    let text = server.announcement();
    let lines = text.lines().filter_map(|line| line.split_once("/s/"));
    lines.map(|(_, slug)| slug.to_owned()).collect()
}

#[tokio::test]
async fn a_changed_file_replaces_a_study_only_if_that_is_said() {
    let server = Server::with_study(SHORT_STUDY).await;
    let changed = with_slug(&SHORT_STUDY.replace("scenes = 3", "scenes = 2"));
    // There are no participants yet.
    let stopped = server.stop().await;
    stopped.write_study(&changed);
    let server = stopped.start().await;
    Driver::enrol(&server).await;
    let (database, site) = (server.database(), server.path("site").display().to_string());
    let stopped = server.stop().await;
    stopped.write_study(SHORT_STUDY);
    let file = stopped.path("study.toml").display().to_string();
    let args = ["serve", "--listen", "127.0.0.1:0", "--database", &database, "--static", &site];
    let said = run(&[&args[..], &["--study", &file]].concat()).await;
    said.refused(2, &["study.toml:1: slug", "1 participants", "--replace-study", "phases"]);
    let server = stopped.start_with(None, |args| args.replace_study = true).await;
    assert_eq!(Driver::enrol(&server).await.scenes().len(), 5);
}

#[tokio::test]
async fn a_restart_with_the_same_file_keeps_what_the_laboratory_changed() {
    for (enrols, made_earlier) in [(false, false), (true, false), (true, true)] {
        let mut server = Server::with_study(SHORT_STUDY).await;
        if enrols {
            Driver::enrol(&server).await;
        }
        if made_earlier {
            // A database of an earlier version does not record the source of its study versions.
            let database = server.database();
            let stopped = server.stop().await;
            behind(&database).execute("UPDATE study_version SET by_file = FALSE").await.unwrap();
            server = stopped.start().await;
        }
        let route = routes::admin_configuration("default");
        let present: Configuration = server.admin(&route).await.into(200);
        let toml = present.toml.replace("title = \"Short\"", "title = \"Edited\"");
        let draft = json!({ "toml": toml, "base": present.hash });
        let change = server.request(Method::PUT, &route).bearer_auth(&server.key).json(&draft);
        let edited: Configuration = Answer::of(change).await.into(200);
        // Also change the status, which creates no version.
        let status = server.request(Method::PUT, &routes::admin_status("default"));
        let status = status.bearer_auth(&server.key).json(&json!({ "status": "closed" }));
        Answer::of(status).await.into::<Configuration>(200);
        let server = server.restarted().await;
        let after: Configuration = server.admin(&route).await.into(200);
        assert_eq!(after.versions.len(), 2, "{:?}", after.versions);
        assert!(after.toml.contains("Edited") && after.toml.contains("closed"), "{}", after.toml);
        assert_eq!(after.versions[1].toml, edited.versions[1].toml);
        // A changed file takes effect.
        let server = server
            .restarted_with(None, |args: &mut sidestep_server::commands::serve::ServeArgs| {
                args.replace_study = true;
            })
            .await;
        let replaced: Configuration = server.admin(&route).await.into(200);
        assert!(replaced.toml.contains("Short"), "{}", replaced.toml);
    }
}

#[tokio::test]
async fn without_a_file_the_studies_stay_as_they_are() {
    let server = Server::with_study("slug = \"first\"\ntitle = \"One\"").await;
    let no_file = |args: &mut sidestep_server::commands::serve::ServeArgs| args.study = None;
    let server = server.restarted_with(None, no_file).await;
    assert_eq!(announced(&server), ["first"]);
    let stopped = server.stop().await;
    stopped.write_study("slug = \"second\"");
    let file = |args: &mut sidestep_server::commands::serve::ServeArgs| {
        args.study = args.site.as_ref().map(|site| site.with_file_name("study.toml"));
    };
    let server = stopped.start_with(None, file).await;
    assert_eq!(announced(&server), ["second", "first"]);
    let server = server.restarted_with(None, no_file).await;
    assert_eq!(announced(&server), ["second", "first"]);
    let studies = server.admin(routes::ADMIN_STUDIES).await.body;
    assert_eq!(studies.as_array().unwrap().len(), 2);
    assert_eq!(studies[0]["title"], json!("One"));
}

#[tokio::test]
async fn who_has_begun_keeps_the_study_that_they_agreed_to() {
    let question = |name: &str| {
        format!(
            "title = \"{name}\"\nphases = [{{ phase = \"task\", scenes = 1 }}]\n[[questions]]\n\
             name = \"{name}\"\nkind = \"text\"\ntext = {{ en = \"{name}?\" }}\n"
        )
    };
    let server = Server::with_study(&question("before")).await;
    let driver = Driver::enrol(&server).await;
    let server = server.restarted_with_study(&question("after")).await;
    let (study, texts) = (routes::study("default"), routes::texts("default"));
    for (token, name) in [(Some(&driver.enrolled.token), "before"), (None, "after")] {
        let ask = |route: &str| {
            let request = server.request(Method::GET, route);
            Answer::of(match token {
                Some(token) => request.bearer_auth(token),
                None => request,
            })
        };
        let info: StudyInfo = ask(&study).await.into(200);
        let texts: Texts = ask(&texts).await.into(200);
        assert_eq!((&info.title[..], &texts.questions[0].name[..]), (name, name));
    }
    let answers = json!({ "answers": { "before": "yes" } });
    assert_eq!(driver.put(&server, routes::ANSWERS, &answers).await.status, 204);
}
